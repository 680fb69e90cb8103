// log, exp, sin, cos and atan2 from + - * / and sqrt alone: the same bits on every processor and with every C library
// (glibc selects code that rounds differently where there is AVX2 and FMA). Reductions and polynomials of fdlibm:
// Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved. Developed at SunPro, a Sun Microsystems, Inc.
// business. Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice
// is preserved.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "medulla/config.hpp"

/// Built with -ffp-contract=off (cmake/warnings.cmake). Errors: tests/test_elementary.cpp.
namespace medulla::sim2d::portable {

namespace detail {
inline std::int64_t bits_of(double x) noexcept {
    std::int64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    return bits;
}
inline double of_bits(std::int64_t bits) noexcept {
    double x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}
inline constexpr double ln2_high = 6.93147180369123816490e-01, ln2_low = 1.90821492927058770002e-10;
inline constexpr double half_pi_high = 1.57079632679489655800e+00, half_pi_low = 6.12323399573676603587e-17;

/// sin(x + low), |x| <= pi/4.
inline double sin_near_0(double x, double low) noexcept {
    const double z = x * x, v = z * x;
    const double r =
        8.33333333332248946124e-03 +
        z * (-1.98412698298579493134e-04 +
             z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    return x - ((z * (0.5 * low - v * r) - low) - v * -1.66666666666666324348e-01);
}

/// cos(x + low), |x| <= pi/4.
inline double cos_near_0(double x, double low) noexcept {
    const double z = x * x;
    const double r = z * (4.16666666666666019037e-02 +
                          z * (-1.38888888888741095749e-03 +
                               z * (2.48015872894767294178e-05 +
                                    z * (-2.75573143513906633035e-07 +
                                         z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const double half = 0.5 * z, w = 1 - half;
    return w + (((1 - w) - half) + (z * r - x * low));
}

/// atan(x), x >= 0.
inline double atan_of_positive(double x) noexcept {
    // atan(x) = atan(c) + atan((x - c) / (1 + c x)), c = 0, 1/2, 1, 3/2, infinity
    double high = 0, low = 0, t = x;
    if (x >= 2.4375)
        t = -1 / x, high = half_pi_high, low = half_pi_low;
    else if (x >= 1.1875)
        t = (x - 1.5) / (1 + 1.5 * x), high = 9.82793723247329054082e-01, low = 1.39033110312309984516e-17;
    else if (x >= 0.6875)
        t = (x - 1) / (x + 1), high = 7.85398163397448278999e-01, low = 3.06161699786838301793e-17;
    else if (x >= 0.4375)
        t = (2 * x - 1) / (2 + x), high = 4.63647609000806093515e-01, low = 2.26987774529616870924e-17;
    const double z = t * t, w = z * z;
    const double odd = z * (3.33333333333329318027e-01 +
                            w * (1.42857142725034663711e-01 +
                                 w * (9.09088713343650656196e-02 +
                                      w * (6.66107313738753120669e-02 +
                                           w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)))));
    const double even =
        w *
        (-1.99999999998764832476e-01 +
         w * (-1.11111104054623557880e-01 +
              w * (-7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))));
    return high - ((t * (odd + even) - low) - t);
}
}  // namespace detail

/// Natural logarithm of a finite x > 0; -infinity at 0, NaN below.
inline double log(double x) noexcept {
    if (!(x > 0)) return x == 0 ? -std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
    if (x > std::numeric_limits<double>::max()) return x;
    double shift = 0;
    if (x < 0x1p-1022) x *= 0x1p54, shift = -54;
    // x = 2^k (1 + f), sqrt(1/2) <= 1 + f < sqrt(2)
    const std::int64_t bits = detail::bits_of(x) + (0x3ff0000000000000 - 0x3fe6a09e667f3bcd);
    const double k = static_cast<double>((bits >> 52) - 1023) + shift;
    const double f = detail::of_bits((bits & 0x000fffffffffffff) + 0x3fe6a09e667f3bcd) - 1;
    const double s = f / (2 + f), z = s * s, w = z * z, half = 0.5 * f * f;
    const double even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
    const double odd =
        z * (6.666666666666735130e-01 +
             w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
    return k * detail::ln2_high - ((half - (s * (half + (even + odd)) + k * detail::ln2_low)) - f);
}

/// e^x; 0 below -745.2, infinity above 709.78, NaN of NaN.
inline double exp(double x) noexcept {
    if (!(x <= 709.782712893383973096)) return x > 0 ? std::numeric_limits<double>::infinity() : x;
    if (x < -745.133219101941108420) return 0;
    // Rounds to the nearest integer without floor, which is a function call on plain SSE2.
    const double k = (x * 1.44269504088896338700 + 0x1.8p52) - 0x1.8p52;
    const double high = x - k * detail::ln2_high, low = k * detail::ln2_low, r = high - low, z = r * r;
    const double c = r - z * (1.66666666666666019037e-01 +
                              z * (-2.77777777770155933842e-03 +
                                   z * (6.61375632143793436117e-05 +
                                        z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08))));
    const double y = 1 - ((low - r * c / (2 - c)) - high);
    // Two steps: 2^k itself may be subnormal or infinite where y 2^k is not.
    const auto whole = static_cast<std::int64_t>(k), first = whole / 2;
    return y * detail::of_bits((first + 1023) << 52) * detail::of_bits((whole - first + 1023) << 52);
}

/// log(1 + x), x > -1, without cancellation: Kahan's log(u) x / (u - 1), u = 1 + x rounded.
inline double log1p(double x) noexcept {
    const double u = 1 + x;
    if (u == 1) return x;
    if (!(u > 0) || u > std::numeric_limits<double>::max()) return log(u);
    return log(u) * (x / (u - 1));
}

/// e^x - 1 without cancellation: Kahan's (u - 1) x / log(u), u = e^x rounded.
inline double expm1(double x) noexcept {
    if (x > 1 || x < -40) return exp(x) - 1;
    const double u = exp(x);
    if (u == 1 || !(x == x)) return x;
    return (u - 1) * (x / log(u));
}

/// Sine and cosine of |x| <= pi.
inline double sin(double x) noexcept {
    const double a = std::abs(x);
    if (a <= 0.78539816339744830962) return detail::sin_near_0(x, 0);
    const double value = a <= 2.35619449019234492885
                             ? detail::cos_near_0(detail::half_pi_high - a, detail::half_pi_low)
                             : detail::sin_near_0(2 * detail::half_pi_high - a, 2 * detail::half_pi_low);
    return std::copysign(1.0, x) * value;
}
inline double cos(double x) noexcept {
    const double a = std::abs(x);
    if (a <= 0.78539816339744830962) return detail::cos_near_0(x, 0);
    if (a <= 2.35619449019234492885) return detail::sin_near_0(detail::half_pi_high - a, detail::half_pi_low);
    return -detail::cos_near_0(2 * detail::half_pi_high - a, 2 * detail::half_pi_low);
}

/// Angle of (x, y) in [-pi, pi], finite arguments; 0 for (0, 0) with the sign of y. NaN of NaN.
inline double atan2(double y, double x) noexcept {
    const double a = std::abs(x), b = std::abs(y);
    if (b > 0x1p64 * a) return std::copysign(detail::half_pi_high, y);
    double angle = a == 0 && b == 0 ? 0 : detail::atan_of_positive(b / a);
    if (std::signbit(x)) angle = 2 * detail::half_pi_high - (angle - 2 * detail::half_pi_low);
    return std::copysign(angle, y);
}

/// Arc functions of |x| <= 1 without cancellation at either end.
inline double asin(double x) noexcept { return atan2(x, std::sqrt((1 - x) * (1 + x))); }
inline double acos(double x) noexcept { return atan2(std::sqrt((1 - x) * (1 + x)), x); }

/// planar_hg_pdf of medulla/phase.hpp with the functions above.
/// @param sin_half, cos_half of half the scattering angle; only the one that |g| -> 1 makes small is used
inline double planar_hg_pdf_of_half(double sin_half, double cos_half, double g) noexcept {
    const double half = g < 0 ? cos_half : sin_half, a = std::abs(g);
    return (1 - a) * (1 + a) / (2 * pi * ((1 - a) * (1 - a) + 4 * a * half * half));
}
/// @param t scattering angle [radians], |t| <= 2 pi
inline double planar_hg_pdf(double t, double g) noexcept {
    return g < 0 ? planar_hg_pdf_of_half(0, cos(t / 2), g) : planar_hg_pdf_of_half(sin(t / 2), 0, g);
}

}  // namespace medulla::sim2d::portable
