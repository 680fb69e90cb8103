// A hair BCSDF as a renderer writes it (R, TT, TRT and a residual lobe, near field): the yardstick of bench_vertex.
// Rests on Chiang et al. 2016, 'A Practical and Controllable Hair and Fur Model for Production Path Tracing', and the
// longitudinal function of d'Eon et al. 2011, from their formulas; plain std:: math, no dependence on the runtime.
#pragma once

#include <algorithm>
#include <cmath>

namespace chiang {

constexpr float pi = 3.14159265f;
constexpr int lobes = 4;  ///< R, TT, TRT, and all paths after them as one

struct Vector {
    float x, y, z;  ///< x along the fibre, root to tip
};
struct Colour {
    float value[3];
};
struct Evaluation {
    Colour value;  ///< energy per steradian
    float pdf;     ///< per steradian
};
struct Sample {
    Vector direction;
    Colour value;
    float pdf;
};

inline float square(float x) { return x * x; }
inline float safe_sqrt(float x) { return std::sqrt(std::max(0.0f, x)); }
inline float safe_asin(float x) { return std::asin(std::min(1.0f, std::max(-1.0f, x))); }

/// Reflectance of a dielectric of index eta met from outside.
inline float fresnel(float cos_i, float eta) {
    const float cos_t = safe_sqrt(1 - (1 - square(cos_i)) / square(eta));
    const float s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    const float p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    return 0.5f * (square(s) + square(p));
}

/// exp(-x) I_0(x), x >= 0: Abramowitz and Stegun 9.8.1, 9.8.2.
inline float scaled_bessel_i0(float x) {
    if (x < 3.75f) {
        const float t = square(x / 3.75f);
        return std::exp(-x) *
               (1 + t * (3.5156229f +
                         t * (3.0899424f + t * (1.2067492f + t * (0.2659732f + t * (0.0360768f + t * 0.0045813f))))));
    }
    const float t = 3.75f / x;
    return (0.39894228f +
            t * (0.01328592f +
                 t * (0.00225319f +
                      t * (-0.00157565f +
                           t * (0.00916281f +
                                t * (-0.02057706f + t * (0.02635537f + t * (-0.01647633f + t * 0.00392377f)))))))) /
           std::sqrt(x);
}

/// Longitudinal density csch(1/v) / (2 v) exp(-sin sin / v) I_0(cos cos / v); its integral over sin theta_r is 1.
inline float longitudinal(float v, float sin_i, float cos_i, float sin_r, float cos_r) {
    const float a = cos_i * cos_r / v, b = sin_i * sin_r / v;
    return scaled_bessel_i0(a) * std::exp(a - b - 1 / v) / (v * (1 - std::exp(-2 / v)));
}

inline float logistic_cdf(float x, float s) { return 1 / (1 + std::exp(-x / s)); }

/// Logistic density of scale s, trimmed to [-pi, pi].
inline float trimmed_logistic(float x, float s) {
    const float e = std::exp(-std::abs(x) / s);
    return e / (s * square(1 + e)) / (logistic_cdf(pi, s) - logistic_cdf(-pi, s));
}

inline float sample_trimmed_logistic(float u, float s) {
    const float low = logistic_cdf(-pi, s), high = logistic_cdf(pi, s);
    const float x = -s * std::log(1 / (low + u * (high - low)) - 1);
    return std::min(pi, std::max(-pi, x));
}

/// What the parameters decide: made at every hit, as textures vary them.
struct Hair {
    float eta, sigma_a[3];
    float v[lobes];                            ///< longitudinal variances
    float s;                                   ///< azimuthal scale
    float sin_shift[lobes], cos_shift[lobes];  ///< shifts of theta_i by the tilted scales

    /// @param sigma_a_ absorption [1 / fibre radius]  @param beta_m, beta_n roughness in (0, 1]
    /// @param alpha tilt of the scales [radians]
    Hair(float eta_, const float (&sigma_a_)[3], float beta_m, float beta_n, float alpha) : eta(eta_) {
        for (int c = 0; c < 3; ++c) sigma_a[c] = sigma_a_[c];
        v[0] = square(0.726f * beta_m + 0.812f * square(beta_m) + 3.7f * power20(beta_m));
        v[1] = 0.25f * v[0], v[2] = 4 * v[0], v[3] = v[2];
        s = 0.626657069f * (0.265f * beta_n + 1.194f * square(beta_n) + 5.372f * power20(beta_n) * square(beta_n));
        // theta_i turns by 2, -1, -4 alpha, so that R leaves towards the root; by the double-angle formulas.
        const float sin1 = std::sin(alpha), cos1 = safe_sqrt(1 - square(sin1));
        const float sin2 = 2 * sin1 * cos1, cos2 = square(cos1) - square(sin1);
        const float sin4 = 2 * sin2 * cos2, cos4 = square(cos2) - square(sin2);
        sin_shift[0] = sin2, cos_shift[0] = cos2;
        sin_shift[1] = -sin1, cos_shift[1] = cos1;
        sin_shift[2] = -sin4, cos_shift[2] = cos4;
        sin_shift[3] = 0, cos_shift[3] = 1;
    }

  private:
    static float power20(float x) {
        const float x4 = square(square(x));
        return square(square(x4)) * x4;
    }
};

/// A hit of the direction `known` at offset h in [-1, 1] along the left normal of its travel, seen along x.
struct Hit {
    const Hair* hair;
    float phi_known, gamma_i, gamma_t;
    float sin_i[lobes], cos_i[lobes];  ///< of theta_i with each lobe's shift
    float A[lobes][3];                 ///< attenuation
    float share[lobes];                ///< probability of each lobe

    Hit(const Hair& hair_, Vector known, float h) : hair(&hair_) {
        const float sin_theta = known.x, cos_theta = safe_sqrt(1 - square(sin_theta));
        phi_known = std::atan2(known.z, known.y);
        gamma_i = safe_asin(h);
        const float sin_theta_t = sin_theta / hair->eta, cos_theta_t = safe_sqrt(1 - square(sin_theta_t));
        const float eta_prime = safe_sqrt(square(hair->eta) - square(sin_theta)) / cos_theta;
        const float sin_gamma_t = h / eta_prime, cos_gamma_t = safe_sqrt(1 - square(sin_gamma_t));
        gamma_t = safe_asin(sin_gamma_t);
        const float F = fresnel(cos_theta * safe_sqrt(1 - square(h)), hair->eta);
        float sum[lobes] = {}, total = 0;
        for (int c = 0; c < 3; ++c) {
            const float T = std::exp(-hair->sigma_a[c] * 2 * cos_gamma_t / cos_theta_t);
            A[0][c] = F;
            A[1][c] = square(1 - F) * T;
            A[2][c] = A[1][c] * T * F;
            A[3][c] = F < 1 ? A[2][c] * T * F / (1 - T * F) : 0;
            for (int p = 0; p < lobes; ++p) sum[p] += A[p][c];
        }
        for (int p = 0; p < lobes; ++p) {
            total += sum[p];
            sin_i[p] = sin_theta * hair->cos_shift[p] + cos_theta * hair->sin_shift[p];
            cos_i[p] = std::abs(cos_theta * hair->cos_shift[p] - sin_theta * hair->sin_shift[p]);
        }
        for (int p = 0; p < lobes; ++p) share[p] = sum[p] / total;
    }

    float centre(int p) const { return 2 * float(p) * gamma_t - 2 * gamma_i + float(p) * pi; }

    Evaluation evaluate(Vector drawn) const {
        const float sin_r = drawn.x, cos_r = safe_sqrt(1 - square(sin_r));
        const float phi = std::atan2(drawn.z, drawn.y) - phi_known;
        Evaluation e = {};
        for (int p = 0; p < lobes; ++p) {
            const float M = longitudinal(hair->v[p], sin_i[p], cos_i[p], sin_r, cos_r);
            float N = 1 / (2 * pi);
            if (p < 3) {
                float x = phi - centre(p);
                while (x > pi) x -= 2 * pi;
                while (x < -pi) x += 2 * pi;
                N = trimmed_logistic(x, hair->s);
            }
            for (int c = 0; c < 3; ++c) e.value.value[c] += M * N * A[p][c];
            e.pdf += M * N * share[p];
        }
        return e;
    }

    Sample sample(const float (&u)[4]) const {
        int p = 0;
        for (float left = u[0]; p < lobes - 1 && left >= share[p]; ++p) left -= share[p];
        const float v = hair->v[p];
        const float cosine = std::max(-1.0f, 1 + v * std::log(u[1] + (1 - u[1]) * std::exp(-2 / v)));
        const float sine = safe_sqrt(1 - square(cosine));
        const float sin_r = -cosine * sin_i[p] + sine * std::cos(2 * pi * u[2]) * cos_i[p];
        const float cos_r = safe_sqrt(1 - square(sin_r));
        const float turn = p < 3 ? centre(p) + sample_trimmed_logistic(u[3], hair->s) : 2 * pi * u[3];
        const float phi = phi_known + turn;
        const Vector direction = {sin_r, cos_r * std::cos(phi), cos_r * std::sin(phi)};
        const Evaluation e = evaluate(direction);
        return {direction, e.value, e.pdf};
    }
};

}  // namespace chiang
