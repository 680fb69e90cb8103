#include "sim3d/model/escape.hpp"

#include <algorithm>
#include <cmath>

#include "medulla/config.hpp"
#include "sim2d/quadrature.hpp"

namespace medulla::sim3d {
namespace {

/// Reflectance from inside, of light that arrives at `cosine` to the normal.
double inside_reflectance(const Fibre& f, double cosine) {
    const double out2 = 1 - f.eta_c * f.eta_c * (1 - cosine * cosine);
    if (out2 <= 0) return 1;
    const double c = std::sqrt(out2), n = f.eta_c;
    const double s = (c - n * cosine) / (c + n * cosine), p = (n * c - cosine) / (n * c + cosine);
    const double F1 = s * s / (1 + s * s) + p * p / (1 + p * p);
    return f.layers * F1 / (1 + (f.layers - 1) * F1);
}

}  // namespace

double left_by_medulla(const Fibre& f) {
    const double tau = f.sigma_ms * f.kappa, narrow = 1 - f.g;
    const double path = f.kappa * (4 / 3.0 + tau * (1.431 + tau * 2.898)) / (1 + tau * (1.44 + tau * 1.449));
    return f.sigma_ms / (f.sigma_ms + f.sigma_ma) * std::exp(-std::log1p(path * f.sigma_ma * narrow) / narrow);
}

double escape(const Fibre& f, double sigma_ca) {
    constexpr int offsets = 32, inclinations = 24;  // in each zone: 1e-5
    const sim2d::Quadrature along = sim2d::unit_gauss_legendre(offsets), up = sim2d::unit_gauss_legendre(inclinations);
    const double kept = left_by_medulla(f), extinction = f.sigma_ms + f.sigma_ma;
    double out = 0, all = 0;
    const auto add = [&](double b, double theta, double weight) {
        const double cos_theta = std::cos(theta), cos_b = std::sqrt(1 - b * b),
                     half = std::sqrt(f.kappa * f.kappa - b * b);
        const double F = inside_reflectance(f, cos_theta * cos_b), chord = 2 * half / cos_theta;
        const double cortex = std::exp(-sigma_ca * (cos_b - half) / cos_theta),
                     collides = -std::expm1(-extinction * chord);
        const double share = weight * cos_theta * cos_theta * -std::expm1(-f.sigma_ms * chord) /
                             (1 - F * cortex * cortex * (1 - collides));
        out += share * (1 - F) * cortex, all += share * (1 - F * cortex * cortex * (1 - collides * (1 - kept)));
    };
    // Beyond the offset 1 / eta nothing is transmitted; at lesser ones, inclinations below the critical one are.
    const double edge = std::min(f.kappa, 1 / f.eta_c);
    const double zones[2][2] = {{0, std::asin(edge / f.kappa)}, {std::asin(edge / f.kappa), pi / 2}};
    for (const auto& [low, high] : zones)
        for (std::size_t i = 0; i < along.nodes.size() && high > low; ++i) {
            const double t = low + (high - low) * along.nodes[i], b = f.kappa * std::sin(t);
            const double weight = f.kappa * std::cos(t) * (high - low) * along.weights[i];
            const double critical = std::acos(std::min(1.0, std::sqrt((1 - 1 / (f.eta_c * f.eta_c)) / (1 - b * b))));
            for (std::size_t j = 0; j < up.nodes.size(); ++j) {
                const double u = up.nodes[j];  // dense at the critical angle, where F has a root
                add(b, critical * (1 - u * u), weight * critical * 2 * u * up.weights[j]);
                add(b, critical + (pi / 2 - critical) * u, weight * (pi / 2 - critical) * up.weights[j]);
            }
        }
    return all > 0 ? out / all : 0;
}

}  // namespace medulla::sim3d
