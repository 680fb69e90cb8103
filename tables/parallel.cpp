#include "tables/parallel.hpp"

#include <omp.h>

#include <exception>
#include <thread>
#include <vector>

namespace medulla::tables {

void in_parallel(std::size_t count, int threads, const std::atomic<bool>& stop,
                 const std::function<void(std::size_t)>& job) {
    std::atomic<std::size_t> next{0};
    std::atomic<bool> failed{false};
    std::exception_ptr error;
    const auto work = [&] {
        while (!failed && !stop) {
            const std::size_t i = next++;
            if (i >= count) return;
            try {
                job(i);
            } catch (...) {
                if (!failed.exchange(true)) error = std::current_exception();
            }
        }
    };
    const auto wanted = static_cast<std::size_t>(threads > 0 ? threads : omp_get_max_threads());
    std::vector<std::thread> others;
    others.reserve(wanted);
    try {
        while (others.size() + 1 < wanted && others.size() + 1 < count) others.emplace_back(work);
    } catch (const std::exception&) {
        // The system has no more threads or memory: the existing ones do all jobs.
    }
    work();
    for (std::thread& other : others) other.join();
    if (error) std::rethrow_exception(error);
}

}  // namespace medulla::tables
