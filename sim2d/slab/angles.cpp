// Quadrature of directions for the slab. The last bin before grazing is split dyadically, so that every scale of mu is
// resolved.
#include "sim2d/slab/angles.hpp"
#include "sim2d/elementary.hpp"

#include <algorithm>
#include <cmath>

namespace medulla::sim2d {
namespace {

constexpr std::size_t kMaxPoints = 12;  ///< per cell of a bin

/// 1 - m(t) in e = 1 - t: constant and linear term vanish, so u = (pi/2) (1 - m) suffers no cancellation.
double one_minus_map(double e) { return e * e * (21 + e * (-35 + e * (35 + e * (-21 + e * (7 - e))))) / 6; }

/// m'(t) = (7/6) (1 - t^6), with e = 1 - t.
double map_slope(double e) {
    const double t = 1 - e;
    return 7.0 / 6 * e * (1 + t * (1 + t * (1 + t * (1 + t * (1 + t)))));
}

/// Points that integrate a function analytic inside the Bernstein ellipse through a singularity `ratio` half-lengths
/// away to 1e-10: the error of an n-point Gauss rule is rho^(-2n).
std::size_t points_for(double ratio) {
    const double rho = ratio + std::sqrt(1 + ratio * ratio);
    const double points = portable::log(1e10) / (2 * portable::log(rho)) + 1;
    return points < kMaxPoints ? static_cast<std::size_t>(std::ceil(points)) : kMaxPoints;
}

}  // namespace

SlabDirections slab_directions(std::size_t count) {
    const Quadrature rule = gauss_legendre(2 * count);
    SlabDirections d;
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t k = 2 * count - 1 - i;
        const double t = rule.nodes[k], e = 1 - t, u = pi / 2 * one_minus_map(e);
        d.t.push_back(t);
        d.theta.push_back(pi / 2 - u);
        d.mu.push_back(portable::sin(u));
        d.weight.push_back(pi / 2 * map_slope(e) * rule.weights[k]);
        sum += d.weight.back();
        // Known for Gauss-Legendre nodes (Wang and Xiang 2012): (-1)^i sqrt((1 - t^2) w).
        d.barycentric.push_back((i % 2 ? -1 : 1) * std::sqrt(e * (1 + t) * rule.weights[k]));
    }
    for (double& w : d.weight) w *= pi / 2 / sum;  // m' is a polynomial, so this changes the last digits only
    return d;
}

double slab_t_of(double from_grazing) {
    const double target = from_grazing / (pi / 2);
    // 1 - m is convex and increasing in e on [0, 1]; its leading term 3.5 e^2 is above it, so e starts below the root
    // and the first Newton step lands above it, from where the iteration falls monotonically.
    double e = std::min(1.0, std::sqrt(target / 3.5));
    for (int iteration = 0; iteration < 60 && e > 0; ++iteration) {
        const double step = (one_minus_map(e) - target) / map_slope(e);
        e = std::clamp(e - step, 0.0, 1.0);
        if (std::abs(step) <= 1e-15 * e) break;
    }
    return 1 - e;
}

void slab_interpolation_row(const SlabDirections& d, double t, double theta, Parity parity, Interpolation interpolation,
                            double* row) {
    const std::size_t n = d.t.size();
    const double sign = parity == Parity::even ? 1 : -1;
    std::fill(row, row + n, 0.0);
    if (interpolation == Interpolation::linear) {
        // theta falls with the index; the neighbour of the last node across the normal is its mirror image.
        const auto below = std::find_if(d.theta.begin(), d.theta.end(), [&](double x) { return x <= theta; });
        if (below == d.theta.begin()) {
            row[0] = 1;
        } else if (below == d.theta.end()) {
            const double f = 0.5 * (1 + theta / d.theta[n - 1]);
            row[n - 1] = f + sign * (1 - f);
        } else {
            const std::size_t i = std::size_t(below - d.theta.begin());
            const double f = (theta - d.theta[i]) / (d.theta[i - 1] - d.theta[i]);
            row[i - 1] = f;
            row[i] = 1 - f;
        }
        return;
    }
    double denominator = 0;
    for (std::size_t j = 0; j < n; ++j) {
        if (t == d.t[j]) {
            std::fill(row, row + n, 0.0);
            row[j] = 1;
            return;
        }
        // Over all 2N nodes the sign alternates, so the mirror node carries the opposite weight.
        const double right = d.barycentric[j] / (t - d.t[j]), left = -d.barycentric[j] / (t + d.t[j]);
        denominator += right + left;
        row[j] = right + sign * left;
    }
    for (std::size_t j = 0; j < n; ++j) row[j] /= denominator;
}

SlabBins slab_bins(std::size_t count, double g) {
    SlabBins bins;
    bins.count = count;
    const double w = pi / double(count);
    const double pole = g == 0 ? HUGE_VAL : -portable::log(std::abs(g));  // distance of the phase function's poles
    std::vector<Quadrature> rules;
    for (std::size_t q = 0; q <= kMaxPoints; ++q) rules.push_back(gauss_legendre(q));
    const auto add = [&](double from, double to) {  // distances from grazing
        const double half = (to - from) / 2;
        const double cells = std::ceil(2 * half / std::min(pole, 2 * half));  // each pole >= 2 half-lengths of its cell
        const double h = half / cells;
        for (double c = 0; c < cells; ++c) {
            const double centre = from + (2 * c + 1) * h;
            // The poles of p lie beside the cell, the essential singularity exp(-depth / mu) at grazing in line with
            // it.
            const std::size_t q = std::max(points_for(std::min(pole, 1.0) / h),
                                           points_for(std::sqrt(std::max(0.0, (centre / h - 1) * (centre / h + 1)))));
            const Quadrature& rule = rules[q];
            for (std::size_t k = rule.nodes.size(); k-- > 0;) {
                const double u = centre + h * rule.nodes[k];
                bins.theta.push_back(pi / 2 - u);
                bins.mu.push_back(portable::sin(u));
                bins.weight.push_back(h * rule.weights[k]);
                bins.sin_half.push_back(portable::sin((pi / 2 - u) / 2));
                bins.cos_half.push_back(portable::cos((pi / 2 - u) / 2));
            }
        }
    };
    for (std::size_t upper = count / 2; upper < count; ++upper) {
        const double from = double(count - 1 - upper) * w, to = std::min(from + w, pi / 2);
        SlabBins::Group group{upper, count - 1 - upper, bins.theta.size(), 0};
        if (upper + 1 < count) {
            add(from, to);
        } else {
            // Densities are bounded, so [0, 2^-20 w] contributes below 1e-6 of the bin, and its error is smaller still.
            double b = to;
            for (int level = 0; level < 20; ++level, b /= 2) add(b / 2, b);
            add(0, b);
        }
        group.last = bins.theta.size();
        bins.groups.push_back(group);
    }
    return bins;
}

}  // namespace medulla::sim2d
