// A substitute for the simulated disc table: single scattering in a homogeneous disc, every lobe normalised.
// Needs quadrature only, so that benchmarks and tests of tensor/ need no simulation.
#pragma once

#include <array>
#include <cmath>

#include "medulla/phase.hpp"
#include "tensor/dense.hpp"

namespace medulla::tensor {

/// value(sigma, g, h, phi): light that enters a unit disc at offset h is scattered once, by a planar Henyey-Greenstein
/// angle phi, and leaves. Graded axes sigma = 16 u^2, g = 0.95 (1 - (1-u)^1.5), h = sin(pi u / 2), u at cell centres
/// (at sigma = 0 and h = 1 there is nothing to normalise); phi at the centres of equal bins.
inline Tensor single_scattering_table(std::size_t sigmas, std::size_t gs, std::size_t hs, std::size_t bins) {
    constexpr int nodes = 64;  // midpoints along the chord
    const auto u = [](std::size_t i, std::size_t n) { return (static_cast<double>(i) + 0.5) / static_cast<double>(n); };
    Tensor table({sigmas, gs, hs, bins});
    // mean over the chord of exp(-sigma (t + d(t, h, phi))), t into the disc, d out of it
    for (std::size_t k = 0; k < hs; ++k)
        for (std::size_t l = 0; l < bins; ++l) {
            const double h = std::sin(pi / 2 * u(k, hs)), phi = 2 * pi * u(l, bins);
            const double half = std::sqrt(1 - h * h);
            std::array<double, nodes> path;
            for (int q = 0; q < nodes; ++q) {
                const double t = (q + 0.5) / nodes * 2 * half, x = t - half;
                const double b = x * std::cos(phi) + h * std::sin(phi);
                path[static_cast<std::size_t>(q)] = t - b + std::sqrt(std::max(0.0, b * b - (x * x + h * h - 1)));
            }
            for (std::size_t i = 0; i < sigmas; ++i) {
                const double sigma = 16 * u(i, sigmas) * u(i, sigmas);
                double sum = 0;
                for (double s : path) sum += std::exp(-sigma * s);
                for (std::size_t j = 0; j < gs; ++j) {
                    const double g = 0.95 * (1 - std::pow(1 - u(j, gs), 1.5));
                    table({i, j, k, l}) = planar_hg_pdf(phi, g) * sum / nodes;
                }
            }
        }
    for (std::size_t lobe = 0; lobe < table.size(); lobe += bins) {
        double sum = 0;
        for (std::size_t l = 0; l < bins; ++l) sum += table.values[lobe + l];
        for (std::size_t l = 0; l < bins; ++l) table.values[lobe + l] *= static_cast<double>(bins) / (2 * pi * sum);
    }
    return table;
}

}  // namespace medulla::tensor
