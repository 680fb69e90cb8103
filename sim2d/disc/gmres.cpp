#include "sim2d/disc/gmres.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sim2d/disc/lanes.hpp"

namespace medulla::sim2d {
namespace {

using PerMode = std::vector<double>;

const std::size_t block_rows =
    32;  ///< so that a block of a field stays in the first-level cache over all basis vectors

/// products[i][k] = sum over rows of x y_i, i < count; within a block in DiscReal, over blocks in double.
void dots(const DiscField& x, const std::vector<DiscField>& y, std::size_t count, std::size_t stride,
          std::size_t active, PerMode* products) {
    std::vector<DiscReal> sum(stride);
    for (std::size_t i = 0; i < count; ++i) products[i].assign(stride, 0.0);
    for (std::size_t at = 0; at < x.size(); at += block_rows * stride) {
        const std::size_t rows = std::min(block_rows, (x.size() - at) / stride);
        for (std::size_t i = 0; i < count; ++i) {
            std::fill(sum.begin(), sum.end(), DiscReal(0));
            lanes::multiply_add(&x[at], &y[i][at], sum.data(), rows, stride, active);
            for (std::size_t k = 0; k < active; ++k) products[i][k] += static_cast<double>(sum[k]);
        }
    }
}

PerMode square(const DiscField& x, std::size_t stride, std::size_t active) {
    PerMode total(stride, 0.0);
    std::vector<DiscReal> sum(stride);
    for (std::size_t at = 0; at < x.size(); at += block_rows * stride) {
        std::fill(sum.begin(), sum.end(), DiscReal(0));
        lanes::multiply_add(&x[at], &x[at], sum.data(), std::min(block_rows, (x.size() - at) / stride), stride, active);
        for (std::size_t k = 0; k < active; ++k) total[k] += static_cast<double>(sum[k]);
    }
    return total;
}

/// x -= sum over i < count of scale_i y_i, mode by mode.
void subtract_all(DiscField& x, const std::vector<DiscField>& y, std::size_t count, std::size_t active,
                  const PerMode* scale) {
    if (count == 0) return;
    const std::size_t stride = scale[0].size();
    std::vector<DiscReal> factor(count * stride);
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t k = 0; k < stride; ++k) factor[i * stride + k] = static_cast<DiscReal>(scale[i][k]);
    for (std::size_t at = 0; at < x.size(); at += block_rows * stride)
        for (std::size_t i = 0; i < count; ++i)
            lanes::subtract(&x[at], &y[i][at], &factor[i * stride], std::min(block_rows, (x.size() - at) / stride),
                            stride, active);
}

void multiply(DiscField& a, const PerMode& scale, std::size_t active) {
    const std::size_t stride = scale.size();
    for (std::size_t at = 0; at < a.size(); at += stride)
        for (std::size_t k = 0; k < active; ++k) a[at + k] *= static_cast<DiscReal>(scale[k]);
}

}  // namespace

DiscIteration gmres(const DiscOperator& apply, DiscField right_side, std::size_t stride, double tolerance,
                    std::size_t most) {
    const std::size_t size = right_side.size();
    std::vector<DiscField> basis;
    basis.push_back(std::move(right_side));
    // Modes do not couple: each has its own Krylov space and rotations, but all share the passes over memory.
    PerMode norm = square(basis[0], stride, stride), scale(stride, 0.0);
    for (double& n : norm) n = std::sqrt(n);
    scale[0] = norm[0];  // column 0, the path length, has its own scale
    std::fill(scale.begin() + 1, scale.end(), *std::max_element(norm.begin() + 1, norm.end()));
    std::vector<PerMode> column(most * (most + 1), PerMode()), cosine, sine, right(1, norm);
    const auto h = [&](std::size_t i, std::size_t j) -> PerMode& { return column[j * (most + 1) + i]; };
    std::vector<std::size_t> steps(stride, 0);
    PerMode inverse(stride);
    for (std::size_t k = 0; k < stride; ++k) inverse[k] = norm[k] > 0 ? 1 / norm[k] : 0;
    multiply(basis[0], inverse, stride);
    std::size_t active = stride, j = 0;
    const auto shrink = [&] {
        std::size_t highest = 0;
        for (std::size_t k = 0; k < active; ++k)
            if (std::abs(right[j][k]) > tolerance * scale[k]) highest = k + 1;
        active = (highest + 7) / 8 * 8;
    };
    shrink();
    while (active > 0 && j < most) {
        DiscField next(size);
        apply(basis[j], next, active);
        for (std::size_t at = 0; at < next.size(); at += stride)
            for (std::size_t k = 0; k < active; ++k) next[at + k] = basis[j][at + k] - next[at + k];
        // Classical Gram-Schmidt: two passes over the basis. Its loss of orthogonality costs steps, not accuracy.
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
            const double x = h(j, j)[k], y = h(j + 1, j)[k], r = std::sqrt(x * x + y * y);
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
    DiscIteration result;
    result.iterations = static_cast<int>(j);
    result.converged = active == 0;
    double unsolved = 0;  // squares of the residuals of columns 1 and on
    std::vector<PerMode> weight(std::max<std::size_t>(j, 1), PerMode(stride, 0.0));
    for (std::size_t k = 0; k < stride; ++k) {
        result.residual = std::max(result.residual, scale[k] > 0 ? std::abs(right[steps[k]][k]) / scale[k] : 0);
        if (k > 0) unsolved += right[steps[k]][k] * right[steps[k]][k];
        for (std::size_t i = steps[k]; i-- > 0;) {
            double value = right[i][k];
            for (std::size_t c = i + 1; c < steps[k]; ++c) value -= h(i, c)[k] * weight[c][k];
            weight[i][k] = value / h(i, i)[k];
        }
        if (steps[k] == 0)
            weight[0][k] = norm[k];  // below the tolerance from the start: the solution is the right side
    }
    for (PerMode& w : weight)
        for (double& x : w) x = -x;
    result.solution.assign(size, DiscReal(0));
    subtract_all(result.solution, basis, weight.size(), stride, weight.data());
    if (result.converged) return result;
    const PerMode solved = square(result.solution, stride, stride);
    const double first = std::abs(right[steps[0]][0]), others = std::accumulate(solved.begin() + 1, solved.end(), 0.0);
    if (first > 0) result.left = first / std::sqrt(solved[0]);
    if (unsolved > 0) result.left = std::max(result.left, std::sqrt(unsolved / others));
    return result;
}

}  // namespace medulla::sim2d
