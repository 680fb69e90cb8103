// The fur fibre in the near field: prepared once per material, then once per (theta_i, h), then any number of exits.
// Rests on Yan et al. 2017, Sec. 4 with the errata of docs/bcsdf.md, and on the pack's C^M and C^N.
// Frame, value and measure stand at the top of medulla.hpp.
#pragma once

#include <cmath>

#include "medulla/config.hpp"
#include "medulla/cross_section.hpp"
#include "medulla/fur_parameters.hpp"
#include "medulla/gaussian.hpp"
#include "medulla/lookup.hpp"
#include "medulla/pack.hpp"
#include "medulla/scattered_lookup.hpp"
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

/// Widest range of sqrt(sigma), upper over lower end, that four nodes are enough for: eta >= 1.165.
inline constexpr float widest_root_range = 1.4f;

/// How far from 1 a spline coefficient's integral over phi may be, for all of them to be divided by it: that moves a
/// lobe by the difference between neighbours times what the lobe changes between them (default pack: 8e-4, and 3e-6).
inline constexpr double most_imbalance = 1e-2;

/// Spans of theta_i next to 90 degrees that unfolding halves: there alone sigma and the lobes change fast enough that
/// the cubic between the pack's own breakpoints errs by more than 1e-5 (by 1e-4 to 5e-4).
inline constexpr std::uint32_t halved_spans = 5;

/// Multiplies the material's tables out into `tables`, which `fibre` then reads instead of the factors; takes about
/// 1 ms with the default pack. false, and the fibre reads its factors, where they do not fit: longer or fewer than 3
/// spans of an axis, longitudinal tables on different axes or not up to 90 degrees, a sigma axis that begins above the
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

/// Each lobe's factors: its value is M N / cos^2 theta_i.
template <int Channels = 3>
struct LobeValues {
    float M[lobe_count] = {};            ///< longitudinal density [1 / radian]
    float N[lobe_count][Channels] = {};  ///< azimuthal density times energy [1 / radian]
};

template <int Channels = 3>
struct Colour {
    float value[Channels] = {};
};

/// sum M N: density of energy per radian^2 of (theta_r, phi).
template <int Channels>
MEDULLA_FN Colour<Channels> angular_density(const LobeValues<Channels>& lobes) noexcept {
    Colour<Channels> sum;
    for (int lobe = 0; lobe < lobe_count; ++lobe)
        for (int c = 0; c < Channels; ++c) sum.value[c] += lobes.M[lobe] * lobes.N[lobe][c];
    return sum;
}

/// Least cosine of an inclination that a float angle can mean: half a spacing of floats around pi/2, 2^-24.5. A
/// direction nearer to the axis than that is the axis itself, where a fibre has no cross-section: lobes are 0 there.
inline constexpr float least_cosine = 4.3e-8f;

/// The part that theta_i decides.
template <int Channels = 3>
struct Longitudinal {
    bool valid = false;
    float theta_i = 0;
    float scale = 0;     ///< 1 / cos^2 theta_i of Eq. 12
    float sigma = 0;     ///< optical radius sigma_ms kappa / cos theta_t [1]
    float absorbed = 0;  ///< optical radius of absorption, sigma_ma kappa / cos theta_t [1]
    Inclination<float> at = {};
    Absorption<Channels> absorption = {};
    TruncatedGaussians gaussian = {};
    Four sigma_point;           ///< where sigma lies in unfolded tables; set where
    LongitudinalPoint point;    ///< set where the fibre scatters and its tables are unfolded
    Contraction back, forward;  ///< set where the fibre scatters and they are not
    Contraction survival;       ///< of the axes before h, where the fibre has such a table and it is not unfolded
};

/// Sets m.back and m.forward: the longitudinal factors contracted to m.sigma and theta_i.
template <int Channels>
MEDULLA_FN void contract_longitudinal(const FurFibre<Channels>& fibre, float theta_i,
                                      Longitudinal<Channels>& m) noexcept {
    const float inclined = theta_i < 0 ? -theta_i : theta_i;
    if (!fibre.paired) {
        contract(fibre.back, m.sigma, inclined, m.back);
        contract(fibre.forward, m.sigma, inclined, m.forward);
    } else {
        const AxisPoint at_sigma = sigma_point(fibre.back, m.sigma);
        const AxisPoint at_theta = last_point(fibre.back, inclined);
        contract(fibre.back, at_sigma, at_theta, m.back);
        contract(fibre.forward, at_sigma, at_theta, m.forward);
    }
    if (fibre.exact_energy) hold_energy(fibre.back.view, m.back), hold_energy(fibre.forward.view, m.forward);
}

/// @param theta_i [radians], in (-pi/2, pi/2); outside it the result is not valid and every lobe is 0
template <int Channels>
MEDULLA_FN void longitudinal_at(const FurFibre<Channels>& fibre, float theta_i, Longitudinal<Channels>& m) noexcept {
    m.valid = false;
    if (!usable(fibre.status) || !detail::within(theta_i, float(pi / 2))) return;
    const float cos_i = std::cos(theta_i);
    if (!(cos_i >= least_cosine)) return;
    m.valid = true;
    m.theta_i = theta_i;
    m.scale = 1 / (cos_i * cos_i);
    m.at = inclination(fibre.parameters.eta, cos_i, fibre.parameters.fresnel);
    m.absorption = absorption(fibre.parameters, m.at.inverse_cos_t, static_cast<bool>(fibre.survival));
    m.gaussian = truncated_gaussians(fibre.shift - Four(theta_i), fibre.deviation);
    m.sigma = fibre.parameters.sigma_ms * fibre.parameters.kappa * m.at.inverse_cos_t;
    m.absorbed = fibre.parameters.sigma_ma * fibre.parameters.kappa * m.at.inverse_cos_t;
    if (!fibre.scattered) return;
    if (fibre.tables == nullptr) {
        if (fibre.survival) contract_survival(fibre.survival, m.sigma, fibre.parameters.g, m.absorbed, m.survival);
        return contract_longitudinal(fibre, theta_i, m);
    }
    m.sigma_point = fibre.tables->sigma_at(m.sigma);
    m.point = fibre.tables->longitudinal_at(std::abs(theta_i));
}

/// C^M back and forward straight from the factors. @param theta_r seen from the side of theta_i
template <int Channels>
MEDULLA_FN BackForward contracted_sides(const FurFibre<Channels>& fibre, const Longitudinal<Channels>& m,
                                        float theta_r) noexcept {
    const ExitPoint at_back = exit_point(fibre.back, theta_r);
    const ExitPoint at_forward = fibre.paired ? at_back : exit_point(fibre.forward, theta_r);
    const float back = signed_lobe(fibre.back.view, m.back, at_back);
    const float forward = signed_lobe(fibre.forward.view, m.forward, at_forward);
    return {back < 0 ? 0.0f : back, forward < 0 ? 0.0f : forward};
}

/// M of the three unscattered lobes and, where `scattered`, M^s.
template <int Channels>
MEDULLA_FN void longitudinal_lobes(const FurFibre<Channels>& fibre, const Longitudinal<Channels>& m, float theta_r,
                                   float phi, bool scattered, LobeValues<Channels>& lobes) noexcept {
    const Four M = m.gaussian.pdf(theta_r);
    for (int p = 0; p < 3; ++p) lobes.M[p] = lane(M, p);
    if (!scattered) return;
    const float side = m.theta_i < 0 ? -theta_r : theta_r;
    const BackForward sides =
        fibre.tables ? fibre.tables->longitudinal_density(m.point, side) : contracted_sides(fibre, m, side);
    lobes.M[3] = lobes.M[4] = blend_sides(sides, std::abs(wrap_angle(phi)) * float(1 / pi));
}

/// The fibre lit from theta_i at offset h: what is left is a function of the exit (theta_r, phi).
template <int Channels = 3>
struct NearField {
    const FurFibre<Channels>* fibre = nullptr;
    Longitudinal<Channels> longitudinal;
    bool valid = false, scattered = false;
    float side = 1;                 ///< sign of h
    float offset = 0;               ///< |h'| / kappa, set where `scattered`
    float centre[lobe_count] = {};  ///< Phi_p and Phi^s_p + pi [radians]
    Energies<Channels> energy = {};
    AzimuthalPoint point;   ///< set where `scattered` and the fibre's tables are unfolded
    Contraction azimuthal;  ///< set where `scattered` and they are not

    /// M and N of every lobe at (theta_r, phi) [radians]; all 0 outside theta_r in [-pi/2, pi/2] or for |phi| > 1e4.
    MEDULLA_FN LobeValues<Channels> lobes(float theta_r, float phi) const noexcept {
        LobeValues<Channels> result;
        if (!answers(theta_r, phi)) return result;
        const ScatteredDensities s = scattered_densities(theta_r, phi);
        const Four M = longitudinal.gaussian.pdf(theta_r), D = fibre->azimuthal_gaussian.pdf(four_at(centre), phi);
        for (int p = 0; p < lobe_count; ++p) {
            const float density = p < 3 ? lane(D, p) : s.D[p - 3];
            result.M[p] = p < 3 ? lane(M, p) : s.M;
            for (int c = 0; c < Channels; ++c) result.N[p][c] = energy.A[p][c] * density;
        }
        return result;
    }
    /// S of Eq. 12.
    MEDULLA_FN Colour<Channels> eval(float theta_r, float phi) const noexcept {
        Colour<Channels> sum;
        if (!answers(theta_r, phi)) return sum;
        const ScatteredDensities s = scattered_densities(theta_r, phi);
        const Four unscattered =
            joint_pdf(longitudinal.gaussian, fibre->azimuthal_gaussian, four_at(centre), theta_r, phi);
        const float R = lane(unscattered, 0), TT = lane(unscattered, 1), TRT = lane(unscattered, 2);
        const float TTs = s.M * s.D[0], TRTs = s.M * s.D[1];
        for (int c = 0; c < Channels; ++c)
            sum.value[c] = longitudinal.scale * ((R * energy.A[0][c] + TT * energy.A[1][c]) +
                                                 (TRT * energy.A[2][c] + TTs * energy.A[3][c]) + TRTs * energy.A[4][c]);
        return sum;
    }

  private:
    MEDULLA_HOT bool answers(float theta_r, float phi) const noexcept {
        return valid && detail::within(theta_r, float(pi / 2)) && detail::within(phi, 1e4f);
    }
    MEDULLA_HOT ScatteredDensities scattered_densities(float theta_r, float phi) const noexcept {
        ScatteredDensities at;
        if (!scattered) return at;
        const float inclined = longitudinal.theta_i < 0 ? -theta_r : theta_r;
        const float y[2] = {side * (phi - centre[3]), side * (phi - centre[4])};
        if (fibre->tables == nullptr) {
            at.M = blend_sides(contracted_sides(*fibre, longitudinal, inclined),
                               std::abs(wrap_angle(phi)) * float(1 / pi));
            for (int p = 0; p < 2; ++p) at.D[p] = lobe(fibre->azimuthal, azimuthal, y[p]);
            return at;
        }
        return medulla::scattered_densities(*fibre->tables, point, longitudinal.point, y[0], y[1], inclined, phi);
    }
};

/// Share of the scattered light that the medulla's absorption leaves at an offset [medulla radii]; 1 where Eq. 20's T_b
/// has it.
template <int Channels>
MEDULLA_FN float survival_at(const FurFibre<Channels>& fibre, const Longitudinal<Channels>& m, float offset) noexcept {
    if (!fibre.survival) return 1;
    if (fibre.tables != nullptr) return survival_of(m.absorbed, fibre.tables->survival_length(m.sigma_point, offset));
    const AxisPoint at = axis_point(fibre.survival, 3, offset);
    float length = 0;
    for (std::uint32_t t = 0; t < 4; ++t)
        length += at.weights.w[t] * survival_coefficient(fibre.survival, m.survival, at.span + t);
    return survival_of(m.absorbed, length);
}
template <int Channels>
MEDULLA_FN Four survival_at(const FurFibre<Channels>& fibre, const Longitudinal<Channels>& m, Four offset) noexcept {
    return Four(survival_at(fibre, m, lane(offset, 0)), survival_at(fibre, m, lane(offset, 1)),
                survival_at(fibre, m, lane(offset, 2)), survival_at(fibre, m, lane(offset, 3)));
}

/// Energies of the five lobes on a path (or four), with what absorption leaves of the scattered ones.
template <int Channels, class T>
MEDULLA_FN Energies<Channels, T> energies_at(const FurFibre<Channels>& fibre, const Longitudinal<Channels>& m,
                                             const Path<T>& path, bool scattered) noexcept {
    Energies<Channels, T> e = energies(path, m.absorption, scattered);
    if (!scattered || !fibre.survival) return e;
    const T left = survival_at(fibre, m, magnitude(path.h_inside) * T(1 / fibre.parameters.kappa));
    for (int c = 0; c < Channels; ++c) e.A[3][c] = e.A[3][c] * left, e.A[4][c] = e.A[4][c] * left;
    return e;
}

/// Scattered lobes that carry less than this of the incident energy in every channel are left out: it bounds the error
/// of the fibre's albedo, and it is what a float sum of energies near 1 cannot show.
inline constexpr float negligible_energy = 5.9604645e-8f;  // 2^-24

/// Sets `near` to another offset under the same theta_i: near.longitudinal is set and valid, h in [-1, 1].
template <int Channels>
MEDULLA_FN void offset_at(NearField<Channels>& near, float h) noexcept {
    const FurFibre<Channels>& fibre = *near.fibre;
    const Longitudinal<Channels>& m = near.longitudinal;
    const FurParameters<Channels>& p = fibre.parameters;
    const Path<float> path = trace(m.at, p.kappa, p.layers, h, std::sqrt((1 - h) * (1 + h)));
    near.valid = true;
    near.side = h < 0 ? -1.0f : 1.0f;
    for (int k = 0; k < 3; ++k) near.centre[k] = unscattered_centre(k, path.gamma_i, path.gamma_t);
    for (int k = 1; k < 3; ++k) near.centre[k + 2] = scattered_centre(k, path.gamma_i, path.gamma_t) + float(pi);
    near.energy = energies_at(fibre, m, path, fibre.scattered);
    near.scattered = false;
    for (int c = 0; c < Channels; ++c)
        near.scattered = near.scattered || near.energy.A[3][c] + near.energy.A[4][c] > negligible_energy;
    if (!near.scattered) return;
    const float offset = std::abs(path.h_inside) / p.kappa;
    near.offset = offset < 1 ? offset : 1.0f;
    if (fibre.tables != nullptr) {
        near.point = fibre.tables->azimuthal_at(m.sigma_point, near.offset);
        return;
    }
    const float* weight = weights_at(fibre.azimuthal, m.absorbed, near.azimuthal.weight);
    contract(fibre.azimuthal, weight, sigma_point(fibre.azimuthal, m.sigma), last_point(fibre.azimuthal, near.offset),
             near.azimuthal);
}

/// Sets `near`, whose fibre and longitudinal part are set, to an offset. @param h [fibre radii], in [-1, 1]; outside it
/// every lobe is 0
template <int Channels>
MEDULLA_FN void set_offset(NearField<Channels>& near, float h) noexcept {
    near.valid = near.scattered = false;
    if (near.longitudinal.valid && detail::within(h, 1.0f)) offset_at(near, h);
}

/// @param h offset [fibre radii], in [-1, 1]; outside it every lobe is 0
template <int Channels>
MEDULLA_FN void near_field(const FurFibre<Channels>& fibre, float theta_i, float h,
                           NearField<Channels>& near) noexcept {
    near.fibre = &fibre;
    longitudinal_at(fibre, theta_i, near.longitudinal);
    set_offset(near, h);
}

/// M and N of every lobe for one offset (the plain way in; keep a NearField where many exits are asked).
template <int Channels>
MEDULLA_FN LobeValues<Channels> near_lobes(const FurFibre<Channels>& fibre, float theta_i, float theta_r, float phi,
                                           float h) noexcept {
    NearField<Channels> near;
    near_field(fibre, theta_i, h, near);
    return near.lobes(theta_r, phi);
}

/// S of Eq. 12 for one offset.
template <int Channels>
MEDULLA_FN Colour<Channels> eval(const FurFibre<Channels>& fibre, float theta_i, float theta_r, float phi,
                                 float h) noexcept {
    NearField<Channels> near;
    near_field(fibre, theta_i, h, near);
    return near.eval(theta_r, phi);
}

}  // namespace medulla
