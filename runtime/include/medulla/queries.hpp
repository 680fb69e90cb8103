// Many queries, each with its own light, offset and exit, four abreast: for wavefronts, where no two rays have anything
// in common. Rests on near_field.hpp, with its formulas; eval of one query is the slow twin.
#pragma once

#include "medulla/config.hpp"
#include "medulla/near_field.hpp"

namespace medulla {

namespace detail {

/// Four queries, held to what a fibre answers: lanes that it does not are at 0 and count for nothing.
struct FourQueries {
    Four theta_i, h, theta_r, phi;
    Four cos_i;     ///< of theta_i
    Four answered;  ///< 1, or 0 for a lane that is out of range

    MEDULLA_FN FourQueries(const float* inclination, const float* offset, const float* exit,
                           const float* azimuth) noexcept
        : theta_i(four_at(inclination)), h(four_at(offset)), theta_r(four_at(exit)), phi(four_at(azimuth)) {
        constexpr float quarter = float(pi / 2);
        const FourMask valid =
            within(theta_i, quarter) & within(h, 1.0f) & within(theta_r, quarter) & within(phi, 1e4f);
        cos_i = real_math::cosine(only_where(valid, theta_i));
        const FourMask across = valid & (cos_i > Four(least_cosine));
        answered = only_where(across, Four(1.0f));
        theta_i = only_where(across, theta_i), h = only_where(across, h);
        theta_r = only_where(across, theta_r), phi = only_where(across, phi);
        cos_i = choose(across, cos_i, Four(1.0f));
    }
};

/// What the medulla's absorption leaves of scattered light, where the tables know it.
template <int Channels>
MEDULLA_FN Four survival_abreast(const FurFibre<Channels>& fibre, Four inverse_cos_t, Four sigma_place,
                                 Four offset) noexcept {
    float place[4], h[4], absorbed[4], left[4];
    store_four(sigma_place, place), store_four(offset, h);
    store_four(Four(fibre.parameters.sigma_ma * fibre.parameters.kappa) * inverse_cos_t, absorbed);
    for (int k = 0; k < 4; ++k) {
        const Four weights = fibre.tables->sigma_weights.at(Same(place[k]));
        left[k] = survival_of(absorbed[k], fibre.tables->survival_length(weights, h[k]));
    }
    return four_at(left);
}

/// Adds TTs and TRTs to S, from unfolded tables.
template <int Channels>
MEDULLA_FN void add_scattered(const FurFibre<Channels>& fibre, const FourQueries& q, Four inverse_cos_t,
                              const Path<Four>& path, const Energies<Channels, Four>& energy,
                              Four (&S)[Channels]) noexcept {
    const FurParameters<Channels>& p = fibre.parameters;
    const UnfoldedTables& tables = *fibre.tables;
    const Four zero(0.0f), offset = lesser(magnitude(path.h_inside) / Four(p.kappa), Four(1.0f));
    const auto turned = [&](int k) {  // seen from the side that the ray came in on
        const Four y = q.phi - (scattered_centre(k, path.gamma_i, path.gamma_t) + Four(float(pi)));
        return choose(q.h < zero, -y, y);
    };
    FourLookups at;
    at.sigma = tables.sigma_place(Four(p.sigma_ms * p.kappa) * inverse_cos_t);
    at.offset = chord_coordinate(offset);
    at.inclination = chord_coordinate(magnitude(q.theta_i) * Four(float(2 / pi)));
    at.y[0] = turned(1), at.y[1] = turned(2);
    at.theta_r = choose(q.theta_i < zero, -q.theta_r, q.theta_r), at.phi = q.phi;
    const FourDensities density = scattered_densities(tables, at);
    const Four left = fibre.survival ? survival_abreast(fibre, inverse_cos_t, at.sigma, offset) : Four(1.0f);
    Four most(0.0f);
    for (int c = 0; c < Channels; ++c) most = greater((energy.A[3][c] + energy.A[4][c]) * left, most);
    const Four M = only_where(most > Four(negligible_energy), density.M * left);
    for (int c = 0; c < Channels; ++c)
        S[c] = S[c] + M * (density.D[0] * energy.A[3][c] + density.D[1] * energy.A[4][c]);
}

/// S of Eq. 12 of four queries.
template <int Channels>
MEDULLA_FN void eval_four(const FurFibre<Channels>& fibre, const FourQueries& q, Four (&S)[Channels]) noexcept {
    const FurParameters<Channels>& p = fibre.parameters;
    const Inclination<Four> at = inclination(Four(p.eta), q.cos_i, p.fresnel);
    const Four one(1.0f);
    const Path<Four> path = trace(at, p.kappa, p.layers, q.h, square_root((one - q.h) * (one + q.h)));
    Energies<Channels, Four> e =
        energies(path, absorption(p, at.inverse_cos_t, static_cast<bool>(fibre.survival)), fibre.scattered);
    Four lobe[3];
    for (int k = 0; k < 3; ++k) {
        const TruncatedGaussians M =
            truncated_gaussians(Four(lane(fibre.shift, k)) - q.theta_i, Four(lane(fibre.deviation, k)));
        lobe[k] = joint_pdf(M, fibre.azimuthal_gaussian[k], q.theta_r,
                            q.phi - unscattered_centre(k, path.gamma_i, path.gamma_t));
    }
    const Four scale = q.answered / (q.cos_i * q.cos_i);
    for (int c = 0; c < Channels; ++c) S[c] = lobe[0] * e.A[0][c] + lobe[1] * e.A[1][c] + lobe[2] * e.A[2][c];
    if (fibre.scattered) add_scattered(fibre, q, at.inverse_cos_t, path, e, S);
    for (int c = 0; c < Channels; ++c) S[c] = scale * S[c];
}

/// Queries one by one, what neighbours have in common prepared once: where the tables are factors.
template <int Channels>
MEDULLA_FN void eval_singly(const FurFibre<Channels>& fibre, int count, const float* theta_i, const float* h,
                            const float* theta_r, const float* phi, Colour<Channels>* S) noexcept {
    NearField<Channels> near;
    for (int i = 0; i < count; ++i) {  // as bits, so that a NaN is no neighbour's value under -ffast-math either
        if (i == 0 || bits_of(theta_i[i]) != bits_of(theta_i[i - 1]))
            near_field(fibre, theta_i[i], h[i], near);
        else if (bits_of(h[i]) != bits_of(h[i - 1]))
            set_offset(near, h[i]);
        S[i] = near.eval(theta_r[i], phi[i]);
    }
}

template <int Channels>
MEDULLA_FN void eval_abreast(const FurFibre<Channels>& fibre, int count, const float* theta_i, const float* h,
                             const float* theta_r, const float* phi, Colour<Channels>* S) noexcept {
    for (int from = 0, n; from < count; from += n) {
        n = count - from < 4 ? count - from : 4;
        float last[4][4] = {};  // fewer than four: the rest stands at 0
        for (int i = 0; n < 4 && i < n; ++i)
            last[0][i] = theta_i[from + i], last[1][i] = h[from + i], last[2][i] = theta_r[from + i],
            last[3][i] = phi[from + i];
        const FourQueries q = n < 4 ? FourQueries(last[0], last[1], last[2], last[3])
                                    : FourQueries(theta_i + from, h + from, theta_r + from, phi + from);
        Four value[Channels];
        eval_four(fibre, q, value);
        for (int c = 0; c < Channels; ++c) {
            float each[4];
            store_four(value[c], each);
            for (int i = 0; i < n; ++i) S[from + i].value[c] = each[i];
        }
    }
}

}  // namespace detail

/// S of Eq. 12 of `count` queries, each with its own light, offset and exit, as eval(fibre, theta_i[i], theta_r[i],
/// phi[i], h[i]) but for rounding. Four abreast, unless the fibre scatters and reads factors. S overlaps none of the
/// others.
template <int Channels>
MEDULLA_FN void eval(const FurFibre<Channels>& fibre, int count, const float* theta_i, const float* h,
                     const float* theta_r, const float* phi, Colour<Channels>* S) noexcept {
    if (!usable(fibre.status) || (fibre.scattered && fibre.tables == nullptr))
        return run_widest([&] { detail::eval_singly(fibre, count, theta_i, h, theta_r, phi, S); });
    const int last = count - 1, abreast = count % 4 == 1 ? last : count;  // one alone costs half of four
    run_fused([&] { detail::eval_abreast(fibre, abreast, theta_i, h, theta_r, phi, S); });
    if (abreast == last) S[last] = eval(fibre, theta_i[last], theta_r[last], phi[last], h[last]);
}

}  // namespace medulla
