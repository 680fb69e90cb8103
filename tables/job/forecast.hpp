// Size and expected duration of a job, from the solve times of a few slices.
#pragma once

#include "tables/job/cost.hpp"
#include "tables/job/simulate.hpp"

namespace medulla::tables {

struct Forecast {
    std::size_t slices = 0, cells = 0;
    double core_seconds = 0;   ///< of all slices on one core of this machine
    double seconds = 0;        ///< on the request's threads
    std::size_t measured = 0;  ///< slices that were solved for it
};

/// Expected costs (tables/job/cost.hpp) of the slices, scaled by the time that some of them take: the median slice
/// first, then others at even steps of the cost, until `patience` seconds are spent.
Forecast forecast(const Request& request, const std::vector<SliceId>& slices, double patience);

}  // namespace medulla::tables
