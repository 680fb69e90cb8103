// A hit at one offset h: value, pdf and sample of what leaves the fibre. A value of at most 512 bytes that is copied
// freely; it points to the tables alone. Rests on Yan et al. 2017, Sec. 4 and 6, with the errata of docs/bcsdf.md.
//
// Measure. `value` is energy per steradian about the drawn direction, for a unit that arrives along the known one: no
// cosine is left to add. `pdf` is per steradian, the very density of what `sample` returns. A sample's `weight` is
// value over pdf, which multiplies a path's throughput as it is; it is at most Channels, and for a grey fibre at
// most 1.
#pragma once

#include <cstddef>
#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/detail/gaussian.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/detail/table_lookup.hpp"
#include "medulla/fibre.hpp"
#include "medulla/vector.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// Value and pdf together cost what one does.
template <int Channels = 3>
struct Evaluation {
    Colour<Channels> value;  ///< energy per steradian
    float pdf = 0;           ///< per steradian
};

/// Numbers that a sample consumes, each in [0, 1] (both ends included) and independent of the others.
struct RandomNumbers {
    float lobe = 0, azimuth = 0, longitude = 0, rows = 0;
    float offset = 0;  ///< read by a far field alone
};

template <int Channels = 3>
struct Sample {
    bool valid = false;   ///< false: the fibre has no light to give here; all numbers are 0
    Lobe lobe = Lobe::R;  ///< that it was drawn from
    Vector direction = {0, 0, 0};
    Angles angles = {0, 0};   ///< the same, phi from the known azimuth
    float pdf = 0;            ///< per steradian
    Colour<Channels> value;   ///< energy per steradian
    Colour<Channels> weight;  ///< value / pdf
};

/// Each lobe's factors; its energy per radian^2 of (theta_r, phi) is M N.
template <int Channels = 3>
struct LobeValues {
    float M[all_lobe_count] = {};                         ///< longitudinal density [1 / radian]
    float N[all_lobe_count][std::size_t(Channels)] = {};  ///< azimuthal density times energy [1 / radian]
};

/// sum M N over the lobes of a mask: energy per radian^2 of (theta_r, phi).
template <int Channels>
MEDULLA_FN Colour<Channels> angular_density(const LobeValues<Channels>& lobes, LobeMask mask = all_lobes) noexcept {
    Colour<Channels> sum;
    for (int lobe = 0; lobe < all_lobe_count; ++lobe)
        for (int c = 0; c < Channels && (mask >> lobe & 1u); ++c) sum.value[c] += lobes.M[lobe] * lobes.N[lobe][c];
    return sum;
}

namespace detail {

/// Scattered lobes that carry less than this of the incident energy in every channel are left out: it bounds the error
/// of the fibre's albedo, and it is what a float sum of energies near 1 cannot show.
inline constexpr float negligible_energy = 5.9604645e-8f;  // 2^-24

/// 1 / Channels in the lanes of a channel, from lane b on; else 0.
template <int Channels>
MEDULLA_HOT Four channel_mask(int b) noexcept {
    constexpr float w = 1.0f / float(Channels);
    return Four(b < Channels ? w : 0.0f, b + 1 < Channels ? w : 0.0f, b + 2 < Channels ? w : 0.0f,
                b + 3 < Channels ? w : 0.0f);
}

/// Everything of a field but its offsets. Set where the known direction is one.
template <int Channels>
struct FieldBase {
    Polar known;                ///< cosine 0: nothing is lit, every value is 0, and nothing else is set
    const DenseTables* tables;  ///< null: no scattered lobes
    TruncatedGaussians longitudinal;
    WrappedGaussians azimuthal;
    TableRows rows;
};

/// @param theta the known inclination [radians]
template <int Channels>
MEDULLA_HOT void begin_field(const Fibre<Channels>& fibre, const Inclination<float>& at, float theta,
                             FieldBase<Channels>& field) noexcept {
    field.longitudinal =
        truncated_gaussians(aligned_four_at(fibre.shift) - Four(theta), aligned_four_at(fibre.deviation));
    field.azimuthal = fibre.azimuthal;
    field.tables = fibre.tables;
    if (fibre.tables == nullptr) return;
    field.rows.g_count = fibre.g_count, field.rows.g_first = fibre.g_first;
    store_four(aligned_four_at(fibre.g_weight), field.rows.g);
    const FurParameters<Channels>& p = fibre.parameters;
    set_inclination(*fibre.tables, p.sigma_ms * p.kappa * at.inverse_cos_t, theta, field.rows);
}

/// Draws a lobe by its share and makes `u` uniform again. The last lobe with a share takes what rounding leaves; -1:
/// there is none.
MEDULLA_HOT int draw_lobe(const float (&share)[all_lobe_count], float& u) noexcept {
    int last = -1;
    float below = 0, at_last = 0;
    for (int k = 0; k < all_lobe_count; ++k) {
        if (!(share[k] > 0)) continue;
        last = k;
        at_last = below;
        if (u < below + share[k]) break;
        below += share[k];
    }
    if (last < 0) return last;
    const float v = (u - at_last) / share[last];
    u = v > 0 ? (v < 1 ? v : 1.0f) : 0.0f;
    return last;
}

/// Densities M D of the six lobes at an exit [1 / radian^2].
struct LobeDensities {
    alignas(16) float x[8];
};

/// Fills a sample. @param phi from the known azimuth
template <int Channels>
MEDULLA_HOT void set_sample(const Polar& known, Lobe lobe, float theta, float phi, const Evaluation<Channels>& e,
                            Sample<Channels>& s) noexcept {
    if (!(e.pdf > 0)) return;
    const auto t = sine_cosine(theta), p = full_sine_cosine(phi);
    s.valid = true, s.lobe = lobe, s.angles = {theta, phi};
    s.direction = {-t.sine, t.cosine * (known.y * p.cosine - known.z * p.sine),
                   t.cosine * (known.z * p.cosine + known.y * p.sine)};
    s.pdf = e.pdf, s.value = e.value;
    const float inverse = 1 / greater(e.pdf, 1e-37f);  // of a lesser one it is infinite
    for (int c = 0; c < Channels; ++c) s.weight[c] = e.value[c] * inverse;
}

/// A ray's offset clamped to the fibre: a hit's rounding may put it beyond. A NaN stays one.
MEDULLA_HOT float clamp_offset(float h) noexcept { return h < -1 ? -1.0f : (h > 1 ? 1.0f : h); }

}  // namespace detail

template <int Channels = 3>
struct NearField : detail::FieldBase<Channels> {
    static constexpr int lanes = detail::channel_lanes<Channels>;
    alignas(16) float centre[4];      ///< Phi_p of R, TT, TRT [radians]
    float scattered_centre[2], side;  ///< Phi^s_p + pi of TTs and TRTs [radians]; sign of h
    float known_theta;                ///< [radians]
    alignas(16) float A[all_lobe_count]
                       [std::size_t(lanes)];  ///< energies of the channels and, last, the lobe's probability

    /// Energy per steradian about `drawn`.
    MEDULLA_FN Colour<Channels> value(Vector drawn) const noexcept { return evaluate(drawn).value; }
    MEDULLA_FN Colour<Channels> value(Angles drawn) const noexcept { return evaluate(drawn).value; }
    /// Density of `sample` at `drawn` per steradian; 0 where nothing is drawn.
    MEDULLA_FN float pdf(Vector drawn) const noexcept { return evaluate(drawn).pdf; }
    MEDULLA_FN float pdf(Angles drawn) const noexcept { return evaluate(drawn).pdf; }
    MEDULLA_FN Evaluation<Channels> evaluate(Vector drawn) const noexcept {
        return detail::run_fused([&] { return at(detail::polar_of(drawn)); });
    }
    MEDULLA_FN Evaluation<Channels> evaluate(Angles drawn) const noexcept {
        return detail::run_fused([&] { return at(detail::polar_of(drawn)); });
    }
    MEDULLA_FN Sample<Channels> sample(RandomNumbers u) const noexcept {
        return detail::run_fused([&] { return draw(u); });
    }
    /// The same hit with some lobes alone: for light groups and for one picture a lobe.
    MEDULLA_FN NearField keep(LobeMask mask) const noexcept {
        NearField kept = *this;
        if (!(this->known.cosine > 0)) return kept;
        float sum = 0;
        for (int k = 0; k < all_lobe_count; ++k) sum += mask >> k & 1u ? A[k][lanes - 1] : 0.0f;
        const float inverse = sum > 1e-30f ? 1 / sum : 0.0f;  // of a lesser one the inverse may be infinite
        for (int k = 0; k < all_lobe_count; ++k)
            for (int c = 0; c < lanes; ++c)
                kept.A[k][c] = mask >> k & 1u ? A[k][c] * (c < Channels ? 1.0f : inverse) : 0.0f;
        return kept;
    }
    /// Share of the light that leaves, over all directions.
    MEDULLA_FN Colour<Channels> albedo() const noexcept {
        Colour<Channels> sum;
        for (int k = 0; this->known.cosine > 0 && k < all_lobe_count; ++k)
            for (int c = 0; c < Channels; ++c) sum[c] += A[k][c];
        return sum;
    }
    /// M and N of every lobe at (theta_r, phi), phi relative to the known azimuth [radians].
    MEDULLA_FN LobeValues<Channels> lobes(float theta_r, float phi) const noexcept;
    /// S of Eq. 12: sum over the paper's five lobes of M N / cos^2 theta_i, whose light is the caller's to multiply by
    /// cos theta_i.
    MEDULLA_FN Colour<Channels> eq12(float theta_r, float phi) const noexcept {
        Colour<Channels> sum = angular_density(lobes(theta_r, phi), all_lobes ^ lobe_bit(Lobe::residual));
        for (int c = 0; this->known.cosine > 0 && c < Channels; ++c) sum[c] /= this->known.cosine * this->known.cosine;
        return sum;
    }

  private:
    MEDULLA_HOT detail::LobeDensities densities(float theta_r, float phi) const noexcept;
    MEDULLA_HOT Evaluation<Channels> sum_of_lobes(float theta_r, float cosine, float phi) const noexcept;
    /// Apart, since values and samples share it.
    MEDULLA_FN Evaluation<Channels> at(float theta_r, float cosine, float phi) const noexcept {
        return detail::run_fused([&] { return sum_of_lobes(theta_r, cosine, phi); });
    }
    MEDULLA_HOT Evaluation<Channels> at(const detail::Polar& drawn) const noexcept {
        if (!(this->known.cosine > 0 && drawn.cosine > 0)) return {};
        const Angles between = detail::angles_between(this->known, drawn);
        return at(between.theta, drawn.cosine, between.phi);
    }
    MEDULLA_HOT detail::ExitPlaces places(float theta_r, float phi) const noexcept {
        const DenseTables& t = *this->tables;
        return detail::exit_places(
            detail::turns_of(detail::Four(side * (phi - scattered_centre[0]), side * (phi - scattered_centre[1]),
                                          known_theta < 0 ? -theta_r : theta_r, phi)),
            detail::Four(2 * t.phi.end, 2 * t.phi.end, 4 * t.theta_r.end, 2));
    }
    MEDULLA_HOT Sample<Channels> draw(RandomNumbers u) const noexcept;
};
static_assert(sizeof(NearField<3>) <= 512, "a hit fits into a GPU thread");

template <int Channels>
MEDULLA_HOT detail::LobeDensities NearField<Channels>::densities(float theta_r, float phi) const noexcept {
    using namespace detail;
    LobeDensities d;
    const Four delta = Four(phi) - aligned_four_at(centre);
    store_four(joint_pdf(this->longitudinal, this->azimuthal, Four(theta_r), delta), d.x);
    // The residual lobe, lane 3, goes behind the scattered ones.
    d.x[5] = d.x[3];
    d.x[3] = d.x[4] = 0;
    if (this->tables == nullptr) return d;
    const DenseTables& t = *this->tables;
    const ExitPlaces exits = places(theta_r, phi);
    const float M = longitudinal_density(t, this->rows, exits, 2, exits.place[3]);
    d.x[3] = M * azimuthal_density(t, this->rows, exits, 0);
    d.x[4] = M * azimuthal_density(t, this->rows, exits, 1);
    return d;
}

template <int Channels>
MEDULLA_HOT Evaluation<Channels> NearField<Channels>::sum_of_lobes(float theta_r, float cosine,
                                                                   float phi) const noexcept {
    using namespace detail;
    const LobeDensities d = densities(theta_r, phi);
    const Four inverse(1 / cosine);
    alignas(16) float sum[std::size_t(lanes)];
    for (int b = 0; b < lanes; b += 4) {
        const Four a = Four(d.x[0]) * aligned_four_at(A[0] + b) + Four(d.x[1]) * aligned_four_at(A[1] + b),
                   c = Four(d.x[2]) * aligned_four_at(A[2] + b) + Four(d.x[3]) * aligned_four_at(A[3] + b),
                   e = Four(d.x[4]) * aligned_four_at(A[4] + b) + Four(d.x[5]) * aligned_four_at(A[5] + b);
        store_four(inverse * ((a + c) + e), sum + b);
    }
    Evaluation<Channels> result;
    for (int c = 0; c < Channels; ++c) result.value[c] = sum[c];
    result.pdf = sum[lanes - 1];
    return result;
}

template <int Channels>
MEDULLA_HOT Sample<Channels> NearField<Channels>::draw(RandomNumbers u) const noexcept {
    using namespace detail;
    Sample<Channels> s;
    if (!(this->known.cosine > 0)) return s;
    float share[all_lobe_count];
    for (int k = 0; k < all_lobe_count; ++k) share[k] = A[k][lanes - 1];
    const int k = draw_lobe(share, u.lobe);
    if (k < 0) return s;
    float theta, phi;
    if (k < 3) {
        phi = wrap_angle(centre[k] + detail::sample(this->azimuthal[k], u.azimuth));
        theta = detail::sample(this->longitudinal[k], u.longitude);
    } else if (k == static_cast<int>(Lobe::residual)) {
        phi = float(pi) * (2 * u.azimuth - 1);
        theta = detail::sample(this->longitudinal[3], u.longitude);
    } else {
        const LongitudeDraw along = begin_longitude(*this->tables, this->rows, u.rows, u.longitude);
        phi = wrap_angle(scattered_centre[k - 3] + side * draw_azimuth(*this->tables, this->rows, u.lobe, u.azimuth));
        theta = with_sign(1.0f, known_theta) * finish_longitude(*this->tables, along, magnitude(phi) * float(1 / pi));
    }
    set_sample(this->known, static_cast<Lobe>(k), theta, phi, at(theta, cosine_of(theta), phi), s);
    return s;
}

template <int Channels>
MEDULLA_FN LobeValues<Channels> NearField<Channels>::lobes(float theta_r, float phi) const noexcept {
    using namespace detail;
    LobeValues<Channels> result;
    if (!(this->known.cosine > 0) || !within(theta_r, float(pi / 2)) || !within(phi, 1e4f)) return result;
    const Four M = this->longitudinal.pdf(Four(theta_r)), D = this->azimuthal.pdf(Four(phi) - aligned_four_at(centre));
    float density[all_lobe_count] = {lane(D, 0), lane(D, 1), lane(D, 2), 0, 0, lane(D, 3)};
    for (int k = 0; k < 3; ++k) result.M[k] = lane(M, k);
    result.M[5] = lane(M, 3);
    if (this->tables != nullptr) {
        const DenseTables& t = *this->tables;
        const ExitPlaces exits = places(theta_r, phi);
        result.M[3] = result.M[4] = longitudinal_density(t, this->rows, exits, 2, exits.place[3]);
        for (int p = 0; p < 2; ++p) density[3 + p] = azimuthal_density(t, this->rows, exits, p);
    }
    for (int k = 0; k < all_lobe_count; ++k)
        for (int c = 0; c < Channels; ++c) result.N[k][c] = A[k][c] * density[k];
    return result;
}

namespace detail {

/// Sets the energies of all lobes at one offset, channels side by side, and the lobes' probabilities: their shares of
/// the energy, averaged over channels. The formulas are those of energies() in cross_section.hpp.
template <int Channels>
MEDULLA_HOT void set_energies(const Fibre<Channels>& fibre, const Path<float>& path, float inverse_cos_t,
                              bool scattered, float survival, NearField<Channels>& hit) noexcept {
    constexpr int lanes = NearField<Channels>::lanes;
    const FurParameters<Channels>& p = fibre.parameters;
    const float F = path.cuticle.F, T = path.cuticle.T_, s_m = path.s_m * inverse_cos_t, s_c = path.s_c * inverse_cos_t;
    const auto& leaves = fibre.scattered;
    const float depth = 2 * leaves.collisions * s_m, medulla = (p.sigma_ms + p.sigma_ma) * s_m;
    const float E = scattered ? absorbed(depth, exponential(-depth)) * survival * leaves.kept : 0.0f;
    const float out = leaves.cortex * inverse_cos_t, inside = leaves.medulla * inverse_cos_t;
    Four mean[all_lobe_count];
    for (int b = 0; b < lanes; b += 4) {
        const Four sigma = aligned_four_at(fibre.sigma_ca + b), cortex = Four(s_c) * sigma;
        const Four half = cortex + Four(medulla), crossing = half + half;  // lengths of half a crossing and of a whole
        const Four through = exponential(-crossing);
        const Four share =
            exponential(-(cortex + Four(out) * sigma + Four(inside))) * Four(E) * aligned_four_at(leaves.escape + b);
        const Four TT = Four(T * T) * through, again = Four(F) * through, TTs = Four(T) * share;
        const Four stays = Four(T) + Four(F) * absorbed(crossing, through);
        const FourMask some = stays > Four(0.0f);
        const Four rest = only_where(some, (share + Four(T) * through) / choose(some, stays, Four(1.0f)));
        const Four A[all_lobe_count] = {Four(F), TT, TT * again, TTs, TTs * again, Four(T) * again * again * rest};
        const Four counts = channel_mask<Channels>(b);
        for (int k = 0; k < all_lobe_count; ++k) {
            store_four(A[k], hit.A[k] + b);
            mean[k] = b == 0 ? A[k] * counts : mean[k] + A[k] * counts;
        }
    }
    Four last[4] = {mean[4], mean[5], Four(0.0f), Four(0.0f)};
    transpose(mean[0], mean[1], mean[2], mean[3]);
    transpose(last[0], last[1], last[2], last[3]);
    const Four low = (mean[0] + mean[1]) + (mean[2] + mean[3]), high = (last[0] + last[1]) + (last[2] + last[3]);
    const float total = sum_of(low + high);
    const Four inverse(total > 1e-30f ? 1 / total : 0.0f);
    alignas(16) float share[8];
    store_four(low * inverse, share);
    store_four(high * inverse, share + 4);
    for (int k = 0; k < all_lobe_count; ++k) hit.A[k][lanes - 1] = share[k];
    // Less than this in every channel cannot be seen beside 1.
    if (lane(high, 0) + lane(low, 3) > negligible_energy) return;
    hit.tables = nullptr;
    for (int k = 3; k < 5; ++k)  // nor may it be drawn: there is no table to draw from
        for (int c = 0; c < lanes; ++c) hit.A[k][c] = 0;
}

template <int Channels>
MEDULLA_HOT NearField<Channels> make_near(const Fibre<Channels>& fibre, const Polar& known, float h) noexcept {
    NearField<Channels> hit;
    h = clamp_offset(h);
    if (!(known.cosine > 0) || !within(h, 1.0f) || fibre.status == FibreStatus::bad_parameters) return hit;
    const FurParameters<Channels>& p = fibre.parameters;
    hit.known = known;
    const Inclination<float> at = inclination(p.eta, known.cosine, p.fresnel);
    // As trace() has it, with theta_i's angle beside the two of the cross-section.
    const float cos_h = detail::math::sqrt((1 - h) * (1 + h)), x = detail::math::sqrt(at.index_excess + cos_h * cos_h);
    const float sin_t = h * at.inverse_index;
    const Four angles = angle(Four(h, sin_t, known.sine, 0), Four(cos_h, x * at.inverse_index, known.cosine, 1));
    const Path<float> path = path_at(at, p.kappa, p.layers, cos_h, sin_t, x, lane(angles, 0), lane(angles, 1));
    hit.known_theta = lane(angles, 2);
    begin_field(fibre, at, hit.known_theta, hit);
    hit.side = h < 0 ? -1.0f : 1.0f;
    const float turn = 2 * path.gamma_t, start = float(pi) - 2 * path.gamma_i;
    store_four(Four(-2 * path.gamma_i, start + turn, start + 2 * turn + float(pi), 0), hit.centre);
    hit.scattered_centre[0] = path.gamma_t - path.gamma_i + float(pi);
    hit.scattered_centre[1] = hit.scattered_centre[0] + float(pi) + turn;
    const bool inside = hit.tables != nullptr && path.s_m > 0, tabled = hit.tables != nullptr && hit.tables->absorbs;
    float survival = 1;
    if (inside) {
        set_offset(*hit.tables, magnitude(path.h_inside) / p.kappa, hit.rows);
        if (tabled)
            survival = survival_of(p.sigma_ma * p.kappa * at.inverse_cos_t, survival_length(*hit.tables, hit.rows));
    }
    set_energies(fibre, path, at.inverse_cos_t, inside, survival, hit);
    return hit;
}

}  // namespace detail

/// A hit at offset h.
/// @param known direction, away from the fibre
/// @param h [fibre radii], as offset_of gives it; clamped to [-1, 1], beyond which rounding may put it
/// @return a black hit for a direction along the fibre, or a NaN
template <int Channels>
MEDULLA_FN NearField<Channels> near_field(const Fibre<Channels>& fibre, Vector known, float h) noexcept {
    return detail::run_fused([&] { return detail::make_near(fibre, detail::polar_of(known), h); });
}
template <int Channels>
MEDULLA_FN NearField<Channels> near_field(const Fibre<Channels>& fibre, Angles known, float h) noexcept {
    return detail::run_fused([&] { return detail::make_near(fibre, detail::polar_of(known), h); });
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
