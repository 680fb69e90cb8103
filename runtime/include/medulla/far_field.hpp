// The far field and everything between: lobes averaged over offsets h in [h1, h2] (Eqs. 22 and 26 of Yan et al. 2017).
// A value of at most 2 KB. Rests on near_field.hpp; by quadrature that follows the narrow Gaussians instead of the
// paper's closed forms, which divide by powers of a and linearise at the rim: docs/bcsdf.md, 'Far field', has the
// derivation and the errors. Value and measure are those of near_field.hpp.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/far_quadrature.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/near_field.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// How many nodes are spent: each step takes the next larger Gauss rule on every piece.
enum class FarQuality : int { draft = -1, standard = 0, fine = 1 };

template <int Channels = 3>
struct FarField : detail::FieldBase<Channels> {
    detail::Inclination<float> inclination = {};
    detail::Absorption<Channels> absorption = {};
    float absorbed = 0;     ///< optical radius of absorption, sigma_ma kappa / cos theta_t [1]
    float known_theta = 0;  ///< [radians]
    float kappa = 0, layers = 0, g = 0;
    int quality = 0;
    LobeMask mask = all_lobes;
    float gamma_low = 0, gamma_high = 0;  ///< asin of the range [radians]
    float inverse_width = 0;              ///< 1 / (sin gamma_high - sin gamma_low)
    float rim = 1;                        ///< offset of the medulla's rim, min(1, kappa eta') [fibre radii]
    float gamma_rim = 0;                  ///< asin rim [radians]
    float residual[std::size_t(Channels)] = {},
          residual_share = 0;  ///< mean energy and probability of the residual lobe
    detail::LobeCuts cuts[3];  ///< of R, TT, TRT

    /// As NearField has them, averaged over the range.
    MEDULLA_FN Colour<Channels> value(Vector drawn) const noexcept { return evaluate(drawn).value; }
    MEDULLA_FN Colour<Channels> value(Angles drawn) const noexcept { return evaluate(drawn).value; }
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
    MEDULLA_FN FarField keep(LobeMask lobes) const noexcept;
    MEDULLA_FN LobeValues<Channels> lobes(float theta_r, float phi) const noexcept;
    MEDULLA_FN Colour<Channels> eq12(float theta_r, float phi) const noexcept {
        Colour<Channels> sum = angular_density(lobes(theta_r, phi), all_lobes ^ lobe_bit(Lobe::residual));
        for (int c = 0; this->known.cosine > 0 && c < Channels; ++c) sum[c] /= this->known.cosine * this->known.cosine;
        return sum;
    }
    /// The parts of a mean: for each lobe its N, and its share of the probability density over phi.
    struct Means {
        float N[all_lobe_count][std::size_t(Channels)] = {}, share[all_lobe_count] = {};
    };
    MEDULLA_FN Means means(float phi) const noexcept {
        return detail::run_fused([&] { return integrate(phi); });
    }

  private:
    MEDULLA_FN Means integrate(float phi) const noexcept;
    MEDULLA_FN Evaluation<Channels> at(float theta_r, float cosine, float phi) const noexcept;
    MEDULLA_FN Evaluation<Channels> at(const detail::Polar& drawn) const noexcept {
        if (!(this->known.cosine > 0 && drawn.cosine > 0)) return {};
        const Angles between = detail::angles_between(this->known, drawn);
        return at(between.theta, drawn.cosine, between.phi);
    }
    MEDULLA_FN Sample<Channels> draw(RandomNumbers u) const noexcept;
};
static_assert(sizeof(FarField<3>) <= 2048, "a far field fits into a GPU thread");

namespace detail {

/// The corrected form in place of T_b.
template <int Channels>
MEDULLA_FN void use_escape(const ScatteredEnergy<channel_lanes<Channels>>& leaves, FarField<Channels>& field) noexcept {
    Absorption<Channels>& a = field.absorption;
    a.collisions = leaves.collisions * field.inclination.inverse_cos_t, a.kept = leaves.kept;
    for (int c = 0; c < Channels; ++c) a.T_b[c] = leaves.escape[c];
}

template <int Channels>
MEDULLA_FN FarField<Channels> make_far(const Fibre<Channels>& fibre, const Polar& known, Offsets range,
                                       FarQuality quality) noexcept {
    FarField<Channels> field;
    const float from = clamp_offset(range.low), to = clamp_offset(range.high);
    const bool valid = within(from, 1.0f) && within(to, 1.0f) && from <= to;
    if (!(known.cosine > 0) || !valid || fibre.status == FibreStatus::bad_parameters) return field;
    const FurParameters<Channels>& p = fibre.parameters;
    field.known = known, field.known_theta = angle(known.sine, known.cosine);
    field.inclination = detail::inclination(p.eta, known.cosine, p.fresnel);
    begin_field(fibre, field.inclination, field.known_theta, field);
    field.absorption =
        detail::absorption(p, field.inclination.inverse_cos_t, fibre.tables != nullptr && fibre.tables->absorbs);
    if (fibre.tables != nullptr && p.scattering == Scattering::corrected) use_escape(fibre.scattered, field);
    field.absorbed = p.sigma_ma * p.kappa * field.inclination.inverse_cos_t;
    field.kappa = p.kappa, field.layers = p.layers, field.g = p.g;
    field.quality = static_cast<int>(quality);
    const auto angle_of = [](float h) { return angle(h, detail::math::sqrt((1 - h) * (1 + h))); };
    field.gamma_low = angle_of(from), field.gamma_high = angle_of(to);
    // One offset is a range of 2e-6 about it: a lobe's exit moves by 8e-6 there, 0.08 of the narrowest deviation.
    if (!(field.gamma_high - field.gamma_low > 2e-6f)) {
        const float edge = 1.57079625f, middle = 0.5f * (field.gamma_low + field.gamma_high);
        field.gamma_low = greater(middle - 1e-6f, -edge), field.gamma_high = lesser(middle + 1e-6f, edge);
    }
    // sin b - sin a from the angles that are integrated over, so that a short range loses no digits.
    const float width = 2 * greater(sine_cosine(0.5f * (field.gamma_low + field.gamma_high)).cosine, 1e-8f) *
                        sine_cosine(0.5f * (field.gamma_high - field.gamma_low)).sine;
    field.inverse_width = 1 / width;
    const float rim = p.kappa / field.inclination.inverse_index;
    field.rim = rim < 1 ? rim : 1.0f;
    field.gamma_rim = angle_of(field.rim);
    if (!(field.rim > 0)) field.tables = nullptr;
    place_cuts(field);
    average_residual(field);
    return field;
}

/// What is kept of an average: its quadrature gives up to 4.6e-6 more than the near field's mean
/// (tests/test_furnace.cpp, 1000 random fibres), and white fur must not return more than it receives.
inline constexpr float kept_of_average = 1 - 1e-5f;

}  // namespace detail

/// A hit of which an interval of offsets is seen; the whole fibre by default.
/// @param known direction, away from the fibre
/// @param range clamped to [-1, 1]; where low > high, or a number is a NaN, the hit is black
template <int Channels>
MEDULLA_FN FarField<Channels> far_field(const Fibre<Channels>& fibre, Vector known, Offsets range = Offsets(),
                                        FarQuality quality = FarQuality::standard) noexcept {
    return detail::run_fused([&] { return detail::make_far(fibre, detail::polar_of(known), range, quality); });
}
template <int Channels>
MEDULLA_FN FarField<Channels> far_field(const Fibre<Channels>& fibre, Angles known, Offsets range = Offsets(),
                                        FarQuality quality = FarQuality::standard) noexcept {
    return detail::run_fused([&] { return detail::make_far(fibre, detail::polar_of(known), range, quality); });
}

/// N of every lobe, and the density over phi of what is drawn from it, at phi [radians] from the known azimuth.
template <int Channels>
MEDULLA_FN typename FarField<Channels>::Means FarField<Channels>::integrate(float phi) const noexcept {
    using namespace detail;
    Means m;
    for (int p = 0; p < 3; ++p) {
        if (!(mask >> p & 1u)) continue;
        Four N[std::size_t(Channels)], probability;
        visit_unscattered(*this, p, phi, [&](const Path<Four>& path, Four weight, Four D) {
            const Energies<Channels, Four> e = energies_at(*this, path);
            Four share[all_lobe_count];
            shares_of(e, mask, share);
            const Four value = weight * D;
            for (int c = 0; c < Channels; ++c) N[c] = N[c] + value * e.A[p][c];
            probability = probability + value * share[p];
        });
        for (int c = 0; c < Channels; ++c) m.N[p][c] = kept_of_average * sum_of(N[c]);
        m.share[p] = sum_of(probability);
    }
    if (mask & lobe_bit(Lobe::residual)) {
        const float even = float(0.5 / pi);
        for (int c = 0; c < Channels; ++c) m.N[5][c] = kept_of_average * even * residual[c];
        m.share[5] = even * residual_share;
    }
    if (this->tables == nullptr || !(mask & (lobe_bit(Lobe::TTs) | lobe_bit(Lobe::TRTs)))) return m;
    const DenseTables& t = *this->tables;
    TableRows at = this->rows;
    visit_scattered(*this, [&](const Offset<Four>& h, const Path<Four>& path, Four weight) {
        const Energies<Channels, Four> e = energies_at(*this, path);
        Four share[all_lobe_count];
        shares_of(e, mask, share);
        const Four offset = magnitude(path.h_inside) * Four(1 / kappa), zero(0.0f);
        float D[2][4];
        Four y[2];
        for (int p = 0; p < 2; ++p) {
            const Four turned = Four(phi) - (scattered_centre(p + 1, path.gamma_i, path.gamma_t) + Four(float(pi)));
            y[p] = turns_of(choose(h.h < zero, -turned, turned));
        }
        const ExitPlaces first = exit_places(y[0], Four(2 * t.phi.end)),
                         second = exit_places(y[1], Four(2 * t.phi.end));
        for (int i = 0; i < 4; ++i) {
            set_offset(t, lane(offset, i), at);
            D[0][i] = azimuthal_density(t, at, first, i);
            D[1][i] = azimuthal_density(t, at, second, i);
        }
        for (int p = 0; p < 2; ++p) {
            const Four value = weight * four_at(D[p]);
            for (int c = 0; c < Channels; ++c) m.N[3 + p][c] += kept_of_average * sum_of(value * e.A[3 + p][c]);
            m.share[3 + p] += sum_of(value * share[3 + p]);
        }
    });
    for (int p = 3; p < 5; ++p)
        for (int c = 0; !(mask >> p & 1u) && c < Channels; ++c) m.N[p][c] = 0;
    return m;
}

template <int Channels>
MEDULLA_FN LobeValues<Channels> FarField<Channels>::lobes(float theta_r, float phi) const noexcept {
    using namespace detail;
    LobeValues<Channels> result;
    if (!(this->known.cosine > 0) || !within(theta_r, float(pi / 2)) || !within(phi, 1e4f)) return result;
    const float turned = wrap_angle(phi);
    const Four M = this->longitudinal.pdf(Four(theta_r));
    for (int k = 0; k < 3; ++k) result.M[k] = lane(M, k);
    result.M[5] = lane(M, 3);
    if (this->tables != nullptr) {
        const DenseTables& t = *this->tables;
        const ExitPlaces place =
            exit_places(turns_of(Four(known_theta < 0 ? -theta_r : theta_r)), Four(4 * t.theta_r.end));
        result.M[3] = result.M[4] = longitudinal_density(t, this->rows, place, 0, magnitude(turned) * float(1 / pi));
    }
    const Means m = means(turned);
    for (int k = 0; k < all_lobe_count; ++k)
        for (int c = 0; c < Channels; ++c) result.N[k][c] = m.N[k][c];
    return result;
}

template <int Channels>
MEDULLA_FN Evaluation<Channels> FarField<Channels>::at(float theta_r, float cosine, float phi) const noexcept {
    using namespace detail;
    Evaluation<Channels> e;
    const Means m = means(phi);
    const Four M = this->longitudinal.pdf(Four(theta_r));
    float along[all_lobe_count] = {lane(M, 0), lane(M, 1), lane(M, 2), 0, 0, lane(M, 3)};
    if (this->tables != nullptr) {
        const DenseTables& t = *this->tables;
        const ExitPlaces place =
            exit_places(turns_of(Four(known_theta < 0 ? -theta_r : theta_r)), Four(4 * t.theta_r.end));
        along[3] = along[4] = longitudinal_density(t, this->rows, place, 0, magnitude(phi) * float(1 / pi));
    }
    for (int k = 0; k < all_lobe_count; ++k) {
        const float x = along[k] / cosine;
        e.pdf += x * m.share[k];
        for (int c = 0; c < Channels; ++c) e.value[c] += x * m.N[k][c];
    }
    return e;
}

/// h evenly over the range, then as the near field at h, so that the density drawn is the mean of the near field's;
/// what is narrow keeps to the deviations within which the mean is taken.
template <int Channels>
MEDULLA_FN Sample<Channels> FarField<Channels>::draw(RandomNumbers u) const noexcept {
    using namespace detail;
    Sample<Channels> s;
    if (!(this->known.cosine > 0)) return s;
    // Even in h between the ends that the quadrature has: their sines.
    const float h = clamp_offset(sine_cosine(gamma_low).sine + u.offset / inverse_width);
    const Path<Four> four = trace(inclination, kappa, layers, Four(h), Four(detail::math::sqrt((1 - h) * (1 + h))));
    Four all[all_lobe_count];
    shares_of(energies_at(*this, four), mask, all);
    float share[all_lobe_count];
    for (int k = 0; k < all_lobe_count; ++k) share[k] = lane(all[k], 0);
    const float gamma_i = lane(four.gamma_i, 0), gamma_t = lane(four.gamma_t, 0);
    const int k = draw_lobe(share, u.lobe);
    if (k < 0) return s;
    float theta, phi;
    if (k < 3) {
        const WrappedGaussian<float> D = this->azimuthal[k];
        const float outside = D.deviation > wide_deviation ? 0.0f : 0.5f * (1 - 1 / within_reach);
        phi = wrap_angle(unscattered_centre(k, gamma_i, gamma_t) +
                         detail::sample(D, outside + u.azimuth * (1 - 2 * outside)));
        theta = detail::sample(this->longitudinal[k], u.longitude);
    } else if (k == static_cast<int>(Lobe::residual)) {
        phi = float(pi) * (2 * u.azimuth - 1);
        theta = detail::sample(this->longitudinal[3], u.longitude);
    } else {
        TableRows at = this->rows;
        set_offset(*this->tables, magnitude(lane(four.h_inside, 0)) / kappa, at);
        const LongitudeDraw along = begin_longitude(*this->tables, at, u.rows, u.longitude);
        phi = wrap_angle(scattered_centre(k - 2, gamma_i, gamma_t) + float(pi) +
                         with_sign(1.0f, h) * draw_azimuth(*this->tables, at, u.lobe, u.azimuth));
        theta = with_sign(1.0f, known_theta) * finish_longitude(*this->tables, along, magnitude(phi) * float(1 / pi));
    }
    const Evaluation<Channels> e = this->at(theta, cosine_of(theta), phi);
    set_sample(this->known, static_cast<Lobe>(k), theta, phi, e, s);
    return s;
}

template <int Channels>
MEDULLA_FN FarField<Channels> FarField<Channels>::keep(LobeMask lobes) const noexcept {
    FarField kept = *this;
    kept.mask = mask & lobes;
    if (kept.known.cosine > 0) detail::average_residual(kept);
    return kept;
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
