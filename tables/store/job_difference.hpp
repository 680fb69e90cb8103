// What tells two jobs apart, in the options of medulla-precompute.
#pragma once

#include <string>

#include "tables/table/table.hpp"

namespace medulla::tables {

/// "--bins: expected 72, found 36; --seed: expected 1, found 2": every option in which the plan that was found differs
/// from the one that is expected. Empty where no option does.
std::string job_difference(const Tables& expected, const Tables& found);

}  // namespace medulla::tables
