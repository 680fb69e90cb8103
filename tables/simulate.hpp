// Request -> tables: solves every (sigma, g) slice, in parallel, with the solver that the method names.
#pragma once

#include "tables/progress.hpp"
#include "tables/request.hpp"
#include "tables/table.hpp"

namespace medulla::tables {

/// Simulates the tables of a request. The result depends on the request alone, not on threads or timing.
Tables simulate(const Request& request, ProgressMode progress);

}  // namespace medulla::tables
