// Many exits of one prepared (theta_i, h) at once: what is left of the tables there is multiplied out, and exits go
// four abreast. Rests on fur_fibre.hpp; NearField::eval is the slow twin.
#pragma once

#include "medulla/config.hpp"
#include "medulla/fur_fibre.hpp"

namespace medulla {

namespace detail {

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
        const Four h[4] = {spread<0>(p.offset), spread<1>(p.offset), spread<2>(p.offset), spread<3>(p.offset)};
        const Four sigma = p.sigma * Four(p.inverse_integral);
        const std::uint32_t rows = 2 * tables.azimuth_rows(), step = 4 * rows;
        for (std::uint32_t k = 0; k < rows; k += 4) {
            Four at[4];
            for (std::uint32_t i = 0; i < 4; ++i) {
                const float* r = p.rows + 4 * (k + i < rows ? k + i : k);
                at[i] = ((h[0] * aligned_four_at(r) + h[1] * aligned_four_at(r + step)) +
                         (h[2] * aligned_four_at(r + 2 * step) + h[3] * aligned_four_at(r + 3 * step))) *
                        sigma;
            }
            transpose(at[0], at[1], at[2], at[3]);
            store_four((at[0] + at[1]) + (at[2] + at[3]), azimuthal + k);
        }
        const LongitudinalPoint& m = near.longitudinal.point;
        const Four w[4] = {spread<0>(m.weight), spread<1>(m.weight), spread<2>(m.weight), spread<3>(m.weight)};
        const std::uint32_t length = 4 * tables.longitude_rows();
        for (std::uint32_t k = 0; k < length; k += 4) {
            const float* r = m.rows + k;
            store_four((w[0] * four_at(r) + w[1] * four_at(r + length)) +
                           (w[2] * four_at(r + 2 * length) + w[3] * four_at(r + 3 * length)),
                       longitudinal + k);
        }
    }
    /// Densities at four exits of TTs or TRTs, >= 0.
    MEDULLA_HOT Four azimuthal_densities(const UnfoldedTables& tables, Four y) const noexcept {
        const ExitPlaces places = exit_places(turns_of(y), Four(tables.azimuth_scale()));
        Four at[4];
        for (int i = 0; i < 4; ++i) {
            const RowPoint exit = tables.azimuth.at(places.stretch[i], places.place[i]);
            at[i] = exit.weight * four_at(azimuthal + exit.first + tables.azimuth_rows() * (places.below >> i & 1u));
        }
        transpose(at[0], at[1], at[2], at[3]);
        const Four sum = (at[0] + at[1]) + (at[2] + at[3]);
        return greater(sum, Four(0.0f));
    }
    /// M^s of Eq. 19 at four exits. @param forwardness |phi| / pi
    MEDULLA_HOT Four longitudinal_densities(const UnfoldedTables& tables, Four y, Four forwardness) const noexcept {
        const ExitPlaces places = exit_places(turns_of(y), Four(tables.longitude_scale()));
        Four at[4];
        for (int i = 0; i < 4; ++i) {
            const RowPoint exit = tables.longitude_exit(places, i);
            at[i] = lower_twice(exit.weight) * four_at(longitudinal + exit.first) +
                    upper_twice(exit.weight) * four_at(longitudinal + exit.first + 4);
        }
        transpose(at[0], at[1], at[2], at[3]);
        const Four zero(0.0f), back = at[0] + at[2], forward = at[1] + at[3];
        return (Four(1.0f) - forwardness) * greater(back, zero) + forwardness * greater(forward, zero);
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
    /// S at four exits, all of them valid.
    MEDULLA_HOT void eval(Four theta_r, Four phi, Four (&S)[Channels]) const noexcept {
        const FurFibre<Channels>& fibre = *near.fibre;
        const Longitudinal<Channels>& m = near.longitudinal;
        Four value[lobe_count];
        for (int p = 0; p < 3; ++p)
            value[p] = joint_pdf(longitudinal[p], fibre.azimuthal_gaussian[p], theta_r, phi - Four(near.centre[p]));
        if (near.scattered) {
            const UnfoldedTables& tables = *fibre.tables;
            const Four M = rows.longitudinal_densities(tables, m.theta_i < 0 ? -theta_r : theta_r,
                                                       Four(2.0f) * magnitude(turns_of(phi)));
            for (int p = 3; p < 5; ++p)
                value[p] = M * rows.azimuthal_densities(tables, Four(near.side) * (phi - Four(near.centre[p])));
        }
        for (int c = 0; c < Channels; ++c) {
            const auto& A = near.energy.A;
            S[c] = Four(A[0][c]) * value[0] + Four(A[1][c]) * value[1] + Four(A[2][c]) * value[2];
            if (near.scattered) S[c] = S[c] + (Four(A[3][c]) * value[3] + Four(A[4][c]) * value[4]);
            S[c] = S[c] * Four(m.scale);
        }
    }
};

}  // namespace detail

/// S of Eq. 12 at `count` exits, as near.eval(theta_r[i], phi[i]) but for rounding. Fastest where the fibre's tables
/// are unfolded and `count` is a multiple of 4; fewer than 8 exits are asked one by one.
template <int Channels>
MEDULLA_FN void eval(const NearField<Channels>& near, int count, const float* theta_r, const float* phi,
                     Colour<Channels>* S) noexcept {
    if (!near.valid || count < 8 || (near.scattered && near.fibre->tables == nullptr)) {
        for (int i = 0; i < count; ++i) S[i] = near.eval(theta_r[i], phi[i]);
        return;
    }
    const detail::NearBatch<Channels> batch(near);
    for (int from = 0; from < count; from += 4) {
        const int n = count - from < 4 ? count - from : 4;
        bool good[4], all = n == 4;
        for (int i = 0; i < n; ++i)
            all &= good[i] = detail::within(theta_r[from + i], float(pi / 2)) && detail::within(phi[from + i], 1e4f);
        Four theta, azimuth;
        if (all) {
            theta = four_at(theta_r + from), azimuth = four_at(phi + from);
        } else {
            float at[2][4] = {};
            for (int i = 0; i < n; ++i)
                if (good[i]) at[0][i] = theta_r[from + i], at[1][i] = phi[from + i];
            theta = four_at(at[0]), azimuth = four_at(at[1]);
        }
        Four sum[Channels];
        batch.eval(theta, azimuth, sum);
        for (int i = 0; i < n; ++i)
            for (int c = 0; c < Channels; ++c) S[from + i].value[c] = all || good[i] ? lane(sum[c], i) : 0.0f;
    }
}

}  // namespace medulla
