// Drawing exits from the fibre, near and far: sample and pdf, where pdf is the density of what sample returns: near
// exactly, far to its quadrature (2e-4, at the rim 1e-3).
// Rests on Sec. 6 of Yan et al. 2017, made exact: truncated and wrapped Gaussians, scattered lobes drawn from the
// tables.
//
// Measure. pdf_angular is per radian^2 of (theta_r, phi); pdf = pdf_angular / cos theta_r is per steradian, the density
// over the sphere that integrates to 1. The weight of a sample is sum M N / pdf_angular per channel: what is left of a
// unit of light from i that goes on along the sample. docs/bcsdf.md has the bound.
#pragma once

#include <cmath>

#include "medulla/config.hpp"
#include "medulla/exit_distribution.hpp"
#include "medulla/exit_rows.hpp"
#include "medulla/far_field.hpp"
#include "medulla/near_field.hpp"

namespace medulla {

/// Numbers that one sample consumes, each uniform in [0, 1) and independent of the others.
struct RandomNumbers {
    float lobe = 0, azimuth = 0, azimuth2 = 0, longitude = 0;
    float offset = 0;  ///< far field only
};

template <int Channels = 3>
struct FurSample {
    bool valid = false;     ///< false: the fibre has no light to give here
    Lobe lobe = Lobe::R;    ///< that it was drawn from
    float theta_r = 0;      ///< [radians]
    float phi = 0;          ///< [radians], in [-pi, pi]
    float pdf_angular = 0;  ///< [1 / radian^2]
    float pdf = 0;          ///< [1 / steradian]
    float weight[Channels] = {};
};

namespace detail {

MEDULLA_FN float solid_angle_density(float angular, float theta) noexcept {
    if (!(angular > 0)) return 0;  // also where theta is no inclination at all
    const float cosine = std::cos(theta);
    return angular / (cosine > least_cosine ? cosine : least_cosine);
}

template <int Channels>
MEDULLA_FN float mean(const float (&x)[Channels]) noexcept {
    float sum = 0;
    for (int c = 0; c < Channels; ++c) sum += x[c];
    return sum * (1.0f / float(Channels));
}

/// Probability of each lobe at one offset: its share of the energy, averaged over channels. `total` 0: no light.
struct LobeShares {
    float share[lobe_count] = {};
    float total = 0;
};

template <int Channels>
MEDULLA_FN LobeShares lobe_shares(const Energies<Channels>& energy) noexcept {
    LobeShares s;
    for (int k = 0; k < lobe_count; ++k) s.share[k] = mean(energy.A[k]), s.total += s.share[k];
    if (!(s.total > 1e-30f)) {
        s.total = 0;
        return s;
    }
    const float inverse = 1 / s.total;
    for (float& share : s.share) share *= inverse;
    return s;
}

/// Draws a lobe and makes `u` uniform again. The last lobe with a share takes what rounding leaves.
MEDULLA_FN int pick_lobe(const LobeShares& s, float& u) noexcept {
    int last = 0;
    float below = 0, at_last = 0;
    for (int k = 0; k < lobe_count; ++k) {
        if (!(s.share[k] > 0)) continue;
        last = k, at_last = below;
        if (u < below + s.share[k]) break;
        below += s.share[k];
    }
    const float v = (u - at_last) / s.share[last];
    u = v < 0 ? 0.0f : (v < 0.99999994f ? v : 0.99999994f);
    return last;
}

}  // namespace detail

/// M^s as something to draw from, at one theta_i.
struct LongitudinalSampler {
    ExitDistribution back, forward;
    float side = 1;  ///< sign of theta_i

    template <int Channels>
    MEDULLA_FN void prepare(const FurFibre<Channels>& fibre, const Longitudinal<Channels>& m) noexcept {
        side = m.theta_i < 0 ? -1.0f : 1.0f;
        if (m.tables != nullptr) {
            detail::ExitRows rows;
            rows.set_longitudinal(*m.tables, m.point);
            distribute(fibre.back.view, rows.longitudinal, 2, back);
            return distribute(fibre.forward.view, rows.longitudinal + 1, 2, forward);
        }
        Contraction contracted;
        contract(fibre.back, m.sigma, side * m.theta_i, contracted);
        distribute(fibre.back.view, contracted, back);
        contract(fibre.forward, m.sigma, side * m.theta_i, contracted);
        distribute(fibre.forward.view, contracted, forward);
    }
    /// Density of theta_r given phi, both sides blended as M^s is.
    MEDULLA_FN float pdf(float theta_r, float phi) const noexcept {
        const float t = std::abs(wrap_angle(phi)) * float(1 / pi);
        return (1 - t) * back.pdf(side * theta_r) + t * forward.pdf(side * theta_r);
    }
    MEDULLA_FN float sample(float phi, float which, float u) const noexcept {
        const float t = std::abs(wrap_angle(phi)) * float(1 / pi);
        return side * (which < t ? forward.sample(u) : back.sample(u));
    }
};

/// Draws from a NearField, which it borrows. Prepare once per (theta_i, h), then draw and ask any number of times.
template <int Channels = 3>
struct NearSampler {
    const NearField<Channels>* near = nullptr;
    detail::LobeShares shares;
    ExitDistribution azimuth;
    LongitudinalSampler longitude;

    MEDULLA_FN void prepare(const NearField<Channels>& field) noexcept {
        near = &field;
        shares = {};
        if (!field.valid) return;
        Energies<Channels> energy = field.energy;
        for (int c = 0; !field.scattered && c < Channels; ++c) energy.A[3][c] = energy.A[4][c] = 0;
        shares = detail::lobe_shares(energy);
        if (!field.scattered) return;
        longitude.prepare(*field.fibre, field.longitudinal);
        const MaterialTable& table = field.fibre->azimuthal;
        if (field.longitudinal.tables != nullptr) {
            detail::ExitRows rows;
            rows.set_azimuthal(*field.longitudinal.tables, field.point);
            return distribute(table.view, rows.azimuthal, 1, azimuth);
        }
        Contraction contracted;
        const float* weight = weights_at(table, field.longitudinal.absorbed, contracted.weight);
        contract(table, weight, sigma_point(table, field.longitudinal.sigma), last_point(table, field.offset),
                 contracted);
        distribute(table.view, contracted, azimuth);
    }

    /// Density per radian^2 of (theta_r, phi) of what `sample` returns.
    MEDULLA_FN float pdf_angular(float theta_r, float phi) const noexcept {
        if (!(shares.total > 0) || !detail::within(theta_r, float(pi / 2)) || !detail::within(phi, 1e4f)) return 0;
        float sum = 0;
        for (int p = 0; p < 3; ++p)
            sum += shares.share[p] * near->longitudinal.gaussian[p].pdf(theta_r) *
                   near->fibre->azimuthal_gaussian[p].pdf(phi - near->centre[p]);
        if (!near->scattered) return sum;
        const float scattered = shares.share[3] * azimuth.pdf(near->side * (phi - near->centre[3])) +
                                shares.share[4] * azimuth.pdf(near->side * (phi - near->centre[4]));
        return sum + scattered * longitude.pdf(theta_r, phi);
    }
    /// Density per steradian.
    MEDULLA_FN float pdf(float theta_r, float phi) const noexcept {
        return detail::solid_angle_density(pdf_angular(theta_r, phi), theta_r);
    }

    MEDULLA_FN FurSample<Channels> sample(RandomNumbers u) const noexcept {
        FurSample<Channels> s;
        if (!(shares.total > 0)) return s;
        const int k = detail::pick_lobe(shares, u.lobe);
        s.lobe = static_cast<Lobe>(k);
        if (k < 3) {
            s.phi = wrap_angle(near->centre[k] +
                               medulla::sample(near->fibre->azimuthal_gaussian[k], u.azimuth, u.azimuth2));
            s.theta_r = medulla::sample(near->longitudinal.gaussian[k], u.longitude);
        } else {
            s.phi = wrap_angle(near->centre[k] + near->side * azimuth.sample(u.azimuth));
            s.theta_r = longitude.sample(s.phi, u.azimuth2, u.longitude);
        }
        s.pdf_angular = pdf_angular(s.theta_r, s.phi);
        s.pdf = detail::solid_angle_density(s.pdf_angular, s.theta_r);
        s.valid = s.pdf_angular > 0;
        const Colour<Channels> density = angular_density(near->lobes(s.theta_r, s.phi));
        for (int c = 0; s.valid && c < Channels; ++c) s.weight[c] = density.value[c] / s.pdf_angular;
        return s;
    }
};

/// Share of an even density in the far field's scattered azimuth: its distribution is drawn at the mean shift of each
/// side of the fibre, and this bounds the weight where the true lobe is wider.
inline constexpr float even_share = 0.1f;

namespace detail {

template <int Channels>
MEDULLA_FN float mean_energy(const ScatteringNode<Channels>& n) noexcept {
    return mean(n.A[0]) + mean(n.A[1]);
}

/// C^N averaged by energy over the nodes at h < 0 and over those at h > 0, where there are any, from factors.
template <int Channels>
MEDULLA_FN void distribute_factors(const FarField<Channels>& field, const float (&energy)[2],
                                   ExitDistribution (&azimuth)[2]) noexcept {
    const MaterialTable& table = field.fibre().azimuthal;
    const std::uint32_t stride = table.view.layout.rank_stride;
    Contraction mean_lobe[2], at_sigma, at;
    const float* weight = weights_at(table, field.near.longitudinal.absorbed, at_sigma.weight);
    contract_axis(table.view, table.sigma_axis, field.near.longitudinal.sigma, weight, at_sigma.weight);
    for (auto& lobe : mean_lobe)
        for (std::uint32_t r = 0; r < stride; ++r) lobe.weight[r] = 0;
    for (int i = 0; i < field.nodes; ++i) {
        const ScatteringNode<Channels>& n = field.node[i];
        contract_axis(table.view, table.last_axis, n.offset, at_sigma.weight, at.weight);
        const float factor = mean_energy(n) * inverse_integral(table.view, at.weight);
        for (std::uint32_t r = 0; r < stride; ++r) mean_lobe[n.side < 0 ? 0 : 1].weight[r] += factor * at.weight[r];
    }
    for (int side = 0; side < 2; ++side) {
        if (!(energy[side] > 0)) continue;
        mean_lobe[side].inverse_integral = inverse_integral(table.view, mean_lobe[side].weight);
        distribute(table.view, mean_lobe[side], azimuth[side]);
    }
}
/// The same from unfolded tables: what is averaged are the weights of rows of h, and then each row is read once.
template <int Channels>
MEDULLA_FN void distribute_rows(const FarField<Channels>& field, const float (&energy)[2],
                                ExitDistribution (&azimuth)[2]) noexcept {
    const UnfoldedTables& tables = *field.near.longitudinal.tables;
    float weight[2][most_offset_spans + 3] = {};
    for (int i = 0; i < field.nodes; ++i) {
        const ScatteringNode<Channels>& n = field.node[i];
        const RowPoint row = tables.offset.at(chord_coordinate(Same(n.offset)));
        for (int t = 0; t < 4; ++t)
            weight[n.side < 0 ? 0 : 1][row.first + std::uint32_t(t)] += mean_energy(n) * lane(row.weight, t);
    }
    for (int side = 0; side < 2; ++side) {
        if (!(energy[side] > 0)) continue;
        ExitRows rows;
        rows.set_azimuthal(tables, [&](std::size_t from) {
            Four sum;
            for (std::uint32_t j = 0; j < tables.offset.spans + 3; ++j)
                sum = sum + Four(weight[side][j]) * aligned_four_at(tables.azimuthal_rows(j) + from);
            return sum * (Four(1 / energy[side]) * field.near.longitudinal.sigma_point);
        });
        distribute(field.fibre().azimuthal.view, rows.azimuthal, 1, azimuth[side]);
    }
}

}  // namespace detail

/// Draws from a FarField, which it borrows: h evenly over the range, a lobe by its energy at h, then that lobe;
/// scattered azimuths from the tables averaged over each side of the fibre.
template <int Channels = 3>
struct FarSampler {
    const FarField<Channels>* far = nullptr;
    NearSampler<Channels> single;   ///< where the range is one offset
    float scattered_share[2] = {};  ///< probability of TTs and TRTs over the whole range
    float side_share = 0;           ///< probability of the distribution of h > 0
    float centre[2][2] = {};        ///< [h < 0 or h > 0][TTs or TRTs]: mean shift [radians]
    ExitDistribution azimuth[2];    ///< h < 0, h > 0
    LongitudinalSampler longitude;

    MEDULLA_FN void prepare(const FarField<Channels>& field) noexcept;
    MEDULLA_FN float pdf_angular(float theta_r, float phi) const noexcept;
    MEDULLA_FN FurSample<Channels> sample(RandomNumbers u) const noexcept;
    MEDULLA_FN float pdf(float theta_r, float phi) const noexcept {
        return detail::solid_angle_density(pdf_angular(theta_r, phi), theta_r);
    }

  private:
    MEDULLA_FN detail::LobeShares shares_at(const Path<float>& path) const noexcept {
        return detail::lobe_shares(energies_at(far->fibre(), far->near.longitudinal, path, far->nodes > 0));
    }
    MEDULLA_FN float scattered_azimuth(int p, float phi) const noexcept {
        float sum = even_share * float(1 / (2 * pi));
        const float side[2] = {1 - side_share, side_share};
        for (int i = 0; i < 2; ++i)
            if (side[i] > 0)
                sum += (1 - even_share) * side[i] * azimuth[i].pdf(float(2 * i - 1) * (phi - centre[i][p]));
        return sum;
    }
};

template <int Channels>
MEDULLA_FN void FarSampler<Channels>::prepare(const FarField<Channels>& field) noexcept {
    far = &field;
    scattered_share[0] = scattered_share[1] = 0;
    if (!field.valid) return;
    if (field.single) return single.prepare(field.near);
    if (field.nodes == 0) return;
    const FurFibre<Channels>& fibre = field.fibre();
    float energy[2] = {}, moment[2][2] = {};
    for (int i = 0; i < field.nodes; ++i) {
        const ScatteringNode<Channels>& n = field.node[i];
        const int side = n.side < 0 ? 0 : 1;
        energy[side] += detail::mean_energy(n);
        for (int p = 0; p < 2; ++p) {
            moment[side][p] += detail::mean_energy(n) * n.centre[p];
            scattered_share[p] += n.share[p];
        }
    }
    side_share = energy[1] / (energy[0] + energy[1]);
    for (int side = 0; side < 2; ++side)
        for (int p = 0; p < 2 && energy[side] > 0; ++p) centre[side][p] = moment[side][p] / energy[side];
    if (field.near.longitudinal.tables != nullptr)
        detail::distribute_rows(field, energy, azimuth);
    else
        detail::distribute_factors(field, energy, azimuth);
    longitude.prepare(fibre, field.near.longitudinal);
}

/// Density per radian^2 of (theta_r, phi); the average over h of the unscattered shares is the far field's quadrature,
/// exact to that: 2e-4, at the rim 1e-3.
template <int Channels>
MEDULLA_FN float FarSampler<Channels>::pdf_angular(float theta_r, float phi) const noexcept {
    if (far == nullptr || !far->valid) return 0;
    if (far->single) return single.pdf_angular(theta_r, phi);
    if (!detail::within(theta_r, float(pi / 2)) || !detail::within(phi, 1e4f)) return 0;
    const float turned = wrap_angle(phi);
    float sum = 0;
    for (int p = 0; p < 3; ++p) {
        const float M = far->near.longitudinal.gaussian[p].pdf(theta_r);
        if (!(M > 0)) continue;
        Four average;
        detail::visit_unscattered(*far, p, turned, [&](const Path<Four>& path, Four weight, Four D) {
            const auto e = energies_at(far->fibre(), far->near.longitudinal, path, far->nodes > 0);
            Four all, own;
            for (int lobe = 0; lobe < lobe_count; ++lobe)
                for (int c = 0; c < Channels; ++c) all = all + e.A[lobe][c];
            for (int c = 0; c < Channels; ++c) own = own + e.A[p][c];
            average = average + weight * D * own / choose(all > Four(1e-30f), all, Four(1.0f));
        });
        sum += M * sum_of(average);
    }
    if (far->nodes == 0) return sum;
    const float scattered =
        scattered_share[0] * scattered_azimuth(0, turned) + scattered_share[1] * scattered_azimuth(1, turned);
    return sum + scattered * longitude.pdf(theta_r, turned);
}

template <int Channels>
MEDULLA_FN FurSample<Channels> FarSampler<Channels>::sample(RandomNumbers u) const noexcept {
    FurSample<Channels> s;
    if (far == nullptr || !far->valid) return s;
    if (far->single) return single.sample(u);
    const FurFibre<Channels>& fibre = far->fibre();
    const Longitudinal<Channels>& m = far->near.longitudinal;
    // Even in h between the ends that the quadrature has: their sines.
    const float low = real_math::sine_cosine(far->gamma_low).sine;
    float h = low + u.offset / far->inverse_width;
    h = h < -1 ? -1.0f : (h > 1 ? 1.0f : h);
    const Path<float> path =
        trace(m.at, fibre.parameters.kappa, fibre.parameters.layers, h, std::sqrt((1 - h) * (1 + h)));
    const detail::LobeShares shares = shares_at(path);
    if (!(shares.total > 0)) return s;
    const int k = detail::pick_lobe(shares, u.lobe);
    s.lobe = static_cast<Lobe>(k);
    if (k < 3) {
        const float centre_k = unscattered_centre(k, path.gamma_i, path.gamma_t);
        const WrappedGaussian<float>& D = fibre.azimuthal_gaussian[k];
        // Held to where the density is integrated, but for the square of what lies outside: 2e-8.
        const float most = D.deviation > detail::wide_deviation ? 1e30f : detail::reach;
        s.phi = wrap_angle(centre_k + medulla::sample(D, u.azimuth, u.azimuth2, most));
        s.theta_r = medulla::sample(m.gaussian[k], u.longitude);
    } else {
        if (u.lobe < even_share) {
            s.phi = float(pi) * (2 * u.azimuth - 1);
        } else {
            const float v = (u.lobe - even_share) / (1 - even_share);
            const int side = v < side_share ? 1 : 0;
            s.phi = wrap_angle(centre[side][k - 3] + float(2 * side - 1) * azimuth[side].sample(u.azimuth));
        }
        s.theta_r = longitude.sample(s.phi, u.azimuth2, u.longitude);
    }
    s.pdf_angular = pdf_angular(s.theta_r, s.phi);
    s.pdf = detail::solid_angle_density(s.pdf_angular, s.theta_r);
    s.valid = s.pdf_angular > 0;
    const Colour<Channels> density = angular_density(far->lobes(s.theta_r, s.phi));
    for (int c = 0; s.valid && c < Channels; ++c) s.weight[c] = density.value[c] / s.pdf_angular;
    return s;
}

}  // namespace medulla
