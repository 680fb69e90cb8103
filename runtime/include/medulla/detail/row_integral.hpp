// The positive part of one row of a table over a span: its integral and the place below which a given share of it lies.
// A row is a cubic on a span, given by four B-spline coefficients; where they are all >= 0 so is the cubic.
#pragma once

#include <cmath>

#include "medulla/config.hpp"
#include "medulla/detail/spline_axis.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// Four coefficients of a row, `stride` floats apart.
struct RowCoefficients {
    float c[4];
    MEDULLA_HOT RowCoefficients(const float* row, std::uint32_t stride) noexcept
        : c{row[0], row[stride], row[2 * stride], row[3 * stride]} {}
    MEDULLA_HOT bool positive() const noexcept { return c[0] >= 0 && c[1] >= 0 && c[2] >= 0 && c[3] >= 0; }
    MEDULLA_HOT float dot(const float (&w)[4]) const noexcept {
        return (w[0] * c[0] + w[1] * c[1]) + (w[2] * c[2] + w[3] * c[3]);
    }
};

/// A cubic in the distance from a span's middle.
struct Cubic {
    float p[4];
    MEDULLA_FN Cubic(const SplineSpan& span, const RowCoefficients& row) noexcept
        : p{row.dot(span.weights.power[0]), row.dot(span.weights.power[1]), row.dot(span.weights.power[2]),
            row.dot(span.weights.power[3])} {}
    MEDULLA_FN float at(float x) const noexcept { return p[0] + x * (p[1] + x * (p[2] + x * p[3])); }
    /// Integral over [a, b].
    MEDULLA_FN float integral(float a, float b) const noexcept {
        const auto to = [&](float x) {
            return x * (p[0] + x * (0.5f * p[1] + x * (float(1.0 / 3) * p[2] + x * 0.25f * p[3])));
        };
        return to(b) - to(a);
    }
};

/// Integral over [a, b] of max(0, f): between its ends and where it is stationary a cubic is monotone, and there a sign
/// change is bisected to the last bit.
MEDULLA_FN float positive_integral(const Cubic& f, float a, float b) noexcept {
    float end[4] = {a, b, b, b};
    int parts = 1;
    const float discriminant = f.p[2] * f.p[2] - 3 * f.p[1] * f.p[3];
    if (discriminant > 0) {
        const float root = std::sqrt(discriminant), q = -(f.p[2] + (f.p[2] < 0 ? -root : root));
        const float s = f.p[3] != 0 ? q / (3 * f.p[3]) : a, t = q != 0 ? f.p[1] / q : a;
        const float ascending[2] = {s < t ? s : t, s < t ? t : s};
        for (const float x : ascending)
            if (x > end[parts - 1] && x < b) end[parts++] = x;
        end[parts] = b;
    }
    float sum = 0;
    for (int i = 0; i < parts; ++i) {
        float l = end[i], r = end[i + 1];
        const bool left = f.at(l) > 0, right = f.at(r) > 0;
        if (!left && !right) continue;
        if (left != right) {
            float positive = left ? l : r, other = left ? r : l;
            for (int k = 0; k < 26; ++k) {
                const float middle = 0.5f * (positive + other);
                (f.at(middle) > 0 ? positive : other) = middle;
            }
            (left ? r : l) = positive;
        }
        const float part = f.integral(l, r);
        sum += part > 0 ? part : 0.0f;
    }
    return sum;
}

/// Integral of a row's positive part over a span [stretches times density].
MEDULLA_FN float span_mass(const SplineSpan& span, const RowCoefficients& row) noexcept {
    if (row.positive()) return row.dot(span.integral);
    return positive_integral(Cubic(span, row), -span.half, span.half);
}

/// The place from the span's middle [stretches] below which `mass` of a row's positive part lies, 0 <= mass <= whole,
/// that of the span. Newton's steps from where the straight line through the cubic's ends has it: two where the cubic is
/// a density all along, and more, kept in a bracket, where it is cut at 0.
MEDULLA_HOT float invert_span(const SplineSpan& span, const RowCoefficients& row, float mass, float whole) noexcept {
    const Cubic f(span, row);
    const float half = span.half, a = f.at(-half), b = f.at(half);
    if (a > 0 && b > 0 && row.positive()) {
        // Along a straight line from a to b the share t of the span has (a + (b - a) t / 2) t of its mass.
        const float share = mass / whole, t = share * (a + b) / (a + std::sqrt(a * a + share * (b - a) * (b + a)));
        float x = half * (2 * t - 1);
        const float from = f.integral(0, -half) + mass;
        for (int i = 0; i < 2; ++i) x -= (f.integral(0, x) - from) / f.at(x);
        return x;
    }
    float low = -half, high = half, x = low + 2 * half * (whole > 0 ? mass / whole : 0.5f);
    for (int i = 0; i < 40 && high - low > 1e-6f * half; ++i) {
        const float error = positive_integral(f, -half, x) - mass;
        (error > 0 ? high : low) = x;
        const float density = f.at(x), next = x - error / (density > 0 ? density : 1.0f);
        const float to = density > 0 && next > low && next < high ? next : 0.5f * (low + high);
        const bool done = std::abs(to - x) < 1e-6f * half;
        x = to;
        if (done) break;
    }
    return x;
}

/// Spans of a block of cumulated integrals: a draw finds its block among these, and its span within.
inline constexpr std::uint32_t block_spans = 4;
/// Blocks of an exit axis: of y >= 0, then of y < 0; padded to a multiple of four by blocks of no mass.
MEDULLA_HOT std::uint32_t half_blocks(const SplineAxis& axis) noexcept {
    return (axis.spans + block_spans - 1) / block_spans;
}
MEDULLA_HOT std::uint32_t block_count(const SplineAxis& axis) noexcept { return (2 * half_blocks(axis) + 3) / 4 * 4; }

/// Draws an exit from the positive part of one row: exactly, by inverting its integral.
/// @param row its first coefficient; from |y| to |y| they are `stride` floats apart
/// @param blocks cumulated integrals, the last is 1  @param u in [0, 1]
MEDULLA_HOT float draw_from_row(const SplineAxis& axis, const float* row, std::uint32_t stride, const float* blocks,
                                float u) noexcept {
    u = u < 0.99999994f ? u : 0.99999994f;
    const std::uint32_t count = block_count(axis), half = half_blocks(axis);
    std::uint32_t block = 0;
    for (std::uint32_t b = 0; b < count; b += 4) block += count_of(Four(u) < four_at(blocks + b));
    block = count - block;  // the first whose cumulated integral is above u
    const bool below = block >= half;
    const std::uint32_t first = (below ? block - half : block) * block_spans;
    if (below) row += std::size_t(axis.rows) * stride;
    row += std::size_t(first) * stride;
    float rest = (u - (block > 0 ? blocks[block - 1] : 0.0f)) * axis.scale, mass = 0;
    const std::uint32_t most = axis.spans - first < block_spans ? axis.spans - first : block_spans;
    std::uint32_t span = 0;
    for (std::uint32_t s = 0; s < most; ++s) {
        const float here = span_mass(axis.span(first + s), RowCoefficients(row + std::size_t(s) * stride, stride));
        if (!(here > 0)) continue;
        rest -= mass;  // past the span before
        span = s, mass = here;
        if (rest < here) break;
    }
    const SplineSpan& at = axis.span(first + span);
    rest = rest > 0 ? (rest < mass ? rest : mass) : 0.0f;
    float place = at.middle + invert_span(at, RowCoefficients(row + std::size_t(span) * stride, stride), rest, mass);
    place = place > 0 ? (place < axis.end ? place : axis.end) : 0.0f;
    return below ? -place / axis.scale : place / axis.scale;
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
