// Reference implementation of the BCSDF: double precision, standard library, directly from the formulas of
// docs/bcsdf.md. It shares nothing with the runtime except table lookups (contract + lobe).
#pragma once

#include <algorithm>
#include <cmath>

#include "medulla/fur_parameters.hpp"
#include "medulla/lookup.hpp"

namespace reference {

using namespace medulla;

struct Lobes {
    double M[lobe_count] = {}, N[lobe_count][3] = {};
};

/// Unpolarised sums as printed: R + (1-R)^2 R / (1-R^2), averaged over both polarisations, for an interface of
/// `index` at the angle of incidence gamma_i.
inline double cuticle_reflectance(double index, double gamma_i, double layers) {
    const double ci = std::cos(gamma_i), ct = std::sqrt(1 - std::pow(std::sin(gamma_i) / index, 2));
    double F1 = 0;
    const double r[2] = {(ci - index * ct) / (ci + index * ct), (index * ci - ct) / (index * ci + ct)};
    for (double x : r) {
        const double R = x * x;
        F1 += 0.5 * (R + (1 - R) * R / (1 + R));
    }
    return layers > 0 ? layers * F1 / (1 + (layers - 1) * F1) : 0;
}

inline double gaussian(double x, double s) { return std::exp(-x * x / (2 * s * s)) / (s * std::sqrt(2 * pi)); }

inline double truncated(double theta, double centre, double s) {
    const double r = std::sqrt(0.5) / s;
    const double mass = 0.5 * (std::erf((pi / 2 - centre) * r) - std::erf((-pi / 2 - centre) * r));
    return gaussian(theta - centre, s) / mass;
}

inline double wrapped(double x, double s) {
    double sum = 0;
    const double y = std::remainder(x, 2 * pi);
    for (int k = -20; k <= 20; ++k) sum += gaussian(y + 2 * pi * k, s);
    return sum;
}

inline Lobes near_lobes(const FurParameters<3>& p, const PackView& pack, double theta_i, double theta_r, double phi,
                        double h, bool with_scattered = true) {
    Lobes l;
    const double eta = double(p.eta), kappa = double(p.kappa);
    const double index = std::sqrt(eta * eta - std::pow(std::sin(theta_i), 2)) / std::cos(theta_i);
    const double cos_t = std::cos(std::asin(std::sin(theta_i) / eta));
    const double gamma_i = std::asin(h), gamma_t = std::asin(h / index), inside = h / index;
    const double s_m = std::sqrt(std::max(0.0, kappa * kappa - inside * inside)), s_c = std::cos(gamma_t) - s_m;
    const double F = p.fresnel == Fresnel::exact
                         ? cuticle_reflectance(eta, std::acos(std::cos(theta_i) * std::cos(gamma_i)), double(p.layers))
                         : cuticle_reflectance(index, gamma_i, double(p.layers));
    const double shift[3] = {1, -0.5, -1.5}, rough[3] = {1, 0.5, 1.5};
    for (int k = 0; k < 3; ++k)
        l.M[k] = truncated(theta_r, -theta_i + shift[k] * double(p.alpha), rough[k] * double(p.beta_m));
    const double ms = double(p.sigma_ms), ma = double(p.sigma_ma);
    const bool scattered = with_scattered && std::abs(inside) < kappa && ms > 0;
    const bool tabled = absorbs(pack);  // the tables include absorption in the medulla; else T_b does
    double C[3] = {}, M = 0;
    if (scattered) {
        const float sigma = float(ms * kappa / cos_t), side = h < 0 ? -1.0f : 1.0f;
        LobeQuery q;
        q.sigma = sigma, q.g = p.g, q.h = float(std::min(1.0, std::abs(inside) / kappa));
        if (tabled) q.absorption = float(ma * kappa / cos_t);
        const TableView& table = pack[TableKind::azimuthal];
        const double E = (1 - std::exp(-2 * s_m * ms / cos_t)) *
                         (tabled ? double(survival(pack, q.sigma, q.g, q.h, q.absorption)) : 1);
        for (int k = 1; k <= 2; ++k) {
            const double centre = (gamma_t - gamma_i) + (k - 1) * (pi + 2 * gamma_t);
            C[k] = E * double(lobe(table, contract_signed(table, q), side * float(phi - centre - pi)));
        }
        const double t = std::abs(std::remainder(phi, 2 * pi)) / pi;
        M = (1 - t) * double(longitudinal(pack, Side::back, sigma, p.g, float(theta_i), float(theta_r))) +
            t * double(longitudinal(pack, Side::forward, sigma, p.g, float(theta_i), float(theta_r)));
    }
    l.M[3] = l.M[4] = M;
    for (int c = 0; c < 3; ++c) {
        const double ca = double(p.sigma_ca[c]);
        const double T_b = std::exp(-((tabled ? 0 : kappa * ma) + (1 - kappa) * ca) / cos_t);
        for (int k = 0; k < 3; ++k) {
            const double A = k == 0 ? F
                                    : std::pow(1 - F, 2) * std::pow(F, k - 1) *
                                          std::exp(-2 * k * (s_c * ca + s_m * (ma + ms)) / cos_t);
            l.N[k][c] =
                A * wrapped(phi - (2 * k * gamma_t - 2 * gamma_i + k * pi), std::sqrt(k + 1.0) * double(p.beta_n));
        }
        for (int k = 1; k <= 2; ++k)
            l.N[k + 2][c] = (1 - F) * std::pow(F, k - 1) *
                            std::exp(-((2 * k - 1) * s_c * ca + 2 * (k - 1) * s_m * (ma + ms)) / cos_t) * T_b * C[k];
    }
    return l;
}

}  // namespace reference
