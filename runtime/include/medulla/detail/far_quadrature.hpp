// The quadrature of the far field: where its pieces end, which nodes lie in reach of an exit, and what a path has at
// four of them side by side. docs/bcsdf.md, 'Far field and intervals', has the derivation and the errors.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/detail/gauss_legendre.hpp"
#include "medulla/detail/gaussian.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/detail/table_lookup.hpp"
#include "medulla/fur_parameters.hpp"
#include "medulla/vector.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

template <int Channels>
struct FarField;

namespace detail {

inline constexpr int most_cuts = 32;
/// Deviations to either side of a Gaussian's centre within which it is integrated, and what that leaves out: 1.4e-4 of
/// the energy of every offset, which the rest then carries.
inline constexpr float reach = 3.8f, within_reach = 1 / 0.99985530f;
/// Above this deviation [radians] the whole circle is within reach, nearly, and no offset is skipped.
inline constexpr float wide_deviation = 0.8f;

/// Offsets in gamma_i = asin h, in ascending order, where a lobe's integrand changes character: the range's ends, the
/// medulla's rim, the grading towards the fibre's rim, the caustic of TRT. Between two cuts Phi_p is monotone.
struct Cuts {
    int count = 0;
    float gamma[most_cuts];  ///< not set beyond count
    MEDULLA_APART void insert(float x, float low, float high) noexcept {
        if (!(x > low && x < high) || count == most_cuts) return;
        int i = count++;
        for (; i > 0 && gamma[i - 1] > x; --i) gamma[i] = gamma[i - 1];
        gamma[i] = x;
    }
};

/// Cuts of one lobe with where it leaves there.
struct LobeCuts {
    int count;
    float gamma[most_cuts], phi[most_cuts], slope[most_cuts];
};

/// A point of the quadrature, or four: h, cos gamma_i, and dh over the variable that is stepped.
template <class T>
struct Offset {
    T h, cos_i, dh;
};

/// Stepping psi inside the medulla, h = rim sin(psi): s_m = kappa cos(psi) is then smooth at the medulla's rim.
/// Outside, and where the medulla reaches the fibre's rim, psi is gamma_i itself.
template <class T>
MEDULLA_FN Offset<T> offset_inside(float rim, T psi) noexcept {
    const auto sc = sine_cosine(psi);
    const T along = T(rim) * sc.cosine;  // 1 - h^2 without a difference that rounding could make negative
    return {T(rim) * sc.sine, square_root(T((1 - rim) * (1 + rim)) + along * along), along};
}
template <class T>
MEDULLA_FN Offset<T> offset_at_angle(T gamma) noexcept {
    const auto sc = sine_cosine(gamma);
    const T cosine = greater(sc.cosine, T(0.0f));  // at the rim rounding may put it below
    return {sc.sine, cosine, cosine};
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
    const auto sc = sine_cosine(gamma);
    const float x = detail::math::sqrt(index_excess + sc.cosine * sc.cosine);
    const float gamma_t = p == 0 ? 0.0f : angle(sc.sine * inverse_index, x * inverse_index);
    return {unscattered_centre(p, gamma, gamma_t), 2 * float(p) * sc.cosine / x - 2};
}

/// gamma_i in [a, b] where Phi_p = phi; Phi_p is monotone there and takes the value. Only places the ends of a
/// quadrature, so 2 % of a deviation is near enough.
MEDULLA_FN float invert_exit(int p, float inverse_index, float index_excess, float phi, float a, Exit at_a, float b,
                             Exit at_b, float tolerance) noexcept {
    if (p == 0) return -0.5f * phi;
    if (p == 1) {  // d = gamma_i - gamma_t: sin(gamma_t + d) = eta' sin gamma_t
        const float d = 0.5f * (float(pi) - phi);
        const auto sc = full_sine_cosine(d);  // |d| < pi
        const float c = 1 - sc.cosine * inverse_index, r = sc.sine * inverse_index,
                    unit = 1 / detail::math::sqrt(c * c + r * r);
        return d + full_angle(c * unit, r * unit);
    }
    // Newton kept in its bracket by bisection; a slope of 0 at a caustic is one end of it.
    const bool rising = at_b.phi > at_a.phi;
    float low = a, high = b, x = a + (b - a) * (phi - at_a.phi) / (at_b.phi - at_a.phi);
    for (int i = 0; i < 30; ++i) {
        if (!(x > low && x < high)) x = 0.5f * (low + high);
        const Exit at = exit_of(p, inverse_index, index_excess, x);
        const float error = at.phi - phi;
        if (detail::math::abs(error) < tolerance) break;
        ((error > 0) == rising ? high : low) = x;
        x = at.slope < 0 || at.slope > 0 ? x - error / at.slope : 0.5f * (low + high);
    }
    return x;
}

/// psi of an offset given as gamma_i, clamped to the medulla.
template <int Channels>
MEDULLA_FN float medulla_angle(const FarField<Channels>& field, float gamma) noexcept {
    if (!(field.rim < 1)) return gamma;
    const float s = sine_cosine(gamma).sine / field.rim, t = s > 1 ? 1.0f : (s < -1 ? -1.0f : s);
    return angle(t, detail::math::sqrt((1 - t) * (1 + t)));
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
MEDULLA_FN void integrate_piece(const FarField<Channels>& field, int p, float a, float b, float density,
                                Visit&& visit) noexcept {
    // Through the medulla (R sees none of it) and not so short that the ends' rounding in psi would show.
    const bool inside = p > 0 && detail::math::abs(a + b) < 2 * field.gamma_rim && field.rim < 1 &&
                        field.gamma_high - field.gamma_low > 0.01f;
    if (inside) {
        a = medulla_angle(field, a), b = medulla_angle(field, b);
        // Nodes are even in psi, so deviations count there: d gamma_i / d psi is greatest next to psi = 0.
        const Offset<float> at = offset_inside(field.rim, a > 0 ? a : (b < 0 ? b : 0.0f));
        density *= at.dh / at.cos_i;
    }
    const float middle = 0.5f * (a + b), half = 0.5f * (b - a);
    const int index = rule_for(density * (b - a), b - a) + field.quality;
    const GaussRule rule = gauss_rule(index < 0 ? 0 : (index >= gauss_rules ? gauss_rules - 1 : index));
    for (int j = 0; 2 * j < rule.half; ++j) {
        const Four t = rule_nodes(rule, j, middle, half);
        const Offset<Four> at = inside ? offset_inside(field.rim, t) : offset_at_angle(t);
        visit(trace(field.inclination, field.kappa, field.layers, at.h, at.cos_i),
              rule_weights(rule, j) * Four(half * field.inverse_width) * at.dh);
    }
}

/// Calls visit(path, weight, D) for every four nodes in reach of phi for lobe p = 0, 1, 2: the average over the range
/// of any amplitude(h) D_p(h, phi) is the sum of weight * amplitude(path) * D.
template <int Channels, class Visit>
MEDULLA_FN void visit_unscattered(const FarField<Channels>& field, int p, float phi, Visit&& visit) noexcept {
    const Inclination<float>& at = field.inclination;
    const WrappedGaussian<float> gaussian = field.azimuthal[p];
    const LobeCuts& cuts = field.cuts[p];
    const float s = gaussian.deviation, wide = reach * s;
    const bool whole = s > wide_deviation;
    float a = cuts.gamma[0];
    Exit at_a = {cuts.phi[0], cuts.slope[0]};
    for (int i = 1; i < cuts.count; ++i) {
        const float b = cuts.gamma[i];
        const Exit at_b = {cuts.phi[i], cuts.slope[i]};
        const bool falling = at_b.phi < at_a.phi;
        float slope = greater(detail::math::abs(at_a.slope), detail::math::abs(at_b.slope));
        if (a < 0 && b > 0)
            slope = greater(slope, detail::math::abs(exit_of(p, at.inverse_index, at.index_excess, 0.0f).slope));
        // Every whole turn by which phi - wide .. phi + wide can meet the exits between the cuts.
        const float low = lesser(at_a.phi, at_b.phi), high = greater(at_a.phi, at_b.phi);
        float y = whole ? phi : phi + float(2 * pi) * detail::math::ceil((low - wide - phi) * float(1 / (2 * pi)));
        const float last = whole ? phi : high + wide;
        for (; y <= last; y += float(2 * pi)) {
            float ga = a, gb = b, steepest = slope;
            if (!whole) {
                const float enter = falling ? y + wide : y - wide, leave = falling ? y - wide : y + wide;
                if (falling ? enter < at_a.phi : enter > at_a.phi)
                    ga = invert_exit(p, at.inverse_index, at.index_excess, enter, a, at_a, b, at_b, 0.02f * s);
                if (falling ? leave > at_b.phi : leave < at_b.phi)
                    gb = invert_exit(p, at.inverse_index, at.index_excess, leave, a, at_a, b, at_b, 0.02f * s);
                ga = ga > a ? ga : a;
                gb = gb < b ? gb : b;
                if (!(gb > ga)) continue;
                const float sa = !(ga > a) ? at_a.slope : exit_of(p, at.inverse_index, at.index_excess, ga).slope;
                const float sb = !(gb < b) ? at_b.slope : exit_of(p, at.inverse_index, at.index_excess, gb).slope;
                if (!(ga < 0 && gb > 0 && p == 2)) steepest = greater(detail::math::abs(sa), detail::math::abs(sb));
            }
            // The image that is y alone: the others' tails are not within this reach of theirs.
            integrate_piece(field, p, ga, gb, steepest / s, [&](const Path<Four>& path, Four weight) {
                const Four delta = Four(y) - unscattered_centre(p, path.gamma_i, path.gamma_t);
                const Four z = delta * Four(gaussian.inverse);
                visit(path, weight,
                      whole ? gaussian.pdf_of(delta)
                            : Four(within_reach * gaussian.peak) * exponential(Four(-0.5f) * z * z));
            });
        }
        a = b;
        at_a = at_b;
    }
}

/// Cuts of R, TT and TRT over [gamma_low, gamma_high].
template <int Channels>
MEDULLA_FN void place_cuts(FarField<Channels>& field) noexcept {
    const Inclination<float>& at = field.inclination;
    const float low = field.gamma_low, high = field.gamma_high;
    Cuts cuts;
    const auto keep = [&](int p) {
        LobeCuts& of = field.cuts[p];
        of.count = cuts.count;
        for (int i = 0; i < cuts.count; ++i) {
            const Exit exit = exit_of(p, at.inverse_index, at.index_excess, cuts.gamma[i]);
            of.gamma[i] = cuts.gamma[i];
            of.phi[i] = exit.phi;
            of.slope[i] = exit.slope;
        }
    };
    const auto both = [&](float gamma) {
        cuts.insert(gamma, low, high);
        cuts.insert(-gamma, low, high);
    };
    const auto both_at = [&](float c) { both(angle(detail::math::sqrt((1 - c) * (1 + c)), c)); };
    // The cuticle's F changes over cos gamma_i ~ sqrt(eta'^2 - 1) as eta' -> 1, and ~ 1 / eta' as eta' -> infinity, and
    // with few layers later.
    const float few = lesser(1.0f, greater(2 * field.layers, 0.0625f));
    const float scale = lesser(detail::math::sqrt(at.index_excess), at.inverse_index) * few;
    for (float c = 2 * scale; c < 0.8f; c *= 4) both_at(c);
    cuts.insert(low, low - 1, high);
    cuts.insert(high, low, high + 1);
    keep(0);
    if (field.rim < 1 && field.kappa > 0) both(field.gamma_rim);
    // What a dense medulla lets through leaves next to its rim, over psi ~ 1 / tau.
    const float tau = field.absorption.medulla_extinction * field.kappa;
    if (tau > 4) {
        const Offset<float> edge = offset_inside(field.rim, float(pi / 2) - 4 / tau);
        both(angle(edge.h, edge.cos_i));
    }
    keep(1);
    // TRT is stationary where cos^2 gamma_i = (eta'^2 - 1) / 3.
    if (at.index_excess < 3) both_at(detail::math::sqrt(at.index_excess / 3));
    keep(2);
}

/// What the medulla's absorption leaves of scattered light at four offsets, by tables that know it.
template <int Channels>
MEDULLA_APART Four survivals(const FarField<Channels>& field, Four h_inside) noexcept {
    float left[4];
    for (int i = 0; i < 4; ++i) {
        TableRows rows = field.rows;
        set_offset(*field.tables, magnitude(lane(h_inside, i)) / field.kappa, rows);
        left[i] = survival_of(field.absorbed, survival_length(*field.tables, rows));
    }
    return four_at(left);
}

/// Energies at four offsets.
template <int Channels>
MEDULLA_FN Energies<Channels, Four> energies_at(const FarField<Channels>& field, const Path<Four>& path) noexcept {
    const bool scattered = field.tables != nullptr;
    return energies(path, field.absorption, scattered,
                    scattered && field.tables->absorbs ? survivals(field, path.h_inside) : Four(1.0f));
}

/// Means over channels of each lobe's energy, over their sum: the lobes' probabilities at four offsets.
template <int Channels>
MEDULLA_HOT void shares_of(const Energies<Channels, Four>& e, LobeMask mask, Four (&share)[all_lobe_count]) noexcept {
    Four all;
    for (int k = 0; k < all_lobe_count; ++k) {
        share[k] = Four(0.0f);
        for (int c = 0; c < Channels && (mask >> k & 1u); ++c) share[k] = share[k] + e.A[k][c];
        all = all + share[k];
    }
    const auto some = all > Four(1e-30f);
    const Four inverse = only_where(some, Four(1.0f) / choose(some, all, Four(1.0f)));
    for (Four& x : share) x = x * inverse;
}

/// Calls visit(offset, path, weight) for every four nodes of one panel [a, b] in psi.
template <int Channels, class Visit>
MEDULLA_FN void visit_panel(const FarField<Channels>& field, float a, float b, GaussRule rule, Visit&& visit) noexcept {
    const float middle = 0.5f * (a + b), half = 0.5f * (b - a);
    for (int j = 0; 2 * j < rule.half; ++j) {
        const Offset<Four> at = offset_inside(field.rim, rule_nodes(rule, j, middle, half));
        visit(at, trace(field.inclination, field.kappa, field.layers, at.h, at.cos_i),
              rule_weights(rule, j) * Four(half * field.inverse_width) * at.dh);
    }
}

/// Nodes of the scattered lobes: 8 over psi for either side of an ordinary medulla, more where g makes the lobe narrow
/// against its shift; in a dense medulla, or where F rises at the rim alone, TRTs lives near the rim in psi, which then
/// has panels of its own.
template <int Channels, class Visit>
MEDULLA_FN void visit_scattered(const FarField<Channels>& field, Visit&& visit) noexcept {
    const float a = medulla_angle(field, field.gamma_low), b = medulla_angle(field, field.gamma_high);
    if (!(b > a)) return;
    const float width = 1 - detail::math::abs(field.g);  // of planar HG's peak [radians]
    const float per_panel = width > 0.2f ? 1.6f : (width > 0.1f ? 0.8f : 0.54f);
    const int index = (width > 0.1f ? 0 : 1) + field.quality;
    const GaussRule rule = gauss_rule(index < 0 ? 0 : index), edge = gauss_rule(0);
    const float tau = field.absorption.medulla_extinction * field.kappa;
    // Where the medulla reaches the fibre's rim, F rises to 1 within the cos gamma_i that place_cuts grades by.
    const Inclination<float>& at = field.inclination;
    const float steep = lesser(detail::math::sqrt(at.index_excess), at.inverse_index) * lesser(1.0f, 2 * field.layers);
    const float rise = field.rim < 1 ? 4.0f : greater(2 * steep, 0.01f), dense = tau > 4 ? 4 / tau : 4.0f;
    const float edge_width = lesser(rise, dense);
    float low = a, high = b;
    if (edge_width < 1) {
        const float rim = float(pi / 2) - edge_width;
        if (a < -rim) low = b < -rim ? b : -rim;
        if (b > rim && b > low) high = low > rim ? low : rim;
    }
    // A low-rank lobe is not quite its own mirror image at h = 0, where the side changes: no panel crosses it.
    const float cut[5] = {a, low, low < 0 && high > 0 ? 0.0f : high, high, b};
    for (int part = 0; part < 4; ++part) {
        const float length = cut[part + 1] - cut[part];
        if (!(length > 0)) continue;
        const bool at_edge = part == 0 || part == 3;
        const int panels = at_edge ? 1 : 1 + int(length / per_panel);
        for (int i = 0; i < panels; ++i) {
            const float step = length / float(panels), from = cut[part] + step * float(i);
            visit_panel(field, from, i + 1 == panels ? cut[part + 1] : from + step, at_edge ? edge : rule, visit);
        }
    }
}

/// Mean energy and probability of the residual lobe, which is even in phi: once a field. Like TRT it rises with F at
/// the rim, so it takes TRT's pieces.
template <int Channels>
MEDULLA_FN void average_residual(FarField<Channels>& field) noexcept {
    Four energy[std::size_t(Channels)], probability;
    const LobeCuts& cuts = field.cuts[2];
    for (int i = 1; i < cuts.count; ++i)
        integrate_piece(field, 1, cuts.gamma[i - 1], cuts.gamma[i], 0.0f, [&](const Path<Four>& path, Four weight) {
            const Energies<Channels, Four> e = energies_at(field, path);
            Four share[all_lobe_count];
            shares_of(e, field.mask, share);
            for (int c = 0; c < Channels; ++c) energy[c] = energy[c] + weight * e.A[5][c];
            probability = probability + weight * share[5];
        });
    for (int c = 0; c < Channels; ++c) field.residual[c] = sum_of(energy[c]);
    field.residual_share = sum_of(probability);
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
