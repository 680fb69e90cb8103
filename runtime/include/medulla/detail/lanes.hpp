// The one vector type: four floats with the operators of one, so that the same formula runs for one offset or for four.
// SSE2 on x86-64, NEON on AArch64; elsewhere, on GPUs, or with MEDULLA_NO_SIMD defined, an array of four. No struct
// that a user keeps holds one: their layout is the same everywhere.
#pragma once

#include <cstdint>
#include <cstring>

#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"

#if !defined(MEDULLA_NO_SIMD) && !defined(__CUDA_ARCH__) && !defined(__HIP_DEVICE_COMPILE__)
#if defined(__SSE2__) || defined(_M_X64)
#define MEDULLA_SSE2 1
#include <emmintrin.h>
#if defined(__AVX2__)
#include <immintrin.h>
#endif
// What is compiled a second time for AVX2 with fused products, and run where the processor has them.
#if defined(__GNUC__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#define MEDULLA_WIDE 1
#include <immintrin.h>
#endif
#elif defined(__ARM_NEON) && defined(__aarch64__)
#define MEDULLA_NEON 1
#include <arm_neon.h>
#endif
#endif

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

MEDULLA_FN std::uint32_t bits_of(float x) noexcept {
    std::uint32_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    return bits;
}
/// |x| <= limit, false for a NaN also under -ffast-math: compared as bits, limit > 0.
MEDULLA_FN bool within(float x, float limit) noexcept { return (bits_of(x) & 0x7fffffffu) <= bits_of(limit); }
/// The whole number nearest to a; what is too large to have a fraction, and a NaN, stays as it is.
MEDULLA_FN float nearest_integer(float a) noexcept {
    return within(a, 8388608.0f) ? float(std::int32_t(a + detail::math::copysign(0.5f, a))) : a;
}

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
/// The same, lane by lane.
inline FourMask within(Four a, float limit) noexcept {
    const __m128i bits = _mm_and_si128(_mm_castps_si128(a.v), _mm_set1_epi32(0x7fffffff));
    const __m128i end = _mm_add_epi32(_mm_castps_si128(_mm_set1_ps(limit)), _mm_set1_epi32(1));
    return {_mm_castsi128_ps(_mm_cmplt_epi32(bits, end))};
}
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
/// The whole number nearest to a, |a| < 2^31, in any rounding mode: half a unit is added and the rest cut off.
inline Four nearest_integer(Four a) noexcept {
    const __m128 half = _mm_or_ps(_mm_and_ps(a.v, _mm_set1_ps(-0.0f)), _mm_set1_ps(0.5f));
    return Four(_mm_cvtepi32_ps(_mm_cvttps_epi32(_mm_add_ps(a.v, half))));
}
/// 2^k for whole k, -126 <= k <= 127.
inline Four power_of_two(Four k) noexcept {
    const __m128i n = _mm_cvttps_epi32(k.v);
    return Four(_mm_castsi128_ps(_mm_slli_epi32(_mm_add_epi32(n, _mm_set1_epi32(127)), 23)));
}
inline bool any(FourMask mask) noexcept { return _mm_movemask_ps(mask.v) != 0; }
inline Four four_at(const float* x) noexcept { return Four(_mm_loadu_ps(x)); }
/// @param x aligned to 16 bytes
inline Four aligned_four_at(const float* x) noexcept { return Four(_mm_load_ps(x)); }
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
#elif defined(MEDULLA_NEON)
struct Four {
    float32x4_t v;
    Four() noexcept : v(vdupq_n_f32(0)) {}
    Four(float x) noexcept : v(vdupq_n_f32(x)) {}  // implicit: a number is four of itself
    explicit Four(float32x4_t x) noexcept : v(x) {}
    Four(float a, float b, float c, float d) noexcept : v{a, b, c, d} {}
};
inline Four operator+(Four a, Four b) noexcept { return Four(vaddq_f32(a.v, b.v)); }
inline Four operator-(Four a, Four b) noexcept { return Four(vsubq_f32(a.v, b.v)); }
inline Four operator*(Four a, Four b) noexcept { return Four(vmulq_f32(a.v, b.v)); }
inline Four operator/(Four a, Four b) noexcept { return Four(vdivq_f32(a.v, b.v)); }
inline Four operator-(Four a) noexcept { return Four(vnegq_f32(a.v)); }
struct FourMask {
    uint32x4_t v;
};
inline FourMask operator<(Four a, Four b) noexcept { return {vcltq_f32(a.v, b.v)}; }
inline FourMask operator>(Four a, Four b) noexcept { return {vcgtq_f32(a.v, b.v)}; }
inline FourMask operator&(FourMask a, FourMask b) noexcept { return {vandq_u32(a.v, b.v)}; }
inline FourMask within(Four a, float limit) noexcept {
    return {vcleq_u32(vandq_u32(vreinterpretq_u32_f32(a.v), vdupq_n_u32(0x7fffffffu)), vdupq_n_u32(bits_of(limit)))};
}
inline Four choose(FourMask mask, Four yes, Four no) noexcept { return Four(vbslq_f32(mask.v, yes.v, no.v)); }
inline Four greater(Four a, Four b) noexcept { return choose(a > b, a, b); }
inline Four lesser(Four a, Four b) noexcept { return choose(a < b, a, b); }
inline Four only_where(FourMask mask, Four a) noexcept {
    return Four(vreinterpretq_f32_u32(vandq_u32(mask.v, vreinterpretq_u32_f32(a.v))));
}
inline Four zero_where(FourMask mask, Four a) noexcept {
    return Four(vreinterpretq_f32_u32(vbicq_u32(vreinterpretq_u32_f32(a.v), mask.v)));
}
inline Four square_root(Four a) noexcept { return Four(vsqrtq_f32(a.v)); }
inline Four magnitude(Four a) noexcept { return Four(vabsq_f32(a.v)); }
inline Four with_sign(Four x, Four y) noexcept { return Four(vbslq_f32(vdupq_n_u32(0x80000000u), y.v, x.v)); }
inline Four nearest_integer(Four a) noexcept {
    return Four(vcvtq_f32_s32(vcvtq_s32_f32(vaddq_f32(a.v, with_sign(Four(0.5f), a).v))));
}
inline Four power_of_two(Four k) noexcept {
    return Four(vreinterpretq_f32_s32(vshlq_n_s32(vaddq_s32(vcvtq_s32_f32(k.v), vdupq_n_s32(127)), 23)));
}
inline bool any(FourMask mask) noexcept { return vmaxvq_u32(mask.v) != 0; }
inline Four four_at(const float* x) noexcept { return Four(vld1q_f32(x)); }
inline Four aligned_four_at(const float* x) noexcept { return Four(vld1q_f32(x)); }
inline void store_four(Four a, float* x) noexcept { vst1q_f32(x, a.v); }
inline void store_whole(Four a, std::int32_t* n) noexcept { vst1q_s32(n, vcvtq_s32_f32(a.v)); }
inline unsigned below_zero(Four a) noexcept {
    const uint32x4_t bit = {1, 2, 4, 8};
    return vaddvq_u32(vandq_u32(vcltq_f32(a.v, vdupq_n_f32(0)), bit));
}
template <int i>
inline Four spread(Four a) noexcept {
    return Four(vdupq_laneq_f32(a.v, i));
}
inline void transpose(Four& a, Four& b, Four& c, Four& d) noexcept {
    const float32x4x2_t x = vtrnq_f32(a.v, b.v), y = vtrnq_f32(c.v, d.v);
    a.v = vcombine_f32(vget_low_f32(x.val[0]), vget_low_f32(y.val[0]));
    b.v = vcombine_f32(vget_low_f32(x.val[1]), vget_low_f32(y.val[1]));
    c.v = vcombine_f32(vget_high_f32(x.val[0]), vget_high_f32(y.val[0]));
    d.v = vcombine_f32(vget_high_f32(x.val[1]), vget_high_f32(y.val[1]));
}
inline float lane(Four a, int i) noexcept {
    float x[4];
    vst1q_f32(x, a.v);
    return x[i];
}
inline float sum_of(Four a) noexcept {
    const float32x2_t y = vadd_f32(vget_low_f32(a.v), vget_high_f32(a.v));
    return vget_lane_f32(y, 0) + vget_lane_f32(y, 1);
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
MEDULLA_FN FourMask within(Four a, float limit) noexcept {
    return {{within(a.v[0], limit), within(a.v[1], limit), within(a.v[2], limit), within(a.v[3], limit)}};
}
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
    return each([&](int i) { return detail::math::sqrt(a.v[i]); });
}
MEDULLA_FN Four magnitude(Four a) noexcept {
    return each([&](int i) { return a.v[i] < 0 ? -a.v[i] : a.v[i]; });
}
/// |x| with the sign of y.
MEDULLA_FN Four with_sign(Four x, Four y) noexcept { return choose(y < Four(0.0f), -magnitude(x), magnitude(x)); }
MEDULLA_FN Four nearest_integer(Four a) noexcept {
    return each([&](int i) { return nearest_integer(a.v[i]); });
}
/// 2^k for whole k, -126 <= k <= 127.
MEDULLA_FN Four power_of_two(Four k) noexcept {
    return each([&](int i) { return ::ldexpf(1.0f, int(k.v[i])); });
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
/// Rows become columns.
MEDULLA_FN void transpose(Four& a, Four& b, Four& c, Four& d) noexcept {
    const Four x = a, y = b, z = c, w = d;
    a = Four(x.v[0], y.v[0], z.v[0], w.v[0]), b = Four(x.v[1], y.v[1], z.v[1], w.v[1]);
    c = Four(x.v[2], y.v[2], z.v[2], w.v[2]), d = Four(x.v[3], y.v[3], z.v[3], w.v[3]);
}
MEDULLA_FN float lane(Four a, int i) noexcept { return a.v[i]; }
MEDULLA_FN float sum_of(Four a) noexcept { return (a.v[0] + a.v[2]) + (a.v[1] + a.v[3]); }
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
MEDULLA_FN float zero_where(bool condition, float a) noexcept { return condition ? 0.0f : a; }
template <class T>
MEDULLA_FN T square_root(T a) noexcept {
    using detail::math::sqrt;
    return sqrt(a);
}
template <class T>
MEDULLA_FN T magnitude(T a) noexcept {
    return a < T(0) ? -a : a;
}
template <class T>
MEDULLA_FN T nearest_integer(T a) noexcept {
    using detail::math::floor;
    return floor(a + T(0.5));
}
MEDULLA_HOT float magnitude(float a) noexcept { return detail::math::abs(a); }
MEDULLA_HOT float with_sign(float x, float y) noexcept { return detail::math::copysign(x, y); }
MEDULLA_FN float power_of_two(float k) noexcept {
    const std::uint32_t bits = std::uint32_t(std::int32_t(k) + 127) << 23;
    float x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}
MEDULLA_FN float lane(float a, int) noexcept { return a; }
MEDULLA_FN float sum_of(float a) noexcept { return a; }

/// Runs f(), compiled twice: for what the renderer is built for and, taken where the processor has them, for AVX2 with
/// fused products. The compiler may fuse there, so the two differ by rounding.
#if defined(MEDULLA_WIDE) && !defined(__FMA__)
template <class F>
__attribute__((target("avx2,fma"), flatten, noinline)) auto run_on_fma(const F& f) noexcept {
    return f();
}
template <class F>
MEDULLA_APART auto run_plain(const F& f) noexcept {
    return f();
}
template <class F>
MEDULLA_FN auto run_fused(const F& f) noexcept {
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return run_on_fma(f);
    return run_plain(f);
}
#else
template <class F>
MEDULLA_FN auto run_fused(const F& f) noexcept {
    return f();
}
#endif

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
