// The two Gaussians of the unscattered lobes, each with its density and its sampler: truncated in theta, wrapped in
// phi. Rests on Eqs. 5 and 7 of Yan et al. 2017; docs/bcsdf.md says why truncated and how the sums converge.
#pragma once

#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/detail/elementary.hpp"
#include "medulla/detail/math.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// exp(x^2) erfc(x) for x >= 0, float precision: direct up to 5, then six terms of the asymptotic series
/// (the seventh is 7e-7 of the sum at x = 5).
template <class T>
MEDULLA_APART T scaled_erfc(T x) noexcept {
    using detail::math::erfc;
    using detail::math::exp;
    if (x < T(5)) return exp(x * x) * erfc(x);
    const T u = T(0.5) / (x * x);
    const T sum = T(1) - u * (T(1) - T(3) * u * (T(1) - T(5) * u * (T(1) - T(7) * u * (T(1) - T(9) * u))));
    return sum / (x * T(1.7724538509055160));
}

/// Mass of the standard normal over [near, from + w], near, w >= 0, divided by exp(-near^2 / 2). Kept scaled, a lobe
/// whose centre lies far outside the interval still has a mass that is no underflow.
template <class T>
MEDULLA_APART T scaled_tail_mass(T from, T w) noexcept {
    using detail::math::exp;
    const T root_half = T(0.70710678118654752);
    const T to = from + w;
    // Short against the tail's length 1 / far: the two tails would cancel, so the density is integrated by four Gauss
    // nodes, which are exact to float for an exponent that changes by at most 1.
    if (w * (to + T(1)) < T(1)) {
        const T x[2] = {T(0.43056815579702629), T(0.16999052179242813)};
        const T c[2] = {T(0.17392742256872693), T(0.32607257743127307)};
        T sum = T(0);
        for (int i = 0; i < 2; ++i) {
            const T p = w * (T(0.5) + x[i]), q = w * (T(0.5) - x[i]);
            sum = sum + c[i] * (exp(-p * (from + T(0.5) * p)) + exp(-q * (from + T(0.5) * q)));
        }
        return sum * w * T(0.39894228040143268);
    }
    const T tail = exp(T(-0.5) * w * (to + from));
    return T(0.5) * (scaled_erfc(from * root_half) - (tail > T(0) ? tail * scaled_erfc(to * root_half) : T(0)));
}

/// Mass of the standard normal between 0 and z >= 0.
template <class T>
MEDULLA_FN T normal_half_mass(T z) noexcept {
    using detail::math::erf;
    return T(0.5) * erf(z * T(0.70710678118654752));
}
/// Abramowitz and Stegun 7.1.26: absolute error 1e-7, and the masses it is used for are not small. For float or Four.
template <class V>
MEDULLA_FN V normal_half_mass_series(V z) noexcept {
    const V x = z * V(0.70710678f), t = V(1.0f) / (V(1.0f) + V(0.3275911f) * x);
    const V p = t * (V(0.254829592f) +
                     t * (V(-0.284496736f) + t * (V(1.421413741f) + t * (V(-1.453152027f) + t * V(1.061405429f)))));
    return V(0.5f) - V(0.5f) * p * exponential(-x * x);
}
MEDULLA_FN float normal_half_mass(float z) noexcept { return normal_half_mass_series(z); }
MEDULLA_FN Four normal_half_mass(Four z) noexcept { return normal_half_mass_series(z); }

/// Mass of the standard normal over [a, b], a <= 0 <= b.
template <class T>
MEDULLA_FN T normal_mass(T a, T b) noexcept {
    return normal_half_mass(b) + normal_half_mass(-a);
}

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
    /// Density at several inclinations side by side.
    template <class V>
    MEDULLA_FN V pdf_of(V theta) const noexcept {
        return V(peak) * exponential(exponent_of(theta));
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
    if (a <= T(0) && b >= T(0)) return {centre, deviation, inverse, T(0), density / normal_mass(a, b)};
    const T beyond = a > T(0) ? a : -b;
    const T mass = scaled_tail_mass(beyond, T(2) * edge * inverse);
    return {a > T(0) ? -edge : edge, deviation, inverse, beyond, density / mass};
}

/// The standard normal's quantile of p = 1 - q, both given so that neither tail loses digits: Giles 2010's polynomials,
/// 2e-6 of a deviation. p, q = 0 count as 2^-26, 5.5 deviations out, which no float in (0, 1) reaches.
MEDULLA_FN float normal_quantile(float p, float q) noexcept {
    const float least = 1.4901161e-8f, product = 4 * (p > least ? p : least) * (q > least ? q : least);
    float w = -detail::math::log(product), y;
    if (w < 5) {
        w -= 2.5f;
        y = 3.43273939e-7f + 2.81022636e-8f * w;
        y = -4.39150654e-6f + (-3.5233877e-6f + y * w) * w;
        y = -0.00125372503f + (0.00021858087f + y * w) * w;
        y = 1.50140941f + (0.246640727f + (-0.00417768164f + y * w) * w) * w;
    } else {
        w = detail::math::sqrt(w) - 3;
        y = 0.000100950558f - 0.000200214257f * w;
        y = -0.00367342844f + (0.00134934322f + y * w) * w;
        y = -0.0076224613f + (0.00573950773f + y * w) * w;
        y = 2.83297682f + (1.00167406f + (0.00943887047f + y * w) * w) * w;
    }
    return 1.41421356f * y * (p - q);
}

/// Draws theta from a truncated Gaussian whose centre lies outside: its distribution function inverted by Newton steps
/// kept in a bracket. @param u in [0, 1]
MEDULLA_APART float sample_tail(const TruncatedGaussian<float>& gaussian, float u) noexcept {
    constexpr float edge = float(pi / 2);
    // d counts deviations from the edge into the interval.
    const bool mirrored = gaussian.origin > 0;
    const float to_share = gaussian.peak * gaussian.deviation * 2.5066283f, v = mirrored ? 1 - u : u, left = 1 - v;
    float low = 0, high = 2 * edge * gaussian.inverse;
    float d = -detail::math::log(left > 1e-30f ? left : 1e-30f) / (gaussian.beyond + 1);
    for (int i = 0; i < 60; ++i) {
        if (!(d > low && d < high)) d = 0.5f * (low + high);
        const float error = to_share * scaled_tail_mass(gaussian.beyond, d) - v;
        (error > 0 ? high : low) = d;
        const float density =
            gaussian.peak * gaussian.deviation * detail::math::exp(-0.5f * d * (d + 2 * gaussian.beyond));
        const float next = density > 0 ? d - error / density : 0.5f * (low + high);
        // The density falls by e over 1 / beyond: steps are measured by that.
        const bool done =
            detail::math::abs(next - d) * (1 + gaussian.beyond) < 2e-6f || high - low < 1e-7f * detail::math::abs(d);
        d = next > low && next < high ? next : (done ? d : 0.5f * (low + high));
        if (done) break;
    }
    return gaussian.origin + (mirrored ? -gaussian.deviation : gaussian.deviation) * d;
}

/// Draws theta from the truncated Gaussian. @param u in [0, 1]
MEDULLA_FN float sample(const TruncatedGaussian<float>& gaussian, float u) noexcept {
    constexpr float edge = float(pi / 2);
    float theta;
    if (gaussian.beyond > 0) {
        theta = sample_tail(gaussian, u);
    } else {
        const float below = 0.5f - normal_half_mass((gaussian.origin + edge) * gaussian.inverse),
                    above = 0.5f - normal_half_mass((edge - gaussian.origin) * gaussian.inverse),
                    mass = 0.39894228f / (gaussian.peak * gaussian.deviation);
        theta = gaussian.origin + gaussian.deviation * normal_quantile(below + u * mass, above + (1 - u) * mass);
    }
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
    /// Density at several angles side by side.
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
        V sum = exponential(V(T(-0.5)) * z * z);
        if (!narrow()) {
            const V turn = V(T(2 * pi) * inverse), p = z + turn, q = z - turn;
            sum = sum + exponential(V(T(-0.5)) * p * p) + exponential(V(T(-0.5)) * q * q);
        }
        return V(peak) * sum;
    }
    /// Theta series: sum of damping^(n^2) cos(n x); at deviation 1.2 the sixth term is 6e-12.
    template <class V>
    MEDULLA_APART V harmonics(V x) const noexcept {
        const auto half = sine_cosine(V(T(0.5)) * x);  // |x / 2| <= pi / 2
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
    using detail::math::exp;
    return {deviation, inverse, T(0.39894228040143268) * inverse, exp(T(-0.5) * deviation * deviation)};
}

/// Draws an angle from the centre of the wrapped Gaussian, in [-pi, pi]. @param u in [0, 1]
MEDULLA_FN float sample(const WrappedGaussian<float>& gaussian, float u) noexcept {
    return wrap_angle(gaussian.deviation * normal_quantile(u, 1 - u));
}

/// Truncated Gaussians side by side: those of R, TT, TRT and the residual lobe, or of one lobe of four queries.
struct TruncatedGaussians {
    alignas(16) float origin[4], inverse[4], beyond[4], peak[4];  ///< as TruncatedGaussian has them

    MEDULLA_FN TruncatedGaussian<float> operator[](int p) const noexcept {
        return {origin[p], 1 / inverse[p], inverse[p], beyond[p], peak[p]};
    }
    MEDULLA_HOT Four peaks() const noexcept { return aligned_four_at(peak); }
    MEDULLA_HOT Four pdf(Four theta) const noexcept { return peaks() * exponential(exponent(theta)); }
    MEDULLA_HOT Four exponent(Four theta) const noexcept {
        const Four d = magnitude(theta - aligned_four_at(origin)) * aligned_four_at(inverse);
        const Four past = aligned_four_at(beyond);
        return Four(-0.5f) * d * (d + past + past);
    }
};

/// As truncated_gaussian(centre, deviation), lane by lane.
MEDULLA_HOT TruncatedGaussians truncated_gaussians(Four centre, Four deviation) noexcept {
    const Four edge(float(pi / 2)), zero(0.0f);
    const Four inverse = Four(1.0f) / deviation, away = magnitude(centre);
    const Four closer = (edge - away) * inverse, farther = (edge + away) * inverse;
    // Beyond 6 deviations lies 1e-9 of the mass.
    const Four beyond_closer = normal_half_mass(greater(closer, zero)),
               beyond_farther = any(farther < Four(6.0f)) ? normal_half_mass(farther) : Four(0.5f);
    TruncatedGaussians g;
    store_four(centre, g.origin);
    store_four(inverse, g.inverse);
    store_four(zero, g.beyond);
    store_four(Four(0.39894228f) * inverse / (beyond_closer + beyond_farther), g.peak);
    if (!any(closer < zero)) return g;
    for (int i = 0; i < 4; ++i) {
        if (!(lane(closer, i) < 0)) continue;
        const TruncatedGaussian<float> one = truncated_gaussian(lane(centre, i), lane(deviation, i));
        g.origin[i] = one.origin;
        g.beyond[i] = one.beyond;
        g.peak[i] = one.peak;
    }
    return g;
}

/// The wrapped Gaussians of R, TT and TRT, deviations ascending, side by side; lane 3, the residual lobe, is even.
struct WrappedGaussians {
    alignas(16) float deviation[4], inverse[4], peak[4];  ///< inverse[3] = 0, peak[3] = 1 / (2 pi)

    MEDULLA_FN WrappedGaussian<float> operator[](int p) const noexcept { return wrapped_gaussian(deviation[p]); }
    /// Whether of every one only the nearest image counts.
    MEDULLA_HOT bool narrow() const noexcept { return deviation[2] <= 0.25f; }
    MEDULLA_HOT Four peaks() const noexcept { return aligned_four_at(peak); }
    MEDULLA_HOT Four exponent(Four delta) const noexcept {
        const Four z = wrapped(delta) * aligned_four_at(inverse);
        return Four(-0.5f) * z * z;
    }
    /// Density at angles from the centres; lane 3 is 1 / (2 pi). @param delta four finite numbers
    MEDULLA_FN Four pdf(Four delta) const noexcept {
        if (narrow()) return peaks() * exponential(exponent(delta));
        if (deviation[2] > 1.2f) return one_by_one(delta);
        const Four turn = Four(float(2 * pi)) * aligned_four_at(inverse), z = wrapped(delta) * aligned_four_at(inverse),
                   p = z + turn, q = z - turn, third(0.0f, 0.0f, 0.0f, -1e3f);  // of lane 3 one image in three counts
        return peaks() * (exponential(Four(-0.5f) * z * z) + exponential(Four(-0.5f) * p * p + third) +
                          exponential(Four(-0.5f) * q * q + third));
    }

  private:
    MEDULLA_APART Four one_by_one(Four delta) const noexcept {
        return Four((*this)[0].pdf(lane(delta, 0)), (*this)[1].pdf(lane(delta, 1)), (*this)[2].pdf(lane(delta, 2)),
                    peak[3]);
    }
    static MEDULLA_HOT Four wrapped(Four delta) noexcept {
        return delta - Four(float(2 * pi)) * nearest_integer(delta * Four(float(1 / (2 * pi))));
    }
};

/// Deviations sqrt(p + 1) beta_n of R, TT and TRT (Eq. 16).
MEDULLA_HOT WrappedGaussians wrapped_gaussians(float beta_n) noexcept {
    WrappedGaussians g;
    const Four inverse = Four(1.0f, 0.70710678f, 0.57735027f, 0.0f) * Four(1 / beta_n);
    store_four(Four(1.0f, 1.41421356f, 1.73205081f, 0.0f) * Four(beta_n), g.deviation);
    store_four(inverse, g.inverse);
    store_four(Four(0.39894228f) * inverse + Four(0, 0, 0, float(0.5 / pi)), g.peak);
    return g;
}

/// M D of R, TT, TRT and the residual lobe at an exit. One exponential serves both where D is one image.
/// @param delta phi less the lobes' centres
MEDULLA_HOT Four joint_pdf(const TruncatedGaussians& M, const WrappedGaussians& D, Four theta, Four delta) noexcept {
    if (!D.narrow()) return M.pdf(theta) * D.pdf(delta);
    return M.peaks() * D.peaks() * exponential(M.exponent(theta) + D.exponent(delta));
}

/// The same of one lobe, lane by lane of M. @param delta phi - centre
MEDULLA_HOT Four joint_pdf(const TruncatedGaussians& M, const WrappedGaussian<float>& D, Four theta,
                           Four delta) noexcept {
    if (!D.narrow()) return M.pdf(theta) * D.pdf_of(delta);
    return M.peaks() * Four(D.peak) * exponential(M.exponent(theta) + D.exponent_of(delta));
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
