// The integral of what a contracted lobe is below 0: a signed low-rank sum has negative undershoots where the
// lobe is nearly 0, and clamping them adds that much to its integral. Rests on blocks.hpp.
#pragma once

#include "medulla/detail/blocks.hpp"
#include "medulla/detail/math.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// Integral of max(0, -f) over one span; f the spline with these four coefficients there. Between its ends and where it
/// is stationary the cubic is monotone: a root is bisected, and Simpson's rule is exact.
MEDULLA_FN float span_undershoot(const AxisView<float>& axis, std::uint32_t span, const float* c) noexcept {
    if (c[0] >= 0 && c[1] >= 0 && c[2] >= 0 && c[3] >= 0) return 0;  // then f is too
    const float low = axis.breakpoint(std::int32_t(span)), width = axis.breakpoint(std::int32_t(span) + 1) - low;
    float at[4];  // f at thirds of the span, which make its cubic by Newton's forward differences
    for (int i = 0; i < 4; ++i) {
        const SplineWeights<float> w = spline_weights(axis, Cell<float>{span, low + float(i) / 3 * width});
        at[i] = (w.w[0] * c[0] + w.w[1] * c[1]) + (w.w[2] * c[2] + w.w[3] * c[3]);
    }
    const float p1 = 9 * (at[1] - at[2]) + at[3] - 5.5f * at[0] + 4.5f * at[2],
                p2 = 4.5f * (2 * at[0] - 5 * at[1] + 4 * at[2] - at[3]),
                p3 = 4.5f * (3 * (at[1] - at[2]) + at[3] - at[0]);
    const auto f = [&](float t) { return at[0] + t * (p1 + t * (p2 + t * p3)); };  // t in [0, 1]
    float end[4] = {0, 1, 1, 1};                                                   // of the monotone parts, ascending
    int parts = 1;
    const float discriminant = p2 * p2 - 3 * p1 * p3;
    if (discriminant > 0) {
        const float q = -(p2 + (p2 < 0 ? -detail::math::sqrt(discriminant) : detail::math::sqrt(discriminant)));
        const float s = q / (3 * p3), t = p1 / q;
        const float ascending[2] = {s < t ? s : t, s < t ? t : s};
        for (const float x : ascending)
            if (x > end[parts - 1] && x < 1) end[parts++] = x;
        end[parts] = 1;
    }
    float sum = 0;
    for (int i = 0; i < parts; ++i) {
        const float a = end[i], b = end[i + 1], at_a = f(a), at_b = f(b);
        if (!(at_a < 0 || at_b < 0)) continue;
        float negative = at_a < 0 ? a : b, positive = at_a < 0 ? b : a;
        if (at_a > 0 || at_b > 0)
            for (int k = 0; k < 12; ++k) {  // f is nearly 0 there: what is left is second order in 2^-12
                const float middle = 0.5f * (negative + positive);
                (f(middle) < 0 ? negative : positive) = middle;
            }
        else
            negative = positive;
        const float from = at_a < 0 ? a : negative, to = at_a < 0 ? negative : b;
        sum -= (to - from) / 6 * (f(from) + 4 * f(0.5f * (from + to)) + f(to));
    }
    return sum > 0 ? sum * width : 0;
}

/// Calls put(row, sums) with the sums of four exit rows from `row` on; the last four may repeat some.
template <class Put>
MEDULLA_FN void exit_rows(const TableView& view, const float* weight, Put&& put) noexcept {
    const std::uint32_t k = view.parameter_axes(), rows = view.layout.axes[k].spans + 3;
    RowSums sums[4];
    for (std::uint32_t row = 0; row < rows; row += 4) {
        const std::uint32_t first = row + 4 <= rows ? row : rows - 4;
        four_row_sums(view, k, first, weight, sums);
        put(first, sums);
    }
}

/// Calls put(row, positive, negative) with the coefficients of the contracted lobe for y >= 0 and y < 0; some of the
/// last may come twice.
template <class Put>
MEDULLA_FN void exit_coefficients(const TableView& view, const float* weight, Put&& put) noexcept {
    exit_rows(view, weight, [&](std::uint32_t row, const RowSums(&sums)[4]) {
        for (std::uint32_t i = 0; i < 4; ++i) put(row + i, sums[i].even + sums[i].odd, sums[i].even - sums[i].odd);
    });
}

/// Integral over both halves of the axis of what lies below 0. @param at at(j, k): coefficient j for y >= 0 (k = 0) and
/// y < 0 (k = 1)
template <class At>
MEDULLA_FN float undershoot(const AxisView<float>& axis, At&& at) noexcept {
    float sum = 0;
    for (std::uint32_t span = 0; span < axis.spans; ++span)
        for (std::uint32_t k = 0; k < 2; ++k) {
            const float c[4] = {at(span, k), at(span + 1, k), at(span + 2, k), at(span + 3, k)};
            sum += span_undershoot(axis, span, c);
        }
    return sum;
}

/// The same of a table's lobe with these weights, from the whole exit factor, to float precision.
MEDULLA_FN float undershoot(const TableView& table, const float* weight) noexcept {
    const AxisView<float> axis = table.axis(table.parameter_axes());
    // Of either half the four coefficients of the rows that came last, behind the three before them.
    float c[2][7] = {}, sum = 0;
    std::uint32_t last = 0, spans = 0;  // the first of those four rows; spans that are done
    exit_rows(table, weight, [&](std::uint32_t row, const RowSums(&sums)[4]) {
        for (int k = 0; k < 2; ++k) {
            for (std::uint32_t i = 0; i < 3; ++i) c[k][i] = c[k][i + row - last];
            for (int i = 0; i < 4; ++i) c[k][3 + i] = k == 0 ? sums[i].even + sums[i].odd : sums[i].even - sums[i].odd;
            bool below = false;
            for (const float x : c[k]) below |= x < 0;
            for (std::uint32_t span = spans; below && span <= row; ++span)
                sum += span_undershoot(axis, span, c[k] + (span + 3 - row));
        }
        last = row;
        spans = row + 1;
    });
    return sum;
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
