// A material's tables multiplied out. g is fixed and sigma moves over [1, eta / sqrt(eta^2 - 1)] times its least value
// only, so what is left of a table is small enough to hold dense: a lookup is then a few dozen products, whatever the
// rank. Rests on lookup.hpp, whose contractions are the slow twin; docs/bcsdf.md, 'Unfolded tables', has the errors.
#pragma once

#include <cmath>
#include <cstdint>

#include "medulla/held_integral.hpp"
#include "medulla/lanes.hpp"
#include "medulla/lookup.hpp"

namespace medulla {

/// Spans that there is room for; the default pack fits.
inline constexpr std::uint32_t most_offset_spans = 24, most_inclination_spans = 68, most_exit_spans = 64;

/// Angles in turns, less whole ones, in [-1/2, 1/2]. @param y [radians], |y| < 1e9
MEDULLA_HOT Four turns_of(Four y) noexcept {
    const Four t = y * Four(float(1 / (2 * pi)));
    return t - nearest_integer(t);
}

/// Four neighbouring rows of an axis and their weights.
struct RowPoint {
    std::uint32_t first;
    Four weight;
};

/// Four weights that are cubics in t in [0, 1]: read, not recomputed.
struct CubicWeights {
    alignas(16) float power[4][4];  ///< [power of t][row]

    MEDULLA_HOT Four at(float t) const noexcept {
        const Four x(t);
        return (aligned_four_at(power[0]) + x * aligned_four_at(power[1])) +
               (x * x) * (aligned_four_at(power[2]) + x * aligned_four_at(power[3]));
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

/// A span of an axis.
struct CubicSpan {
    CubicWeights weights;      ///< of its four rows, over the place within it
    float low, high, inverse;  ///< its ends and 1 / its length [stretches]; the last one's upper end is out of reach
    std::uint32_t first;       ///< of its four rows
};

/// An axis of a pack with the weights of each of its spans. Even stretches say which span a value lies in; breakpoints
/// fall on their ends where that can be had (those of exits do, being whole bins apart), so that none is searched.
template <std::uint32_t Most>
struct CubicAxis {
    static constexpr std::int32_t most_stretches = 720;
    std::uint32_t spans = 0;
    std::int32_t stretches = 0;
    float lower, upper, scale;               ///< scale = stretches / (upper - lower)
    std::uint8_t start[most_stretches + 1];  ///< the span at the beginning of the stretch; one more for the upper end
    alignas(16) CubicSpan span[Most];

    /// Rows are the pack's spline coefficients.
    MEDULLA_FN void set_spline(const AxisView<float>& axis) noexcept {
        set(
            axis.spans, [&](std::uint32_t i) { return axis.breakpoint(std::int32_t(i)); },
            [&](std::uint32_t i, float a, float b) {
                span[i].first = i;
                return cubic_weights([&](float t) { return spline_weights(axis, Cell<float>{i, a + t * (b - a)}); });
            });
    }
    /// Rows are values at count + 1 ascending nodes, joined by the cubic through the four nearest; count >= 3.
    MEDULLA_FN void set_nodes(std::uint32_t count, const float* node) noexcept {
        set(
            count, [&](std::uint32_t i) { return node[i]; },
            [&](std::uint32_t i, float a, float b) {
                const std::uint32_t before = i > 0 ? i - 1 : 0, from = before + 3 <= count ? before : count - 3;
                span[i].first = from;
                const float x[4] = {node[from], node[from + 1], node[from + 2], node[from + 3]};
                return cubic_weights([&](float t) { return lagrange_weights(x, a + t * (b - a)); });
            });
    }
    /// @param x a spline coordinate, held to the axis's ends; no NaN
    MEDULLA_HOT RowPoint at(float x) const noexcept {
        x = x > lower ? x : lower, x = x < upper ? x : upper;
        const float u = (x - lower) * scale;
        const auto stretch = std::int32_t(u);
        return at(stretch < stretches ? stretch : stretches, u);
    }
    /// @param u a place [stretches] on the axis, in stretch `stretch`
    MEDULLA_HOT RowPoint at(std::int32_t stretch, float u) const noexcept {
        const CubicSpan* s = span + start[stretch];
        while (s->high <= u) ++s;  // where a breakpoint lies within the stretch
        return {s->first, s->weights.at((u - s->low) * s->inverse)};
    }

  private:
    template <class Breakpoint, class F>
    MEDULLA_FN void set(std::uint32_t count, Breakpoint&& breakpoint, F&& weights_of) noexcept {
        spans = count, lower = breakpoint(0), upper = breakpoint(count);
        // Rounding moves a place by 1e-4 stretches, so within 1e-3 of an end is the end; the cubic of the neighbouring
        // span is there the same to the third power of that.
        constexpr float near = 1e-3f;
        const auto on_ends = [&](std::int32_t n) {
            for (std::uint32_t i = 1; i < spans; ++i) {
                const float u = (breakpoint(i) - lower) * float(n) / (upper - lower);
                if (magnitude(u - nearest_integer(u)) > near) return false;
            }
            return true;
        };
        stretches = std::int32_t(spans);
        while (stretches < most_stretches && !on_ends(stretches)) ++stretches;
        scale = float(stretches) / (upper - lower);
        for (std::uint32_t i = 0; i < spans; ++i) {
            const float a = breakpoint(i), b = breakpoint(i + 1);
            span[i].weights = weights_of(i, a, b);
            span[i].low = (a - lower) * scale, span[i].high = (b - lower) * scale;
            span[i].inverse = 1 / (span[i].high - span[i].low);
        }
        std::uint32_t at = 0;
        for (std::int32_t i = 0; i <= stretches; ++i) {
            while (at + 1 < spans && span[at].high <= float(i) + near) ++at;
            start[i] = static_cast<std::uint8_t>(at);
        }
        for (std::uint32_t i = 0; i + 1 < spans; ++i) span[i].high += near;
        span[spans - 1].high = 3.4e38f;
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

/// Four exits on axes that are symmetric about 0: how far from 0 [stretches], and which lanes lie below it.
struct ExitPlaces {
    std::int32_t stretch[4];
    float place[4];
    unsigned below;
};

/// @param turns exits less whole turns, in [-1/2, 1/2]  @param scale stretches per turn
MEDULLA_HOT ExitPlaces exit_places(Four turns, Four scale) noexcept {
    ExitPlaces p;
    const Four u = magnitude(turns) * scale;
    store_whole(u, p.stretch), store_four(u, p.place);
    p.below = below_zero(turns);
    return p;
}

/// The tables of one material, 149 KB in memory that the caller keeps for as long as the fibre that reads them.
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
        const Four sum =
            (spread<0>(row.weight) * aligned_four_at(x) + spread<1>(row.weight) * aligned_four_at(x + 4)) +
            (spread<2>(row.weight) * aligned_four_at(x + 8) + spread<3>(row.weight) * aligned_four_at(x + 12));
        const float total = sum_of(sum * sigma);
        return {azimuthal + std::size_t(row.first) * 8 * azimuth_rows(), row.weight, sigma,
                total > 1e-30f && total < 1e30f ? 1 / total : 0.0f};
    }
    MEDULLA_HOT float azimuth_scale() const noexcept { return float(2 * azimuth.stretches); }
    MEDULLA_HOT float longitude_scale() const noexcept { return float(4 * longitude.stretches); }

    /// Where exit i lies among an azimuthal point's rows.
    MEDULLA_HOT RowPoint azimuth_exit(const ExitPlaces& p, int i) const noexcept {
        const RowPoint exit = azimuth.at(p.stretch[i], p.place[i]);
        return {4 * (exit.first + azimuth_rows() * (p.below >> i & 1u)), exit.weight};
    }
    /// Where exit i lies among a longitudinal point's rows.
    MEDULLA_HOT RowPoint longitude_exit(const ExitPlaces& p, int i) const noexcept {
        const RowPoint exit = longitude.at(p.stretch[i], p.place[i]);
        return {2 * (exit.first + longitude_rows() * (p.below >> i & 1u)), exit.weight};
    }
    /// Density per radian at an exit, >= 0.
    MEDULLA_HOT float azimuthal_density(const AzimuthalPoint& p, const RowPoint& exit) const noexcept {
        const std::uint32_t step = 8 * azimuth_rows();
        const float *r0 = p.rows + exit.first, *r1 = r0 + step, *r2 = r1 + step, *r3 = r2 + step;
        // h first: its weights are known before the exit's.
        const auto blend = [&](int k) {
            return (spread<0>(p.offset) * aligned_four_at(r0 + k) + spread<1>(p.offset) * aligned_four_at(r1 + k)) +
                   (spread<2>(p.offset) * aligned_four_at(r2 + k) + spread<3>(p.offset) * aligned_four_at(r3 + k));
        };
        const Four sum = (spread<0>(exit.weight) * blend(0) + spread<1>(exit.weight) * blend(4)) +
                         (spread<2>(exit.weight) * blend(8) + spread<3>(exit.weight) * blend(12));
        const float value = sum_of(sum * p.sigma) * p.inverse_integral;
        return 0.0f > value ? 0.0f : value;  // a NaN stays one
    }
    /// @param y [radians], |y| < 1e9
    MEDULLA_HOT float azimuthal_density(const AzimuthalPoint& p, float y) const noexcept {
        return azimuthal_density(p, azimuth_exit(exit_places(turns_of(Four(y)), Four(azimuth_scale())), 0));
    }
    /// At two exits, as TTs and TRTs ask.
    MEDULLA_HOT void azimuthal_densities(const AzimuthalPoint& p, float y0, float y1, float (&N)[2]) const noexcept {
        const ExitPlaces at = exit_places(turns_of(Four(y0, y1, y0, y1)), Four(azimuth_scale()));
        for (int i = 0; i < 2; ++i) N[i] = azimuthal_density(p, azimuth_exit(at, i));
    }
    /// @param theta_i [radians], in [0, pi/2]
    MEDULLA_HOT LongitudinalPoint longitudinal_at(float theta_i) const noexcept {
        const RowPoint row = inclination.at(spline_coordinate(Quantity::theta_i, theta_i));
        return {longitudinal + std::size_t(row.first) * 4 * longitude_rows(), row.weight};
    }
    /// Densities per radian at an exit, >= 0.
    MEDULLA_HOT BackForward longitudinal_density(const LongitudinalPoint& p, const RowPoint& exit) const noexcept {
        const std::uint32_t step = 4 * longitude_rows();
        const float *r0 = p.rows + exit.first, *r1 = r0 + step, *r2 = r1 + step, *r3 = r2 + step;
        const auto blend = [&](int k) {
            return (spread<0>(p.weight) * four_at(r0 + k) + spread<1>(p.weight) * four_at(r1 + k)) +
                   (spread<2>(p.weight) * four_at(r2 + k) + spread<3>(p.weight) * four_at(r3 + k));
        };
        const Four sum = lower_twice(exit.weight) * blend(0) + upper_twice(exit.weight) * blend(4);
        return both_of(sum);
    }
    /// @param y [radians], in [-pi/2, pi/2]
    MEDULLA_HOT BackForward longitudinal_density(const LongitudinalPoint& p, float y) const noexcept {
        return longitudinal_density(p, longitude_exit(exit_places(turns_of(Four(y)), Four(longitude_scale())), 0));
    }
    /// Lanes 0 + 2 and 1 + 3, >= 0; a NaN stays one.
    static MEDULLA_HOT BackForward both_of(Four sum) noexcept {
        const float back = lane(sum, 0) + lane(sum, 2), forward = lane(sum, 1) + lane(sum, 3);
        return {0.0f > back ? 0.0f : back, 0.0f > forward ? 0.0f : forward};
    }
};

namespace detail {

/// integral over y of the contracted lobe.
MEDULLA_FN float exit_integral(const TableView& view, const float* weight) noexcept {
    float sum = 0;
    for (std::uint32_t r = 0; r < view.even_stride(); ++r)
        sum += weight[r] * load<float>(view.bytes + view.layout.integrals_offset + 4 * r);
    return sum;
}

}  // namespace detail

}  // namespace medulla
