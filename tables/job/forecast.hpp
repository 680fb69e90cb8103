// What a job would simulate and how long it will take, from a few of its slices.
#pragma once

#include "tables/job/schedule.hpp"
#include "tables/job/simulate.hpp"

namespace medulla::tables {

struct Forecast {
    std::size_t slices = 0, cells = 0;
    double core_seconds = 0;   ///< of all slices on one core of this machine
    double seconds = 0;        ///< on the request's threads
    std::size_t measured = 0;  ///< slices that were solved to know it
};

/// Expected costs (tables/job/schedule.hpp) of the slices, scaled by what some of them take: the median slice first,
/// then its neighbours at even steps of the cost, until `patience` seconds are spent.
Forecast forecast(const Request& request, const std::vector<SliceId>& slices, double patience);

}  // namespace medulla::tables
