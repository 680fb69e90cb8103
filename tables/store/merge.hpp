// Merges parts of a job: slice files of many workers, and tables files that cover parts of the axes.
#pragma once

#include <string>
#include <vector>

#include "tables/table/table.hpp"

namespace medulla::tables {

/// Merges folders of slice files (given by their name or by their output) and tables files. All parts must have the
/// same program, method, stopping rule and exit axis. The result has the union of the nodes of the other axes and
/// equals the result of a single process. Throws Error if parts disagree, if two have different values of a cell, or if
/// a cell is missing.
Tables merge(const std::vector<std::string>& parts);

}  // namespace medulla::tables
