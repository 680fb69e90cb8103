// Marschner et al. 2003, 'Light Scattering from Human Hair Fibers': the far field of a dielectric cylinder, R, TT and
// TRT, with exact roots of Phi_p(h) = phi in place of the paper's cubic, and the caustic of TRT replaced by glints.
// S = sum M_p(theta_h) N_p(phi; theta_d) / cos^2 theta_d. docs/models.md has the errata.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/models/cylinder.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace models {

/// Angles of lobes are the paper's, of the half angle theta_h, about an axis that runs from root to tip: a tilt alpha_R
/// < 0 turns R by 2 alpha_R towards the root.
template <int Channels = 3>
struct Marschner {
    float eta = 1.55f;                          ///< refractive index [1], in (1, 10]
    float sigma_a[std::size_t(Channels)] = {};  ///< absorption coefficient [1 / fibre radius], in [0, 1e9]
    float alpha_R = -0.12f;                     ///< [radians], in [-pi/4, pi/4]; TT -1/2 and TRT -3/2 of it
    float beta_R = 0.12f;                       ///< deviation along [radians], in [1e-3, 2]; TT 1/2 and TRT 2 of it
    float glint = 2.5f;                         ///< k_G [1], in [0, 100]: 0.539 keeps the energy of narrow glints
    float glint_width = 0.26f;                  ///< w_c, deviation of a glint around [radians], in [1e-5, 2]
    float fade = 0.3f;                          ///< range of eta' over which glints merge [1], in [1e-3, 10]
    float glint_limit = 0.5f;                   ///< most offsets h that a glint takes in [1], in [0, 2]
    bool normalised = false;                    ///< M integrates to 1 over theta_r, and S cos^2 theta_r to the energy

    template <class Visit>
    MEDULLA_FN static void visit(const Marschner& m, Visit&& v) noexcept {
        v("eta", m.eta, detail::least_above_1, 10.0f);
        for (const float x : m.sigma_a) v("sigma_a", x, 0.0f, 1e9f);
        v("alpha_R", m.alpha_R, -float(pi / 4), float(pi / 4));
        v("beta_R", m.beta_R, 1e-3f, 2.0f);
        v("glint", m.glint, 0.0f, 100.0f);
        v("glint_width", m.glint_width, 1e-5f, 2.0f);
        v("fade", m.fade, 1e-3f, 10.0f);
        v("glint_limit", m.glint_limit, 0.0f, 2.0f);
    }
};

}  // namespace models

namespace detail {

/// Where TRT turns back: exits crowd at +-phi_c, and N is infinite there.
struct Caustic {
    float h = 0, gamma = 0, phi = 0;  ///< offset and angle of incidence of the ray, its exit [radians]; 0 for eta' >= 2
    float curvature = 0;              ///< |Phi''(h)|
};
/// @param at of theta_d; index_excess = eta'^2 - 1
MEDULLA_FN Caustic caustic(const Inclination<float>& at) noexcept {
    Caustic c;
    const float over = 3 - at.index_excess;  // 4 - eta'^2
    if (!(over > 0)) return c;
    const float cos2 = at.index_excess * (1.0f / 3), cosine = math::sqrt(cos2);
    c.h = math::sqrt(over * (1.0f / 3));
    c.gamma = angle(c.h, cosine);
    const float sin_t = c.h * at.inverse_index, cos_t = math::sqrt(at.index_excess + cos2) * at.inverse_index;
    c.phi = 4 * angle(sin_t, cos_t) - 2 * c.gamma;
    c.curvature = 1.5f * c.h / greater(cos2 * cosine, 1e-20f);
    return c;
}

/// d Phi_p / d gamma_i; for p = 1 without cancellation as eta' -> 1. @param x eta' cos gamma_t
MEDULLA_FN float exit_slope(int p, const Inclination<float>& at, float cosine, float x) noexcept {
    if (p == 1) return -2 * at.index_excess / (x * (x + cosine));
    return 2 * (float(p) * cosine / x - 1);
}

/// Visits the rays of lobe p that leave at phi: use(gamma_i, cos gamma_i, 1 / |2 d Phi_p / dh|).
template <class Use>
MEDULLA_FN void visit_roots(int p, const Inclination<float>& at, const Caustic& fold, float phi, Use&& use) noexcept {
    constexpr float edge = float(pi / 2);
    const auto found = [&](float gamma) {
        const float cosine = cosine_of(gamma), x = math::sqrt(at.index_excess + cosine * cosine);
        const float slope = magnitude(exit_slope(p, at, cosine, x));
        if (slope > 1e-6f * cosine) use(gamma, cosine, 0.5f * cosine / slope);  // at a fold there is no density
    };
    if (p == 0) return found(-0.5f * phi);
    const float x = wrap_angle(p == 1 ? phi - float(pi) : phi);
    if (p == 1) {
        // gamma_t = gamma_i + x / 2 and sin gamma_i = eta' sin gamma_t.
        const float d = -0.5f * x, index = 1 / at.inverse_index;
        const auto turn = sine_cosine(d);
        // eta' - cos d = (eta'^2 - 1) / (eta' + 1) + (1 - cos d)
        const float half = polynomial::sine_cosine(0.5f * d).sine,
                    below = at.index_excess / (index + 1) + 2 * half * half;
        const float inverse = 1 / math::sqrt(turn.sine * turn.sine + below * below);
        const float gamma = angle(turn.sine * inverse, below * inverse) + d;
        if (within(gamma, edge)) found(gamma);
        return;
    }
    const auto beyond = [&](float gamma) {
        const auto g = sine_cosine(gamma);
        const float sin_t = g.sine * at.inverse_index,
                    cos_t = math::sqrt(at.index_excess + g.cosine * g.cosine) * at.inverse_index;
        return 4 * angle(sin_t, cos_t) - 2 * gamma - x;
    };
    const auto piece = [&](float low, float high) {
        const float at_low = beyond(low), at_high = beyond(high);
        if (!(at_low * at_high <= 0) || !(high > low)) return;
        const float sign = at_low > 0 ? -1.0f : 1.0f;
        float gamma = low + (high - low) * (at_low / (at_low - at_high));
        for (int i = 0; i < 40; ++i) {
            const float error = sign * beyond(gamma);
            (error < 0 ? low : high) = gamma;
            const float cosine = polynomial::cosine(gamma),
                        slope = sign * exit_slope(2, at, cosine, math::sqrt(at.index_excess + cosine * cosine));
            float next = slope > 0 ? gamma - error / slope : low - 1;
            if (!(next > low && next < high)) next = 0.5f * (low + high);
            const bool done = magnitude(next - gamma) < 2e-7f;
            gamma = next;
            if (done) break;
        }
        found(gamma);
    };
    if (!(fold.h > 0)) return piece(-edge, edge);
    piece(-edge, -fold.gamma), piece(-fold.gamma, fold.gamma), piece(fold.gamma, edge);
}

}  // namespace detail

namespace models {

template <int Channels = 3>
struct MarschnerHit : Hit<MarschnerHit<Channels>, Channels> {
    Marschner<Channels> model;
    detail::TruncatedGaussian<float> M[3] = {};  ///< over theta_r: theta_h of deviation b is theta_r of 2 b
    float share[3] = {};

    MEDULLA_FN MarschnerHit(const Marschner<Channels>& m, const Known& direction) noexcept : model(m) {
        using namespace detail;
        if (!this->begin(m, direction)) return;
        const float shift[3] = {1, -0.5f, -1.5f}, width[3] = {1, 0.5f, 2};
        for (int p = 0; p < 3; ++p)
            M[p] = truncated_gaussian(-this->known_theta - 2 * shift[p] * m.alpha_R, 2 * width[p] * m.beta_R);
        // Probabilities: mean energies, by four midpoints in h, where the exit is a mirror's.
        const Cylinder<Channels> c = cylinder<Channels>(m.eta, m.sigma_a, this->known.cosine);
        const Four h(0.125f, 0.375f, 0.625f, 0.875f);
        Four A[3][std::size_t(Channels)];
        order_energies<Channels, 3>(c, chord(c.at, h, square_root((Four(1) - h) * (Four(1) + h))), false, A);
        for (int p = 0; p < 3; ++p)
            for (int k = 0; k < Channels; ++k) share[p] += sum_of(A[p][k]);
        normalise_shares<3>(share);
    }

    /// N_p at phi, and the density over phi with which lobe p is drawn [1 / radian].
    struct Azimuthal {
        Colour<Channels> N[3];
        float density[3] = {};
    };
    /// @param theta_d half the difference of the inclinations [radians]  @param phi [radians], in [-pi, pi]
    MEDULLA_FN Azimuthal azimuthal(float theta_d, float phi) const noexcept {
        using namespace detail;
        Azimuthal a;
        const Glints g = glints(cosine_of(theta_d));
        const float fade_low = faded(g, phi - g.fold.phi), fade_high = faded(g, phi + g.fold.phi);
        for (int p = 0; p < 3; ++p) {
            const float keep = p == 2 ? fade_low * fade_high : 1.0f;
            visit_roots(p, g.cylinder.at, g.fold, phi, [&](float gamma, float cosine, float density) {
                float A[3][std::size_t(Channels)];
                energies_at(g, polynomial::sine_cosine(gamma).sine, cosine, A);
                for (int c = 0; c < Channels; ++c) a.N[p][c] += keep * density * A[p][c];
                a.density[p] += density;
            });
        }
        const float both = g.gaussian.pdf(phi - g.fold.phi) + g.gaussian.pdf(phi + g.fold.phi);
        for (int c = 0; c < Channels; ++c) a.N[2][c] += both * g.energy[c];
        a.density[2] = (1 - g.share) * a.density[2] + g.share * 0.5f * both;
        return a;
    }

    MEDULLA_FN Evaluation<Channels> at(float theta, float cosine, float phi) const noexcept {
        using namespace detail;
        Evaluation<Channels> e;
        const float theta_d = 0.5f * (theta - this->known_theta), cos_d = cosine_of(theta_d);
        const Azimuthal a = azimuthal(theta_d, phi);
        const float shift[3] = {1, -0.5f, -1.5f}, width[3] = {1, 0.5f, 2};
        for (int p = 0; p < 3; ++p) {
            const float density = M[p].pdf(theta) / cosine;
            float along = density;
            if (!model.normalised) {
                // The axis of theta runs the other way: theta_h - alpha_p becomes theta_h + alpha_p.
                const float inverse = 1 / (width[p] * model.beta_R),
                            z = (0.5f * (theta + this->known_theta) + shift[p] * model.alpha_R) * inverse;
                along = 0.39894228f * inverse * exponential(-0.5f * z * z) * cosine / (cos_d * cos_d);
            }
            e.pdf += share[p] * density * a.density[p];
            for (int c = 0; c < Channels; ++c) e.value[c] += along * a.N[p][c];
        }
        return e;
    }
    MEDULLA_FN Exit draw(RandomNumbers u) const noexcept {
        using namespace detail;
        const int p = draw_of<3>(share, u.lobe);
        if (p < 0) return {};
        const float theta = detail::sample(M[p], u.longitude);
        const Glints g = glints(cosine_of(0.5f * (theta - this->known_theta)));
        if (p == 2 && u.rows < g.share) {
            const float side = u.lobe < 0.5f ? -g.fold.phi : g.fold.phi;
            return {p, theta, side + detail::sample(g.gaussian, u.azimuth)};
        }
        const Chord<float> ray = chord(g.cylinder.at, 2 * u.azimuth - 1, 2 * math::sqrt(u.azimuth * (1 - u.azimuth)));
        return {p, theta, centre_of(p, ray)};
    }

  private:
    /// What theta_d decides.
    struct Glints {
        detail::Cylinder<Channels> cylinder;
        detail::Caustic fold;
        detail::WrappedGaussian<float> gaussian;
        float strength = 0;                        ///< t: 1 for eta' < 2, 0 where glints have merged and gone
        float energy[std::size_t(Channels)] = {};  ///< of each of the two
        float share = 0;                           ///< of the samples of TRT that are drawn from the glints
    };
    MEDULLA_FN Glints glints(float cos_d) const noexcept {
        using namespace detail;
        Glints g;
        g.cylinder = detail::cylinder<Channels>(model.eta, model.sigma_a, cos_d);
        g.fold = caustic(g.cylinder.at);
        g.gaussian = wrapped_gaussian(model.glint_width);
        float offsets = model.glint_limit;
        g.strength = 1;
        if (g.fold.h > 0) {
            offsets = lesser(offsets, 2 * math::sqrt(2 * model.glint_width / g.fold.curvature));
        } else {
            // Marschner et al. print smoothstep itself, which would let glints reappear above eta' = 2.
            const float x = lesser((1 / g.cylinder.at.inverse_index - 2) / model.fade, 1.0f);
            g.strength = 1 - x * x * (3 - 2 * x);
        }
        float A[3][std::size_t(Channels)], there = 0, typical = 0;
        energies_at(g, g.fold.h, math::sqrt((1 - g.fold.h) * (1 + g.fold.h)), A);
        for (int c = 0; c < Channels; ++c) {
            g.energy[c] = g.strength * model.glint * offsets * A[2][c];
            there += 2 * g.energy[c];
            typical += A[2][c];
        }
        g.share = there > 1e-30f ? there / (there + typical) : 0.0f;
        return g;
    }
    /// 1 - t g(x) / g(0).
    MEDULLA_FN float faded(const Glints& g, float x) const noexcept {
        using namespace detail;
        const float z = wrap_angle(x) / model.glint_width, half = 0.5f * z * z, left = exponential(-half);
        return (1 - g.strength) * left + absorbed(half, left);
    }
    MEDULLA_FN static void energies_at(const Glints& g, float h, float cosine,
                                       float (&A)[3][std::size_t(Channels)]) noexcept {
        detail::order_energies<Channels, 3>(g.cylinder, detail::chord(g.cylinder.at, h, cosine), false, A);
    }
};

template <int Channels>
MEDULLA_FN MarschnerHit<Channels> far_field(const Marschner<Channels>& m, Known known) noexcept {
    return detail::run_fused([&] { return MarschnerHit<Channels>(m, known); });
}

/// The reference implementation of N_p without glints: the mean over phi in [low, high] of (1/2) integral over h of A_p
/// delta(phi - Phi_p(h)), by `nodes` midpoints in gamma_i, each of which falls into the interval or does not.
template <int Channels>
MEDULLA_FN Colour<Channels> brute_force_azimuthal(const Marschner<Channels>& m, int p, float theta_d, float low,
                                                  float high, int nodes) noexcept {
    using namespace detail;
    const Cylinder<Channels> c = cylinder<Channels>(m.eta, m.sigma_a, cosine_of(theta_d));
    double sum[std::size_t(Channels)] = {};
    for (int i = 0; i < nodes; ++i) {
        const float gamma = float(pi * ((double(i) + 0.5) / double(nodes) - 0.5));
        const auto at = polynomial::sine_cosine(gamma);
        const Chord<float> ray = chord(c.at, at.sine, at.cosine);
        if (!(magnitude(wrap_angle(centre_of(p, ray) - 0.5f * (low + high))) < 0.5f * (high - low))) continue;
        float A[3][std::size_t(Channels)];
        order_energies<Channels, 3>(c, ray, false, A);
        for (int k = 0; k < Channels; ++k) sum[k] += double(A[p][k]) * double(at.cosine);
    }
    Colour<Channels> mean;
    for (int k = 0; k < Channels; ++k) mean[k] = float(0.5 * pi / double(nodes) * sum[k] / double(high - low));
    return mean;
}

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
