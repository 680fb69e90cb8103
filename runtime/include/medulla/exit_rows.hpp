// Unfolded tables multiplied out further, for one light and offset: splines over the exit alone, which a batch of exits
// and a sampler read. Rests on unfolded.hpp and scattered_lookup.hpp.
#pragma once

#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/lanes.hpp"
#include "medulla/scattered_lookup.hpp"
#include "medulla/unfolded.hpp"

namespace medulla {

namespace detail {

/// C^N and C^M of one near field as splines over the exit alone: a lookup is then four products. Rows of y >= 0, then
/// those of y < 0; some beyond the last are written and not used.
struct ExitRows {
    static constexpr std::uint32_t most = 2 * (most_exit_spans + 3);
    alignas(16) float azimuthal[most + 4];         ///< [row]
    alignas(16) float longitudinal[2 * most + 4];  ///< [row][back, forward]

    /// @param terms from where a row of one exit begins: its four numbers, weighted, to be added up
    template <class Terms>
    MEDULLA_FN void set_azimuthal(const UnfoldedTables& tables, Terms&& terms) noexcept {
        const std::uint32_t rows = 2 * tables.azimuth_rows;
        for (std::uint32_t k = 0; k < rows; k += 4) {
            Four at[4];
            for (std::uint32_t i = 0; i < 4; ++i) at[i] = terms(4 * std::size_t(k + i < rows ? k + i : k));
            transpose(at[0], at[1], at[2], at[3]);
            store_four((at[0] + at[1]) + (at[2] + at[3]), azimuthal + k);
        }
    }
    MEDULLA_FN void set_azimuthal(const UnfoldedTables& tables, const AzimuthalPoint& p) noexcept {
        const Four w0 = spread<0>(p.offset) * p.sigma, w1 = spread<1>(p.offset) * p.sigma,
                   w2 = spread<2>(p.offset) * p.sigma, w3 = spread<3>(p.offset) * p.sigma;
        const std::size_t step = 8 * std::size_t(tables.azimuth_rows);
        set_azimuthal(tables, [&](std::size_t from) {
            const float* r = p.rows + from;
            return (w0 * aligned_four_at(r) + w1 * aligned_four_at(r + step)) +
                   (w2 * aligned_four_at(r + 2 * step) + w3 * aligned_four_at(r + 3 * step));
        });
    }
    MEDULLA_FN void set_longitudinal(const UnfoldedTables& tables, const LongitudinalPoint& m) noexcept {
        const Four w[4] = {spread<0>(m.weight), spread<1>(m.weight), spread<2>(m.weight), spread<3>(m.weight)};
        const std::uint32_t length = 4 * tables.longitude_rows;
        for (std::uint32_t k = 0; k < length; k += 4) {
            const float* r = m.rows + k;
            store_four((w[0] * four_at(r) + w[1] * four_at(r + length)) +
                           (w[2] * four_at(r + 2 * length) + w[3] * four_at(r + 3 * length)),
                       longitudinal + k);
        }
    }
    /// Densities of TTs or TRTs at four places, >= 0.
    MEDULLA_HOT Four azimuthal_densities(const UnfoldedTables& tables, const ExitPlaces& places) const noexcept {
        Four at[4];
        for (int i = 0; i < 4; ++i) {
            const RowPoint exit = tables.azimuth.at(places.stretch[i], places.place[i]);
            at[i] = exit.weight * four_at(azimuthal + exit.first + tables.azimuth_rows * (places.below >> i & 1u));
        }
        transpose(at[0], at[1], at[2], at[3]);
        return greater(Four(0.0f), (at[0] + at[1]) + (at[2] + at[3]));  // a NaN stays one
    }
    /// M^s of Eq. 19 at four places. @param forwardness |phi| / pi
    MEDULLA_HOT Four longitudinal_densities(const UnfoldedTables& tables, const ExitPlaces& places,
                                            Four forwardness) const noexcept {
        Four at[4];
        for (int i = 0; i < 4; ++i) {
            const RowPoint exit = tables.longitude_exit(places, i);
            at[i] = lower_twice(exit.weight) * four_at(longitudinal + exit.first) +
                    upper_twice(exit.weight) * four_at(longitudinal + exit.first + 4);
        }
        transpose(at[0], at[1], at[2], at[3]);
        const Four zero(0.0f);
        return blend_sides(greater(zero, at[0] + at[2]), greater(zero, at[1] + at[3]), forwardness);
    }
};

}  // namespace detail

}  // namespace medulla
