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

}  // namespace detail

/// Integral of lobe() over the exit direction, to float precision but for dips narrower than an eighth of a span. Reads
/// the whole exit factor, as distribute() does: for what must balance energy exactly, not for each lookup.
MEDULLA_FN float held_integral(const TableView& table, const Contraction& contraction) noexcept {
    const std::uint32_t k = table.parameter_axes(), middle = table.even_stride(), end = table.layout.rank_stride;
    const AxisView<float> axis = table.axis(k);
    float right[4] = {}, left[4] = {}, sum = 0;  // coefficients of the span that ends with row j
    for (std::uint32_t j = 0; j < axis.spans + 3; ++j) {
        for (int i = 0; i < 3; ++i) right[i] = right[i + 1], left[i] = left[i + 1];
        const float even = detail::row_sum(table, k, j, contraction.weight, 0, middle),
                    odd = detail::row_sum(table, k, j, contraction.weight, middle, end);
        right[3] = even + odd, left[3] = even - odd;
        if (j < 3) continue;
        sum += detail::dip(axis, j - 3, right) + detail::dip(axis, j - 3, left);
    }
    return 1 + sum * contraction.inverse_integral;
}

/// Makes lobe() integrate to 1 to float precision.
MEDULLA_FN void hold_energy(const TableView& table, Contraction& contraction) noexcept {
    contraction.inverse_integral /= held_integral(table, contraction);
}

}  // namespace medulla
