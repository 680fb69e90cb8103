// Keeps Eigen's matrix products on the calling thread: their block sizes, hence their rounding, follow the thread
// count. Rests on omp_set_num_threads setting the caller's own value only (OpenMP: nthreads-var is per task).
#pragma once

#ifdef _OPENMP
#include <omp.h>
#endif

namespace medulla::sim2d {

/// While alive, Eigen called from this thread uses one thread. A definition EIGEN_DONT_PARALLELIZE in some files only
/// would let the linker mix both versions of the same templates.
class SerialEigen {
  public:
    SerialEigen(const SerialEigen&) = delete;
    SerialEigen& operator=(const SerialEigen&) = delete;
#ifdef _OPENMP
    SerialEigen() : threads_(omp_get_max_threads()) { omp_set_num_threads(1); }
    ~SerialEigen() { omp_set_num_threads(threads_); }

  private:
    int threads_;
#else
    SerialEigen() {}
    ~SerialEigen() {}
#endif
};

}  // namespace medulla::sim2d
