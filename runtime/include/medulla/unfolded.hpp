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

/// spline_coordinate of an offset, or of an inclination over pi/2; x in [0, 1] but for rounding. T is Same or Four.
template <class T>
MEDULLA_HOT T chord_coordinate(T x) noexcept {
    const T one(1.0f);
    return x / (one + square_root(greater(one - x, T(0.0f)) * (one + x)));
}

/// Four neighbouring rows of an axis and their weights.
struct RowPoint {
    std::uint32_t first;
    Four weight;
};

/// A span of an axis and the place from its middle [stretches].
struct AxisPlace {
    std::uint32_t span;
    Same along;
};

/// Four weights that are cubics in a place, counted from the middle so that little rounds: read, not recomputed.
struct CubicWeights {
    alignas(64) float power[4][4];  ///< [power of the place][row]: a cache line

    MEDULLA_HOT Four at(Same x) const noexcept {
        return (aligned_four_at(power[0]) + x * aligned_four_at(power[1])) +
               (x * x) * (aligned_four_at(power[2]) + x * aligned_four_at(power[3]));
    }
};

/// From the weights at t = 0, 1/3, 2/3, 1, whose sum is 1: so is that of the result, to the rounding of its
/// coefficients. @param length so much of the place is t = 0 to 1  @param f four weights at t
template <class F>
MEDULLA_FN CubicWeights cubic_weights(double length, F&& f) noexcept {
    SplineWeights<float> at[4];
    for (int i = 0; i < 4; ++i) at[i] = f(float(i) / 3);
    CubicWeights c;
    double excess[4] = {-1, 0, 0, 0};
    int largest = 0;
    for (int r = 0; r < 4; ++r) {
        const double a = double(at[0].w[r]), b = double(at[1].w[r]), d = double(at[2].w[r]), e = double(at[3].w[r]);
        const double power[4] = {(9 * (b + d) - (a + e)) / 16, (27 * (d - b) - (e - a)) / 8, 2.25 * ((a + e) - (b + d)),
                                 4.5 * ((e - a) - 3 * (d - b))};
        double scale = 1;
        for (int k = 0; k < 4; ++k, scale /= length)
            c.power[k][r] = float(power[k] * scale), excess[k] += double(c.power[k][r]);
        if (at[1].w[r] + at[2].w[r] > at[1].w[largest] + at[2].w[largest]) largest = r;
    }
    for (int k = 0; k < 4; ++k) c.power[k][largest] = float(double(c.power[k][largest]) - excess[k]);
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

/// An axis of a pack, from 0, with the weights of each of its spans, cubics in the distance from its middle
/// [stretches]. Even stretches say which span a value lies in: where a breakpoint is not the end of one (those of exits
/// are, being whole bins apart), the nearest end stands in for it, off by at most a 32nd of a span. There the cubics of
/// two neighbours differ by the cube of that in a spline (default pack: 1e-8 of a lobe), through nodes by a tenth of
/// what they err between them.
template <std::uint32_t Most, std::int32_t most_stretches>
struct CubicAxis {
    std::uint32_t spans = 0;
    std::int32_t stretches = 0;
    float scale, end;                        ///< stretches / upper end of the axis; stretches
    float middle[Most];                      ///< of a span [stretches]
    std::uint8_t first[Most];                ///< of a span's four rows
    std::uint8_t start[most_stretches + 1];  ///< the span at the middle of the stretch; one more for the upper end
    CubicWeights weights[Most];

    /// Rows are the pack's spline coefficients. false where spans are too narrow.
    MEDULLA_FN bool set_spline(const AxisView<float>& axis) noexcept {
        return set(
            axis.spans, [&](std::uint32_t i) { return axis.breakpoint(std::int32_t(i)); },
            [&](std::uint32_t i, float a, float b, float length) {
                first[i] = static_cast<std::uint8_t>(i);
                return cubic_weights(double(length), [&](float t) {
                    return spline_weights(axis, Cell<float>{i, a + t * (b - a)});
                });
            });
    }
    /// Rows are values at count + 1 ascending nodes, joined by the cubic through the four nearest; count >= 3.
    MEDULLA_FN bool set_nodes(std::uint32_t count, const float* node) noexcept {
        return set(
            count, [&](std::uint32_t i) { return node[i]; },
            [&](std::uint32_t i, float a, float b, float length) {
                const std::uint32_t before = i > 0 ? i - 1 : 0, from = before + 3 <= count ? before : count - 3;
                first[i] = static_cast<std::uint8_t>(from);
                const float x[4] = {node[from], node[from + 1], node[from + 2], node[from + 3]};
                return cubic_weights(double(length), [&](float t) { return lagrange_weights(x, a + t * (b - a)); });
            });
    }
    /// The span of a spline coordinate >= 0; beyond the axis, as for a NaN, its end holds.
    MEDULLA_HOT AxisPlace place(Same x) const noexcept {
        const Same u = lesser(x * Same(scale), Same(end));
        return place_in(whole(u), u);
    }
    MEDULLA_HOT RowPoint at(Same x) const noexcept {
        const AxisPlace p = place(x);
        return {first[p.span], weights[p.span].at(p.along)};
    }
    /// The spans of four coordinates.
    MEDULLA_HOT void places(Four x, AxisPlace (&place)[4]) const noexcept {
        const Four u = lesser(x * Four(scale), Four(end));
        std::int32_t stretch[4];
        float along[4];
        store_whole(u, stretch), store_four(u, along);
        for (int k = 0; k < 4; ++k) place[k] = place_in(stretch[k], Same(along[k]));
    }
    /// The same of a spline. @param u a place [stretches] on the axis, in stretch `stretch`
    MEDULLA_HOT RowPoint at(std::int32_t stretch, float u) const noexcept {
        const AxisPlace p = place_in(stretch, Same(u));
        return {p.span, weights[p.span].at(p.along)};
    }

    /// Integral over a spline's axis of what each row is weighted by [the axis's unit].
    MEDULLA_FN void integrate(const AxisView<float>& axis, double (&rows)[Most + 3]) const noexcept {
        for (double& row : rows) row = 0;
        for (std::uint32_t i = 0; i < spans; ++i) {
            const auto k = std::int32_t(i);
            const double width = double(axis.breakpoint(k + 1)) - double(axis.breakpoint(k)),
                         length = width * double(scale);
            for (std::uint32_t r = 0; r < 4; ++r)
                rows[i + r] +=
                    width * (double(weights[i].power[0][r]) + length * length / 12 * double(weights[i].power[2][r]));
        }
    }

  private:
    MEDULLA_HOT AxisPlace place_in(std::int32_t stretch, Same u) const noexcept {
        const std::uint32_t i = start[std::uint32_t(stretch)];
        return {i, u - Same(middle[i])};
    }
    template <class Breakpoint, class F>
    MEDULLA_FN bool set(std::uint32_t count, Breakpoint&& breakpoint, F&& weights_of) noexcept {
        spans = count;
        const float upper = breakpoint(count);
        const auto on_ends = [&] {  // but for rounding
            for (std::uint32_t i = 1; i < spans; ++i) {
                const float u = breakpoint(i) * float(stretches) / upper;
                if (magnitude(u - nearest_integer(u)) > 1e-3f) return false;
            }
            return true;
        };
        stretches = std::int32_t(spans);
        while (stretches < most_stretches && !on_ends()) ++stretches;
        const float narrowest = on_ends() ? 0.5f : 16.0f;
        end = float(stretches), scale = end / upper;
        std::int32_t from = 0;
        for (std::uint32_t i = 0; i < spans; ++i) {
            const float a = breakpoint(i), b = breakpoint(i + 1), length = (b - a) * scale;
            if (!(length > narrowest)) return false;
            middle[i] = 0.5f * (a + b) * scale;
            weights[i] = weights_of(i, a, b, length);
            for (const float next = b * scale; from < stretches && float(from) + 0.5f < next; ++from)
                start[from] = static_cast<std::uint8_t>(i);
        }
        while (from <= stretches) start[from++] = static_cast<std::uint8_t>(spans - 1);
        return true;
    }
};

/// C^N at one (sigma, h): four rows of h, weights of h and sigma.
struct AzimuthalPoint {
    const float* rows;
    Four offset, sigma;
};

/// Densities of TTs and TRTs [1 / radian].
struct TwoDensities {
    float TTs, TRTs;
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

/// The tables of one material, 153 KB in memory that the caller keeps for as long as the fibre that reads them.
struct UnfoldedTables {
    float middle_root = 0, inverse_range = 0;  ///< of the range of sqrt(sigma), 1 / its length
    std::uint32_t azimuth_rows = 0, longitude_rows = 0;
    float azimuth_scale = 0, longitude_scale = 0;  ///< stretches per turn
    CubicWeights sigma_weights;                    ///< of four Chebyshev nodes in it
    CubicAxis<most_offset_spans, 2048> offset;
    CubicAxis<most_inclination_spans, 2048> inclination;
    CubicAxis<most_exit_spans, 720> azimuth, longitude;
    /// Coefficients of the exit spline, each row of h and sigma divided by its integral over phi, so that any blend of
    /// rows integrates to 1: [row of h][y >= 0 or y < 0][row of |y|][sigma node].
    alignas(16) float azimuthal[(most_offset_spans + 3) * 2 * (most_exit_spans + 3) * 4];
    /// The same: [row of theta_i][y >= 0 or y < 0][row of |y|][back, forward].
    alignas(16) float longitudinal[(most_inclination_spans + 1) * 2 * (most_exit_spans + 3) * 2];
    alignas(
        16) float survival[(most_offset_spans + 3) * 4];  ///< lengths, where the pack has them: [row of h][sigma node]

    /// false where spans are too narrow.
    MEDULLA_FN bool set_exits(const AxisView<float>& phi, const AxisView<float>& theta_r) noexcept {
        if (!azimuth.set_spline(phi) || !longitude.set_spline(theta_r)) return false;
        azimuth_rows = phi.spans + 3, longitude_rows = theta_r.spans + 3;
        azimuth_scale = 2 * azimuth.end, longitude_scale = 4 * longitude.end;
        return true;
    }
    /// @param sigma one optical radius or several abreast
    template <class T>
    MEDULLA_HOT T sigma_place(T sigma) const noexcept {
        const T t = (square_root(sigma) - T(middle_root)) * T(inverse_range);
        return lesser(greater(t, T(-0.5f)), T(0.5f));
    }
    MEDULLA_HOT Four sigma_at(float sigma) const noexcept { return sigma_weights.at(sigma_place(Same(sigma))); }
    /// @param sigma what sigma_at gave  @param h offset [medulla radii], in [0, 1]
    MEDULLA_HOT AzimuthalPoint azimuthal_at(Four sigma, float h) const noexcept {
        const RowPoint row = offset.at(chord_coordinate(Same(h)));
        return {azimuthal_rows(row.first), row.weight, sigma};
    }
    /// What -log(survival) is per absorption.  @param sigma, h as above
    MEDULLA_HOT float survival_length(Four sigma, float h) const noexcept {
        const RowPoint row = offset.at(chord_coordinate(Same(h)));
        const float* r = survival + 4 * row.first;
        return sum_of(sigma * ((spread<0>(row.weight) * four_at(r) + spread<1>(row.weight) * four_at(r + 4)) +
                               (spread<2>(row.weight) * four_at(r + 8) + spread<3>(row.weight) * four_at(r + 12))));
    }
    /// From a row of h, and of theta_i.
    MEDULLA_HOT const float* azimuthal_rows(std::uint32_t first) const noexcept {
        return azimuthal + std::size_t(first) * 8 * azimuth_rows;
    }
    MEDULLA_HOT const float* longitudinal_rows(std::uint32_t first) const noexcept {
        return longitudinal + std::size_t(first) * 4 * longitude_rows;
    }
    /// Where exit i lies among an azimuthal point's rows.
    MEDULLA_HOT RowPoint azimuth_exit(const ExitPlaces& p, int i) const noexcept {
        const RowPoint exit = azimuth.at(p.stretch[i], p.place[i]);
        return {4 * (exit.first + azimuth_rows * (p.below >> i & 1u)), exit.weight};
    }
    /// Where exit i lies among a longitudinal point's rows.
    MEDULLA_HOT RowPoint longitude_exit(const ExitPlaces& p, int i) const noexcept {
        const RowPoint exit = longitude.at(p.stretch[i], p.place[i]);
        return {2 * (exit.first + longitude_rows * (p.below >> i & 1u)), exit.weight};
    }
    /// Four terms of the density at an exit.
    MEDULLA_HOT Four azimuthal_terms(const AzimuthalPoint& p, const RowPoint& exit) const noexcept {
        const std::uint32_t step = 8 * azimuth_rows;
        const float *r0 = p.rows + exit.first, *r1 = r0 + step, *r2 = r1 + step, *r3 = r2 + step;
        // h first: its weights are known before the exit's.
        const auto blend = [&](int k) {
            return (spread<0>(p.offset) * aligned_four_at(r0 + k) + spread<1>(p.offset) * aligned_four_at(r1 + k)) +
                   (spread<2>(p.offset) * aligned_four_at(r2 + k) + spread<3>(p.offset) * aligned_four_at(r3 + k));
        };
        const Four sum = (spread<0>(exit.weight) * blend(0) + spread<1>(exit.weight) * blend(4)) +
                         (spread<2>(exit.weight) * blend(8) + spread<3>(exit.weight) * blend(12));
        return sum * p.sigma;
    }
    /// Density per radian at an exit, >= 0.
    MEDULLA_HOT float azimuthal_density(const AzimuthalPoint& p, const RowPoint& exit) const noexcept {
        const float value = sum_of(azimuthal_terms(p, exit));
        return 0.0f > value ? 0.0f : value;  // a NaN stays one
    }
    /// @param y [radians], |y| < 1e9
    MEDULLA_HOT float azimuthal_density(const AzimuthalPoint& p, float y) const noexcept {
        return azimuthal_density(p, azimuth_exit(exit_places(turns_of(Four(y)), Four(azimuth_scale)), 0));
    }
    /// At two exits, as TTs and TRTs ask.
    MEDULLA_HOT TwoDensities azimuthal_densities(const AzimuthalPoint& p, float y0, float y1) const noexcept {
        const ExitPlaces at = exit_places(turns_of(Four(y0, y1, y0, y1)), Four(azimuth_scale));
        return {azimuthal_density(p, azimuth_exit(at, 0)), azimuthal_density(p, azimuth_exit(at, 1))};
    }
    /// @param theta_i [radians], in [0, pi/2]
    MEDULLA_HOT LongitudinalPoint longitudinal_at(float theta_i) const noexcept {
        const RowPoint row = inclination.at(chord_coordinate(Same(theta_i * float(2 / pi))));
        return {longitudinal_rows(row.first), row.weight};
    }
    /// Terms of the densities at an exit: back and forward, twice.
    MEDULLA_HOT Four longitudinal_terms(const LongitudinalPoint& p, const RowPoint& exit) const noexcept {
        const std::uint32_t step = 4 * longitude_rows;
        const float *r0 = p.rows + exit.first, *r1 = r0 + step, *r2 = r1 + step, *r3 = r2 + step;
        const auto blend = [&](int k) {
            return (spread<0>(p.weight) * four_at(r0 + k) + spread<1>(p.weight) * four_at(r1 + k)) +
                   (spread<2>(p.weight) * four_at(r2 + k) + spread<3>(p.weight) * four_at(r3 + k));
        };
        return lower_twice(exit.weight) * blend(0) + upper_twice(exit.weight) * blend(4);
    }
    /// Densities per radian at an exit, >= 0.
    MEDULLA_HOT BackForward longitudinal_density(const LongitudinalPoint& p, const RowPoint& exit) const noexcept {
        return both_of(longitudinal_terms(p, exit));
    }
    /// @param y [radians], in [-pi/2, pi/2]
    MEDULLA_HOT BackForward longitudinal_density(const LongitudinalPoint& p, float y) const noexcept {
        return longitudinal_density(p, longitude_exit(exit_places(turns_of(Four(y)), Four(longitude_scale)), 0));
    }
    /// Lanes 0 + 2 and 1 + 3, >= 0; a NaN stays one.
    static MEDULLA_HOT BackForward both_of(Four sum) noexcept {
        const float back = lane(sum, 0) + lane(sum, 2), forward = lane(sum, 1) + lane(sum, 3);
        return {0.0f > back ? 0.0f : back, 0.0f > forward ? 0.0f : forward};
    }
};

}  // namespace medulla
