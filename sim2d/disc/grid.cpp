#include "sim2d/disc/grid.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "sim2d/elementary.hpp"
#include "sim2d/quadrature.hpp"

namespace medulla::sim2d {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

const int taps = 6;  ///< nodes of the interpolant in psi, even

/// A node of the interpolant: its index (modulo mirror images), the sign of its image and its position.
struct Tap {
    std::ptrdiff_t node;
    double sign, at;
};

/// Mirror images of the nodes about 0 (sign `about_zero`) and the last node, pi / 2 (sign `about_grazing`): tap t of
/// ... -2 -1 0 1 ...
Tap tap(const double* psi, std::ptrdiff_t count, std::ptrdiff_t t, double about_zero, double about_grazing) {
    if (t < 0) return {-1 - t, about_zero, -psi[-1 - t]};
    if (t < count) return {t, 1, psi[t]};
    return {2 * count - 2 - t, about_grazing, pi - psi[2 * count - 2 - t]};
}

/// Fourier coefficients in psi of the piecewise polynomial through the nodes: row = harmonic n of cosine or sine, exact
/// up to the Gauss rule per panel; c_n = (4 / pi) integral over (0, pi / 2), half that for n = 0.
Matrix analyse(const double* psi, std::ptrdiff_t count, int part, std::size_t harmonics, bool rim) {
    const bool cosine = DiscGrid::is_cosine(part);
    const int lowest = DiscGrid::parity(part), highest = lowest + 2 * static_cast<int>(harmonics) - 2;
    const double about_zero = cosine ? 1 : -1;
    const double about_grazing = part == real_sum || part == imaginary_sum ? 1 : -1;
    Matrix coefficients = Matrix::Zero(static_cast<Eigen::Index>(harmonics), count);
    const auto value = [&](int n, double x) { return cosine ? portable::cos(n * x) : portable::sin(n * x); };
    for (std::ptrdiff_t panel = -1; panel + 1 < count; ++panel) {
        const double low = panel < 0 ? 0 : psi[panel], high = psi[panel + 1];
        // Points for a polynomial times a wave of n_max (high - low) radians.
        const int points = 4 + static_cast<int>(std::ceil(0.5 * highest * (high - low)));
        const Quadrature rule = unit_gauss_legendre(points);
        // No light enters at the rim: a part has a kink at pi / 2, where the stencil stops.
        const std::ptrdiff_t middle = panel + 1 - taps / 2;
        const std::ptrdiff_t start = std::max(-count, rim ? std::min(middle, count - taps) : middle);
        Tap stencil[taps];
        for (int a = 0; a < taps; ++a) stencil[a] = tap(psi, count, start + a, about_zero, about_grazing);
        for (int q = 0; q < points; ++q) {
            const double x = low + rule.nodes[static_cast<std::size_t>(q)] * (high - low);
            const double weight = rule.weights[static_cast<std::size_t>(q)] * (high - low) * 4 / pi;
            double basis[taps];
            for (int a = 0; a < taps; ++a) {
                basis[a] = weight * stencil[a].sign;
                for (int c = 0; c < taps; ++c)
                    if (c != a) basis[a] *= (x - stencil[c].at) / (stencil[a].at - stencil[c].at);
            }
            // Harmonics of one part step by 2: f_n+2 = 2 cos(2 x) f_n - f_n-2.
            const double twice = 2 * portable::cos(2 * x);
            double before = value(lowest - 2, x), now = value(lowest, x);
            for (std::size_t n = 0; n < harmonics; ++n) {
                const double wave = n == 0 && lowest == 0 ? 0.5 * now : now;
                for (int a = 0; a < taps; ++a)
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

/// Radii cos x: steps of x from the rim, each longer by a factor up to the interior step, pi / 2 in total.
std::vector<double> radii(const DiscGridSize& size) {
    const double widest = pi / (2 * size.circles);
    std::vector<double> step;
    double next = std::min(size.rim, widest), sum = 0;
    while (sum < pi / 2 - 0.5 * widest) {
        step.push_back(next);
        sum += next;
        next = std::min(next * size.growth, widest);
    }
    std::vector<double> radius;  // sin of the angle from the centre
    double angle = 0;
    for (std::size_t i = step.size(); i-- > 0;) {
        angle += step[i] * (pi / 2) / sum;
        radius.push_back(i == 0 ? 1.0 : portable::sin(angle));
    }
    return radius;
}

}  // namespace

DiscGrid::DiscGrid(double g, const DiscGridSize& wanted) : mean_cosine(g), size(wanted) {
    radius = radii(size);
    for (std::size_t i = 0; i < circles(); ++i) {
        const double inner = i == 0 ? 0 : radius[i - 1];
        const double arc = portable::acos(inner / radius[i]);
        const int count = std::max(2, static_cast<int>(std::ceil(arc / size.gap)));
        const double intervals =
            i == 0 ? count - 0.5 : count;  // half a gap from the centre, one from the circle inside
        for (int m = count - 1; m >= 0; --m) {
            offset.push_back(radius[i] * portable::cos(arc * m / intervals));
            ring.push_back(i);
        }
        first.push_back(psi.size());
        for (const double b : offset) psi.push_back(portable::atan2(b, std::sqrt((radius[i] - b) * (radius[i] + b))));
    }
    first.push_back(psi.size());
    stride = (static_cast<std::size_t>(size.modes) + 9) / 8 * 8;
    const int highest = static_cast<int>(stride) - 2;
    reach =
        highest +
        (g == 0 ? 0 : static_cast<int>(std::ceil(std::min(400.0, portable::log(1e-7) / portable::log(std::abs(g))))));
    for (std::size_t i = 0; i < circles(); ++i)
        for (int part = 0; part < disc_parts; ++part) {
            const auto count = static_cast<std::ptrdiff_t>(chords(i));
            std::vector<DiscReal> wave;
            wave.reserve(chords(i) * all_harmonics());
            for (std::size_t m = 0; m < chords(i); ++m) {
                const double x = psi[first[i] + m], twice = 2 * portable::cos(2 * x);
                const auto value = [&](int n) { return is_cosine(part) ? portable::cos(n * x) : portable::sin(n * x); };
                double before = value(parity(part) - 2), now = value(parity(part));
                for (std::size_t n = 0; n < all_harmonics(); ++n) {
                    wave.push_back(static_cast<DiscReal>(now));
                    const double next = twice * now - before;
                    before = now, now = next;
                }
            }
            waves_.push_back(std::move(wave));
            analysis_.push_back(rounded(analyse(&psi[first[i]], count, part, harmonics(i), i + 1 == circles())));
        }
    const int most = 2 * static_cast<int>(all_harmonics());
    std::vector<double> power(static_cast<std::size_t>(most + highest) + 1, 1.0);
    for (std::size_t n = 1; n < power.size(); ++n) power[n] = power[n - 1] * g;
    for (int m = 0; m < most; ++m)
        for (std::size_t c = 0; c < stride; ++c) {
            const int k = static_cast<int>(mode_of(c));
            const double lower = power[static_cast<std::size_t>(std::abs(m - k))];
            const double upper = power[static_cast<std::size_t>(m + k)];
            even_.push_back(static_cast<DiscReal>(0.5 * (lower + upper)));
            odd_.push_back(static_cast<DiscReal>(0.5 * (lower - upper)));
        }
}

}  // namespace medulla::sim2d
