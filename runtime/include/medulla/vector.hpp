// Directions, offsets and colours: what lies between a renderer's vectors and the model's angles.
//
// Vectors. A fibre's frame has x along the fibre from ROOT to TIP, as every renderer's tangent runs, and (y, z) across
// it. Directions point away from the fibre.
// Angles are the papers', whose axis runs the other way: theta = -asin x is positive towards the root; phi = atan2(z,
// y).
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/elementary.hpp"
#include "medulla/detail/math.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// A direction or a point in the fibre's frame.
struct Vector {
    float x, y, z;
};

/// A direction in the papers' angles.
struct Angles {
    float theta;  ///< inclination [radians], in [-pi/2, pi/2], positive towards the root
    float phi;    ///< azimuth [radians]
};

template <int Channels = 3>
struct Colour {
    float value[std::size_t(Channels)] = {};
    MEDULLA_FN float operator[](int c) const noexcept { return value[c]; }
    MEDULLA_FN float& operator[](int c) noexcept { return value[c]; }
};

/// An interval of offsets h [fibre radii], -1 <= low <= high <= 1; the whole fibre by default.
struct Offsets {
    float low = -1, high = 1;
};

/// The papers' angles of a direction, which need not be of unit length.
MEDULLA_FN Angles angles_of(Vector w) noexcept {
    return {detail::math::atan2(-w.x, detail::math::sqrt(w.y * w.y + w.z * w.z)), detail::math::atan2(w.z, w.y)};
}
MEDULLA_FN Vector direction_of(Angles a) noexcept {
    const float c = detail::math::cos(a.theta);
    return {-detail::math::sin(a.theta), c * detail::math::cos(a.phi), c * detail::math::sin(a.phi)};
}

/// Offset h of the ray along `known`: its distance from the fibre's axis, counted to the left of its direction of
/// travel in the cross-section. @param point any point of the ray, from the axis [fibre radii]
MEDULLA_FN float offset_of(Vector known, Vector point) noexcept {
    // Light that comes along `known` travels in (-y, -z); its left normal is (z, -y).
    return (known.z * point.y - known.y * point.z) / detail::math::sqrt(known.y * known.y + known.z * known.z);
}

/// Offsets that a round pixel covers (Eq. 27 of Yan et al. 2017), clamped to the fibre.
/// @param h offset of the pixel's centre  @param footprint diameter of the pixel at the hit [world units]
/// @param radius of the fibre [world units], > 0  @param cosine omega_fiber . omega_lookat, in practice that of the
///        angle between the camera's ray and its viewing axis
MEDULLA_FN Offsets pixel_coverage(float h, float footprint, float radius, float cosine) noexcept {
    const float half = 0.5f * detail::math::abs(cosine) * footprint / radius;
    const float low = h - half, high = h + half;
    return {low < -1 ? -1.0f : (low > 1 ? 1.0f : low), high > 1 ? 1.0f : (high < -1 ? -1.0f : high)};
}

namespace detail {

/// Below every cosine that a float angle within pi/2 has: the last, 1.57079625, has 7.5e-8, and the next lies 4.4e-8
/// beyond pi/2. It is the axis itself, where a fibre has no cross-section and lobes are 0.
inline constexpr float least_cosine = 4.3e-8f;

/// A direction taken apart: sine and cosine of its inclination, and the unit vector of its azimuth.
struct Polar {
    float sine = 0, cosine = 0;  ///< of theta; cosine 0: along the fibre, not finite, or no direction at all
    float y = 1, z = 0;
};
MEDULLA_HOT Polar polar_of(Vector w) noexcept {
    const float across2 = w.y * w.y + w.z * w.z, length2 = across2 + w.x * w.x;
    if (!within(length2, 1e30f) || !(length2 > 1e-30f)) return {};
    const float inverse = 1 / detail::math::sqrt(length2), across = detail::math::sqrt(across2),
                cosine = across * inverse;
    if (!(cosine > least_cosine)) return {};
    const float inverse_across = 1 / across;
    return {-w.x * inverse, cosine, w.y * inverse_across, w.z * inverse_across};
}
MEDULLA_FN Polar polar_of(Angles a) noexcept {
    if (!within(a.theta, float(pi / 2)) || !within(a.phi, 1e4f)) return {};
    const float cosine = detail::math::cos(a.theta);
    if (!(cosine > least_cosine)) return {};
    return {detail::math::sin(a.theta), cosine, detail::math::cos(a.phi), detail::math::sin(a.phi)};
}

/// A drawn direction's inclination, and its azimuth from the known one [radians].
MEDULLA_HOT Angles angles_between(const Polar& known, const Polar& drawn) noexcept {
    const float cosine = known.y * drawn.y + known.z * drawn.z, sine = known.y * drawn.z - known.z * drawn.y;
    const Four both = angle(Four(drawn.sine, sine, 0, 0), Four(drawn.cosine, magnitude(cosine), 1, 1));
    const float turn = lane(both, 1);
    return {lane(both, 0), cosine < 0 ? with_sign(float(pi), sine) - turn : turn};
}

/// Angle of the point (cosine, sine) of the unit circle [radians], in [-pi, pi].
MEDULLA_HOT float full_angle(float cosine, float sine) noexcept {
    const float a = angle(sine, magnitude(cosine));
    return cosine < 0 ? with_sign(float(pi), sine) - a : a;
}

/// Cosine of an inclination, never below least_cosine: exits at the axis itself have a density all the same.
MEDULLA_HOT float cosine_of(float theta) noexcept { return greater(polynomial::cosine(theta), least_cosine); }

/// Sine and cosine on the whole circle. @param x [radians], in [-pi, pi]
MEDULLA_HOT SineCosine<float> full_sine_cosine(float x) noexcept {
    const SineCosine<float> half = sine_cosine(0.5f * x);
    return {2 * half.sine * half.cosine, (half.cosine - half.sine) * (half.cosine + half.sine)};
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
