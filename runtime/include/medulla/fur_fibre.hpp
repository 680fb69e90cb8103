// The fur fibre: a material's parameters and what it needs of a pack, prepared once; its tables multiplied out.
// Rests on fur_parameters.hpp, pack.hpp and the contractions of lookup.hpp.
#pragma once

#include <cmath>

#include "medulla/config.hpp"
#include "medulla/fur_parameters.hpp"
#include "medulla/gaussian.hpp"
#include "medulla/lookup.hpp"
#include "medulla/pack.hpp"
#include "medulla/unfolded.hpp"

namespace medulla {

/// A table with the axes contracted that a material fixes: g, and absorption at 0 unless the pack knows what it leaves.
struct MaterialTable {
    TableView view;
    std::uint32_t sigma_axis = 0, last_axis = 0;  ///< the two axes left: sigma, and h or theta_i
    std::uint32_t absorption_axis = 0;            ///< a third one between them; 0: none
    AxisIndex<float> sigma_index = {}, last_index = {}, exit_index = {};
    alignas(32) float weight[max_rank] = {};  ///< [0, rank_stride) is set
};

MEDULLA_FN void prepare_table(const TableView& view, float g, MaterialTable& table,
                              bool keep_absorption = false) noexcept {
    table.view = view;
    table.absorption_axis = 0;
    start_contraction(view, table.weight);
    for (std::uint32_t k = 0; k < view.parameter_axes(); ++k) {
        switch (static_cast<Quantity>(view.layout.axes[k].quantity)) {
            case Quantity::sigma:
                table.sigma_axis = k;
                break;
            case Quantity::g:
                contract_axis(view, k, g, table.weight, table.weight);
                break;
            case Quantity::absorption:
                if (keep_absorption)
                    table.absorption_axis = k;
                else
                    contract_axis(view, k, 0.0f, table.weight, table.weight);
                break;
            default:
                table.last_axis = k;
        }
    }
    table.sigma_index = index_axis(view.axis(table.sigma_axis));
    table.last_index = index_axis(view.axis(table.last_axis));
    table.exit_index = index_axis(view.axis(view.parameter_axes()));
}

MEDULLA_HOT AxisPoint sigma_point(const MaterialTable& table, float sigma) noexcept {
    return axis_point(table.view, table.sigma_axis, table.sigma_index, sigma);
}
/// @param x h or theta_i
MEDULLA_HOT AxisPoint last_point(const MaterialTable& table, float x) noexcept {
    return axis_point(table.view, table.last_axis, table.last_index, x);
}
MEDULLA_HOT ExitPoint exit_point(const MaterialTable& table, float y) noexcept {
    return exit_point(table.view, table.exit_index, y);
}
/// Density of the contracted lobe at y, >= 0, as lobe() of lookup.hpp.
MEDULLA_FN float lobe(const MaterialTable& table, const Contraction& contraction, float y) noexcept {
    const float value = signed_lobe(table.view, contraction, exit_point(table, y));
    return value < 0 ? 0.0f : value;
}

/// The weights of a table at an absorption [optical radius], where it has kept that axis: in `room`, or its own.
MEDULLA_FN const float* weights_at(const MaterialTable& table, float absorption, float* room) noexcept {
    if (table.absorption_axis == 0) return table.weight;
    contract_axis(table.view, table.absorption_axis, absorption, table.weight, room);
    return room;
}

/// The lobe that is left at (sigma, h or theta_i).
MEDULLA_FN void contract(const MaterialTable& table, const float* weight, const AxisPoint& sigma, const AxisPoint& last,
                         Contraction& result) noexcept {
    contract_axis(table.view, table.sigma_axis, sigma, weight, result.weight);
    contract_axis(table.view, table.last_axis, last, result.weight, result.weight);
    result.inverse_integral = inverse_integral(table.view, result.weight);
}
MEDULLA_FN void contract(const MaterialTable& table, const AxisPoint& sigma, const AxisPoint& last,
                         Contraction& result) noexcept {
    contract(table, table.weight, sigma, last, result);
}
MEDULLA_FN void contract(const MaterialTable& table, float sigma, float last, Contraction& result) noexcept {
    contract(table, sigma_point(table, sigma), last_point(table, last), result);
}

/// The lengths that are left at (sigma, g, absorption): a spline in h.
MEDULLA_FN void contract_survival(const TableView& view, float sigma, float g, float absorbed,
                                  Contraction& result) noexcept {
    const float at[3] = {sigma, g, absorbed};
    start_contraction(view, result.weight);
    for (std::uint32_t k = 0; k < 3; ++k) contract_axis(view, k, at[k], result.weight, result.weight);
}
MEDULLA_FN float survival_coefficient(const TableView& view, const Contraction& c, std::uint32_t row) noexcept {
    return detail::row_sums(view, 3, row, c.weight).even;
}

/// Whether axis `i` of one table has the breakpoints of axis `k` of another: what is located once then serves both.
MEDULLA_FN bool same_axis(const TableView& a, std::uint32_t i, const TableView& b, std::uint32_t k) noexcept {
    const PackAxis &x = a.layout.axes[i], &y = b.layout.axes[k];
    if (x.quantity != y.quantity || x.spans != y.spans) return false;
    const std::size_t bytes = (x.spans + 1 + 2 * ghost_knots) * sizeof(Knot<float>);
    for (std::size_t j = 0; j < bytes; ++j)  // no memcmp on a GPU
        if (a.bytes[x.knots_offset + j] != b.bytes[y.knots_offset + j]) return false;
    return true;
}

/// A material, ready to be asked. It borrows the pack's bytes, allocates nothing and is constant once prepared.
template <int Channels = 3>
struct FurFibre {
    FurParameters<Channels> parameters;
    FurStatus status = FurStatus::bad_eta;
    bool scattered = false;                    ///< whether there are scattered lobes to read
    Four shift, deviation;                     ///< alpha_p, beta_p of Table 2 [radians]; lane 3 is nobody's
    WrappedGaussians azimuthal_gaussian = {};  ///< variance (p + 1) beta_n^2 (Eq. 16)
    MaterialTable azimuthal, back, forward;
    bool paired = false;                     ///< whether `back` and `forward` have the same axes
    TableView survival;                      ///< where the pack knows what the medulla's absorption leaves
    const UnfoldedTables* tables = nullptr;  ///< set by `unfold`: read instead of the factors
    /// Whether C^M from factors integrates to 1 to float precision, as unfolded ones do, or to that and what its dips
    /// below 0 hold (docs/bcsdf.md, 'Right at the ends'): a quarter of the time for a near field from scratch.
    bool exact_energy = true;
};

/// Prepares `fibre`. kappa = 0 or sigma_ms = 0 never reads a table and is exactly the hair model R + TT + TRT.
template <int Channels>
MEDULLA_FN FurStatus prepare(const FurParameters<Channels>& p, const PackView& pack,
                             FurFibre<Channels>& fibre) noexcept {
    fibre.parameters = p;
    fibre.scattered = false;
    fibre.survival = {};
    fibre.tables = nullptr;
    fibre.status = check(p);
    if (!usable(fibre.status)) return fibre.status;
    fibre.shift = Four(1.0f, -0.5f, -1.5f, 0.0f) * Four(p.alpha);
    fibre.deviation = Four(1.0f, 0.5f, 1.5f, 1.0f) * Four(p.beta_m);
    fibre.azimuthal_gaussian = wrapped_gaussians(p.beta_n, std::sqrt(2.0f) * p.beta_n, std::sqrt(3.0f) * p.beta_n);
    if (!(p.kappa > 0 && p.sigma_ms > 0)) return fibre.status;
    const TableView& azimuthal = pack[TableKind::azimuthal];
    const TableView& back = pack[TableKind::longitudinal_back];
    const TableView& forward = pack[TableKind::longitudinal_forward];
    if (!azimuthal) return fibre.status = FurStatus::no_azimuthal_table;
    if (!back || !forward) return fibre.status = FurStatus::no_longitudinal_table;
    if (absorbs(pack)) fibre.survival = pack[TableKind::survival];
    prepare_table(azimuthal, p.g, fibre.azimuthal, absorbs(pack));
    prepare_table(back, p.g, fibre.back);
    prepare_table(forward, p.g, fibre.forward);
    fibre.paired = true;
    for (std::uint32_t k = 0; k < back.layout.axis_count; ++k)
        fibre.paired = fibre.paired && same_axis(back, k, forward, k);
    fibre.scattered = true;
    return fibre.status;
}

/// Widest range of sqrt(sigma), upper over lower end, that four nodes are enough for: eta >= 1.163.
inline constexpr float widest_root_range = 1.4f;

/// How far from 1 a spline coefficient's integral over phi may be, for all of them to be divided by it: that moves a
/// lobe by the difference between neighbours times what the lobe changes between them (default pack: 8e-4, and 3e-6).
inline constexpr double most_imbalance = 1e-2;

/// Spans of theta_i next to 90 degrees that unfolding halves: there alone sigma and the lobes change fast enough that
/// the cubic between the pack's own breakpoints errs by more than 1e-5 (by 1e-4 to 5e-4).
inline constexpr std::uint32_t halved_spans = 5;

/// Multiplies the material's tables out into `tables`, which `fibre` then reads instead of the factors; takes half
/// a millisecond with the default pack. A field or sampler that was prepared before keeps to what it read then. false,
/// and the fibre reads its factors, where it does not scatter, and where they do not fit: longer or fewer than 3 spans
/// of an axis, longitudinal tables on different axes or not up to 90 degrees, a sigma axis that begins above the
/// material's (or, where absorption goes with sigma, ends below it), eta so near 1 that sigma's range is wide.
template <int Channels>
MEDULLA_FN bool unfold(FurFibre<Channels>& fibre, UnfoldedTables& tables) noexcept {
    fibre.tables = nullptr;
    if (!fibre.scattered || !fibre.paired) return false;
    const MaterialTable &around = fibre.azimuthal, &back = fibre.back, &forward = fibre.forward;
    const AxisView<float> offset = around.view.axis(around.last_axis), theta = back.view.axis(back.last_axis);
    const AxisView<float> phi = around.view.axis(around.view.parameter_axes());
    const AxisView<float> theta_r = back.view.axis(back.view.parameter_axes());
    const AxisView<float> sigma = around.view.axis(around.sigma_axis);
    const FurParameters<Channels>& p = fibre.parameters;
    const auto held = [&](float root) { return root < sigma.upper() ? root : sigma.upper(); };
    const auto sigma_at = [&](float cos_i) {
        return p.sigma_ms * p.kappa * p.eta / std::sqrt((p.eta - 1) * (p.eta + 1) + cos_i * cos_i);
    };
    const float low = held(std::sqrt(sigma_at(1))), high = held(std::sqrt(sigma_at(0)));
    // Both optical radii are per cos theta_t: where there is an axis of absorption it goes with sigma.
    if (fibre.survival &&
        (std::sqrt(sigma_at(0)) > sigma.upper() || !same_axis(fibre.survival, 3, around.view, around.last_axis)))
        return false;
    if (offset.spans > most_offset_spans || theta.spans < 3 || theta.spans + halved_spans > most_inclination_spans ||
        phi.spans > most_exit_spans || theta_r.spans > most_exit_spans || high > widest_root_range * low ||
        low < sigma.lower() || theta.upper() < 1 || !(offset.lower() == 0) || !(theta.lower() == 0))
        return false;
    float node[most_inclination_spans + 1];
    std::uint32_t nodes = 0;
    for (std::uint32_t j = 0; j <= theta.spans; ++j) {
        const float at = theta.breakpoint(std::int32_t(j));
        if (j > 0 && j + halved_spans > theta.spans) node[nodes] = 0.5f * (node[nodes - 1] + at), ++nodes;
        node[nodes++] = at;
    }
    if (!tables.offset.set_spline(offset) || !tables.inclination.set_nodes(nodes - 1, node) ||
        !tables.set_exits(phi, theta_r))
        return false;

    const float chebyshev[4] = {0.03806023f, 0.30865828f, 0.69134172f, 0.96193977f};  // nodes on [0, 1]
    tables.middle_root = 0.5f * (low + high), tables.inverse_range = high > low ? 1 / (high - low) : 0;
    tables.sigma_weights = cubic_weights(1, [&](float t) { return lagrange_weights(chebyshev, t); });
    double share[most_exit_spans + 3];  // of an exit's row in the integral
    const auto integral_of = [&](const float* to, std::uint32_t rows, std::uint32_t step) {
        double sum = 0;
        for (std::uint32_t k = 0; k < rows; ++k)
            sum += share[k] * (double(to[step * k]) + double(to[step * (rows + k)]));
        return sum;
    };
    tables.azimuth.integrate(phi, share);
    Contraction at_sigma, at;
    for (std::uint32_t s = 0; s < 4; ++s) {
        const float root = low + chebyshev[s] * (high - low), absorbed = root * root * p.sigma_ma / p.sigma_ms;
        const float* weight = weights_at(around, absorbed, at_sigma.weight);
        contract_axis(around.view, around.sigma_axis, root * root, weight, at_sigma.weight);
        for (std::uint32_t j = 0; j < offset.spans + 3; ++j) {
            scale_by_row(around.view, around.last_axis, j, at_sigma.weight, at.weight);
            float* to = tables.azimuthal + std::size_t(j) * 8 * tables.azimuth_rows + s;
            detail::exit_coefficients(around.view, at.weight, [&](std::uint32_t k, float positive, float negative) {
                to[4 * k] = positive, to[4 * (tables.azimuth_rows + k)] = negative;
            });
            const double integral = integral_of(to, tables.azimuth_rows, 4);
            if (!(std::abs(integral - 1) < most_imbalance)) return false;
            for (std::uint32_t k = 0; k < 2 * tables.azimuth_rows; ++k) to[4 * k] = float(double(to[4 * k]) / integral);
        }
    }
    for (std::uint32_t s = 0; fibre.survival && s < 4; ++s) {
        const float root = low + chebyshev[s] * (high - low), absorbed = root * root * p.sigma_ma / p.sigma_ms;
        contract_survival(fibre.survival, root * root, p.g, absorbed, at);
        for (std::uint32_t j = 0; j < offset.spans + 3; ++j)
            tables.survival[4 * j + s] = survival_coefficient(fibre.survival, at, j);
    }
    tables.longitude.integrate(theta_r, share);
    const std::uint32_t rows = tables.longitude_rows;
    for (std::uint32_t j = 0; j < nodes; ++j) {
        const float theta_i = from_spline_coordinate(Quantity::theta_i, node[j]);
        for (std::uint32_t side = 0; side < 2; ++side) {
            const MaterialTable& table = side == 0 ? back : forward;
            contract(table, sigma_at(std::cos(theta_i)), theta_i, at);
            float* to = tables.longitudinal + std::size_t(j) * 4 * rows + side;
            detail::exit_coefficients(table.view, at.weight, [&](std::uint32_t k, float positive, float negative) {
                to[2 * k] = positive, to[2 * (rows + k)] = negative;
            });
            // The lobe is held to >= 0 as it is read: what lies below counts as light, so that its integral is 1.
            const double below = double(detail::dips(
                theta_r, [&](std::uint32_t k, std::uint32_t negative) { return to[2 * (rows * negative + k)]; }));
            const double integral = integral_of(to, rows, 2) + below;
            // A signed low-rank sum with no positive integral is no density: it has no light to give.
            const double factor = integral > 1e-30 && integral < 1e30 ? 1 / integral : 0;
            for (std::uint32_t k = 0; k < 2 * rows; ++k) to[2 * k] = float(factor * double(to[2 * k]));
        }
    }
    fibre.tables = &tables;
    return true;
}

}  // namespace medulla
