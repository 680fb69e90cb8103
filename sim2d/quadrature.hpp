// Gauss-Legendre rules of any order, by Newton's method on the Legendre recurrence (Numerical Recipes 4.6).
// The runtime's gauss_legendre.hpp stores four of them as float constants, since it must not compute any.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "sim2d/elementary.hpp"

namespace medulla::sim2d {

struct Quadrature {
    std::vector<double> nodes, weights;
};

/// The n-point Gauss-Legendre rule on (-1, 1), nodes ascending; the weights sum to 2.
inline Quadrature gauss_legendre(std::size_t n) {
    Quadrature rule{std::vector<double>(n), std::vector<double>(n)};
    for (std::size_t i = 0; i < (n + 1) / 2; ++i) {
        double x = portable::cos(pi * (double(i) + 0.75) / (double(n) + 0.5)), slope = 1;
        for (int iteration = 0; iteration < 100; ++iteration) {
            double p = 1, previous = 0;
            for (std::size_t k = 1; k <= n; ++k) {
                const double next = ((2 * double(k) - 1) * x * p - (double(k) - 1) * previous) / double(k);
                previous = p;
                p = next;
            }
            slope = double(n) * (previous - x * p) / ((1 - x) * (1 + x));
            const double step = p / slope;
            x -= step;
            if (std::abs(step) < 1e-15) break;
        }
        if (n % 2 == 1 && i == n / 2) x = 0;
        rule.nodes[i] = -x;
        rule.nodes[n - 1 - i] = x;
        rule.weights[i] = rule.weights[n - 1 - i] = 2 / ((1 - x) * (1 + x) * slope * slope);
    }
    return rule;
}

/// The same rule on (0, 1); the weights sum to 1.
inline Quadrature unit_gauss_legendre(int count) {
    Quadrature rule = gauss_legendre(static_cast<std::size_t>(count));
    for (double& x : rule.nodes) x = 0.5 * (1 + x);
    for (double& w : rule.weights) w *= 0.5;
    return rule;
}

}  // namespace medulla::sim2d
