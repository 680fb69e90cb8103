// --time-budget: every slice to a coarse error, then the seconds that are left where error falls most for them.
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "tables/job/simulate.hpp"

namespace medulla::tables {

/// Errors by which slices are refined, one after the other: a half of a decade each.
inline constexpr double refinements[] = {1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4};

/// A slice that is to be bettered, and what is known of it.
struct Refinable {
    SliceId id;
    std::vector<double> standard_error;  ///< of its cells
    double seconds = 0;                  ///< its last solve took, or is thought to have taken; > 0
};

/// Solves slices again to the next of `refinements` below their worst error, that one first whose sum of squared errors
/// is expected to fall most per second, until the budget would be overrun by the next. Which slices get how far depends
/// on the clock; each slice alone does not.
/// @param seconds that are left   @param keep called from any thread with each bettered slice
/// @return solves done
std::size_t refine(const SliceSolver& solver, std::vector<Refinable> slices, double seconds, int threads,
                   const std::atomic<bool>& stop, const std::function<void(const SliceId&, const Slice&)>& keep);

}  // namespace medulla::tables
