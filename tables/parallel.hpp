// Jobs over threads. Plain threads instead of OpenMP: exceptions reach the caller, and the thread sanitizer sees all
// synchronisation.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>

namespace medulla::tables {

/// Starts job(0) .. job(count - 1) in that order, each on one of `threads` threads (0: OpenMP's default). Starts no
/// further ones once `stop` is set or one has thrown; rethrows the first exception after all have ended.
void in_parallel(std::size_t count, int threads, const std::atomic<bool>& stop,
                 const std::function<void(std::size_t)>& job);

}  // namespace medulla::tables
