// Planar Henyey-Greenstein phase function: pdf, sample, invert. docs/physics.md, section 1.
#pragma once

#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// A direction in the plane as a unit complex number x + iy.
template <class T>
struct Direction {
    T x, y;
};

/// The direction turned by the angle of `b` (product of unit complex numbers).
template <class T>
MEDULLA_FN constexpr Direction<T> rotate(Direction<T> a, Direction<T> b) noexcept {
    return {a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x};
}

/// p(t; g) = (1 - g^2) / (2 pi (1 + g^2 - 2 g cos t)), density per radian over (-pi, pi].
/// @param t scattering angle [radians]; the sine of its half keeps the peak's digits as g -> 1.
/// @param g mean cosine, in (-1, 1)
template <class T>
MEDULLA_FN T planar_hg_pdf(T t, T g) noexcept {
    // 1 + g^2 - 2 g cos t = (1 - g)^2 + 4 g sin^2(t/2): no cancellation near t = 0. For g < 0 the mirrored form.
    const T half = g < T(0) ? detail::math::cos(t / T(2)) : detail::math::sin(t / T(2));
    const T a = g < T(0) ? -g : g;
    const T d = T(1) - a;
    return d * (T(1) + a) / (T(2 * pi) * (d * d + T(4) * a * half * half));
}

/// Moebius form w = (z + g) / (1 + g z): for z uniform on the unit circle, arg w has density p(t; g).
template <class T>
MEDULLA_FN Direction<T> sample_planar_hg(Direction<T> uniform, T g) noexcept {
    // |1 + g z|^2 = 1 + g^2 + 2 g x >= (1 - |g|)^2 > 0, so the quotient exists for every g in (-1, 1).
    const T dx = T(1) + g * uniform.x, dy = g * uniform.y;
    const T nx = uniform.x + g, ny = uniform.y;
    const T n = T(1) / (dx * dx + dy * dy);
    return {(nx * dx + ny * dy) * n, (ny * dx - nx * dy) * n};
}

/// The uniform direction that sample_planar_hg turns into `scattered`: z = (w - g) / (1 - g w).
template <class T>
MEDULLA_FN Direction<T> invert_planar_hg(Direction<T> scattered, T g) noexcept {
    return sample_planar_hg(scattered, -g);
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
