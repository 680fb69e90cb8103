// Elementary functions the lobes spend their time in: the standard library's for any scalar, and for float
// branch-free polynomials (2 ulp class) that a compiler can run side by side for several nodes.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "medulla/config.hpp"

namespace medulla {
namespace real_math {

/// exp(x).
template <class T>
MEDULLA_FN T exponential(T x) noexcept {
    using std::exp;
    return exp(x);
}

/// exp(x) for float, x <= 80; below -87 exactly 0, so that a lobe out of reach is no denormal.
/// x = n log 2 + r, |r| <= log(2)/2; degree 6 on r: relative error < 3e-7.
MEDULLA_FN float exponential(float x) noexcept {
    const bool out = x < -87.0f;
    const float y = out ? -87.0f : x;
    const float shifted = y * 1.44269504f + 12582912.0f;  // 1.5 * 2^23 rounds to the nearest integer
    std::int32_t n;
    std::memcpy(&n, &shifted, sizeof n);
    const float k = float(n - 0x4b400000);
    const float r = (y - k * 0.693359375f) + k * 2.12194440e-4f;
    const float p =
        1.0f +
        r * (1.0f + r * (0.5f + r * (1.6666667e-1f + r * (4.1666646e-2f + r * (8.3335698e-3f + r * 1.3943e-3f)))));
    const std::int32_t bits = ((n - 0x4b400000) + 127) << 23;
    float scale;
    std::memcpy(&scale, &bits, sizeof scale);
    return out ? 0.0f : p * scale;
}

/// 1 - exp(-x) for x >= 0, to full relative precision.
template <class T>
MEDULLA_FN T absorbed(T x) noexcept {
    using std::expm1;
    return -expm1(-x);
}
MEDULLA_FN float absorbed(float x) noexcept {
    // Taylor to x^6 below 0.25: the next term is 0.25^6 / 5040 of the first, 5e-8.
    const float small =
        x * (1.0f - x * (0.5f - x * (1.6666667e-1f - x * (4.1666667e-2f - x * (8.3333333e-3f - x * 1.3888889e-3f)))));
    const float large = 1.0f - exponential(-x);
    return x < 0.25f ? small : large;
}

/// The angle in [-pi/2, pi/2] of the point (cosine >= 0, sine) on the unit circle.
template <class T>
MEDULLA_FN T angle(T sine, T cosine) noexcept {
    using std::atan2;
    return atan2(sine, cosine);
}
/// asin of the smaller of sine and cosine, 2 ulp: no digits lost at either end since both are given.
MEDULLA_FN float angle(float sine, float cosine) noexcept {
    const float s = sine < 0 ? -sine : sine;
    const bool steep = s > cosine;
    const float x = steep ? cosine : s, z = x * x;  // x <= sqrt(1/2)
    const float p = 1.0f + z * (1.6666752e-1f +
                                z * (7.4953002e-2f + z * (4.5470025e-2f + z * (2.4181311e-2f + z * 4.2163199e-2f))));
    // Cephes' asinf covers |x| <= 1/2; between 1/2 and sqrt(1/2) the half-angle form.
    const bool far = x > 0.5f;
    const float w = 0.5f * (1.0f - x), root = std::sqrt(w);
    const float q = 1.0f + w * (1.6666752e-1f +
                                w * (7.4953002e-2f + w * (4.5470025e-2f + w * (2.4181311e-2f + w * 4.2163199e-2f))));
    const float a = far ? 1.57079633f - 2.0f * root * q : x * p;
    const float b = steep ? 1.57079633f - a : a;
    return sine < 0 ? -b : b;
}

/// Sine and cosine of an angle in [-pi/2, pi/2].
template <class T>
struct SineCosine {
    T sine, cosine;
};
template <class T>
MEDULLA_FN SineCosine<T> sine_cosine(T x) noexcept {
    using std::cos;
    using std::sin;
    return {sin(x), cos(x)};
}
/// From the half angle, |x/2| <= pi/4: the polynomials of Cephes, then doubling; cos >= 0 keeps its digits as
/// (c - s)(c + s) near pi/2.
MEDULLA_FN SineCosine<float> sine_cosine(float x) noexcept {
    const float y = 0.5f * x, z = y * y;
    const float s = y + y * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
    const float c =
        1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
    return {2.0f * s * c, (c - s) * (c + s)};
}

}  // namespace real_math
}  // namespace medulla
