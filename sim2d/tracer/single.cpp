#include "sim2d/tracer/single.hpp"

#include <algorithm>
#include <cmath>

#include "medulla/phase.hpp"
#include "sim2d/quadrature.hpp"
#include "sim2d/slab/single.hpp"

namespace medulla::sim2d {
namespace {

/// 1 - (1 + a) exp(-a) for a >= 0, by its series where that cancels.
double second_moment(double a) {
    if (a > 0.5) return std::isinf(a) ? 1.0 : -std::expm1(-a) - a * std::exp(-a);
    // sum over k >= 2 of (-1)^k (k - 1) / k! a^k
    double term = 1, sum = 0;
    for (int k = 1; k <= 18; ++k) {
        term *= -a / k;
        sum += (k - 1) * term;
    }
    return sum;
}

/// Path length times energy that leaves on the side of the light: integral of L exp(-sigma L) sigma / mu_i dx over the
/// depth, L = x (1 / mu_i + 1 / mu_r).
double back_moment(double sigma, double mu_i, double mu_r) {
    if (!(mu_r > 0)) return 0;
    return second_moment(2 * sigma * (mu_i > 0 ? 1 / mu_i + 1 / mu_r : HUGE_VAL)) / (sigma * (1 + mu_i / mu_r));
}

/// The same through the far side: L runs from 2 / mu_r at the lit face to 2 / mu_i at the far one.
double forward_moment(double sigma, double mu_i, double mu_r) {
    if (!(mu_r > 0)) return 0;
    const double a = 2 / mu_r, b = mu_i > 0 ? 2 / mu_i : HUGE_VAL;
    if (std::isinf(b)) return a * std::exp(-sigma * a);  // everything scatters at the face
    static const Quadrature rule = unit_gauss_legendre(12);
    if (sigma * std::abs(b - a) < 2) {
        double sum = 0;
        for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
            const double length = a + (b - a) * rule.nodes[i];
            sum += rule.weights[i] * length * std::exp(-sigma * length);
        }
        return sigma * b * sum;
    }
    const auto primitive = [&](double length) { return -(length + 1 / sigma) * std::exp(-sigma * length); };
    return (primitive(b) - primitive(a)) / (1 - a / b);
}

}  // namespace

SlabSingle slab_single_lobes(double sigma, double g, double theta_i, std::size_t bins) {
    // Points per bin: as in disc_single_lobe from the pole of p. Near grazing the path factors vary on a scale of their
    // own, so u^2 (3 - 2 u) concentrates the points at both ends of the bin.
    const double width = pi / static_cast<double>(bins);
    const double pole = g == 0 ? 100 : std::min(100.0, -std::log(std::abs(g)) * 2 / width);
    const double rho = pole + std::sqrt(pole * pole + 1);
    const int count = static_cast<int>(std::clamp(std::ceil(9.2 / std::log(rho)), 2.0, 64.0));
    const Quadrature plain = unit_gauss_legendre(std::max(count, bins < 90 ? 24 : 2));
    const Quadrature graded = unit_gauss_legendre(std::max(count, 32));
    const double mu_i = slab_cosine(theta_i), energy = slab_energy(sigma, theta_i);
    SlabSingle out;
    out.back.assign(bins, 0.0), out.forward.assign(bins, 0.0);
    for (std::size_t b = 0; b < bins; ++b) {
        const double low = -pi / 2 + static_cast<double>(b) * width;
        const bool grazing = std::min(low + pi / 2, pi / 2 - low - width) < 0.1;
        const Quadrature& rule = grazing ? graded : plain;
        for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
            const double u = rule.nodes[i];
            const double theta_r = low + width * (grazing ? u * u * (3 - 2 * u) : u);
            const double weight = rule.weights[i] * (grazing ? 6 * u * (1 - u) : 1.0) / energy;
            out.back[b] += weight * slab_single_back(sigma, g, theta_i, theta_r);
            out.forward[b] += weight * slab_single_forward(sigma, g, theta_i, theta_r);
            const double mu_r = slab_cosine(theta_r);
            out.back_length += weight * width * planar_hg_pdf(theta_r - theta_i, -g) * back_moment(sigma, mu_i, mu_r);
            out.forward_length +=
                weight * width * planar_hg_pdf(theta_r + theta_i, g) * forward_moment(sigma, mu_i, mu_r);
        }
    }
    return out;
}

}  // namespace medulla::sim2d
