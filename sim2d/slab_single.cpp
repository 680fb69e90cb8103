// Closed forms of single scattering in the slab; every difference of exponentials is an expm1 of a difference.
#include "sim2d/slab_single.hpp"

#include <algorithm>
#include <cmath>

#include "medulla/phase.hpp"
#include "sim2d/elementary.hpp"

namespace medulla::sim2d {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// (1 - exp(-x)) / x for x >= 0, 1 at 0 and 0 at infinity.
double mean_attenuation(double x) noexcept { return x > 0 ? -portable::expm1(-x) / x : 1.0; }

}  // namespace

double slab_cosine(double theta) noexcept {
    const double a = std::abs(theta);
    return a < kPi / 2 ? portable::cos(a) : 0.0;
}

double slab_energy(double sigma, double theta_i) noexcept {
    return sigma > 0 ? -portable::expm1(-2 * sigma / slab_cosine(theta_i)) : 0.0;
}

double slab_back_factor(double depth, double mu_i, double mu_r) noexcept {
    if (!(depth > 0)) return 0;
    if (!(mu_i > 0)) return 1;  // enters along the surface: scatters at depth 0 and leaves unhindered
    if (!(mu_r > 0)) return 0;
    return -portable::expm1(-depth / mu_r - depth / mu_i) / (1 + mu_i / mu_r);
}

double slab_forward_factor(double depth, double mu_i, double mu_r) noexcept {
    if (!(depth > 0) || !(mu_r > 0)) return 0;
    const double a = depth / mu_r, b = mu_i > 0 ? depth / mu_i : HUGE_VAL;
    if (!std::isfinite(a)) return 0;
    // b / (b - a) in cosines where b is far above a, so that it keeps its value as b grows beyond all doubles.
    if (b > 2 * a) return -portable::exp(-a) * portable::expm1(a - b) / (1 - mu_i / mu_r);
    return b * portable::exp(-std::min(a, b)) * mean_attenuation(std::abs(b - a));
}

double slab_single_back(double sigma, double g, double theta_i, double theta_r) noexcept {
    // p(pi - t; g) = p(t; -g): the difference theta_r - theta_i keeps its digits at the peak of g < 0.
    return portable::planar_hg_pdf(theta_r - theta_i, -g) *
           slab_back_factor(2 * sigma, slab_cosine(theta_i), slab_cosine(theta_r));
}

double slab_single_forward(double sigma, double g, double theta_i, double theta_r) noexcept {
    return portable::planar_hg_pdf(theta_r + theta_i, g) *
           slab_forward_factor(2 * sigma, slab_cosine(theta_i), slab_cosine(theta_r));
}

double planar_hg_integral(double a, double b, double g) noexcept {
    // The antiderivative is arg((1 - g) cos(t/2) + i (1 + g) sin(t/2)) / pi; the argument of a quotient has no branch.
    const double cross = (1 - g) * (1 + g) * portable::sin((b - a) / 2);
    const double dot = (1 - g) * (1 - g) * portable::cos(a / 2) * portable::cos(b / 2) +
                       (1 + g) * (1 + g) * portable::sin(a / 2) * portable::sin(b / 2);
    // b - a = 2 pi: sin is a rounding of 0 of either sign, the angle is pi.
    return portable::atan2(std::max(cross, 0.0), dot) / kPi;
}

}  // namespace medulla::sim2d
