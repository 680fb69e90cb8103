// Everything that a renderer does with an open pack. Any pack that open_pack accepts must give finite numbers.
// For mutation tests and fuzzers; uses the runtime only.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

#include "tests/support/fibre_of.hpp"

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

template <class Field>
const char* exercise_field(const Field& field) {
    for (const Angles drawn : {Angles{0.1f, 0.2f}, Angles{-1.5f, -3}, Angles{1.4f, 2}}) {
        const Evaluation<1> e = field.evaluate(drawn);
        if (!is_density(e.value[0]) || !is_density(e.pdf)) return "a value or its density";
    }
    for (const RandomNumbers& u :
         {RandomNumbers{0, 0, 0, 0, 0}, RandomNumbers{0.9f, 0.7f, 0.3f, 0.1f, 0.5f}, RandomNumbers{1, 1, 1, 1, 1}}) {
        const Sample<1> s = field.sample(u);
        if (!std::isfinite(s.angles.theta) || !std::isfinite(s.angles.phi)) return "a drawn direction";
        if (!is_density(s.pdf) || !is_density(s.weight[0])) return "a sample's density";
    }
    return nullptr;
}

/// Near and far field of a fibre.
inline const char* exercise_fibre(const Fibre<1>& fibre) {
    for (const float inclination : {0.0f, -1.2f, 1.5707f}) {
        for (const float offset : {0.0f, 0.6f, -1.0f})
            if (const char* wrong = exercise_field(near_field(fibre, Angles{inclination, 0}, offset))) return wrong;
        for (const Offsets range : {Offsets{}, Offsets{0.2f, 0.3f}})
            if (const char* wrong = exercise_field(far_field(fibre, Angles{inclination, 0}, range, FarQuality::draft)))
                return wrong;
    }
    return nullptr;
}

}  // namespace detail

/// Evaluates every table, and evaluates and samples fibres of several materials.
/// @return description of the first value that is not finite or below 0, empty if none
inline std::string exercise(const PackView& pack) {
    if (const char* wrong = detail::exercise_tables(pack)) return wrong;
    FurParameters<1> bobcat = parameters_of<1>(*find_preset("bobcat"));
    FurParameters<1> absorbing = bobcat, thin = bobcat;
    absorbing.sigma_ma = 0.5f, absorbing.eta = 1.3f;
    thin.sigma_ms = 1e-4f, thin.g = -0.9f;
    for (const FurParameters<1>& material : {bobcat, absorbing, thin})
        if (const char* wrong = detail::exercise_fibre(test::FibreOf<1>(material, pack))) return wrong;
    return "";
}

}  // namespace medulla::testing
