// Parts of a job -> one table: shard folders of many workers, and tables files that each hold a part of the axes.
#pragma once

#include <string>
#include <vector>

#include "tables/table.hpp"

namespace medulla::tables {

/// Merges shard folders (named themselves, or by the output they belong to) and tables files. All parts must agree in
/// program, method, seed, paths and every axis but sigma and g; the result has the union of their sigma and g nodes,
/// and equals what one process would have made. Throws Error where parts disagree, where two hold different slices of
/// one (sigma, g), and where one is missing.
Tables merge(const std::vector<std::string>& parts);

}  // namespace medulla::tables
