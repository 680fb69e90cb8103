// Random numbers that depend on seed, pixel and sample alone, never on the thread: Sobol pairs, Owen-scrambled by
// hashing (Burley 2020, 'Practical hash-based Owen scrambling'), one independently shuffled pair after another.
#pragma once

#include <cstdint>

namespace medulla::render {

/// A bijection of 32 bits with good avalanche (Wellons, 'lowbias32').
inline std::uint32_t scatter_bits(std::uint32_t x) {
    x ^= x >> 16, x *= 0x7feb352du;
    x ^= x >> 15, x *= 0x846ca68bu;
    return x ^ x >> 16;
}
inline std::uint32_t hash(std::uint32_t a, std::uint32_t b) { return scatter_bits(a ^ scatter_bits(b + 0x9e3779b9u)); }

/// In [0, 1).
inline float unit_float(std::uint32_t bits) { return float(bits >> 8) * 0x1p-24f; }

inline std::uint32_t reverse_bits(std::uint32_t x) {
    x = x >> 16 | x << 16;
    x = (x & 0xff00ff00u) >> 8 | (x & 0x00ff00ffu) << 8;
    x = (x & 0xf0f0f0f0u) >> 4 | (x & 0x0f0f0f0fu) << 4;
    x = (x & 0xccccccccu) >> 2 | (x & 0x33333333u) << 2;
    return (x & 0xaaaaaaaau) >> 1 | (x & 0x55555555u) << 1;
}

/// Owen scrambling of a number whose bits are reversed. Laine and Karras 2011, constants by Vegdahl 2021.
inline std::uint32_t scramble_reversed(std::uint32_t x, std::uint32_t seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= seed >> 16 | 1;
    x ^= x * 0x05526c56u;
    return x ^ x * 0x53a22864u;
}
inline std::uint32_t scramble(std::uint32_t x, std::uint32_t seed) {
    return reverse_bits(scramble_reversed(reverse_bits(x), seed));
}

/// The second dimension of Sobol's sequence from the first: Pascal's triangle modulo 2 (Ahmed 2024).
inline std::uint32_t second_sobol(std::uint32_t first) {
    first ^= first << 16;
    first ^= (first & 0x00ff00ffu) << 8;
    first ^= (first & 0x0f0f0f0fu) << 4;
    first ^= (first & 0x33333333u) << 2;
    return first ^ (first & 0x55555555u) << 1;
}

struct Pair {
    float x, y;
};

/// The random numbers of one sample of one pixel, pair by pair.
class Random {
  public:
    Random(std::uint32_t seed, std::uint32_t pixel, std::uint32_t sample)
        : stream_(hash(hash(seed, pixel), 0x51ed270bu)), sample_(sample) {}

    Pair pair() {
        const std::uint32_t seed = hash(stream_, dimension_++);
        if (dimension_ > stratified_pairs) {  // deep in a path, where stratification has no visible effect
            const std::uint32_t bits = hash(seed, sample_);
            return {unit_float(bits), unit_float(scatter_bits(bits ^ 0xb5297a4du))};
        }
        // The index is shuffled by scrambling it; its reversed bits are Sobol's first dimension.
        const std::uint32_t first = scramble_reversed(reverse_bits(sample_), seed);
        return {unit_float(scramble(first, scatter_bits(seed ^ 0x68bc21ebu))),
                unit_float(scramble(second_sobol(first), scatter_bits(seed ^ 0x02e5be93u)))};
    }
    float number() { return pair().x; }

  private:
    static constexpr std::uint32_t stratified_pairs = 32;
    std::uint32_t stream_, sample_, dimension_ = 0;
};

/// A plain sequence of independent numbers, for growing coats.
class Sequence {
  public:
    explicit Sequence(std::uint32_t seed) : seed_(scatter_bits(seed ^ 0x1b56c4e9u)) {}
    float operator()() { return unit_float(hash(seed_, count_++)); }
    float even() { return 2 * (*this)() - 1; }  ///< in [-1, 1)

  private:
    std::uint32_t seed_, count_ = 0;
};

}  // namespace medulla::render
