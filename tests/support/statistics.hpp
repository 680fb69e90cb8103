// The few statistics that tests share: chi-squared tail, Student's t, z-scores of histograms.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "medulla/config.hpp"

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

/// Two-sided p-value of Student's t with an odd number of degrees of freedom (Abramowitz and Stegun 26.7.3).
inline double student_p(double t, int freedom) {
    const double theta = std::atan(std::abs(t) / std::sqrt(double(freedom))), c = std::cos(theta);
    double sum = 0, term = c;
    for (int k = 3; k <= freedom; term *= (k - 1.0) / k * c * c, k += 2) sum += term;
    return 1 - 2 / pi * (theta + std::sin(theta) * sum);
}

/// p-value of p-values that are uniform in (0, 1), over `classes` classes.
inline double evenness_p(const std::vector<double>& p, std::size_t classes) {
    std::vector<double> counts(classes, 0.0);
    for (const double x : p) counts[std::min(classes - 1, static_cast<std::size_t>(x * double(classes)))] += 1;
    return chi_squared_p(counts, std::vector<double>(classes, 1 / double(classes)), double(p.size()));
}

}  // namespace medulla::test
