// Splines through given values: the nodes of an axis, coefficients from values there, and rows of C^M times cos
// theta_r. Rests on spline_axis.hpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/detail/spline_axis.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// Rows at most of an axis that is solved for: the system stands on the stack.
inline constexpr std::uint32_t most_solved_rows = 128;

/// Knots beyond either end of an axis repeat it: the splines are the same, and the nodes of all rows lie within.
MEDULLA_FN void clamp_ends(AxisPlan& plan) noexcept {
    plan.t[0] = plan.t[1] = plan.lower();
    plan.t[plan.spans + 3] = plan.t[plan.spans + 4] = plan.upper();
}

/// Nodes of a spline through as many values as it has rows: the means of three neighbouring knots (Greville).
MEDULLA_FN double node_of(const AxisPlan& plan, std::uint32_t row) noexcept {
    const auto i = std::int32_t(row);
    return (plan.knot(i - 2) + plan.knot(i - 1) + plan.knot(i)) / 3;
}

/// A spline through values at its nodes: coefficients from values. The matrix of weights is banded and totally
/// positive, as each node lies where its row weighs most, and such a system is eliminated without pivots (de Boor 1978,
/// XIII).
struct SplineSolve {
    static constexpr int band = 3;  ///< diagonals to either side
    std::uint32_t rows;
    double factor[most_solved_rows][2 * band + 1] =
        {};  ///< of row i at column i - band + k: L below, U from k = band on

    MEDULLA_APART explicit SplineSolve(const AxisPlan& plan) noexcept : rows(plan.spans + 3) {
        for (std::uint32_t i = 0; i < rows; ++i) {
            const double x = node_of(plan, i);
            std::uint32_t span = 0;
            while (span + 1 < plan.spans && x >= plan.knot(std::int32_t(span) + 1)) ++span;
            double w[4];
            plan.weights(span, x, w);
            for (std::uint32_t k = 0; k < 4; ++k) factor[i][span + k + band - i] = w[k];
        }
        for (std::uint32_t c = 0; c < rows; ++c)
            for (std::uint32_t i = c + 1; i < rows && i <= c + band; ++i) {
                double& below = factor[i][c + band - i];
                below /= factor[c][band];
                for (std::uint32_t k = c + 1; k < rows && k <= c + band; ++k)
                    factor[i][k + band - i] -= below * factor[c][k + band - c];
            }
    }
    /// Values at the nodes, `step` floats apart, become coefficients.
    MEDULLA_APART void apply(float* x, std::size_t step) const noexcept {
        double y[most_solved_rows];
        for (std::uint32_t i = 0; i < rows; ++i) {
            y[i] = double(x[i * step]);
            for (std::uint32_t k = i > band ? i - band : 0; k < i; ++k) y[i] -= factor[i][k + band - i] * y[k];
        }
        for (std::uint32_t i = rows; i-- > 0;) {
            for (std::uint32_t k = i + 1; k < rows && k <= i + band; ++k) y[i] -= factor[i][k + band - i] * y[k];
            y[i] /= factor[i][band];
            x[i * step] = float(y[i]);
        }
    }
};

/// The corrected form: rows of C^M times cos theta_r, by a spline through the product at as many nodes as it has rows.
struct CosineProduct {
    SplineSolve solve;
    std::uint32_t span[most_solved_rows];
    double weight[most_solved_rows][4];  ///< of the pack's rows at a node, times the cosine

    /// @param from the axis of theta_r as the pack has it  @param to the tables'
    MEDULLA_APART CosineProduct(const AxisPlan& from, const AxisPlan& to) noexcept : solve(to) {
        for (std::uint32_t i = 0; i < solve.rows; ++i) {
            const double theta_r = node_of(to, i);
            span[i] = 0;
            while (span[i] + 1 < from.spans && theta_r >= from.knot(std::int32_t(span[i]) + 1)) ++span[i];
            from.weights(span[i], theta_r, weight[i]);
            for (double& w : weight[i]) w *= detail::math::cos(theta_r);
        }
    }
    /// @param row coefficients of theta_r >= 0 and of theta_r < 0, `step` floats apart
    MEDULLA_APART void apply(float* row, std::size_t step) const noexcept {
        float value[most_solved_rows];
        for (int side = 0; side < 2; ++side, row += step * solve.rows) {
            for (std::uint32_t i = 0; i < solve.rows; ++i) {
                double sum = 0;
                for (std::uint32_t k = 0; k < 4; ++k) sum += weight[i][k] * double(row[step * (span[i] + k)]);
                value[i] = float(sum);
            }
            for (std::uint32_t i = 0; i < solve.rows; ++i) row[step * i] = value[i];
            solve.apply(row, step);
        }
    }
};

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
