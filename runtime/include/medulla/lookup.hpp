// Lobes straight from the factors: contract the parameter axes once, then read any number of exit directions.
// value(x_1 .. x_d, y) = sum over r of scale_r * prod over k of f_kr(x_k) * u_r(y), f and u cubic splines. Lobes at h =
// 0 and theta_i = 0 are their own mirror images: components are even or odd in y, and only y >= 0 is stored.
#pragma once

#include <cmath>
#include <cstdint>

#include "medulla/blocks.hpp"
#include "medulla/held_integral.hpp"
#include "medulla/pack.hpp"

namespace medulla {

/// Where in a table's parameter space: only the axes that the table has are read.
struct LobeQuery {
    float sigma = 0;       ///< optical radius of scattering [1], >= 0
    float g = 0;           ///< mean cosine [1]
    float h = 0;           ///< offset in the medulla [medulla radii], in [0, 1]
    float theta_i = 0;     ///< inclination [radians], in [0, pi/2]
    float absorption = 0;  ///< optical radius of absorption [1], >= 0

    MEDULLA_FN float operator[](Quantity quantity) const noexcept {
        switch (quantity) {
            case Quantity::sigma:
                return sigma;
            case Quantity::g:
                return g;
            case Quantity::absorption:
                return absorption;
            case Quantity::h:
                return h;
            default:
                return theta_i;
        }
    }
};

/// The parameter axes contracted: what is left is one spline over the exit direction.
struct Contraction {
    alignas(32) float weight[max_rank];  ///< per component, scale included; [0, rank_stride) is set
    float inverse_integral;              ///< 1 / integral over the exit direction, of the lobe as it is or held to >= 0
};

namespace detail {

/// numeric_limits' own is no device function.
MEDULLA_FN float not_a_number() noexcept {
    const std::uint32_t bits = 0x7fc00000u;
    float x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}

}  // namespace detail

/// weight[r] = scale_r: no axis contracted yet.
MEDULLA_FN void start_contraction(const TableView& table, float* weight) noexcept {
    std::memcpy(weight, table.bytes + table.layout.scales_offset, 4 * std::size_t(table.layout.rank_stride));
}

/// Where a value lies on an axis of a table: four rows from `span` and their weights.
struct AxisPoint {
    std::uint32_t span;
    SplineWeights<float> weights;
};

/// @param x a value of the axis's quantity; outside the axis it is held to its ends
MEDULLA_HOT AxisPoint axis_point(const TableView& table, std::uint32_t k, float x) noexcept {
    const AxisView<float> axis = table.axis(k);
    const Cell<float> cell = locate(axis, spline_coordinate(static_cast<Quantity>(table.layout.axes[k].quantity), x));
    return {cell.span, spline_weights(axis, cell)};
}

/// The same with a starting point for the search.
MEDULLA_HOT AxisPoint axis_point(const TableView& table, std::uint32_t k, const AxisIndex<float>& index,
                                 float x) noexcept {
    const AxisView<float> axis = table.axis(k);
    const Cell<float> cell =
        locate(axis, index, spline_coordinate(static_cast<Quantity>(table.layout.axes[k].quantity), x));
    return {cell.span, spline_weights(axis, cell)};
}

/// to[r] = from[r] * (factor r of axis k at the point).
MEDULLA_HOT void contract_axis(const TableView& table, std::uint32_t k, const AxisPoint& at, const float* from,
                               float* to) noexcept {
    detail::scale_by_blend(table, k, at.span, at.weights, from, to);
}
/// to[r] = from[r] * (row `row` of axis k)[r].
MEDULLA_FN void scale_by_row(const TableView& table, std::uint32_t k, std::uint32_t row, const float* from,
                             float* to) noexcept {
    const unsigned char* block = table.row(k, row);
    for (std::uint32_t first = 0; first < table.layout.rank_stride; first += rank_multiple) {
        const std::uint32_t bits = table.bits(first);
        const detail::Eight factor = detail::convert_eight(block, bits);
        detail::store_eight(detail::times(detail::load_eight(from + first), factor), to + first);
        block += bits;
    }
}
MEDULLA_FN void contract_axis(const TableView& table, std::uint32_t k, float x, const float* from, float* to) noexcept {
    contract_axis(table, k, axis_point(table, k, x), from, to);
}

/// Where an exit direction lies: on the stored half of the axis, and the sign of the odd components there.
struct ExitPoint {
    AxisPoint at;
    float sign;  ///< 1 for y >= 0, -1 below; NaN for a NaN
};

/// y in [-pi, pi] for an azimuth (any number of turns is taken off), else y itself.
MEDULLA_HOT float wrapped_exit(const TableView& table, float y) noexcept {
    if (table.layout.axes[table.parameter_axes()].quantity != static_cast<std::uint32_t>(Quantity::phi)) return y;
    if (y >= -float(pi) && y <= float(pi)) return y;
    return y - std::floor((y + float(pi)) * float(0.5 / pi)) * float(2 * pi);
}

/// @param y exit direction [radians]; an inclination outside [-pi/2, pi/2] is held to the end
MEDULLA_HOT ExitPoint exit_point(const TableView& table, float y) noexcept {
    const float x = wrapped_exit(table, y);
    return {axis_point(table, table.parameter_axes(), x < 0 ? -x : x), x < 0 ? -1.0f : 1.0f};
}
MEDULLA_HOT ExitPoint exit_point(const TableView& table, const AxisIndex<float>& index, float y) noexcept {
    const float x = wrapped_exit(table, y);
    return {axis_point(table, table.parameter_axes(), index, x < 0 ? -x : x), x < 0 ? -1.0f : 1.0f};
}

/// 1 / integral over the exit direction of the contracted lobe. A signed low-rank sum with no positive integral is no
/// density; it has no light to give and 0 is returned.
MEDULLA_FN float inverse_integral(const TableView& table, const float* weight) noexcept {
    detail::Eight sum = detail::zero_eight();
    for (std::uint32_t first = 0; first < table.even_stride(); first += rank_multiple)  // odd ones have no integral
        sum = detail::plus(sum, detail::times(detail::load_eight(weight + first),
                                              detail::load_eight(table, table.layout.integrals_offset, first)));
    const float total = detail::sum_of(sum);
    return total > 1e-30f && total < 1e30f ? 1.0f / total : 0.0f;
}

/// 1 / (integral over the exit direction of the contracted lobe held to >= 0). Reads the whole exit factor.
MEDULLA_FN float inverse_held_integral(const TableView& table, const float* weight) noexcept {
    const float inverse = inverse_integral(table, weight);
    return inverse / (1 + detail::dips(table, weight) * inverse);
}

/// Integral of lobe() over the exit direction; 0 where there is no lobe.
MEDULLA_FN float held_integral(const TableView& table, const Contraction& contraction) noexcept {
    const float inverse = inverse_held_integral(table, contraction.weight);
    return inverse > 0 ? contraction.inverse_integral / inverse : 0.0f;
}

/// Makes lobe() integrate to 1 to float precision.
MEDULLA_FN void hold_energy(const TableView& table, Contraction& contraction) noexcept {
    contraction.inverse_integral = inverse_held_integral(table, contraction.weight);
}

/// Contracts the parameter axes of `table` at `query`; values outside an axis are held to its ends. signed_lobe()
/// integrates to 1, lobe() to that and what its dips hold: the plain twin of contract(), four to five times as fast.
MEDULLA_FN Contraction contract_signed(const TableView& table, const LobeQuery& query) noexcept {
    Contraction result;
    start_contraction(table, result.weight);
    for (std::uint32_t k = 0; k < table.parameter_axes(); ++k) {
        const auto quantity = static_cast<Quantity>(table.layout.axes[k].quantity);
        contract_axis(table, k, query[quantity], result.weight, result.weight);
    }
    result.inverse_integral = table.has_exit() ? inverse_integral(table, result.weight) : 1.0f;
    return result;
}

/// The same so that lobe() integrates to 1, to float precision.
MEDULLA_FN Contraction contract(const TableView& table, const LobeQuery& query) noexcept {
    Contraction result = contract_signed(table, query);
    if (table.has_exit()) hold_energy(table, result);
    return result;
}

/// Density per radian at an exit direction, before anything is held to >= 0.
MEDULLA_HOT float signed_lobe(const TableView& table, const Contraction& contraction, const ExitPoint& to) noexcept {
    return detail::sum_of_blend(table, table.parameter_axes(), to.at.span, to.at.weights, contraction.weight, to.sign) *
           contraction.inverse_integral;
}
/// The same at exit direction y [radians] of a table with an exit axis.
MEDULLA_FN float signed_lobe(const TableView& table, const Contraction& contraction, float y) noexcept {
    return signed_lobe(table, contraction, exit_point(table, y));
}

/// Density per radian, >= 0, of integral 1 where `contract` made the contraction: a signed low-rank sum dips below 0
/// where the lobe is nearly 0, and holding it there lowers the error (docs/accuracy.md gives how far it dips).
MEDULLA_FN float lobe(const TableView& table, const Contraction& contraction, float y) noexcept {
    const float value = signed_lobe(table, contraction, y);
    return value < 0 ? 0.0f : value;  // a NaN stays one
}

/// Value of a table without an exit axis.
MEDULLA_FN float scalar(const TableView& table, const Contraction& contraction) noexcept {
    float total = 0;
    for (std::uint32_t r = 0; r < table.layout.rank_stride; ++r) total += contraction.weight[r];
    return total;
}

/// E = 1 - exp(-2 sigma sqrt(1 - h^2)): energy that the disc scatters of a ray at offset h (physics.md, section 2).
template <class T>
MEDULLA_FN T azimuthal_energy(T sigma, T h) noexcept {
    return -std::expm1(T(-2) * sigma * std::sqrt((T(1) - h) * (T(1) + h)));
}

/// 1 - exp(-2 sigma / cos theta_i): energy that the slab scatters, both sides together (physics.md, section 3).
template <class T>
MEDULLA_FN T longitudinal_energy(T sigma, T theta_i) noexcept {
    // The number next to pi/2 stands for 90 degrees, where any scatterer is met; its own cosine is 6e-17, or below 0.
    const T inclined = theta_i < T(0) ? -theta_i : theta_i;
    if (inclined >= T(pi / 2)) return sigma > T(0) ? T(1) : sigma;  // a NaN goes on
    return -std::expm1(T(-2) * sigma / std::cos(inclined));
}

/// Whether a pack knows what absorption leaves: its azimuthal table has that axis, and the lengths stand beside it.
MEDULLA_FN bool absorbs(const PackView& pack) noexcept {
    return pack[TableKind::survival] && pack[TableKind::azimuthal] && pack[TableKind::azimuthal].parameter_axes() == 4;
}

/// exp(-absorption length), in [0, 1]. A low-rank length below 0 would be light out of nowhere: it is 0.
template <class T>
MEDULLA_FN T survival_of(T absorption, T length) noexcept {
    return std::exp(-absorption * (length < T(0) ? T(0) : length));
}

/// Share of the disc's scattered light that absorption leaves; h in [-1, 1]. 1 at absorption 0; NaN above it where the
/// pack does not know.
MEDULLA_FN float survival(const PackView& pack, float sigma, float g, float h, float absorption) noexcept {
    if (absorption == 0) return 1;
    if (!absorbs(pack)) return detail::not_a_number();
    LobeQuery query;
    query.sigma = sigma, query.g = g, query.h = h < 0 ? -h : h, query.absorption = absorption;
    const TableView& table = pack[TableKind::survival];
    return survival_of(absorption, scalar(table, contract(table, query)));
}

/// C^N(phi; sigma, g, h) [1/radian], scattered light only; h in [-1, 1], phi = 0 forward. A `sigma` of 0 gives 0.
/// NaN where the pack has no azimuthal table, or absorption is asked for that it does not know.
MEDULLA_FN float azimuthal(const PackView& pack, float sigma, float g, float h, float phi,
                           float absorption = 0) noexcept {
    const TableView& table = pack[TableKind::azimuthal];
    if (!table) return detail::not_a_number();
    const float side = h < 0 ? -1.0f : 1.0f;
    LobeQuery query;
    query.sigma = sigma, query.g = g, query.h = side * h, query.absorption = absorption;
    const float energy = azimuthal_energy(sigma, h) * survival(pack, sigma, g, h, absorption);
    return energy * lobe(table, contract(table, query), side * phi);
}

enum class Side { back, forward };

/// C^M(theta_r; sigma, g, theta_i) of one side, normalised over theta_r in (-pi/2, pi/2) [1/radian].
/// NaN where the pack has no such table.
MEDULLA_FN float longitudinal(const PackView& pack, Side which, float sigma, float g, float theta_i,
                              float theta_r) noexcept {
    const TableView& table = pack[which == Side::back ? TableKind::longitudinal_back : TableKind::longitudinal_forward];
    if (!table) return detail::not_a_number();
    const float side = theta_i < 0 ? -1.0f : 1.0f;
    LobeQuery query;
    query.sigma = sigma, query.g = g, query.theta_i = side * theta_i;
    return lobe(table, contract(table, query), side * theta_r);
}

}  // namespace medulla
