// Kajiya and Kay 1989, 'Rendering Fur with Three Dimensional Textures': a diffuse and a specular lobe, even in azimuth.
// As printed, S = K_d + k_s cos^p(theta_i + theta_r) / cos theta_i; or each lobe with a given energy.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/gauss_legendre.hpp"
#include "medulla/models/hit.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// max(0, cos x)^p, x in [-pi, pi]. By 1 - 2 sin^2(x / 2), whose digits an exponent of 1e5 needs.
MEDULLA_FN float power_of_cosine(float x, float p) noexcept {
    if (!within(x, float(pi / 2))) return 0;
    const float s = polynomial::sine_cosine(0.5f * x).sine, z = 2 * s * s;
    if (!(z < 1)) return 0;
    // log(1 - z): series to z^5 below 0.05, where the next term is 3e-9.
    const float log_cosine =
        z < 0.05f ? -z * (1 + z * (0.5f + z * (0.33333333f + z * (0.25f + 0.2f * z)))) : math::log(1 - z);
    return exponential(p * log_cosine);
}

/// Its integral over theta_r in (-pi/2, pi/2), x = theta_i + theta_r: beyond 6 / sqrt(p) lies less than 2e-9 of it,
/// since cos^p x < exp(-p x^2 / 2); 24 Gauss nodes.
MEDULLA_FN float power_of_cosine_integral(float theta_i, float p) noexcept {
    const float edge = float(pi / 2), within_6 = 6 / math::sqrt(p), low = -lesser(edge - magnitude(theta_i), within_6),
                high = lesser(edge, within_6), half = 0.5f * (high - low), middle = 0.5f * (high + low);
    const GaussRule rule = gauss_rule(3);
    float sum = 0;
    for (int i = 0; i < rule.half; ++i)
        sum +=
            rule.w[i] * (power_of_cosine(middle + half * rule.x[i], p) + power_of_cosine(middle - half * rule.x[i], p));
    return half * sum;
}

}  // namespace detail

namespace models {

template <int Channels = 3>
struct KajiyaKay {
    /// As printed: K_d and k_s, in [0, 1e6]. Normalised: the energies of the two lobes [1].
    float diffuse[std::size_t(Channels)] = {}, specular[std::size_t(Channels)] = {};
    float exponent = 20;      ///< p [1], in [1, 1e6]; about 1 / roughness^2
    bool normalised = false;  ///< the integral over all drawn directions is diffuse + specular, whatever the known one

    template <class Visit>
    MEDULLA_FN static void visit(const KajiyaKay& m, Visit&& v) noexcept {
        for (const float x : m.diffuse) v("diffuse", x, 0.0f, 1e6f);
        for (const float x : m.specular) v("specular", x, 0.0f, 1e6f);
        v("exponent", m.exponent, 1.0f, 1e6f);
    }
};

template <int Channels = 3>
struct KajiyaKayHit : Hit<KajiyaKayHit<Channels>, Channels> {
    KajiyaKay<Channels> model;
    detail::TruncatedGaussian<float> gaussian =
        {};  ///< the specular lobe is drawn from: above it everywhere, p = 1/variance
    float diffuse_scale = 0, specular_scale = 0;  ///< of cos theta_r, and of the power of the cosine over cos theta_r
    float diffuse_share = 0;

    MEDULLA_FN KajiyaKayHit(const KajiyaKay<Channels>& m, const Known& direction) noexcept : model(m) {
        if (!this->begin(m, direction)) return;
        const float root = 1 / detail::math::sqrt(m.exponent);
        gaussian = detail::truncated_gaussian(-this->known_theta, root);
        diffuse_scale = m.normalised ? float(1 / (pi * pi)) : 1.0f;
        specular_scale =
            m.normalised ? float(0.5 / pi) / detail::power_of_cosine_integral(this->known_theta, m.exponent) : 1.0f;
        // Energies, that of the printed specular lobe estimated: it is a Gaussian about -theta_i but for grazing light.
        const float d = diffuse_scale * float(pi * pi) * detail::mean_of<Channels>(m.diffuse),
                    s = detail::mean_of<Channels>(m.specular) *
                        (m.normalised ? 1.0f
                                      : 15.7496099f * root * detail::greater(direction.polar.cosine, 0.5f * root));
        const float sum = d + s;
        diffuse_share = sum > 1e-30f ? d / sum : 0.0f;
        if (!(sum > 1e-30f)) this->known.cosine = 0;
    }

    MEDULLA_FN Evaluation<Channels> at(float theta, float cosine, float) const noexcept {
        using namespace detail;
        Evaluation<Channels> e;
        const float power = power_of_cosine(this->known_theta + theta, model.exponent) * specular_scale;
        const float D = cosine * diffuse_scale, S = model.normalised ? power / cosine : power;
        for (int c = 0; c < Channels; ++c) e.value[c] = model.diffuse[c] * D + model.specular[c] * S;
        e.pdf = diffuse_share * cosine * float(1 / (pi * pi)) +
                (1 - diffuse_share) * gaussian.pdf(theta) * float(0.5 / pi) / cosine;
        return e;
    }
    MEDULLA_FN Exit draw(RandomNumbers u) const noexcept {
        const float phi = float(pi) * (2 * u.azimuth - 1);
        if (!(u.lobe < diffuse_share)) return {int(Lobe::R), detail::sample(gaussian, u.longitude), phi};
        // (2 / pi) cos^2 theta: sin theta is a coordinate of a point that is even over the unit disc.
        const auto turn = detail::full_sine_cosine(float(pi) * (2 * u.rows - 1));
        const float r = detail::math::sqrt(u.longitude), off = r * turn.cosine;
        return {int(Lobe::residual), detail::angle(r * turn.sine, detail::math::sqrt((1 - u.longitude) + off * off)),
                phi};
    }
};

/// A hit. `value` is not reciprocal: as printed, `drawn` is the light.
template <int Channels>
MEDULLA_FN KajiyaKayHit<Channels> far_field(const KajiyaKay<Channels>& m, Known known) noexcept {
    return detail::run_fused([&] { return KajiyaKayHit<Channels>(m, known); });
}

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
