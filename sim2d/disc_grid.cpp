#include "sim2d/disc_grid.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "sim2d/quadrature.hpp"

namespace medulla::sim2d {
namespace {

const double pi = 3.14159265358979323846;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A value of the interpolant: node index (modulo mirror images) and the sign its image carries.
struct Tap {
    std::ptrdiff_t node;  ///< < 0: a zero
    double sign, at;
};

/// Mirror images of the nodes about 0 (sign `about_zero`) and pi / 2 (sign `about_grazing`): tap t of ... -2 -1 0 1 ...
/// On the rim nothing comes in, so a part ends at pi / 2 with the value 0 and has no image beyond.
Tap tap(const double* psi, std::ptrdiff_t count, std::ptrdiff_t t, double about_zero, double about_grazing, bool rim) {
    if (t < 0) return {-1 - t, about_zero, -psi[-1 - t]};
    if (t < count) return {t, 1, psi[t]};
    if (rim) return {-1, 0, pi / 2};
    return {2 * count - 1 - t, about_grazing, pi - psi[2 * count - 1 - t]};
}

/// Fourier coefficients in psi of the piecewise cubic through the nodes: row = harmonic n of cosine or sine, exact up
/// to the Gauss rule per panel; c_n = (4 / pi) integral over (0, pi / 2), half that for n = 0.
Matrix analyse(const double* psi, std::ptrdiff_t count, DiscPart part, const std::vector<int>& harmonics, bool rim) {
    const bool cosine = part == real_sum || part == real_difference;
    const double about_zero = cosine ? 1 : -1;
    const double about_grazing = part == real_sum || part == imaginary_sum ? 1 : -1;
    Matrix coefficients = Matrix::Zero(static_cast<Eigen::Index>(harmonics.size()), count);
    if (harmonics.empty()) return coefficients;
    const auto value = [&](int n, double x) { return cosine ? std::cos(n * x) : std::sin(n * x); };
    std::vector<double> taps(4);
    for (std::ptrdiff_t panel = -1; panel < count; ++panel) {
        const double low = panel < 0 ? 0 : psi[panel], high = panel + 1 < count ? psi[panel + 1] : pi / 2;
        // Points for a cubic times a wave of n_max (high - low) radians.
        const int points = 4 + static_cast<int>(std::ceil(0.5 * harmonics.back() * (high - low)));
        const GaussRule rule = gauss_legendre(points);
        // Stencil of four taps; at the rim it stops at the zero.
        const std::ptrdiff_t start =
            std::max<std::ptrdiff_t>(-count, rim ? std::min<std::ptrdiff_t>(panel - 1, count - 3) : panel - 1);
        Tap stencil[4];
        for (int a = 0; a < 4; ++a) stencil[a] = tap(psi, count, start + a, about_zero, about_grazing, rim);
        for (int q = 0; q < points; ++q) {
            const double x = low + rule.nodes[static_cast<std::size_t>(q)] * (high - low);
            const double weight = rule.weights[static_cast<std::size_t>(q)] * (high - low) * 4 / pi;
            double basis[4];
            for (int a = 0; a < 4; ++a) {
                basis[a] = weight * stencil[a].sign;
                for (int c = 0; c < 4; ++c)
                    if (c != a) basis[a] *= (x - stencil[c].at) / (stencil[a].at - stencil[c].at);
            }
            // Harmonics of one part step by 2: f_n+2 = 2 cos(2 x) f_n - f_n-2.
            const double twice = 2 * std::cos(2 * x);
            double before = value(harmonics[0] - 2, x), now = value(harmonics[0], x);
            for (std::size_t n = 0; n < harmonics.size(); ++n) {
                const double wave = harmonics[n] == 0 ? 0.5 : now;
                for (int a = 0; a < 4; ++a)
                    if (stencil[a].node >= 0)
                        coefficients(static_cast<Eigen::Index>(n), stencil[a].node) += basis[a] * wave;
                const double next = twice * now - before;
                before = now, now = next;
            }
        }
    }
    return coefficients;
}

std::vector<DiscReal> rounded(const Matrix& matrix) {
    std::vector<DiscReal> values;
    values.reserve(static_cast<std::size_t>(matrix.size()));
    for (Eigen::Index i = 0; i < matrix.size(); ++i) values.push_back(static_cast<DiscReal>(matrix.data()[i]));
    return values;
}

}  // namespace

DiscGrid::DiscGrid(double g, const DiscGridSize& wanted) : size(wanted) {
    const auto circle_count = static_cast<std::size_t>(size.circles);
    for (std::size_t i = 0; i < circle_count; ++i) {
        const double inner = i == 0 ? 0 : radius.back();
        radius.push_back(i + 1 == circle_count ? 1.0 : std::sin(pi * static_cast<double>(i + 1) / (2 * size.circles)));
        const double arc = std::acos(inner / radius[i]);
        const int count = std::max(2, static_cast<int>(std::ceil(arc / size.gap)));
        for (int m = 0; m < count; ++m) {
            offset.push_back(radius[i] * std::cos(arc * (count - m - 0.5) / count));
            ring.push_back(i);
        }
        first.push_back(psi.size());
        for (const double b : offset) psi.push_back(std::atan2(b, std::sqrt((radius[i] - b) * (radius[i] + b))));
    }
    first.push_back(psi.size());
    stride = (static_cast<std::size_t>(size.modes) + 8) / 8 * 8;
    cosine.resize(nodes() * stride);
    sine.resize(nodes() * stride);
    for (std::size_t node = 0; node < nodes(); ++node)
        for (std::size_t k = 0; k < stride; ++k) {
            cosine[node * stride + k] = static_cast<DiscReal>(std::cos(static_cast<double>(k) * psi[node]));
            sine[node * stride + k] = static_cast<DiscReal>(std::sin(static_cast<double>(k) * psi[node]));
        }
    harmonics = g == 0 ? 0 : static_cast<int>(std::ceil(std::log(1e-8) / std::log(std::abs(g))));
    for (std::size_t i = 0; i < circle_count; ++i)
        for (const DiscPart part : {real_sum, real_difference, imaginary_sum, imaginary_difference}) {
            const std::vector<int> n = harmonics_of(part);
            const auto count = static_cast<std::ptrdiff_t>(chords(i));
            const bool cosines = part == real_sum || part == real_difference;
            Matrix wave(count, static_cast<Eigen::Index>(n.size()));
            for (Eigen::Index m = 0; m < wave.rows(); ++m)
                for (Eigen::Index c = 0; c < wave.cols(); ++c) {
                    const int order = n[static_cast<std::size_t>(c)];
                    const double angle = order * psi[first[i] + static_cast<std::size_t>(m)];
                    wave(m, c) = std::pow(g, order) * (cosines ? std::cos(angle) : std::sin(angle));
                }
            const Matrix coefficients = analyse(&psi[first[i]], count, part, n, i + 1 == circle_count);
            waves_.push_back(rounded(wave));
            const bool factored = 2 * wave.cols() < count;
            analysis_.push_back(factored ? rounded(coefficients) : std::vector<DiscReal>());
            scatter_.push_back(factored ? std::vector<DiscReal>() : rounded(wave * coefficients));
        }
}

std::vector<int> DiscGrid::harmonics_of(DiscPart part) const {
    // cos(n (pi - psi)) = (-1)^n cos(n psi), sin(n (pi - psi)) = -(-1)^n sin(n psi).
    const bool even = part == real_sum || part == imaginary_difference;
    std::vector<int> n;
    for (int order = even ? (part == real_sum ? 0 : 2) : 1; order <= harmonics; order += 2) n.push_back(order);
    return n;
}

}  // namespace medulla::sim2d
