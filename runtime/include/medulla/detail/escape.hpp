// The energy of scattered light: how much of it a fibre absorbs before it leaves. Published: T_b of Eq. 20. Corrected:
// light from the medulla meets the cuticle from inside; beyond the critical angle it returns to the medulla, which
// absorbs or scatters it again. docs/bcsdf.md, 'Escape and return', has the derivation.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/detail/elementary.hpp"
#include "medulla/fur_parameters.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// Floats in which one number a channel stands beside one more: a multiple of four.
template <int Channels>
inline constexpr int channel_lanes = 4 * (Channels / 4 + 1);

/// A^s_p without absorption times: kept E(collisions) / E(sigma_ms), exp(-(medulla + cortex sigma_ca) / cos theta_t)
/// and escape.
template <int lanes>
struct ScatteredEnergy {
    float collisions;       ///< rate of first collisions [1 / fibre radius]
    float kept;             ///< share of what they scatter that leaves the medulla the first time
    float cortex, medulla;  ///< of T_b: 1 - kappa, kappa sigma_ma; 0 in the corrected form
    alignas(16) float escape[std::size_t(lanes)];  ///< share of what left the medulla that leaves the fibre in the end
};

/// @param tabled the tables know what the medulla absorbs of scattered light
template <int Channels, int lanes>
MEDULLA_HOT void set_published(const FurParameters<Channels>& p, bool tabled, ScatteredEnergy<lanes>& s) noexcept {
    s.collisions = p.sigma_ms, s.kept = 1;
    s.cortex = 1 - p.kappa, s.medulla = tabled ? 0.0f : p.kappa * p.sigma_ma;
    for (float& x : s.escape) x = 1;
}

/// Of light that collided, the share that leaves the medulla before it is absorbed.
MEDULLA_HOT float left_by_medulla(float kappa, float sigma_ms, float sigma_ma, float g) noexcept {
    if (!(sigma_ma > 0)) return 1;
    // Mean path after the first collision: 4/3 kappa in a thin medulla, 2 kappa in a dense one.
    const float tau = sigma_ms * kappa,
                path = kappa * (1.3333333f + tau * (1.431f + tau * 2.898f)) / (1 + tau * (1.44f + tau * 1.449f));
    const float narrow = 1 - g;  // paths of forward scattering differ less from one another
    const float x = path * sigma_ma * narrow;
    const float log = x < 0.03f ? x * (1 - x * (0.5f - x * (0.33333333f - x * 0.25f))) : detail::math::log(1 + x);
    return sigma_ms / (sigma_ms + sigma_ma) * exponential(-log / narrow);
}

/// Four directions stand for all in which light leaves the medulla: two that the cuticle transmits, and two beyond the
/// critical angle. Offsets in the cross-section, cosines of the inclination and weights are those with which the share
/// that escapes comes nearest to the integrals over all directions (bench_escape --fit).
/// @param sigma_ca of the channels, padded with 0
template <int Channels, int lanes>
MEDULLA_HOT void set_corrected(const FurParameters<Channels>& p, const float (&sigma_ca)[std::size_t(lanes)],
                               bool tabled, ScatteredEnergy<lanes>& s) noexcept {
    const float kept = left_by_medulla(p.kappa, p.sigma_ms, p.sigma_ma, p.g);
    s.collisions = tabled ? p.sigma_ms : p.sigma_ms + p.sigma_ma, s.kept = tabled ? 1.0f : kept;
    s.cortex = s.medulla = 0;

    // Offsets b are in units of the widest that the zone has; a zone's weight is the integral of cos^2 over it.
    const float inverse = 1 / p.eta, excess = (p.eta - 1) * (p.eta + 1), widest = lesser(p.kappa, inverse);
    const Four zero(0.0f), one(1.0f), kappa(p.kappa), top(widest, widest, p.kappa, p.kappa),
        b = top * Four(0.57f, 0.60f, 0.51f, 0.89f);
    const Four cos_b = square_root((one - b) * (one + b)), half = square_root((kappa - b) * (kappa + b));
    const Four critical = lesser(one, Four(detail::math::sqrt(excess) * inverse) / cos_b);
    const Four sine = square_root((one - critical) * (one + critical)), place(0.84f, 0.12f, 0.63f, 0.99f);
    const Four transmitted = Four(0.5f) * (angle(sine, critical) + sine * critical);
    const FourMask escapes = Four(1, 1, 0, 0) > zero;
    const Four cos_theta = choose(escapes, one - (one - critical) * place, critical * place);
    Four weight = top * Four(0.17f, 0.83f, 0.71f, 0.29f) *
                  choose(escapes, transmitted, greater(zero, Four(float(pi / 4)) - transmitted));

    // The exact Fresnel term there, from inside: eta cos of the angle inside, and the cosine outside.
    const Four x = Four(p.eta) * cos_theta * cos_b;
    const Cuticle<Four> crossed = cuticle(p.layers, excess, square_root(greater(zero, x * x - Four(excess))), x);
    const Four F = choose(escapes, crossed.F, one), T = only_where(escapes, crossed.T_);

    // A crossing of the medulla: 1 - u collides; of the directions in which scattered light leaves, 1 - exp(-sigma_ms
    // L) weights each as reciprocity has it.
    const Four slant = one / cos_theta, chord = (half + half) * slant;
    const Four cortex = Four((1 - p.kappa) * (1 + p.kappa)) / (cos_b + half) * slant;
    const Four scattering = Four(p.sigma_ms) * chord, depth = Four(p.sigma_ms + p.sigma_ma) * chord;
    const Four collides = absorbed(depth, exponential(-depth));
    weight = weight * absorbed(scattering, exponential(-scattering));
    const Four lost = collides * Four(1 - kept);
    for (int c = Channels; c < lanes; ++c) s.escape[c] = 1;
    for (int c = 0; c < Channels; ++c) {
        const Four once = Four(sigma_ca[c]) * cortex, left = exponential(-once), left2 = left * left;
        const Four absorbs = absorbed(once + once, left2);
        const Four ends = greater(T + F * (absorbs + left2 * collides), Four(1e-30f));
        const Four share = weight / ends;
        const float out = sum_of(share * T * left), all = sum_of(share * (T + F * (absorbs + left2 * lost)));
        s.escape[c] = all > 0 ? lesser(1.0f, out / all) : 0.0f;
    }
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
