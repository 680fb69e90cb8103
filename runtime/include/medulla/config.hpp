// The one macro that lets every function of the runtime compile for a GPU as well.
#pragma once

#if defined(__CUDACC__) || defined(__HIPCC__)
#define MEDULLA_FN __host__ __device__ inline
#else
#define MEDULLA_FN inline
#endif

namespace medulla {

inline constexpr double pi = 3.14159265358979323846;

}  // namespace medulla
