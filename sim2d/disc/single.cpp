#include "sim2d/disc/single.hpp"

#include <algorithm>
#include <cmath>

#include "sim2d/elementary.hpp"
#include "sim2d/quadrature.hpp"

namespace medulla::sim2d {
namespace {

/// sqrt(1 - h^2) without cancellation at |h| = 1.
double half_chord(double h) { return std::sqrt(std::max(0.0, (1 - h) * (1 + h))); }

/// Points x in [-half, half] along the chord with weights w exp(-sigma t) sigma / E: a rule for the first collision.
struct Collisions {
    std::vector<double> x, weight;
};

Collisions first_collision(double sigma, double h) {
    const double half = half_chord(h), tau = 2 * sigma * half;
    // u^2 (3 - 2 u) concentrates the points at both ends, where d has square-root branch points.
    static const Quadrature rule = unit_gauss_legendre(40);
    Collisions c;
    double sum = 0;
    for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
        const double u = rule.nodes[i], v = u * u * (3 - 2 * u);
        c.x.push_back((2 * v - 1) * half);
        c.weight.push_back(rule.weights[i] * 6 * u * (1 - u) * portable::exp(-tau * v));
        sum += c.weight.back();
    }
    // sum approximates (1 - exp(-tau)) / tau, so this divides by E / tau: also at tau = 0.
    for (double& w : c.weight) w /= sum;
    return c;
}

/// Mean over the first collision of value(place on the chord, distance d to the circle along phi).
template <class Value>
double mean_over(const Collisions& c, double h, double phi, Value&& value) {
    const double cosine = portable::cos(phi), sine = portable::sin(phi), half2 = (1 - h) * (1 + h);
    double sum = 0;
    for (std::size_t i = 0; i < c.x.size(); ++i) {
        const double along = c.x[i] * cosine + h * sine;
        const double inside = std::max(0.0, half2 - c.x[i] * c.x[i]);  // 1 - r^2
        const double root = std::sqrt(along * along + inside);
        const double d = along > 0 ? (root + along > 0 ? inside / (root + along) : 0.0) : root - along;
        sum += c.weight[i] * value(c.x[i], d);
    }
    return sum;
}

double escape(const Collisions& c, double sigma, double h, double phi) {
    return mean_over(c, h, phi, [&](double, double d) { return portable::exp(-sigma * d); });
}

/// Gauss points for the integral over phi of p times a smooth function, in a bin of this width. The integrand's nearest
/// singularity is the pole of p, at -log|g| from the real axis: r points converge like rho^-2r, rho = (pole +
/// sqrt(pole^2 + 1)) in units of half a bin. At least 2 points; error about 1e-8.
Quadrature rule_for(double g, double width) {
    const double pole = g == 0 ? 100 : std::min(100.0, -portable::log(std::abs(g)) * 2 / width);
    const double rho = pole + std::sqrt(pole * pole + 1);
    return unit_gauss_legendre(static_cast<int>(std::clamp(std::ceil(9.2 / portable::log(rho)), 2.0, 64.0)));
}

}  // namespace

double disc_energy(double sigma, double h) { return -portable::expm1(-2 * sigma * half_chord(h)); }

double disc_single_over_energy(double sigma, double g, double h, double phi) {
    return portable::planar_hg_pdf(phi, g) * escape(first_collision(sigma, h), sigma, h, phi);
}

std::vector<double> disc_single_lobe(double sigma, double g, double h, std::size_t bins) {
    const double width = 2 * pi / static_cast<double>(bins);
    const Quadrature rule = rule_for(g, width);
    const Collisions collisions = first_collision(sigma, h);
    std::vector<double> lobe(bins);
    for (std::size_t b = 0; b < bins; ++b) {
        double sum = 0;
        for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
            const double phi = -pi + (static_cast<double>(b) + rule.nodes[i]) * width;
            sum += rule.weights[i] * portable::planar_hg_pdf(phi, g) *
                   (sigma == 0 ? 1.0 : escape(collisions, sigma, h, phi));
        }
        lobe[b] = sum;
    }
    return lobe;
}

double disc_single_length(double sigma, double g, double h) {
    const int bins = 180;
    const double width = 2 * pi / bins, half = half_chord(h);
    const Quadrature rule = rule_for(g, width);
    const Collisions collisions = first_collision(sigma, h);
    double sum = 0;
    for (int b = 0; b < bins; ++b)
        for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
            const double phi = -pi + (b + rule.nodes[i]) * width;
            sum += rule.weights[i] * width * portable::planar_hg_pdf(phi, g) *
                   mean_over(collisions, h, phi,
                             [&](double x, double d) { return (x + half + d) * portable::exp(-sigma * d); });
        }
    return sum;
}

}  // namespace medulla::sim2d
