// Rows of a table's factors, a block of eight components at a time: blends of four rows, and sums over the components.
// Each comes twice, for what the renderer is built for and for AVX2 (GCC and clang, x86-64), of the same bits. Rests on
// pack.hpp's layout.
#pragma once

#include <cstdint>
#include <cstring>

#include "medulla/detail/lanes.hpp"
#include "medulla/pack.hpp"

#if defined(MEDULLA_SSE2) && defined(__GNUC__) && defined(__x86_64__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#define MEDULLA_ON_AVX2 __attribute__((target("avx2")))
#define MEDULLA_HOT_ON_AVX2 __attribute__((target("avx2"), always_inline)) inline
#include <immintrin.h>
#endif

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// Eight components side by side: AVX2 where the renderer is built for it, SSE2, which every x86-64 has, or plain
/// floats.
template <int bits>
struct Bits {};

#if defined(MEDULLA_SSE2)
/// Eight numbers of a block as 16-bit words.
template <int bits>
MEDULLA_HOT __m128i words_of(const unsigned char* block, Bits<bits>) noexcept {
    /// Halves of bytes, in order, in the upper half of a byte each.
    const auto halves = [](const unsigned char* four) {
        std::int32_t packed;
        std::memcpy(&packed, four, sizeof packed);
        const __m128i both = _mm_cvtsi32_si128(packed), mask = _mm_set1_epi8(char(0xf0));
        return _mm_unpacklo_epi8(_mm_and_si128(_mm_slli_epi16(both, 4), mask), _mm_and_si128(both, mask));
    };
    const auto bytes = [](const unsigned char* eight) {
        return _mm_loadl_epi64(reinterpret_cast<const __m128i*>(eight));
    };
    if constexpr (bits == 4) return _mm_unpacklo_epi8(_mm_setzero_si128(), halves(block));
    if constexpr (bits == 8) return _mm_unpacklo_epi8(_mm_setzero_si128(), bytes(block));
    if constexpr (bits == 12) return _mm_unpacklo_epi8(halves(block + 8), bytes(block));
    if constexpr (bits == 16) return _mm_unpacklo_epi8(bytes(block + 8), bytes(block));
}
#endif
#if defined(MEDULLA_SSE2) && defined(__AVX2__)
struct Eight {
    __m256 v;
};
MEDULLA_HOT Eight zero_eight() noexcept { return {_mm256_setzero_ps()}; }
MEDULLA_HOT Eight load_eight(const float* x) noexcept { return {_mm256_loadu_ps(x)}; }
MEDULLA_HOT void store_eight(Eight a, float* x) noexcept { _mm256_storeu_ps(x, a.v); }
template <int bits>
MEDULLA_HOT Eight convert_eight(const unsigned char* block, Bits<bits> width) noexcept {
    return {_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(words_of(block, width)))};
}
MEDULLA_HOT Eight times(Eight a, Eight b) noexcept { return {_mm256_mul_ps(a.v, b.v)}; }
MEDULLA_HOT Eight times(float a, Eight b) noexcept { return {_mm256_mul_ps(_mm256_set1_ps(a), b.v)}; }
MEDULLA_HOT Eight plus(Eight a, Eight b) noexcept { return {_mm256_add_ps(a.v, b.v)}; }
MEDULLA_HOT float sum_of(Eight a) noexcept {
    const __m128 x = _mm_add_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
    const __m128 y = _mm_add_ps(x, _mm_movehl_ps(x, x));
    return _mm_cvtss_f32(_mm_add_ss(y, _mm_shuffle_ps(y, y, 1)));
}
#elif defined(MEDULLA_SSE2)
struct Eight {
    __m128 low, high;
};
MEDULLA_HOT Eight zero_eight() noexcept { return {_mm_setzero_ps(), _mm_setzero_ps()}; }
MEDULLA_HOT Eight load_eight(const float* x) noexcept { return {_mm_loadu_ps(x), _mm_loadu_ps(x + 4)}; }
MEDULLA_HOT void store_eight(Eight a, float* x) noexcept {
    _mm_storeu_ps(x, a.low);
    _mm_storeu_ps(x + 4, a.high);
}
template <int bits>
MEDULLA_HOT Eight convert_eight(const unsigned char* block, Bits<bits> width) noexcept {
    // A word moved to the upper half and shifted down keeps its sign.
    const __m128i q = words_of(block, width);
    return {_mm_cvtepi32_ps(_mm_srai_epi32(_mm_unpacklo_epi16(q, q), 16)),
            _mm_cvtepi32_ps(_mm_srai_epi32(_mm_unpackhi_epi16(q, q), 16))};
}
MEDULLA_HOT Eight times(Eight a, Eight b) noexcept { return {_mm_mul_ps(a.low, b.low), _mm_mul_ps(a.high, b.high)}; }
MEDULLA_HOT Eight times(float a, Eight b) noexcept {
    const __m128 w = _mm_set1_ps(a);
    return {_mm_mul_ps(w, b.low), _mm_mul_ps(w, b.high)};
}
MEDULLA_HOT Eight plus(Eight a, Eight b) noexcept { return {_mm_add_ps(a.low, b.low), _mm_add_ps(a.high, b.high)}; }
MEDULLA_HOT float sum_of(Eight a) noexcept {
    const __m128 x = _mm_add_ps(a.low, a.high), y = _mm_add_ps(x, _mm_movehl_ps(x, x));
    return _mm_cvtss_f32(_mm_add_ss(y, _mm_shuffle_ps(y, y, 1)));
}
#else
struct Eight {
    float x[rank_multiple];
};
MEDULLA_HOT Eight zero_eight() noexcept { return {}; }
MEDULLA_HOT Eight load_eight(const float* x) noexcept {
    Eight a;
    std::memcpy(a.x, x, sizeof a.x);
    return a;
}
MEDULLA_HOT void store_eight(const Eight& a, float* x) noexcept { std::memcpy(x, a.x, sizeof a.x); }
template <int bits>
MEDULLA_HOT Eight convert_eight(const unsigned char* block, Bits<bits>) noexcept {
    Eight a;
    for (std::uint32_t r = 0; r < rank_multiple; ++r) a.x[r] = float(load_number(block, bits, r));
    return a;
}
MEDULLA_HOT Eight times(const Eight& a, Eight b) noexcept {
    for (std::uint32_t r = 0; r < rank_multiple; ++r) b.x[r] *= a.x[r];
    return b;
}
MEDULLA_HOT Eight times(float a, Eight b) noexcept {
    for (std::uint32_t r = 0; r < rank_multiple; ++r) b.x[r] *= a;
    return b;
}
MEDULLA_HOT Eight plus(const Eight& a, Eight b) noexcept {
    for (std::uint32_t r = 0; r < rank_multiple; ++r) b.x[r] += a.x[r];
    return b;
}
MEDULLA_HOT float sum_of(const Eight& a) noexcept {
    const float* x = a.x;
    return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}
#endif

/// f(Bits<b>) of a block's width.
template <class F>
MEDULLA_HOT Eight of_width(std::uint32_t bits, F&& f) noexcept {
    switch (bits) {
        case 4:
            return f(Bits<4>{});
        case 8:
            return f(Bits<8>{});
        case 12:
            return f(Bits<12>{});
        default:
            return f(Bits<16>{});
    }
}

MEDULLA_HOT Eight convert_eight(const unsigned char* block, std::uint32_t bits) noexcept {
    return of_width(bits, [=](auto width) { return convert_eight(block, width); });
}

/// sum over four rows of w[t] * row_t, for the components of a block; rows are `step` bytes apart.
MEDULLA_HOT Eight blend(const unsigned char* block, std::uint32_t bits, std::size_t step,
                        const SplineWeights<float>& w) noexcept {
    return of_width(bits, [&](auto width) {
        const Eight a = times(w.w[0], convert_eight(block, width)),
                    b = times(w.w[1], convert_eight(block + step, width)),
                    c = times(w.w[2], convert_eight(block + 2 * step, width)),
                    d = times(w.w[3], convert_eight(block + 3 * step, width));
        return plus(plus(a, b), plus(c, d));
    });
}

MEDULLA_HOT Eight load_eight(const TableView& table, std::uint32_t offset, std::uint32_t first) noexcept {
    float x[rank_multiple];
    std::memcpy(x, table.bytes + offset + 4 * first, sizeof x);
    return load_eight(x);
}

/// Sums of a row over the even and over the odd components.
struct RowSums {
    float even, odd;
};

/// Row `row` of axis k times the weights, summed.
MEDULLA_FN RowSums row_sums(const TableView& table, std::uint32_t k, std::uint32_t row, const float* weight) noexcept {
    const unsigned char* block = table.row(k, row);
    Eight sum[2] = {zero_eight(), zero_eight()};
    const auto add = [&](Eight& part, std::uint32_t first) {
        const std::uint32_t bits = table.bits(first);
        part = plus(part, times(load_eight(weight + first), convert_eight(block, bits)));
        block += bits;
    };
    const std::uint32_t even = table.even_stride(), stride = table.layout.rank_stride;
    for (std::uint32_t first = 0; first < even; first += rank_multiple) add(sum[0], first);
    for (std::uint32_t first = even; first < stride; first += rank_multiple) add(sum[1], first);
    return {sum_of(sum[0]), sum_of(sum[1])};
}

// Rows are long enough that a branch to AVX2 pays where the processor has it. No fused products: the bits are the same.
#if defined(MEDULLA_ON_AVX2)
/// Numbers of a block; of 8 bits the upper bytes alone, so that what they are multiplied with is scaled by
/// unit_of<bits>.
template <int bits>
MEDULLA_HOT_ON_AVX2 __m256 wide_eight(const unsigned char* block) noexcept {
    if constexpr (bits == 8)
        return _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(block))));
    else
        return _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(words_of(block, Bits<bits>{})));
}
template <int bits>
inline constexpr float unit_of = bits == 8 ? 256.0f : 1.0f;

/// As sum_of adds.
MEDULLA_HOT_ON_AVX2 float sum_of_wide(__m256 a) noexcept {
    const __m128 x = _mm_add_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    const __m128 y = _mm_add_ps(x, _mm_movehl_ps(x, x));
    return _mm_cvtss_f32(_mm_add_ss(y, _mm_shuffle_ps(y, y, 1)));
}

/// blend, to the bit.
template <int bits>
MEDULLA_HOT_ON_AVX2 __m256 blend_wide(const unsigned char* block, std::size_t step,
                                      const SplineWeights<float>& w) noexcept {
    const __m256 a = _mm256_mul_ps(_mm256_set1_ps(w.w[0] * unit_of<bits>), wide_eight<bits>(block)),
                 b = _mm256_mul_ps(_mm256_set1_ps(w.w[1] * unit_of<bits>), wide_eight<bits>(block + step)),
                 c = _mm256_mul_ps(_mm256_set1_ps(w.w[2] * unit_of<bits>), wide_eight<bits>(block + 2 * step)),
                 d = _mm256_mul_ps(_mm256_set1_ps(w.w[3] * unit_of<bits>), wide_eight<bits>(block + 3 * step));
    return _mm256_add_ps(_mm256_add_ps(a, b), _mm256_add_ps(c, d));
}
MEDULLA_HOT_ON_AVX2 __m256 blend_wide(const unsigned char* block, std::uint32_t bits, std::size_t step,
                                      const SplineWeights<float>& w) noexcept {
    switch (bits) {
        case 4:
            return blend_wide<4>(block, step, w);
        case 8:
            return blend_wide<8>(block, step, w);
        case 12:
            return blend_wide<12>(block, step, w);
        default:
            return blend_wide<16>(block, step, w);
    }
}

MEDULLA_ON_AVX2 inline void scale_by_blend_on_avx2(const TableView& table, const unsigned char* block,
                                                   const SplineWeights<float>& w, const float* from,
                                                   float* to) noexcept {
    for (std::uint32_t first = 0; first < table.layout.rank_stride; first += rank_multiple) {
        const std::uint32_t bits = table.bits(first);
        const __m256 factor = blend_wide(block, bits, table.layout.row_bytes, w);
        _mm256_storeu_ps(to + first, _mm256_mul_ps(_mm256_loadu_ps(from + first), factor));
        block += bits;
    }
}

MEDULLA_ON_AVX2 inline float sum_of_blend_on_avx2(const TableView& table, const unsigned char* block,
                                                  const SplineWeights<float>& w, const float* weight,
                                                  float sign) noexcept {
    const std::uint32_t even = table.even_stride(), stride = table.layout.rank_stride;
    __m256 sum = _mm256_setzero_ps(), odd = sum;
    std::uint32_t first = 0;
    for (; first < even; first += rank_multiple) {
        const std::uint32_t bits = table.bits(first);
        sum = _mm256_add_ps(
            sum, _mm256_mul_ps(_mm256_loadu_ps(weight + first), blend_wide(block, bits, table.layout.row_bytes, w)));
        block += bits;
    }
    for (; first < stride; first += rank_multiple) {
        const std::uint32_t bits = table.bits(first);
        odd = _mm256_add_ps(
            odd, _mm256_mul_ps(_mm256_loadu_ps(weight + first), blend_wide(block, bits, table.layout.row_bytes, w)));
        block += bits;
    }
    return sum_of_wide(_mm256_add_ps(sum, _mm256_mul_ps(_mm256_set1_ps(sign), odd)));
}

/// Adds w times a block of four rows, `step` bytes apart.
template <int bits>
MEDULLA_HOT_ON_AVX2 void add_four_blocks(const unsigned char* block, std::size_t step, __m256 w, __m256& a, __m256& b,
                                         __m256& c, __m256& d) noexcept {
    w = _mm256_mul_ps(w, _mm256_set1_ps(unit_of<bits>));
    a = _mm256_add_ps(a, _mm256_mul_ps(w, wide_eight<bits>(block)));
    b = _mm256_add_ps(b, _mm256_mul_ps(w, wide_eight<bits>(block + step)));
    c = _mm256_add_ps(c, _mm256_mul_ps(w, wide_eight<bits>(block + 2 * step)));
    d = _mm256_add_ps(d, _mm256_mul_ps(w, wide_eight<bits>(block + 3 * step)));
}

/// row_sums of four rows side by side, to the bit.
MEDULLA_ON_AVX2 inline void four_row_sums_on_avx2(const TableView& table, std::uint32_t k, std::uint32_t row,
                                                  const float* weight, RowSums (&sums)[4]) noexcept {
    const unsigned char* block = table.row(k, row);
    const std::size_t step = table.layout.row_bytes;
    std::uint32_t first = 0;
    float part[2][4];
    for (int odd = 0; odd < 2; ++odd) {
        const std::uint32_t end = odd ? table.layout.rank_stride : table.even_stride();
        __m256 a = _mm256_setzero_ps(), b = a, c = a, d = a;
        for (; first < end; first += rank_multiple) {
            const __m256 w = _mm256_loadu_ps(weight + first);
            const std::uint32_t bits = table.bits(first);
            switch (bits) {
                case 4:
                    add_four_blocks<4>(block, step, w, a, b, c, d);
                    break;
                case 8:
                    add_four_blocks<8>(block, step, w, a, b, c, d);
                    break;
                case 12:
                    add_four_blocks<12>(block, step, w, a, b, c, d);
                    break;
                default:
                    add_four_blocks<16>(block, step, w, a, b, c, d);
            }
            block += bits;
        }
        // As sum_of adds.
        __m128 w = _mm_add_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1)),
               x = _mm_add_ps(_mm256_castps256_ps128(b), _mm256_extractf128_ps(b, 1)),
               y = _mm_add_ps(_mm256_castps256_ps128(c), _mm256_extractf128_ps(c, 1)),
               z = _mm_add_ps(_mm256_castps256_ps128(d), _mm256_extractf128_ps(d, 1));
        _MM_TRANSPOSE4_PS(w, x, y, z);
        _mm_storeu_ps(part[odd], _mm_add_ps(_mm_add_ps(w, y), _mm_add_ps(x, z)));
    }
    for (int i = 0; i < 4; ++i) sums[i] = {part[0][i], part[1][i]};
}
#endif

/// row_sums of rows `row` .. `row + 3`: on AVX2 where the processor has it, to the same bits, as the two below.
MEDULLA_FN void four_row_sums(const TableView& table, std::uint32_t k, std::uint32_t row, const float* weight,
                              RowSums (&sums)[4]) noexcept {
#if defined(MEDULLA_ON_AVX2)
    if (__builtin_cpu_supports("avx2")) return four_row_sums_on_avx2(table, k, row, weight, sums);
#endif
    for (std::uint32_t i = 0; i < 4; ++i) sums[i] = row_sums(table, k, row + i, weight);
}

/// to[r] = from[r] * (blend of four rows of axis k from `row` on)[r].
MEDULLA_FN void scale_by_blend(const TableView& table, std::uint32_t k, std::uint32_t row,
                               const SplineWeights<float>& w, const float* from, float* to) noexcept {
    const unsigned char* block = table.row(k, row);
#if defined(MEDULLA_ON_AVX2)
    if (__builtin_cpu_supports("avx2")) return scale_by_blend_on_avx2(table, block, w, from, to);
#endif
    for (std::uint32_t first = 0; first < table.layout.rank_stride; first += rank_multiple) {
        const std::uint32_t bits = table.bits(first);
        store_eight(times(load_eight(from + first), blend(block, bits, table.layout.row_bytes, w)), to + first);
        block += bits;
    }
}

/// Sum over r of weight[r] * (blend of four rows of axis k from `row` on)[r], odd components times `sign`.
MEDULLA_FN float sum_of_blend(const TableView& table, std::uint32_t k, std::uint32_t row, const SplineWeights<float>& w,
                              const float* weight, float sign) noexcept {
    const unsigned char* block = table.row(k, row);
#if defined(MEDULLA_ON_AVX2)
    if (__builtin_cpu_supports("avx2")) return sum_of_blend_on_avx2(table, block, w, weight, sign);
#endif
    Eight sum[2] = {zero_eight(), zero_eight()};
    const auto add = [&](Eight& part, std::uint32_t first) {
        const std::uint32_t bits = table.bits(first);
        part = plus(part, times(load_eight(weight + first), blend(block, bits, table.layout.row_bytes, w)));
        block += bits;
    };
    const std::uint32_t even = table.even_stride(), stride = table.layout.rank_stride;
    for (std::uint32_t first = 0; first < even; first += rank_multiple) add(sum[0], first);
    for (std::uint32_t first = even; first < stride; first += rank_multiple) add(sum[1], first);
    return sum_of(plus(sum[0], times(sign, sum[1])));
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
