// An axis of dense tables: cubic B-spline weights as polynomials of the place in a span, read and not recomputed. It
// lies in the tables' own memory, at offsets from the axis itself. Rests on medulla/axis.hpp's coordinates.
#pragma once

#include <cstdint>

#include "medulla/axis.hpp"
#include "medulla/config.hpp"
#include "medulla/detail/lanes.hpp"
#include "medulla/detail/math.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// Four neighbouring rows of an axis and their weights, >= 0, sum 1.
struct RowPoint {
    std::uint32_t first;
    Four weight;
};

/// Four weights that are cubics in a place, counted from the middle of a span so that little rounds.
struct CubicWeights {
    alignas(16) float power[4][4];  ///< [power of the place][row]

    MEDULLA_HOT Four at(Four x) const noexcept {
        return (aligned_four_at(power[0]) + x * aligned_four_at(power[1])) +
               (x * x) * (aligned_four_at(power[2]) + x * aligned_four_at(power[3]));
    }
};

/// A span: its weights, and what drawing from it needs.
struct SplineSpan {
    CubicWeights weights;
    alignas(16) float by_row[4][4];  ///< the same weights, [row][power]
    alignas(16) float integral[4];   ///< of each row's weight over the span [stretches]
    float middle, half;              ///< of the span [stretches]
    float unused[2];
};
static_assert(sizeof(SplineSpan) == 160, "one layout everywhere");

/// Integrals of four neighbouring spans' row weights, for masses of all four at once.
struct SplineBlock {
    alignas(16) float integral[4][4];  ///< [row less the span][span]; 0 beyond the axis
};
inline constexpr std::uint32_t block_spans = 4;

/// Even stretches say which span a coordinate lies in. Where a breakpoint is not the end of a stretch, the nearest end
/// is used instead; there the cubics of two neighbours differ by the cube of the distance, at most a 32nd of a span.
struct SplineAxis {
    float lower, scale, end;      ///< coordinate of the lower end; stretches per unit; number of stretches
    float inverse_scale;          ///< 1 / scale
    std::uint32_t spans, rows;    ///< rows = spans + 3
    std::uint32_t spans_offset;   ///< SplineSpan[spans], bytes from this axis
    std::uint32_t start_offset;   ///< std::uint16_t[stretches + 1]: the span at the middle of a stretch
    std::uint32_t blocks_offset;  ///< SplineBlock[blocks]

    MEDULLA_HOT const SplineSpan& span(std::uint32_t i) const noexcept {
        return reinterpret_cast<const SplineSpan*>(reinterpret_cast<const char*>(this) + spans_offset)[i];
    }
    MEDULLA_HOT std::uint32_t blocks() const noexcept { return (spans + block_spans - 1) / block_spans; }
    MEDULLA_HOT const SplineBlock& block(std::uint32_t i) const noexcept {
        return reinterpret_cast<const SplineBlock*>(reinterpret_cast<const char*>(this) + blocks_offset)[i];
    }
    MEDULLA_HOT std::uint32_t start(std::uint32_t stretch) const noexcept {
        return reinterpret_cast<const std::uint16_t*>(reinterpret_cast<const char*>(this) + start_offset)[stretch];
    }
    /// Rows and weights at a place [stretches], in [0, end].
    MEDULLA_HOT RowPoint at_place(std::uint32_t stretch, float place) const noexcept {
        const std::uint32_t i = start(stretch);
        const SplineSpan& s = span(i);
        return {i, s.weights.at(Four(place - s.middle))};
    }
    /// Rows and weights at a spline coordinate; clamped to the ends of the axis. A NaN gives the lower end's rows and
    /// NaN weights. A weight that is 0 may round to -1e-8, which would make a lobe negative where all else is 0.
    MEDULLA_HOT RowPoint at(float coordinate) const noexcept {
        const float u = (coordinate - lower) * scale, v = u < 0 ? 0.0f : (u > end ? end : u);
        const RowPoint p = at_place(v > 0 ? std::uint32_t(std::int32_t(v)) : 0u, v);
        return {p.first, greater(Four(0.0f), p.weight)};
    }
};
static_assert(sizeof(SplineAxis) == 36, "one layout everywhere");

/// Spans at most: a stretch's span is a std::uint16_t, and tables stay within 4 GiB.
inline constexpr std::uint32_t most_table_spans = 1024;
inline constexpr std::uint32_t most_stretches = 4096;

/// How an axis is laid out: breakpoints and two knots beyond either end, in spline coordinates.
struct AxisPlan {
    std::uint32_t spans = 0;
    double t[most_table_spans + 5] = {};  ///< knot i at t[i + 2], -2 <= i <= spans + 2

    MEDULLA_FN double knot(std::int32_t i) const noexcept { return t[i + 2]; }
    MEDULLA_FN double lower() const noexcept { return knot(0); }
    MEDULLA_FN double upper() const noexcept { return knot(std::int32_t(spans)); }
    /// The four cubic basis functions that are not 0 on a span, at x there (Cox and de Boor's recurrence).
    MEDULLA_FN void weights(std::uint32_t span, double x, double (&w)[4]) const noexcept {
        const auto i = std::int32_t(span);
        w[0] = 1;
        for (int degree = 1; degree < 4; ++degree) {
            double saved = 0;
            for (int r = 0; r < degree; ++r) {
                const double right = knot(i + r + 1), left = knot(i + r + 1 - degree), part = w[r] / (right - left);
                w[r] = saved + (right - x) * part;
                saved = (x - left) * part;
            }
            w[degree] = saved;
        }
    }
    /// Even stretches such that breakpoints are their ends, where there are few enough, else as many as there may be.
    MEDULLA_FN std::uint32_t stretches() const noexcept {
        const double length = upper() - lower();
        for (std::uint32_t n = spans; n <= most_stretches; ++n) {
            bool ends = true;
            for (std::uint32_t i = 1; ends && i < spans; ++i) {
                const double u = (knot(std::int32_t(i)) - lower()) / length * n, whole = detail::math::floor(u + 0.5);
                ends = detail::math::abs(u - whole) < 1e-3;
            }
            if (ends) return n;
        }
        return most_stretches;
    }
};

/// A pack's axis as it is.
MEDULLA_FN void plan_axis(const AxisView<float>& axis, AxisPlan& plan) noexcept {
    plan.spans = axis.spans;
    for (std::int32_t i = -2; i <= std::int32_t(axis.spans) + 2; ++i) plan.t[i + 2] = double(axis.breakpoint(i));
}
/// An axis of our own: knots beyond an end repeat it, so that no row lies outside the range. @param step of x to the
/// next breakpoint, before steps are scaled to end at `upper`
template <class Step>
MEDULLA_FN void plan_range(double lower, double upper, Step&& step, AxisPlan& plan) noexcept {
    double x = lower;
    std::uint32_t n = 0;
    for (; x < upper && n < most_table_spans; ++n) plan.t[n + 2] = x, x += step(x);
    for (std::uint32_t i = 1; i < n; ++i)
        plan.t[i + 2] = lower + (plan.t[i + 2] - lower) * (upper - lower) / (x - lower);
    plan.spans = n;
    plan.t[0] = plan.t[1] = lower;
    plan.t[n + 2] = plan.t[n + 3] = plan.t[n + 4] = upper;
}
/// Whether every span is the whole stretches that `SplineAxis` needs.
MEDULLA_FN bool fits(const AxisPlan& plan) noexcept {
    if (plan.spans < 1 || plan.spans > most_table_spans) return false;
    const std::uint32_t n = plan.stretches();
    const double stretch = (plan.upper() - plan.lower()) / double(n);
    for (std::uint32_t i = 0; n == most_stretches && i < plan.spans; ++i)
        if (!(plan.knot(std::int32_t(i) + 1) - plan.knot(std::int32_t(i)) > 16 * stretch)) return false;
    return true;
}

/// Writes an axis into memory that is 0. @param spans, start, blocks where its arrays lie, at the offsets it has
MEDULLA_FN void write_axis(const AxisPlan& plan, std::uint32_t stretches, SplineAxis& axis, SplineSpan* spans,
                           std::uint16_t* start, SplineBlock* blocks) noexcept {
    const double lower = plan.lower(), scale = double(stretches) / (plan.upper() - lower);
    axis.lower = float(lower);
    axis.scale = float(scale);
    axis.end = float(stretches);
    axis.inverse_scale = float(1 / scale);
    axis.spans = plan.spans;
    axis.rows = plan.spans + 3;
    std::uint32_t from = 0;
    for (std::uint32_t i = 0; i < plan.spans; ++i) {
        const double a = plan.knot(std::int32_t(i)), b = plan.knot(std::int32_t(i) + 1);
        SplineSpan& s = spans[i];
        s.middle = float(0.5 * (a + b - 2 * lower) * scale);
        s.half = float(0.5 * (b - a) * scale);
        s.unused[0] = s.unused[1] = 0;
        double at[4][4];
        for (int k = 0; k < 4; ++k) plan.weights(i, a + (b - a) * k / 3, at[k]);
        double excess[4] = {-1, 0, 0, 0};
        const double span_length = (b - a) * scale;
        int largest = 0;
        for (int r = 0; r < 4; ++r) {
            const double p = at[0][r], q = at[1][r], u = at[2][r], v = at[3][r];
            const double power[4] = {(9 * (q + u) - (p + v)) / 16, (27 * (u - q) - (v - p)) / 8,
                                     2.25 * ((p + v) - (q + u)), 4.5 * ((v - p) - 3 * (u - q))};
            double unit = 1;
            for (int k = 0; k < 4; ++k, unit /= span_length) {
                s.weights.power[k][r] = float(power[k] * unit);
                excess[k] += double(s.weights.power[k][r]);
            }
            if (at[1][r] + at[2][r] > at[1][largest] + at[2][largest]) largest = r;
        }
        // Weights add up to 1 to the rounding of their sum.
        for (int k = 0; k < 4; ++k)
            s.weights.power[k][largest] = float(double(s.weights.power[k][largest]) - excess[k]);
        for (int r = 0; r < 4; ++r)
            s.integral[r] = float(span_length * (double(s.weights.power[0][r]) +
                                                 span_length * span_length / 12 * double(s.weights.power[2][r])));
        for (int r = 0; r < 4; ++r) {
            for (int k = 0; k < 4; ++k) s.by_row[r][k] = s.weights.power[k][r];
            blocks[i / block_spans].integral[r][i % block_spans] = s.integral[r];
        }
        for (const double next = (b - lower) * scale; from < stretches && double(from) + 0.5 < next; ++from)
            start[from] = static_cast<std::uint16_t>(i);
    }
    while (from <= stretches) start[from++] = static_cast<std::uint16_t>(plan.spans - 1);
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
