// Directions in the fibre's frame and a pixel's coverage of the fibre: what lies between a renderer's vectors and
// (theta, phi, h). Rests on the frame at the top of medulla.hpp and on Eq. 27 of Yan et al. 2017.
#pragma once

#include <cmath>

#include "medulla/config.hpp"
#include "medulla/far_field.hpp"
#include "medulla/near_field.hpp"
#include "medulla/sampling.hpp"

namespace medulla {

/// A unit vector in the fibre's frame: x along the fibre from tip to root, (y, z) the cross-section.
template <class T = float>
struct Vector {
    T x, y, z;
};

template <class T = float>
struct Angles {
    T theta;  ///< inclination [radians], in [-pi/2, pi/2]
    T phi;    ///< azimuth [radians], in [-pi, pi]
};

/// theta from both its sine and its cosine, so that neither end loses digits.
template <class T>
MEDULLA_FN Angles<T> angles_of(Vector<T> w) noexcept {
    return {std::atan2(w.x, std::sqrt(w.y * w.y + w.z * w.z)), std::atan2(w.z, w.y)};
}

template <class T>
MEDULLA_FN Vector<T> direction_of(Angles<T> a) noexcept {
    const T c = std::cos(a.theta);
    return {std::sin(a.theta), c * std::cos(a.phi), c * std::sin(a.phi)};
}

/// Offset h of a ray that comes from direction `w` and passes the fibre's axis at `point` (any point of the ray, in
/// fibre radii from the axis): the left normal of its travel direction -w in the cross-section, times the point.
template <class T>
MEDULLA_FN T offset_of(Vector<T> w, Vector<T> point) noexcept {
    // Travel direction (-y, -z); its left normal (z, -y).
    return (w.z * point.y - w.y * point.z) / std::sqrt(w.y * w.y + w.z * w.z);
}

/// Offsets that a round pixel covers (Eq. 27), clamped to the fibre.
/// @param h offset of the pixel's centre  @param footprint diameter of the pixel at the hit point [world units]
/// @param radius of the fibre [world units], > 0  @param cosine omega_fiber . omega_lookat, in practice that of the
///        angle between the camera's ray and its viewing axis
MEDULLA_FN OffsetRange pixel_coverage(float h, float footprint, float radius, float cosine) noexcept {
    const float half = 0.5f * std::abs(cosine) * footprint / radius;
    const float low = h - half, high = h + half;
    return {low < -1 ? -1.0f : (low > 1 ? 1.0f : low), high > 1 ? 1.0f : (high < -1 ? -1.0f : high)};
}

namespace detail {

template <int Channels>
MEDULLA_FN Colour<Channels> solid_angle_density(const LobeValues<Channels>& lobes, float theta_r) noexcept {
    Colour<Channels> sum = angular_density(lobes);
    for (float& value : sum.value) value = solid_angle_density(value, theta_r);
    return sum;
}

}  // namespace detail

/// S of Eq. 12 from directions: omega_i, omega_r and the offset h of the ray along omega_i.
template <int Channels>
MEDULLA_FN Colour<Channels> eval(const FurFibre<Channels>& fibre, Vector<float> omega_i, Vector<float> omega_r,
                                 float h) noexcept {
    const Angles<float> i = angles_of(omega_i), r = angles_of(omega_r);
    return eval(fibre, i.theta, r.theta, r.phi - i.phi, h);
}

/// S of Eq. 12 from directions, averaged over offsets.
template <int Channels>
MEDULLA_FN Colour<Channels> eval(const FurFibre<Channels>& fibre, Vector<float> omega_i, Vector<float> omega_r,
                                 OffsetRange range) noexcept {
    const Angles<float> i = angles_of(omega_i), r = angles_of(omega_r);
    return eval(fibre, i.theta, r.theta, r.phi - i.phi, range);
}

/// Energy per steradian about an exit of a unit of light along omega_i: sum M N / cos theta_r = S cos^2 theta_i / cos
/// theta_r. Its integral over omega_r is the albedo; over a sampler's pdf it is a sample's weight. It is what
/// multiplies the radiance of a light at omega_r where omega_i is the camera's ray (next-event estimation).
template <int Channels>
MEDULLA_FN Colour<Channels> density(const NearField<Channels>& near, float theta_r, float phi) noexcept {
    return detail::solid_angle_density(near.lobes(theta_r, phi), theta_r);
}
template <int Channels>
MEDULLA_FN Colour<Channels> density(const FarField<Channels>& far, float theta_r, float phi) noexcept {
    return detail::solid_angle_density(far.lobes(theta_r, phi), theta_r);
}
/// The same from directions and the offset h of the ray along omega_i.
template <int Channels>
MEDULLA_FN Colour<Channels> density(const FurFibre<Channels>& fibre, Vector<float> omega_i, Vector<float> omega_r,
                                    float h) noexcept {
    const Angles<float> i = angles_of(omega_i), r = angles_of(omega_r);
    NearField<Channels> near;
    near_field(fibre, i.theta, h, near);
    return density(near, r.theta, r.phi - i.phi);
}
/// The same averaged over offsets.
template <int Channels>
MEDULLA_FN Colour<Channels> density(const FurFibre<Channels>& fibre, Vector<float> omega_i, Vector<float> omega_r,
                                    OffsetRange range) noexcept {
    const Angles<float> i = angles_of(omega_i), r = angles_of(omega_r);
    FarField<Channels> far;
    far_field(fibre, i.theta, range, far);
    return density(far, r.theta, r.phi - i.phi);
}

/// Density per steradian of omega_r. @param sampler a NearSampler or FarSampler prepared at omega_i's inclination
template <class Sampler>
MEDULLA_FN float pdf(const Sampler& sampler, Vector<float> omega_i, Vector<float> omega_r) noexcept {
    const Angles<float> i = angles_of(omega_i), r = angles_of(omega_r);
    return sampler.pdf(r.theta, r.phi - i.phi);
}

/// omega_r of a sample that was drawn for omega_i.
template <int Channels>
MEDULLA_FN Vector<float> direction_of(const FurSample<Channels>& sample, Vector<float> omega_i) noexcept {
    return direction_of(Angles<float>{sample.theta_r, sample.phi + angles_of(omega_i).phi});
}

}  // namespace medulla
