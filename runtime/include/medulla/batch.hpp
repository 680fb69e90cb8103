// Many exits of one prepared (theta_i, h) at once: what is left of the tables there is multiplied out, and exits go
// four abreast. Rests on near_field.hpp; NearField::eval is the slow twin.
#pragma once

#include "medulla/config.hpp"
#include "medulla/exit_rows.hpp"
#include "medulla/near_field.hpp"

namespace medulla {

namespace detail {

inline constexpr int batch_block = 16;

/// A near field with what a batch of exits asks for again and again.
template <int Channels>
struct NearBatch {
    const NearField<Channels>& near;
    TruncatedGaussian<float> longitudinal[3];
    ExitRows rows;

    explicit MEDULLA_FN NearBatch(const NearField<Channels>& field) noexcept : near(field) {
        for (int p = 0; p < 3; ++p) longitudinal[p] = field.longitudinal.gaussian[p];
        if (!field.scattered) return;
        rows.set_azimuthal(*field.longitudinal.tables, field.point);
        rows.set_longitudinal(*field.longitudinal.tables, field.longitudinal.point);
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
            const UnfoldedTables& tables = *m.tables;
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
            const UnfoldedTables& tables = *m.tables;
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
    if (!near.valid || count < 8 || (near.scattered && near.longitudinal.tables == nullptr)) {
        for (int i = 0; i < count; ++i) S[i] = near.eval(theta_r[i], phi[i]);
        return;
    }
    run_widest([&] { detail::eval_exits(near, count, theta_r, phi, S); });
}

}  // namespace medulla
