// The unscattered lobes R, TT and TRT of one offset for any scalar: double, or a number that carries its derivatives.
// Rests on cross_section.hpp and gaussian.hpp; for T = float it is what NearField gives for these lobes.
//
// T has + - * / and unary minus, < > <= >=, is made from a double, and sqrt, exp, expm1, erf, erfc, sin, cos, atan2 and
// floor are found by its arguments' namespace. docs/bcsdf.md, 'Other scalars'.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/detail/gaussian.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/fur_parameters.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

template <int Channels = 3, class T = float>
struct UnscatteredLobes {
    T M[3];                         ///< longitudinal density of R, TT, TRT [1 / radian]
    T N[3][std::size_t(Channels)];  ///< azimuthal density times energy [1 / radian]
};

/// @param p inside the ranges of FurParameters (out_of_range() tests those of float)
/// @param theta_i, theta_r [radians], in (-pi/2, pi/2)  @param phi [radians]  @param h offset [fibre radii], in [-1, 1]
template <int Channels, class T>
MEDULLA_FN UnscatteredLobes<Channels, T> unscattered_lobes(const FurParameters<Channels, T>& p, T theta_i, T theta_r,
                                                           T phi, T h) noexcept {
    using detail::math::cos;
    using namespace detail;
    const Inclination<T> at = inclination(p.eta, cos(theta_i), p.fresnel);
    const Path<T> path = trace(at, p.kappa, p.layers, h, square_root((T(1) - h) * (T(1) + h)));
    const auto energy = energies(path, absorption(p, at.inverse_cos_t), false);
    const double shift[3] = {1, -0.5, -1.5}, rough[3] = {1, 0.5, 1.5};   // Table 2
    const double root[3] = {1, 1.4142135623730951, 1.7320508075688772};  // sqrt(p + 1), Eq. 16
    UnscatteredLobes<Channels, T> lobes;
    for (int k = 0; k < 3; ++k) {
        lobes.M[k] = truncated_gaussian(T(shift[k]) * p.alpha - theta_i, T(rough[k]) * p.beta_m).pdf(theta_r);
        const T D =
            wrapped_gaussian(T(root[k]) * p.beta_n).pdf(phi - unscattered_centre(k, path.gamma_i, path.gamma_t));
        for (int c = 0; c < Channels; ++c) lobes.N[k][c] = energy.A[k][c] * D;
    }
    return lobes;
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
