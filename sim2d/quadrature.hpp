// Gauss-Legendre rules, by Newton's method on the Legendre recurrence (Numerical Recipes 4.6, any order).
#pragma once

#include <cmath>
#include <vector>

namespace medulla::sim2d {

/// Nodes and weights on [0, 1]; the weights sum to 1.
struct GaussRule {
    std::vector<double> nodes, weights;
};

inline GaussRule gauss_legendre(int count) {
    const double pi = 3.14159265358979323846;
    GaussRule rule;
    rule.nodes.resize(static_cast<std::size_t>(count));
    rule.weights.resize(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
        double x = std::cos(pi * (i + 0.75) / (count + 0.5)), derivative = 1;
        for (int step = 0; step < 8; ++step) {
            double p0 = 1, p1 = x;
            for (int n = 2; n <= count; ++n) {
                const double p2 = ((2 * n - 1) * x * p1 - (n - 1) * p0) / n;
                p0 = p1, p1 = p2;
            }
            derivative = count * (x * p1 - p0) / (x * x - 1);
            x -= p1 / derivative;
        }
        rule.nodes[static_cast<std::size_t>(i)] = 0.5 * (1 - x);
        rule.weights[static_cast<std::size_t>(i)] = 1 / ((1 - x * x) * derivative * derivative);
    }
    return rule;
}

}  // namespace medulla::sim2d
