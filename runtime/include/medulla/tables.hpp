// The medulla's dense tables: a pack's factors multiplied out over ranges of g and of the optical radius, once per
// coat. They lie in memory that the caller owns, hold offsets and no pointers, and so can be copied as bytes, to a GPU
// too. Rests on lookup.hpp, whose contractions from factors are the reference implementation.
//
// Each table is a tensor of cubic B-spline coefficients: C^N over (g, sigma, h; phi), C^M over (g, sigma, theta_i;
// theta_r) for the backward and the forward side, or, of one material, over (theta_i; theta_r) alone, since its sigma
// follows from theta_i. A row is one spline over the exit direction. What a lookup returns is
// sum over rows of w max(0, row(y)), weights w >= 0 of sum 1 and rows whose positive part integrates to 1: a density of
// integral 1 that can be drawn from exactly, by picking a row by its weight and inverting it. docs/bcsdf.md, 'Dense
// tables', has the errors.
#pragma once

#include <cstddef>
#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/detail/spline_axis.hpp"
#include "medulla/fur_parameters.hpp"
#include "medulla/pack.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// What tables are made for. Ends beyond the pack's axes are those axes' ends.
struct TableRanges {
    float g_low = 0, g_high = 0;          ///< mean cosine of the phase function [1], in (-1, 1)
    float sigma_low = 0, sigma_high = 0;  ///< optical radius sigma_ms kappa / cos theta_t [1], >= 0
    float absorption = 0;  ///< sigma_ma / sigma_ms [1]; read where the pack has an axis of absorption alone
    /// Of one material its index [1]: the optical radius at theta_i is then sigma_low / cos theta_t, which leaves C^M a
    /// table over (theta_i; theta_r). Anything else, such as 0, and ends that are not one material's leave sigma free.
    float eta = 0;
    std::uint32_t forms = 1;  ///< form_bit of the materials' Scattering; tables have one form
};
MEDULLA_FN constexpr std::uint32_t form_bit(Scattering scattering) noexcept {
    return scattering == Scattering::corrected ? 2u : 1u;
}

/// The ranges that one material needs: its g, and sigma_ms kappa to sigma_ms kappa eta / sqrt(eta^2 - 1) over all
/// theta_i.
template <int Channels>
MEDULLA_FN TableRanges ranges_of(const FurParameters<Channels>& p) noexcept {
    const float radius = p.sigma_ms * p.kappa;
    const float longest = p.eta / detail::math::sqrt((p.eta - 1) * (p.eta + 1));  // 1 / cos theta_t at grazing
    return {p.g,
            p.g,
            radius,
            radius * longest,
            p.sigma_ms > 0 ? p.sigma_ma / p.sigma_ms : 0.0f,
            p.eta,
            form_bit(p.scattering)};
}
/// The ranges that cover both. The absorption is a's: where the pack has an axis of it, materials that share tables
/// have the same sigma_ma / sigma_ms.
MEDULLA_FN TableRanges join(const TableRanges& a, const TableRanges& b) noexcept {
    return {a.g_low < b.g_low ? a.g_low : b.g_low,
            a.g_high > b.g_high ? a.g_high : b.g_high,
            a.sigma_low < b.sigma_low ? a.sigma_low : b.sigma_low,
            a.sigma_high > b.sigma_high ? a.sigma_high : b.sigma_high,
            a.absorption,
            a.eta < b.eta || a.eta > b.eta ? 0.0f : a.eta,
            a.forms | b.forms};
}

/// Dense tables as they lie in memory; made by make_tables. Arrays follow the struct.
struct DenseTables {
    std::uint64_t magic;    ///< tables_magic
    std::uint64_t bytes;    ///< of everything
    TableRanges ranges;     ///< what they cover: as asked for, within the pack's axes
    std::uint32_t absorbs;  ///< whether survival lengths are there
    detail::SplineAxis sigma, g, h, theta_i, phi, theta_r;
    std::uint32_t g_rows;            ///< 1: g is one number
    std::uint32_t one_material;      ///< 1: C^M has lines of theta_i in place of sigma, and none of g
    std::uint32_t azimuthal;         ///< bytes from here: float[g][h][phi >= 0, phi < 0][row of |phi|][sigma]
    std::uint32_t azimuthal_blocks;  ///< float[g][h][sigma][blocks]: cumulated integrals of eight spans each
    /// float[g][theta_i][theta_r >= 0, < 0][row of |theta_r|][back, forward][sigma], or of one material
    /// float[theta_r >= 0, < 0][row of |theta_r|][back, forward][theta_i]
    std::uint32_t longitudinal;
    std::uint32_t
        longitudinal_blocks;  ///< float[g][theta_i][back, forward][sigma][blocks], or [back, forward][theta_i][blocks]
    std::uint32_t survival;   ///< float[g][h][sigma]

    MEDULLA_HOT const float* floats(std::uint32_t offset) const noexcept {
        return reinterpret_cast<const float*>(reinterpret_cast<const char*>(this) + offset);
    }
    /// Floats from one number to the next along an axis.
    MEDULLA_HOT std::uint32_t azimuthal_step() const noexcept { return sigma.rows; }
    MEDULLA_HOT std::uint32_t longitudinal_step() const noexcept { return 2 * longitudinal_side(); }
    MEDULLA_HOT std::uint32_t longitudinal_side() const noexcept { return one_material ? theta_i.rows : sigma.rows; }
    MEDULLA_HOT std::uint32_t longitudinal_planes() const noexcept { return one_material ? 1 : g_rows * theta_i.rows; }
};
static_assert(sizeof(DenseTables) == 296, "one layout everywhere");
inline constexpr std::uint64_t tables_magic = 0x324c42544c44454du;  // "MEDLTBL2"

enum class TablesStatus {
    ok,
    no_azimuthal_table,
    no_longitudinal_table,
    bad_ranges,  ///< a range that is empty, not finite, or wholly outside the pack's axes
    two_forms,   ///< materials of both forms of the scattered lobes, or of none
    bad_axes,    ///< the pack's two longitudinal tables have different axes, or an axis is too finely divided
    null_memory,
    unaligned_memory,
    too_little_memory,
    too_large,  ///< more than 2 GiB
};

MEDULLA_FN const char* describe(TablesStatus status) noexcept {
    switch (status) {
        case TablesStatus::ok:
            return "ok";
        case TablesStatus::no_azimuthal_table:
            return "the pack has no azimuthal table";
        case TablesStatus::no_longitudinal_table:
            return "the pack lacks a longitudinal table";
        case TablesStatus::bad_ranges:
            return "a range of g or sigma is empty, not finite, or outside the pack's axes";
        case TablesStatus::two_forms:
            return "materials of the published and of the corrected form cannot share tables";
        case TablesStatus::bad_axes:
            return "the pack's tables have axes that dense tables cannot share";
        case TablesStatus::null_memory:
            return "no memory was given";
        case TablesStatus::unaligned_memory:
            return "the memory is not aligned to 64 bytes";
        case TablesStatus::too_little_memory:
            return "the memory is smaller than tables_bytes says";
        case TablesStatus::too_large:
            return "the tables would take more than 2 GiB";
    }
    return "unknown status";
}

struct TablesResult {
    const DenseTables* tables;  ///< null unless status is ok
    TablesStatus status;
};

/// Bytes that make_tables needs; 0 where it would refuse (its status says why).
MEDULLA_FN std::size_t tables_bytes(const PackView& pack, const TableRanges& ranges) noexcept;

/// Multiplies the pack's tables out into `memory` (aligned to 64 bytes), which the caller keeps for as long as fibres
/// read it. The pack is not read afterwards. Takes some milliseconds.
MEDULLA_FN TablesResult make_tables(const PackView& pack, const TableRanges& ranges, void* memory,
                                    std::size_t bytes) noexcept;

}  // namespace MEDULLA_TARGET
}  // namespace medulla

#include "medulla/detail/make_tables.hpp"
