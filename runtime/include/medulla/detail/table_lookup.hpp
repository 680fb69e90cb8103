// What a field reads from dense tables: the rows of its (g, sigma, h, theta_i) with their weights, densities at an
// exit, and draws. Rests on tables.hpp and row_integral.hpp.
#pragma once

#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/detail/row_integral.hpp"
#include "medulla/tables.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// Angles in turns, less whole ones, in [-1/2, 1/2]. @param y [radians], |y| < 1e9
MEDULLA_HOT Four turns_of(Four y) noexcept {
    const Four t = y * Four(float(1 / (2 * pi)));
    return t - nearest_integer(t);
}

/// spline_coordinate of an offset [medulla radii], or of an inclination over pi/2; x in [0, 1] but for rounding.
template <class T>
MEDULLA_HOT T chord_coordinate(T x) noexcept {
    const T one(1.0f);
    return x / (one + square_root(greater(one - x, T(0.0f)) * (one + x)));
}

/// Rows and weights of one (g, sigma, h, theta_i).
struct TableRows {
    alignas(16) float g[4], sigma[4], h[4], theta_i[4];  ///< weights
    std::uint32_t g_count;                               ///< 1 or 4
    std::uint32_t g_first, sigma_first, h_first, theta_first;
    std::uint32_t azimuthal, longitudinal;  ///< where those rows begin [floats]
};

MEDULLA_HOT void set_g(const SplineAxis& axis, std::uint32_t rows, float g, TableRows& at) noexcept {
    if (rows == 1) {
        at.g_count = 1;
        at.g_first = 0;
        store_four(Four(1, 0, 0, 0), at.g);
        return;
    }
    const RowPoint p = axis.at(g);
    at.g_count = 4;
    at.g_first = p.first;
    store_four(p.weight, at.g);
}
MEDULLA_HOT void set_row(const SplineAxis& axis, float coordinate, std::uint32_t& first, float (&weight)[4]) noexcept {
    const RowPoint p = axis.at(coordinate);
    first = p.first;
    store_four(p.weight, weight);
}

/// Sets the rows of h. @param offset of the ray in the medulla [medulla radii], >= 0
MEDULLA_HOT void set_offset(const DenseTables& t, float offset, TableRows& at) noexcept {
    set_row(t.h, chord_coordinate(offset < 1 ? offset : 1.0f), at.h_first, at.h);
    at.azimuthal = (at.g_first * t.h.rows + at.h_first) * 2 * t.phi.rows * t.azimuthal_step() + at.sigma_first;
}
/// Sets the rows of sigma and theta_i. @param theta [radians]
MEDULLA_HOT void set_inclination(const DenseTables& t, float sigma, float theta, TableRows& at) noexcept {
    set_row(t.sigma, detail::math::sqrt(sigma), at.sigma_first, at.sigma);
    set_row(t.theta_i, chord_coordinate(magnitude(theta) * float(2 / pi)), at.theta_first, at.theta_i);
    at.longitudinal =
        t.one_material ? at.theta_first
                       : (at.g_first * t.theta_i.rows + at.theta_first) * 2 * t.theta_r.rows * t.longitudinal_step() +
                             at.sigma_first;
}

/// Four exits on axes that are symmetric about 0: how far from 0 [stretches], and which of them lie below it.
struct ExitPlaces {
    std::int32_t stretch[4];
    float place[4];
    unsigned below;
};
/// @param turns in [-1/2, 1/2]  @param scale stretches per turn
MEDULLA_HOT ExitPlaces exit_places(Four turns, Four scale) noexcept {
    ExitPlaces p;
    const Four u = magnitude(turns) * scale;
    store_whole(u, p.stretch);
    store_four(u, p.place);
    p.below = below_zero(turns);
    return p;
}

/// A row at an exit, four of sigma side by side: its positive part.
MEDULLA_HOT Four row_density(const float* row, std::size_t step, Four w0, Four w1, Four w2, Four w3) noexcept {
    const Four value =
        (w0 * four_at(row) + w1 * four_at(row + step)) + (w2 * four_at(row + 2 * step) + w3 * four_at(row + 3 * step));
    return greater(Four(0.0f), value);  // a NaN stays one
}

/// C^N at exit i [1 / radian].
MEDULLA_HOT float azimuthal_density(const DenseTables& t, const TableRows& at, const ExitPlaces& places,
                                    int i) noexcept {
    const RowPoint exit = t.phi.at_place(std::uint32_t(places.stretch[i]), places.place[i]);
    const std::size_t step = t.azimuthal_step(), h_step = step * 2 * t.phi.rows, g_step = h_step * t.h.rows;
    const Four w0 = spread<0>(exit.weight), w1 = spread<1>(exit.weight), w2 = spread<2>(exit.weight),
               w3 = spread<3>(exit.weight);
    const float* row =
        t.floats(t.azimuthal) + at.azimuthal + step * (exit.first + (places.below >> i & 1u) * t.phi.rows);
    Four sum;
    std::uint32_t j = 0;
    do {
        const Four h = Four(at.g[j]) * aligned_four_at(at.h);
        sum = sum + ((spread<0>(h) * row_density(row, step, w0, w1, w2, w3) +
                      spread<1>(h) * row_density(row + h_step, step, w0, w1, w2, w3)) +
                     (spread<2>(h) * row_density(row + 2 * h_step, step, w0, w1, w2, w3) +
                      spread<3>(h) * row_density(row + 3 * h_step, step, w0, w1, w2, w3)));
        row += g_step;
    } while (++j < at.g_count);
    return sum_of(sum * aligned_four_at(at.sigma));
}

/// M^s of Eq. 19 at exit i: C^M back and forward, blended by |phi| / pi [1 / radian].
MEDULLA_HOT float longitudinal_density(const DenseTables& t, const TableRows& at, const ExitPlaces& places, int i,
                                       float forwardness) noexcept {
    const RowPoint exit = t.theta_r.at_place(std::uint32_t(places.stretch[i]), places.place[i]);
    const std::size_t side = t.longitudinal_side(), step = 2 * side, theta_step = step * 2 * t.theta_r.rows,
                      g_step = theta_step * t.theta_i.rows;
    const Four w0 = spread<0>(exit.weight), w1 = spread<1>(exit.weight), w2 = spread<2>(exit.weight),
               w3 = spread<3>(exit.weight);
    const float* row =
        t.floats(t.longitudinal) + at.longitudinal + step * (exit.first + (places.below >> i & 1u) * t.theta_r.rows);
    if (t.one_material) {
        const Four back = row_density(row, step, w0, w1, w2, w3),
                   forward = row_density(row + side, step, w0, w1, w2, w3);
        return sum_of((back + Four(forwardness) * (forward - back)) * aligned_four_at(at.theta_i));
    }
    Four back, forward;
    std::uint32_t j = 0;
    do {
        const Four w = Four(at.g[j]) * aligned_four_at(at.theta_i);
        const Four a = spread<0>(w), b = spread<1>(w), c = spread<2>(w), d = spread<3>(w);
        back = back +
               ((a * row_density(row, step, w0, w1, w2, w3) + b * row_density(row + theta_step, step, w0, w1, w2, w3)) +
                (c * row_density(row + 2 * theta_step, step, w0, w1, w2, w3) +
                 d * row_density(row + 3 * theta_step, step, w0, w1, w2, w3)));
        const float* other = row + side;
        forward = forward + ((a * row_density(other, step, w0, w1, w2, w3) +
                              b * row_density(other + theta_step, step, w0, w1, w2, w3)) +
                             (c * row_density(other + 2 * theta_step, step, w0, w1, w2, w3) +
                              d * row_density(other + 3 * theta_step, step, w0, w1, w2, w3)));
        row += g_step;
    } while (++j < at.g_count);
    const Four sides = back + Four(forwardness) * (forward - back);
    return sum_of(sides * aligned_four_at(at.sigma));
}

/// Draws one of four by its weight, >= 0 of sum 1, and makes u uniform again.
MEDULLA_HOT std::uint32_t draw_row(const float (&weight)[4], float& u) noexcept {
    const SpanDraw drawn = draw_span(weight, u);
    u = drawn.rest / drawn.mass;
    return drawn.span;
}

/// Draws the azimuth of a scattered lobe from its shift, as seen from h >= 0 [radians].
/// @param which picks the rows  @param u is inverted; both in [0, 1]
MEDULLA_HOT float draw_azimuth(const DenseTables& t, const TableRows& at, float which, float u) noexcept {
    const std::uint32_t g = at.g_count == 1 ? 0 : at.g_first + draw_row(at.g, which),
                        h = at.h_first + draw_row(at.h, which),
                        sigma = at.sigma_first + draw_span(at.sigma, which).span;
    const std::uint32_t row = g * t.h.rows + h, step = t.azimuthal_step();
    const float* const cumulated =
        t.floats(t.azimuthal_blocks) + std::size_t(row * t.sigma.rows + sigma) * block_count(t.phi);
    return invert_block(t.phi, t.floats(t.azimuthal) + std::size_t(row * 2 * t.phi.rows) * step + sigma, step,
                        draw_block(t.phi, cumulated, below_1(u)));
}

/// What of a draw of theta_r is known before phi: a row of each side, and the block there.
struct LongitudeDraw {
    const float* row;    ///< of the backward side
    float side;          ///< decides between the sides, in [0, 1]
    BlockDraw block[2];  ///< back, forward
};
/// @param which, u as above
MEDULLA_HOT LongitudeDraw begin_longitude(const DenseTables& t, const TableRows& at, float which, float u) noexcept {
    const std::uint32_t theta = at.theta_first + draw_row(at.theta_i, which);
    std::uint32_t plane = 0, line = theta;
    if (!t.one_material) {
        const std::uint32_t g = at.g_count == 1 ? 0 : at.g_first + draw_row(at.g, which);
        plane = g * t.theta_i.rows + theta;
        line = draw_row(at.sigma, which) + at.sigma_first;
    }
    const std::uint32_t blocks = block_count(t.theta_r), step = t.longitudinal_step();
    const float* const cumulated = t.floats(t.longitudinal_blocks) + std::size_t(plane * step + line) * blocks;
    u = below_1(u);
    return {t.floats(t.longitudinal) + std::size_t(plane * 2 * t.theta_r.rows) * step + line,
            which,
            {draw_block(t.theta_r, cumulated, u),
             draw_block(t.theta_r, cumulated + std::size_t(t.longitudinal_side()) * blocks, u)}};
}
/// theta_r, as seen from theta_i >= 0 [radians]. @param forwardness |phi| / pi
MEDULLA_HOT float finish_longitude(const DenseTables& t, const LongitudeDraw& draw, float forwardness) noexcept {
    const auto forward = std::uint32_t(draw.side < forwardness);
    return invert_block(t.theta_r, draw.row + forward * t.longitudinal_side(), t.longitudinal_step(),
                        draw.block[forward]);
}

/// What -log(survival) is per absorption, at one offset.
MEDULLA_FN float survival_length(const DenseTables& t, const TableRows& at) noexcept {
    const std::size_t step = t.sigma.rows, g_step = step * t.h.rows;
    const float* row = t.floats(t.survival) + at.g_first * g_step + at.h_first * step + at.sigma_first;
    float length = 0;
    for (std::uint32_t j = 0; j < at.g_count; ++j, row += g_step)
        for (std::uint32_t k = 0; k < 4; ++k)
            length += at.g[j] * at.h[k] * sum_of(aligned_four_at(at.sigma) * four_at(row + k * step));
    return length;
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
