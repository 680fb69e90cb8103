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
    if (x < T(5)) return std::exp(x * x) * erfc(x);
    const T u = T(0.5) / (x * x);
    const T sum = T(1) - u * (T(1) - T(3) * u * (T(1) - T(5) * u * (T(1) - T(7) * u * (T(1) - T(9) * u))));
    return sum / (x * T(1.7724538509055160));
}

/// Mass of the standard normal over [a, b], a <= b, divided by exp(-m^2 / 2), m the point of [a, b] nearest to 0.
/// Kept scaled, a lobe whose centre lies far outside the interval still has a mass that is no underflow.
template <class T>
MEDULLA_FN T scaled_normal_mass(T a, T b) noexcept {
    constexpr T root_half = T(0.70710678118654752);
    using std::erf;
    if (a < T(0) && b > T(0)) return T(0.5) * (erf(b * root_half) - erf(a * root_half));
    const T near = a < T(0) ? -b : a, far = a < T(0) ? -a : b;
    // Narrow against its distance: the two tails nearly cancel, so the density is integrated by four Gauss nodes;
    // exp(-near * w) over near * w <= 1 is then exact to float.
    const T w = far - near;
    if (w * (far + T(1)) < T(1)) {
        const T x[2] = {T(0.43056815579702629), T(0.16999052179242813)};
        const T c[2] = {T(0.17392742256872693), T(0.32607257743127307)};
        T sum = T(0);
        for (int i = 0; i < 2; ++i) {
            const T p = w * (T(0.5) + x[i]), q = w * (T(0.5) - x[i]);
            sum += c[i] * (std::exp(-p * (near + T(0.5) * p)) + std::exp(-q * (near + T(0.5) * q)));
        }
        return sum * w * T(0.39894228040143268);
    }
    const T tail = std::exp(T(-0.5) * w * (far + near));
    return T(0.5) * (scaled_erfc(near * root_half) - (tail > T(0) ? tail * scaled_erfc(far * root_half) : T(0)));
}

}  // namespace detail

/// Gaussian in theta about `centre`, cut at +-pi/2 and normalised there: its integral over (-pi/2, pi/2) is 1 wherever
/// the centre lies, so a lobe near grazing keeps its energy.
template <class T>
struct TruncatedGaussian {
    T centre;     ///< [radians]
    T deviation;  ///< of the uncut Gaussian [radians], > 0
    T inverse;    ///< 1 / deviation
    T nearest;    ///< least |z| inside, z = (theta - centre) / deviation: the exponent is kept relative to it
    T peak;       ///< density at `nearest` [1 / radian]

    MEDULLA_FN T pdf(T theta) const noexcept {
        const T z = (theta - centre) * inverse;
        return peak * real_math::exponential(T(-0.5) * (z - nearest) * (z + nearest));
    }
};

template <class T>
MEDULLA_FN TruncatedGaussian<T> truncated_gaussian(T centre, T deviation) noexcept {
    constexpr T edge = T(pi / 2);
    const T inverse = T(1) / deviation, a = (-edge - centre) * inverse, b = (edge - centre) * inverse;
    const T nearest = a > T(0) ? a : (b < T(0) ? -b : T(0));
    // Both edges 6 deviations away: all but 2e-9 of the mass is inside, less than float can tell.
    const T mass = a < T(-6) && b > T(6) ? T(1) : detail::scaled_normal_mass(a, b);
    return {centre, deviation, inverse, nearest, T(0.39894228040143268) * inverse / mass};
}

/// Draws theta from the truncated Gaussian: inverts its distribution function by bisection started Newton steps.
/// @param u uniform in [0, 1)
template <class T>
MEDULLA_FN T sample(const TruncatedGaussian<T>& gaussian, T u) noexcept {
    constexpr T edge = T(pi / 2);
    const T a = (-edge - gaussian.centre) * gaussian.inverse, b = (edge - gaussian.centre) * gaussian.inverse;
    // Outermost 7.5 deviations hold 3e-14 of the mass: the bracket need not be wider where the centre is inside.
    T low = a < T(-7.5) && b > T(0) ? T(-7.5) : a, high = b > T(7.5) && a < T(0) ? T(7.5) : b;
    const T reference = T(0.5) * gaussian.nearest * gaussian.nearest;
    const T scale = gaussian.peak * gaussian.deviation;  // density in z at `nearest`
    const T whole = T(0.39894228040143268) / scale;
    T z = low + u * (high - low);
    if (gaussian.nearest > T(0)) {  // an exponential tail from the nearer edge is a good start
        const T v = a > T(0) ? T(1) - u : u;
        const T step = -std::log(v > T(1e-30) ? v : T(1e-30)) / (gaussian.nearest + T(1));
        z = a > T(0) ? a + step : b - step;
    } else {
        z = T(0) < low ? low : (T(0) > high ? high : T(0));
    }
    for (int i = 0; i < 60; ++i) {
        if (!(z > low && z < high)) z = T(0.5) * (low + high);
        // Mass of [a, z] or of [z, b], whichever side is nearer to its edge, in the scale of `nearest`.
        const T m = a > T(0) ? a : (z < T(0) ? -z : T(0));
        const T left = detail::scaled_normal_mass(a, z) * std::exp(reference - T(0.5) * m * m);
        const T error = left / whole - u;
        (error > T(0) ? high : low) = z;
        const T density = scale * std::exp(reference - T(0.5) * z * z);
        const T next = density > T(0) ? z - error / density : T(0.5) * (low + high);
        // The density falls by e over 1 / nearest where the centre is outside: steps are measured by that.
        if (std::abs(next - z) * (T(1) + gaussian.nearest) < T(2e-6) || high - low < T(1e-7) * (T(1) + std::abs(z))) {
            z = next > low && next < high ? next : z;
            break;
        }
        z = next;
    }
    const T theta = gaussian.centre + gaussian.deviation * z;
    return theta < -edge ? -edge : (theta > edge ? edge : theta);
}

/// `x` less whole turns, in [-pi, pi]; |x| < 1e9.
template <class T>
MEDULLA_FN T wrap_angle(T x) noexcept {
    constexpr T turn = T(2 * pi);
    const T turns = x * T(1 / (2 * pi));
    const T y = x - turn * T(static_cast<std::int32_t>(turns + (turns < T(0) ? T(-0.5) : T(0.5))));
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
    /// Sum of images: at deviation 1.2 the first one left out is 7.8 deviations away (1e-13).
    MEDULLA_FN T images(T x) const noexcept {
        const T z = x * inverse;
        T sum = real_math::exponential(T(-0.5) * z * z);
        if (deviation > T(0.25)) {  // else the next image is at least 12 deviations away
            const T turn = T(2 * pi) * inverse, p = z + turn, q = z - turn;
            sum += real_math::exponential(T(-0.5) * p * p) + real_math::exponential(T(-0.5) * q * q);
        }
        return peak * sum;
    }
    /// Theta series: sum of damping^(n^2) cos(n x); at deviation 1.2 the sixth term is 6e-12.
    MEDULLA_FN T harmonics(T x) const noexcept {
        const T c = std::cos(x), d2 = damping * damping;
        T before = T(1), now = c, power = damping, ratio = damping * d2, sum = T(0);
        for (int n = 1; n <= 5; ++n) {
            sum += power * now;
            const T next = T(2) * c * now - before;
            before = now, now = next;
            power *= ratio, ratio *= d2;
        }
        return (T(1) + T(2) * sum) * T(1 / (2 * pi));
    }
};

template <class T>
MEDULLA_FN WrappedGaussian<T> wrapped_gaussian(T deviation) noexcept {
    const T inverse = T(1) / deviation;
    return {deviation, inverse, T(0.39894228040143268) * inverse, std::exp(T(-0.5) * deviation * deviation)};
}

/// Draws an angle from the centre of the wrapped Gaussian (Box and Muller 1958), in [-pi, pi].
/// @param u uniform in [0, 1)  @param v uniform in [0, 1)
template <class T>
MEDULLA_FN T sample(const WrappedGaussian<T>& gaussian, T u, T v) noexcept {
    const T radius = std::sqrt(T(-2) * std::log(T(1) - u));  // 1 - u > 0
    return wrap_angle(gaussian.deviation * radius * std::cos(T(2 * pi) * v));
}

}  // namespace medulla
