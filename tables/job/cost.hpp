// Expected cost of a slice: the order in which slices are solved, and how they are divided among workers.
// The same on every machine: costs are whole numbers, computed with + - * / alone.
#pragma once

#include <cstdint>
#include <vector>

#include "tables/job/request.hpp"
#include "tables/store/slices.hpp"

namespace medulla::tables {

/// Expected cost of a slice in microseconds of one core of the machine of docs/cluster.md. Only ratios matter.
std::uint64_t expected_cost(const Request& request, const SliceId& id);

/// Slices by falling cost, equal ones in their order: a parallel run then ends with short slices.
std::vector<SliceId> by_cost(const Request& request, std::vector<SliceId> slices);

}  // namespace medulla::tables
