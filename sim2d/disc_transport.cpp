#include "sim2d/disc_transport.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#include "sim2d/disc_single.hpp"

namespace medulla::sim2d {
namespace {

const double pi = 3.14159265358979323846;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RealMatrix = Eigen::Matrix<DiscReal, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstMap = Eigen::Map<const RealMatrix>;
using Strided = Eigen::Map<RealMatrix, 0, Eigen::OuterStride<>>;
using ConstStrided = Eigen::Map<const RealMatrix, 0, Eigen::OuterStride<>>;

/// Modes at all nodes: circle by circle, the four parts one after the other, each chords(i) x stride, row-major.
using Field = std::vector<DiscReal>;

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
    DiscReal transmission, weight[4];
    std::size_t start, taps;
};

/// Exact for a source that is cubic in s between the four nearest points of the chord.
std::vector<Cell> chord_cells(const std::vector<double>& s, double sigma) {
    const std::size_t points = s.size(), taps = std::min<std::size_t>(4, points);
    std::vector<Cell> cells(points - 1);
    for (std::size_t p = 0; p + 1 < points; ++p) {
        Cell& cell = cells[p];
        const double length = s[p + 1] - s[p], tau = sigma * length;
        cell.transmission = static_cast<DiscReal>(std::exp(-tau));
        cell.taps = taps;
        cell.start = std::min(p == 0 ? 0 : p - 1, points - taps);
        double moment[4];
        exponential_moments(tau, moment);
        for (std::size_t a = 0; a < taps; ++a) {
            double weight = 0;
            double polynomial[4] = {1, 0, 0, 0};  // Lagrange basis in u = (s - s_p) / length
            const double here = (s[cell.start + a] - s[p]) / length;
            for (std::size_t c = 0; c < taps; ++c) {
                if (c == a) continue;
                const double there = (s[cell.start + c] - s[p]) / length, scale = 1 / (here - there);
                for (int j = 3; j > 0; --j) polynomial[j] = scale * (polynomial[j - 1] - there * polynomial[j]);
                polynomial[0] *= -scale * there;
            }
            for (int j = 0; j < 4; ++j) weight += length * polynomial[j] * moment[j];
            cell.weight[a] = static_cast<DiscReal>(weight);
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
    void stream(const Field& source, Field& radiance, std::size_t active, DiscReal* exit = nullptr) {
        for (std::size_t m = 0; m < cells_.size(); ++m) chord(m, source, radiance, active, exit);
    }

    /// The convolution of the radiance with the phase function times `factor`, at every point.
    void scatter(const Field& radiance, Field& source, std::size_t active, double factor) const {
        for (std::size_t i = 0; i < grid_.circles(); ++i)
            for (int part = 0; part < disc_parts; ++part) {
                const auto count = static_cast<Eigen::Index>(grid_.chords(i));
                const std::size_t at = row(i, part, 0) * grid_.stride;
                const auto kind = static_cast<DiscPart>(part);
                const Eigen::OuterStride<> stride(static_cast<Eigen::Index>(grid_.stride));
                const auto columns = static_cast<Eigen::Index>(active);
                Strided out(&source[at], count, columns, stride);
                const ConstStrided in(&radiance[at], count, columns, stride);
                const auto scale = static_cast<DiscReal>(factor);
                if (grid_.scatter(i, kind).empty()) {
                    const auto orders = static_cast<Eigen::Index>(grid_.waves(i, kind).size()) / count;
                    const RealMatrix coefficients = ConstMap(grid_.analysis(i, kind).data(), orders, count) * in;
                    out.noalias() = scale * (ConstMap(grid_.waves(i, kind).data(), count, orders) * coefficients);
                } else {
                    out.noalias() = scale * (ConstMap(grid_.scatter(i, kind).data(), count, count) * in);
                }
            }
    }

    /// Source of the first collisions over sigma, p(omega) exp(-sigma s0(r, alpha)), s0 the way from the rim: in modes
    /// 1 / (2 pi) sum over n of g^|n| exp(-i n psi) f_(k - n), f the cosine coefficients of the exponential.
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
                RealMatrix shifted(orders, static_cast<Eigen::Index>(stride));
                const auto column = static_cast<Eigen::Index>(i);
                for (Eigen::Index c = 0; c < orders; ++c)
                    for (int k = 0; k < static_cast<int>(stride); ++k) {
                        const int n = harmonics[static_cast<std::size_t>(c)];
                        const double lower = f(std::abs(k - n), column), upper = f(k + n, column);
                        shifted(c, k) = static_cast<DiscReal>((n == 0 ? lower
                                                               : real ? lower + upper
                                                                      : upper - lower) /
                                                              (2 * pi));
                    }
                Eigen::Map<RealMatrix> out(&source[row(i, part, 0) * stride], count, static_cast<Eigen::Index>(stride));
                out.noalias() = ConstMap(grid_.waves(i, part).data(), count, orders) * shifted;
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

    void chord(std::size_t m, const Field& source, Field& radiance, std::size_t active, DiscReal* exit) {
        const std::size_t ring = grid_.ring[m], met = grid_.circles() - ring, stride = grid_.stride;
        const auto real_at = [&](std::size_t p) { return &source_[2 * p * stride]; };
        const auto imaginary_at = [&](std::size_t p) { return &source_[(2 * p + 1) * stride]; };
        // To modes along the chord: times exp(i k psi), psi -> pi - psi for the point on the way in.
        for (std::size_t c = 0; c < met; ++c) {
            const std::size_t i = ring + c;
            const DiscReal* rs = &source[row(i, real_sum, m) * stride];
            const DiscReal* rd = &source[row(i, real_difference, m) * stride];
            const DiscReal* is = &source[row(i, imaginary_sum, m) * stride];
            const DiscReal* id = &source[row(i, imaginary_difference, m) * stride];
            const DiscReal* cosine = &grid_.cosine[(grid_.first[i] + m) * stride];
            const DiscReal* sine = &grid_.sine[(grid_.first[i] + m) * stride];
            DiscReal *out_re = real_at(met + c), *out_im = imaginary_at(met + c);
            DiscReal *in_re = real_at(met - 1 - c), *in_im = imaginary_at(met - 1 - c);
#pragma omp simd
            for (std::size_t k = 0; k < active; ++k) {
                const DiscReal x = rs[k] + rd[k], y = is[k] + id[k], u = rs[k] - rd[k], v = is[k] - id[k];
                out_re[k] = x * cosine[k] - y * sine[k];
                out_im[k] = x * sine[k] + y * cosine[k];
                in_re[k] = u * cosine[k] + v * sine[k];  // times (-1)^k below
                in_im[k] = v * cosine[k] - u * sine[k];
            }
            for (std::size_t k = 1; k < active; k += 2) in_re[k] = -in_re[k], in_im[k] = -in_im[k];
        }
        // March from the rim, where nothing comes in; the radiance at each point goes back to circle coordinates.
        DiscReal *re = flux_.data(), *im = flux_.data() + stride;
        std::fill(flux_.begin(), flux_.end(), DiscReal(0));
        for (std::size_t p = 0; p < 2 * met; ++p) {
            if (p > 0) {
                const Cell& cell = cells_[m][p - 1];
                const DiscReal t = cell.transmission;
                if (cell.taps == 4) {
                    const DiscReal w0 = cell.weight[0], w1 = cell.weight[1], w2 = cell.weight[2], w3 = cell.weight[3];
                    const DiscReal* a = real_at(cell.start);
                    const DiscReal* b = imaginary_at(cell.start);
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
            DiscReal* rs = &radiance[row(i, real_sum, m) * stride];
            DiscReal* rd = &radiance[row(i, real_difference, m) * stride];
            DiscReal* is = &radiance[row(i, imaginary_sum, m) * stride];
            DiscReal* id = &radiance[row(i, imaginary_difference, m) * stride];
            const DiscReal* cosine = &grid_.cosine[(grid_.first[i] + m) * stride];
            const DiscReal* sine = &grid_.sine[(grid_.first[i] + m) * stride];
            if (in) {
                for (std::size_t k = 0; k < active; ++k) {
                    const DiscReal sign = k % 2 ? DiscReal(-0.5) : DiscReal(0.5);
                    rs[k] = sign * (re[k] * cosine[k] - im[k] * sine[k]);
                    is[k] = sign * (re[k] * sine[k] + im[k] * cosine[k]);
                }
            } else {
#pragma omp simd
                for (std::size_t k = 0; k < active; ++k) {
                    const DiscReal x = DiscReal(0.5) * (re[k] * cosine[k] + im[k] * sine[k]);
                    const DiscReal y = DiscReal(0.5) * (im[k] * cosine[k] - re[k] * sine[k]);
                    const DiscReal u = rs[k], v = is[k];
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
    std::vector<DiscReal> source_, flux_;
};

/// Modes fade like r^k towards the centre, into denormals, which cost 100 cycles each: rounds them to zero while alive.
class FlushDenormals {
  public:
#if defined(__SSE2__)
    FlushDenormals() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | 0x8040u); }  // flush to zero, denormals are zeros
    ~FlushDenormals() { _mm_setcsr(saved_); }
    FlushDenormals(const FlushDenormals&) = delete;
    FlushDenormals& operator=(const FlushDenormals&) = delete;

  private:
    unsigned saved_;
#else
    FlushDenormals() {}  // elsewhere only slower
#endif
};

using PerMode = std::vector<double>;

// The loops over memory. Lanes are independent and nothing is contracted, so every clone gives the same bits.
#if defined(__x86_64__) && defined(__GNUC__)
#define MEDULLA_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define MEDULLA_CLONES
#endif

MEDULLA_CLONES void multiply_add(const DiscReal* x, const DiscReal* y, DiscReal* sum, std::size_t rows,
                                 std::size_t stride, std::size_t active) {
    for (std::size_t r = 0; r < rows; ++r, x += stride, y += stride)
#pragma omp simd
        for (std::size_t k = 0; k < active; ++k) sum[k] += x[k] * y[k];
}

MEDULLA_CLONES void subtract(DiscReal* x, const DiscReal* y, const DiscReal* scale, std::size_t rows,
                             std::size_t stride, std::size_t active) {
    for (std::size_t r = 0; r < rows; ++r, x += stride, y += stride)
#pragma omp simd
        for (std::size_t k = 0; k < active; ++k) x[k] -= scale[k] * y[k];
}

const std::size_t block_rows = 32;  ///< a block of a field stays in the first cache over all basis vectors

/// products[i][k] = sum over rows of x y_i, i < count; within a block in DiscReal, over blocks in double.
void dots(const Field& x, const std::vector<Field>& y, std::size_t count, std::size_t stride, std::size_t active,
          PerMode* products) {
    std::vector<DiscReal> sum(stride);
    for (std::size_t i = 0; i < count; ++i) products[i].assign(stride, 0.0);
    for (std::size_t at = 0; at < x.size(); at += block_rows * stride) {
        const std::size_t rows = std::min(block_rows, (x.size() - at) / stride);
        for (std::size_t i = 0; i < count; ++i) {
            std::fill(sum.begin(), sum.end(), DiscReal(0));
            multiply_add(&x[at], &y[i][at], sum.data(), rows, stride, active);
            for (std::size_t k = 0; k < active; ++k) products[i][k] += static_cast<double>(sum[k]);
        }
    }
}

PerMode square(const Field& x, std::size_t stride, std::size_t active) {
    PerMode total(stride, 0.0);
    std::vector<DiscReal> sum(stride);
    for (std::size_t at = 0; at < x.size(); at += block_rows * stride) {
        std::fill(sum.begin(), sum.end(), DiscReal(0));
        multiply_add(&x[at], &x[at], sum.data(), std::min(block_rows, (x.size() - at) / stride), stride, active);
        for (std::size_t k = 0; k < active; ++k) total[k] += static_cast<double>(sum[k]);
    }
    return total;
}

/// x -= sum over i < count of scale_i y_i, mode by mode.
void subtract_all(Field& x, const std::vector<Field>& y, std::size_t count, std::size_t active, const PerMode* scale) {
    if (count == 0) return;
    const std::size_t stride = scale[0].size();
    std::vector<DiscReal> factor(count * stride);
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t k = 0; k < stride; ++k) factor[i * stride + k] = static_cast<DiscReal>(scale[i][k]);
    for (std::size_t at = 0; at < x.size(); at += block_rows * stride)
        for (std::size_t i = 0; i < count; ++i)
            subtract(&x[at], &y[i][at], &factor[i * stride], std::min(block_rows, (x.size() - at) / stride), stride,
                     active);
}

void multiply(Field& a, const PerMode& scale, std::size_t active) {
    const std::size_t stride = scale.size();
    for (std::size_t at = 0; at < a.size(); at += stride)
        for (std::size_t k = 0; k < active; ++k) a[at + k] *= static_cast<DiscReal>(scale[k]);
}

}  // namespace

DiscExit solve_disc_transport(const DiscGrid& grid, double sigma) {
    // Truncation of the iteration: below the grids' own errors (1e-4), above the floor that rounding to DiscReal and
    // the orthogonality it costs set (3e-6 at sigma = 16).
    const double tolerance = 2e-5;
    const std::size_t most = 60, stride = grid.stride;
    const FlushDenormals flush;
    Transport transport(grid, sigma);
    Field first(transport.size()), radiance(transport.size());
    transport.first_collision(first);
    transport.stream(first, radiance, stride);
    std::vector<Field> basis(1, Field(transport.size()));
    transport.scatter(radiance, basis[0], stride, 1);  // source of the second collisions over sigma^2: finite at 0

    // GMRES (Saad and Schultz 1986) on (1 - scatter stream) J = basis[0]. Modes do not couple: each has its own
    // Krylov space and rotation, but all share the passes over memory; converged high modes drop out.
    PerMode norm = square(basis[0], stride, stride);
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
        transport.scatter(radiance, next, active, sigma);
        for (std::size_t at = 0; at < next.size(); at += stride)
            for (std::size_t k = 0; k < active; ++k) next[at + k] = basis[j][at + k] - next[at + k];
        // Classical Gram-Schmidt: two passes over the basis. What it loses in orthogonality costs steps, not accuracy.
        dots(next, basis, j + 1, stride, active, &h(0, j));
        subtract_all(next, basis, j + 1, active, &h(0, j));
        PerMode length = square(next, stride, active);
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
    std::fill(many.begin(), many.end(), DiscReal(0));
    // A mode that needed no step (below the tolerance from the start) keeps its source of second collisions.
    if (j > 0)
        for (std::size_t k = 0; k < stride; ++k)
            if (steps[k] == 0) weight[0][k] = norm[k];
    for (PerMode& w : weight)
        for (double& x : w) x = -x;
    subtract_all(many, basis, j, stride, weight.data());

    std::vector<DiscReal> rows(2 * grid.offset.size() * stride);
    transport.stream(many, radiance, stride, rows.data());
    exit.offset = grid.offset;
    exit.modes = stride;
    for (std::size_t m = 0; m < grid.offset.size(); ++m) {
        const double scale_back = sigma / (disc_energy(sigma, grid.offset[m]) / sigma);
        for (std::size_t k = 0; k < stride; ++k)
            exit.lobes.push_back(scale_back *
                                 std::complex<double>(rows[2 * m * stride + k], rows[(2 * m + 1) * stride + k]));
    }
    // Tangent chord: I / E -> J(r = 1, psi = pi / 2) / sigma. A source is smooth there, its sum parts are even about
    // pi / 2 and its difference parts 0: a cubic in (pi / 2 - psi)^2.
    exit.offset.push_back(1);
    for (std::size_t k = 0; k < stride; ++k)
        exit.lobes.push_back(transport.grazing(many, k) * sigma * std::polar(1.0, 0.5 * pi * static_cast<double>(k)));
    return exit;
}

}  // namespace medulla::sim2d
