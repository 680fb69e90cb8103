// Many exits of one prepared (theta_i, h) at once: four abreast through the Gaussians, and table lookups in stages, so
// that each waits for memory while the next is on its way. Rests on fur_fibre.hpp; NearField::eval is the slow twin.
#pragma once

#include "medulla/config.hpp"
#include "medulla/fur_fibre.hpp"

namespace medulla {

namespace detail {

inline constexpr int batch_block = 16;

/// S without its 1 / cos^2 theta_i for one block of exits, all of them valid.
template <int Channels>
MEDULLA_FN void near_block(const NearField<Channels>& near, const float (&theta_r)[batch_block],
                           const float (&phi)[batch_block], float (&S)[Channels][batch_block]) noexcept {
    const FurFibre<Channels>& fibre = *near.fibre;
    const Longitudinal<Channels>& m = near.longitudinal;
    for (int i = 0; i < batch_block; i += 4) {
        const Four theta = four_at(theta_r + i), azimuth = four_at(phi + i);
        Four value[3];
        for (int p = 0; p < 3; ++p)
            value[p] = m.gaussian[p].pdf_of(theta) * fibre.azimuthal_gaussian[p].pdf_of(azimuth - Four(near.centre[p]));
        for (int c = 0; c < Channels; ++c)
            store_four(Four(near.energy.A[0][c]) * value[0] + Four(near.energy.A[1][c]) * value[1] +
                           Four(near.energy.A[2][c]) * value[2],
                       S[c] + i);
    }
    if (!near.scattered) return;
    const UnfoldedTables& tables = *fibre.tables;
    const float side = m.theta_i < 0 ? -1.0f : 1.0f;
    RowPoint around[2][batch_block], along[batch_block];
    for (int i = 0; i < batch_block; ++i) {
        for (int p = 0; p < 2; ++p) around[p][i] = tables.azimuth_exit(near.side * (phi[i] - near.centre[p + 3]));
        along[i] = tables.longitude_exit(side * theta_r[i]);
    }
    float N[2][batch_block], back[batch_block], forward[batch_block];
    for (int i = 0; i < batch_block; ++i) {
        for (int p = 0; p < 2; ++p) N[p][i] = tables.azimuthal_density(near.point, around[p][i]);
        const BackForward at = tables.longitudinal_density(m.point, along[i]);
        back[i] = at.back, forward[i] = at.forward;
    }
    for (int i = 0; i < batch_block; i += 4) {
        const Four x = four_at(phi + i), turns = nearest_integer(x * Four(float(1 / (2 * pi))));
        const Four t = magnitude(x - Four(float(2 * pi)) * turns) * Four(float(1 / pi));
        const Four M = (Four(1.0f) - t) * four_at(back + i) + t * four_at(forward + i);
        for (int c = 0; c < Channels; ++c)
            store_four(four_at(S[c] + i) + M * (Four(near.energy.A[3][c]) * four_at(N[0] + i) +
                                                Four(near.energy.A[4][c]) * four_at(N[1] + i)),
                       S[c] + i);
    }
}

}  // namespace detail

/// S of Eq. 12 at `count` exits, as near.eval(theta_r[i], phi[i]) but for rounding. Fastest where the fibre's tables
/// are unfolded and `count` is a multiple of 16.
template <int Channels>
MEDULLA_FN void eval(const NearField<Channels>& near, int count, const float* theta_r, const float* phi,
                     Colour<Channels>* S) noexcept {
    constexpr int block = detail::batch_block;
    if (!near.valid || (near.scattered && near.fibre->tables == nullptr)) {
        for (int i = 0; i < count; ++i) S[i] = near.eval(theta_r[i], phi[i]);
        return;
    }
    const float cosine = near.longitudinal.at.cos_i, scale = 1 / (cosine * cosine);
    for (int from = 0; from < count; from += block) {
        const int n = count - from < block ? count - from : block;
        float theta[block], azimuth[block], factor[block], value[Channels][block];
        for (int i = 0; i < block; ++i) {
            const int k = from + (i < n ? i : 0);
            const bool valid = detail::within(theta_r[k], float(pi / 2)) && detail::within(phi[k], 1e4f);
            theta[i] = valid ? theta_r[k] : 0.0f, azimuth[i] = valid ? phi[k] : 0.0f, factor[i] = valid ? scale : 0.0f;
        }
        detail::near_block(near, theta, azimuth, value);
        for (int i = 0; i < n; ++i)
            for (int c = 0; c < Channels; ++c) S[from + i].value[c] = value[c][i] * factor[i];
    }
}

}  // namespace medulla
