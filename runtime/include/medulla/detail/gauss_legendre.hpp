// Gauss-Legendre rules on [-1, 1] of 8, 12, 16 and 24 nodes, stored by halves: nodes are +-x.
// Rests on Newton's iteration on the Legendre recurrence, rounded to 10 digits; tests integrate polynomials with them.
#pragma once

#include "medulla/config.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

inline constexpr int gauss_rules = 4;

/// Half of a rule: `half` nodes x > 0 with their weights; the other half mirrors it.
struct GaussRule {
    int half;
    const float* x;
    const float* w;
};

/// Rule 0 .. 3: 8, 12, 16, 24 nodes, multiples of four.
MEDULLA_FN GaussRule gauss_rule(int index) noexcept {
    static constexpr float x8[] = {0.1834346425f, 0.5255324099f, 0.7966664774f, 0.9602898565f};
    static constexpr float w8[] = {0.3626837834f, 0.3137066459f, 0.2223810345f, 0.1012285363f};
    static constexpr float x12[] = {0.1252334085f, 0.367831499f,  0.5873179543f,
                                    0.7699026742f, 0.9041172564f, 0.9815606342f};
    static constexpr float w12[] = {0.2491470458f, 0.2334925365f, 0.2031674267f,
                                    0.1600783285f, 0.106939326f,  0.04717533639f};
    static constexpr float x16[] = {0.09501250984f, 0.2816035508f, 0.4580167777f, 0.6178762444f,
                                    0.7554044084f,  0.8656312024f, 0.9445750231f, 0.989400935f};
    static constexpr float w16[] = {0.1894506105f, 0.182603415f,   0.1691565194f,  0.1495959888f,
                                    0.1246289713f, 0.09515851168f, 0.06225352394f, 0.02715245941f};
    static constexpr float x24[] = {0.06405689286f, 0.1911188675f, 0.3150426797f, 0.4337935076f,
                                    0.5454214714f,  0.6480936519f, 0.7401241916f, 0.820001986f,
                                    0.886415527f,   0.938274552f,  0.974728556f,  0.99518722f};
    static constexpr float w24[] = {0.1279381953f,  0.1258374563f,  0.1216704729f,  0.1155056681f,
                                    0.1074442701f,  0.0976186521f,  0.08619016153f, 0.07334648141f,
                                    0.05929858492f, 0.04427743882f, 0.02853138863f, 0.0123412298f};
    switch (index) {
        case 0:
            return {4, x8, w8};
        case 1:
            return {6, x12, w12};
        case 2:
            return {8, x16, w16};
        default:
            return {12, x24, w24};
    }
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
