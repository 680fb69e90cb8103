// How many bits each block of a pack's factors keeps. Strong components need more than weak ones: bits go where a byte
// takes most of the error that rounding adds.
#pragma once

#include <limits>
#include <vector>

#include "tables/pack/writer.hpp"

namespace medulla::tables {

/// Rounding's share of a squared error, over that of the components left out, where a byte more for either gains the
/// same: the one falls as rank^-4, the other as 4^-bits at about nine bits a number (4 / (9 log 4)).
inline constexpr double balanced_rounding = 0.32;

/// Squared relative error that rounding adds to a table.
double rounding_error(const PackedTable& table);

/// Bits that a number of the tables takes on average.
double mean_bits(const std::vector<const PackedTable*>& tables);

/// Sets every block of the tables to 4 bits, then widens one block after another, always the one that gains most for
/// its bytes, until the sum of their squared errors is at most `error` or no step fits into `bytes`.
void set_bits(const std::vector<PackedTable*>& tables, double error,
              std::size_t bytes = std::numeric_limits<std::size_t>::max());

}  // namespace medulla::tables
