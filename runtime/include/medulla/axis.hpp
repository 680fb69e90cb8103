// The one axis type and its one mapping pair: where a value lies among the breakpoints, and the four cubic
// B-spline weights there. Every stage interpolates with these, offline in double and in a renderer in float.
#pragma once

#include <cstdint>
#include <cstring>

#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// What an axis measures. The numbers are part of the pack format.
enum class Quantity : std::uint32_t {
    sigma = 0,       ///< optical radius of scattering, sigma_ms * kappa / cos theta_t [1], >= 0
    g = 1,           ///< mean cosine of the phase function [1], in (-1, 1)
    absorption = 2,  ///< optical radius of absorption [1], >= 0
    h = 3,           ///< offset in the medulla's cross-section [medulla radii], in [0, 1]
    theta_i = 4,     ///< inclination of the direction towards the light [radians], in [0, pi/2]
    phi = 5,      ///< azimuth of exit [radians], 0 = forward; axes run over [0, pi], the other half is its mirror image
    theta_r = 6,  ///< inclination of exit [radians]; axes run over [0, pi/2], the other half is its mirror image
};
inline constexpr std::uint32_t quantity_count = 7;

/// The variable in which lobes are smooth, and in which splines run: the quantity itself, but for
/// - optical radii, sqrt(sigma): near grazing exits lobes change with sigma / cos theta_r, over every scale of sigma;
/// - offsets, tan(asin(h) / 2) = h / (1 + sqrt(1 - h^2)), since lobes have the square-root behaviour of the chord;
/// - inclinations, the same of u = theta_i / (pi/2), since near grazing lobes change as (1 - u) log(1 - u).
template <class T>
MEDULLA_FN T spline_coordinate(Quantity quantity, T x) noexcept {
    if (quantity == Quantity::sigma || quantity == Quantity::absorption) return detail::math::sqrt(x);
    if (quantity != Quantity::h && quantity != Quantity::theta_i) return x;
    const T u = quantity == Quantity::h ? x : x * T(2 / pi);
    const T below = T(1) - u;  // below 0 by the rounding of pi/2, or outside the axis, whose end holds there
    return u / (T(1) + detail::math::sqrt((below < T(0) ? T(0) : below) * (T(1) + u)));
}

/// Inverse of spline_coordinate.
template <class T>
MEDULLA_FN T from_spline_coordinate(Quantity quantity, T c) noexcept {
    if (quantity == Quantity::sigma || quantity == Quantity::absorption) return c * c;
    if (quantity != Quantity::h && quantity != Quantity::theta_i) return c;
    const T u = T(2) * c / (T(1) + c * c);
    return quantity == Quantity::h ? u : u * T(pi / 2);
}

/// A breakpoint and the reciprocals that the de Boor recurrence divides by.
template <class T>
struct Knot {
    T t;         ///< t[i]
    T inverse1;  ///< 1 / (t[i+1] - t[i])
    T inverse2;  ///< 1 / (t[i+2] - t[i])
    T inverse3;  ///< 1 / (t[i+3] - t[i])
};

/// Ghost breakpoints on either side of the axis; they mirror it.
inline constexpr std::uint32_t ghost_knots = 2;

/// Breakpoints t[0] < ... < t[spans], spans >= 1, with ghosts: spans + 1 + 2 * ghost_knots knots, unaligned.
template <class T>
struct AxisView {
    const unsigned char* knots;
    std::uint32_t spans;

    /// Breakpoint i, -2 <= i <= spans + 2.
    MEDULLA_FN Knot<T> knot(std::int32_t i) const noexcept {
        Knot<T> k;
        std::memcpy(&k, knots + sizeof(Knot<T>) * static_cast<std::size_t>(i + std::int32_t(ghost_knots)), sizeof k);
        return k;
    }
    /// Number `field` of knot i (0: t, 1 to 3: the reciprocals), read alone: a lookup needs few of them.
    MEDULLA_FN T number(std::int32_t i, std::size_t field) const noexcept {
        T t;
        const auto index = static_cast<std::size_t>(i + std::int32_t(ghost_knots));
        std::memcpy(&t, knots + sizeof(Knot<T>) * index + sizeof(T) * field, sizeof t);
        return t;
    }
    MEDULLA_FN T breakpoint(std::int32_t i) const noexcept { return number(i, 0); }
    MEDULLA_FN T lower() const noexcept { return breakpoint(0); }
    MEDULLA_FN T upper() const noexcept { return breakpoint(std::int32_t(spans)); }
};

/// A value on an axis: t[span] <= x <= t[span + 1].
template <class T>
struct Cell {
    std::uint32_t span;
    T x;
};

/// The cell of `x` (a spline coordinate), clamped to the axis's ends. A NaN stays NaN in `x` and takes span 0, so that
/// it shows in the result.
template <class T>
MEDULLA_HOT Cell<T> locate(const AxisView<T>& axis, T x) noexcept {
    const T lower = axis.lower(), upper = axis.upper();
    x = x < lower ? lower : (x > upper ? upper : x);
    // Even breakpoints are where they would be expected; else a binary search, whose steps are masks and no branches.
    const T even = (x - lower) / (upper - lower) * T(axis.spans);
    std::uint32_t span = even > T(0) ? std::uint32_t(std::int32_t(even)) : 0;
    span = span < axis.spans ? span : axis.spans - 1;
    if (axis.breakpoint(std::int32_t(span)) <= x && x < axis.breakpoint(std::int32_t(span + 1))) return {span, x};
    span = 0;
    for (std::uint32_t n = axis.spans; n > 1;) {
        const std::uint32_t half = n / 2;
        span += half & (0u - std::uint32_t(axis.breakpoint(std::int32_t(span + half)) <= x));
        n -= half;
    }
    return {span, x};
}

/// Inverse of locate.
template <class T>
MEDULLA_FN T position(const Cell<T>& cell) noexcept {
    return cell.x;
}

/// Weights of the coefficients span .. span + 3; non-negative, sum 1.
template <class T>
struct SplineWeights {
    T w[4];
};

/// Cubic B-spline basis at a cell (de Boor's recurrence, all denominators are spans of distinct breakpoints).
template <class T>
MEDULLA_HOT SplineWeights<T> spline_weights(const AxisView<T>& axis, const Cell<T>& cell) noexcept {
    const auto i = std::int32_t(cell.span);
    const T k1 = axis.breakpoint(i + 1), k2 = axis.breakpoint(i + 2), k3 = axis.breakpoint(i + 3);
    const T x = cell.x;
    const T l1 = x - axis.breakpoint(i), l2 = x - axis.breakpoint(i - 1), l3 = x - axis.breakpoint(i - 2);
    const T r1 = k1 - x, r2 = k2 - x, r3 = k3 - x;
    const T n0 = r1 * axis.number(i, 1), n1 = l1 * axis.number(i, 1);
    const T a = n0 * axis.number(i - 1, 2), b = n1 * axis.number(i, 2);
    const T m0 = r1 * a, m1 = l2 * a + r2 * b, m2 = l1 * b;
    const T c = m0 * axis.number(i - 2, 3), d = m1 * axis.number(i - 1, 3), e = m2 * axis.number(i, 3);
    return {{r1 * c, l3 * c + r2 * d, l2 * d + r3 * e, l1 * e}};
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
