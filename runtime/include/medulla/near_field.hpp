// The fur fibre in the near field: once per theta_i, then per h, then any number of exits.
// Rests on Yan et al. 2017, Sec. 4 with the errata of docs/bcsdf.md, and on the pack's C^M and C^N.
// Frame, value and measure stand at the top of medulla.hpp.
#pragma once

#include <cmath>

#include "medulla/config.hpp"
#include "medulla/cross_section.hpp"
#include "medulla/fur_fibre.hpp"
#include "medulla/gaussian.hpp"
#include "medulla/lookup.hpp"
#include "medulla/scattered_lookup.hpp"
#include "medulla/unfolded.hpp"

namespace medulla {

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

/// Below every cosine that a float angle within pi/2 has: the last, 1.57079625, has 7.5e-8, and the next lies 4.4e-8
/// beyond pi/2. It is the axis itself, where a fibre has no cross-section: lobes are 0 there.
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
    const UnfoldedTables* tables = nullptr;  ///< the fibre's when this was prepared
    Four sigma_point;                        ///< where sigma lies in unfolded tables; set where `point` is
    LongitudinalPoint point;                 ///< set where the fibre scatters and its tables are unfolded
    Contraction back, forward;               ///< set where the fibre scatters and they are not
    Contraction survival;  ///< of the axes before h, where the fibre has such a table and it is not unfolded
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
    m.tables = fibre.tables;
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
    if (m.tables == nullptr) {
        if (fibre.survival) contract_survival(fibre.survival, m.sigma, fibre.parameters.g, m.absorbed, m.survival);
        return contract_longitudinal(fibre, theta_i, m);
    }
    m.sigma_point = m.tables->sigma_at(m.sigma);
    m.point = m.tables->longitudinal_at(std::abs(theta_i));
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
        m.tables ? m.tables->longitudinal_density(m.point, side) : contracted_sides(fibre, m, side);
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
        if (longitudinal.tables == nullptr) {
            at.M = blend_sides(contracted_sides(*fibre, longitudinal, inclined),
                               std::abs(wrap_angle(phi)) * float(1 / pi));
            for (int p = 0; p < 2; ++p) at.D[p] = lobe(fibre->azimuthal, azimuthal, y[p]);
            return at;
        }
        return medulla::scattered_densities(*longitudinal.tables, point, longitudinal.point, y[0], y[1], inclined, phi);
    }
};

/// Share of the scattered light that the medulla's absorption leaves at an offset [medulla radii]; 1 where Eq. 20's T_b
/// has it.
template <int Channels>
MEDULLA_FN float survival_at(const FurFibre<Channels>& fibre, const Longitudinal<Channels>& m, float offset) noexcept {
    if (!fibre.survival) return 1;
    if (m.tables != nullptr) return survival_of(m.absorbed, m.tables->survival_length(m.sigma_point, offset));
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
    if (m.tables != nullptr) {
        near.point = m.tables->azimuthal_at(m.sigma_point, near.offset);
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
