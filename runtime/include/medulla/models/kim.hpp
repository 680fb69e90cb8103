// Kim 2002, 'Modeling, Rendering and Animation of Human Hair': Kajiya and Kay's specular lobe times N(phi) = rho_R
// cos(phi / 2) + rho_T cos(k (pi - |phi|)), the latter within pi / (2 k) of forward. As printed, or each lobe with a
// given energy.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/models/kajiya_kay.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace models {

template <int Channels = 3>
struct Kim {
    float rho_R[std::size_t(Channels)] = {}, rho_T[std::size_t(Channels)] = {};  ///< [1], in [0, 1e6]; energies if
                                                                                 ///< normalised
    float exponent = 20;      ///< p of the longitudinal lobe [1], in [1, 1e6]
    float sharpness = 2;      ///< k [1], in [0.5, 1e4]: below 0.5 the lobe would be wider than the circle
    bool normalised = false;  ///< the integral over all drawn directions is rho_R + rho_T

    template <class Visit>
    MEDULLA_FN static void visit(const Kim& m, Visit&& v) noexcept {
        for (const float x : m.rho_R) v("rho_R", x, 0.0f, 1e6f);
        for (const float x : m.rho_T) v("rho_T", x, 0.0f, 1e6f);
        v("exponent", m.exponent, 1.0f, 1e6f);
        v("sharpness", m.sharpness, 0.5f, 1e4f);
    }
};

template <int Channels = 3>
struct KimHit : Hit<KimHit<Channels>, Channels> {
    Kim<Channels> model;
    detail::TruncatedGaussian<float> gaussian = {};  ///< as KajiyaKayHit has it
    float scale_R = 0, scale_T = 0, along = 0;       ///< factors of N_R, N_T and the power of the cosine
    float R_share = 0;

    MEDULLA_FN KimHit(const Kim<Channels>& m, const Known& direction) noexcept : model(m) {
        if (!this->begin(m, direction)) return;
        gaussian = detail::truncated_gaussian(-this->known_theta, 1 / detail::math::sqrt(m.exponent));
        // The integrals of N_R and N_T are 4 and 2 / k.
        scale_R = m.normalised ? 0.25f : 1.0f, scale_T = m.normalised ? 0.5f * m.sharpness : 1.0f;
        along = m.normalised ? 1 / detail::power_of_cosine_integral(this->known_theta, m.exponent) : 1.0f;
        const float R = detail::mean_of<Channels>(m.rho_R) * scale_R * 4,
                    T = detail::mean_of<Channels>(m.rho_T) * scale_T * 2 / m.sharpness, sum = R + T;
        R_share = sum > 1e-30f ? R / sum : 0.0f;
        if (!(sum > 1e-30f)) this->known.cosine = 0;
    }

    MEDULLA_FN Evaluation<Channels> at(float theta, float cosine, float phi) const noexcept {
        using namespace detail;
        Evaluation<Channels> e;
        const float power = power_of_cosine(this->known_theta + theta, model.exponent) * along,
                    M = model.normalised ? power / cosine : power;
        const float R = polynomial::cosine(0.5f * phi), x = model.sharpness * (float(pi) - magnitude(phi)),
                    T = x < float(pi / 2) ? polynomial::cosine(x) : 0.0f;
        for (int c = 0; c < Channels; ++c)
            e.value[c] = M * (model.rho_R[c] * scale_R * R + model.rho_T[c] * scale_T * T);
        e.pdf = gaussian.pdf(theta) / cosine * (R_share * 0.25f * R + (1 - R_share) * 0.5f * model.sharpness * T);
        return e;
    }
    MEDULLA_FN Exit draw(RandomNumbers u) const noexcept {
        const float s = 2 * u.azimuth - 1, x = detail::angle(s, 2 * detail::math::sqrt(u.azimuth * (1 - u.azimuth)));
        const float theta = detail::sample(gaussian, u.longitude);
        if (u.lobe < R_share) return {int(Lobe::R), theta, 2 * x};
        return {int(Lobe::TT), theta, float(pi) + x / model.sharpness};
    }
};

template <int Channels>
MEDULLA_FN KimHit<Channels> far_field(const Kim<Channels>& m, Known known) noexcept {
    return detail::run_fused([&] { return KimHit<Channels>(m, known); });
}

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
