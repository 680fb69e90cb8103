// What every header of the runtime needs: function attributes, and the namespace tag that keeps objects apart which
// were compiled for different instruction sets.
#pragma once

/// Marks every function of the runtime: inline, and compiled for a GPU as well where the compiler can.
#if defined(__CUDACC__) || defined(__HIPCC__)
#define MEDULLA_FN __host__ __device__ inline
#else
#define MEDULLA_FN inline
#endif

/// The innermost functions of a lookup, which GCC at -O2 would otherwise call.
#if defined(__CUDACC__) || defined(__HIPCC__)
#define MEDULLA_HOT __host__ __device__ __forceinline__
#elif defined(__GNUC__)
#define MEDULLA_HOT __attribute__((always_inline)) inline
#else
#define MEDULLA_HOT inline
#endif

/// What a lookup seldom needs, or what several callers share: never inlined, which keeps the code of a hit in the
/// processor's instruction cache and compile times short.
#if defined(__CUDACC__) || defined(__HIPCC__)
#define MEDULLA_APART __host__ __device__ __noinline__ inline
#elif defined(__GNUC__)
#define MEDULLA_APART __attribute__((noinline)) inline
#elif defined(_MSC_VER)
#define MEDULLA_APART __declspec(noinline) inline
#else
#define MEDULLA_APART inline
#endif

// Two files compiled with different -m flags or with -ffast-math hold different code under the same inline function, of
// which the linker keeps one: AVX code could end up in a program for every processor. So all of the runtime lives in an
// inline namespace whose name says what it was compiled for. Users write medulla::; structs have one layout everywhere,
// so files of different flags can still exchange them as bytes.
#if defined(__AVX512F__)
#define MEDULLA_ISA avx512
#elif defined(__AVX2__)
#define MEDULLA_ISA avx2
#elif defined(__AVX__)
#define MEDULLA_ISA avx
#elif defined(__SSE4_1__)
#define MEDULLA_ISA sse4
#elif defined(__SSE3__)
#define MEDULLA_ISA sse3
#elif defined(__SSE2__) || defined(_M_X64)
#define MEDULLA_ISA sse2
#elif defined(__ARM_NEON)
#define MEDULLA_ISA neon
#else
#define MEDULLA_ISA plain
#endif
#if defined(__FMA__)
#define MEDULLA_FUSED _fma
#else
#define MEDULLA_FUSED
#endif
#if defined(__BMI2__)
#define MEDULLA_BITS _bmi2
#else
#define MEDULLA_BITS
#endif
#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#define MEDULLA_MATH _fast
#else
#define MEDULLA_MATH
#endif
#if defined(MEDULLA_NO_SIMD)
#define MEDULLA_LANES _scalar
#else
#define MEDULLA_LANES
#endif
#define MEDULLA_JOIN_(a, b, c, d, e) a##b##c##d##e
#define MEDULLA_JOIN(a, b, c, d, e) MEDULLA_JOIN_(a, b, c, d, e)
#define MEDULLA_TARGET MEDULLA_JOIN(MEDULLA_ISA, MEDULLA_FUSED, MEDULLA_BITS, MEDULLA_MATH, MEDULLA_LANES)

namespace medulla {
inline namespace MEDULLA_TARGET {

inline constexpr double pi = 3.14159265358979323846;

}  // namespace MEDULLA_TARGET
}  // namespace medulla
