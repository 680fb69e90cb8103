// --time-budget: after a coarse solve of every slice, spends the remaining seconds where they reduce the error most.
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "tables/job/simulate.hpp"

namespace medulla::tables {

/// Successive target errors of a slice, half a decade apart.
inline constexpr double refinements[] = {1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4};

/// A solved slice that may be refined.
struct Refinable {
    SliceId id;
    std::vector<double> standard_error;  ///< of each cell
    double seconds = 0;                  ///< of its last solve, measured or expected; > 0
};

/// Solves slices again to the next of `refinements` below their worst error, first the one whose sum of squared errors
/// is expected to fall most per second, until the next solve would exceed the budget. Which slices are refined depends
/// on the clock, the result of each solve does not.
/// @param seconds remaining budget   @param keep called from any thread with each improved slice
/// @return solves done
std::size_t refine(const SliceSolver& solver, std::vector<Refinable> slices, double seconds, int threads,
                   const std::atomic<bool>& stop, const std::function<void(const SliceId&, const Slice&)>& keep);

}  // namespace medulla::tables
