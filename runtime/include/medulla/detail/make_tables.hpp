// make_tables: where each array of dense tables lies, and what is in it. Rests on lookup.hpp's contractions.
//
// Along h, theta_i and the exits rows are the pack's own coefficients. Along g and sigma axes are made to measure: the
// factors are contracted at as many nodes as there are rows, and the rows are the spline through them. So it is along
// theta_i where sigma follows from it.
#pragma once

#include <cstring>

#include "medulla/config.hpp"
#include "medulla/detail/clamped_integral.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/detail/row_integral.hpp"
#include "medulla/detail/spline_solve.hpp"
#include "medulla/lookup.hpp"
#include "medulla/tables.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// Rows of a made-to-measure axis at most: its nodes stand on the stack.
inline constexpr std::uint32_t most_range_rows = 40;

/// The axis of g: lobes are analytic in g up to |g| = 1, and steps are a share of the distance to it. Steps of both
/// axes are such that lobes differ from the factors' by a relative L2 of 3e-4 at most over a coat's ranges, and of 6e-4
/// over the whole pack (tests/test_dense_tables.cpp); with steps twice as long it is 1e-3 and 8e-3.
struct GStep {
    MEDULLA_FN double operator()(double g) const noexcept { return 0.2 * (1 - detail::math::abs(g)); }
};
/// The axis of sqrt(sigma): lobes change with sigma / cos theta_r, over every scale of sigma; next to 0 they are
/// linear.
struct SigmaStep {
    MEDULLA_FN double operator()(double root) const noexcept { return 0.03 + 0.2 * root; }
};

/// All that is decided before memory is touched.
struct TablesPlan {
    TablesStatus status = TablesStatus::ok;
    DenseTables layout = {};
    AxisPlan axis[6];    ///< sigma, g, h, theta_i, phi, theta_r
    AxisPlan pack_exit;  ///< theta_r as the pack has it
    bool corrected = false;
    std::uint32_t stretches[6] = {};
    TableView azimuthal, side[2], survival;
    float g[most_range_rows] = {}, sigma[most_range_rows] = {};  ///< nodes
};

/// The optical radius of one material at theta_i.
MEDULLA_FN double sigma_at(const TableRanges& r, double theta_i) noexcept {
    const double sine = detail::math::sin(theta_i) / double(r.eta),
                 cosine = detail::math::sqrt((1 - sine) * (1 + sine));
    const double sigma = double(r.sigma_low) / cosine;
    return sigma < double(r.sigma_high) ? sigma : double(r.sigma_high);
}
/// Whether ranges are those of one material, and no wider.
MEDULLA_FN bool of_one_material(const TableRanges& r) noexcept {
    if (!(r.eta > 1 && within(r.eta, 1e9f)) || r.g_high > r.g_low) return false;
    const double high =
        double(r.sigma_low) * double(r.eta) / detail::math::sqrt((double(r.eta) - 1) * (double(r.eta) + 1));
    return detail::math::abs(double(r.sigma_high) - high) <= 1e-5 * high;
}
/// Parameter axis of a table by what it measures; its axis_count if there is none.
MEDULLA_FN std::uint32_t find_axis(const TableView& view, Quantity quantity) noexcept {
    std::uint32_t k = 0;
    while (k < view.layout.axis_count && view.layout.axes[k].quantity != static_cast<std::uint32_t>(quantity)) ++k;
    return k;
}
MEDULLA_FN AxisView<float> axis_of(const TableView& view, Quantity quantity) noexcept {
    return view.axis(find_axis(view, quantity));
}

/// Whether two tables have the same breakpoints along an axis.
MEDULLA_FN bool same_axis(const TableView& a, const TableView& b, Quantity quantity) noexcept {
    const AxisView<float> x = axis_of(a, quantity), y = axis_of(b, quantity);
    if (x.spans != y.spans) return false;
    const std::size_t bytes = (x.spans + 1 + 2 * ghost_knots) * sizeof(Knot<float>);
    for (std::size_t i = 0; i < bytes; ++i)  // no memcmp on a GPU
        if (x.knots[i] != y.knots[i]) return false;
    return true;
}

/// Range [low, high] within the axis that both tables share; false where they do not meet it.
MEDULLA_FN bool clip_range(const TableView& a, const TableView& b, Quantity quantity, float& low,
                           float& high) noexcept {
    if (!within(low, 1e30f) || !within(high, 1e30f) || low > high) return false;
    const AxisView<float> x = axis_of(a, quantity), y = axis_of(b, quantity);
    const float lower = from_spline_coordinate(quantity, x.lower() > y.lower() ? x.lower() : y.lower()),
                upper = from_spline_coordinate(quantity, x.upper() < y.upper() ? x.upper() : y.upper());
    low = low < lower ? lower : (low > upper ? upper : low);
    high = high < lower ? lower : (high > upper ? upper : high);
    return true;
}

MEDULLA_FN void plan_tables(const PackView& pack, const TableRanges& asked, TablesPlan& plan) noexcept {
    const auto fail = [&](TablesStatus status) { plan.status = status; };
    plan.azimuthal = pack[TableKind::azimuthal];
    plan.side[0] = pack[TableKind::longitudinal_back];
    plan.side[1] = pack[TableKind::longitudinal_forward];
    if (!plan.azimuthal) return fail(TablesStatus::no_azimuthal_table);
    if (!plan.side[0] || !plan.side[1]) return fail(TablesStatus::no_longitudinal_table);
    if (!same_axis(plan.side[0], plan.side[1], Quantity::theta_i) ||
        !same_axis(plan.side[0], plan.side[1], Quantity::theta_r))
        return fail(TablesStatus::bad_axes);
    if (absorbs(pack)) plan.survival = pack[TableKind::survival];
    if (plan.survival && !same_axis(plan.azimuthal, plan.survival, Quantity::h)) return fail(TablesStatus::bad_axes);

    if (asked.forms != form_bit(Scattering::published) && asked.forms != form_bit(Scattering::corrected))
        return fail(TablesStatus::two_forms);

    DenseTables& t = plan.layout;
    t.magic = tables_magic;
    t.absorbs = plan.survival ? 1u : 0u;
    t.ranges = asked;
    TableRanges& r = t.ranges;
    if (!clip_range(plan.azimuthal, plan.side[0], Quantity::g, r.g_low, r.g_high) ||
        !clip_range(plan.azimuthal, plan.side[0], Quantity::sigma, r.sigma_low, r.sigma_high) ||
        !(within(r.absorption, 1e9f) && r.absorption >= 0))
        return fail(TablesStatus::bad_ranges);
    if (!plan.survival) r.absorption = 0;  // Eq. 20 has all of the absorption then
    // One optical radius is a range of a hundredth about it: rows need a span.
    double low = detail::math::sqrt(double(r.sigma_low)), high = detail::math::sqrt(double(r.sigma_high));
    const double widest = double(axis_of(plan.azimuthal, Quantity::sigma).upper());
    if (high < low * 1.01 + 1e-3) high = low * 1.01 + 1e-3;
    if (high > widest) {
        high = widest;
        low = low < 0.99 * high ? low : 0.99 * high;
    }
    plan_range(low, high, SigmaStep{}, plan.axis[0]);
    const bool one_g = !(r.g_high > r.g_low);
    plan_range(double(r.g_low), one_g ? double(r.g_low) + 0.01 : double(r.g_high), GStep{}, plan.axis[1]);
    plan_axis(axis_of(plan.azimuthal, Quantity::h), plan.axis[2]);
    plan_axis(axis_of(plan.side[0], Quantity::theta_i), plan.axis[3]);
    plan_axis(axis_of(plan.azimuthal, Quantity::phi), plan.axis[4]);
    plan_axis(axis_of(plan.side[0], Quantity::theta_r), plan.axis[5]);
    plan.corrected = asked.forms == form_bit(Scattering::corrected);
    plan.pack_exit = plan.axis[5];
    if (plan.corrected) {
        if (plan.axis[3].spans + 3 > most_solved_rows || plan.axis[5].spans + 3 > most_solved_rows)
            return fail(TablesStatus::bad_axes);
        clamp_ends(plan.axis[3]);
        clamp_ends(plan.axis[5]);
    }
    t.one_material = of_one_material(asked) && plan.axis[3].spans + 3 <= most_solved_rows ? 1u : 0u;
    if (t.one_material && !plan.corrected) clamp_ends(plan.axis[3]);
    // Lookups take the sides of h and theta_i by their signs; beyond its upper end an axis clamps.
    if (!(detail::math::abs(plan.axis[2].lower()) < 1e-6) || !(detail::math::abs(plan.axis[3].lower()) < 1e-6))
        return fail(TablesStatus::bad_axes);
    SplineAxis* const axes[6] = {&t.sigma, &t.g, &t.h, &t.theta_i, &t.phi, &t.theta_r};
    std::uint64_t at = sizeof(DenseTables);
    const auto place = [&](std::uint64_t size) {
        const std::uint64_t from = (at + 63) / 64 * 64;
        at = from + size;
        return static_cast<std::uint32_t>(from);
    };
    for (int k = 0; k < 6; ++k) {
        if (!fits(plan.axis[k])) return fail(TablesStatus::bad_axes);
        plan.stretches[k] = plan.axis[k].stretches();
        axes[k]->spans = plan.axis[k].spans;
        axes[k]->rows = plan.axis[k].spans + 3;
        const std::uint32_t from =
            static_cast<std::uint32_t>(reinterpret_cast<const char*>(axes[k]) - reinterpret_cast<const char*>(&t));
        axes[k]->spans_offset = place(sizeof(SplineSpan) * plan.axis[k].spans) - from;
        axes[k]->start_offset = place(sizeof(std::uint16_t) * (plan.stretches[k] + 1)) - from;
        axes[k]->blocks_offset = place(sizeof(SplineBlock) * axes[k]->blocks()) - from;
    }
    if (t.sigma.rows > most_range_rows || t.g.rows > most_range_rows) return fail(TablesStatus::bad_ranges);
    t.g_rows = one_g ? 1 : t.g.rows;
    for (std::uint32_t i = 0; i < t.sigma.rows; ++i) {
        const double root = node_of(plan.axis[0], i);
        plan.sigma[i] = float(root * root);
    }
    for (std::uint32_t i = 0; i < t.g_rows; ++i) plan.g[i] = one_g ? r.g_low : float(node_of(plan.axis[1], i));
    const std::uint64_t planes = std::uint64_t(t.g_rows) * t.sigma.rows;
    const std::uint64_t floats[5] = {
        planes * t.h.rows * 2 * t.phi.rows, planes * t.h.rows * block_count(t.phi),
        std::uint64_t(t.longitudinal_planes()) * 2 * t.theta_r.rows * t.longitudinal_step(),
        std::uint64_t(t.longitudinal_planes()) * t.longitudinal_step() * block_count(t.theta_r),
        plan.survival ? planes * t.h.rows : 0};
    std::uint64_t all = at;
    for (const std::uint64_t n : floats) all += 64 + 4 * n;
    if (all > 0x7fffffffu) return fail(TablesStatus::too_large);
    std::uint32_t* const offsets[5] = {&t.azimuthal, &t.azimuthal_blocks, &t.longitudinal, &t.longitudinal_blocks,
                                       &t.survival};
    for (int k = 0; k < 5; ++k) *offsets[k] = place(4 * floats[k]);
    t.bytes = at + 16 * t.longitudinal_step();  // draws read four rows past the last
}

/// The factors of a table contracted at (sigma, g), and at an absorption that goes with sigma.
MEDULLA_APART void contract_node(const TableView& view, float sigma, float g, float absorption,
                                 float* weight) noexcept {
    start_contraction(view, weight);
    contract_axis(view, find_axis(view, Quantity::sigma), sigma, weight, weight);
    contract_axis(view, find_axis(view, Quantity::g), g, weight, weight);
    const std::uint32_t k = find_axis(view, Quantity::absorption);
    if (k < view.layout.axis_count) contract_axis(view, k, sigma * absorption, weight, weight);
}

/// Coefficients of a lobe over its exits. @param to of y >= 0 of the first row  @param step from exit to exit [floats]
MEDULLA_APART void expand_row(const TableView& view, const float* weight, float* to, std::size_t step) noexcept {
    const std::uint32_t exits = view.layout.axes[view.parameter_axes()].spans + 3;
    exit_coefficients(view, weight, [&](std::uint32_t k, float positive, float negative) {
        to[step * k] = positive;
        to[step * (exits + k)] = negative;
    });
}
/// The same for every row of its last parameter axis.
/// @param row_step from row to row [floats]
MEDULLA_FN void expand_rows(const TableView& view, const float* weight, float* to, std::size_t step,
                            std::size_t row_step) noexcept {
    const std::uint32_t last = view.parameter_axes() - 1, rows = view.layout.axes[last].spans + 3;
    alignas(32) float at[max_rank];
    for (std::uint32_t j = 0; j < rows; ++j, to += row_step) {
        scale_by_row(view, last, j, weight, at);
        expand_row(view, at, to, step);
    }
}

/// Lobes at the nodes of theta_i. @param weight contracted at sigma and g  @param row_step from node to node [floats]
MEDULLA_FN void expand_inclinations(const TablesPlan& plan, std::uint32_t side, const float* weight, float* to,
                                    std::size_t step, std::size_t row_step) noexcept {
    const TableView& view = plan.side[side];
    alignas(32) float at[max_rank];
    for (std::uint32_t i = 0; i < plan.axis[3].spans + 3; ++i) {
        const float theta = from_spline_coordinate(Quantity::theta_i, float(node_of(plan.axis[3], i)));
        contract_axis(view, find_axis(view, Quantity::theta_i), theta, weight, at);
        expand_row(view, at, to + i * row_step, step);
    }
}

/// Divides a row by the integral of its positive part and writes its cumulated integrals. A signed low-rank sum with no
/// positive integral is no density: it becomes even.
MEDULLA_APART void finish_row(const SplineAxis& axis, float* row, std::uint32_t stride, float* blocks) noexcept {
    const std::uint32_t count = block_count(axis), half = axis.blocks();
    const auto cumulate = [&] {
        float sum = 0;
        for (std::uint32_t b = 0; b < count; ++b) {
            const float* from = b < half ? row : row + std::size_t(axis.rows) * stride;
            const std::uint32_t first = (b < half ? b : b - half) * block_spans;
            for (std::uint32_t s = first; b < 2 * half && s < first + block_spans && s < axis.spans; ++s)
                sum += span_mass(axis.span(s), RowCoefficients(from + std::size_t(s) * stride, stride));
            blocks[b] = sum;
        }
        return sum;
    };
    float integral = cumulate();
    const bool density = integral > 1e-30f && integral < 1e30f;
    const float inverse = density ? axis.scale / integral : 0.5f * axis.scale / axis.end;
    for (std::uint32_t k = 0; k < 2 * axis.rows; ++k)
        row[std::size_t(k) * stride] = density ? row[std::size_t(k) * stride] * inverse : inverse;
    if (!density) integral = cumulate();
    for (std::uint32_t b = 0; b < count; ++b) blocks[b] = blocks[b] < integral ? blocks[b] / integral : 1.0f;
}

MEDULLA_FN void fill_tables(const TablesPlan& plan, DenseTables& t) noexcept {
    const std::uint32_t sigmas = t.sigma.rows, gs = t.g_rows;
    const auto floats = [&](std::uint32_t offset) { return const_cast<float*>(t.floats(offset)); };
    float *azimuthal = floats(t.azimuthal), *longitudinal = floats(t.longitudinal), *survival = floats(t.survival);
    const std::size_t h_step = std::size_t(2) * t.phi.rows * sigmas, g_azimuthal = t.h.rows * h_step,
                      plane = std::size_t(2) * t.theta_r.rows * t.longitudinal_step(),
                      g_longitudinal = t.theta_i.rows * plane, g_survival = std::size_t(t.h.rows) * sigmas;
    alignas(32) float weight[max_rank];
    for (std::uint32_t j = 0; j < gs; ++j) {
        for (std::uint32_t i = 0; i < sigmas; ++i) {
            contract_node(plan.azimuthal, plan.sigma[i], plan.g[j], t.ranges.absorption, weight);
            expand_rows(plan.azimuthal, weight, azimuthal + j * g_azimuthal + i, sigmas, h_step);
            for (std::uint32_t side = 0; side < 2 && !t.one_material; ++side) {
                contract_node(plan.side[side], plan.sigma[i], plan.g[j], 0, weight);
                if (plan.corrected)
                    expand_inclinations(plan, side, weight, longitudinal + j * g_longitudinal + side * sigmas + i,
                                        std::size_t(2) * sigmas, plane);
                else
                    expand_rows(plan.side[side], weight, longitudinal + j * g_longitudinal + side * sigmas + i,
                                std::size_t(2) * sigmas, plane);
            }
            if (!plan.survival) continue;
            contract_node(plan.survival, plan.sigma[i], plan.g[j], t.ranges.absorption, weight);
            for (std::uint32_t k = 0; k < t.h.rows; ++k)
                survival[j * g_survival + std::size_t(k) * sigmas + i] =
                    row_sums(plan.survival, find_axis(plan.survival, Quantity::h), k, weight).even;
        }
    }
    const auto solve = [](const SplineSolve& system, float* x, std::size_t step, std::size_t count, std::size_t next) {
        for (std::size_t k = 0; k < count; ++k) system.apply(x + k * next, step);
    };
    for (std::uint32_t i = 0; t.one_material && i < t.theta_i.rows; ++i) {
        const float theta = from_spline_coordinate(Quantity::theta_i, float(node_of(plan.axis[3], i)));
        for (std::uint32_t side = 0; side < 2; ++side) {
            const TableView& view = plan.side[side];
            contract_node(view, float(sigma_at(t.ranges, double(theta))), plan.g[0], 0, weight);
            contract_axis(view, find_axis(view, Quantity::theta_i), theta, weight, weight);
            expand_row(view, weight, longitudinal + side * t.theta_i.rows + i, t.longitudinal_step());
        }
    }
    if (plan.corrected) {
        // Lobes times the cosine are densities at the nodes, before splines are put through them: their integrals vary.
        const CosineProduct product(plan.pack_exit, plan.axis[5]);
        for (std::size_t row = 0; row < t.longitudinal_planes(); ++row)
            for (std::uint32_t i = 0; i < t.longitudinal_step(); ++i) {
                product.apply(longitudinal + row * plane + i, t.longitudinal_step());
                finish_row(t.theta_r, longitudinal + row * plane + i, t.longitudinal_step(),
                           floats(t.longitudinal_blocks));
            }
        const SplineSolve along_theta(plan.axis[3]);
        for (std::uint32_t j = 0; j < gs && !t.one_material; ++j)
            solve(along_theta, longitudinal + j * g_longitudinal, plane, plane, 1);
    }
    const SplineSolve along_sigma(plan.axis[0]);
    solve(along_sigma, azimuthal, 1, gs * g_azimuthal / sigmas, sigmas);
    if (t.one_material)
        solve(SplineSolve(plan.axis[3]), longitudinal, 1, plane / t.theta_i.rows, t.theta_i.rows);
    else
        solve(along_sigma, longitudinal, 1, gs * g_longitudinal / sigmas, sigmas);
    if (plan.survival) solve(along_sigma, survival, 1, gs * g_survival / sigmas, sigmas);
    if (gs > 1) {
        const SplineSolve along_g(plan.axis[1]);
        solve(along_g, azimuthal, g_azimuthal, g_azimuthal, 1);
        solve(along_g, longitudinal, g_longitudinal, g_longitudinal, 1);
        if (plan.survival) solve(along_g, survival, g_survival, g_survival, 1);
    }
    float* blocks = floats(t.azimuthal_blocks);
    for (std::size_t row = 0; row < std::size_t(gs) * t.h.rows; ++row)
        for (std::uint32_t i = 0; i < sigmas; ++i, blocks += block_count(t.phi))
            finish_row(t.phi, azimuthal + row * h_step + i, t.azimuthal_step(), blocks);
    blocks = floats(t.longitudinal_blocks);
    for (std::size_t row = 0; row < t.longitudinal_planes(); ++row)
        for (std::uint32_t i = 0; i < t.longitudinal_step(); ++i, blocks += block_count(t.theta_r))
            finish_row(t.theta_r, longitudinal + row * plane + i, t.longitudinal_step(), blocks);
}

}  // namespace detail

MEDULLA_FN std::size_t tables_bytes(const PackView& pack, const TableRanges& ranges) noexcept {
    detail::TablesPlan plan;
    detail::plan_tables(pack, ranges, plan);
    return plan.status == TablesStatus::ok ? std::size_t(plan.layout.bytes) : 0;
}

MEDULLA_FN TablesResult make_tables(const PackView& pack, const TableRanges& ranges, void* memory,
                                    std::size_t bytes) noexcept {
    detail::TablesPlan plan;
    detail::plan_tables(pack, ranges, plan);
    const auto fail = [](TablesStatus status) { return TablesResult{nullptr, status}; };
    if (plan.status != TablesStatus::ok) return fail(plan.status);
    if (memory == nullptr) return fail(TablesStatus::null_memory);
    if (reinterpret_cast<std::uintptr_t>(memory) % 64 != 0) return fail(TablesStatus::unaligned_memory);
    if (bytes < plan.layout.bytes) return fail(TablesStatus::too_little_memory);
    auto* const tables = static_cast<DenseTables*>(memory);
    std::memset(memory, 0, std::size_t(plan.layout.bytes));
    *tables = plan.layout;
    detail::SplineAxis* const axes[6] = {&tables->sigma,   &tables->g,   &tables->h,
                                         &tables->theta_i, &tables->phi, &tables->theta_r};
    for (int k = 0; k < 6; ++k) {
        char* const from = reinterpret_cast<char*>(axes[k]);
        detail::write_axis(plan.axis[k], plan.stretches[k], *axes[k],
                           reinterpret_cast<detail::SplineSpan*>(from + axes[k]->spans_offset),
                           reinterpret_cast<std::uint16_t*>(from + axes[k]->start_offset),
                           reinterpret_cast<detail::SplineBlock*>(from + axes[k]->blocks_offset));
    }
    detail::fill_tables(plan, *tables);
    return {tables, TablesStatus::ok};
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
