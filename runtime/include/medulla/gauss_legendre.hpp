// Gauss-Legendre rules on [-1, 1] of 6, 10, 16 and 24 nodes, stored by halves: nodes are +-x.
// Rests on Newton's iteration on the Legendre recurrence, rounded to 10 digits; tests integrate polynomials with them.
#pragma once

#include "medulla/config.hpp"

namespace medulla {

inline constexpr int gauss_rules = 4;

/// Half of a rule: `half` nodes x > 0 with their weights; the other half mirrors it.
struct GaussRule {
    int half;
    const float* x;
    const float* w;
};

/// Rule 0 .. 3: 6, 10, 16, 24 nodes.
MEDULLA_FN GaussRule gauss_rule(int index) noexcept {
    static constexpr float x6[] = {0.2386191861f, 0.6612093865f, 0.9324695142f};
    static constexpr float w6[] = {0.4679139346f, 0.360761573f, 0.1713244924f};
    static constexpr float x10[] = {0.148874339f, 0.4333953941f, 0.6794095683f, 0.8650633667f, 0.9739065285f};
    static constexpr float w10[] = {0.2955242247f, 0.2692667193f, 0.2190863625f, 0.1494513492f, 0.06667134431f};
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
            return {3, x6, w6};
        case 1:
            return {5, x10, w10};
        case 2:
            return {8, x16, w16};
        default:
            return {12, x24, w24};
    }
}

}  // namespace medulla
