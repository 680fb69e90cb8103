#include "sim2d/disc_transport.hpp"

#define EIGEN_DONT_PARALLELIZE
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "sim2d/disc_single.hpp"

namespace medulla::sim2d {
namespace {

const double pi = 3.14159265358979323846;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Strided = Eigen::Map<Matrix, 0, Eigen::OuterStride<>>;
using ConstStrided = Eigen::Map<const Matrix, 0, Eigen::OuterStride<>>;

/// Modes at all nodes: circle by circle, the four parts one after the other, each chords(i) x stride, row-major.
using Field = std::vector<double>;

/// integral over u in (0, 1) of exp(-tau (1 - u)) u^j du, j = 0..3: by recurrence in the direction that is stable.
void exponential_moments(double tau, double moment[4]) {
    if (tau > 2) {
        moment[0] = -std::expm1(-tau) / tau;
        for (int j = 1; j < 4; ++j) moment[j] = (1 - j * moment[j - 1]) / tau;
        return;
    }
    double term = 0.25, sum = 0;  // j! (-tau)^n / (j + n + 1)!, j = 3
    for (int n = 0; n < 24; ++n) sum += term, term *= -tau / (n + 5);
    moment[3] = sum;
    for (int j = 3; j > 0; --j) moment[j - 1] = (1 - tau * moment[j]) / j;
}

/// Transport through one cell of a chord: I(p + 1) = transmission I(p) + sum of weight[a] J(start + a).
struct Cell {
    double transmission, weight[4];
    std::size_t start, taps;
};

/// Exact for a source that is cubic in s between the four nearest points of the chord.
std::vector<Cell> chord_cells(const std::vector<double>& s, double sigma) {
    const std::size_t points = s.size(), taps = std::min<std::size_t>(4, points);
    std::vector<Cell> cells(points - 1);
    for (std::size_t p = 0; p + 1 < points; ++p) {
        Cell& cell = cells[p];
        const double length = s[p + 1] - s[p], tau = sigma * length;
        cell.transmission = std::exp(-tau);
        cell.taps = taps;
        cell.start = std::min(p == 0 ? 0 : p - 1, points - taps);
        double moment[4];
        exponential_moments(tau, moment);
        for (std::size_t a = 0; a < 4; ++a) {
            cell.weight[a] = 0;
            if (a >= taps) continue;
            double polynomial[4] = {1, 0, 0, 0};  // Lagrange basis in u = (s - s_p) / length
            const double here = (s[cell.start + a] - s[p]) / length;
            for (std::size_t c = 0; c < taps; ++c) {
                if (c == a) continue;
                const double there = (s[cell.start + c] - s[p]) / length, scale = 1 / (here - there);
                for (int j = 3; j > 0; --j) polynomial[j] = scale * (polynomial[j - 1] - there * polynomial[j]);
                polynomial[0] *= -scale * there;
            }
            for (int j = 0; j < 4; ++j) cell.weight[a] += length * polynomial[j] * moment[j];
        }
    }
    return cells;
}

class Transport {
  public:
    Transport(const DiscGrid& grid, double sigma) : grid_(grid), sigma_(sigma) {
        for (std::size_t m = 0; m < grid.offset.size(); ++m) {
            std::vector<double> s;
            const double b = grid.offset[m];
            const auto along = [&](std::size_t i) { return std::sqrt((grid.radius[i] - b) * (grid.radius[i] + b)); };
            for (std::size_t i = grid.circles(); i-- > grid.ring[m];) s.push_back(-along(i));
            for (std::size_t i = grid.ring[m]; i < grid.circles(); ++i) s.push_back(along(i));
            cells_.push_back(chord_cells(s, sigma));
        }
        source_.resize(4 * grid.circles() * grid.stride);
        flux_.resize(2 * grid.stride);
    }

    std::size_t size() const { return grid_.nodes() * disc_parts * grid_.stride; }
    std::size_t rows() const { return grid_.nodes() * disc_parts; }

    /// Radiance from a source; `exit`, where given, takes the radiance that leaves along each chord, times
    /// exp(i k psi): real and imaginary row per chord.
    void stream(const Field& source, Field& radiance, std::size_t active, double* exit = nullptr) {
        for (std::size_t m = 0; m < cells_.size(); ++m) chord(m, source, radiance, active, exit);
    }

    /// sigma times the convolution of the radiance with the phase function, at every point.
    void scatter(const Field& radiance, Field& source, std::size_t active) const {
        for (std::size_t i = 0; i < grid_.circles(); ++i)
            for (int part = 0; part < disc_parts; ++part) {
                const auto count = static_cast<Eigen::Index>(grid_.chords(i));
                const std::size_t at = row(i, part, 0) * grid_.stride;
                const auto& matrix = grid_.scatter(i, static_cast<DiscPart>(part));
                const Eigen::OuterStride<> stride(static_cast<Eigen::Index>(grid_.stride));
                Strided out(&source[at], count, static_cast<Eigen::Index>(active), stride);
                out.noalias() =
                    sigma_ * (Eigen::Map<const Matrix>(matrix.data(), count, count) *
                              ConstStrided(&radiance[at], count, static_cast<Eigen::Index>(active), stride));
            }
    }

    /// Source of the first collisions, sigma p(omega) exp(-sigma s0(r, alpha)), s0 the way from the rim: in modes
    /// sigma / (2 pi) sum over n of g^|n| exp(-i n psi) f_(k - n), f the cosine coefficients of the exponential.
    void first_collision(Field& source) const {
        const std::size_t stride = grid_.stride;
        const int top = static_cast<int>(stride) + grid_.harmonics;
        int samples = 512;
        while (samples < 4 * top) samples *= 2;
        std::vector<double> table(static_cast<std::size_t>(samples));
        for (int a = 0; a < samples; ++a) table[static_cast<std::size_t>(a)] = std::cos(2 * pi * a / samples);
        Matrix attenuation(samples / 2 + 1, static_cast<Eigen::Index>(grid_.circles()));
        for (Eigen::Index i = 0; i < attenuation.cols(); ++i)
            for (int a = 0; a <= samples / 2; ++a) {
                const double r = grid_.radius[static_cast<std::size_t>(i)];
                const double x = r * table[static_cast<std::size_t>(a)], inside = (1 - r) * (1 + r);
                const double root = std::sqrt(inside + x * x);
                const double way = x < 0 ? inside / (root - x) : root + x;
                attenuation(a, i) = std::exp(-sigma_ * way) * (a == 0 || a == samples / 2 ? 1 : 2) / samples;
            }
        Matrix cosines(top + 1, samples / 2 + 1);
        for (int k = 0; k <= top; ++k)
            for (int a = 0; a <= samples / 2; ++a) cosines(k, a) = table[static_cast<std::size_t>((k * a) % samples)];
        const Matrix f = cosines * attenuation;
        for (std::size_t i = 0; i < grid_.circles(); ++i)
            for (const DiscPart part : {real_sum, real_difference, imaginary_sum, imaginary_difference}) {
                const std::vector<int> harmonics = grid_.harmonics_of(part);
                const bool real = part == real_sum || part == real_difference;
                const auto orders = static_cast<Eigen::Index>(harmonics.size());
                const auto count = static_cast<Eigen::Index>(grid_.chords(i));
                Matrix shifted(orders, static_cast<Eigen::Index>(stride));
                const auto column = static_cast<Eigen::Index>(i);
                for (Eigen::Index c = 0; c < orders; ++c)
                    for (int k = 0; k < static_cast<int>(stride); ++k) {
                        const int n = harmonics[static_cast<std::size_t>(c)];
                        const double lower = f(std::abs(k - n), column), upper = f(k + n, column);
                        shifted(c, k) = n == 0 ? lower : real ? lower + upper : upper - lower;
                    }
                Eigen::Map<Matrix> out(&source[row(i, part, 0) * stride], count, static_cast<Eigen::Index>(stride));
                out.noalias() = sigma_ / (2 * pi) *
                                (Eigen::Map<const Matrix>(grid_.waves(i, part).data(), count, orders) * shifted);
            }
    }

    /// Mode k of a source at the rim, psi = pi / 2.
    std::complex<double> grazing(const Field& source, std::size_t k) const {
        const std::size_t i = grid_.circles() - 1, count = grid_.chords(i);
        std::complex<double> value = 0;
        for (std::size_t a = count - 4; a < count; ++a) {
            double weight = 1;
            const double x = 0.5 * pi - grid_.psi[grid_.first[i] + a];
            for (std::size_t c = count - 4; c < count; ++c) {
                const double y = 0.5 * pi - grid_.psi[grid_.first[i] + c];
                if (c != a) weight *= y * y / ((y - x) * (y + x));
            }
            value += weight * std::complex<double>(source[row(i, real_sum, a) * grid_.stride + k],
                                                   source[row(i, imaginary_sum, a) * grid_.stride + k]);
        }
        return value;
    }

  private:
    /// Row of a field: circle i, part, chord m.
    std::size_t row(std::size_t i, int part, std::size_t m) const {
        return disc_parts * grid_.first[i] + static_cast<std::size_t>(part) * grid_.chords(i) + m;
    }

    void chord(std::size_t m, const Field& source, Field& radiance, std::size_t active, double* exit) {
        const std::size_t ring = grid_.ring[m], met = grid_.circles() - ring, stride = grid_.stride;
        const auto real_at = [&](std::size_t p) { return &source_[2 * p * stride]; };
        const auto imaginary_at = [&](std::size_t p) { return &source_[(2 * p + 1) * stride]; };
        // To modes along the chord: times exp(i k psi), psi -> pi - psi for the point on the way in.
        for (std::size_t c = 0; c < met; ++c) {
            const std::size_t i = ring + c;
            const double* rs = &source[row(i, real_sum, m) * stride];
            const double* rd = &source[row(i, real_difference, m) * stride];
            const double* is = &source[row(i, imaginary_sum, m) * stride];
            const double* id = &source[row(i, imaginary_difference, m) * stride];
            const double* cosine = &grid_.cosine[(grid_.first[i] + m) * stride];
            const double* sine = &grid_.sine[(grid_.first[i] + m) * stride];
            double *out_re = real_at(met + c), *out_im = imaginary_at(met + c);
            double *in_re = real_at(met - 1 - c), *in_im = imaginary_at(met - 1 - c);
#pragma omp simd
            for (std::size_t k = 0; k < active; ++k) {
                const double x = rs[k] + rd[k], y = is[k] + id[k], u = rs[k] - rd[k], v = is[k] - id[k];
                out_re[k] = x * cosine[k] - y * sine[k];
                out_im[k] = x * sine[k] + y * cosine[k];
                in_re[k] = u * cosine[k] + v * sine[k];  // times (-1)^k below
                in_im[k] = v * cosine[k] - u * sine[k];
            }
            for (std::size_t k = 1; k < active; k += 2) in_re[k] = -in_re[k], in_im[k] = -in_im[k];
        }
        // March from the rim, where nothing comes in; the radiance at each point goes back to circle coordinates.
        double *re = flux_.data(), *im = flux_.data() + stride;
        std::fill(flux_.begin(), flux_.end(), 0.0);
        for (std::size_t p = 0; p < 2 * met; ++p) {
            if (p > 0) {
                const Cell& cell = cells_[m][p - 1];
                const double t = cell.transmission;
                if (cell.taps == 4) {
                    const double w0 = cell.weight[0], w1 = cell.weight[1], w2 = cell.weight[2], w3 = cell.weight[3];
                    const double* a = real_at(cell.start);
                    const double* b = imaginary_at(cell.start);
                    const std::size_t step = 2 * stride;
#pragma omp simd
                    for (std::size_t k = 0; k < active; ++k) {
                        re[k] = t * re[k] +
                                ((w0 * a[k] + w1 * a[k + step]) + (w2 * a[k + 2 * step] + w3 * a[k + 3 * step]));
                        im[k] = t * im[k] +
                                ((w0 * b[k] + w1 * b[k + step]) + (w2 * b[k + 2 * step] + w3 * b[k + 3 * step]));
                    }
                } else {
                    for (std::size_t k = 0; k < active; ++k) re[k] *= t, im[k] *= t;
                    for (std::size_t q = 0; q < cell.taps; ++q)
                        for (std::size_t k = 0; k < active; ++k) {
                            re[k] += cell.weight[q] * real_at(cell.start + q)[k];
                            im[k] += cell.weight[q] * imaginary_at(cell.start + q)[k];
                        }
                }
            }
            const bool in = p < met;
            const std::size_t i = in ? grid_.circles() - 1 - p : ring + (p - met);
            double* rs = &radiance[row(i, real_sum, m) * stride];
            double* rd = &radiance[row(i, real_difference, m) * stride];
            double* is = &radiance[row(i, imaginary_sum, m) * stride];
            double* id = &radiance[row(i, imaginary_difference, m) * stride];
            const double* cosine = &grid_.cosine[(grid_.first[i] + m) * stride];
            const double* sine = &grid_.sine[(grid_.first[i] + m) * stride];
            if (in) {
                for (std::size_t k = 0; k < active; ++k) {
                    const double sign = k % 2 ? -0.5 : 0.5;
                    rs[k] = sign * (re[k] * cosine[k] - im[k] * sine[k]);
                    is[k] = sign * (re[k] * sine[k] + im[k] * cosine[k]);
                }
            } else {
#pragma omp simd
                for (std::size_t k = 0; k < active; ++k) {
                    const double x = 0.5 * (re[k] * cosine[k] + im[k] * sine[k]);
                    const double y = 0.5 * (im[k] * cosine[k] - re[k] * sine[k]);
                    const double u = rs[k], v = is[k];
                    rs[k] = x + u, rd[k] = x - u;
                    is[k] = y + v, id[k] = y - v;
                }
            }
        }
        if (exit) std::copy(flux_.begin(), flux_.end(), exit + 2 * m * stride);
    }

    const DiscGrid& grid_;
    double sigma_;
    std::vector<std::vector<Cell>> cells_;
    std::vector<double> source_, flux_;
};

using PerMode = std::vector<double>;

PerMode dot(const Field& a, const Field& b, std::size_t stride, std::size_t active) {
    PerMode sum(stride, 0.0);
    for (std::size_t at = 0; at < a.size(); at += stride) {
        const double *x = &a[at], *y = &b[at];
        double* s = sum.data();
#pragma omp simd
        for (std::size_t k = 0; k < active; ++k) s[k] += x[k] * y[k];
    }
    return sum;
}

/// a += scale b, mode by mode.
void add(Field& a, const Field& b, const PerMode& scale, std::size_t active) {
    const std::size_t stride = scale.size();
    for (std::size_t at = 0; at < a.size(); at += stride) {
        double* x = &a[at];
        const double *y = &b[at], *s = scale.data();
#pragma omp simd
        for (std::size_t k = 0; k < active; ++k) x[k] += s[k] * y[k];
    }
}

void multiply(Field& a, const PerMode& scale, std::size_t active) {
    const std::size_t stride = scale.size();
    for (std::size_t at = 0; at < a.size(); at += stride)
        for (std::size_t k = 0; k < active; ++k) a[at + k] *= scale[k];
}

}  // namespace

DiscExit solve_disc_transport(const DiscGrid& grid, double sigma) {
    // Truncation of the iteration, far below the grids' own errors.
    const double tolerance = 1e-6;
    const std::size_t most = 80, stride = grid.stride;
    Transport transport(grid, sigma);
    Field first(transport.size()), radiance(transport.size());
    transport.first_collision(first);
    transport.stream(first, radiance, stride);
    std::vector<Field> basis(1, Field(transport.size()));
    transport.scatter(radiance, basis[0], stride);  // source of the second collisions

    // GMRES (Saad and Schultz 1986) on (1 - scatter stream) J = basis[0]. Modes do not couple: each has its own
    // Krylov space and rotation, but all share the passes over memory; converged high modes drop out.
    PerMode norm = dot(basis[0], basis[0], stride, stride);
    double scale = 0;
    for (double& n : norm) n = std::sqrt(n), scale = std::max(scale, n);
    std::vector<PerMode> column(most * (most + 1), PerMode()), cosine, sine, right(1, norm);
    const auto h = [&](std::size_t i, std::size_t j) -> PerMode& { return column[j * (most + 1) + i]; };
    std::vector<std::size_t> steps(stride, 0);
    PerMode inverse(stride);
    for (std::size_t k = 0; k < stride; ++k) inverse[k] = norm[k] > 0 ? 1 / norm[k] : 0;
    multiply(basis[0], inverse, stride);
    std::size_t active = stride, j = 0;
    const auto still = [&](std::size_t k) { return std::abs(right[j][k]) > tolerance * scale; };
    const auto shrink = [&] {
        std::size_t highest = 0;
        for (std::size_t k = 0; k < active; ++k)
            if (still(k)) highest = k + 1;
        active = (highest + 7) / 8 * 8;
    };
    shrink();
    while (active > 0 && j < most) {
        Field next(transport.size());
        transport.stream(basis[j], radiance, active);
        transport.scatter(radiance, next, active);
        for (std::size_t at = 0; at < next.size(); at += stride)
            for (std::size_t k = 0; k < active; ++k) next[at + k] = basis[j][at + k] - next[at + k];
        for (std::size_t i = 0; i <= j; ++i) {
            h(i, j) = dot(next, basis[i], stride, active);
            PerMode minus = h(i, j);
            for (double& x : minus) x = -x;
            add(next, basis[i], minus, active);
        }
        PerMode length = dot(next, next, stride, active);
        for (std::size_t k = 0; k < active; ++k) {
            length[k] = std::sqrt(length[k]);
            inverse[k] = length[k] > 0 ? 1 / length[k] : 0;
        }
        h(j + 1, j) = length;
        multiply(next, inverse, active);
        cosine.emplace_back(stride, 1.0), sine.emplace_back(stride, 0.0), right.emplace_back(stride, 0.0);
        for (std::size_t k = 0; k < active; ++k) {
            for (std::size_t i = 0; i < j; ++i) {
                const double x = h(i, j)[k], y = h(i + 1, j)[k];
                h(i, j)[k] = cosine[i][k] * x + sine[i][k] * y;
                h(i + 1, j)[k] = cosine[i][k] * y - sine[i][k] * x;
            }
            const double x = h(j, j)[k], y = h(j + 1, j)[k], r = std::hypot(x, y);
            if (!(r > 0)) continue;  // the Krylov space of this mode is exhausted
            cosine[j][k] = x / r, sine[j][k] = y / r;
            h(j, j)[k] = r;
            right[j + 1][k] = -sine[j][k] * right[j][k];
            right[j][k] *= cosine[j][k];
            steps[k] = j + 1;
        }
        basis.push_back(std::move(next));
        ++j;
        shrink();
    }
    DiscExit exit;
    exit.iterations = static_cast<int>(j);
    std::vector<PerMode> weight(j, PerMode(stride, 0.0));
    for (std::size_t k = 0; k < stride; ++k) {
        exit.residual = std::max(exit.residual, scale > 0 ? std::abs(right[steps[k]][k]) / scale : 0);
        for (std::size_t i = steps[k]; i-- > 0;) {
            double value = right[i][k];
            for (std::size_t c = i + 1; c < steps[k]; ++c) value -= h(i, c)[k] * weight[c][k];
            weight[i][k] = value / h(i, i)[k];
        }
    }
    Field& many = first;
    std::fill(many.begin(), many.end(), 0.0);
    // A mode that needed no step (below the tolerance from the start) keeps its source of second collisions.
    if (j > 0)
        for (std::size_t k = 0; k < stride; ++k)
            if (steps[k] == 0) weight[0][k] = norm[k];
    for (std::size_t i = 0; i < j; ++i) add(many, basis[i], weight[i], stride);

    std::vector<double> rows(2 * grid.offset.size() * stride);
    transport.stream(many, radiance, stride, rows.data());
    exit.offset = grid.offset;
    exit.modes = stride;
    for (std::size_t m = 0; m < grid.offset.size(); ++m) {
        const double energy = disc_energy(sigma, grid.offset[m]);
        for (std::size_t k = 0; k < stride; ++k)
            exit.lobes.emplace_back(rows[2 * m * stride + k] / energy, rows[(2 * m + 1) * stride + k] / energy);
    }
    // Tangent chord: I / E -> J(r = 1, psi = pi / 2) / sigma. A source is smooth there, its sum parts are even about
    // pi / 2 and its difference parts 0: a cubic in (pi / 2 - psi)^2.
    exit.offset.push_back(1);
    for (std::size_t k = 0; k < stride; ++k)
        exit.lobes.push_back(transport.grazing(many, k) / sigma * std::polar(1.0, 0.5 * pi * static_cast<double>(k)));
    return exit;
}

}  // namespace medulla::sim2d
