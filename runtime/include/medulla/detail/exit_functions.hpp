// Exit functions of a baked material: coefficients of a hit, the sum at an exit direction, and drawing from one of
// them. Rests on baked.hpp's layout: between nodes, functions and coefficients are bilinear.
#pragma once

#include <cstdint>

#include "medulla/baked.hpp"
#include "medulla/config.hpp"
#include "medulla/detail/elementary.hpp"
#include "medulla/detail/lanes.hpp"
#include "medulla/vector.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// The squares of four bytes.
MEDULLA_HOT Four squares_at(const unsigned char* b) noexcept {
#if defined(MEDULLA_SSE2)
    std::int32_t packed;
    std::memcpy(&packed, b, sizeof packed);
    const __m128i zero = _mm_setzero_si128();
    const Four x(_mm_cvtepi32_ps(_mm_unpacklo_epi16(_mm_unpacklo_epi8(_mm_cvtsi32_si128(packed), zero), zero)));
#else
    const Four x = Four(float(b[0]), float(b[1]), float(b[2]), float(b[3]));
#endif
    return x * x;
}

/// Weights of the absorption nodes for several sigma_ca side by side: the interpolating polynomial in
/// x = s / (s + sqrt(sigma_middle)), s = sqrt(sigma), which is 0 at x = 1. At sigma = 0 the first is 1 and the others
/// are 0.
MEDULLA_HOT void absorption_weights(const BakedMaterial& m, Four sigma, Four (&weight)[absorption_nodes]) noexcept {
    const Four s = square_root(sigma), x = s / (s + Four(detail::math::sqrt(m.header.sigma_middle)));
    for (int j = 0; j < absorption_nodes; ++j) {
        Four product = (x - Four(1.0f)) * Four(m.inverse[j]);
        for (int k = 0; k < absorption_nodes; ++k)
            if (k != j) product = product * (x - Four(m.x[k]));
        weight[j] = product;
    }
}

/// A place between two nodes of an axis.
struct Between {
    std::uint32_t lower;
    float weight;  ///< of the upper one
};
/// @param x from the first node [nodes], clamped to the axis
MEDULLA_HOT Between between(float x, std::uint32_t nodes) noexcept {
    const float last = float(nodes - 1), y = x > 0 ? (x < last ? x : last) : 0.0f;
    const auto lower = y < last ? std::uint32_t(y) : nodes - 2;
    return {lower, y - float(lower)};
}

/// Four cells about (theta_i, |h|).
struct CellBlend {
    std::uint32_t cell[4];
    float weight[4];
};
/// @param theta_i [radians]  @param h |h|, in [0, 1]  @param rim offset of the medulla's rim, not clamped to 1
MEDULLA_HOT CellBlend cells_about(const BakedMaterial& m, float theta_i, float h, float rim) noexcept {
    const BakedHeader& at = m.header;
    const Between i = between((theta_i / at.theta_high + 1) * 0.5f * float(at.inclinations - 1), at.inclinations);
    const float end = rim < 1 ? rim : 1.0f, s = h < end ? h / end : 1.0f, last = float(at.offsets_inside - 1);
    float y = angle(s, detail::math::sqrt((1 - s) * (1 + s))) * float(2 / pi) * last;
    if (h > end && end < 1) y = last + detail::math::sqrt((h - end) / (1 - end)) * float(at.offsets_beyond);
    const Between j = between(y, m.offsets());
    const std::uint32_t first = i.lower * m.offsets() + j.lower;
    const float u = i.weight, v = j.weight;
    return {{first, first + 1, first + m.offsets(), first + m.offsets() + 1},
            {(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v}};
}
MEDULLA_HOT float energy_at(const BakedMaterial& m, const CellBlend& at, int which) noexcept {
    float sum = 0;
    for (int i = 0; i < 4; ++i) sum += at.weight[i] * m.energy(at.cell[i], which);
    return sum;
}

/// Amplitudes of the 2 K functions at a hit, channels side by side: densities per radian^2 for a unit of light.
/// @param weight [absorption] of the channels in lanes; 0 in unused lanes
/// @param energy E times the weight of the offset, and what the shortest way leaves of each channel
/// @return energies of the channels: amplitudes times the areas of their functions
template <std::size_t lanes>
MEDULLA_HOT Colour<int(lanes)> set_amplitudes(const BakedMaterial& m, const CellBlend& at,
                                              const float (&weight)[absorption_nodes][lanes],
                                              const float (&energy)[lanes], float (*amplitude)[lanes]) noexcept {
    const std::uint32_t functions = m.header.functions;
    Four whole[lanes / 4];
    for (std::uint32_t k = 0; k < 2 * functions; k += 4) {
        alignas(16) float blend[absorption_nodes][4];
        for (int j = 0; j < absorption_nodes; ++j) {
            Four b(0.0f);
            for (int i = 0; i < 4; ++i)
                b = b + Four(at.weight[i] * m.scale(at.cell[i], j)) * squares_at(m.coefficients(at.cell[i], j) + k);
            store_four(b, blend[j]);
        }
        for (std::uint32_t n = 0; n < 4; ++n) {
            const std::uint32_t f = k + n < functions ? k + n : k + n - functions;
            const Four unit(m.unit[f]), area(m.area[f]);
            for (std::size_t b = 0; b < lanes; b += 4) {
                Four a(0.0f);
                for (int j = 0; j < absorption_nodes; ++j) a = a + Four(blend[j][n]) * four_at(weight[j] + b);
                a = greater(a, Four(0.0f)) * (unit * four_at(energy + b));
                whole[b / 4] = whole[b / 4] + a * area;
                store_four(a, amplitude[k + n] + b);
            }
        }
    }
    Colour<int(lanes)> energies;
    for (std::size_t b = 0; b < lanes / 4; ++b) store_four(whole[b], energies.value + 4 * b);
    return energies;
}

/// The nodes about an exit: two rows with their weights, and two columns.
struct ExitCorners {
    std::uint32_t row[2], column[2];
    float row_weight[2], column_weight[2];
};
MEDULLA_HOT void set_rows(const BakedHeader& h, float theta_r, ExitCorners& at) noexcept {
    const float rows = float(h.rows), y = (theta_r * float(1 / pi) + 0.5f) * rows - 0.5f, last = rows - 1;
    const Between r = between(y, h.rows);
    at.row[0] = r.lower;
    at.row[1] = r.lower + 1;
    at.row_weight[0] = 1 - r.weight;
    at.row_weight[1] = r.weight;
    // Beyond the outermost nodes, down to 0 at the pole.
    const float beyond = y < 0 ? -y : (y > last ? y - last : 0.0f), left = beyond < 0.5f ? 1 - 2 * beyond : 0.0f;
    at.row_weight[0] *= left;
    at.row_weight[1] *= left;
}
/// @param phi [radians], |phi| < 1e4
MEDULLA_HOT void set_columns(const BakedHeader& h, float phi, ExitCorners& at) noexcept {
    const float turns = phi * float(0.5 / pi), columns = float(h.columns);
    const float x = (turns - detail::math::floor(turns)) * columns;  // from phi = 0, a cell's edge: columns / 2 below
    float shifted = x + 0.5f * columns - 0.5f;
    if (!(shifted < columns)) shifted -= columns;
    if (shifted < 0) shifted += columns;
    std::uint32_t lower = std::uint32_t(shifted);
    if (lower >= h.columns) lower = h.columns - 1;
    at.column[0] = lower;
    at.column[1] = lower + 1 < h.columns ? lower + 1 : 0;
    at.column_weight[1] = shifted - float(lower);
    at.column_weight[0] = 1 - at.column_weight[1];
}

/// Adds sum over k of amplitude[k] times the squares of B_k, at an exit whose corners are given.
template <std::size_t lanes>
MEDULLA_HOT void add_functions(const BakedMaterial& m, const ExitCorners& at, const float (*amplitude)[lanes],
                               float (&sum)[lanes]) noexcept {
    const std::uint32_t functions = m.header.functions, last = m.header.columns - 1;
    Four total[lanes / 4];
    for (std::size_t b = 0; b < lanes / 4; ++b) total[b] = four_at(sum + 4 * b);
    for (std::uint32_t mirrored = 0; mirrored < 2; ++mirrored) {
        const unsigned char* corner[4];
        float weight[4];
        for (int i = 0; i < 4; ++i) {
            const std::uint32_t column = at.column[i & 1];
            corner[i] = m.node(at.row[i >> 1], mirrored ? last - column : column);
            weight[i] = at.row_weight[i >> 1] * at.column_weight[i & 1];
        }
        for (std::uint32_t k = 0; k < functions; k += 4) {
            Four b(0.0f);
            for (int i = 0; i < 4; ++i) b = b + Four(weight[i]) * squares_at(corner[i] + k);
            const float(*a)[lanes] = amplitude + mirrored * functions + k;
            for (std::size_t c = 0; c < lanes / 4; ++c)
                total[c] = total[c] + (spread<0>(b) * four_at(a[0] + 4 * c) + spread<1>(b) * four_at(a[1] + 4 * c)) +
                           (spread<2>(b) * four_at(a[2] + 4 * c) + spread<3>(b) * four_at(a[3] + 4 * c));
        }
    }
    for (std::size_t b = 0; b < lanes / 4; ++b) store_four(total[b], sum + 4 * b);
}

/// Draws from a hat: offset from its node [cells], in [-lower, upper]. @param u in [0, 1]
MEDULLA_HOT float sample_hat(float lower, float upper, float u) noexcept {
    const float x = u * (lower + upper);
    const bool below = x < lower;
    const float width = below ? lower : upper, v = below ? (lower - x) / lower : (x - lower) / upper;
    const float distance = width * (1 - detail::math::sqrt(v < 1 ? 1 - v : 0.0f));
    return below ? -distance : distance;
}

/// An exit in a function's own frame.
struct DrawnExit {
    float theta, phi;  ///< [radians]
};
/// Draws from B_k: a node by its square, then within its hats.
MEDULLA_HOT DrawnExit sample_function(const BakedMaterial& m, std::uint32_t k, float u, float v) noexcept {
    const BakedHeader& h = m.header;
    // In whole numbers: `below` of the mass lies before the node.
    const double place = double(u) * double(m.mass[k]);
    std::uint64_t below = 0, mass = 0;
    std::uint32_t row = 0;
    for (std::uint32_t r = 0; r < h.rows; ++r) {
        const std::uint64_t w = std::uint64_t(m.row_sum(k, r)) * row_area(r, h.rows);
        if (w == 0) continue;
        below += mass;
        row = r;
        mass = w;
        if (place < double(below + w)) break;
    }
    const std::uint32_t sum = m.row_sum(k, row);
    const auto target = std::uint32_t(double(v) * double(sum));
    std::uint32_t before = 0, square = 0, column = 0;
    const unsigned char* node = m.node(row, 0) + k;
    for (std::uint32_t c = 0; c < h.columns; ++c) {
        const std::uint32_t b = node[std::size_t(c) * h.functions];
        if (b == 0) continue;
        before += square;
        column = c;
        square = b * b;
        if (target < before + square) break;
    }
    const auto share = [](double part, double whole) {
        const float x = float(part / whole);
        return x > 0 ? (x < 1 ? x : 1.0f) : 0.0f;
    };
    u = share(place - double(below), double(mass));
    v = share(double(v) * sum - before, square);
    const float y = float(row) + 0.5f + sample_hat(row == 0 ? 0.5f : 1.0f, row + 1 == h.rows ? 0.5f : 1.0f, u);
    const float x = float(column) + 0.5f + sample_hat(1, 1, v);
    return {(y / float(h.rows) - 0.5f) * float(pi), (x / float(h.columns) - 0.5f) * float(2 * pi)};
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
