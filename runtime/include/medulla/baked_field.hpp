// Hits on a fibre whose scattered light was baked (baked.hpp), by the names and in the measure of near_field.hpp and
// far_field.hpp. Light that did not scatter has the lobes R, TT, TRT and residual of those headers, with exact Fresnel
// terms and the energies that were simulated; scattered light is the lobe TTs.
//
//   const BakedResult opened = open_baked(bytes, count);              // once; the bytes stay where they are
//   const BakedFibre<3> fibre = make_fibre(opened.material, sigma_ca);  // or without: the material's own colour
//   const BakedNear<3> hit = near_field(fibre, known, h);
//   const BakedFar<3> hit = far_field(fibre, known, Offsets{a, b});
//
// Everything but sigma_ca is fixed by the bake.
#pragma once

#include <cstddef>
#include <cstdint>

#include "medulla/baked.hpp"
#include "medulla/config.hpp"
#include "medulla/detail/exit_functions.hpp"
#include "medulla/far_field.hpp"
#include "medulla/fibre.hpp"
#include "medulla/near_field.hpp"
#include "medulla/random.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

template <int Channels = 3>
struct BakedFibre {
    static constexpr int lanes = detail::channel_lanes<Channels>;
    Fibre<Channels> fibre;                                                ///< of the light that does not scatter
    const BakedMaterial* material = nullptr;                              ///< null: a black fibre
    alignas(16) float weight[absorption_nodes][std::size_t(lanes)] = {};  ///< of the absorption nodes, by channel
};

/// @param material outlives the fibre  @param sigma_ca [1 / fibre radius]; accurate in the range of its nodes, and
///        going to 0 beyond
template <std::size_t Count>
MEDULLA_FN BakedFibre<int(Count)> make_fibre(const BakedMaterial& material, const float (&sigma_ca)[Count],
                                             OutOfRange out = OutOfRange::black) noexcept {
    constexpr int Channels = int(Count);
    BakedFibre<Channels> f;
    if (!material) return f;
    const FurParameters<3> own = material.parameters();
    FurParameters<Channels> p;
    p.eta = own.eta, p.kappa = own.kappa, p.alpha = own.alpha, p.beta_m = own.beta_m, p.beta_n = own.beta_n;
    p.layers = own.layers, p.sigma_ms = own.sigma_ms, p.sigma_ma = own.sigma_ma, p.g = own.g, p.fresnel = own.fresnel;
    for (int c = 0; c < Channels; ++c) p.sigma_ca[c] = sigma_ca[c];
    f.fibre = make_fibre(p, static_cast<const DenseTables*>(nullptr), out);
    if (f.fibre.status == FibreStatus::bad_parameters) return f;
    if (f.fibre.status == FibreStatus::no_tables) f.fibre.status = FibreStatus::ok;  // the material is its tables
    f.material = &material;
    for (int b = 0; b < f.lanes; b += 4) {
        detail::Four w[absorption_nodes];
        detail::absorption_weights(material, detail::aligned_four_at(f.fibre.sigma_ca + b), w);
        for (int j = 0; j < absorption_nodes; ++j) detail::store_four(w[j], f.weight[j] + b);
    }
    return f;
}
MEDULLA_FN BakedFibre<3> make_fibre(const BakedMaterial& material) noexcept {
    return make_fibre<3>(material, material.header.sigma_ca);
}

namespace detail {

/// Scattered light at one offset.
template <int Channels>
struct ScatteredLight {
    static constexpr int lanes = channel_lanes<Channels>;
    float side = 1, turn = 0;  ///< sign of h; what is subtracted from side * phi [radians]
    float probability = 0;     ///< of being drawn from
    /// Of B_k and its mirror image, densities per radian^2: channels and, last, what is drawn. Set as far as 2 K.
    alignas(16) float amplitude[2 * max_exit_functions][std::size_t(lanes)];

    MEDULLA_HOT void scale(const BakedMaterial& m, float factor) noexcept {
        for (std::uint32_t k = 0; k < 2 * m.header.functions; ++k)
            for (int b = 0; b < lanes; b += 4)
                store_four(aligned_four_at(amplitude[k] + b) * Four(factor), amplitude[k] + b);
    }
    /// What is drawn: the mean of the channels times `share`, which makes all probabilities add up to 1.
    /// @param energy mean of the channels
    MEDULLA_HOT void set_drawn(const BakedMaterial& m, float energy, float share) noexcept {
        const float each = share * (1.0f / float(Channels));
        for (std::uint32_t k = 0; k < 2 * m.header.functions; ++k) {
            float channels = 0;
            for (int c = 0; c < Channels; ++c) channels += amplitude[k][c];
            amplitude[k][lanes - 1] = channels * each;
        }
        probability = energy * share;
    }
    /// @param u in [0, 1]
    MEDULLA_HOT DrawnExit draw(const BakedMaterial& m, float u, const RandomNumbers& numbers) const noexcept {
        const std::uint32_t functions = m.header.functions;
        float left = u * probability, mass = 0;
        std::uint32_t chosen = 0;
        for (std::uint32_t k = 0; k < 2 * functions; ++k) {
            const float p = amplitude[k][lanes - 1] * m.area[k < functions ? k : k - functions];
            if (!(p > 0)) continue;
            left -= mass;
            mass = p;
            chosen = k;
            if (left < p) break;
        }
        const bool mirrored = chosen >= functions;
        DrawnExit exit = sample_function(m, mirrored ? chosen - functions : chosen, numbers.longitude, numbers.azimuth);
        exit.phi = wrap_angle(side * ((mirrored ? -exit.phi : exit.phi) + turn));
        return exit;
    }
};

/// Energies at one offset without absorption: closed forms of R and of TT, TRT and higher orders, what was simulated
/// over them, and what scatters.
struct OffsetEnergies {
    float R, entered, R_factor, entered_factor, scattered;
};
MEDULLA_HOT OffsetEnergies energies_without_absorption(const BakedMaterial& m, const Path<float>& path,
                                                       const CellBlend& cells, float inverse_cos_t) noexcept {
    OffsetEnergies e;
    e.R = path.cuticle.F;
    // (1 - F)^2 x (1 + F x + F^2 x^2 + ..), where x is left of a crossing.
    const float T = path.cuticle.T_, x = exponential(-2 * m.header.sigma_ms * path.s_m * inverse_cos_t);
    const float stays = T + e.R * (1 - x);  // 1 - F x
    e.entered = stays > 1e-30f ? T * (T / stays) * x : 0.0f;
    e.R_factor = energy_at(m, cells, 0);
    e.entered_factor = energy_at(m, cells, 1);
    // What is simulated as R cannot be more than there is, nor the rest more than R leaves.
    const float R = e.R_factor * e.R;
    if (R > 1) e.R_factor /= R;
    const float left = R < 1 ? 1 - R : 0.0f, entered = e.entered_factor * e.entered;
    if (entered > left) e.entered_factor *= left / entered;
    e.scattered = left > entered ? left - entered : 0.0f;
    return e;
}

/// A path, the cells about it, and its energies.
struct BakedOffset {
    Path<float> path;
    CellBlend cells;
    OffsetEnergies energy;
    float inverse_cos_t;
};
MEDULLA_HOT BakedOffset baked_offset(const BakedMaterial& m, const Inclination<float>& at, float theta_i,
                                     float h) noexcept {
    const BakedHeader& p = m.header;
    BakedOffset o;
    o.path = trace(at, p.kappa, p.layers, magnitude(h), detail::math::sqrt((1 - h) * (1 + h)));
    o.cells = cells_about(m, theta_i, magnitude(h), p.kappa / at.inverse_index);
    o.inverse_cos_t = at.inverse_cos_t;
    o.energy = energies_without_absorption(m, o.path, o.cells, at.inverse_cos_t);
    return o;
}
/// Its scattered light, but for what is drawn. @param weight of the offset  @return energy, mean of the channels
template <int Channels>
MEDULLA_HOT float set_light(const BakedFibre<Channels>& fibre, const BakedOffset& o, float h, float weight,
                            ScatteredLight<Channels>& light) noexcept {
    const BakedMaterial& m = *fibre.material;
    light.side = h < 0 ? -1.0f : 1.0f;
    light.turn = m.header.turn * 2 * (o.path.gamma_t - o.path.gamma_i);
    constexpr int lanes = BakedFibre<Channels>::lanes;
    const float shortest = o.path.s_c * o.inverse_cos_t + (1 - m.header.kappa);
    alignas(16) float energy[std::size_t(lanes)];
    for (int b = 0; b < lanes; b += 4)
        store_four(Four(weight * o.energy.scattered) *
                       exponential(Four(-shortest) * aligned_four_at(fibre.fibre.sigma_ca + b)),
                   energy + b);
    const Colour<lanes> energies = set_amplitudes(m, o.cells, fibre.weight, energy, light.amplitude);
    float mean = 0;
    for (int c = 0; c < Channels; ++c) mean += energies[c];
    return mean * (1.0f / float(Channels));
}

}  // namespace detail

/// A hit: light that did not scatter, as fields of the other headers, and scattered light of one offset or several.
template <int Channels, class Unscattered, int part_count, int light_count>
struct BakedField {
    static constexpr int lanes = detail::channel_lanes<Channels>;
    const BakedMaterial* material = nullptr;  ///< null: black
    detail::Polar known;
    Unscattered part[std::size_t(part_count)];
    float scale[std::size_t(part_count)] = {}, probability[std::size_t(part_count)] = {};
    detail::ScatteredLight<Channels> light[std::size_t(light_count)];

    /// As NearField and FarField have them.
    MEDULLA_FN Colour<Channels> value(Vector drawn) const noexcept { return evaluate(drawn).value; }
    MEDULLA_FN Colour<Channels> value(Angles drawn) const noexcept { return evaluate(drawn).value; }
    MEDULLA_FN float pdf(Vector drawn) const noexcept { return evaluate(drawn).pdf; }
    MEDULLA_FN float pdf(Angles drawn) const noexcept { return evaluate(drawn).pdf; }
    MEDULLA_FN Evaluation<Channels> evaluate(Vector drawn) const noexcept {
        return sum(drawn, detail::polar_of(drawn));
    }
    MEDULLA_FN Evaluation<Channels> evaluate(Angles drawn) const noexcept {
        return sum(drawn, detail::polar_of(drawn));
    }
    MEDULLA_FN Sample<Channels> sample(RandomNumbers u) const noexcept {
        using namespace detail;
        Sample<Channels> s;
        if (material == nullptr) return s;
        float below = 0, mass = 0;
        int chosen = -1;
        for (int i = 0; i < part_count + light_count; ++i) {
            const float p = i < part_count ? probability[i] : light[i - part_count].probability;
            if (!(p > 0)) continue;
            below += mass;
            mass = p;
            chosen = i;
            if (u.lobe < below + p) break;
        }
        if (chosen < 0) return s;
        u.lobe = reuse(u.lobe, below, below + mass);
        Lobe lobe = Lobe::TTs;
        DrawnExit exit;
        if (chosen < part_count) {
            const Sample<Channels> other = part[chosen].sample(u);
            if (!other.valid) return s;
            lobe = other.lobe, exit = {other.angles.theta, other.angles.phi};
        } else {
            exit = run_fused([&] { return light[chosen - part_count].draw(*material, u.lobe, u); });
        }
        // Sets the direction; then its value.
        Evaluation<Channels> e;
        e.pdf = 1;
        set_sample(known, lobe, exit.theta, exit.phi, e, s);
        e = sum(s.direction, polar_of(s.direction));
        s = {};
        set_sample(known, lobe, exit.theta, exit.phi, e, s);
        return s;
    }
    /// Scattered light alone: energy per radian^2 of (theta_r, phi), phi relative to the known azimuth [radians].
    MEDULLA_FN Colour<Channels> scattered_density(float theta_r, float phi) const noexcept {
        Colour<Channels> result;
        if (material == nullptr || !detail::within(theta_r, float(pi / 2)) || !detail::within(phi, 1e4f)) return result;
        alignas(16) float total[std::size_t(lanes)] = {};
        detail::run_fused([&] { return add(theta_r, phi, total), 0; });
        for (int c = 0; c < Channels; ++c) result[c] = total[c];
        return result;
    }
    /// Share of the light that leaves, over all directions.
    MEDULLA_FN Colour<Channels> albedo() const noexcept {
        Colour<Channels> sum = scattered_energy();
        for (int i = 0; material != nullptr && i < part_count; ++i) {
            const Colour<Channels> other = part[i].albedo();
            for (int c = 0; c < Channels; ++c) sum[c] += scale[i] * other[c];
        }
        return sum;
    }
    /// Energy of scattered light.
    MEDULLA_FN Colour<Channels> scattered_energy() const noexcept {
        Colour<Channels> result;
        for (int i = 0; material != nullptr && i < light_count; ++i)
            for (std::uint32_t k = 0; k < 2 * material->header.functions; ++k)
                for (int c = 0; c < Channels; ++c)
                    result[c] += light[i].amplitude[k][c] * material->area[k % material->header.functions];
        return result;
    }

  private:
    MEDULLA_HOT void add(float theta_r, float phi, float (&total)[std::size_t(lanes)]) const noexcept {
        detail::ExitCorners at;
        detail::set_rows(material->header, theta_r, at);
        for (const detail::ScatteredLight<Channels>& one : light) {
            detail::set_columns(material->header, one.side * phi - one.turn, at);
            detail::add_functions(*material, at, one.amplitude, total);
        }
    }
    template <class Direction>
    MEDULLA_FN Evaluation<Channels> sum(const Direction& drawn, const detail::Polar& polar) const noexcept {
        Evaluation<Channels> e;
        if (material == nullptr || !(polar.cosine > 0)) return e;
        alignas(16) float total[std::size_t(lanes)] = {};
        detail::run_fused([&] {
            const Angles between = detail::angles_between(known, polar);
            add(between.theta, between.phi, total);
            return 0;
        });
        const float inverse = 1 / polar.cosine;
        for (int c = 0; c < Channels; ++c) e.value[c] = total[c] * inverse;
        e.pdf = total[lanes - 1] * inverse;
        for (int i = 0; i < part_count; ++i) {
            if (!(scale[i] > 0)) continue;
            const Evaluation<Channels> other = part[i].evaluate(drawn);
            for (int c = 0; c < Channels; ++c) e.value[c] += scale[i] * other.value[c];
            e.pdf += probability[i] * other.pdf;
        }
        return e;
    }
};

template <int Channels = 3>
using BakedNear = BakedField<Channels, NearField<Channels>, 1, 1>;
/// R, the other light that did not scatter, and eight offsets.
template <int Channels = 3>
using BakedFar = BakedField<Channels, FarField<Channels>, 2, 8>;

namespace detail {

/// Energies of a hit's lobes, R times one factor and the others times another. @return their sum, mean of the channels
template <int Channels>
MEDULLA_HOT float scale_lobes(NearField<Channels>& hit, float R, float entered) noexcept {
    constexpr int drawn = NearField<Channels>::lanes - 1;
    float all = 0;
    for (int k = 0; k < all_lobe_count; ++k) {
        float mean = 0;
        for (int c = 0; c < Channels; ++c) mean += hit.A[k][c] *= k == 0 ? R : entered;
        hit.A[k][drawn] = mean * (1.0f / float(Channels));
        all += hit.A[k][drawn];
    }
    const float inverse = all > 1e-30f ? 1 / all : 0.0f;
    for (int k = 0; k < all_lobe_count; ++k) hit.A[k][drawn] *= inverse;
    return all;
}

template <int Channels>
MEDULLA_HOT BakedNear<Channels> make_near(const BakedFibre<Channels>& fibre, const Polar& known, float h) noexcept {
    BakedNear<Channels> hit;
    h = clamp_offset(h);
    if (fibre.material == nullptr || !(known.cosine > 0) || !within(h, 1.0f)) return hit;
    hit.material = fibre.material, hit.known = known;
    hit.part[0] = make_near(fibre.fibre, known, h);
    const BakedHeader& p = fibre.material->header;
    const Inclination<float> at = inclination(p.eta, known.cosine, Fresnel::exact);
    const BakedOffset o = baked_offset(*fibre.material, at, hit.part[0].known_theta, h);
    const float others = scale_lobes(hit.part[0], o.energy.R_factor, o.energy.entered_factor);
    const float scattered = set_light(fibre, o, h, 1, hit.light[0]);
    const float all = others + scattered, share = all > 1e-30f ? 1 / all : 0.0f;
    hit.light[0].set_drawn(*fibre.material, scattered, share);
    hit.scale[0] = 1, hit.probability[0] = others * share;
    return hit;
}

/// Scattered light is that of eight offsets within the medulla's rim; energies are means over 24.
template <int Channels>
MEDULLA_FN BakedFar<Channels> make_far(const BakedFibre<Channels>& fibre, const Polar& known, Offsets range,
                                       FarQuality quality) noexcept {
    BakedFar<Channels> field;
    if (fibre.material == nullptr) return field;
    const FarField<Channels> all = make_far(fibre.fibre, known, range, quality);
    if (!(all.known.cosine > 0)) return field;
    const BakedMaterial& m = *fibre.material;
    const Inclination<float>& at = all.inclination;
    const float theta_i = all.known_theta, low = all.gamma_low, high = all.gamma_high;
    field.material = &m, field.known = all.known;
    field.part[0] = all.keep(lobe_bit(Lobe::R));
    field.part[1] = all.keep(all_lobes ^ lobe_bit(Lobe::R));
    // Means of the energies: R, closed and simulated; the rest likewise, and with absorption; what scatters.
    float R = 0, R_simulated = 0, entered = 0, entered_simulated = 0, absorbing = 0, scattered = 0;
    const auto visit = [&](const GaussRule& rule, float from, float to, auto&& at_offset) {
        for (int i = 0; i < 2 * rule.half; ++i) {
            const float x = i % 2 == 0 ? rule.x[i / 2] : -rule.x[i / 2];
            const Offset<float> o = offset_at_angle(0.5f * (from + to) + 0.5f * (to - from) * x);
            at_offset(i, o.h, rule.w[i / 2] * 0.5f * (to - from) * o.dh * all.inverse_width);
        }
    };
    visit(gauss_rule(3), low, high, [&](int, float h, float weight) {
        const BakedOffset o = baked_offset(m, at, theta_i, h);
        R += weight * o.energy.R;
        R_simulated += weight * o.energy.R * o.energy.R_factor;
        const float simulated = weight * o.energy.entered * o.energy.entered_factor;
        entered += weight * o.energy.entered;
        entered_simulated += simulated;
        scattered += weight * o.energy.scattered;
        const auto e = energies(o.path, all.absorption, false);
        for (int c = 0; c < Channels; ++c)
            absorbing += weight * (e.A[1][c] + e.A[2][c] + e.A[5][c]) * (1.0f / float(Channels));
    });
    field.scale[0] = R > 1e-30f ? R_simulated / R : 0.0f;
    field.scale[1] = entered > 1e-30f ? entered_simulated / entered : 0.0f;
    // Offsets of the scattered light: within the rim, if the range has some there.
    float from = low > -all.gamma_rim ? low : -all.gamma_rim, to = high < all.gamma_rim ? high : all.gamma_rim;
    if (!(to > from)) {
        from = low;
        to = high;
    }
    float sum = 0, energy[8];
    visit(gauss_rule(0), from, to, [&](int i, float h, float weight) {
        const BakedOffset o = baked_offset(m, at, theta_i, h);
        energy[i] = set_light(fibre, o, h, weight, field.light[i]);
        sum += weight * o.energy.scattered;
    });
    const float balance = sum > 1e-30f ? scattered / sum : 0.0f;
    float mean[2] = {R_simulated, absorbing * field.scale[1]}, total = mean[0] + mean[1];
    for (int i = 0; i < 8; ++i) {
        field.light[i].scale(m, balance);
        energy[i] *= balance;
        total += energy[i];
    }
    const float share = total > 1e-30f ? 1 / total : 0.0f;
    for (int i = 0; i < 2; ++i) field.probability[i] = mean[i] * share;
    for (int i = 0; i < 8; ++i) field.light[i].set_drawn(m, energy[i], share);
    return field;
}

}  // namespace detail

/// A hit at offset h. @return a black hit for a direction along the fibre, or a NaN
template <int Channels>
MEDULLA_FN BakedNear<Channels> near_field(const BakedFibre<Channels>& fibre, Vector known, float h) noexcept {
    return detail::run_fused([&] { return detail::make_near(fibre, detail::polar_of(known), h); });
}
template <int Channels>
MEDULLA_FN BakedNear<Channels> near_field(const BakedFibre<Channels>& fibre, Angles known, float h) noexcept {
    return detail::run_fused([&] { return detail::make_near(fibre, detail::polar_of(known), h); });
}

/// A hit of which an interval of offsets is seen; the whole fibre by default.
template <int Channels>
MEDULLA_FN BakedFar<Channels> far_field(const BakedFibre<Channels>& fibre, Vector known, Offsets range = Offsets(),
                                        FarQuality quality = FarQuality::standard) noexcept {
    return detail::run_fused([&] { return detail::make_far(fibre, detail::polar_of(known), range, quality); });
}
template <int Channels>
MEDULLA_FN BakedFar<Channels> far_field(const BakedFibre<Channels>& fibre, Angles known, Offsets range = Offsets(),
                                        FarQuality quality = FarQuality::standard) noexcept {
    return detail::run_fused([&] { return detail::make_far(fibre, detail::polar_of(known), range, quality); });
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
