// The fur fibre: what a material's parameters decide at a hit before any direction is known. A small value (at most 256
// bytes) that a renderer's closure can hold. Rests on fur_parameters.hpp, and reads tables.hpp.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/detail/escape.hpp"
#include "medulla/detail/gaussian.hpp"
#include "medulla/detail/table_lookup.hpp"
#include "medulla/fur_parameters.hpp"
#include "medulla/tables.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

enum class FibreStatus : std::uint32_t {
    ok,
    clamped_parameters,  ///< usable: parameters out of range were brought into it, as asked; out_of_range says which
    beyond_tables,       ///< usable: g or the optical radius is outside the tables' ranges and clamped to them
    no_tables,           ///< usable: kappa > 0 and sigma_ms > 0, but there are no tables: scattered lobes are absent
    other_form,          ///< usable: the tables have the other form of the scattered lobes, which are absent
    bad_parameters,      ///< black: out_of_range says which parameters are out of their ranges
};

MEDULLA_FN const char* describe(FibreStatus status) noexcept {
    switch (status) {
        case FibreStatus::ok:
            return "ok";
        case FibreStatus::clamped_parameters:
            return "parameters were clamped to their ranges";
        case FibreStatus::beyond_tables:
            return "g or the optical radius is outside the tables' ranges, and is clamped to them";
        case FibreStatus::no_tables:
            return "no tables: scattered lobes are absent";
        case FibreStatus::other_form:
            return "the tables are those of the other form (FurParameters::scattering): scattered lobes are absent";
        case FibreStatus::bad_parameters:
            return "parameters are out of their ranges: the fibre is black";
    }
    return "unknown status";
}

/// What make_fibre does with parameters out of their ranges.
enum class OutOfRange : std::uint32_t { black, clamp };

template <int Channels = 3>
struct Fibre {
    FurParameters<Channels> parameters;
    FibreStatus status = FibreStatus::bad_parameters;
    std::uint32_t out_of_range = 0;           ///< bits of Parameter
    const DenseTables* tables = nullptr;      ///< null: no scattered lobes
    alignas(16) float shift[4] = {};          ///< alpha_p of Table 2 for R, TT, TRT and the residual lobe [radians]
    alignas(16) float deviation[4] = {};      ///< beta_p of Table 2 [radians]
    detail::WrappedGaussians azimuthal = {};  ///< variance (p + 1) beta_n^2 (Eq. 16)
    alignas(16) float sigma_ca[std::size_t(detail::channel_lanes<Channels>)] = {};  ///< the parameters', padded with 0
    alignas(16) float g_weight[4] = {};                                             ///< of rows of g
    std::uint32_t g_count = 0, g_first = 0;
    detail::ScatteredEnergy<detail::channel_lanes<Channels>> scattered = {};
};
static_assert(sizeof(Fibre<3>) <= 256, "a fibre fits into a closure");

/// Makes a fibre; some 30 ns. kappa = 0 or sigma_ms = 0 reads no table and is the hair model R + TT + TRT.
/// @param tables made for ranges that hold the parameters; may be null. Only eta, kappa, sigma_ms, sigma_ma and g ask
///        something of them: colour, roughness, tilt and layers are free.
template <int Channels>
MEDULLA_FN Fibre<Channels> make_fibre(const FurParameters<Channels>& parameters, const DenseTables* tables,
                                      OutOfRange out = OutOfRange::black) noexcept {
    Fibre<Channels> f;
    FurParameters<Channels>& p = f.parameters;
    p = parameters;
    f.out_of_range = out_of_range(p);
    f.status = FibreStatus::ok;
    if (f.out_of_range != 0) {
        if (out == OutOfRange::black) {
            f.status = FibreStatus::bad_parameters;
            return f;
        }
        p = clamped(p), f.status = FibreStatus::clamped_parameters;
    }
    // Table 2, and its rule carried on to the paths after TRT.
    detail::store_four(detail::Four(1.0f, -0.5f, -1.5f, -2.5f) * detail::Four(p.alpha), f.shift);
    detail::store_four(detail::Four(1.0f, 0.5f, 1.5f, 2.5f) * detail::Four(p.beta_m), f.deviation);
    for (int c = 0; c < Channels; ++c) f.sigma_ca[c] = p.sigma_ca[c];
    f.azimuthal = detail::wrapped_gaussians(p.beta_n);
    if (!(p.kappa > 0 && p.sigma_ms > 0)) return f;
    if (tables == nullptr) {
        f.status = FibreStatus::no_tables;
        return f;
    }
    assert(tables->magic == tables_magic && "the memory of a fibre's tables is gone or was overwritten");
    if (tables->ranges.forms != form_bit(p.scattering)) {
        f.status = FibreStatus::other_form;
        return f;
    }
    f.tables = tables;
    if (p.scattering == Scattering::corrected)
        detail::run_fused([&] { detail::set_corrected(p, f.sigma_ca, tables->absorbs != 0, f.scattered); });
    else
        detail::set_published(p, tables->absorbs != 0, f.scattered);
    detail::TableRows at;
    detail::set_g(tables->g, tables->g_rows, p.g, at);
    f.g_count = at.g_count, f.g_first = at.g_first;
    for (int k = 0; k < 4; ++k) f.g_weight[k] = at.g[k];
    // Equal but for rounding, as ranges_of and a sum of textures may differ by it.
    const TableRanges& r = tables->ranges;
    const float radius = p.sigma_ms * p.kappa, slack = 1e-4f;
    const float longest2 = p.eta * p.eta * radius * radius, span2 = (p.eta - 1) * (p.eta + 1);
    bool inside = p.g >= r.g_low - slack && p.g <= r.g_high + slack && radius >= r.sigma_low * (1 - slack) &&
                  longest2 <= r.sigma_high * r.sigma_high * (1 + slack) * span2;
    if (tables->one_material)
        inside = inside && radius <= r.sigma_low * (1 + slack) && detail::within(p.eta - r.eta, slack);
    if (!inside && f.status == FibreStatus::ok) f.status = FibreStatus::beyond_tables;
    return f;
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
