// Elementary functions the lobes spend their time in: the standard library's for any scalar, and for float, alone or
// four at a time, branch-free polynomials (relative error < 4e-7).
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/lanes.hpp"
#include "medulla/detail/math.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {
template <class T>
struct SineCosine {
    T sine, cosine;
};

namespace polynomial {

/// exp(x), x <= 80; below -87 exactly 0, so that a lobe out of reach is no denormal.
/// x = n log 2 + r, |r| <= log(2) / 2; degree 6 in r, by pairs of terms, which wait less for one another.
template <class T>
MEDULLA_FN T exponential(T x) noexcept {
    const T y = greater(T(-87.0f), x), k = nearest_integer(y * T(1.44269504f));
    const T r = (y - k * T(0.693359375f)) + k * T(2.12194440e-4f), r2 = r * r;
    const T p = (T(1.0f) + r) + r2 * ((T(0.5f) + r * T(1.6666667e-1f)) +
                                      r2 * ((T(4.1666646e-2f) + r * T(8.3335698e-3f)) + r2 * T(1.3943e-3f)));
    return zero_where(x < T(-87.0f), p * power_of_two(k));
}

/// 1 - exp(-x), x >= 0: Taylor to x^6 below 0.25, where the next term is 5e-8 of the first. @param left exp(-x)
template <class T>
MEDULLA_FN T absorbed(T x, T left) noexcept {
    const T z = choose(x < T(0.25f), x, T(0.0f));
    const T series =
        z * (T(1.0f) - z * (T(0.5f) - z * (T(1.6666667e-1f) -
                                           z * (T(4.1666667e-2f) - z * (T(8.3333333e-3f) - z * T(1.3888889e-3f))))));
    return choose(x < T(0.25f), series, T(1.0f) - left);
}

/// Angle in [-pi/2, pi/2] of the point (cosine >= 0, sine) on the unit circle: asin of the smaller of the two, by
/// Cephes' asinf up to 1/2 and its half-angle form up to sqrt(1/2), so that no digits are lost at either end.
template <class T>
MEDULLA_FN T angle(T sine, T cosine) noexcept {
    const T s = magnitude(sine);
    const auto steep = s > cosine;
    const T x = choose(steep, cosine, s);
    const auto upper = x > T(0.5f);
    const T w = T(0.5f) * (T(1.0f) - x), z = choose(upper, w, x * x);
    const T p =
        T(1.0f) + z * (T(1.6666752e-1f) +
                       z * (T(7.4953002e-2f) + z * (T(4.5470025e-2f) + z * (T(2.4181311e-2f) + z * T(4.2163199e-2f)))));
    const T root = choose(upper, square_root(w), x) * p;
    const T a = choose(upper, T(1.57079633f) - T(2.0f) * root, root);
    return with_sign(choose(steep, T(1.57079633f) - a, a), sine);
}

/// Cephes' polynomials of sine and cosine, |y| <= pi/4.
template <class T>
MEDULLA_FN SineCosine<T> sine_cosine_about_0(T y) noexcept {
    const T z = y * y;
    return {y + y * z * (T(-1.6666654611e-1f) + z * (T(8.3321608736e-3f) + z * T(-1.9515295891e-4f))),
            T(1.0f) - T(0.5f) * z +
                z * z * (T(4.166664568298827e-2f) + z * (T(-1.388731625493765e-3f) + z * T(2.443315711809948e-5f)))};
}

/// Sine and cosine in [-pi/2, pi/2] from the half angle, the cosine as (c - s)(c + s): to 6e-8 of 1.
template <class T>
MEDULLA_FN SineCosine<T> sine_cosine(T x) noexcept {
    const auto [s, c] = sine_cosine_about_0(T(0.5f) * x);
    return {T(2.0f) * s * c, (c - s) * (c + s)};
}

/// Cosine in [-pi/2, pi/2] to 2e-7 of itself, however small: beyond pi/4 it is the sine of what is missing to pi/2,
/// which is float(pi/2) less x, exactly, and the 4.4e-8 that float(pi/2) is too much. The magnitude of the former,
/// which is not negative, changes nothing; it keeps -ffast-math from joining both constants, which would lose the
/// latter.
template <class T>
MEDULLA_FN T cosine(T x) noexcept {
    const T a = magnitude(x);
    const auto steep = a > T(0.78539816f);
    const auto [s, c] = sine_cosine_about_0(choose(steep, magnitude(T(1.57079637f) - a) - T(4.37113883e-8f), a));
    return choose(steep, s, c);
}

}  // namespace polynomial

/// exp(x).
template <class T>
MEDULLA_FN T exponential(T x) noexcept {
    using detail::math::exp;
    return exp(x);
}
MEDULLA_FN float exponential(float x) noexcept { return polynomial::exponential(x); }
MEDULLA_FN Four exponential(Four x) noexcept { return polynomial::exponential(x); }

/// exp(x[i]) replaces each x[i]; floats four at a time.
template <std::size_t n, class T>
MEDULLA_FN void exponentials(T (&x)[n]) noexcept {
    for (T& value : x) value = exponential(value);
}
template <std::size_t n>
MEDULLA_FN void exponentials(float (&x)[n]) noexcept {
    for (std::size_t i = 0; i < n; i += 4) {
        const std::size_t more = n - i - 1;  // beyond x[i]
        const Four e =
            exponential(Four(x[i], x[more > 0 ? i + 1 : i], x[more > 1 ? i + 2 : i], x[more > 2 ? i + 3 : i]));
        for (std::size_t k = 0; k <= more && k < 4; ++k) x[i + k] = lane(e, int(k));
    }
}

/// 1 - exp(-x) for x >= 0, to full relative precision. @param left exp(-x)
template <class T>
MEDULLA_FN T absorbed(T x, T) noexcept {
    using detail::math::expm1;
    return -expm1(-x);
}
MEDULLA_FN float absorbed(float x, float left) noexcept { return polynomial::absorbed(x, left); }
MEDULLA_FN Four absorbed(Four x, Four left) noexcept { return polynomial::absorbed(x, left); }

/// The angle in [-pi/2, pi/2] of the point (cosine >= 0, sine) on the unit circle.
template <class T>
MEDULLA_FN T angle(T sine, T cosine) noexcept {
    using detail::math::atan2;
    return atan2(sine, cosine);
}
MEDULLA_FN float angle(float sine, float cosine) noexcept { return polynomial::angle(sine, cosine); }
MEDULLA_FN Four angle(Four sine, Four cosine) noexcept { return polynomial::angle(sine, cosine); }

/// angle(sine[i], cosine[i]); floats side by side.
template <class T>
MEDULLA_FN void angles(const T (&sine)[2], const T (&cosine)[2], T (&result)[2]) noexcept {
    for (int i = 0; i < 2; ++i) result[i] = angle(sine[i], cosine[i]);
}
MEDULLA_FN void angles(const float (&sine)[2], const float (&cosine)[2], float (&result)[2]) noexcept {
    const Four both = angle(Four(sine[0], sine[1], 0, 0), Four(cosine[0], cosine[1], 1, 1));
    for (int i = 0; i < 2; ++i) result[i] = lane(both, i);
}

/// Sine and cosine of an angle in [-pi/2, pi/2].
template <class T>
MEDULLA_FN SineCosine<T> sine_cosine(T x) noexcept {
    using detail::math::cos;
    using detail::math::sin;
    return {sin(x), cos(x)};
}
MEDULLA_FN SineCosine<float> sine_cosine(float x) noexcept { return polynomial::sine_cosine(x); }
MEDULLA_FN SineCosine<Four> sine_cosine(Four x) noexcept { return polynomial::sine_cosine(x); }

/// Cosines of angles in [-pi/2, pi/2].
MEDULLA_FN Four cosine(Four x) noexcept { return polynomial::cosine(x); }

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
