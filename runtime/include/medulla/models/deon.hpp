// d'Eon et al. 2011, 'An Energy-Conserving Hair Reflectance Model': the far field of a dielectric cylinder with any
// number of orders, von Mises-Fisher lobes along and Gaussians around the fibre. A last lobe carries all orders after
// them (not in the paper), so that a white fibre returns all light.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/models/cylinder.hpp"
#include "medulla/models/von_mises_fisher.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace models {

/// Shifts and widths as Zinke has them. Index and Fresnel terms are those of theta_i, which keeps the energy exact; the
/// paper's, of theta_d, would be reciprocal for alpha = 0.
/// @tparam Lobes R, TT, TRT .. and, with a tail, the rest as the last one
template <int Channels = 3, int Lobes = 5>
struct DEon {
    static_assert(Lobes >= 2, "R and one more");
    float eta = 1.55f;                          ///< refractive index [1], in (1, 10]
    float sigma_a[std::size_t(Channels)] = {};  ///< absorption coefficient [1 / fibre radius], in [0, 1e9]
    float alpha = 0;                            ///< shift of R in theta_r [radians], in [-pi/2, pi/2]
    float beta_m = 0.1f, beta_n = 0.1f;         ///< roughness along (v = beta_m^2) and around [radians], in [1e-3, 4]
    bool tail = true;                           ///< the last lobe is all that is left, even in azimuth

    MEDULLA_FN detail::VonMisesFisher along(int p, float theta_i) const noexcept {
        const float width = detail::width_of(p) * beta_m;
        return detail::von_mises_fisher(width * width, theta_i, detail::shift_of(p) * alpha);
    }
    MEDULLA_FN detail::WrappedGaussian<float> around(int p) const noexcept {
        return detail::wrapped_gaussian(detail::math::sqrt(float(p + 1)) * beta_n);
    }
    template <class Visit>
    MEDULLA_FN static void visit(const DEon& m, Visit&& v) noexcept {
        v("eta", m.eta, detail::least_above_1, 10.0f);
        for (const float x : m.sigma_a) v("sigma_a", x, 0.0f, 1e9f);
        v("alpha", m.alpha, -float(pi / 2), float(pi / 2));
        v("beta_m", m.beta_m, 1e-3f, 4.0f);
        v("beta_n", m.beta_n, 1e-3f, 4.0f);
    }
};

template <int Channels = 3, int Lobes = 5>
using DEonFar = CylinderMean<Channels, Lobes, detail::VonMisesFisher>;

template <int Channels, int Lobes>
MEDULLA_FN DEonFar<Channels, Lobes> far_field(const DEon<Channels, Lobes>& m, Known known) noexcept {
    return detail::run_fused([&] { return DEonFar<Channels, Lobes>(m, known); });
}

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
