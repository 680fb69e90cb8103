#include "sim2d/disc/transport.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "sim2d/disc/lanes.hpp"
#include "sim2d/elementary.hpp"

namespace medulla::sim2d {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// integral over u in (0, 1) of exp(-tau (1 - u)) u^j du, j < disc_taps, by recurrence in its stable direction.
void exponential_moments(double tau, double moment[disc_taps]) {
    if (tau > 2) {
        moment[0] = -portable::expm1(-tau) / tau;
        for (int j = 1; j < disc_taps; ++j) moment[j] = (1 - j * moment[j - 1]) / tau;
        return;
    }
    const int last = disc_taps - 1;
    double term = 1.0 / disc_taps, sum = 0;  // j! (-tau)^n / (j + n + 1)!, j = last
    for (int n = 0; n < 24; ++n) sum += term, term *= -tau / (n + disc_taps + 1);
    moment[last] = sum;
    for (int j = last; j > 0; --j) moment[j - 1] = (1 - tau * moment[j]) / j;
}

/// Distance from the rim to a point at radius r along a direction at the angle psi to its position, >= 0.
double way_from_rim(double r, double cosine) {
    const double x = r * cosine, inside = (1 - r) * (1 + r), root = std::sqrt(inside + x * x);
    return x < 0 ? inside / (root - x) : root + x;
}

}  // namespace

/// Exact for a source that is a polynomial in s through the disc_taps nearest points of the chord.
std::vector<DiscTransport::Cell> DiscTransport::chord_cells(const std::vector<double>& s) const {
    const std::size_t points = s.size(), taps = std::min<std::size_t>(disc_taps, points);
    std::vector<Cell> cells(points - 1);
    for (std::size_t p = 0; p + 1 < points; ++p) {
        Cell& cell = cells[p];
        const double length = s[p + 1] - s[p], tau = extinction_ * length;
        cell.transmission = static_cast<DiscReal>(portable::exp(-tau));
        cell.taps = taps;
        cell.start = std::min(p < disc_taps / 2 ? 0 : p + 1 - disc_taps / 2, points - taps);
        double moment[disc_taps];
        exponential_moments(tau, moment);
        for (std::size_t a = 0; a < taps; ++a) {
            double weight = 0;
            double polynomial[disc_taps] = {1};  // Lagrange basis in u = (s - s_p) / length
            const double here = (s[cell.start + a] - s[p]) / length;
            for (std::size_t c = 0; c < taps; ++c) {
                if (c == a) continue;
                const double there = (s[cell.start + c] - s[p]) / length, scale = 1 / (here - there);
                for (int j = disc_taps - 1; j > 0; --j)
                    polynomial[j] = scale * (polynomial[j - 1] - there * polynomial[j]);
                polynomial[0] *= -scale * there;
            }
            for (int j = 0; j < disc_taps; ++j) weight += length * polynomial[j] * moment[j];
            cell.weight[a] = static_cast<DiscReal>(weight);
        }
    }
    return cells;
}

DiscTransport::DiscTransport(const DiscGrid& grid, double extinction) : grid_(grid), extinction_(extinction) {
    for (std::size_t m = 0; m < grid.offset.size(); ++m) {
        std::vector<double> s;
        const double b = grid.offset[m];
        const auto along = [&](std::size_t i) { return std::sqrt((grid.radius[i] - b) * (grid.radius[i] + b)); };
        for (std::size_t i = grid.circles(); i-- > grid.ring[m];) s.push_back(-along(i));
        for (std::size_t i = grid.ring[m] + grid.tangent(m); i < grid.circles(); ++i) s.push_back(along(i));
        cells_.push_back(chord_cells(s));
    }
    along_.resize(4 * grid.circles() * grid.stride);
    flux_.resize(2 * grid.stride);
    for (DiscField& c : coefficients_) c.resize(grid.all_harmonics() * grid.stride);
}

void DiscTransport::stream(const DiscField& source, DiscField& radiance, std::size_t active, DiscReal* exit) {
    for (std::size_t m = 0; m < cells_.size(); ++m) chord(m, source, radiance, active, exit);
}

void DiscTransport::scatter(const DiscField& radiance, DiscField& source, std::size_t active, double factor) {
    const std::size_t stride = grid_.stride;
    const auto scale = static_cast<DiscReal>(factor);
    for (std::size_t i = 0; i < grid_.circles(); ++i)
        for (int parity = 0; parity < 2; ++parity) {
            const int parts[2] = {parity ? real_difference : real_sum, parity ? imaginary_sum : imaginary_difference};
            const std::size_t count = grid_.chords(i), harmonics = grid_.harmonics(i);
            for (int c = 0; c < 2; ++c)
                lanes::product(grid_.analysis(i, parts[c]).data(), count, &radiance[row(i, parts[c], 0) * stride],
                               coefficients_[c].data(), harmonics, count, stride, active);
            for (std::size_t j = 0; j < harmonics; ++j) {
                const int m = 2 * static_cast<int>(j) + parity;
                lanes::mix(&coefficients_[0][j * stride], &coefficients_[1][j * stride], grid_.even(m), grid_.odd(m),
                           scale, active);
            }
            for (int c = 0; c < 2; ++c)
                lanes::product(grid_.waves(i, parts[c]).data(), grid_.all_harmonics(), coefficients_[c].data(),
                               &source[row(i, parts[c], 0) * stride], count, harmonics, stride, active);
        }
}

/// Unscattered light at radius r is delta(omega) exp(-extinction d(psi)): a_m = f_m for every k, f the Fourier
/// coefficients of the exponential; scattering follows.
void DiscTransport::first_collision(DiscField& source) {
    const std::size_t stride = grid_.stride, orders = grid_.all_harmonics();
    const auto top = static_cast<Eigen::Index>(2 * orders);
    int samples = 512;
    while (samples < 4 * top) samples *= 2;
    std::vector<double> table(static_cast<std::size_t>(samples));
    for (int a = 0; a <= samples / 2; ++a)
        table[static_cast<std::size_t>(a)] = table[static_cast<std::size_t>((samples - a) % samples)] =
            portable::cos(2 * pi * a / samples);
    Matrix attenuation(samples / 2 + 1, static_cast<Eigen::Index>(grid_.circles()));
    for (Eigen::Index i = 0; i < attenuation.cols(); ++i)
        for (int a = 0; a <= samples / 2; ++a) {
            const double way =
                way_from_rim(grid_.radius[static_cast<std::size_t>(i)], table[static_cast<std::size_t>(a)]);
            attenuation(a, i) = portable::exp(-extinction_ * way) * (a == 0 || a == samples / 2 ? 1 : 2) / samples;
        }
    Matrix cosines(top, samples / 2 + 1);
    for (Eigen::Index k = 0; k < top; ++k)
        for (Eigen::Index a = 0; a <= samples / 2; ++a)
            cosines(k, a) = table[static_cast<std::size_t>((k * a) % samples)];
    const Matrix f = cosines * attenuation;
    for (std::size_t i = 0; i < grid_.circles(); ++i)
        for (int part = 0; part < disc_parts; ++part) {
            for (std::size_t j = 0; j < orders; ++j) {
                const int m = 2 * static_cast<int>(j) + DiscGrid::parity(part);
                const double c = f(m, static_cast<Eigen::Index>(i)) / pi * (m == 0 ? 0.5 : 1);
                const DiscReal* ratio = DiscGrid::is_cosine(part) ? grid_.even(m) : grid_.odd(m);
                for (std::size_t k = 0; k < stride; ++k)
                    coefficients_[0][j * stride + k] = static_cast<DiscReal>(c * static_cast<double>(ratio[k]));
            }
            lanes::product(grid_.waves(i, part).data(), orders, coefficients_[0].data(),
                           &source[row(i, part, 0) * stride], grid_.chords(i), orders, stride, stride);
        }
}

void DiscTransport::uniform_radiance(DiscField& radiance) const {
    for (std::size_t i = 0; i < grid_.circles(); ++i)
        for (std::size_t m = 0; m < grid_.chords(i); ++m) {
            const double cosine = portable::cos(grid_.psi[grid_.first[i] + m]);
            const auto at = [&](double c) {
                const double way = way_from_rim(grid_.radius[i], c), tau = extinction_ * way;
                return tau > 0 ? way * (-portable::expm1(-tau) / tau) : way;
            };
            const double out = at(cosine), in = i + 1 == grid_.circles() ? 0 : at(-cosine);
            radiance[row(i, real_sum, m) * grid_.stride] = static_cast<DiscReal>(0.5 * (out + in));
            radiance[row(i, real_difference, m) * grid_.stride] = static_cast<DiscReal>(0.5 * (out - in));
            radiance[row(i, imaginary_sum, m) * grid_.stride] = 0;
            radiance[row(i, imaginary_difference, m) * grid_.stride] = 0;
        }
}

std::complex<double> DiscTransport::grazing(const DiscField& source, std::size_t column) const {
    const std::size_t i = grid_.circles() - 1, last = grid_.chords(i) - 1;
    return {source[row(i, real_sum, last) * grid_.stride + column],
            source[row(i, imaginary_sum, last) * grid_.stride + column]};
}

void DiscTransport::chord(std::size_t m, const DiscField& source, DiscField& radiance, std::size_t active,
                          DiscReal* exit) {
    const std::size_t ring = grid_.ring[m], met = grid_.circles() - ring, stride = grid_.stride;
    const std::size_t out = met - grid_.tangent(m);  // the tangent point belongs to the way in and to the way out
    const auto at = [&](std::size_t p, int imaginary) {
        return &along_[(2 * p + static_cast<std::size_t>(imaginary)) * stride];
    };
    const int sums[2] = {real_sum, imaginary_sum}, differences[2] = {real_difference, imaginary_difference};
    for (std::size_t c = 0; c < met; ++c)
        for (int part = 0; part < 2; ++part)
            lanes::sum_difference(&source[row(ring + c, sums[part], m) * stride],
                                  &source[row(ring + c, differences[part], m) * stride], DiscReal(1), at(out + c, part),
                                  at(met - 1 - c, part), active);
    // March from the rim, where no light enters. The sum rows store the radiance on the way in for the way out.
    std::fill(flux_.begin(), flux_.end(), DiscReal(0));
    for (std::size_t p = 0; p < out + met; ++p) {
        for (int part = 0; part < 2; ++part) {
            DiscReal* flux = &flux_[static_cast<std::size_t>(part) * stride];
            if (p > 0) {
                const Cell& cell = cells_[m][p - 1];
                lanes::advance(flux, cell.transmission, cell.weight, at(cell.start, part), 2 * stride, cell.taps,
                               active);
            }
            if (p < met) std::copy_n(flux, active, &radiance[row(grid_.circles() - 1 - p, sums[part], m) * stride]);
            if (p >= out) {
                DiscReal* sum = &radiance[row(ring + p - out, sums[part], m) * stride];
                lanes::sum_difference(flux, sum, DiscReal(0.5), sum,
                                      &radiance[row(ring + p - out, differences[part], m) * stride], active);
            }
        }
    }
    if (exit) std::copy(flux_.begin(), flux_.end(), exit + 2 * m * stride);
}

}  // namespace medulla::sim2d
