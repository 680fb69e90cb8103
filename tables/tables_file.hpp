// The tables file (HDF5): docs/formats.md. Everything read is checked before it is used.
#pragma once

#include <string>

#include "tables/table.hpp"

namespace medulla::tables {

enum class Compression { none, gzip, zstd };

/// Replaces `path` by a file with these tables, in one step. Two equal `Tables` give the same bytes.
void write_tables(const std::string& path, const Tables& tables, Compression compression);

/// Reads and checks a tables file: groups, shapes against axes, axis rules, finite values. Throws Error.
Tables read_tables(const std::string& path);

/// True if the file begins with HDF5's signature.
bool is_hdf5(const std::string& path);

}  // namespace medulla::tables
