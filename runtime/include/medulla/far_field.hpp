// The far field and everything between: lobes averaged over offsets h in [h1, h2] (Eqs. 22 and 26 of Yan et al. 2017).
// Rests on near_field.hpp; by quadrature that follows the narrow Gaussians instead of the paper's closed forms, which
// divide by powers of a and linearise at the rim: docs/bcsdf.md, 'Far field', has the derivation and the errors.
#pragma once

#include <cmath>

#include "medulla/config.hpp"
#include "medulla/gauss_legendre.hpp"
#include "medulla/near_field.hpp"

namespace medulla {

/// An interval of offsets [fibre radii], -1 <= low <= high <= 1.
struct OffsetRange {
    float low = -1, high = 1;
};

/// How many nodes are spent: each step takes the next larger Gauss rule on every piece.
enum class FarQuality : int { draft = -1, standard = 0, fine = 1 };

namespace detail {

inline constexpr int most_cuts = 40;
/// Deviations to either side of a Gaussian's centre within which it is integrated, and what that leaves out: 1.4e-4 of
/// the energy of every offset, which the rest then carries.
inline constexpr float reach = 3.8f, within_reach = 1 / 0.99985530f;
/// Above this deviation [radians] the whole circle is within reach, nearly, and no offset is skipped.
inline constexpr float wide_deviation = 0.8f;

/// Offsets in gamma_i = asin h, in ascending order, where a lobe's integrand changes character: the range's ends, the
/// medulla's rim, the grading towards the fibre's rim, the caustic of TRT. Between two cuts Phi_p is monotone.
struct Cuts {
    int count = 0;
    float gamma[most_cuts];
    MEDULLA_FN void insert(float x, float low, float high) noexcept {
        if (!(x > low && x < high) || count == most_cuts) return;
        int i = count++;
        for (; i > 0 && gamma[i - 1] > x; --i) gamma[i] = gamma[i - 1];
        gamma[i] = x;
    }
};

}  // namespace detail

/// Node of the scattered lobes' quadrature over h: all that does not depend on the exit.
template <int Channels>
struct ScatteringNode {
    float offset, side;    ///< |h'| / kappa, sign of h
    float centre[2];       ///< Phi^s_p + pi [radians]
    float A[2][Channels];  ///< energy times the node's share of the range
    float share[2];        ///< of TTs and TRTs in all lobes' energy there, times the node's share of the range
};

inline constexpr int most_scattering_nodes = 96;

/// The fibre lit from theta_i over a range of offsets; a function of the exit (theta_r, phi). One offset alone
/// (low == high, or nearly) is the near field.
template <int Channels = 3>
struct FarField {
    NearField<Channels> near;  ///< its longitudinal part, and the whole of it for a range of one offset
    bool valid = false, single = false;
    int quality = 0;
    float gamma_low = 0, gamma_high = 0;  ///< asin of the range [radians]
    float inverse_width = 0;              ///< 1 / (sin gamma_high - sin gamma_low)
    float rim = 1;                        ///< offset of the medulla's rim, min(1, kappa eta') [fibre radii]
    float gamma_rim = 0;                  ///< asin rim [radians]
    detail::Cuts cuts[3];                 ///< of R, TT, TRT
    int nodes = 0;                        ///< scattering nodes
    ScatteringNode<Channels> node[most_scattering_nodes];
    float sigma_weight[max_rank];  ///< without unfolded tables: the azimuthal one contracted to sigma and absorption

    MEDULLA_FN const FurFibre<Channels>& fibre() const noexcept { return *near.fibre; }
    MEDULLA_FN LobeValues<Channels> lobes(float theta_r, float phi) const noexcept;
    MEDULLA_FN Colour<Channels> eval(float theta_r, float phi) const noexcept;
};

namespace detail {

/// A point of the quadrature, or four: h, cos gamma_i, and dh over the variable that is stepped.
template <class T>
struct Offset {
    T h, cos_i, dh;
};

/// Stepping psi inside the medulla, h = rim sin(psi): s_m = kappa cos(psi) is then smooth at the medulla's rim.
/// Outside, and where the medulla reaches the fibre's rim, psi is gamma_i itself.
template <class T>
MEDULLA_FN Offset<T> offset_inside(float rim, T psi) noexcept {
    const auto sc = real_math::sine_cosine(psi);
    const T along = T(rim) * sc.cosine;  // 1 - h^2 without a difference that rounding could make negative
    return {T(rim) * sc.sine, square_root(T((1 - rim) * (1 + rim)) + along * along), along};
}
template <class T>
MEDULLA_FN Offset<T> offset_at_angle(T gamma) noexcept {
    const auto sc = real_math::sine_cosine(gamma);
    return {sc.sine, sc.cosine, sc.cosine};
}

/// Nodes 4 j .. 4 j + 3 of a rule over middle +- half, and their weights.
MEDULLA_FN Four rule_nodes(const GaussRule& rule, int j, float middle, float half) noexcept {
    const float a = half * rule.x[2 * j], b = half * rule.x[2 * j + 1];
    return Four(middle - a, middle + a, middle - b, middle + b);
}
MEDULLA_FN Four rule_weights(const GaussRule& rule, int j) noexcept {
    return Four(rule.w[2 * j], rule.w[2 * j], rule.w[2 * j + 1], rule.w[2 * j + 1]);
}

/// Phi_p as a function of gamma_i, and its slope.
struct Exit {
    float phi, slope;
};
MEDULLA_FN Exit exit_of(int p, float inverse_index, float index_excess, float gamma) noexcept {
    const auto sc = real_math::sine_cosine(gamma);
    const float x = std::sqrt(index_excess + sc.cosine * sc.cosine);
    const float gamma_t = p == 0 ? 0.0f : real_math::angle(sc.sine * inverse_index, x * inverse_index);
    return {unscattered_centre(p, gamma, gamma_t), 2 * float(p) * sc.cosine / x - 2};
}

/// gamma_i in [a, b] where Phi_p = phi; Phi_p is monotone there and takes the value. Only places the ends of a
/// quadrature, so 2 % of a deviation is near enough.
MEDULLA_FN float invert_exit(int p, float inverse_index, float index_excess, float phi, float a, Exit at_a, float b,
                             Exit at_b, float tolerance) noexcept {
    if (p == 0) return -0.5f * phi;
    if (p == 1) {  // d = gamma_i - gamma_t: sin(gamma_t + d) = eta' sin gamma_t
        const float d = 0.5f * (float(pi) - phi);
        return d + std::atan2(std::sin(d) * inverse_index, 1 - std::cos(d) * inverse_index);
    }
    // Newton kept in its bracket by bisection; a slope of 0 at a caustic is one end of it.
    const bool rising = at_b.phi > at_a.phi;
    float low = a, high = b, x = a + (b - a) * (phi - at_a.phi) / (at_b.phi - at_a.phi);
    for (int i = 0; i < 30; ++i) {
        if (!(x > low && x < high)) x = 0.5f * (low + high);
        const Exit at = exit_of(p, inverse_index, index_excess, x);
        const float error = at.phi - phi;
        if (std::abs(error) < tolerance) break;
        ((error > 0) == rising ? high : low) = x;
        x = at.slope != 0 ? x - error / at.slope : 0.5f * (low + high);
    }
    return x;
}

/// psi of an offset given as gamma_i, held to the medulla.
template <int Channels>
MEDULLA_FN float medulla_angle(const FarField<Channels>& far, float gamma) noexcept {
    if (!(far.rim < 1)) return gamma;
    const float s = real_math::sine_cosine(gamma).sine / far.rim, t = s > 1 ? 1.0f : (s < -1 ? -1.0f : s);
    return real_math::angle(t, std::sqrt((1 - t) * (1 + t)));
}

/// Gauss rule for `deviations` of a Gaussian under one piece of `length` [radians]: errors of 1e-5 and less
/// (docs/bcsdf.md). A long piece sees the amplitude fall to 0 at the fibre's rim, or rise to a dense medulla's.
MEDULLA_FN int rule_for(float deviations, float length) noexcept {
    const int amplitude = length < 1.2f ? 0 : (length < 2.4f ? 1 : 2);
    const int gaussian = deviations < 5.5f ? 0 : (deviations < 9 ? 1 : (deviations < 12.4f ? 2 : 3));
    return amplitude > gaussian ? amplitude : gaussian;
}

/// Sum over the nodes of [a, b] in gamma_i of weight * visit(path at h), for lobe p.
/// @param density most deviations of the lobe's Gaussian per radian of gamma_i
template <int Channels, class Visit>
MEDULLA_FN void integrate_piece(const FarField<Channels>& far, int p, float a, float b, float density,
                                Visit&& visit) noexcept {
    const auto& parameters = far.fibre().parameters;
    const auto& m = far.near.longitudinal;
    // Through the medulla (R sees none of it) and not so short that the ends' rounding in psi would show.
    const bool inside =
        p > 0 && std::abs(a + b) < 2 * far.gamma_rim && far.rim < 1 && far.gamma_high - far.gamma_low > 0.01f;
    if (inside) {
        a = medulla_angle(far, a), b = medulla_angle(far, b);
        // Nodes are even in psi, so deviations count there: d gamma_i / d psi is greatest next to psi = 0.
        const Offset<float> at = offset_inside(far.rim, a > 0 ? a : (b < 0 ? b : 0.0f));
        density *= at.dh / at.cos_i;
    }
    const float middle = 0.5f * (a + b), half = 0.5f * (b - a);
    const int index = rule_for(density * (b - a), b - a) + far.quality;
    const GaussRule rule = gauss_rule(index < 0 ? 0 : (index >= gauss_rules ? gauss_rules - 1 : index));
    for (int j = 0; 2 * j < rule.half; ++j) {
        const Four t = rule_nodes(rule, j, middle, half);
        const Offset<Four> at = inside ? offset_inside(far.rim, t) : offset_at_angle(t);
        visit(trace(m.at, parameters.kappa, parameters.layers, at.h, at.cos_i),
              rule_weights(rule, j) * Four(half * far.inverse_width) * at.dh);
    }
}

/// Calls visit(path, weight, D) for every four nodes in reach of phi for lobe p = 0, 1, 2: the average over the range
/// of any amplitude(h) D_p(h, phi) is the sum of weight * amplitude(path) * D.
template <int Channels, class Visit>
MEDULLA_FN void visit_unscattered(const FarField<Channels>& far, int p, float phi, Visit&& visit) noexcept {
    const Inclination<float>& at = far.near.longitudinal.at;
    const WrappedGaussian<float>& gaussian = far.fibre().azimuthal_gaussian[p];
    const Cuts& cuts = far.cuts[p];
    const float s = gaussian.deviation, wide = reach * s;
    const auto centre = [p](const Path<Four>& path) { return unscattered_centre(p, path.gamma_i, path.gamma_t); };
    float a = cuts.gamma[0];
    Exit at_a = exit_of(p, at.inverse_index, at.index_excess, a);
    for (int i = 1; i < cuts.count; ++i) {
        const float b = cuts.gamma[i];
        const Exit at_b = exit_of(p, at.inverse_index, at.index_excess, b);
        float slope = std::fmax(std::abs(at_a.slope), std::abs(at_b.slope));
        if (a < 0 && b > 0)
            slope = std::fmax(slope, std::abs(exit_of(p, at.inverse_index, at.index_excess, 0.0f).slope));
        if (s > wide_deviation) {
            integrate_piece(far, p, a, b, slope / s, [&](const Path<Four>& path, Four weight) {
                visit(path, weight, gaussian.pdf_of(Four(phi) - centre(path)));
            });
        } else {
            const float low = std::fmin(at_a.phi, at_b.phi), high = std::fmax(at_a.phi, at_b.phi);
            // Every whole turn by which phi - wide .. phi + wide can meet low .. high.
            const float first = std::ceil((low - wide - phi) * float(1 / (2 * pi)));
            for (float y = phi + float(2 * pi) * first; y <= high + wide; y += float(2 * pi)) {
                float ga = a, gb = b;
                const bool falling = at_b.phi < at_a.phi;
                const float enter = falling ? y + wide : y - wide, leave = falling ? y - wide : y + wide;
                if (falling ? enter < at_a.phi : enter > at_a.phi)
                    ga = invert_exit(p, at.inverse_index, at.index_excess, enter, a, at_a, b, at_b, 0.02f * s);
                if (falling ? leave > at_b.phi : leave < at_b.phi)
                    gb = invert_exit(p, at.inverse_index, at.index_excess, leave, a, at_a, b, at_b, 0.02f * s);
                ga = ga > a ? ga : a, gb = gb < b ? gb : b;
                if (!(gb > ga)) continue;
                const float sa = ga == a ? at_a.slope : exit_of(p, at.inverse_index, at.index_excess, ga).slope;
                const float sb = gb == b ? at_b.slope : exit_of(p, at.inverse_index, at.index_excess, gb).slope;
                const float steepest = ga < 0 && gb > 0 && p == 2 ? slope : std::fmax(std::abs(sa), std::abs(sb));
                // The image that is y alone: the others' tails are not within this reach of theirs.
                integrate_piece(far, p, ga, gb, steepest / s, [&](const Path<Four>& path, Four weight) {
                    const Four z = (Four(y) - centre(path)) * Four(gaussian.inverse);
                    visit(path, weight,
                          Four(within_reach * gaussian.peak) * real_math::exponential(Four(-0.5f) * z * z));
                });
            }
        }
        a = b, at_a = at_b;
    }
}

/// Cuts of R, TT and TRT over [gamma_low, gamma_high].
template <int Channels>
MEDULLA_FN void place_cuts(FarField<Channels>& far) noexcept {
    const FurParameters<Channels>& parameters = far.fibre().parameters;
    const Inclination<float>& at = far.near.longitudinal.at;
    const float low = far.gamma_low, high = far.gamma_high;
    Cuts cuts;
    const auto both = [&](float gamma) { cuts.insert(gamma, low, high), cuts.insert(-gamma, low, high); };
    const auto both_at = [&](float c) { both(real_math::angle(std::sqrt((1 - c) * (1 + c)), c)); };
    // The cuticle's F changes over cos gamma_i ~ sqrt(eta'^2 - 1) as eta' -> 1, and ~ 1 / eta' as eta' -> infinity, and
    // with few layers later.
    const float few = std::fmin(1.0f, std::fmax(2 * parameters.layers, 0.0625f));
    const float scale = std::fmin(std::sqrt(at.index_excess), at.inverse_index) * few;
    for (float c = 2 * scale; c < 0.8f; c *= 4) both_at(c);
    cuts.insert(low, low - 1, high), cuts.insert(high, low, high + 1);
    far.cuts[0] = cuts;
    if (far.rim < 1 && parameters.kappa > 0) both(far.gamma_rim);
    // What a dense medulla lets through leaves next to its rim, over psi ~ 1 / tau.
    const float tau = far.near.longitudinal.absorption.medulla_extinction * parameters.kappa;
    if (tau > 4) {
        const Offset<float> edge = offset_inside(far.rim, float(pi / 2) - 4 / tau);
        both(real_math::angle(edge.h, edge.cos_i));
    }
    far.cuts[1] = cuts;
    // TRT is stationary where cos^2 gamma_i = (eta'^2 - 1) / 3.
    if (at.index_excess < 3) both_at(std::sqrt(at.index_excess / 3));
    far.cuts[2] = cuts;
}

/// Nodes of one panel [a, b] in psi; returns the largest energy among them.
template <int Channels>
MEDULLA_FN float place_panel(FarField<Channels>& far, float a, float b, GaussRule rule) noexcept {
    const FurParameters<Channels>& parameters = far.fibre().parameters;
    const Longitudinal<Channels>& m = far.near.longitudinal;
    const float middle = 0.5f * (a + b), half = 0.5f * (b - a);
    float most = 0;
    for (int j = 0; 2 * j < rule.half && far.nodes + 4 <= most_scattering_nodes; ++j) {
        const Offset<Four> at = offset_inside(far.rim, rule_nodes(rule, j, middle, half));
        const Path<Four> path = trace(m.at, parameters.kappa, parameters.layers, at.h, at.cos_i);
        const Energies<Channels, Four> e = energies_at(far.fibre(), m, path, true);
        const Four weight = rule_weights(rule, j) * Four(half * far.inverse_width) * at.dh;
        const Four offset = magnitude(path.h_inside) * Four(1 / parameters.kappa);
        Four sum, share[2], centre[2];
        for (int lobe = 0; lobe < lobe_count; ++lobe)
            for (int c = 0; c < Channels; ++c) sum = sum + e.A[lobe][c];
        const Four inverse = weight / choose(sum > Four(1e-30f), sum, Four(1.0f));
        for (int p = 0; p < 2; ++p) {
            for (int c = 0; c < Channels; ++c) share[p] = share[p] + e.A[p + 3][c] * inverse;
            centre[p] = scattered_centre(p + 1, path.gamma_i, path.gamma_t) + Four(float(pi));
        }
        for (int i = 0; i < 4; ++i) {
            ScatteringNode<Channels>& n = far.node[far.nodes++];
            n.offset = std::fmin(lane(offset, i), 1.0f);
            n.side = lane(at.h, i) < 0 ? -1.0f : 1.0f;
            for (int p = 0; p < 2; ++p) {
                n.share[p] = lane(share[p], i), n.centre[p] = lane(centre[p], i);
                for (int c = 0; c < Channels; ++c) {
                    n.A[p][c] = lane(weight, i) * lane(e.A[p + 3][c], i);
                    most = std::fmax(most, n.A[p][c]);
                }
            }
        }
    }
    return most;
}

/// Nodes of the scattered lobes: 8 over psi for either side of an ordinary medulla, more where g makes the lobe narrow
/// against its shift; in a dense medulla, or where F rises at the rim alone, TRTs lives near the rim in psi, which then
/// has panels of its own.
template <int Channels>
MEDULLA_FN void place_scattering_nodes(FarField<Channels>& far) noexcept {
    const FurParameters<Channels>& parameters = far.fibre().parameters;
    const float a = medulla_angle(far, far.gamma_low), b = medulla_angle(far, far.gamma_high);
    far.nodes = 0;
    if (!(b > a)) return;
    const float width = 1 - std::abs(parameters.g);  // of planar HG's peak [radians]
    const float per_panel = width > 0.2f ? 1.6f : (width > 0.1f ? 0.8f : 0.54f);
    const int index = (width > 0.1f ? 0 : 1) + far.quality;
    const GaussRule rule = gauss_rule(index < 0 ? 0 : index), edge = gauss_rule(0);
    const float tau = far.near.longitudinal.absorption.medulla_extinction * parameters.kappa;
    // Where the medulla reaches the fibre's rim, F rises to 1 within the cos gamma_i that place_cuts grades by.
    const Inclination<float>& at = far.near.longitudinal.at;
    const float steep =
        std::fmin(std::sqrt(at.index_excess), at.inverse_index) * std::fmin(1.0f, 2 * parameters.layers);
    const float rise = far.rim < 1 ? 4.0f : std::fmax(2 * steep, 0.01f), dense = tau > 4 ? 4 / tau : 4.0f;
    const float edge_width = std::fmin(rise, dense);
    float most = 0, low = a, high = b;
    if (edge_width < 1) {
        const float rim = float(pi / 2) - edge_width;
        if (a < -rim) low = b < -rim ? b : -rim, most = place_panel(far, a, low, edge);
        if (b > rim && b > low) high = low > rim ? low : rim, most = std::fmax(most, place_panel(far, high, b, edge));
    }
    // A low-rank lobe is not quite its own mirror image at h = 0, where the side changes: no panel crosses it.
    const float cut[3] = {low, low < 0 && high > 0 ? 0.0f : high, high};
    for (int part = 0; part < 2 && cut[part + 1] > cut[part]; ++part) {
        const float length = cut[part + 1] - cut[part];
        const int room = (most_scattering_nodes - far.nodes) / ((2 - part) * 2 * rule.half);
        const int wanted = 1 + int(length / per_panel), panels = wanted < room ? wanted : room;
        for (int i = 0; i < panels; ++i) {
            const float step = length / float(panels), from = cut[part] + step * float(i);
            most = std::fmax(most, place_panel(far, from, i + 1 == panels ? cut[part + 1] : from + step, rule));
        }
    }
    if (most * float(far.nodes) < negligible_energy) far.nodes = 0;
}

}  // namespace detail

/// @param theta_i [radians], in (-pi/2, pi/2)  @param range offsets; where low > high, or an end is outside [-1, 1],
///        every lobe is 0
template <int Channels>
MEDULLA_FN void far_field(const FurFibre<Channels>& fibre, float theta_i, OffsetRange range, FarField<Channels>& far,
                          FarQuality quality = FarQuality::standard) noexcept {
    far.valid = false, far.nodes = 0;
    far.near.fibre = &fibre;
    far.near.valid = far.near.scattered = false;
    if (!detail::within(range.low, 1.0f) || !detail::within(range.high, 1.0f) || range.low > range.high) return;
    longitudinal_at(fibre, theta_i, far.near.longitudinal);
    if (!far.near.longitudinal.valid) return;
    far.valid = true;
    far.quality = static_cast<int>(quality);
    const Inclination<float>& at = far.near.longitudinal.at;
    const auto angle = [](float h) { return real_math::angle(h, std::sqrt((1 - h) * (1 + h))); };
    far.gamma_low = angle(range.low), far.gamma_high = angle(range.high);
    // sin b - sin a from the angles that are integrated over, so that a short range loses no digits.
    const float width = 2 * real_math::sine_cosine(0.5f * (far.gamma_low + far.gamma_high)).cosine *
                        real_math::sine_cosine(0.5f * (far.gamma_high - far.gamma_low)).sine;
    // Over 1e-6 radians a lobe's exit moves by at most 4e-6, 0.04 of the narrowest deviation: the middle is its mean to
    // 0.04^2 / 24.
    far.single = !(far.gamma_high - far.gamma_low > 1e-6f);
    if (far.single) {
        offset_at(far.near, 0.5f * (range.low + range.high));
        return;
    }
    far.inverse_width = 1 / width;
    const float rim = fibre.parameters.kappa / at.inverse_index;
    far.rim = rim < 1 ? rim : 1.0f;
    far.gamma_rim = angle(far.rim);
    detail::place_cuts(far);
    if (!fibre.scattered) return;
    if (far.near.longitudinal.tables == nullptr) {
        const Longitudinal<Channels>& m = far.near.longitudinal;
        const float* weight = weights_at(fibre.azimuthal, m.absorbed, far.sigma_weight);
        contract_axis(fibre.azimuthal.view, fibre.azimuthal.sigma_axis, m.sigma, weight, far.sigma_weight);
    }
    detail::place_scattering_nodes(far);
}

/// N of one unscattered lobe, p = 0, 1, 2, averaged over the range.
template <int Channels>
MEDULLA_FN void average_unscattered(const FarField<Channels>& far, int p, float phi, float (&N)[Channels]) noexcept {
    Four sum[Channels];
    const Absorption<Channels>& a = far.near.longitudinal.absorption;
    const float passes = 2 * float(p);
    detail::visit_unscattered(far, p, phi, [&](const Path<Four>& path, Four weight, Four D) {
        const Four F = path.cuticle.F, T = path.cuticle.T_, value = weight * D;
        if (p == 0) {
            sum[0] = sum[0] + value * F;
            return;
        }
        const Four amplitude = value * T * T * (p == 2 ? F : Four(1.0f)),
                   medulla = path.s_m * Four(a.medulla_extinction);
        for (int c = 0; c < Channels; ++c)
            sum[c] =
                sum[c] + amplitude * real_math::exponential(-Four(passes) * (path.s_c * Four(a.cortex[c]) + medulla));
    });
    for (int c = 0; c < Channels; ++c) N[c] = sum_of(sum[p == 0 ? 0 : c]);
}

/// N of TTs and TRTs averaged over the range: the lobe's shift and its offset change together with h, so each node
/// contracts the h axis once and reads two exits.
template <int Channels>
MEDULLA_FN void average_scattered(const FarField<Channels>& far, float phi, float (&TTs)[Channels],
                                  float (&TRTs)[Channels]) noexcept {
    for (int c = 0; c < Channels; ++c) TTs[c] = TRTs[c] = 0;
    const MaterialTable& table = far.fibre().azimuthal;
    const UnfoldedTables* unfolded = far.near.longitudinal.tables;
    Contraction contraction;
    for (int i = 0; i < far.nodes; ++i) {
        const ScatteringNode<Channels>& n = far.node[i];
        if (unfolded != nullptr) {
            const TwoDensities D = azimuthal_densities(*unfolded, far.near.longitudinal.sigma_point, n.offset,
                                                       n.side * (phi - n.centre[0]), n.side * (phi - n.centre[1]));
            for (int c = 0; c < Channels; ++c) TTs[c] += n.A[0][c] * D.TTs, TRTs[c] += n.A[1][c] * D.TRTs;
            continue;
        }
        contract_axis(table.view, table.last_axis, last_point(table, n.offset), far.sigma_weight, contraction.weight);
        contraction.inverse_integral = inverse_integral(table.view, contraction.weight);
        const float D[2] = {lobe(table, contraction, n.side * (phi - n.centre[0])),
                            lobe(table, contraction, n.side * (phi - n.centre[1]))};
        for (int c = 0; c < Channels; ++c) TTs[c] += n.A[0][c] * D[0], TRTs[c] += n.A[1][c] * D[1];
    }
}

/// What is kept of an average: its quadrature gives up to 4.5e-6 more than the model has (docs/bcsdf.md, 'Right at the
/// ends'), and white fur must not shine.
inline constexpr float kept_of_average = 1 - 1e-5f;

/// M and N of every lobe at (theta_r, phi) [radians]; all 0 outside theta_r in [-pi/2, pi/2] or for |phi| > 1e4.
template <int Channels>
MEDULLA_FN LobeValues<Channels> FarField<Channels>::lobes(float theta_r, float phi) const noexcept {
    LobeValues<Channels> result;
    if (!valid || !detail::within(theta_r, float(pi / 2)) || !detail::within(phi, 1e4f)) return result;
    if (single) return near.lobes(theta_r, phi);
    const float turned = wrap_angle(phi);
    longitudinal_lobes(fibre(), near.longitudinal, theta_r, turned, nodes > 0, result);
    float N[lobe_count][Channels] = {};
    for (int p = 0; p < 3; ++p) average_unscattered(*this, p, turned, N[p]);
    if (nodes > 0) average_scattered(*this, turned, N[3], N[4]);
    for (int p = 0; p < lobe_count; ++p)
        for (int c = 0; c < Channels; ++c) result.N[p][c] = kept_of_average * N[p][c];
    return result;
}

/// S of Eq. 12 averaged over the range.
template <int Channels>
MEDULLA_FN Colour<Channels> FarField<Channels>::eval(float theta_r, float phi) const noexcept {
    Colour<Channels> sum = angular_density(lobes(theta_r, phi));
    const float cosine = near.longitudinal.at.cos_i;
    for (int c = 0; valid && c < Channels; ++c) sum.value[c] /= cosine * cosine;
    return sum;
}

/// S of Eq. 12 averaged over offsets; the whole fibre by default (the plain way in).
template <int Channels>
MEDULLA_FN Colour<Channels> eval(const FurFibre<Channels>& fibre, float theta_i, float theta_r, float phi,
                                 OffsetRange range) noexcept {
    FarField<Channels> far;
    far_field(fibre, theta_i, range, far);
    return far.eval(theta_r, phi);
}

}  // namespace medulla
