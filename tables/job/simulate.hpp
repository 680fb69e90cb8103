// Request -> tables: solves (sigma, g) slices with the solver of the requested method. A slice depends only on the
// request, not on other slices, threads or timing.
#pragma once

#include <memory>

#include "tables/job/progress.hpp"
#include "tables/job/request.hpp"
#include "tables/store/slices.hpp"
#include "tables/table/table.hpp"

namespace medulla::tables {

/// In denser discs `auto` traces paths without trying grids. Seconds for an error of 1e-2 by paths and by grids: 0.25
/// and 0.07 at sigma 30, g 0.9; 0.4 and 3 at sigma 100, g 0.9; 5 and 140 at sigma 100, g 0.99 (docs/accuracy.md).
inline constexpr double greatest_grid_sigma = 50;

/// The tables of a request with their axes, methods and seeds, without arrays. Throws Error as check_request.
Tables plan_of(const Request& request);

/// Solves slices of one request. Data that depend on g only are computed on first use and shared. Threads may call
/// `solve` at the same time.
class SliceSolver {
  public:
    explicit SliceSolver(const Request& request);
    ~SliceSolver();

    const Tables& plan() const;
    Slice solve(const SliceId& id) const;
    /// The same slice for another error; 0: with the request's paths, or the default error of the noise-free solvers.
    Slice solve(const SliceId& id, double target_error) const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Simulates the tables of a request in memory.
Tables simulate(const Request& request, ProgressMode progress);

}  // namespace medulla::tables
