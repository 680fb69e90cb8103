// The longitudinal density of d'Eon et al. 2011: the von Mises-Fisher density about the cone of mirrored directions,
// whose energy is 1 whatever the known direction. Density and sampler.
#pragma once

#include "medulla/config.hpp"
#include "medulla/detail/elementary.hpp"
#include "medulla/vector.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// I_0(x) exp(rest - x), x >= 0: Abramowitz and Stegun 9.8.1, 9.8.2, which are within 5e-7 of it for every x.
MEDULLA_FN float bessel_i0_times_exponential(float x, float rest) noexcept {
    if (x < 3.75f) {
        const float t = (x / 3.75f) * (x / 3.75f);
        return exponential(rest - x) *
               (1 + t * (3.5156229f +
                         t * (3.0899424f + t * (1.2067492f + t * (0.2659732f + t * (0.0360768f + t * 0.0045813f))))));
    }
    const float root = 1 / math::sqrt(x), t = 3.75f * root * root;
    return exponential(rest) * root *
           (0.39894228f +
            t * (0.01328592f +
                 t * (0.00225319f +
                      t * (-0.00157565f +
                           t * (0.00916281f +
                                t * (-0.02057706f + t * (0.02635537f + t * (-0.01647633f + t * 0.00392377f))))))));
}

/// csch(1 / v) / (2 v) exp(-sin t sin theta_r / v) I_0(cos t cos theta_r / v), written so that nothing overflows as v
/// -> 0 and v -> infinity gives 1/2. t is theta_i less the lobe's shift, folded back at the poles.
struct VonMisesFisher {
    float inverse;       ///< 1 / v [1], > 0
    float t;             ///< [radians]
    float sine, cosine;  ///< of t
    float scale;         ///< 1 / (v (1 - exp(-2 / v)))
    float least;         ///< exp(-2 / v)

    /// Density per unit of sin theta: its integral over them is 1.
    MEDULLA_FN float density(float theta, float cosine_r) const noexcept {
        const float half = sine_cosine(0.5f * (t + theta)).sine;
        return bessel_i0_times_exponential(cosine * cosine_r * inverse, -2 * half * half * inverse) * scale;
    }
    /// An inclination from two numbers in [0, 1].
    MEDULLA_FN float draw(float u, float w) const noexcept {
        // 1 - cosine of the angle to the cone's direction: the exponential distribution, cut at 2.
        const float cut = u + (1 - u) * least;
        const float x = lesser(-math::log(greater(cut, 1e-37f)) / inverse, 2.0f), z = 1 - x,
                    off = math::sqrt(greater(x * (2 - x), 0.0f));
        const auto turn = full_sine_cosine(float(pi) * (2 * w - 1));
        const float along = off * turn.cosine * cosine - z * sine, across = z * cosine + off * turn.cosine * sine,
                    aside = off * turn.sine;
        const float rest = math::sqrt(across * across + aside * aside),
                    unit = 1 / math::sqrt(along * along + rest * rest);
        return angle(along * unit, rest * unit);
    }
};

/// @param shift of the exit about -theta_i [radians]
MEDULLA_FN VonMisesFisher von_mises_fisher(float variance, float theta_i, float shift) noexcept {
    constexpr float edge = float(pi / 2);
    float t = theta_i - shift;
    if (t > edge) t = float(pi) - t;
    if (t < -edge) t = -float(pi) - t;
    const auto at = sine_cosine(t);
    const float inverse = 1 / variance, depth = 2 * inverse, least = exponential(-depth);
    return {inverse, t, at.sine, at.cosine, inverse / absorbed(depth, least), least};
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
