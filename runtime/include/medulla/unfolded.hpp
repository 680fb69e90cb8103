// A material's tables multiplied out. g is fixed and sigma moves over [1, eta / sqrt(eta^2 - 1)] times its least value
// only, so what is left of a table is small enough to hold dense: a lookup is then a few dozen products, whatever the
// rank. Rests on lookup.hpp, whose contractions are the slow twin; docs/bcsdf.md, 'Unfolded tables', has the errors.
#pragma once

#include <cmath>
#include <cstdint>

#include "medulla/lanes.hpp"
#include "medulla/lookup.hpp"

namespace medulla {

/// Spans that there is room for; the default pack fits.
inline constexpr std::uint32_t most_offset_spans = 24, most_inclination_spans = 56, most_exit_spans = 64;

/// Four neighbouring rows of an axis and their weights.
struct RowPoint {
    std::uint32_t first;
    Four weight;
};

/// Four weights that are cubics in t in [0, 1]: read, not recomputed.
struct CubicWeights {
    float power[4][4];  ///< [power of t][row]

    MEDULLA_HOT Four at(float t) const noexcept {
        const Four x(t);
        return (four_at(power[0]) + x * four_at(power[1])) + (x * x) * (four_at(power[2]) + x * four_at(power[3]));
    }
};

/// From the weights at t = 0, 1/3, 2/3, 1 (Newton's forward differences). @param f four weights at t
template <class F>
MEDULLA_FN CubicWeights cubic_weights(F&& f) noexcept {
    SplineWeights<float> at[4];
    for (int i = 0; i < 4; ++i) at[i] = f(float(i) / 3);
    CubicWeights c;
    for (int r = 0; r < 4; ++r) {
        const float a = at[0].w[r], b = at[1].w[r], d = at[2].w[r], e = at[3].w[r];
        c.power[0][r] = a;
        c.power[1][r] = 9 * (b - d) + e - 5.5f * a + 4.5f * d;
        c.power[2][r] = 4.5f * (2 * a - 5 * b + 4 * d - e);
        c.power[3][r] = 4.5f * (3 * (b - d) + e - a);
    }
    return c;
}

/// Weights of the cubic through values at four ascending places x.
MEDULLA_FN SplineWeights<float> lagrange_weights(const float (&x)[4], float at) noexcept {
    SplineWeights<float> w;
    for (int i = 0; i < 4; ++i) {
        w.w[i] = 1;
        for (int j = 0; j < 4; ++j)
            if (j != i) w.w[i] *= (at - x[j]) / (x[i] - x[j]);
    }
    return w;
}

/// An axis of a pack with the weights of each of its spans, and an index fine enough that the search takes two steps.
template <std::uint32_t Most>
struct CubicAxis {
    static constexpr std::int32_t stretches = 256;
    std::uint32_t spans = 0;
    float lower, upper, scale;           ///< scale = stretches / (upper - lower)
    std::uint8_t start[stretches];       ///< a span that begins at or before the stretch
    float low[Most + 2], inverse[Most];  ///< a span's lower end, out of reach after the last; 1 / its length
    std::uint8_t first[Most];            ///< of its four rows
    CubicWeights weights[Most];

    /// Rows are the pack's spline coefficients.
    MEDULLA_FN void set_spline(const AxisView<float>& axis) noexcept {
        set(axis, [&](std::uint32_t span) {
            first[span] = static_cast<std::uint8_t>(span);
            const float a = axis.breakpoint(std::int32_t(span)), b = axis.breakpoint(std::int32_t(span + 1));
            return cubic_weights([&](float t) { return spline_weights(axis, Cell<float>{span, a + t * (b - a)}); });
        });
    }
    /// Rows are values at the breakpoints, joined by the cubic through the four nearest; 3 spans and more.
    MEDULLA_FN void set_nodes(const AxisView<float>& axis) noexcept {
        set(axis, [&](std::uint32_t span) {
            const std::uint32_t before = span > 0 ? span - 1 : 0;
            const std::uint32_t from = before + 3 <= axis.spans ? before : axis.spans - 3;
            first[span] = static_cast<std::uint8_t>(from);
            float x[4];
            for (std::uint32_t i = 0; i < 4; ++i) x[i] = axis.breakpoint(std::int32_t(from + i));
            const float a = axis.breakpoint(std::int32_t(span)), b = axis.breakpoint(std::int32_t(span + 1));
            return cubic_weights([&](float t) { return lagrange_weights(x, a + t * (b - a)); });
        });
    }
    /// @param x a spline coordinate, held to the axis's ends; no NaN
    MEDULLA_HOT RowPoint at(float x) const noexcept {
        x = x > lower ? x : lower, x = x < upper ? x : upper;
        const auto stretch = std::int32_t((x - lower) * scale);
        std::uint32_t span = start[stretch < stretches ? stretch : stretches - 1];
        span += std::uint32_t(low[span + 1] <= x) + std::uint32_t(low[span + 2] <= x);
        while (low[span + 1] <= x) ++span;  // where breakpoints are denser than stretches
        return {first[span], weights[span].at((x - low[span]) * inverse[span])};
    }

  private:
    template <class F>
    MEDULLA_FN void set(const AxisView<float>& axis, F&& weights_of) noexcept {
        spans = axis.spans, lower = axis.lower(), upper = axis.upper();
        scale = float(stretches) / (upper - lower);
        for (std::uint32_t span = 0; span < spans; ++span) {
            weights[span] = weights_of(span);
            low[span] = axis.breakpoint(std::int32_t(span)), inverse[span] = axis.number(std::int32_t(span), 1);
        }
        low[spans] = low[spans + 1] = 3.4e38f;
        std::uint32_t span = 0;
        for (int i = 0; i < stretches; ++i) {  // a hundredth of a stretch earlier: no rounding reaches that far
            while (low[span + 1] <= lower + (float(i) - 0.01f) / scale) ++span;
            start[i] = static_cast<std::uint8_t>(span);
        }
    }
};

/// C^N at one (sigma, h): four rows of h, weights of h and sigma.
struct AzimuthalPoint {
    const float* rows;
    Four offset, sigma;
    float inverse_integral;
};

/// C^M of both sides at one theta_i (sigma goes with it).
struct LongitudinalPoint {
    const float* rows;
    Four weight;
};

/// Back and forward density.
struct BackForward {
    float back, forward;
};

/// The tables of one material, 136 KB in memory that the caller keeps for as long as the fibre that reads them.
struct UnfoldedTables {
    float least_root = 0, inverse_range = 0;  ///< sqrt(sigma) runs over [least_root, least_root + 1 / inverse_range]
    CubicWeights sigma_weights;               ///< of four Chebyshev nodes in it
    CubicAxis<most_offset_spans> offset;
    CubicAxis<most_inclination_spans> inclination;
    CubicAxis<most_exit_spans> azimuth, longitude;
    /// Coefficients of the exit spline: [row of h][y >= 0 or y < 0][row of |y|][sigma node].
    alignas(16) float azimuthal[(most_offset_spans + 3) * 2 * (most_exit_spans + 3) * 4];
    alignas(16) float integral[most_offset_spans + 3][4];  ///< over phi: [row of h][sigma node]
    /// The same: [row of theta_i][y >= 0 or y < 0][row of |y|][back, forward].
    alignas(16) float longitudinal[(most_inclination_spans + 1) * 2 * (most_exit_spans + 3) * 2];

    MEDULLA_FN std::uint32_t azimuth_rows() const noexcept { return azimuth.spans + 3; }
    MEDULLA_FN std::uint32_t longitude_rows() const noexcept { return longitude.spans + 3; }

    MEDULLA_HOT Four sigma_at(float sigma) const noexcept {
        const float t = (std::sqrt(sigma) - least_root) * inverse_range;
        return sigma_weights.at(t < 0 ? 0.0f : (t > 1 ? 1.0f : t));
    }
    /// @param sigma what sigma_at gave  @param h offset [medulla radii], in [0, 1]
    MEDULLA_HOT AzimuthalPoint azimuthal_at(Four sigma, float h) const noexcept {
        const RowPoint row = offset.at(spline_coordinate(Quantity::h, h));
        const float* x = integral[row.first];
        const Four sum = spread<0>(row.weight) * four_at(x) + spread<1>(row.weight) * four_at(x + 4) +
                         spread<2>(row.weight) * four_at(x + 8) + spread<3>(row.weight) * four_at(x + 12);
        const float total = sum_of(sum * sigma);
        return {azimuthal + std::size_t(row.first) * 8 * azimuth_rows(), row.weight, sigma,
                total > 1e-30f && total < 1e30f ? 1 / total : 0.0f};
    }
    /// Where exit y lies among an azimuthal point's rows. @param y [radians], |y| < 1e9
    MEDULLA_HOT RowPoint azimuth_exit(float y) const noexcept {
        const float x = y - float(2 * pi) * nearest_integer(y * float(1 / (2 * pi)));
        const RowPoint exit = azimuth.at(x < 0 ? -x : x);
        const std::uint32_t other = 0u - std::uint32_t(x < 0);  // no branch on a sign
        return {4 * (exit.first + (azimuth_rows() & other)), exit.weight};
    }
    /// Density per radian at an exit, >= 0.
    MEDULLA_HOT float azimuthal_density(const AzimuthalPoint& p, const RowPoint& exit) const noexcept {
        const std::uint32_t step = 4 * azimuth_rows();
        const float* row = p.rows + exit.first;
        // h first: its weights are known before the exit's.
        const auto blend = [&](const float* r) {
            return (spread<0>(p.offset) * four_at(r) + spread<1>(p.offset) * four_at(r + 2 * step)) +
                   (spread<2>(p.offset) * four_at(r + 4 * step) + spread<3>(p.offset) * four_at(r + 6 * step));
        };
        const Four sum = (spread<0>(exit.weight) * blend(row) + spread<1>(exit.weight) * blend(row + 4)) +
                         (spread<2>(exit.weight) * blend(row + 8) + spread<3>(exit.weight) * blend(row + 12));
        const float value = sum_of(sum * p.sigma) * p.inverse_integral;
        return value < 0 ? 0.0f : value;
    }
    MEDULLA_HOT float azimuthal_density(const AzimuthalPoint& p, float y) const noexcept {
        return azimuthal_density(p, azimuth_exit(y));
    }
    /// @param theta_i [radians], in [0, pi/2]
    MEDULLA_HOT LongitudinalPoint longitudinal_at(float theta_i) const noexcept {
        const RowPoint row = inclination.at(spline_coordinate(Quantity::theta_i, theta_i));
        return {longitudinal + std::size_t(row.first) * 4 * longitude_rows(), row.weight};
    }
    /// Where exit y lies among a longitudinal point's rows. @param y [radians], in [-pi/2, pi/2]
    MEDULLA_HOT RowPoint longitude_exit(float y) const noexcept {
        const RowPoint exit = longitude.at(y < 0 ? -y : y);
        const std::uint32_t other = 0u - std::uint32_t(y < 0);
        return {2 * (exit.first + (longitude_rows() & other)), exit.weight};
    }
    /// Densities per radian at an exit, >= 0.
    MEDULLA_HOT BackForward longitudinal_density(const LongitudinalPoint& p, const RowPoint& exit) const noexcept {
        const std::uint32_t step = 2 * longitude_rows();
        const float* row = p.rows + exit.first;
        const auto blend = [&](const float* r) {
            return (spread<0>(p.weight) * four_at(r) + spread<1>(p.weight) * four_at(r + 2 * step)) +
                   (spread<2>(p.weight) * four_at(r + 4 * step) + spread<3>(p.weight) * four_at(r + 6 * step));
        };
        const Four sum = lower_twice(exit.weight) * blend(row) + upper_twice(exit.weight) * blend(row + 4);
        const float back = lane(sum, 0) + lane(sum, 2), forward = lane(sum, 1) + lane(sum, 3);
        return {back < 0 ? 0.0f : back, forward < 0 ? 0.0f : forward};
    }
    MEDULLA_HOT BackForward longitudinal_density(const LongitudinalPoint& p, float y) const noexcept {
        return longitudinal_density(p, longitude_exit(y));
    }
};

namespace detail {

/// Calls put(k, positive, negative) with the coefficients of the contracted lobe for y >= 0 and y < 0.
template <class Put>
MEDULLA_FN void exit_coefficients(const TableView& view, const float* weight, Put&& put) noexcept {
    const std::uint32_t k = view.parameter_axes(), even = view.even_stride(), all = view.layout.rank_stride;
    for (std::uint32_t row = 0; row < view.layout.axes[k].spans + 3; ++row) {
        const float e = row_sum(view, k, row, weight, 0, even), o = row_sum(view, k, row, weight, even, all);
        put(row, e + o, e - o);
    }
}

/// integral over y of the contracted lobe.
MEDULLA_FN float exit_integral(const TableView& view, const float* weight) noexcept {
    float sum = 0;
    for (std::uint32_t r = 0; r < view.even_stride(); ++r)
        sum += weight[r] * load<float>(view.bytes + view.layout.integrals_offset + 4 * r);
    return sum;
}

}  // namespace detail

}  // namespace medulla
