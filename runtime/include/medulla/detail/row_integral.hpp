// The positive part of one row of a table over a span: its integral and the place below which a given share of it lies.
// A row is a cubic on a span, given by four B-spline coefficients; where they are all >= 0 so is the cubic.
#pragma once

#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"
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
    MEDULLA_HOT Cubic(const SplineSpan& span, const RowCoefficients& row) noexcept {
        store_four(
            (Four(row.c[0]) * aligned_four_at(span.by_row[0]) + Four(row.c[1]) * aligned_four_at(span.by_row[1])) +
                (Four(row.c[2]) * aligned_four_at(span.by_row[2]) + Four(row.c[3]) * aligned_four_at(span.by_row[3])),
            p);
    }
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
MEDULLA_APART float positive_integral(const Cubic& f, float a, float b) noexcept {
    float end[4] = {a, b, b, b};
    int parts = 1;
    const float discriminant = f.p[2] * f.p[2] - 3 * f.p[1] * f.p[3];
    if (discriminant > 0) {
        const float root = detail::math::sqrt(discriminant), q = -(f.p[2] + (f.p[2] < 0 ? -root : root));
        const float s = bits_of(f.p[3]) << 1 ? q / (3 * f.p[3]) : a, t = bits_of(q) << 1 ? f.p[1] / q : a;
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
MEDULLA_APART float span_mass(const SplineSpan& span, const RowCoefficients& row) noexcept {
    if (row.positive()) return row.dot(span.integral);
    return positive_integral(Cubic(span, row), -span.half, span.half);
}

/// The same where the cubic is cut at 0, or steep.
MEDULLA_APART float invert_cut_span(const Cubic& f, float half, float mass, float whole) noexcept {
    float low = -half, high = half, x = low + 2 * half * (whole > 0 ? mass / whole : 0.5f);
    for (int i = 0; i < 40 && high - low > 1e-6f * half; ++i) {
        const float error = positive_integral(f, -half, x) - mass;
        (error > 0 ? high : low) = x;
        const float density = f.at(x), next = x - error / (density > 0 ? density : 1.0f);
        const float to = density > 0 && next > low && next < high ? next : 0.5f * (low + high);
        const bool done = detail::math::abs(to - x) < 1e-6f * half;
        x = to;
        if (done) break;
    }
    return x;
}

/// The place from the span's middle [stretches] below which `mass` of a row's positive part lies, 0 <= mass <= whole,
/// that of the span. Where the cubic is a density all along: one step of third order (Chebyshev's) from where the
/// straight line between the cubic's ends has it; else Newton's steps, kept in a bracket.
MEDULLA_HOT float invert_span(const SplineSpan& span, const RowCoefficients& row, float mass, float whole) noexcept {
    const Cubic f(span, row);
    const float half = span.half, a = f.at(-half), b = f.at(half);
    if (row.positive() && a > 0.25f * b && b > 0.25f * a) {
        // Along a straight line from a to b the share t of the span has (a + (b - a) t / 2) t of its mass; this is its
        // inverse to second order in (b - a) / (b + a).
        const float share = mass / whole, tilt = (a - b) / (a + b), t = share + tilt * share * (share - 1);
        const float x = half * (2 * t - 1), inverse = 1 / f.at(x);
        const float step = (f.integral(-half, x) - mass) * inverse;
        const float slope = f.p[1] + x * (2 * f.p[2] + 3 * x * f.p[3]);
        const float to = x - step * (1 + 0.5f * step * slope * inverse);
        return to > -half ? (to < half ? to : half) : -half;
    }
    return invert_cut_span(f, half, mass, whole);
}

/// Cumulated integrals of a row: of the blocks of y >= 0, then of y < 0, padded with 1 to a multiple of four.
MEDULLA_HOT std::uint32_t block_count(const SplineAxis& axis) noexcept { return (2 * axis.blocks() + 3) / 4 * 4; }

/// Which of four ascending intervals `rest` lies in, by their masses, and what it is within: one with a mass.
struct SpanDraw {
    std::uint32_t span;
    float mass, rest;
};
MEDULLA_HOT SpanDraw draw_span(const float (&mass)[4], float rest) noexcept {
    const float first = mass[0], second = first + mass[1], third = second + mass[2];
    const float below[4] = {0, first, second, third};
    std::uint32_t span = std::uint32_t(rest >= first) + std::uint32_t(rest >= second) + std::uint32_t(rest >= third);
    while (span > 0 && !(mass[span] > 0)) --span;  // past the sum, by its rounding
    rest -= below[span];
    return {span, mass[span], greater(0.0f, lesser(rest, mass[span]))};
}

/// The block of a row in which a number u lies, and how far within.
struct BlockDraw {
    std::uint32_t block;
    float rest;  ///< of u beyond the blocks before it
};
/// @param cumulated integrals of the row's blocks, the last is 1  @param u in [0, 1)
MEDULLA_HOT BlockDraw draw_block(const SplineAxis& axis, const float* cumulated, float u) noexcept {
    const std::uint32_t count = block_count(axis);
    Four above;  // how many are above u, a float a lane
    for (std::uint32_t b = 0; b < count; b += 4)
        above = above + only_where(Four(u) < four_at(cumulated + b), Four(1.0f));
    const std::uint32_t block = count - std::uint32_t(std::int32_t(sum_of(above)));
    return {block, u - (block > 0 ? cumulated[block - 1] : 0.0f)};
}
/// A random number of [0, 1] kept below 1.
MEDULLA_HOT float below_1(float u) noexcept { return lesser(u, 0.99999994f); }

/// Draws an exit from the positive part of one row, within a block: exactly, by inverting its integral.
/// @param row its first coefficient; from |y| to |y| they are `stride` floats apart
MEDULLA_HOT float place_in_block(const SplineAxis& axis, const float* row, std::uint32_t stride,
                                 BlockDraw block) noexcept {
    const std::uint32_t half = axis.blocks(), below = std::uint32_t(block.block >= half);
    const std::uint32_t first = block.block - below * half;
    row += (below * axis.rows + first * block_spans) * stride;
    const float rest = block.rest * axis.scale;
    // Rows past the axis are read, from what lies behind, and count for nothing: their integrals are 0.
    const float* const r3 = row + 3 * std::size_t(stride);
    float mass[4] = {},
          c[7] = {row[0], row[stride], row[2 * stride], r3[0], r3[stride], r3[2 * stride], r3[3 * stride]};
    const Four c0(c[0], c[1], c[2], c[3]), c1(c[1], c[2], c[3], c[4]), c2(c[2], c[3], c[4], c[5]),
        c3(c[3], c[4], c[5], c[6]);
    if (!any(lesser(c0, c3) < Four(0.0f))) {
        const SplineBlock& at = axis.block(first);
        store_four((c0 * aligned_four_at(at.integral[0]) + c1 * aligned_four_at(at.integral[1])) +
                       (c2 * aligned_four_at(at.integral[2]) + c3 * aligned_four_at(at.integral[3])),
                   mass);
    } else {
        const std::uint32_t spans = axis.spans - first * block_spans;
        for (std::uint32_t s = 0; s < 4 && s < spans; ++s)
            mass[s] = span_mass(axis.span(first * block_spans + s), RowCoefficients(c + s, 1));
    }
    const SpanDraw drawn = draw_span(mass, rest);
    const SplineSpan& at = axis.span(first * block_spans + drawn.span);
    const float place = at.middle + invert_span(at, RowCoefficients(c + drawn.span, 1), drawn.rest, drawn.mass);
    return with_sign(greater(0.0f, lesser(place, axis.end)) * axis.inverse_scale, 0.5f - float(below));
}
/// The same, apart, since both angles share it.
MEDULLA_FN float invert_block(const SplineAxis& axis, const float* row, std::uint32_t stride,
                              BlockDraw block) noexcept {
    return run_fused([&] { return place_in_block(axis, row, stride, block); });
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
