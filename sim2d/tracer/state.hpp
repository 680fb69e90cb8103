// Data of one cell's kernel: constants as floats, direction tables, the paths of a batch as arrays.
// Private to kernel.cpp and lanes-inl.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "medulla/config.hpp"
#include "sim2d/tracer/kernel.hpp"

namespace medulla::sim2d {

inline constexpr std::size_t kLaneMargin = 64;  ///< arrays are longer by this much, so that whole vectors can be stored
inline constexpr std::size_t kBatch = 4096;     ///< paths traced together; their arrays fit the second-level cache
inline constexpr std::uint32_t kLatticeDims = 25;

/// Paths of a batch: position, direction, weight. Disc: s = 1 - r^2, updated beside x and y without cancellation.
/// Slab: x is the depth, y the path length so far.
struct Paths {
    std::vector<float> x, y, s, dx, dy, w;
    std::vector<float> straight;                 ///< distance to the boundary along the phase function's peak
    std::vector<float> chance;                   ///< uniform number for the roulette of the deposit
    std::vector<float> length;                   ///< disc: path length so far, used for absorption only
    std::vector<std::uint32_t> index, reversed;  ///< number of the path; its bits in reverse order
    std::vector<std::uint32_t> place;            ///< random word: position of a deposit in its bin and comb

    void reserve(std::size_t n) {
        for (auto* v : {&x, &y, &s, &dx, &dy, &w, &straight, &chance, &length}) v->assign(n, 0.0f);
        for (auto* v : {&index, &reversed, &place}) v->assign(n, 0u);
    }
};

/// Vertices that deposit. The "near" frame is turned back by the offset in the bin, the "far" frame by that and the
/// comb's offset.
struct Deposits {
    std::vector<float> weight, chance, x, y, s, length, far_x, far_y, far_dx, far_dy, near_x, near_y, near_dx, near_dy,
        cos_far, sin_far, cos_near, sin_near;
    std::vector<std::int32_t> offset, window;
    std::vector<std::uint32_t> place;

    void reserve(std::size_t n) {
        for (auto* v : {&weight, &chance, &x, &y, &s, &length, &far_x, &far_y, &far_dx, &far_dy, &near_x, &near_y,
                        &near_dx, &near_dy, &cos_far, &sin_far, &cos_near, &sin_near})
            v->assign(n, 0.0f);
        for (auto* v : {&offset, &window}) v->assign(n, 0);
        place.assign(n, 0u);
    }
};

/// For each subset of eight lanes the numbers of its lanes as nibbles, the lowest first.
struct SqueezeTable {
    std::uint32_t lanes[256] = {};
    constexpr SqueezeTable() {
        for (std::uint32_t set = 0; set < 256; ++set) {
            std::uint32_t place = 0;
            for (std::uint32_t lane = 0; lane < 8; ++lane)
                if (set >> lane & 1u) lanes[set] |= lane << (4 * place++);
        }
    }
};
inline constexpr SqueezeTable kSqueeze{};

struct PathTracer::State {
    TracerCell cell;
    float sigma, g, p_scale, p_floor;  ///< |g|; p = p_scale / (p_floor + g |d - u|^2)
    float flip;                        ///< -1 for g < 0: p(t; g) = p(pi - t; -g)
    float chord, half, h, mu, first_share;
    float dir_x, dir_y;
    std::uint32_t key[2], comb_count, comb_stride;  ///< deposits per vertex; distance between two offsets' bins
    std::vector<float> comb_x, comb_y;              ///< directions of the bins' lower ends, every comb-th
    std::vector<float> window_x, window_y;          ///< of all bins, continued by the length of a window
    std::vector<float> comb_sum, window_sum;
    /// Per absorption: -absorption / log 2; sums as comb_sum, window_sum; lanes of light times path.
    std::vector<float> absorbed_rate, absorbed_comb, absorbed_window, absorbed_length;
    std::vector<std::uint32_t> shift;  ///< of the lattice in this randomisation, per dimension
    Paths paths;
    Deposits deposits;
};

/// Extensible rank-1 lattice exod2_base2_m20 of Kuo (Cools, Kuo, Nuyens 2006, "Constructing embedded lattice rules").
inline constexpr std::uint32_t kLattice[kLatticeDims] = {
    1,      182667, 469891, 498753, 110745, 446247, 250185, 118627, 245333, 283199, 408519, 391023, 246327,
    126539, 399185, 461527, 300343, 69681,  516695, 436179, 106383, 238523, 413283, 70841,  47719};

}  // namespace medulla::sim2d
