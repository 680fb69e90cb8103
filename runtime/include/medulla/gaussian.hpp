// The two Gaussians of the unscattered lobes, each with its density and its sampler: truncated in theta, wrapped in
// phi. Rests on Eqs. 5 and 7 of Yan et al. 2017; docs/bcsdf.md says why truncated and how the sums converge.
#pragma once

#include <cmath>
#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/real_math.hpp"

namespace medulla {

namespace detail {

/// exp(x^2) erfc(x) for x >= 0, float precision: direct up to 5, then six terms of the asymptotic series
/// (the seventh is 7e-7 of the sum at x = 5).
template <class T>
MEDULLA_FN T scaled_erfc(T x) noexcept {
    using std::erfc;
    using std::exp;
    if (x < T(5)) return exp(x * x) * erfc(x);
    const T u = T(0.5) / (x * x);
    const T sum = T(1) - u * (T(1) - T(3) * u * (T(1) - T(5) * u * (T(1) - T(7) * u * (T(1) - T(9) * u))));
    return sum / (x * T(1.7724538509055160));
}

/// Mass of the standard normal over [near, near + w], near, w >= 0, divided by exp(-near^2 / 2). Kept scaled, a lobe
/// whose centre lies far outside the interval still has a mass that is no underflow.
template <class T>
MEDULLA_FN T scaled_tail_mass(T near, T w) noexcept {
    using std::exp;
    const T root_half = T(0.70710678118654752);
    const T far = near + w;
    // Short against the tail's length 1 / far: the two tails would cancel, so the density is integrated by four Gauss
    // nodes, which are exact to float for an exponent that changes by at most 1.
    if (w * (far + T(1)) < T(1)) {
        const T x[2] = {T(0.43056815579702629), T(0.16999052179242813)};
        const T c[2] = {T(0.17392742256872693), T(0.32607257743127307)};
        T sum = T(0);
        for (int i = 0; i < 2; ++i) {
            const T p = w * (T(0.5) + x[i]), q = w * (T(0.5) - x[i]);
            sum = sum + c[i] * (exp(-p * (near + T(0.5) * p)) + exp(-q * (near + T(0.5) * q)));
        }
        return sum * w * T(0.39894228040143268);
    }
    const T tail = exp(T(-0.5) * w * (far + near));
    return T(0.5) * (scaled_erfc(near * root_half) - (tail > T(0) ? tail * scaled_erfc(far * root_half) : T(0)));
}

/// Mass of the standard normal between 0 and z >= 0.
template <class T>
MEDULLA_FN T normal_half_mass(T z) noexcept {
    using std::erf;
    return T(0.5) * erf(z * T(0.70710678118654752));
}
/// Abramowitz and Stegun 7.1.26: absolute error 1e-7, and the masses it is used for are not small. For float or Four.
template <class V>
MEDULLA_FN V normal_half_mass_series(V z) noexcept {
    const V x = z * V(0.70710678f), t = V(1.0f) / (V(1.0f) + V(0.3275911f) * x);
    const V p = t * (V(0.254829592f) +
                     t * (V(-0.284496736f) + t * (V(1.421413741f) + t * (V(-1.453152027f) + t * V(1.061405429f)))));
    return V(0.5f) - V(0.5f) * p * real_math::exponential(-x * x);
}
MEDULLA_FN float normal_half_mass(float z) noexcept { return normal_half_mass_series(z); }
MEDULLA_FN Four normal_half_mass(Four z) noexcept { return normal_half_mass_series(z); }

/// Mass of the standard normal over [a, b], a <= 0 <= b.
template <class T>
MEDULLA_FN T normal_mass(T a, T b) noexcept {
    return normal_half_mass(b) + normal_half_mass(-a);
}

}  // namespace detail

/// Gaussian in theta about `centre`, cut at +-pi/2 and normalised there: its integral over (-pi/2, pi/2) is 1 wherever
/// the centre lies, so a lobe near grazing keeps its energy.
template <class T>
struct TruncatedGaussian {
    T origin;     ///< the centre or, where that is outside, the edge next to it [radians]
    T deviation;  ///< of the uncut Gaussian [radians], > 0
    T inverse;    ///< 1 / deviation
    T beyond;     ///< how far the centre lies beyond the edge [deviations], 0 where it is inside
    T peak;       ///< density at the origin [1 / radian]

    MEDULLA_FN T pdf(T theta) const noexcept { return pdf_of(theta); }
    /// Density at several inclinations abreast.
    template <class V>
    MEDULLA_FN V pdf_of(V theta) const noexcept {
        return V(peak) * real_math::exponential(exponent_of(theta));
    }
    /// log(density / peak)
    template <class V>
    MEDULLA_FN V exponent_of(V theta) const noexcept {
        const V d = magnitude(theta - V(origin)) * V(inverse);
        return V(T(-0.5)) * d * (d + V(T(2) * beyond));
    }
};

template <class T>
MEDULLA_FN TruncatedGaussian<T> truncated_gaussian(T centre, T deviation) noexcept {
    const T edge = T(pi / 2);
    const T inverse = T(1) / deviation, a = (-edge - centre) * inverse, b = (edge - centre) * inverse;
    const T density = T(0.39894228040143268) * inverse;
    // Both edges 6 deviations away: all but 2e-9 of the mass is inside, less than float can tell.
    if (a < T(-6) && b > T(6)) return {centre, deviation, inverse, T(0), density};
    if (a <= T(0) && b >= T(0)) return {centre, deviation, inverse, T(0), density / detail::normal_mass(a, b)};
    const T beyond = a > T(0) ? a : -b;
    const T mass = detail::scaled_tail_mass(beyond, T(2) * edge * inverse);
    return {a > T(0) ? -edge : edge, deviation, inverse, beyond, density / mass};
}

/// Draws theta from the truncated Gaussian: its distribution function inverted by Newton steps kept in a bracket.
/// @param u uniform in [0, 1)
template <class T>
MEDULLA_FN T sample(const TruncatedGaussian<T>& gaussian, T u) noexcept {
    constexpr T edge = T(pi / 2);
    const bool inside = !(gaussian.beyond > T(0)), mirrored = !inside && gaussian.origin > T(0);
    // d counts deviations from the origin: of either sign where the centre is inside, else into the interval.
    const T a = inside ? (-edge - gaussian.origin) * gaussian.inverse : T(0);
    const T b = inside ? (edge - gaussian.origin) * gaussian.inverse : T(2) * edge * gaussian.inverse;
    const T scale = gaussian.peak * gaussian.deviation;  // density in d at the origin
    const T to_share = scale * T(2.5066282746310002);    // from mass of the uncut normal
    const T v = mirrored ? T(1) - u : u;
    // 7.5 deviations from the centre hold all but 3e-14.
    T low = inside && a < T(-7.5) ? T(-7.5) : a, high = inside && b > T(7.5) ? T(7.5) : b;
    constexpr T root_half = T(0.70710678118654752);
    const T half_below = T(0.5) * std::erf(-a * root_half);  // mass between the lower edge and the centre
    const T left = T(1) - v;
    T d = inside ? T(0) : -std::log(left > T(1e-30) ? left : T(1e-30)) / (gaussian.beyond + T(1));
    for (int i = 0; i < 60; ++i) {
        if (!(d > low && d < high)) d = T(0.5) * (low + high);
        T share;
        if (!inside) {
            share = to_share * detail::scaled_tail_mass(gaussian.beyond, d);
        } else if (d >= T(0)) {
            share = to_share * (T(0.5) * std::erf(d * root_half) + half_below);
        } else {
            share = to_share * (half_below - T(0.5) * std::erf(-d * root_half));
        }
        const T error = share - v;
        (error > T(0) ? high : low) = d;
        const T density = scale * std::exp(T(-0.5) * d * (d + T(2) * gaussian.beyond));
        const T next = density > T(0) ? d - error / density : T(0.5) * (low + high);
        // The density falls by e over 1 / beyond where the centre is outside: steps are measured by that.
        const bool done = std::abs(next - d) * (T(1) + gaussian.beyond) < T(2e-6) || high - low < T(1e-7) * std::abs(d);
        d = next > low && next < high ? next : (done ? d : T(0.5) * (low + high));
        if (done) break;
    }
    const T theta = gaussian.origin + (mirrored ? -gaussian.deviation : gaussian.deviation) * d;
    return theta < -edge ? -edge : (theta > edge ? edge : theta);
}

/// `x` less whole turns, in [-pi, pi]; |x| < 1e9.
template <class T>
MEDULLA_FN T wrap_angle(T x) noexcept {
    const T y = x - T(2 * pi) * nearest_integer(x * T(1 / (2 * pi)));
    return y < T(-pi) ? T(-pi) : (y > T(pi) ? T(pi) : y);
}

/// Gaussian of an angle wrapped on the circle, integral 1 over a turn.
template <class T>
struct WrappedGaussian {
    T deviation;  ///< [radians], > 0
    T inverse;    ///< 1 / deviation
    T peak;       ///< 1 / (deviation sqrt(2 pi))
    T damping;    ///< exp(-deviation^2 / 2): the first Fourier coefficient

    /// Density at `delta` from the centre [1 / radian]; delta any finite angle.
    MEDULLA_FN T pdf(T delta) const noexcept {
        const T x = wrap_angle(delta);
        if (deviation <= T(1.2)) return images(x);
        return harmonics(x);
    }
    /// Density at several angles abreast.
    template <class V>
    MEDULLA_FN V pdf_of(V delta) const noexcept {
        const V x = delta - V(T(2 * pi)) * nearest_integer(delta * V(T(1 / (2 * pi))));
        return deviation <= T(1.2) ? images(x) : harmonics(x);
    }
    /// Whether only one image counts: the next is at least 12 deviations away.
    MEDULLA_FN bool narrow() const noexcept { return deviation <= T(0.25); }
    /// log(density / peak) of a narrow one.
    template <class V>
    MEDULLA_FN V exponent_of(V delta) const noexcept {
        const V z = (delta - V(T(2 * pi)) * nearest_integer(delta * V(T(1 / (2 * pi))))) * V(inverse);
        return V(T(-0.5)) * z * z;
    }
    /// Sum of images: at deviation 1.2 the first one left out is 7.8 deviations away (1e-13).
    template <class V>
    MEDULLA_FN V images(V x) const noexcept {
        const V z = x * V(inverse);
        V sum = real_math::exponential(V(T(-0.5)) * z * z);
        if (!narrow()) {
            const V turn = V(T(2 * pi) * inverse), p = z + turn, q = z - turn;
            sum = sum + real_math::exponential(V(T(-0.5)) * p * p) + real_math::exponential(V(T(-0.5)) * q * q);
        }
        return V(peak) * sum;
    }
    /// Theta series: sum of damping^(n^2) cos(n x); at deviation 1.2 the sixth term is 6e-12.
    template <class V>
    MEDULLA_FN V harmonics(V x) const noexcept {
        const auto half = real_math::sine_cosine(V(T(0.5)) * x);  // |x / 2| <= pi / 2
        const V c = half.cosine * half.cosine - half.sine * half.sine;
        const T d2 = damping * damping;
        V before = V(T(1)), now = c, sum = V(T(0));
        T power = damping, ratio = damping * d2;
        for (int n = 1; n <= 5; ++n) {
            sum = sum + V(power) * now;
            const V next = V(T(2)) * c * now - before;
            before = now, now = next;
            power = power * ratio, ratio = ratio * d2;
        }
        return (V(T(1)) + V(T(2)) * sum) * V(T(1 / (2 * pi)));
    }
};

template <class T>
MEDULLA_FN WrappedGaussian<T> wrapped_gaussian(T deviation) noexcept {
    const T inverse = T(1) / deviation;
    using std::exp;
    return {deviation, inverse, T(0.39894228040143268) * inverse, exp(T(-0.5) * deviation * deviation)};
}

/// Draws an angle from the centre of the wrapped Gaussian (Box and Muller 1958), in [-pi, pi].
/// @param u uniform in [0, 1)  @param v uniform in [0, 1)
/// @param most deviations: beyond it, the second number of the pair, which is independent of the first, stands in
template <class T>
MEDULLA_FN T sample(const WrappedGaussian<T>& gaussian, T u, T v, T most = T(1e30)) noexcept {
    const T radius = std::sqrt(T(-2) * std::log(T(1) - u));  // 1 - u > 0
    const T z = radius * std::cos(T(2 * pi) * v);
    return wrap_angle(gaussian.deviation * (magnitude(z) <= most ? z : radius * std::sin(T(2 * pi) * v)));
}

/// Truncated Gaussians abreast: those of R, TT and TRT (lane 3 is nobody's), or of one lobe of four queries.
struct TruncatedGaussians {
    Four origin, deviation, inverse, beyond, peak;  ///< as TruncatedGaussian has them

    MEDULLA_FN TruncatedGaussian<float> operator[](int p) const noexcept {
        return {lane(origin, p), lane(deviation, p), lane(inverse, p), lane(beyond, p), lane(peak, p)};
    }
    MEDULLA_HOT Four pdf(Four theta) const noexcept { return peak * real_math::exponential(exponent(theta)); }
    MEDULLA_HOT Four exponent(Four theta) const noexcept {
        const Four d = magnitude(theta - origin) * inverse;
        return Four(-0.5f) * d * (d + beyond + beyond);
    }
};

/// As truncated_gaussian(centre, deviation), lane by lane.
MEDULLA_FN TruncatedGaussians truncated_gaussians(Four centre, Four deviation) noexcept {
    const Four edge(float(pi / 2)), zero(0.0f);
    const Four inverse = Four(1.0f) / deviation, away = magnitude(centre);
    const Four near = (edge - away) * inverse, far = (edge + away) * inverse;
    // Beyond 6 deviations lies 1e-9 of the mass.
    const Four beyond_near = detail::normal_half_mass(greater(near, zero)),
               beyond_far = any(far < Four(6.0f)) ? detail::normal_half_mass(far) : Four(0.5f);
    TruncatedGaussians g = {centre, deviation, inverse, zero, Four(0.39894228f) * inverse / (beyond_near + beyond_far)};
    if (!any(near < zero)) return g;
    TruncatedGaussian<float> each[4];
    for (int i = 0; i < 4; ++i) each[i] = truncated_gaussian(lane(centre, i), lane(deviation, i));
    g.origin = Four(each[0].origin, each[1].origin, each[2].origin, each[3].origin);
    g.beyond = Four(each[0].beyond, each[1].beyond, each[2].beyond, each[3].beyond);
    g.peak = Four(each[0].peak, each[1].peak, each[2].peak, each[3].peak);
    return g;
}

/// The wrapped Gaussians of R, TT and TRT, deviations ascending, one by one or abreast.
struct WrappedGaussians {
    WrappedGaussian<float> each[3];
    Four inverse, peak;  ///< lane 3 is 0

    MEDULLA_FN const WrappedGaussian<float>& operator[](int p) const noexcept { return each[p]; }
    /// Whether every one is narrow.
    MEDULLA_HOT bool narrow() const noexcept { return each[2].narrow(); }
    /// each[p].pdf(phi - centre[p]); lane 3 is 0. @param centre four finite numbers
    MEDULLA_HOT Four pdf(Four centre, float phi) const noexcept {
        if (narrow()) return peak * real_math::exponential(exponent(centre, phi));
        const Four delta = Four(phi) - centre;
        if (each[2].deviation > 1.2f)
            return Four(each[0].pdf(lane(delta, 0)), each[1].pdf(lane(delta, 1)), each[2].pdf(lane(delta, 2)), 0);
        const Four x = delta - Four(float(2 * pi)) * nearest_integer(delta * Four(float(1 / (2 * pi))));
        const Four turn = Four(float(2 * pi)) * inverse, z = x * inverse, p = z + turn, q = z - turn;
        return peak * (real_math::exponential(Four(-0.5f) * z * z) + real_math::exponential(Four(-0.5f) * p * p) +
                       real_math::exponential(Four(-0.5f) * q * q));
    }
    MEDULLA_HOT Four exponent(Four centre, float phi) const noexcept {
        const Four delta = Four(phi) - centre;
        const Four z = (delta - Four(float(2 * pi)) * nearest_integer(delta * Four(float(1 / (2 * pi))))) * inverse;
        return Four(-0.5f) * z * z;
    }
};

/// M D of R, TT and TRT at an exit; lane 3 is 0. One exponential does for both where D is one image.
MEDULLA_HOT Four joint_pdf(const TruncatedGaussians& M, const WrappedGaussians& D, Four centre, float theta,
                           float phi) noexcept {
    if (!D.narrow()) return M.pdf(theta) * D.pdf(centre, phi);
    return M.peak * D.peak * real_math::exponential(M.exponent(theta) + D.exponent(centre, phi));
}
/// The same of one lobe at several exits. @param delta phi - centre
template <class V>
MEDULLA_HOT V joint_pdf(const TruncatedGaussian<float>& M, const WrappedGaussian<float>& D, V theta, V delta) noexcept {
    if (!D.narrow()) return M.pdf_of(theta) * D.pdf_of(delta);
    return V(M.peak * D.peak) * real_math::exponential(M.exponent_of(theta) + D.exponent_of(delta));
}

/// The same of one lobe, lane by lane of M. @param delta phi - centre
MEDULLA_HOT Four joint_pdf(const TruncatedGaussians& M, const WrappedGaussian<float>& D, Four theta,
                           Four delta) noexcept {
    if (!D.narrow()) return M.pdf(theta) * D.pdf_of(delta);
    return M.peak * Four(D.peak) * real_math::exponential(M.exponent(theta) + D.exponent_of(delta));
}

MEDULLA_FN WrappedGaussians wrapped_gaussians(float a, float b, float c) noexcept {
    WrappedGaussians g;
    g.each[0] = wrapped_gaussian(a), g.each[1] = wrapped_gaussian(b), g.each[2] = wrapped_gaussian(c);
    g.inverse = Four(g.each[0].inverse, g.each[1].inverse, g.each[2].inverse, 0);
    g.peak = Four(g.each[0].peak, g.each[1].peak, g.each[2].peak, 0);
    return g;
}

}  // namespace medulla
