// The difference of two jobs, in options of medulla-precompute.
#pragma once

#include <string>

#include "tables/table/table.hpp"

namespace medulla::tables {

/// Every option in which two plans differ, as in "--bins: expected 72, found 36; --seed: expected 1, found 2". Empty if
/// none does.
std::string job_difference(const Tables& expected, const Tables& found);

}  // namespace medulla::tables
