// Many exits of one prepared (theta_i, h) at once: what is left of the tables there is multiplied out, and exits go
// four abreast. Rests on near_field.hpp; NearField::eval is the slow twin.
#pragma once

#include "medulla/config.hpp"
#include "medulla/near_field.hpp"

namespace medulla {

namespace detail {

inline constexpr int batch_block = 16;

/// C^N and C^M of one near field as splines over the exit alone: a lookup is then four products. Rows of y >= 0, then
/// those of y < 0; some beyond the last are read and not used.
struct ExitRows {
    static constexpr std::uint32_t most = 2 * (most_exit_spans + 3);
    alignas(16) float azimuthal[most + 4];         ///< [row]
    alignas(16) float longitudinal[2 * most + 4];  ///< [row][back, forward]

    template <int Channels>
    MEDULLA_FN void set(const NearField<Channels>& near) noexcept {
        const UnfoldedTables& tables = *near.fibre->tables;
        const AzimuthalPoint& p = near.point;
        const Four w0 = spread<0>(p.offset) * p.sigma, w1 = spread<1>(p.offset) * p.sigma,
                   w2 = spread<2>(p.offset) * p.sigma, w3 = spread<3>(p.offset) * p.sigma;
        const std::uint32_t rows = 2 * tables.azimuth_rows, step = 4 * rows;
        for (std::uint32_t k = 0; k < rows; k += 4) {
            Four at[4];
            for (std::uint32_t i = 0; i < 4; ++i) {
                const float* r = p.rows + 4 * (k + i < rows ? k + i : k);
                at[i] = (w0 * aligned_four_at(r) + w1 * aligned_four_at(r + step)) +
                        (w2 * aligned_four_at(r + 2 * step) + w3 * aligned_four_at(r + 3 * step));
            }
            transpose(at[0], at[1], at[2], at[3]);
            store_four((at[0] + at[1]) + (at[2] + at[3]), azimuthal + k);
        }
        const LongitudinalPoint& m = near.longitudinal.point;
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
        return greater((at[0] + at[1]) + (at[2] + at[3]), Four(0.0f));
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
        return (Four(1.0f) - forwardness) * greater(at[0] + at[2], zero) + forwardness * greater(at[1] + at[3], zero);
    }
};

/// A near field with what a batch of exits asks for again and again.
template <int Channels>
struct NearBatch {
    const NearField<Channels>& near;
    TruncatedGaussian<float> longitudinal[3];
    ExitRows rows;

    explicit MEDULLA_FN NearBatch(const NearField<Channels>& field) noexcept : near(field) {
        for (int p = 0; p < 3; ++p) longitudinal[p] = field.longitudinal.gaussian[p];
        if (field.scattered) rows.set(field);
    }
    /// S at a block of exits, all of them valid: first every place, then every sum, so that one waits for memory while
    /// the next is on its way.
    MEDULLA_HOT void eval(const float (&theta_r)[batch_block], const float (&phi)[batch_block],
                          float (&S)[Channels][batch_block]) const noexcept {
        constexpr int fours = batch_block / 4;
        const FurFibre<Channels>& fibre = *near.fibre;
        const Longitudinal<Channels>& m = near.longitudinal;
        const auto& A = near.energy.A;
        ExitPlaces around[2][fours], along[fours];
        Four forwardness[fours];
        for (int i = 0; near.scattered && i < fours; ++i) {
            const UnfoldedTables& tables = *fibre.tables;
            const Four azimuth = four_at(phi + 4 * i), theta = four_at(theta_r + 4 * i);
            for (int p = 0; p < 2; ++p)
                around[p][i] = exit_places(turns_of(Four(near.side) * (azimuth - Four(near.centre[3 + p]))),
                                           Four(tables.azimuth_scale));
            along[i] = exit_places(turns_of(m.theta_i < 0 ? -theta : theta), Four(tables.longitude_scale));
            forwardness[i] = Four(2.0f) * magnitude(turns_of(azimuth));
        }
        for (int i = 0; i < fours; ++i) {
            const Four azimuth = four_at(phi + 4 * i), theta = four_at(theta_r + 4 * i);
            Four value[3];
            for (int p = 0; p < 3; ++p)
                value[p] =
                    joint_pdf(longitudinal[p], fibre.azimuthal_gaussian[p], theta, azimuth - Four(near.centre[p]));
            for (int c = 0; c < Channels; ++c)
                store_four(Four(A[0][c]) * value[0] + Four(A[1][c]) * value[1] + Four(A[2][c]) * value[2],
                           S[c] + 4 * i);
        }
        for (int i = 0; near.scattered && i < fours; ++i) {
            const UnfoldedTables& tables = *fibre.tables;
            const Four M = rows.longitudinal_densities(tables, along[i], forwardness[i]);
            const Four TTs = M * rows.azimuthal_densities(tables, around[0][i]),
                       TRTs = M * rows.azimuthal_densities(tables, around[1][i]);
            for (int c = 0; c < Channels; ++c)
                store_four(four_at(S[c] + 4 * i) + (Four(A[3][c]) * TTs + Four(A[4][c]) * TRTs), S[c] + 4 * i);
        }
    }
};

/// The whole batch.
template <int Channels>
MEDULLA_FN void eval_exits(const NearField<Channels>& near, int count, const float* theta_r, const float* phi,
                           Colour<Channels>* S) noexcept {
    const NearBatch<Channels> batch(near);
    for (int from = 0; from < count; from += batch_block) {
        const int n = count - from < batch_block ? count - from : batch_block;
        float theta[batch_block], azimuth[batch_block], factor[batch_block], value[Channels][batch_block];
        for (int i = 0; i < batch_block; ++i) {
            const int k = from + (i < n ? i : 0);
            const bool valid = within(theta_r[k], float(pi / 2)) && within(phi[k], 1e4f);
            theta[i] = valid ? theta_r[k] : 0.0f, azimuth[i] = valid ? phi[k] : 0.0f;
            factor[i] = valid ? near.longitudinal.scale : 0.0f;
        }
        batch.eval(theta, azimuth, value);
        for (int i = 0; i < n; ++i)
            for (int c = 0; c < Channels; ++c) S[from + i].value[c] = value[c][i] * factor[i];
    }
}

}  // namespace detail

/// S of Eq. 12 at `count` exits, as near.eval(theta_r[i], phi[i]) but for rounding. Fastest where the fibre's tables
/// are unfolded and `count` is a multiple of 16; fewer than 8 exits are asked one by one.
template <int Channels>
MEDULLA_FN void eval(const NearField<Channels>& near, int count, const float* theta_r, const float* phi,
                     Colour<Channels>* S) noexcept {
    if (!near.valid || count < 8 || (near.scattered && near.fibre->tables == nullptr)) {
        for (int i = 0; i < count; ++i) S[i] = near.eval(theta_r[i], phi[i]);
        return;
    }
    run_widest([&] { detail::eval_exits(near, count, theta_r, phi, S); });
}

}  // namespace medulla
