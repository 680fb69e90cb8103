// Closed forms of single scattering in the slab; every difference of exponentials is an expm1 of a difference.
#include "sim2d/slab/single.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "medulla/phase.hpp"
#include "sim2d/elementary.hpp"
#include "sim2d/quadrature.hpp"

namespace medulla::sim2d {
namespace {

/// (1 - exp(-x)) / x for x >= 0, 1 at 0 and 0 at infinity.
double mean_attenuation(double x) noexcept { return x > 0 ? -portable::expm1(-x) / x : 1.0; }

/// Mean of s on (0, x) under the weight exp(-s), x >= 0: x / 2 for small x, 1 at infinity.
double mean_flight(double x) noexcept {
    if (x > 1) {
        const double left = portable::exp(-x);
        return left > 0 ? 1 - x * left / (1 - left) : 1;  // infinity times 0 would be NaN
    }
    // 1 - (1 + x) exp(-x) = x^2 sum of (-x)^k / (k! (k + 2)), whose 17th term is below eps.
    double sum = 0, power = 1;
    for (int k = 0; k < 17; ++k) {
        sum += power / (k + 2);
        power *= -x / (k + 1);
    }
    return x * sum / mean_attenuation(x);
}

}  // namespace

double slab_cosine(double theta) noexcept {
    const double a = std::abs(theta);
    return a < pi / 2 ? portable::cos(a) : 0.0;
}

double slab_energy(double sigma, double theta_i) noexcept {
    return sigma > 0 ? -portable::expm1(-2 * sigma / slab_cosine(theta_i)) : 0.0;
}

double slab_back_factor(double depth, double mu_i, double mu_r) noexcept {
    if (!(depth > 0)) return 0;
    if (!(mu_i > 0)) return 1;  // enters along the surface: scatters at depth 0 and leaves unattenuated
    if (!(mu_r > 0)) return 0;
    return -portable::expm1(-depth / mu_r - depth / mu_i) / (1 + mu_i / mu_r);
}

double slab_forward_factor(double depth, double mu_i, double mu_r) noexcept {
    if (!(depth > 0) || !(mu_r > 0)) return 0;
    const double a = depth / mu_r, b = mu_i > 0 ? depth / mu_i : HUGE_VAL;
    if (!std::isfinite(a)) return 0;
    // b / (b - a) in terms of cosines where b is much larger than a, so that b may overflow.
    if (b > 2 * a) return -portable::exp(-a) * portable::expm1(a - b) / (1 - mu_i / mu_r);
    return b * portable::exp(-std::min(a, b)) * mean_attenuation(std::abs(b - a));
}

double slab_back_path(double depth, double mu_i, double mu_r) noexcept {
    return mu_i > 0 && mu_r > 0 ? mean_flight(depth / mu_r + depth / mu_i) : 1.0;
}

double slab_forward_path(double depth, double mu_i, double mu_r) noexcept {
    // Light travels (1 - u) depth at the cosine of the shorter way and u depth at the other; the weight of u is
    // exp(-|b - a| u).
    const double a = depth / mu_r, b = mu_i > 0 ? depth / mu_i : HUGE_VAL;
    return std::min(a, b) + mean_flight(std::abs(b - a));
}

double slab_single_back(double sigma, double g, double theta_i, double theta_r) noexcept {
    // p(pi - t; g) = p(t; -g): the difference theta_r - theta_i is accurate at the peak of g < 0.
    return portable::planar_hg_pdf(theta_r - theta_i, -g) *
           slab_back_factor(2 * sigma, slab_cosine(theta_i), slab_cosine(theta_r));
}

double slab_single_forward(double sigma, double g, double theta_i, double theta_r) noexcept {
    return portable::planar_hg_pdf(theta_r + theta_i, g) *
           slab_forward_factor(2 * sigma, slab_cosine(theta_i), slab_cosine(theta_r));
}

SlabSides slab_single_paths(double sigma, double g, double theta_i) {
    static const Quadrature rule = gauss_legendre(16);
    const double mu_i = slab_cosine(theta_i), depth = 2 * sigma, energy = slab_energy(sigma, theta_i);
    if (sigma < 1e-300 && mu_i > 0) {
        // Linear in log(sigma) there; subnormal numbers are too coarse to evaluate it.
        const SlabSides at = slab_single_paths(1e-300, g, theta_i), before = slab_single_paths(1e-290, g, theta_i);
        const double tens = (portable::log(1e-300) - portable::log(sigma)) / portable::log(1e10);
        return {at.back + tens * (at.back - before.back), at.forward + tens * (at.forward - before.forward)};
    }
    // Panel ends, as distances from grazing of theta_r >= 0 and theta_r <= 0. The smallest is 1e-3 of the scales of the
    // factors; below it a path times its factor vanishes linearly.
    const double least = 1e-3 * std::min({1.0, depth, mu_i > 0 ? mu_i : 1.0}), width = 1 - std::abs(g);
    SlabSides sides;
    for (const bool forward : {true, false}) {
        const double q = forward ? g : -g;
        // p(theta_r - turn; q) has its maximum at `turn` for q > 0, at turn -+ pi for q < 0.
        const double turn = forward ? std::abs(theta_i) : -std::abs(theta_i);
        for (const double sign : {1.0, -1.0}) {
            std::vector<double> ends{0};
            for (double d = pi / 2; d > least; d /= 4) ends.push_back(d);
            for (const double peak : {turn, turn - pi, turn + pi}) {
                if ((peak == turn) != (q >= 0)) continue;
                const double at = pi / 2 - sign * peak;  // may lie beyond either end
                for (double d = width; d < 4 * pi; d *= 4)
                    for (const double end : {at - d, at, at + d})
                        if (end > 0 && end < pi / 2) ends.push_back(end);
            }
            std::sort(ends.begin(), ends.end());
            for (std::size_t k = 1; k < ends.size(); ++k) {
                const double half = (ends[k] - ends[k - 1]) / 2, centre = (ends[k] + ends[k - 1]) / 2;
                for (std::size_t j = 0; half > 0 && j < rule.nodes.size(); ++j) {
                    const double grazing = centre + half * rule.nodes[j], mu_r = portable::sin(grazing);
                    const double p =
                        half * rule.weights[j] * portable::planar_hg_pdf(sign * (pi / 2 - grazing) - turn, q);
                    const double factor = (forward ? slab_forward_factor : slab_back_factor)(depth, mu_i, mu_r);
                    // Divide first: factor and path are of order sigma, and their product would underflow as sigma^2.
                    const double share = p * (factor / energy);
                    if (!(share > 0)) continue;
                    const double path = (forward ? slab_forward_path : slab_back_path)(depth, mu_i, mu_r);
                    (forward ? sides.forward : sides.back) += share * (path / sigma);
                }
            }
        }
    }
    return sides;
}

double planar_hg_integral(double a, double b, double g) noexcept {
    // The antiderivative is arg((1 - g) cos(t/2) + i (1 + g) sin(t/2)) / pi; the argument of a quotient has no branch.
    const double cross = (1 - g) * (1 + g) * portable::sin((b - a) / 2);
    const double dot = (1 - g) * (1 - g) * portable::cos(a / 2) * portable::cos(b / 2) +
                       (1 + g) * (1 + g) * portable::sin(a / 2) * portable::sin(b / 2);
    // b - a = 2 pi: sin is a rounding of 0 of either sign, the angle is pi.
    return portable::atan2(std::max(cross, 0.0), dot) / pi;
}

}  // namespace medulla::sim2d
