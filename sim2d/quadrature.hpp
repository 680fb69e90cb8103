// Gauss-Legendre rules of any order, by Newton's method on the Legendre recurrence (Numerical Recipes 4.6).
// (The runtime's gauss_legendre.hpp holds four rules in float as constants: it must not compute any.)
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "sim2d/elementary.hpp"

namespace medulla::sim2d {

/// Nodes in (-1, 1), ascending, and weights of the n-point Gauss-Legendre rule.
struct GaussLegendre {
    std::vector<double> node, weight;
};

inline GaussLegendre gauss_legendre(std::size_t n) {
    const double pi = 3.14159265358979323846;
    GaussLegendre rule{std::vector<double>(n), std::vector<double>(n)};
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
        rule.node[i] = -x;
        rule.node[n - 1 - i] = x;
        rule.weight[i] = rule.weight[n - 1 - i] = 2 / ((1 - x) * (1 + x) * slope * slope);
    }
    return rule;
}

/// Nodes and weights on [0, 1]; the weights sum to 1.
struct GaussRule {
    std::vector<double> nodes, weights;
};

inline GaussRule unit_gauss_rule(int count) {
    const GaussLegendre rule = gauss_legendre(static_cast<std::size_t>(count));
    GaussRule unit;
    for (const double x : rule.node) unit.nodes.push_back(0.5 * (1 + x));
    for (const double w : rule.weight) unit.weights.push_back(0.5 * w);
    return unit;
}

}  // namespace medulla::sim2d
