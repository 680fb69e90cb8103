// Parts of a job -> one table: shard folders of many workers, and tables files that each hold a part of the axes.
#pragma once

#include <string>
#include <vector>

#include "tables/table/table.hpp"

namespace medulla::tables {

/// Merges shard folders (named themselves, or by the output they belong to) and tables files. All parts must agree in
/// program, method, when a cell is done, and the exit axis; the result has the union of their other axes' nodes, and
/// equals what one process would have made. Throws Error where parts disagree, where two hold different values of one
/// cell, and where one is missing.
Tables merge(const std::vector<std::string>& parts);

}  // namespace medulla::tables
