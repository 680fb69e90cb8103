// Everything that a renderer does with an open pack. Any pack that open_pack accepts must give finite numbers.
// For mutation tests and fuzzers; uses the runtime only.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>

#include "medulla/medulla.hpp"

namespace medulla::testing {

namespace detail {

/// Tests bits, which -ffast-math cannot optimise away. Densities and energies of any pack are finite and not negative.
inline bool is_density(float x) {
    std::uint32_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    return bits < 0x7f800000u || bits == 0x80000000u;
}

/// Looks up each table inside and outside its axes. Square roots of sigma and 1 - h^2 are NaN for negative arguments,
/// so those results are not checked.
inline const char* exercise_tables(const PackView& pack) {
    for (const float sigma : {0.0f, 1e-30f, 0.7f, 16.0f, 1e30f, -1.0f})
        for (const float other : {0.0f, 0.6f, 1.0f, -0.3f, -2.0f}) {
            const bool answered = sigma >= 0 && other >= -1;
            const auto bad = [&](float value) { return answered && !is_density(value); };
            for (const TableView& table : pack.tables) {
                if (!table) continue;
                LobeQuery query = {};
                query.sigma = sigma, query.g = other, query.h = other, query.theta_i = other, query.absorption = sigma;
                const Contraction contraction = contract(table, query);
                if (!table.has_exit()) {
                    if (answered && !std::isfinite(scalar(table, contraction))) return "a number without an exit axis";
                    continue;
                }
                ExitDistribution distribution;
                distribute(table, contraction, distribution);
                if (bad(distribution.pdf(0.2f))) return "the density of a distribution";
                for (const float u : {0.0f, 0.3f, 0.99999994f, 1.0f})
                    if (answered && !std::isfinite(distribution.sample(u))) return "a drawn exit";
                for (const float y : {-3.0f, -1e-7f, 0.0f, 0.3f, 1.5707963f, 3.1415927f, 100.0f})
                    if (bad(lobe(table, contraction, y))) return "a lobe";
            }
            if (pack[TableKind::azimuthal])
                for (const float absorption : {0.0f, 0.7f, 30.0f})
                    if ((absorption == 0 || absorbs(pack)) &&
                        bad(azimuthal(pack, sigma, other, other, 1.0f, absorption)))
                        return "C^N";
            if (pack[TableKind::longitudinal_back] && bad(longitudinal(pack, Side::back, sigma, other, other, 0.3f)))
                return "C^M, back";
            if (pack[TableKind::longitudinal_forward] &&
                bad(longitudinal(pack, Side::forward, sigma, other, other, 0.3f)))
                return "C^M, forward";
        }
    return nullptr;
}

template <class Sampler>
const char* exercise_sampler(const Sampler& sampler) {
    for (const RandomNumbers& u : {RandomNumbers{0, 0, 0, 0, 0}, RandomNumbers{0.9f, 0.7f, 0.3f, 0.1f, 0.5f},
                                   RandomNumbers{0.99999994f, 0.5f, 0.99999994f, 0.99999994f, 0.99999994f}}) {
        const FurSample<1> s = sampler.sample(u);
        if (s.valid && (!std::isfinite(s.theta_r) || !std::isfinite(s.phi))) return "a drawn direction";
        if (s.valid && (!is_density(s.pdf) || !is_density(s.weight[0]))) return "a sample's density";
        if (s.valid && !is_density(sampler.pdf(s.theta_r, s.phi))) return "a sampler's density";
    }
    return nullptr;
}

/// Near and far field of a fibre, single queries and batches.
inline const char* exercise_fibre(const FurFibre<1>& fibre) {
    float theta_r[16], phi[16], theta_i[16], h[16];
    for (int i = 0; i < 16; ++i) {
        const auto x = static_cast<float>(i);
        theta_r[i] = 0.2f * x - 1.5f, phi[i] = 0.4f * x - 3, theta_i[i] = 1.5f - 0.19f * x, h[i] = x / 7.5f - 1;
    }
    Colour<1> S[16];
    for (const float inclination : {0.0f, -1.2f, 1.5707f}) {
        for (const float offset : {0.0f, 0.6f, -1.0f}) {
            NearField<1> near;
            near_field(fibre, inclination, offset, near);
            if (!is_density(near.eval(0.1f, 0.2f).value[0])) return "the near field";
            eval(near, 16, theta_r, phi, S);
            for (const Colour<1>& at : S)
                if (!is_density(at.value[0])) return "the near field of many exits";
            NearSampler<1> sampler;
            sampler.prepare(near);
            if (const char* wrong = exercise_sampler(sampler)) return wrong;
        }
        for (const OffsetRange range : {OffsetRange{}, OffsetRange{0.2f, 0.3f}}) {
            FarField<1> far;
            far_field(fibre, inclination, range, far, FarQuality::draft);
            if (!is_density(far.eval(0.2f, 1.0f).value[0])) return "the far field";
            FarSampler<1> sampler;
            sampler.prepare(far);
            if (const char* wrong = exercise_sampler(sampler)) return wrong;
        }
    }
    eval(fibre, 16, theta_i, h, theta_r, phi, S);
    for (const Colour<1>& at : S)
        if (!is_density(at.value[0])) return "independent queries";
    return nullptr;
}

}  // namespace detail

/// Evaluates and samples every table, and fibres of several materials, from factors and from dense tables.
/// @return description of the first value that is not finite or below 0, empty if none
inline std::string exercise(const PackView& pack) {
    if (const char* wrong = detail::exercise_tables(pack)) return wrong;
    static const auto dense = std::make_unique<UnfoldedTables>();
    FurParameters<1> bobcat = parameters_of<1>(*find_preset("bobcat"));
    FurParameters<1> absorbing = bobcat, thin = bobcat;
    absorbing.sigma_ma = 0.5f, absorbing.eta = 1.3f;
    thin.sigma_ms = 1e-4f, thin.g = -0.9f;
    for (const FurParameters<1>& material : {bobcat, absorbing, thin}) {
        FurFibre<1> fibre;
        if (!usable(prepare(material, pack, fibre))) continue;  // a pack without the tables of a fibre
        if (const char* wrong = detail::exercise_fibre(fibre)) return wrong;
        if (!unfold(fibre, *dense)) continue;
        if (const char* wrong = detail::exercise_fibre(fibre)) return std::string(wrong) + ", dense tables";
    }
    return "";
}

}  // namespace medulla::testing
