// Each model's parameters from a fur material's, for pictures and comparisons of one material by all models. A model
// without a medulla gets the absorption that a ray through the axis meets, (1 - kappa) sigma_ca + kappa sigma_ma, and
// no scattering: docs/models.md says what that does. Everything is brought into the model's ranges.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/models/chiang.hpp"
#include "medulla/models/deon.hpp"
#include "medulla/models/kajiya_kay.hpp"
#include "medulla/models/kim.hpp"
#include "medulla/models/marschner.hpp"
#include "medulla/models/yan2015.hpp"
#include "medulla/models/zinke.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

MEDULLA_FN float between(float x, float low, float high) noexcept { return lesser(greater(x, low), high); }

/// x >= 0 with f(x) = y, f increasing and convex, f' = slope, by Newton's steps from an x with f(x) >= y.
template <class F, class Slope>
MEDULLA_FN float invert_convex(float y, float x, F&& f, Slope&& slope) noexcept {
    for (int i = 0; i < 24; ++i) {
        const float next = x - (f(x) - y) / slope(x);
        if (!(next < x)) break;
        x = next;
    }
    return x;
}

/// Energies of R and of all other lobes for light across the fibre, averaged over its width: 16 midpoints in h, 1 % of
/// it.
template <int Channels>
struct CoatEnergies {
    float R[std::size_t(Channels)] = {}, rest[std::size_t(Channels)] = {};
};
template <int Channels>
MEDULLA_FN CoatEnergies<Channels> coat_energies(const FurParameters<Channels>& p) noexcept {
    CoatEnergies<Channels> sum;
    const Inclination<float> at = inclination(p.eta, 1.0f, p.fresnel);
    const Absorption<Channels> a = absorption(p, at.inverse_cos_t);
    for (int i = 0; i < 16; ++i) {
        const float h = (float(i) + 0.5f) / 16;
        const Path<float> path = trace(at, p.kappa, p.layers, h, math::sqrt((1 - h) * (1 + h)));
        const auto e = energies(path, a, p.sigma_ms > 0 && path.s_m > 0);
        for (int c = 0; c < Channels; ++c) {
            sum.R[c] += e.A[0][c] / 16;
            for (int k = 1; k < all_lobe_count; ++k) sum.rest[c] += e.A[k][c] / 16;
        }
    }
    return sum;
}

template <int Channels>
MEDULLA_FN void hair_absorption(const FurParameters<Channels>& p, float (&sigma_a)[std::size_t(Channels)]) noexcept {
    for (int c = 0; c < Channels; ++c) sigma_a[c] = (1 - p.kappa) * p.sigma_ca[c] + p.kappa * p.sigma_ma;
}

}  // namespace detail

namespace models {

/// The fur's energy for light across it: R's in the specular lobe, all else diffuse.
template <int Channels>
MEDULLA_FN KajiyaKay<Channels> kajiya_kay_of(const FurParameters<Channels>& p, bool normalised) noexcept {
    const detail::CoatEnergies<Channels> e = detail::coat_energies(p);
    KajiyaKay<Channels> m;
    m.exponent = detail::between(1 / (p.beta_m * p.beta_m), 1, 1e6f);
    m.normalised = normalised;
    // Printed, the lobes' energies for light across the fibre are pi^2 K_d and 2 pi k_s Z_(p+1).
    const float d = normalised ? 1 : float(1 / (pi * pi)),
                s = normalised ? 1 : float(0.5 / pi) / detail::power_of_cosine_integral(0, m.exponent + 1);
    for (int c = 0; c < Channels; ++c) m.diffuse[c] = d * e.rest[c], m.specular[c] = s * e.R[c];
    return m;
}

/// The same: R's energy reflected, all else transmitted, into the half space behind the fibre.
template <int Channels>
MEDULLA_FN Kim<Channels> kim_of(const FurParameters<Channels>& p) noexcept {
    const detail::CoatEnergies<Channels> e = detail::coat_energies(p);
    Kim<Channels> m;
    m.exponent = detail::between(1 / (p.beta_m * p.beta_m), 1, 1e6f);
    m.sharpness = 1, m.normalised = true;
    for (int c = 0; c < Channels; ++c) m.rho_R[c] = e.R[c], m.rho_T[c] = e.rest[c];
    return m;
}

/// Half angles, and an axis that runs the other way. Normalised, and glints that keep the energy.
template <int Channels>
MEDULLA_FN Marschner<Channels> marschner_of(const FurParameters<Channels>& p) noexcept {
    Marschner<Channels> m;
    m.eta = p.eta, m.normalised = true, m.glint = 0.539f;
    detail::hair_absorption(p, m.sigma_a);
    m.alpha_R = -0.5f * p.alpha, m.beta_R = detail::between(0.5f * p.beta_m, 1e-3f, 2);
    m.glint_width = detail::between(p.beta_n, 1e-5f, 2);
    return m;
}

template <int Channels>
MEDULLA_FN Zinke<Channels> zinke_of(const FurParameters<Channels>& p) noexcept {
    Zinke<Channels> m;
    m.eta = p.eta, m.alpha = p.alpha, m.beta_m = p.beta_m, m.beta_n = p.beta_n;
    detail::hair_absorption(p, m.sigma_a);
    return m;
}

template <int Channels>
MEDULLA_FN DEon<Channels> deon_of(const FurParameters<Channels>& p) noexcept {
    DEon<Channels> m;
    m.eta = p.eta, m.alpha = p.alpha;
    m.beta_m = detail::greater(p.beta_m, 1e-3f), m.beta_n = detail::greater(p.beta_n, 1e-3f);
    detail::hair_absorption(p, m.sigma_a);
    return m;
}

/// One index and one roughness, beta_m; the medulla does not absorb.
template <int Channels>
MEDULLA_FN Yan2015<Channels> yan2015_of(const FurParameters<Channels>& p) noexcept {
    Yan2015<Channels> m;
    m.eta_c = m.eta_m = p.eta, m.kappa = p.kappa, m.layers = p.layers, m.sigma_ms = p.sigma_ms, m.g = p.g;
    m.alpha = p.alpha, m.beta = detail::lesser(p.beta_m, 2);
    for (int c = 0; c < Channels; ++c) m.sigma_ca[c] = p.sigma_ca[c];
    return m;
}

/// Perceptual roughnesses that give R the fur's deviations.
template <int Channels>
MEDULLA_FN Chiang<Channels> chiang_of(const FurParameters<Channels>& p) noexcept {
    using detail::invert_convex;
    Chiang<Channels> m;
    m.eta = p.eta, m.alpha = 0.5f * p.alpha;
    detail::hair_absorption(p, m.sigma_a);
    const auto nineteenth = [](float x) {
        const float x2 = x * x, x4 = x2 * x2, x8 = x4 * x4;
        return x8 * x8 * x2 * x;
    };
    const auto along = [&](float x) { return Chiang<Channels>::deviation_of(x); };
    const auto around = [&](float x) { return Chiang<Channels>::scale_of(x); };
    const float s = 0.55132890f * p.beta_n;  // a logistic of scale s has the deviation s pi / sqrt(3)
    m.beta_m = p.beta_m >= along(1) ? 1.0f
                                    : invert_convex(p.beta_m, detail::lesser(1, p.beta_m / 0.726f), along,
                                                    [&](float x) { return 0.726f + 1.624f * x + 74 * nineteenth(x); });
    m.beta_n = s >= around(1) ? 1.0f : invert_convex(s, detail::lesser(1, s / 0.16606412f), around, [&](float x) {
        return 0.626657069f * (0.265f + 2.388f * x + 118.184f * nineteenth(x) * x * x);
    });
    m.beta_m = detail::greater(m.beta_m, 0.002f), m.beta_n = detail::greater(m.beta_n, 0.005f);
    return m;
}

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
