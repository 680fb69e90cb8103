// Counter-based random numbers: Philox4x32-10 (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3").
// A stream is a pure function of (seed, cell, path), so results do not depend on threads or order.
#pragma once

#include <array>
#include <cstdint>

#include "medulla/phase.hpp"

namespace medulla::sim2d {

/// One Philox4x32-10 block: 128 random bits from a 128-bit counter and a 64-bit key.
inline std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> c, std::uint32_t k0,
                                           std::uint32_t k1) noexcept {
    for (int round = 0; round < 10; ++round) {
        const std::uint64_t a = std::uint64_t{0xD2511F53u} * c[0], b = std::uint64_t{0xCD9E8D57u} * c[2];
        c = {static_cast<std::uint32_t>(b >> 32) ^ c[1] ^ k0, static_cast<std::uint32_t>(b),
             static_cast<std::uint32_t>(a >> 32) ^ c[3] ^ k1, static_cast<std::uint32_t>(a)};
        k0 += 0x9E3779B9u, k1 += 0xBB67AE85u;
    }
    return c;
}

/// The random numbers of one path: key = seed, counter = (block, path, cell).
class RandomStream {
  public:
    /// @param path below 2^40: the counter holds 24 bits of blocks, 40 of paths, 64 of the cell
    RandomStream(std::uint64_t seed, std::uint64_t cell, std::uint64_t path) noexcept
        : seed_(seed), cell_(cell), path_(path) {}

    /// Uniform in (0, 1): 53 bits, never 0 nor 1.
    double uniform() noexcept {
        if (used_ == 2) refill();
        const std::uint64_t bits = words_[used_++];
        return (static_cast<double>(bits >> 12) + 0.5) * 0x1p-52;
    }

    /// Uniform on the unit circle without trigonometry: a point of the unit disc with its angle doubled.
    Direction<double> direction() noexcept {
        for (;;) {
            const double x = 2 * uniform() - 1, y = 2 * uniform() - 1, r2 = x * x + y * y;
            if (r2 <= 1) return {(x - y) * (x + y) / r2, 2 * x * y / r2};  // r2 > 0: uniform() is never 1/2
        }
    }

  private:
    void refill() noexcept {
        const auto c =
            philox({block_ | static_cast<std::uint32_t>(path_ >> 32) << 24, static_cast<std::uint32_t>(path_),
                    static_cast<std::uint32_t>(cell_), static_cast<std::uint32_t>(cell_ >> 32)},
                   static_cast<std::uint32_t>(seed_), static_cast<std::uint32_t>(seed_ >> 32));
        words_ = {std::uint64_t{c[0]} << 32 | c[1], std::uint64_t{c[2]} << 32 | c[3]};
        ++block_, used_ = 0;
    }

    std::uint64_t seed_, cell_, path_;
    std::uint32_t block_ = 0;
    std::array<std::uint64_t, 2> words_{};
    int used_ = 2;
};

}  // namespace medulla::sim2d
