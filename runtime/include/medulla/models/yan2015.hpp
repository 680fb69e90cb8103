// Yan et al. 2015, 'Physically-Accurate Fur Reflectance: Modeling, Measurement and Rendering': a medulla and a cortex
// of two refractive indices, eight unscattered lobes and three scattered ones, at the offset of the ray. C^N and C^M
// come from our dense tables in place of the paper's 755 MB. docs/models.md has the errata.
#pragma once

#include <cassert>
#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/detail/table_lookup.hpp"
#include "medulla/models/hit.hpp"
#include "medulla/tables.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace models {

/// Lengths are in fibre radii: the paper's 'diameter^-1' is per radius of its unit circle.
template <int Channels = 3>
struct Yan2015 {
    float eta_c = 1.5f, eta_m = 1.4f;  ///< refractive indices of cortex and cuticle, and of the medulla [1], in (1, 10]
    float kappa = 0.7f;                ///< medulla's radius [fibre radii], in [0, 1]
    float alpha = 0;                   ///< shift of R in theta_r [radians], in [-pi/2, pi/2]
    float beta = 0.1f;                 ///< roughness, along and around [radians], in [1e-4, 2]
    float layers = 0.5f;               ///< of the cuticle [1], in [0, 1000]
    float sigma_ca[std::size_t(Channels)] = {};  ///< absorption of the cortex [1 / fibre radius], in [0, 1e9]
    float sigma_ms = 0;                          ///< scattering of the medulla [1 / fibre radius], in [0, 1e9]
    float g = 0;                                 ///< mean cosine of the phase function [1], in (-1, 1)

    template <class Visit>
    MEDULLA_FN static void visit(const Yan2015& m, Visit&& v) noexcept {
        v("eta_c", m.eta_c, detail::least_above_1, 10.0f);
        v("eta_m", m.eta_m, detail::least_above_1, 10.0f);
        v("kappa", m.kappa, 0.0f, 1.0f);
        v("alpha", m.alpha, -float(pi / 2), float(pi / 2));
        v("beta", m.beta, 1e-4f, 2.0f);
        v("layers", m.layers, 0.0f, 1000.0f);
        for (const float x : m.sigma_ca) v("sigma_ca", x, 0.0f, 1e9f);
        v("sigma_ms", m.sigma_ms, 0.0f, 1e9f);
        v("g", m.g, -detail::greatest_below_1, detail::greatest_below_1);
    }
};

/// A row of the paper's Table 2: degrees, one grey sigma_ca.
struct Yan2015Preset {
    const char* name;
    float kappa, eta_c, eta_m, alpha, beta, sigma_ca, sigma_ms, g, layers;
};
inline constexpr Yan2015Preset yan2015_presets[] = {
    {"bobcat", 0.78f, 1.40f, 1.27f, 4.44f, 4.86f, 0.75f, 3.18f, 0.54f, 0.50f},
    {"cat", 0.85f, 1.43f, 1.35f, 3.97f, 4.94f, 0.48f, 2.58f, 0.62f, 0.59f},
    {"deer", 0.87f, 1.54f, 1.42f, 2.93f, 5.35f, 1.81f, 2.75f, 0.39f, 0.69f},
    {"dog", 0.69f, 1.55f, 1.37f, 2.47f, 4.21f, 0.37f, 3.17f, 0.18f, 0.53f},
    {"mouse", 0.60f, 1.38f, 1.38f, 1.05f, 4.70f, 0.50f, 2.93f, 0.65f, 0.89f},
    {"rabbit", 0.66f, 1.36f, 1.34f, 4.41f, 6.97f, 0.83f, 2.53f, 0.31f, 0.65f},
    {"raccoon", 0.59f, 1.23f, 1.23f, 1.20f, 5.27f, 0.38f, 3.45f, 0.35f, 1.51f},
    {"red_fox", 0.69f, 1.43f, 1.38f, 2.25f, 4.86f, 0.73f, 2.99f, 0.63f, 0.53f},
    {"springbok", 0.85f, 1.55f, 1.32f, 0.03f, 8.43f, 0.96f, 3.06f, 0.03f, 0.54f},
    {"human", 0.34f, 1.21f, 1.21f, 0.87f, 2.03f, 0.83f, 4.30f, 0.38f, 1.49f},
};
template <int Channels = 3>
MEDULLA_FN Yan2015<Channels> parameters_of(const Yan2015Preset& p) noexcept {
    Yan2015<Channels> m;
    m.eta_c = p.eta_c, m.eta_m = p.eta_m, m.kappa = p.kappa, m.layers = p.layers, m.sigma_ms = p.sigma_ms, m.g = p.g;
    m.alpha = p.alpha * float(pi / 180), m.beta = p.beta * float(pi / 180);
    for (float& s : m.sigma_ca) s = p.sigma_ca;
    return m;
}

/// What its dense tables must cover. C^M is read at sigma_ms kappa whatever theta_i, so that sigma is left free.
template <int Channels>
MEDULLA_FN TableRanges ranges_of(const Yan2015<Channels>& m) noexcept {
    FurParameters<Channels> fur;
    fur.eta = m.eta_m, fur.kappa = m.kappa, fur.sigma_ms = m.sigma_ms, fur.g = m.g;
    TableRanges r = medulla::ranges_of(fur);
    r.eta = 0;
    return r;
}

/// Letters are interfaces, capitals the cuticle's: T and t are transmitted, R and r reflected.
enum class Yan2015Lobe : int { R, TT, TRT, TrT, TrRrT, TttT, TtrtT, TttRttT, TttT_s, TtrtT_s, TttRttT_s };
inline constexpr int yan2015_lobe_count = 11, yan2015_scattered = 8;
inline constexpr const char* yan2015_lobe_names[yan2015_lobe_count] = {
    "R", "TT", "TRT", "TrT", "TrRrT", "TttT", "TtrtT", "TttRttT", "TttT^s", "TtrtT^s", "TttRttT^s"};

}  // namespace models

namespace detail {

/// Energies and exits of one ray.
template <int Channels>
struct Yan2015Ray {
    float A[models::yan2015_lobe_count][std::size_t(Channels)] = {};  ///< scattered ones times 1 - y, their light
    float centre[models::yan2015_lobe_count] = {};                    ///< Phi, of scattered ones Phi^s + pi [radians]
    float offset = 0;     ///< sine of the ray's angle inside the medulla, in [-1, 1]: its offset [medulla radii]
    bool inside = false;  ///< whether it enters the medulla
};

/// Reflectance of the medulla's surface met in the cortex. @param cosine there  @param m (eta_m / eta_c)^2 - 1
MEDULLA_FN Cuticle<float> medulla_surface(float cosine, float m) noexcept {
    const float x2 = m + cosine * cosine;
    if (!(x2 > 0)) return {1, 0};
    return bare_interface(m, greater(cosine, 1e-9f), math::sqrt(x2));
}

/// Secs. 7.1 and 7.2. Turns: T: b - a, t: d - c, R: pi + 2 b, r: pi - 2 c from outside and pi + 2 d from inside.
template <int Channels>
MEDULLA_FN Yan2015Ray<Channels> yan2015_ray(const models::Yan2015<Channels>& p, float cos_i, float h) noexcept {
    Yan2015Ray<Channels> ray;
    const Inclination<float> cortex = inclination(p.eta_c, cos_i), core = inclination(p.eta_m, cos_i);
    const float cos_a = math::sqrt((1 - h) * (1 + h)), x = math::sqrt(cortex.index_excess + cos_a * cos_a);
    const float sin_b = h * cortex.inverse_index, cos_b = x * cortex.inverse_index;
    const float a = angle(h, cos_a), b = angle(sin_b, cos_b);
    const Cuticle<float> outer = cuticle(p.layers, cortex.index_excess, cos_a, x);
    const float F = outer.F, T = outer.T_, TT = 2 * (b - a), half = float(pi), R = half + 2 * b;
    const auto set = [&](models::Yan2015Lobe lobe, float phi, auto&& energy) {
        const int k = static_cast<int>(lobe);
        ray.centre[k] = wrap_angle(phi);
        for (int c = 0; c < Channels; ++c) ray.A[k][c] = energy(p.sigma_ca[c] * cortex.inverse_cos_t);
    };
    using Lobe = models::Yan2015Lobe;
    set(Lobe::R, -2 * a, [&](float) { return F; });
    const float sin_c = sin_b / greater(p.kappa, 1e-30f);
    if (!(magnitude(sin_c) < 1)) {
        const float chord = 2 * cos_b;
        set(Lobe::TT, half + TT, [&](float s) { return T * T * exponential(-chord * s); });
        set(Lobe::TRT, half + TT + R, [&](float s) { return T * T * F * exponential(-2 * chord * s); });
        return ray;
    }
    // kappa^2 cos^2 c = kappa^2 - sin^2 b, and cos b - kappa cos c = (1 - kappa^2) / (cos b + kappa cos c).
    const float across = math::sqrt((p.kappa - sin_b) * (p.kappa + sin_b)),
                ring = (1 - p.kappa) * (1 + p.kappa) / (cos_b + across);
    const float cos_c = across / p.kappa, c = angle(sin_c, cos_c);
    // (eta'_m / eta'_c)^2 - 1
    const float m =
        (p.eta_m - p.eta_c) * (p.eta_m + p.eta_c) * cortex.inverse_index * cortex.inverse_index / (cos_i * cos_i);
    const Cuticle<float> inner = medulla_surface(cos_c, m);
    const float Fm = inner.F, t = inner.T_, r = with_sign(half, h) - 2 * c;
    set(Lobe::TrT, half + TT + r, [&](float s) { return T * T * Fm * exponential(-2 * ring * s); });
    set(Lobe::TrRrT, half + TT + 2 * r + R, [&](float s) { return T * T * Fm * Fm * F * exponential(-4 * ring * s); });
    const float sin_d = h * core.inverse_index / p.kappa;
    if (!(t > 0 && magnitude(sin_d) < 1)) return ray;
    const float cos_d = math::sqrt((1 - sin_d) * (1 + sin_d)), d = angle(sin_d, cos_d);
    const float depth = 2 * p.kappa * cos_d * p.sigma_ms * core.inverse_cos_t, y = exponential(-depth),
                E = absorbed(depth, y), tt = 2 * (d - c), inside = half + 2 * d;
    set(Lobe::TttT, half + TT + tt, [&](float s) { return T * T * t * t * y * exponential(-2 * ring * s); });
    set(Lobe::TtrtT, half + TT + tt + inside,
        [&](float s) { return T * T * t * t * Fm * y * y * exponential(-2 * ring * s); });
    set(Lobe::TttRttT, half + TT + 2 * tt + R,
        [&](float s) { return T * T * (t * t) * (t * t) * F * y * y * exponential(-4 * ring * s); });
    const float out = 1 - p.kappa, enter = (b - a) + (d - c);  // the second: T_b, 1 - kappa of cortex on the way out
    set(Lobe::TttT_s, half + enter, [&](float s) { return T * t * E * exponential(-(ring + out) * s); });
    set(Lobe::TtrtT_s, half + enter + inside,
        [&](float s) { return T * t * Fm * y * E * exponential(-(ring + out) * s); });
    set(Lobe::TttRttT_s, half + enter + tt + R,
        [&](float s) { return T * F * t * t * t * y * E * exponential(-(3 * ring + out) * s); });
    ray.offset = sin_d, ray.inside = E > 0;
    return ray;
}

}  // namespace detail

namespace models {

template <int Channels = 3>
struct Yan2015Hit : Hit<Yan2015Hit<Channels>, Channels> {
    static constexpr int unscattered = yan2015_scattered, all = yan2015_lobe_count;
    detail::Yan2015Ray<Channels> ray = {};
    detail::TruncatedGaussian<float> M[4] = {};  ///< of TT, R, TrT and TRT, as kind_of numbers them
    detail::WrappedGaussian<float> D[3] = {};    ///< of one, two and three encounters with the cuticle
    float share[std::size_t(all)] = {};          ///< probabilities
    const DenseTables* tables = nullptr;         ///< null: no scattered lobes
    detail::TableRows across = {}, along = {};   ///< of C^N and of C^M
    float side = 1, blur = 0;                    ///< sign of h; lambda, the share of scattered light that is diffuse
    float scale[2] = {};                         ///< makes M^s back and forward integrate to 1
    float tilt = 0, index_c = 1, inverse_c = 1, inverse_m = 1, layers = 0, m = 0;

    MEDULLA_FN Yan2015Hit(const Yan2015<Channels>& p, const DenseTables* dense, const Known& direction,
                          float h) noexcept {
        using namespace detail;
        h = clamp_offset(h);
        if (!within(h, 1.0f) || !this->begin(p, direction)) return;
        if (dense != nullptr && dense->one_material != 0) {
            this->wrong = "tables", this->known.cosine = 0;
            return;
        }
        const float theta = this->known_theta;
        ray = yan2015_ray(p, this->known.cosine, h);
        M[0] = truncated_gaussian(-theta - 0.5f * p.alpha, 0.5f * p.beta);
        M[1] = truncated_gaussian(-theta + p.alpha, p.beta);
        M[2] = truncated_gaussian(-theta - 0.5f * p.alpha, p.beta);
        M[3] = truncated_gaussian(-theta - 1.5f * p.alpha, 2 * p.beta);
        D[0] = wrapped_gaussian(p.beta), D[1] = wrapped_gaussian(1.41421356f * p.beta);
        D[2] = wrapped_gaussian(1.73205081f * p.beta);
        tilt = p.alpha, index_c = p.eta_c, inverse_c = 1 / p.eta_c, inverse_m = 1 / p.eta_m, layers = p.layers;
        m = (p.eta_m - p.eta_c) * (p.eta_m + p.eta_c) * inverse_c * inverse_c;
        side = h < 0 ? -1.0f : 1.0f;
        if (ray.inside && dense != nullptr) set_medulla(p, *dense);
        for (int k = 0; tables == nullptr && k < 3; ++k)
            for (float& x : ray.A[unscattered + k]) x = 0;
        for (int k = 0; k < all; ++k) share[k] = mean_of<Channels>(ray.A[k]);
        if (!normalise_shares<all>(share)) this->known.cosine = 0;
    }

    MEDULLA_FN Colour<Channels> albedo() const noexcept {
        Colour<Channels> sum;
        for (int k = 0; this->known.cosine > 0 && k < all; ++k)
            for (int c = 0; c < Channels; ++c) sum[c] += ray.A[k][c];
        return sum;
    }

    /// M^s at theta_r [1 / radian]: C^M inside the medulla, refracted and attenuated on its way out (Eq. 18).
    MEDULLA_FN float scattered_along(float theta, float cosine, float forwardness) const noexcept {
        const Outgoing o = outgoing(theta, cosine);
        // The blend of two sides, each times its scale, as one lookup.
        const float forward = forwardness * scale[1], all_of_it = (1 - forwardness) * scale[0] + forward;
        return o.factor * all_of_it * detail::longitudinal_density(*tables, along, o.exit, 0, forward / all_of_it);
    }

    MEDULLA_FN Evaluation<Channels> at(float theta, float cosine, float phi) const noexcept {
        using namespace detail;
        Evaluation<Channels> e;
        const float inverse = 1 / cosine;
        float along_lobe[4];
        for (int i = 0; i < 4; ++i) along_lobe[i] = M[i].pdf(theta) * inverse;
        for (int k = 0; k < unscattered; ++k) {
            if (!(share[k] > 0)) continue;
            const float x = along_lobe[kind_of(k)] * D[meetings_of(k) - 1].pdf(phi - ray.centre[k]);
            e.pdf += x * share[k];
            for (int c = 0; c < Channels; ++c) e.value[c] += x * ray.A[k][c];
        }
        if (tables == nullptr) return e;
        const float M_s = scattered_along(theta, cosine, magnitude(phi) * float(1 / pi)) * inverse,
                    drawn = cosine * float(2 / pi);  // cos^2 theta, normalised, over cos theta
        for (int k = unscattered; k < all; ++k) {
            const float N = around(phi, k);
            e.pdf += drawn * N * share[k];
            for (int c = 0; c < Channels; ++c) e.value[c] += M_s * N * ray.A[k][c];
        }
        return e;
    }
    MEDULLA_FN Exit draw(RandomNumbers u) const noexcept {
        using namespace detail;
        const int k = draw_of<all>(share, u.lobe);
        if (k < 0) return {};
        if (k < unscattered) {
            constexpr int like[8] = {0, 1, 2, 1, 2, 1, 1, 2};  // the lobe of Lobe that it would be without a medulla
            return {like[k], detail::sample(M[kind_of(k)], u.longitude),
                    ray.centre[k] + detail::sample(D[meetings_of(k) - 1], u.azimuth)};
        }
        // cos^2 theta: sin theta is a coordinate of a point that is even over the unit disc.
        const auto turn = full_sine_cosine(float(pi) * (2 * u.rows - 1));
        const float r = math::sqrt(u.longitude), off = r * turn.cosine;
        const float theta = angle(r * turn.sine, math::sqrt((1 - u.longitude) + off * off));
        float phi;
        if (u.lobe < blur) {
            phi = float(pi) * (2 * u.azimuth - 1);
        } else {
            const float which = lesser((u.lobe - blur) / greater(1 - blur, 1e-6f), 1.0f);
            phi = ray.centre[k] + side * draw_azimuth(*tables, across, which, u.azimuth);
        }
        return {k == unscattered ? int(medulla::Lobe::TTs) : int(medulla::Lobe::TRTs), theta, phi};
    }

  private:
    /// Which M a lobe has: beta_p and alpha_p of Eq. 14, whose beta_TT is +beta / 2 (printed -beta / 2).
    MEDULLA_FN static int kind_of(int k) noexcept {
        constexpr int kind[8] = {1, 0, 3, 2, 3, 0, 2, 3};
        return kind[k];
    }
    /// How often a lobe's ray meets the cuticle, which counts in its width around.
    MEDULLA_FN static int meetings_of(int k) noexcept {
        constexpr int meetings[8] = {1, 2, 3, 2, 3, 2, 2, 3};
        return meetings[k];
    }
    /// N^s over A^s [1 / radian].
    MEDULLA_FN float around(float phi, int k) const noexcept {
        using namespace detail;
        const ExitPlaces exit = exit_places(turns_of(Four(side * (phi - ray.centre[k]))), Four(2 * tables->phi.end));
        return (1 - blur) * azimuthal_density(*tables, across, exit, 0) + blur * float(0.5 / pi);
    }
    /// The way out at theta_r: what of C^M passes both surfaces, and where C^M is read.
    struct Outgoing {
        float factor;
        detail::ExitPlaces exit;
    };
    MEDULLA_FN Outgoing outgoing(float theta, float cosine) const noexcept {
        using namespace detail;
        // The surfaces are met in the plane of the fibre: the cuticle's is tilted, the medulla's is not.
        const float sine = sine_cosine(theta).sine, sin_c = sine * inverse_c, sin_m = sine * inverse_m;
        const float cos_c = math::sqrt((1 - sin_c) * (1 + sin_c)), cos_m = math::sqrt((1 - sin_m) * (1 + sin_m));
        const float tilted = magnitude(theta + tilt);
        const float cos_o = tilted < float(pi / 2) ? polynomial::cosine(tilted) : 0.0f;
        const float excess = (index_c - 1) * (index_c + 1);
        const float out = cuticle(layers, excess, cos_o, math::sqrt(excess + cos_o * cos_o)).T_,
                    through = medulla_surface(cos_c, m).T_;
        const float inside = angle(sin_m, cos_m);
        return {out * through * cosine * inverse_m / cos_m,
                exit_places(turns_of(Four(this->known_theta < 0 ? -inside : inside)), Four(4 * tables->theta_r.end))};
    }
    MEDULLA_FN void set_medulla(const Yan2015<Channels>& p, const DenseTables& dense) noexcept {
        using namespace detail;
        assert(dense.magic == tables_magic && "the memory of a fibre's tables is gone or was overwritten");
        tables = &dense;
        set_g(dense.g, dense.g_rows, p.g, across);
        along = across;
        const Inclination<float> core = inclination(p.eta_m, this->known.cosine);
        set_inclination(dense, p.sigma_ms * p.kappa * core.inverse_cos_t, this->known_theta, across);
        set_offset(dense, magnitude(ray.offset), across);
        const float sin_m = this->known.sine * inverse_m;
        set_inclination(dense, p.sigma_ms * p.kappa, angle(sin_m, math::sqrt((1 - sin_m) * (1 + sin_m))), along);
        // lambda = 1 - (1 - Fm)(1 - F) at normal incidence (printed: at pi / 2, where F is 1).
        const float excess = (p.eta_c - 1) * (p.eta_c + 1);
        blur = 1 - medulla_surface(1, m).T_ * cuticle(p.layers, excess, 1.0f, p.eta_c).T_;
        // 64 midpoints in s, theta = (pi / 4)(3 s - s^3), whose weight is 0 at the ends.
        float sum[2] = {};
        for (int i = 0; i < 64; ++i) {
            const float s = (float(i) + 0.5f) / 32 - 1, theta = float(pi / 4) * s * (3 - s * s),
                        weight = float(3 * pi / 4) * (1 - s * s) / 32, cosine = cosine_of(theta);
            const Outgoing o = outgoing(theta, cosine);
            for (int f = 0; f < 2; ++f)
                sum[f] += weight * o.factor * longitudinal_density(*tables, along, o.exit, 0, float(f));
        }
        for (int f = 0; f < 2; ++f) scale[f] = sum[f] > 1e-30f ? 1 / sum[f] : 0.0f;
        if (!(sum[0] > 1e-30f && sum[1] > 1e-30f)) tables = nullptr;
    }
};

/// @param tables made for ranges_of(model); null: no scattered lobes
template <int Channels>
MEDULLA_FN Yan2015Hit<Channels> near_field(const Yan2015<Channels>& m, const DenseTables* tables, Known known,
                                           float h) noexcept {
    return detail::run_fused([&] { return Yan2015Hit<Channels>(m, tables, known, h); });
}

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
