// Bits per number of each block of a pack's factors. Strong components need more than weak ones: bits are spent where
// they reduce the rounding error most per byte.
#pragma once

#include <limits>
#include <vector>

#include "tables/pack/writer.hpp"

namespace medulla::tables {

/// Squared error of rounding over that of truncated components at the optimum, where a byte more for either gains the
/// same: one falls as 4^-bits, the other as rank^-4, at about nine bits a number (4 / (9 log 4)).
inline constexpr double balanced_rounding = 0.32;

/// Squared relative error that rounding adds to a table.
double rounding_error(const PackedTable& table);

/// Average bits per number of the tables.
double mean_bits(const std::vector<const PackedTable*>& tables);

/// Sets every block of the tables to 4 bits, then repeatedly widens the block with the largest gain per byte, until the
/// sum of squared errors is at most `error` or no step fits into `bytes`.
void set_bits(const std::vector<PackedTable*>& tables, double error,
              std::size_t bytes = std::numeric_limits<std::size_t>::max());

}  // namespace medulla::tables
