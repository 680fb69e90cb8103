// The few statistics that tests share: chi-squared tail and z-scores of histograms.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace medulla::test {

/// Probability that a chi-squared variable of `freedom` degrees exceeds x (Wilson-Hilferty: 1e-3 accurate from 10 on).
inline double chi_squared_tail(double x, double freedom) {
    const double a = 2 / (9 * freedom), z = (std::cbrt(x / freedom) - (1 - a)) / std::sqrt(a);
    return 0.5 * std::erfc(z / std::sqrt(2.0));
}

/// p-value of counts against probabilities; cells that expect fewer than ten are pooled with their neighbours.
inline double chi_squared_p(const std::vector<double>& counts, const std::vector<double>& probability, double total) {
    double x = 0, pooled_count = 0, pooled_expected = 0;
    double cells = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        pooled_count += counts[i], pooled_expected += probability[i] * total;
        if (pooled_expected < 10 && i + 1 < counts.size()) continue;
        if (pooled_expected > 0)
            x += (pooled_count - pooled_expected) * (pooled_count - pooled_expected) / pooled_expected;
        ++cells;
        pooled_count = pooled_expected = 0;
    }
    return chi_squared_tail(x, cells - 1);
}

}  // namespace medulla::test
