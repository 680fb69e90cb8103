// The one macro that lets every function of the runtime compile for a GPU as well.
#pragma once

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

namespace medulla {

inline constexpr double pi = 3.14159265358979323846;

}  // namespace medulla
