// The integral of a lobe as it is returned: a signed low-rank sum is normalised before its dips below 0 are held there,
// so that lobe() integrates to 1 plus what they hold. Rests on lookup.hpp.
#pragma once

#include "medulla/lookup.hpp"

namespace medulla {

namespace detail {

/// Integral of max(0, -f) over one span; f the spline with these four coefficients there. Eighths of the span tell the
/// signs of f apart; the root between two signs is bisected, and Simpson's rule is exact for a cubic.
MEDULLA_FN float dip(const AxisView<float>& axis, std::uint32_t span, const float* c) noexcept {
    if (c[0] >= 0 && c[1] >= 0 && c[2] >= 0 && c[3] >= 0) return 0;  // then f is too
    constexpr int parts = 8, halvings = 12;
    const float low = axis.breakpoint(std::int32_t(span)), width = axis.breakpoint(std::int32_t(span) + 1) - low;
    const auto f = [&](float t) {  // t in [0, 1]
        const SplineWeights<float> w = spline_weights(axis, Cell<float>{span, low + t * width});
        return (w.w[0] * c[0] + w.w[1] * c[1]) + (w.w[2] * c[2] + w.w[3] * c[3]);
    };
    float sum = 0, a = 0, at_a = f(0);
    for (int i = 1; i <= parts; ++i) {
        const float b = float(i) / parts, at_b = f(b);
        if (at_a < 0 || at_b < 0) {
            float root = at_a < 0 ? b : a;  // the end of the negative stretch that is not an end of the part
            if (at_a * at_b < 0) {
                float negative = at_a < 0 ? a : b, positive = at_a < 0 ? b : a;
                for (int k = 0; k < halvings; ++k) {
                    const float middle = 0.5f * (negative + positive);
                    (f(middle) < 0 ? negative : positive) = middle;
                }
                root = negative;
            }
            const float from = at_a < 0 ? a : root, to = at_a < 0 ? root : b;
            sum -= (to - from) / 6 * (f(from) + 4 * f(0.5f * (from + to)) + f(to));
        }
        a = b, at_a = at_b;
    }
    return sum > 0 ? sum * width : 0;
}

/// Calls put(k, positive, negative) with the coefficients of the contracted lobe for y >= 0 and y < 0.
template <class Put>
MEDULLA_FN void exit_coefficients(const TableView& view, const float* weight, Put&& put) noexcept {
    const std::uint32_t k = view.parameter_axes();
    for (std::uint32_t row = 0; row < view.layout.axes[k].spans + 3; ++row) {
        const RowSums sum = row_sums(view, k, row, weight);
        put(row, sum.even + sum.odd, sum.even - sum.odd);
    }
}

/// Integral over both halves of the axis of what lies below 0. @param at at(j, k): coefficient j for y >= 0 (k = 0) and
/// y < 0 (k = 1)
template <class At>
MEDULLA_FN float dips(const AxisView<float>& axis, At&& at) noexcept {
    float sum = 0;
    for (std::uint32_t span = 0; span < axis.spans; ++span)
        for (std::uint32_t k = 0; k < 2; ++k) {
            const float c[4] = {at(span, k), at(span + 1, k), at(span + 2, k), at(span + 3, k)};
            sum += dip(axis, span, c);
        }
    return sum;
}

}  // namespace detail

/// Integral of lobe() over the exit direction, to float precision but for dips narrower than an eighth of a span. Reads
/// the whole exit factor, as distribute() does: for what must balance energy exactly, not for each lookup.
MEDULLA_FN float held_integral(const TableView& table, const Contraction& contraction) noexcept {
    const AxisView<float> axis = table.axis(table.parameter_axes());
    float last[4][2] = {}, sum = 0;  // coefficients of the span that ends with row j
    detail::exit_coefficients(table, contraction.weight, [&](std::uint32_t j, float positive, float negative) {
        for (int i = 0; i < 3; ++i) last[i][0] = last[i + 1][0], last[i][1] = last[i + 1][1];
        last[3][0] = positive, last[3][1] = negative;
        for (int k = 0; j >= 3 && k < 2; ++k) {
            const float c[4] = {last[0][k], last[1][k], last[2][k], last[3][k]};
            sum += detail::dip(axis, j - 3, c);
        }
    });
    return 1 + sum * contraction.inverse_integral;
}

/// Makes lobe() integrate to 1 to float precision.
MEDULLA_FN void hold_energy(const TableView& table, Contraction& contraction) noexcept {
    contraction.inverse_integral /= held_integral(table, contraction);
}

}  // namespace medulla
