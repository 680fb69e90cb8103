// The five lobes of Yan et al. 2017 in the far field, in double precision and straight from the paper (with the errata
// of docs/bcsdf.md), C^N and C^M from the noise-free solvers: the model itself, without tables, factors or runtime.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "medulla/config.hpp"
#include "medulla/fur_parameters.hpp"
#include "sim2d/disc/deterministic.hpp"
#include "sim2d/quadrature.hpp"
#include "sim2d/slab/deterministic.hpp"
#include "sim3d/fibre_profile.hpp"

namespace medulla::bench {

/// A preset of Table 4 as a fibre in three dimensions.
inline sim3d::Fibre fibre_of(const FurPreset& p) {
    const double degree = pi / 180;
    sim3d::Fibre f;
    f.eta_c = double(p.eta), f.kappa = double(p.kappa), f.layers = double(p.layers), f.g = double(p.g);
    f.alpha = double(p.alpha) * degree, f.beta_m = double(p.beta_m) * degree, f.beta_n = double(p.beta_n) * degree;
    f.sigma_ca = {double(p.sigma_ca)}, f.sigma_ma = double(p.sigma_ma), f.sigma_ms = double(p.sigma_ms);
    return f;
}

/// What M^s is made of.
enum class Longitudinal {
    house,         ///< C^M at sigma_ms kappa / cos theta_t: docs/bcsdf.md
    authors,       ///< C^M at sigma_ms kappa: the authors' plug-in
    house_cosine,  ///< either times cos theta_r, each side over its integral: a cylinder's exits per solid angle
    authors_cosine,
};
inline constexpr int longitudinal_count = 4;

struct PublishedModel {
    double energy[5] = {};                                    ///< R, TT, TRT, TTs, TRTs
    sim3d::DirectionalDensity scattered[longitudinal_count];  ///< of TTs and TRTs
};

/// The lobes of one offset, or without one their mean over all offsets; averaged over bins. One channel.
inline PublishedModel published_model(const sim3d::Fibre& f, double theta_i, std::optional<double> only_h,
                                      std::size_t theta_bins, std::size_t phi_bins) {
    const double eta = f.eta_c, kappa = f.kappa, ci = std::cos(theta_i);
    const double prime = std::sqrt(eta * eta - std::pow(std::sin(theta_i), 2)) / ci;
    const double cos_t = std::sqrt(1 - std::pow(std::sin(theta_i) / eta, 2)), ca = f.sigma_ca[0];
    const auto reflectance = [&](double c) {  // both polarisations of eta' at gamma_i, as Eq. 13 prints it
        const double ct = std::sqrt(prime * prime - 1 + c * c);
        const double s = (c - ct) / (c + ct), p = (prime * prime * c - ct) / (prime * prime * c + ct);
        const double F1 = s * s / (1 + s * s) + p * p / (1 + p * p);
        return f.layers * F1 / (1 + (f.layers - 1) * F1);
    };
    PublishedModel m;
    const sim2d::GaussRule rule = sim2d::unit_gauss_rule(48);
    const double T_b = std::exp(-(kappa * f.sigma_ma + (1 - kappa) * ca) / cos_t);
    const auto energies = [&](double h, double A[5]) {
        const double F = reflectance(std::sqrt(1 - h * h)), inside = h / prime;
        const double s_m = std::sqrt(std::max(0.0, kappa * kappa - inside * inside));
        const double s_c = std::sqrt(1 - inside * inside) - s_m;
        const double left = std::exp(-2 * (s_c * ca + s_m * (f.sigma_ma + f.sigma_ms)) / cos_t);
        A[0] = F, A[1] = (1 - F) * (1 - F) * left, A[2] = A[1] * F * left;
        A[3] = (1 - F) * std::exp(-s_c * ca / cos_t) * T_b * -std::expm1(-2 * s_m * f.sigma_ms / cos_t);
        A[4] = A[3] * F * left;
    };
    std::vector<double> h, weight;
    if (only_h) {
        h = {*only_h}, weight = {1};
    } else {
        // h = sin t takes the roots at the rim away; the medulla's edge splits the range.
        const double edge = kappa * prime < 1 ? std::asin(kappa * prime) : pi / 2;
        for (const auto& [low, high] : {std::pair{0.0, edge}, std::pair{edge, pi / 2}})
            for (std::size_t i = 0; i < rule.nodes.size() && high > low; ++i) {
                const double u = rule.nodes[i], t = low + (high - low) * (high < pi / 2 ? 1 - (1 - u) * (1 - u) : u);
                const double slope = high < pi / 2 ? 2 * (1 - u) : 1;
                h.push_back(std::sin(t)), weight.push_back(std::cos(t) * (high - low) * slope * rule.weights[i]);
            }
    }
    for (sim3d::DirectionalDensity& d : m.scattered) {
        d.theta_bins = theta_bins, d.phi_bins = phi_bins;
        d.value.assign(theta_bins * phi_bins, 0.0);
    }
    const std::size_t fine = 1440;
    std::vector<double> N(fine, 0.0);
    const double sigma = f.sigma_ms * kappa / cos_t;
    std::vector<double> offsets;
    for (const double x : h)
        if (std::abs(x) < kappa * prime) offsets.push_back(x / prime / kappa);
    std::vector<sim2d::Profile> lobes;
    if (sigma > 0 && !offsets.empty()) lobes = sim2d::DiscSolver(f.g).solve(sigma, offsets, fine);
    for (std::size_t i = 0; i < h.size(); ++i) {
        double A[5];
        energies(h[i], A);
        for (int k = 0; k < 5; ++k) m.energy[k] += weight[i] * (k < 3 || i < offsets.size() ? A[k] : 0);
        if (i >= lobes.size()) continue;
        const double gamma_i = std::asin(h[i]), gamma_t = std::asin(h[i] / prime);
        for (int p = 1; p <= 2; ++p) {
            const double centre = gamma_t - gamma_i + (p - 1) * (pi + 2 * gamma_t) + pi;
            const double shift = centre / (2 * pi) * double(fine), whole = std::floor(shift), part = shift - whole;
            for (std::size_t b = 0; b < fine; ++b) {
                const auto to = [&](double step) {
                    const auto n = static_cast<long>(fine);
                    return static_cast<std::size_t>(((static_cast<long>(b) + static_cast<long>(whole + step)) % n + n) %
                                                    n);
                };
                const double value = weight[i] * A[2 + p] * lobes[i].lobe[b];
                N[to(0)] += value * (1 - part), N[to(1)] += value * part;
            }
        }
    }
    if (lobes.empty()) return m;
    if (!only_h)  // the other sign of h
        for (std::size_t b = 0; b < fine / 2; ++b) N[b] = N[fine - 1 - b] = 0.5 * (N[b] + N[fine - 1 - b]);
    const std::size_t per_bin = 8;
    std::vector<double> M[longitudinal_count][2];  // by side: back, forward
    const sim2d::SlabSolver slab_solver(f.g);
    for (const int authors : {0, 1}) {
        const double depth = authors ? f.sigma_ms * kappa : sigma;
        const auto slab = slab_solver.solve(depth, {theta_i}, theta_bins * per_bin)[0];
        for (const int side : {0, 1}) {
            const std::vector<double>& lobe = (side == 0 ? slab.back : slab.forward).lobe;
            std::vector<double> plain(theta_bins, 0.0), cosine(theta_bins, 0.0);
            double sum = 0, cosine_sum = 0;
            for (std::size_t i = 0; i < lobe.size(); ++i) {
                const double c = std::cos(((double(i) + 0.5) / double(lobe.size()) - 0.5) * pi);
                plain[i / per_bin] += lobe[i], cosine[i / per_bin] += lobe[i] * c;
                sum += lobe[i], cosine_sum += lobe[i] * c;
            }
            for (double& x : plain) x /= sum * pi / double(theta_bins);
            for (double& x : cosine) x /= cosine_sum * pi / double(theta_bins);
            M[authors][side] = std::move(plain), M[2 + authors][side] = std::move(cosine);
        }
    }
    for (std::size_t t = 0; t < theta_bins; ++t)
        for (std::size_t b = 0; b < fine; ++b) {
            const double phi = std::abs(((double(b) + 0.5) / double(fine) - 0.5) * 2 * pi), forward = phi / pi;
            const std::size_t bin = t * phi_bins + b * phi_bins / fine;
            const double share = N[b] * double(phi_bins) / double(fine);
            for (int k = 0; k < longitudinal_count; ++k)
                m.scattered[k].value[bin] += share * ((1 - forward) * M[k][0][t] + forward * M[k][1][t]);
        }
    return m;
}

}  // namespace medulla::bench
