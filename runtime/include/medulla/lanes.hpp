// Four floats side by side with the operators of one, so that the same formula runs for one offset or for four.
// Rests on SSE2, which every x86-64 has; elsewhere, or with MEDULLA_NO_SIMD defined, plain arrays that a compiler may
// or may not join.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "medulla/config.hpp"

#if defined(__SSE2__) && !defined(MEDULLA_NO_SIMD) && !defined(__CUDA_ARCH__) && !defined(__HIP_DEVICE_COMPILE__)
#define MEDULLA_SSE2 1
#include <emmintrin.h>
#if defined(__AVX2__)
#include <immintrin.h>
#endif
// What may be compiled for AVX2 with fused products beside what the renderer is built for, and taken where the
// processor has them.
#if defined(__GNUC__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#define MEDULLA_WIDE __attribute__((target("avx2,fma")))
#include <immintrin.h>
#endif
#endif

namespace medulla {

namespace detail {

MEDULLA_FN std::uint32_t bits_of(float x) noexcept {
    std::uint32_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    return bits;
}
/// |x| <= limit, false for a NaN also under -ffast-math: compared as bits, limit > 0.
MEDULLA_FN bool within(float x, float limit) noexcept { return (bits_of(x) & 0x7fffffffu) <= bits_of(limit); }

}  // namespace detail

#if defined(MEDULLA_SSE2)
struct Four {
    __m128 v;
    Four() noexcept : v(_mm_setzero_ps()) {}
    Four(float x) noexcept : v(_mm_set1_ps(x)) {}  // implicit: a number is four of itself
    explicit Four(__m128 x) noexcept : v(x) {}
    Four(float a, float b, float c, float d) noexcept : v(_mm_setr_ps(a, b, c, d)) {}
};
inline Four operator+(Four a, Four b) noexcept { return Four(_mm_add_ps(a.v, b.v)); }
inline Four operator-(Four a, Four b) noexcept { return Four(_mm_sub_ps(a.v, b.v)); }
inline Four operator*(Four a, Four b) noexcept { return Four(_mm_mul_ps(a.v, b.v)); }
inline Four operator/(Four a, Four b) noexcept { return Four(_mm_div_ps(a.v, b.v)); }
inline Four operator-(Four a) noexcept { return Four(_mm_xor_ps(a.v, _mm_set1_ps(-0.0f))); }
/// Comparisons give masks for `choose`.
struct FourMask {
    __m128 v;
};
inline FourMask operator<(Four a, Four b) noexcept { return {_mm_cmplt_ps(a.v, b.v)}; }
inline FourMask operator>(Four a, Four b) noexcept { return {_mm_cmpgt_ps(a.v, b.v)}; }
inline FourMask operator&(FourMask a, FourMask b) noexcept { return {_mm_and_ps(a.v, b.v)}; }
namespace detail {
/// The same, lane by lane.
inline FourMask within(Four a, float limit) noexcept {
    const __m128i bits = _mm_and_si128(_mm_castps_si128(a.v), _mm_set1_epi32(0x7fffffff));
    const __m128i end = _mm_add_epi32(_mm_castps_si128(_mm_set1_ps(limit)), _mm_set1_epi32(1));
    return {_mm_castsi128_ps(_mm_cmplt_epi32(bits, end))};
}
}  // namespace detail
inline Four choose(FourMask mask, Four yes, Four no) noexcept {
    return Four(_mm_or_ps(_mm_and_ps(mask.v, yes.v), _mm_andnot_ps(mask.v, no.v)));
}
/// The greater; b for a NaN in a.
inline Four greater(Four a, Four b) noexcept { return Four(_mm_max_ps(a.v, b.v)); }
/// The lesser; b for a NaN in a.
inline Four lesser(Four a, Four b) noexcept { return Four(_mm_min_ps(a.v, b.v)); }
/// 0 where the mask is set.
inline Four zero_where(FourMask mask, Four a) noexcept { return Four(_mm_andnot_ps(mask.v, a.v)); }
/// 0 where the mask is not set.
inline Four only_where(FourMask mask, Four a) noexcept { return Four(_mm_and_ps(mask.v, a.v)); }
inline Four square_root(Four a) noexcept { return Four(_mm_sqrt_ps(a.v)); }
inline Four magnitude(Four a) noexcept { return Four(_mm_andnot_ps(_mm_set1_ps(-0.0f), a.v)); }
/// |x| with the sign of y.
inline Four with_sign(Four x, Four y) noexcept {
    const __m128 sign = _mm_set1_ps(-0.0f);
    return Four(_mm_or_ps(_mm_andnot_ps(sign, x.v), _mm_and_ps(sign, y.v)));
}
inline Four nearest_integer(Four a) noexcept { return Four(_mm_cvtepi32_ps(_mm_cvtps_epi32(a.v))); }
/// 2^k for whole k, -126 <= k <= 127.
inline Four power_of_two(Four k) noexcept {
    const __m128i n = _mm_cvtps_epi32(k.v);
    return Four(_mm_castsi128_ps(_mm_slli_epi32(_mm_add_epi32(n, _mm_set1_epi32(127)), 23)));
}
inline bool any(FourMask mask) noexcept { return _mm_movemask_ps(mask.v) != 0; }
inline Four four_at(const float* x) noexcept { return Four(_mm_loadu_ps(x)); }
/// @param x aligned to 16 bytes
inline Four aligned_four_at(const float* x) noexcept { return Four(_mm_load_ps(x)); }
/// The whole part of lane 0, below 2^31.
inline std::int32_t whole(Four a) noexcept { return _mm_cvttss_si32(a.v); }
inline void store_four(Four a, float* x) noexcept { _mm_storeu_ps(x, a.v); }
/// Whole parts of numbers below 2^31.
inline void store_whole(Four a, std::int32_t* n) noexcept {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(n), _mm_cvttps_epi32(a.v));
}
/// Bit i: whether lane i is below 0.
inline unsigned below_zero(Four a) noexcept { return unsigned(_mm_movemask_ps(a.v)); }
/// Lane i in every lane.
template <int i>
inline Four spread(Four a) noexcept {
    return Four(_mm_shuffle_ps(a.v, a.v, i * 0x55));
}
/// Lanes 0 0 1 1 and 2 2 3 3.
inline Four lower_twice(Four a) noexcept { return Four(_mm_unpacklo_ps(a.v, a.v)); }
inline Four upper_twice(Four a) noexcept { return Four(_mm_unpackhi_ps(a.v, a.v)); }
/// Rows become columns.
inline void transpose(Four& a, Four& b, Four& c, Four& d) noexcept { _MM_TRANSPOSE4_PS(a.v, b.v, c.v, d.v); }
inline float lane(Four a, int i) noexcept {
    alignas(16) float x[4];
    _mm_store_ps(x, a.v);
    return x[i];
}
inline float sum_of(Four a) noexcept {
    const __m128 y = _mm_add_ps(a.v, _mm_movehl_ps(a.v, a.v));
    return _mm_cvtss_f32(_mm_add_ss(y, _mm_shuffle_ps(y, y, 1)));
}
#else
struct Four {
    float v[4];
    MEDULLA_FN Four() noexcept : v{0, 0, 0, 0} {}
    MEDULLA_FN Four(float x) noexcept : v{x, x, x, x} {}  // implicit: a number is four of itself
    MEDULLA_FN Four(float a, float b, float c, float d) noexcept : v{a, b, c, d} {}
};
template <class F>
MEDULLA_FN Four each(F&& f) noexcept {
    return Four(f(0), f(1), f(2), f(3));
}
MEDULLA_FN Four operator+(Four a, Four b) noexcept {
    return each([&](int i) { return a.v[i] + b.v[i]; });
}
MEDULLA_FN Four operator-(Four a, Four b) noexcept {
    return each([&](int i) { return a.v[i] - b.v[i]; });
}
MEDULLA_FN Four operator*(Four a, Four b) noexcept {
    return each([&](int i) { return a.v[i] * b.v[i]; });
}
MEDULLA_FN Four operator/(Four a, Four b) noexcept {
    return each([&](int i) { return a.v[i] / b.v[i]; });
}
MEDULLA_FN Four operator-(Four a) noexcept {
    return each([&](int i) { return -a.v[i]; });
}
/// Comparisons give masks for `choose`.
struct FourMask {
    bool v[4];
};
MEDULLA_FN FourMask operator<(Four a, Four b) noexcept {
    return {{a.v[0] < b.v[0], a.v[1] < b.v[1], a.v[2] < b.v[2], a.v[3] < b.v[3]}};
}
MEDULLA_FN FourMask operator>(Four a, Four b) noexcept { return b < a; }
namespace detail {
MEDULLA_FN FourMask within(Four a, float limit) noexcept {
    return {{within(a.v[0], limit), within(a.v[1], limit), within(a.v[2], limit), within(a.v[3], limit)}};
}
}  // namespace detail
MEDULLA_FN FourMask operator&(FourMask a, FourMask b) noexcept {
    return {{a.v[0] && b.v[0], a.v[1] && b.v[1], a.v[2] && b.v[2], a.v[3] && b.v[3]}};
}
MEDULLA_FN Four choose(FourMask mask, Four yes, Four no) noexcept {
    return each([&](int i) { return mask.v[i] ? yes.v[i] : no.v[i]; });
}
/// The greater; b for a NaN in a.
MEDULLA_FN Four greater(Four a, Four b) noexcept { return choose(a > b, a, b); }
/// The lesser; b for a NaN in a.
MEDULLA_FN Four lesser(Four a, Four b) noexcept { return choose(a < b, a, b); }
/// 0 where the mask is set.
MEDULLA_FN Four zero_where(FourMask mask, Four a) noexcept { return choose(mask, Four(0.0f), a); }
MEDULLA_FN Four only_where(FourMask mask, Four a) noexcept { return choose(mask, a, Four(0.0f)); }
MEDULLA_FN Four square_root(Four a) noexcept {
    return each([&](int i) { return std::sqrt(a.v[i]); });
}
MEDULLA_FN Four magnitude(Four a) noexcept {
    return each([&](int i) { return a.v[i] < 0 ? -a.v[i] : a.v[i]; });
}
/// |x| with the sign of y.
MEDULLA_FN Four with_sign(Four x, Four y) noexcept { return choose(y < Four(0.0f), -magnitude(x), magnitude(x)); }
MEDULLA_FN Four nearest_integer(Four a) noexcept {
    return each([&](int i) { return float(std::int32_t(a.v[i] + (a.v[i] < 0 ? -0.5f : 0.5f))); });
}
/// 2^k for whole k, -126 <= k <= 127.
MEDULLA_FN Four power_of_two(Four k) noexcept {
    return each([&](int i) { return std::ldexp(1.0f, int(k.v[i])); });
}
MEDULLA_FN bool any(FourMask mask) noexcept { return mask.v[0] || mask.v[1] || mask.v[2] || mask.v[3]; }
MEDULLA_FN Four four_at(const float* x) noexcept { return Four(x[0], x[1], x[2], x[3]); }
MEDULLA_FN Four aligned_four_at(const float* x) noexcept { return four_at(x); }
MEDULLA_FN void store_four(Four a, float* x) noexcept {
    for (int i = 0; i < 4; ++i) x[i] = a.v[i];
}
/// Whole parts of numbers below 2^31.
MEDULLA_FN void store_whole(Four a, std::int32_t* n) noexcept {
    for (int i = 0; i < 4; ++i) n[i] = std::int32_t(a.v[i]);
}
/// Bit i: whether lane i is below 0.
MEDULLA_FN unsigned below_zero(Four a) noexcept {
    return unsigned(a.v[0] < 0) | unsigned(a.v[1] < 0) << 1 | unsigned(a.v[2] < 0) << 2 | unsigned(a.v[3] < 0) << 3;
}
/// Lane i in every lane.
template <int i>
MEDULLA_FN Four spread(Four a) noexcept {
    return Four(a.v[i]);
}
/// Lanes 0 0 1 1 and 2 2 3 3.
MEDULLA_FN Four lower_twice(Four a) noexcept { return Four(a.v[0], a.v[0], a.v[1], a.v[1]); }
MEDULLA_FN Four upper_twice(Four a) noexcept { return Four(a.v[2], a.v[2], a.v[3], a.v[3]); }
/// Rows become columns.
MEDULLA_FN void transpose(Four& a, Four& b, Four& c, Four& d) noexcept {
    const Four x = a, y = b, z = c, w = d;
    a = Four(x.v[0], y.v[0], z.v[0], w.v[0]), b = Four(x.v[1], y.v[1], z.v[1], w.v[1]);
    c = Four(x.v[2], y.v[2], z.v[2], w.v[2]), d = Four(x.v[3], y.v[3], z.v[3], w.v[3]);
}
MEDULLA_FN float lane(Four a, int i) noexcept { return a.v[i]; }
MEDULLA_FN float sum_of(Four a) noexcept { return (a.v[0] + a.v[2]) + (a.v[1] + a.v[3]); }
#endif

/// One number, kept as a vector processor wants it for products with four others: in every lane.
#if defined(MEDULLA_SSE2)
using Same = Four;
#else
using Same = float;
#endif

/// A constant as one number or as four.
template <class T>
struct Constant {
    static MEDULLA_FN T of(double x) noexcept { return T(x); }
};
template <>
struct Constant<Four> {
    static MEDULLA_FN Four of(double x) noexcept { return Four(float(x)); }
};

// The same names for one number.
template <class T>
MEDULLA_FN T choose(bool condition, T yes, T no) noexcept {
    return condition ? yes : no;
}
MEDULLA_FN float greater(float a, float b) noexcept { return a > b ? a : b; }
MEDULLA_FN float lesser(float a, float b) noexcept { return a < b ? a : b; }
MEDULLA_FN std::int32_t whole(float a) noexcept { return std::int32_t(a); }
MEDULLA_FN float zero_where(bool condition, float a) noexcept { return condition ? 0.0f : a; }
template <class T>
MEDULLA_FN T square_root(T a) noexcept {
    using std::sqrt;
    return sqrt(a);
}
template <class T>
MEDULLA_FN T magnitude(T a) noexcept {
    return a < T(0) ? -a : a;
}
template <class T>
MEDULLA_FN T nearest_integer(T a) noexcept {
    using std::floor;
    return floor(a + T(0.5));
}
MEDULLA_FN float magnitude(float a) noexcept { return a < 0 ? -a : a; }
MEDULLA_FN float with_sign(float x, float y) noexcept { return y < 0 ? -magnitude(x) : magnitude(x); }
#if defined(MEDULLA_SSE2)
// In a vector's lowest lane, since a way through the integer registers takes twice as long.
inline float nearest_integer(float a) noexcept { return _mm_cvtss_f32(nearest_integer(Four(a)).v); }
inline float power_of_two(float k) noexcept { return _mm_cvtss_f32(power_of_two(Four(k)).v); }
#else
MEDULLA_FN float nearest_integer(float a) noexcept { return float(std::int32_t(a + (a < 0 ? -0.5f : 0.5f))); }
MEDULLA_FN float power_of_two(float k) noexcept {
    const std::int32_t bits = (std::int32_t(k) + 127) * 8388608;  // 2^23
    float x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}
#endif
MEDULLA_FN float lane(float a, int) noexcept { return a; }
MEDULLA_FN float sum_of(float a) noexcept { return a; }

#if defined(MEDULLA_WIDE)
/// Whether what is marked MEDULLA_WIDE can run.
inline bool has_wide() noexcept {
#if defined(__AVX2__) && defined(__FMA__)
    return true;
#else
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#endif
}
namespace detail {
template <class F>
__attribute__((target("avx2"), flatten)) void run_on_avx2(const F& f) noexcept {
    f();
}
template <class F>
__attribute__((target("avx2,fma"), flatten)) void run_on_fma(const F& f) noexcept {
    f();
}
}  // namespace detail
/// f(), compiled twice: for what the renderer is built for and, taken where the processor has it, for AVX2. For work of
/// microseconds, not for one number.
template <class F>
void run_widest(const F& f) noexcept {
#if !defined(__AVX2__)
    if (has_wide()) return detail::run_on_avx2(f);
#endif
    f();
}
/// The same with FMA: what is MEDULLA_WIDE is inlined, and a compiler that fuses products may, and so round less often.
template <class F>
void run_fused(const F& f) noexcept {
#if !defined(__FMA__)
    if (has_wide()) return detail::run_on_fma(f);
#endif
    f();
}
#else
/// f(), as the renderer is built.
template <class F>
MEDULLA_FN void run_widest(const F& f) noexcept {
    f();
}
template <class F>
MEDULLA_FN void run_fused(const F& f) noexcept {
    f();
}
#endif

}  // namespace medulla
