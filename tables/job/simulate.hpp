// Request -> tables: solves (sigma, g) slices with the solver that the method names. A slice depends on the request
// alone, not on other slices, threads or timing.
#pragma once

#include <memory>

#include "tables/job/progress.hpp"
#include "tables/job/request.hpp"
#include "tables/store/slices.hpp"
#include "tables/table/table.hpp"

namespace medulla::tables {

/// In denser discs than this `auto` walks from the start. Seconds to 1e-2 by walks and by grids: at sigma 30, g 0.9
/// 0.25 and 0.07, at sigma 100 0.4 and 3, at sigma 100, g 0.99 5 and 140 (docs/accuracy.md).
inline constexpr double greatest_grid_sigma = 50;

/// Axes, methods, seeds of what a request asks for, its arrays not allocated. Throws Error if no solver can answer.
Tables plan_of(const Request& request);

/// Solves slices of one request. What depends on g alone is made on first use and shared. Threads may call `solve` at
/// the same time.
class SliceSolver {
  public:
    explicit SliceSolver(const Request& request);
    ~SliceSolver();

    const Tables& plan() const;
    Slice solve(const SliceId& id) const;
    /// The same slice to another error; 0: by the request's paths, or to the noise-free solvers' usual error.
    Slice solve(const SliceId& id, double target_error) const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Simulates the tables of a request in memory.
Tables simulate(const Request& request, ProgressMode progress);

}  // namespace medulla::tables
