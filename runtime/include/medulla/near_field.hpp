// A hit at one offset h: value, pdf and sample of what leaves the fibre. A value of at most 512 bytes that is copied
// freely; it points to the tables alone. Rests on Yan et al. 2017, Sec. 4 and 6, with the errata of docs/bcsdf.md.
//
// Measure. `value` is energy per steradian about the drawn direction, for a unit that arrives along the known one: no
// cosine is left to add. `pdf` is per steradian, the very density of what `sample` returns. A sample's `weight` is value
// over pdf, which multiplies a path's throughput as it is; it is at most Channels, and for a grey fibre at most 1.
#pragma once

#include <cmath>
#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/detail/gaussian.hpp"
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
    bool valid = false;  ///< false: the fibre has no light to give here; all numbers are 0
    Lobe lobe = Lobe::R;  ///< that it was drawn from
    Vector direction = {0, 0, 0};
    Angles angles = {0, 0};  ///< the same, phi from the known azimuth
    float pdf = 0;           ///< per steradian
    Colour<Channels> value;  ///< energy per steradian
    Colour<Channels> weight;  ///< value / pdf
};

/// Each lobe's factors; its energy per radian^2 of (theta_r, phi) is M N.
template <int Channels = 3>
struct LobeValues {
    float M[all_lobe_count] = {};            ///< longitudinal density [1 / radian]
    float N[all_lobe_count][Channels] = {};  ///< azimuthal density times energy [1 / radian]
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

template <int Channels>
MEDULLA_HOT float mean(const float (&x)[Channels]) noexcept {
    float sum = 0;
    for (int c = 0; c < Channels; ++c) sum += x[c];
    return sum * (1.0f / float(Channels));
}

/// What the known inclination decides, near and far.
template <int Channels>
struct Incidence {
    Polar known;
    Inclination<float> at = {};
    Absorption<Channels> absorption = {};
    float absorbed = 0;  ///< optical radius of absorption, sigma_ma kappa / cos theta_t [1]
};

/// Everything of a field but its offsets.
template <int Channels>
struct FieldBase {
    const Tables* tables = nullptr;  ///< null: no scattered lobes
    TruncatedGaussians longitudinal = {};
    WrappedGaussians azimuthal = {};
    TableRows rows = {};
    Polar known;  ///< cosine 0: nothing is lit, every value is 0
};

template <int Channels>
MEDULLA_HOT Incidence<Channels> begin_field(const Fibre<Channels>& fibre, const Polar& known,
                                            FieldBase<Channels>& field) noexcept {
    Incidence<Channels> in;
    in.known = known;
    if (fibre.status == FibreStatus::bad_parameters) in.known.cosine = 0;
    field.known = in.known;
    if (!(in.known.cosine > 0)) return in;
    const FurParameters<Channels>& p = fibre.parameters;
    in.at = inclination(p.eta, known.cosine, p.fresnel);
    field.longitudinal =
        truncated_gaussians(aligned_four_at(fibre.shift) - Four(known.theta), aligned_four_at(fibre.deviation));
    field.azimuthal = fibre.azimuthal;
    field.tables = fibre.tables;
    const bool tabled = fibre.tables != nullptr && fibre.tables->absorbs;
    in.absorption = absorption(p, in.at.inverse_cos_t, tabled);
    in.absorbed = p.sigma_ma * p.kappa * in.at.inverse_cos_t;
    if (fibre.tables == nullptr) return in;
    const Tables& t = *fibre.tables;
    TableRows& rows = field.rows;
    rows.g_count = fibre.g_count, rows.g_first = fibre.g_first;
    store_four(aligned_four_at(fibre.g_weight), rows.g);
    set_row(t.sigma, std::sqrt(p.sigma_ms * p.kappa * in.at.inverse_cos_t), rows.sigma_first, rows.sigma);
    set_row(t.theta_i, chord_coordinate(magnitude(known.theta) * float(2 / pi)), rows.theta_first, rows.theta_i);
    return in;
}

/// Sets the rows of h. @param offset of the ray in the medulla [medulla radii], >= 0
MEDULLA_HOT void set_offset(const Tables& t, float offset, TableRows& rows) noexcept {
    set_row(t.h, chord_coordinate(offset < 1 ? offset : 1.0f), rows.h_first, rows.h);
}

/// Probability of each lobe at one offset: its share of the energy, averaged over channels; 0: no light.
template <int Channels>
MEDULLA_HOT void set_shares(const Energies<Channels>& e, float (&share)[all_lobe_count]) noexcept {
    float total = 0;
    for (int k = 0; k < all_lobe_count; ++k) share[k] = mean(e.A[k]), total += share[k];
    const float inverse = total > 1e-30f ? 1 / total : 0.0f;
    for (float& x : share) x *= inverse;
}

/// Draws a lobe by its share and makes `u` uniform again. The last lobe with a share takes what rounding leaves; -1:
/// there is none.
MEDULLA_HOT int draw_lobe(const float (&share)[all_lobe_count], float& u) noexcept {
    int last = -1;
    float below = 0, at_last = 0;
    for (int k = 0; k < all_lobe_count; ++k) {
        if (!(share[k] > 0)) continue;
        last = k, at_last = below;
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
    const float inverse = 1 / e.pdf;
    for (int c = 0; c < Channels; ++c) s.weight[c] = e.value[c] * inverse;
}

/// A ray's offset clamped to the fibre: a hit's rounding may put it beyond. A NaN stays one.
MEDULLA_HOT float clamp_offset(float h) noexcept { return h < -1 ? -1.0f : (h > 1 ? 1.0f : h); }

}  // namespace detail

template <int Channels = 3>
struct NearField : detail::FieldBase<Channels> {
    alignas(16) float centre[4] = {};    ///< Phi_p of R, TT, TRT [radians]
    float scattered_centre[2] = {};      ///< Phi^s_p + pi of TTs and TRTs [radians]
    float side = 1;                      ///< sign of h
    float A[all_lobe_count][Channels] = {};  ///< energies
    float share[all_lobe_count] = {};        ///< probabilities of the lobes

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
        detail::Energies<Channels> e;
        for (int k = 0; k < all_lobe_count; ++k)
            for (int c = 0; c < Channels; ++c) kept.A[k][c] = e.A[k][c] = mask >> k & 1u ? A[k][c] : 0.0f;
        detail::set_shares(e, kept.share);
        return kept;
    }
    /// Share of the light that leaves, over all directions.
    MEDULLA_FN Colour<Channels> albedo() const noexcept {
        Colour<Channels> sum;
        for (int k = 0; k < all_lobe_count; ++k)
            for (int c = 0; c < Channels; ++c) sum[c] += A[k][c];
        return sum;
    }
    /// M and N of every lobe at (theta_r, phi), phi relative to the known azimuth [radians].
    MEDULLA_FN LobeValues<Channels> lobes(float theta_r, float phi) const noexcept;
    /// S of Eq. 12: sum over the paper's five lobes of M N / cos^2 theta_i, whose light is the caller's to multiply by
    /// cos theta_i.
    MEDULLA_FN Colour<Channels> eq12(float theta_r, float phi) const noexcept {
        Colour<Channels> sum = angular_density(lobes(theta_r, phi), all_lobes ^ lobe_bit(Lobe::residual));
        for (int c = 0; this->known.cosine > 0 && c < Channels; ++c)
            sum[c] /= this->known.cosine * this->known.cosine;
        return sum;
    }

  private:
    MEDULLA_HOT detail::LobeDensities densities(float theta_r, float phi) const noexcept;
    MEDULLA_HOT Evaluation<Channels> at(float theta_r, float cosine, float phi) const noexcept;
    MEDULLA_HOT Evaluation<Channels> at(const detail::Polar& drawn) const noexcept {
        if (!(this->known.cosine > 0 && drawn.cosine > 0)) return {};
        return at(drawn.theta, drawn.cosine, detail::azimuth_between(this->known, drawn));
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
    d.x[5] = d.x[3], d.x[3] = d.x[4] = 0;
    if (this->tables == nullptr) return d;
    const Tables& t = *this->tables;
    const ExitPlaces places =
        exit_places(turns_of(Four(side * (phi - scattered_centre[0]), side * (phi - scattered_centre[1]),
                                  this->known.theta < 0 ? -theta_r : theta_r, phi)),
                    Four(2 * t.phi.end, 2 * t.phi.end, 4 * t.theta_r.end, 2));
    const float M = longitudinal_density(t, this->rows, places, 2, places.place[3]);
    d.x[3] = M * azimuthal_density(t, this->rows, places, 0);
    d.x[4] = M * azimuthal_density(t, this->rows, places, 1);
    return d;
}

template <int Channels>
MEDULLA_HOT Evaluation<Channels> NearField<Channels>::at(float theta_r, float cosine, float phi) const noexcept {
    Evaluation<Channels> e;
    const detail::LobeDensities d = densities(theta_r, phi);
    const float inverse = 1 / cosine;
    for (int k = 0; k < all_lobe_count; ++k) {
        const float x = d.x[k] * inverse;
        e.pdf += share[k] * x;
        for (int c = 0; c < Channels; ++c) e.value[c] += A[k][c] * x;
    }
    return e;
}

template <int Channels>
MEDULLA_HOT Sample<Channels> NearField<Channels>::draw(RandomNumbers u) const noexcept {
    using namespace detail;
    Sample<Channels> s;
    const int k = this->known.cosine > 0 ? draw_lobe(share, u.lobe) : -1;
    if (k < 0) return s;
    float theta, phi;
    if (k < 3) {
        phi = wrap_angle(centre[k] + detail::sample(this->azimuthal[k], u.azimuth));
        theta = detail::sample(this->longitudinal[k], u.longitude);
    } else if (k == static_cast<int>(Lobe::residual)) {
        phi = float(pi) * (2 * u.azimuth - 1);
        theta = detail::sample(this->longitudinal[3], u.longitude);
    } else {
        phi = wrap_angle(scattered_centre[k - 3] +
                         side * draw_azimuth(*this->tables, this->rows, u.lobe, u.azimuth));
        const float forwardness = magnitude(phi) * float(1 / pi);
        theta = draw_longitude(*this->tables, this->rows, forwardness < 1 ? forwardness : 1.0f, u.rows, u.longitude);
        theta = this->known.theta < 0 ? -theta : theta;
    }
    set_sample(this->known, static_cast<Lobe>(k), theta, phi, at(theta, cosine_of(theta), phi), s);
    return s;
}

template <int Channels>
MEDULLA_FN LobeValues<Channels> NearField<Channels>::lobes(float theta_r, float phi) const noexcept {
    using namespace detail;
    LobeValues<Channels> result;
    if (!(this->known.cosine > 0) || !within(theta_r, float(pi / 2)) || !within(phi, 1e4f)) return result;
    const Four M = this->longitudinal.pdf(Four(theta_r)),
               D = this->azimuthal.pdf(Four(phi) - aligned_four_at(centre));
    float density[all_lobe_count] = {lane(D, 0), lane(D, 1), lane(D, 2), 0, 0, lane(D, 3)};
    for (int k = 0; k < 3; ++k) result.M[k] = lane(M, k);
    result.M[5] = lane(M, 3);
    if (this->tables != nullptr) {
        const Tables& t = *this->tables;
        const ExitPlaces places =
            exit_places(turns_of(Four(side * (phi - scattered_centre[0]), side * (phi - scattered_centre[1]),
                                      this->known.theta < 0 ? -theta_r : theta_r, phi)),
                        Four(2 * t.phi.end, 2 * t.phi.end, 4 * t.theta_r.end, 2));
        result.M[3] = result.M[4] = longitudinal_density(t, this->rows, places, 2, places.place[3]);
        for (int p = 0; p < 2; ++p) density[3 + p] = azimuthal_density(t, this->rows, places, p);
    }
    for (int k = 0; k < all_lobe_count; ++k)
        for (int c = 0; c < Channels; ++c) result.N[k][c] = A[k][c] * density[k];
    return result;
}

namespace detail {

/// Sets a near field's offset; its base was begun. @param h in [-1, 1]
template <int Channels>
MEDULLA_HOT void set_near(const Fibre<Channels>& fibre, const Incidence<Channels>& in, float h,
                          NearField<Channels>& hit) noexcept {
    const FurParameters<Channels>& p = fibre.parameters;
    const Path<float> path = trace(in.at, p.kappa, p.layers, h, std::sqrt((1 - h) * (1 + h)));
    hit.side = h < 0 ? -1.0f : 1.0f;
    for (int k = 0; k < 3; ++k) hit.centre[k] = unscattered_centre(k, path.gamma_i, path.gamma_t);
    for (int k = 0; k < 2; ++k)
        hit.scattered_centre[k] = scattered_centre(k + 1, path.gamma_i, path.gamma_t) + float(pi);
    const bool inside = hit.tables != nullptr && path.s_m > 0;
    float survival = 1;
    if (inside) {
        set_offset(*hit.tables, magnitude(path.h_inside) / p.kappa, hit.rows);
        if (hit.tables->absorbs) survival = survival_of(in.absorbed, survival_length(*hit.tables, hit.rows));
    }
    const Energies<Channels> e = energies(path, in.absorption, inside, survival);
    for (int k = 0; k < all_lobe_count; ++k)
        for (int c = 0; c < Channels; ++c) hit.A[k][c] = e.A[k][c];
    set_shares(e, hit.share);
    bool scattered = false;
    for (int c = 0; c < Channels; ++c) scattered = scattered || e.A[3][c] + e.A[4][c] > negligible_energy;
    if (!scattered) hit.tables = nullptr;
}

template <int Channels>
MEDULLA_HOT NearField<Channels> make_near(const Fibre<Channels>& fibre, const Polar& known, float h) noexcept {
    NearField<Channels> hit;
    const float held = clamp_offset(h);
    const Incidence<Channels> in = begin_field(fibre, within(held, 1.0f) ? known : Polar{}, hit);
    if (hit.known.cosine > 0) set_near(fibre, in, held, hit);
    return hit;
}

}  // namespace detail

/// A hit at offset h; some 80 ns. @param known direction, away from the fibre  @param h [fibre radii], as offset_of
/// gives it; clamped to [-1, 1], beyond which rounding may put it
/// A direction along the fibre, or a NaN, gives a hit that is black.
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
