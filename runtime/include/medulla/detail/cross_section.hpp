// A ray through the fibre's cross-section: refraction, Fresnel terms, path lengths, where each lobe leaves, what is
// left of it. Rests on Yan et al. 2017, Eqs. 13-16, 20, 21 with the errata of docs/bcsdf.md; everything here is a pure
// formula.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/elementary.hpp"
#include "medulla/fur_parameters.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// What the inclination theta_i decides for a whole cross-section.
template <class T>
struct Inclination {
    T cos_i;                 ///< cos theta_i, > 0
    T index_excess;          ///< eta'^2 - 1 = (eta^2 - 1) / cos^2 theta_i, > 0: no digits lost as eta -> 1
    T inverse_index;         ///< 1 / eta', in (0, 1); eta' = sqrt(eta^2 - sin^2 theta_i) / cos theta_i (Bravais)
    T inverse_cos_t;         ///< 1 / cos theta_t, sin theta_t = sin theta_i / eta
    T fresnel_index_excess;  ///< n^2 - 1 of the index n that the Fresnel terms see: eta' or, exact, eta
    T fresnel_scale;         ///< their cosine of incidence over cos gamma_i: 1 or, exact, cos theta_i
};

template <class T>
MEDULLA_FN Inclination<T> inclination(T eta, T cos_i, Fresnel fresnel = Fresnel::bravais) noexcept {
    const T excess = (eta - T(1)) * (eta + T(1));
    const T root = square_root(excess + cos_i * cos_i);  // eta cos theta_t
    const T excess_prime = excess / (cos_i * cos_i);
    const bool exact = fresnel == Fresnel::exact;
    return {cos_i, excess_prime, cos_i / root, eta / root, exact ? excess : excess_prime, exact ? cos_i : T(1)};
}

/// Reflectance F and transmittance 1 - F of the cuticle.
template <class T>
struct Cuticle {
    T F, T_;
};

/// Where a ray at offset h goes.
template <class T>
struct Path {
    T gamma_i, gamma_t;  ///< angle to the normal outside and inside [radians]
    T h_inside;          ///< h / eta': offset of the refracted chord [fibre radii]
    T s_m, s_c;          ///< half-lengths of one chord in medulla and cortex [fibre radii]
    Cuticle<T> cuticle;
};

/// Reflectance R and transmittance 1 - R of one interface, by polarisation. Differences are expanded so that n -> 1 and
/// cos_i -> 0 lose no digits (docs/bcsdf.md, 'Fresnel').
template <class T>
struct Interface {
    T Rs, Rp, Ts, Tp;
};
/// @param m n^2 - 1  @param index2 n^2  @param cos_i cosine of incidence
/// @param x sqrt(n^2 - 1 + cos_i^2) = n times the cosine of refraction
template <class S, class T>
MEDULLA_HOT Interface<T> interface_of(T m, T index2, T cos_i, T x) noexcept {
    const T one = T(S(1));
    const T s = cos_i + x, p = index2 * cos_i + x, inverse = one / (s * p), inverse_s = p * inverse,
            inverse_p = s * inverse;
    const T rs = m * inverse_s * inverse_s;
    const T rp = m * inverse_p * ((cos_i * cos_i * (index2 + one) - one) * inverse_p);
    return {rs * rs, rp * rp, T(S(2)) * cos_i * inverse_s * (one + rs),
            T(S(4)) * (index2 * cos_i * inverse_p) * (x * inverse_p)};
}

/// F_1 = mean over polarisations of R + (1-R)^2 R / (1-R^2) = 2R / (1+R), F = l F_1 / (1 + (l-1) F_1) (Eq. 13).
/// T is S, or several S side by side; At is either.
/// @param index_excess n^2 - 1  @param cos_i, x as interface_of has them
template <class T, class S, class At>
MEDULLA_FN Cuticle<T> cuticle(S layers, At index_excess, T cos_i, T x) noexcept {
    // Fewer layers than 1e-30 would be seen at h = 1 alone, where T1 is 0, and there 1 / (layers F1) may overflow.
    if (!(layers > S(1e-30))) return {T(S(0)), T(S(1))};
    const T one = T(S(1));
    const auto [Rs, Rp, Ts, Tp] = interface_of<S>(T(index_excess), T(At(S(1)) + index_excess), cos_i, x);
    // F1 and T1 = 1 - F1 over their common denominator (1 + Rs)(1 + Rp), which F does not see.
    const T F1 = T(layers) * (Rs * (one + Rp) + Rp * (one + Rs));
    const T T1 = T(S(0.5)) * (Ts * (one + Rp) + Tp * (one + Rs));
    const T whole = one / (T1 + F1);
    return {F1 * whole, T1 * whole};
}

/// One interface without layers, unpolarised: hair's.
template <class T>
MEDULLA_FN Cuticle<T> bare_interface(float index_excess, T cos_i, T x) noexcept {
    const auto [Rs, Rp, Ts, Tp] = interface_of<float>(T(index_excess), T(1.0f + index_excess), cos_i, x);
    return {T(0.5f) * (Rs + Rp), T(0.5f) * (Ts + Tp)};
}

/// The path, from the angles of incidence and refraction. @param x sqrt(eta'^2 - 1 + cos^2 gamma_i) = eta' cos gamma_t
template <class T, class S, class At>
MEDULLA_HOT Path<T> path_at(const Inclination<At>& at, S kappa, S layers, T cos_i, T sin_t, T x, T gamma_i,
                            T gamma_t) noexcept {
    Path<T> path;
    const T zero = T(S(0)), cos_t = x * T(at.inverse_index);
    path.gamma_i = gamma_i, path.gamma_t = gamma_t, path.h_inside = sin_t;
    const T s2 = (T(kappa) - sin_t) * (T(kappa) + sin_t);
    const auto inside = s2 > zero;
    path.s_m = choose(inside, square_root(choose(inside, s2, T(S(1)))), zero);  // no root of 0: it has no derivative
    // cos gamma_t - s_m = (1 - kappa^2) / (cos gamma_t + s_m) inside the medulla: exactly 0 for kappa = 1.
    const T sum = choose(inside, cos_t + path.s_m, T(S(1)));
    path.s_c = choose(inside, T((S(1) - kappa) * (S(1) + kappa)) / sum, cos_t);
    // cos theta_i sqrt(eta'^2 - 1 + cos^2 gamma_i) = sqrt(eta^2 - 1 + (cos theta_i cos gamma_i)^2): one x serves both.
    const T scale = T(at.fresnel_scale);
    path.cuticle = cuticle(layers, at.fresnel_index_excess, scale * cos_i, scale * x);
    return path;
}

/// @param at of all, or of each of several rays side by side
/// @param cos_i cos gamma_i = sqrt(1 - h^2), given beside h because the caller often has it without cancellation
template <class T, class S, class At>
MEDULLA_HOT Path<T> trace(const Inclination<At>& at, S kappa, S layers, T h, T cos_i) noexcept {
    const T x = square_root(T(at.index_excess) + cos_i * cos_i);
    const T sin_t = h * T(at.inverse_index), cos_t = x * T(at.inverse_index);
    const T sines[2] = {h, sin_t}, cosines[2] = {cos_i, cos_t};
    T gamma[2];
    angles(sines, cosines, gamma);
    return path_at(at, kappa, layers, cos_i, sin_t, x, gamma[0], gamma[1]);
}

/// Phi_p = 2 p gamma_t - 2 gamma_i + p pi (Eq. 15).
template <class T>
MEDULLA_FN T unscattered_centre(int p, T gamma_i, T gamma_t) noexcept {
    using C = Constant<T>;
    return C::of(2 * p) * gamma_t - C::of(2) * gamma_i + C::of(p * pi);
}

/// Phi^s_p = (gamma_t - gamma_i) + (p - 1)(pi + 2 gamma_t) (Eq. 21), p = 1, 2.
template <class T>
MEDULLA_FN T scattered_centre(int p, T gamma_i, T gamma_t) noexcept {
    using C = Constant<T>;
    return (gamma_t - gamma_i) + C::of(p - 1) * (C::of(pi) + C::of(2) * gamma_t);
}

/// What the inclination decides for attenuation: coefficients over cos theta_t and T_b of Eq. 20.
template <int Channels, class T = float>
struct Absorption {
    T medulla_extinction;  ///< (sigma_ma + sigma_ms) / cos theta_t
    T collisions;  ///< rate of first collisions, of which E is made: sigma_ms / cos theta_t (and sigma_ma's, corrected)
    T kept;        ///< share of E that the medulla does not absorb, 1 where T_b or the tables have it
    T cortex[std::size_t(Channels)];  ///< sigma_ca / cos theta_t
    T T_b[std::size_t(Channels)];  ///< exp(-(kappa sigma_ma + (1 - kappa) sigma_ca) / cos theta_t), or without sigma_ma
};

/// @param inverse_cos_t of one inclination or of several side by side
/// @param tabled the tables know what the medulla absorbs of scattered light: T_b leaves it out
template <int Channels, class S, class T>
MEDULLA_FN Absorption<Channels, T> absorption(const FurParameters<Channels, S>& p, T inverse_cos_t,
                                              bool tabled = false) noexcept {
    Absorption<Channels, T> a;
    const T medulla = tabled ? T(S(0)) : T(p.kappa * p.sigma_ma) * inverse_cos_t;
    a.medulla_extinction = T(p.sigma_ma + p.sigma_ms) * inverse_cos_t;
    a.collisions = T(p.sigma_ms) * inverse_cos_t, a.kept = T(S(1));
    for (int c = 0; c < Channels; ++c) {
        a.cortex[c] = T(p.sigma_ca[c]) * inverse_cos_t;
        a.T_b[c] = -(medulla + T(S(1) - p.kappa) * a.cortex[c]);
    }
    exponentials(a.T_b);
    return a;
}

/// Energies A of the five lobes, Eqs. 13, 14, 20, and of the residual one. The scattered ones include E = 1 - exp(-2
/// s_m sigma_ms / cos theta_t), the energy of C^N, so that every lobe's azimuthal integral is its A.
///
/// Residual: of a crossing that light enters with energy e, s e leaves scattered and x e reaches the cuticle, where (1
/// - F) of it leaves and F starts the next. The third crossing begins with (1 - F) F^2 x^2; the sum over it and all
/// later ones is (1 - F) F^2 x^2 (s + (1 - F) x) / (1 - F x). Without absorption s + x = 1 and all six add up to 1.
template <int Channels, class T = float>
struct Energies {
    T A[all_lobe_count][std::size_t(Channels)];
};

/// @param survival share of the scattered light that the medulla's absorption leaves, where tables know it, else 1
template <int Channels, class T, class S>
MEDULLA_HOT Energies<Channels, T> energies(const Path<T>& path, const Absorption<Channels, S>& a, bool scattered,
                                           T survival = T(S(1))) noexcept {
    Energies<Channels, T> e;
    const T one = T(S(1)), zero = T(S(0));
    const T F = path.cuticle.F, passed = path.cuticle.T_, depth = path.s_m * T(S(2) * a.collisions);
    T left[std::size_t(Channels) + 2];  // after half-lengths of cortex, of medulla, and a chord's scattering alone
    for (int c = 0; c < Channels; ++c) left[c] = -path.s_c * T(a.cortex[c]);
    left[std::size_t(Channels)] = -path.s_m * T(a.medulla_extinction), left[std::size_t(Channels) + 1] = -depth;
    T crossing[std::size_t(Channels)];  // optical length of a whole crossing
    for (int c = 0; c < Channels; ++c) crossing[c] = T(S(-2)) * (left[c] + left[std::size_t(Channels)]);
    exponentials(left);
    const T m = left[std::size_t(Channels)],
            E = scattered ? absorbed(depth, left[std::size_t(Channels) + 1]) * survival * T(a.kept) : zero;
    const T third = passed * F * F;
    for (int c = 0; c < Channels; ++c) {
        const T q = left[c], through = (q * m) * (q * m);
        const T share = q * T(a.T_b[c]) * E, s = passed * share;
        e.A[0][c] = F;
        e.A[1][c] = passed * passed * through;
        e.A[2][c] = e.A[1][c] * F * through;
        e.A[3][c] = s;
        e.A[4][c] = s * F * through;
        // 1 - F x = (1 - F) + F (1 - x), which is 0 where all is reflected outside and nothing enters.
        const T stays = passed + F * absorbed(crossing[c], through);
        const auto some = stays > zero;
        e.A[5][c] =
            third * through * through * choose(some, (share + passed * through) / choose(some, stays, one), zero);
    }
    return e;
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
