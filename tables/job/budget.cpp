#include "tables/job/budget.hpp"

#include <omp.h>

#include <algorithm>
#include <mutex>
#include <optional>

#include "tables/parallel.hpp"

namespace medulla::tables {
namespace {

/// Expected cost of a refinement relative to the one before: 10 times the paths for half a decade; grids take 2 to 3
/// times as long (bench/bench_simulation, docs/accuracy.md).
double growth_of(Method method) { return method == Method::analog || method == Method::mc ? 10 : 4; }

double worst(const Refinable& slice) {
    return *std::max_element(slice.standard_error.begin(), slice.standard_error.end());
}

/// The first refinement below a slice's worst error, or nothing.
std::optional<double> next_target(const Refinable& slice) {
    for (const double target : refinements)
        if (target < worst(slice)) return target;
    return std::nullopt;
}

/// Expected fall of the sum of squared errors per second.
double worth(const Refinable& slice, double target, double expected_seconds) {
    double fall = 0;
    for (const double e : slice.standard_error) fall += e > target ? e * e - target * target : 0;
    return fall / expected_seconds;
}

}  // namespace

std::size_t refine(const SliceSolver& solver, std::vector<Refinable> slices, double seconds, int threads,
                   const std::atomic<bool>& stop, const std::function<void(const SliceId&, const Slice&)>& keep) {
    const double deadline = omp_get_wtime() + seconds,
                 growth = growth_of(method_of(solver.plan().present().front()->method));
    std::atomic<bool> failed{false};
    std::mutex mutex;
    std::size_t solves = 0;
    // Removes from the list the slice with the largest gain per second that still fits into the budget.
    const auto take = [&]() -> std::optional<std::pair<Refinable, double>> {
        const std::lock_guard<std::mutex> lock(mutex);
        const double left = deadline - omp_get_wtime();
        std::optional<std::size_t> best;
        double best_worth = 0, best_target = 0;
        for (std::size_t i = 0; i < slices.size(); ++i) {
            const std::optional<double> target = next_target(slices[i]);
            const double expected = growth * slices[i].seconds;
            if (!target || expected > left) continue;
            if (const double w = worth(slices[i], *target, expected); w > best_worth)
                best = i, best_worth = w, best_target = *target;
        }
        if (!best) return std::nullopt;
        std::pair<Refinable, double> taken{std::move(slices[*best]), best_target};
        slices.erase(slices.begin() + static_cast<std::ptrdiff_t>(*best));
        return taken;
    };
    const int workers = threads > 0 ? threads : omp_get_max_threads();
    in_parallel(static_cast<std::size_t>(workers), workers, stop, [&](std::size_t) {
        while (!stop && !failed) {
            auto taken = take();
            if (!taken) return;
            auto& [slice, target] = *taken;
            const double start = omp_get_wtime(), before = worst(slice);
            bool better = false;
            try {
                const Slice solved = solver.solve(slice.id, target);
                slice.seconds = omp_get_wtime() - start;
                slice.standard_error = solved.standard_error;
                better = worst(slice) < before;
                if (better) keep(slice.id, solved);
            } catch (...) {
                failed = true;  // the others stop too
                throw;
            }
            const std::lock_guard<std::mutex> lock(mutex);
            ++solves;
            if (better) slices.push_back(std::move(slice));  // a slice that no longer improves is left as it is
        }
    });
    return solves;
}

}  // namespace medulla::tables
