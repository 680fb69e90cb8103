// A contracted table as something to draw from: the lobe's values at its own knots, joined by straight lines.
// Rests on lookup.hpp; what is drawn has exactly the density that pdf states, wherever signed factors dip below 0.
#pragma once

#include <cmath>

#include "medulla/config.hpp"
#include "medulla/lookup.hpp"

namespace medulla {

inline constexpr int most_bins = 128;  ///< over the full axis, both halves

/// Piecewise linear density over an exit axis, integral 1. `value` is the lobe held to `floor_share` of the even
/// density and more, so that the lobe between two knots never meets a density of 0.
struct ExitDistribution {
    int bins = 0;  ///< 0: nothing to draw from
    bool periodic = false;
    float edge[most_bins + 1];        ///< ascending [radians]
    float value[most_bins + 1];       ///< density at the edge [1 / radian]
    float cumulative[most_bins + 1];  ///< mass below the edge; cumulative[bins] = 1

    /// Density at y [radians], wrapped where the axis is periodic, 0 outside where it is not.
    MEDULLA_FN float pdf(float y) const noexcept {
        if (bins == 0) return 0;
        const float low = edge[0], high = edge[bins];
        if (periodic) y -= std::floor((y - low) / (high - low)) * (high - low);
        if (!periodic && (y < low || y > high)) return 0;
        const int i = find(edge, y);
        const float t = (y - edge[i]) / (edge[i + 1] - edge[i]);
        return value[i] + (value[i + 1] - value[i]) * (t < 0 ? 0.0f : (t > 1 ? 1.0f : t));
    }

    /// Draws y [radians]. @param u uniform in [0, 1)
    MEDULLA_FN float sample(float u) const noexcept {
        const int i = find(cumulative, u);
        const float mass = cumulative[i + 1] - cumulative[i];
        const float a = value[i], b = value[i + 1], ratio = mass > 0 ? (u - cumulative[i]) / mass : 0.0f;
        const float x = ratio < 0 ? 0.0f : (ratio > 1 ? 1.0f : ratio);
        // Inverse of the mass below a straight line, in the form without cancellation.
        const float t = x * (a + b) / (a + std::sqrt(a * a + x * (b * b - a * a)));
        return edge[i] + t * (edge[i + 1] - edge[i]);
    }

    /// The bin of `array` (ascending, bins + 1 long) that holds x.
    MEDULLA_FN int find(const float* array, float x) const noexcept {
        int i = 0;
        for (int n = bins; n > 1;) {
            const int half = n / 2;
            i = array[i + half] <= x ? i + half : i;
            n -= half;
        }
        return i;
    }
};

/// Share of an even density below which no value is held.
inline constexpr float floor_share = 0.02f;

/// Reads a lobe at its knots (every few knots where there are more than most_bins spans on both halves).
/// @param axis of |y|  @param coefficients of the spline, row by row: f(row, positive, negative) sets those of y and -y
template <class F>
MEDULLA_FN void distribute(const AxisView<float>& axis, bool periodic, F&& coefficients,
                           ExitDistribution& out) noexcept {
    const std::uint32_t stride = (2 * axis.spans + most_bins - 1) / most_bins;
    const int half = int((axis.spans + stride - 1) / stride);
    out.bins = 2 * half;
    out.periodic = periodic;
    const float floor_value = floor_share / (2 * axis.upper());
    // The spline at a knot is the blend of three coefficients.
    float positive[3] = {}, negative[3] = {};
    std::uint32_t known = 0;  // they hold rows known - 3 .. known - 1
    const auto next_row = [&]() {
        positive[0] = positive[1], positive[1] = positive[2], negative[0] = negative[1], negative[1] = negative[2];
        coefficients(known++, positive[2], negative[2]);
    };
    const auto put = [&](int i, float y, float value) {
        out.edge[i] = y;
        out.value[i] = value > floor_value ? value : floor_value;
    };
    for (int i = 0; i <= half; ++i) {
        const std::uint32_t at = std::uint32_t(i) * stride < axis.spans ? std::uint32_t(i) * stride : axis.spans;
        while (known < at + 3) next_row();
        // At the last knot the blend runs from the last span, at its right end: weights w[1..3] there.
        const bool last = at == axis.spans;
        const float y = axis.knot(std::int32_t(at)).t;
        const auto w = spline_weights(axis, Cell<float>{last ? at - 1 : at, y});
        const float* v = last ? w.w + 1 : w.w;
        put(half + i, y, v[0] * positive[0] + v[1] * positive[1] + v[2] * positive[2]);
        if (i > 0) put(half - i, -y, v[0] * negative[0] + v[1] * negative[1] + v[2] * negative[2]);
    }
    float total = 0;
    out.cumulative[0] = 0;
    for (int i = 0; i < out.bins; ++i) {
        total += 0.5f * (out.value[i] + out.value[i + 1]) * (out.edge[i + 1] - out.edge[i]);
        out.cumulative[i + 1] = total;
    }
    const float inverse = 1 / total;  // total >= floor_share
    for (int i = 0; i <= out.bins; ++i) out.value[i] *= inverse, out.cumulative[i] *= inverse;
    out.cumulative[out.bins] = 1;
}
/// The same of a contracted lobe: each coefficient is a dot product with one row of factors.
MEDULLA_FN void distribute(const TableView& table, const Contraction& contraction, ExitDistribution& out) noexcept {
    const std::uint32_t k = table.parameter_axes();
    distribute(
        table.axis(k), static_cast<Quantity>(table.layout.axes[k].quantity) == Quantity::phi,
        [&](std::uint32_t row, float& positive, float& negative) {
            const detail::RowSums sum = detail::row_sums(table, k, row, contraction.weight);
            positive = (sum.even + sum.odd) * contraction.inverse_integral;
            negative = (sum.even - sum.odd) * contraction.inverse_integral;
        },
        out);
}
/// The same of unfolded tables. @param at coefficients of y >= 0, then those of y < 0  @param step from row to row
MEDULLA_FN void distribute(const TableView& table, const float* at, std::uint32_t step,
                           ExitDistribution& out) noexcept {
    const std::uint32_t k = table.parameter_axes();
    const AxisView<float> axis = table.axis(k);
    const std::uint32_t below = step * (axis.spans + 3);
    distribute(
        axis, static_cast<Quantity>(table.layout.axes[k].quantity) == Quantity::phi,
        [&](std::uint32_t row, float& positive, float& negative) {
            positive = at[step * row], negative = at[below + step * row];
        },
        out);
}

}  // namespace medulla
