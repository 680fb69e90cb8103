// Zinke and Weber 2007, 'Light Scattering from Filaments' (and Zinke et al. 2004): the near-field BCSDF of a dielectric
// cylinder, R, TT and TRT at the offset of the ray, with a Gaussian along and around the fibre for each; and the far
// field, its mean over the width.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/models/cylinder.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace models {

/// Lobe p has the shifts and widths of Yan et al. 2017, Table 2 (theirs are free): alpha, -alpha / 2, -3 alpha / 2;
/// beta_m, beta_m / 2, 3 beta_m / 2; sqrt(p + 1) beta_n.
template <int Channels = 3>
struct Zinke {
    float eta = 1.55f;                          ///< refractive index [1], in (1, 10]
    float sigma_a[std::size_t(Channels)] = {};  ///< absorption coefficient [1 / fibre radius], in [0, 1e9]
    float alpha = 0;                            ///< shift of R in theta_r [radians], in [-pi/2, pi/2]
    float beta_m = 0.1f, beta_n = 0.1f;         ///< roughness along and around [radians], in [1e-4, 4]

    static constexpr bool tail = false;
    MEDULLA_FN detail::GaussianAlong along(int p, float theta_i) const noexcept {
        using namespace detail;
        return {truncated_gaussian(shift_of(p) * alpha - theta_i, width_of(p) * beta_m)};
    }
    MEDULLA_FN detail::WrappedGaussian<float> around(int p) const noexcept {
        return detail::wrapped_gaussian(detail::math::sqrt(float(p + 1)) * beta_n);
    }
    template <class Visit>
    MEDULLA_FN static void visit(const Zinke& m, Visit&& v) noexcept {
        v("eta", m.eta, detail::least_above_1, 10.0f);
        for (const float x : m.sigma_a) v("sigma_a", x, 0.0f, 1e9f);
        v("alpha", m.alpha, -float(pi / 2), float(pi / 2));
        v("beta_m", m.beta_m, 1e-4f, 4.0f);
        v("beta_n", m.beta_n, 1e-4f, 4.0f);
    }
};

template <int Channels = 3>
using ZinkeNear = CylinderHit<Channels, 3, detail::GaussianAlong, detail::WrappedGaussian<float>>;
template <int Channels = 3>
using ZinkeFar = CylinderMean<Channels, 3, detail::GaussianAlong>;

/// What a ray does beside turning: where it leaves, for close-ups in which the fibre has a visible width. p = 0: R.
struct ExitPoint {
    float offset;        ///< of the exit, to the left of the outgoing travel [fibre radii]: the ray's own h
    float azimuth;       ///< of the point at which it leaves, from the known azimuth [radians]
    float displacement;  ///< along the papers' axis, from tip to root [fibre radii]
    float length;        ///< of the path inside [fibre radii]
};
/// @param theta_i known inclination [radians]  @param h in [-1, 1]  @param p crossings of the fibre, >= 0
MEDULLA_FN ExitPoint exit_point(float eta, float theta_i, float h, int p) noexcept {
    using namespace detail;
    const auto i = sine_cosine(theta_i);
    const Inclination<float> at = inclination(eta, greater(i.cosine, least_cosine), Fresnel::exact);
    const Chord<float> ray = chord(at, h, math::sqrt((1 - h) * (1 + h)));
    const float across = 2 * float(p) * ray.cos_t, sin_t = i.sine / eta;
    return {h, wrap_angle(unscattered_centre(p, 0.5f * ray.gamma_i, ray.gamma_t)), -across * sin_t * at.inverse_cos_t,
            across * at.inverse_cos_t};
}

template <int Channels>
MEDULLA_FN ZinkeNear<Channels> near_field(const Zinke<Channels>& m, Known known, float h) noexcept {
    return detail::run_fused([&] { return ZinkeNear<Channels>(m, known, h); });
}
template <int Channels>
MEDULLA_FN ZinkeFar<Channels> far_field(const Zinke<Channels>& m, Known known) noexcept {
    return detail::run_fused([&] { return ZinkeFar<Channels>(m, known); });
}

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
