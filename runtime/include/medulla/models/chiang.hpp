// Chiang et al. 2016, 'A Practical and Controllable Hair and Fur Model for Production Path Tracing': R, TT, TRT and all
// paths after them as one lobe, at the offset of the ray. d'Eon's lobes along the fibre, trimmed logistics around it.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/models/cylinder.hpp"
#include "medulla/models/von_mises_fisher.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// The logistic density of scale s, cut at +-pi.
struct TrimmedLogistic {
    float scale, inverse;  ///< s [radians], > 0; 1 / s
    float inside;          ///< mass of the whole one within +-pi
    float below;           ///< and below -pi
    float peak;            ///< 1 / (s inside)

    MEDULLA_FN float pdf(float delta) const noexcept {
        const float e = exponential(-magnitude(wrap_angle(delta)) * inverse);
        return peak * e / ((1 + e) * (1 + e));
    }
};
MEDULLA_FN TrimmedLogistic trimmed_logistic(float scale) noexcept {
    const float inverse = 1 / scale, e = exponential(-float(pi) * inverse), below = e / (1 + e), inside = 1 - 2 * below;
    return {scale, inverse, inside, below, inverse / inside};
}
/// An angle from the centre, in [-pi, pi]. @param u in [0, 1]
MEDULLA_FN float sample(const TrimmedLogistic& d, float u) noexcept {
    const float p = greater(d.below + u * d.inside, 1e-30f), q = greater(d.below + (1 - u) * d.inside, 1e-30f);
    return wrap_angle(lesser(greater(d.scale * math::log(p / q), -float(pi)), float(pi)));
}

}  // namespace detail

namespace models {

template <int Channels = 3>
struct Chiang {
    float eta = 1.55f;                          ///< refractive index [1], in (1, 10]
    float sigma_a[std::size_t(Channels)] = {};  ///< absorption coefficient [1 / fibre radius], in [0, 1e9]
    float alpha = 0;      ///< tilt of the scales [radians], in [-pi/4, pi/4]: R is shifted by -2 alpha in x
    float beta_m = 0.3f;  ///< perceptual roughness along, in [0.002, 1]
    float beta_n = 0.3f;  ///< and around, in [0.005, 1]
    static constexpr bool tail = true;

    /// Deviation sqrt(v) of R along the fibre [radians] (Eq. 7). v of TT is a quarter, of TRT four times it.
    MEDULLA_FN static float deviation_of(float x) noexcept { return 0.726f * x + 0.812f * x * x + 3.7f * twentieth(x); }
    /// Scale s of the logistic [radians] (Eq. 8); its deviation is s pi / sqrt(3).
    MEDULLA_FN static float scale_of(float x) noexcept {
        return 0.626657069f * (0.265f * x + 1.194f * x * x + 5.372f * twentieth(x) * x * x);
    }
    MEDULLA_FN detail::VonMisesFisher along(int p, float theta_i) const noexcept {
        const float d = deviation_of(beta_m) * (p == 0 ? 1.0f : p == 1 ? 0.5f : 2.0f);
        return detail::von_mises_fisher(d * d, theta_i, alpha * (p == 0 ? 2.0f : p == 1 ? -1.0f : p == 2 ? -4.0f : 0));
    }
    MEDULLA_FN detail::TrimmedLogistic around(int) const noexcept { return detail::trimmed_logistic(scale_of(beta_n)); }
    template <class Visit>
    MEDULLA_FN static void visit(const Chiang& m, Visit&& v) noexcept {
        v("eta", m.eta, detail::least_above_1, 10.0f);
        for (const float x : m.sigma_a) v("sigma_a", x, 0.0f, 1e9f);
        v("alpha", m.alpha, -float(pi / 4), float(pi / 4));
        v("beta_m", m.beta_m, 0.002f, 1.0f);
        v("beta_n", m.beta_n, 0.005f, 1.0f);
    }

  private:
    MEDULLA_FN static float twentieth(float x) noexcept {
        const float x2 = x * x, x4 = x2 * x2, x8 = x4 * x4;
        return x8 * x8 * x4;
    }
};

template <int Channels = 3>
using ChiangNear = CylinderHit<Channels, 4, detail::VonMisesFisher, detail::TrimmedLogistic>;

template <int Channels>
MEDULLA_FN ChiangNear<Channels> near_field(const Chiang<Channels>& m, Known known, float h) noexcept {
    return detail::run_fused([&] { return ChiangNear<Channels>(m, known, h); });
}

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
