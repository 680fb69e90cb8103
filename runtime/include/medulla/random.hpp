// One random number made into several, for renderers that hand a material fewer numbers than it draws with.
// Rests on nothing but integer arithmetic.
#pragma once

#include <cstddef>
#include <cstdint>

#include "medulla/config.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// Random numbers in (0, 1).
template <int Count>
struct Stretched {
    float u[std::size_t(Count)] = {};
};

namespace detail {

template <int Count, int Bits>
MEDULLA_FN Stretched<Count> deal(std::uint32_t bits) noexcept {
    static_assert(Count >= 1 && 4 * Count <= Bits, "each number has four bits or more");
    Stretched<Count> result;
    for (int n = 0; n < Count; ++n) {
        std::uint32_t dealt = 0, cells = 1;
        // 23 bits at most: the middle of a finer cell would not be a float.
        for (int k = n; k < Bits && cells < (1u << 23); k += Count) {
            dealt = 2 * dealt + ((bits >> (Bits - 1 - k)) & 1u);
            cells *= 2;
        }
        result.u[n] = (float(dealt) + 0.5f) / float(cells);
    }
    return result;
}

}  // namespace detail

/// Deals the bits of one number out in turn: bit k from the top goes to number k mod Count. Points that are well spread
/// in one dimension stay well spread in Count dimensions (this is the Morton order), and each number is the middle of
/// its cell, so that its mean is exact. The cost is resolution: 32 bits give two numbers of 16 bits, three of 10 or 11,
/// four of 8.
template <int Count>
MEDULLA_FN Stretched<Count> stretch(std::uint32_t bits) noexcept {
    return detail::deal<Count, 32>(bits);
}

/// The same of a float in [0, 1], which has 24 bits: two numbers of 12 bits (4096 values), three of 8 (256), four of 6
/// (64). Two are enough to choose a lobe and to place a point in it at up to some thousand samples a pixel; for more,
/// take the renderer's own numbers or 32 bits.
template <int Count>
MEDULLA_FN Stretched<Count> stretch(float u) noexcept {
    const float scaled = u * 16777216.0f;
    return detail::deal<Count, 24>(!(scaled > 0) ? 0u : scaled < 16777215.0f ? std::uint32_t(scaled) : 16777215u);
}

/// A number that chose the interval [low, high) of [0, 1], even in (0, 1) again. It costs log2(1 / (high - low)) bits.
MEDULLA_FN float reuse(float u, float low, float high) noexcept {
    const float width = high - low, x = width > 0 ? (u - low) / width : 0.5f;
    return x > 0 ? (x < 1 ? x : 1.0f) : 0.0f;
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
