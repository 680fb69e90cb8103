// The tables file (HDF5): docs/formats.md. Everything read is checked before it is used.
#pragma once

#include <string>

#include "tables/table/table.hpp"

namespace medulla::tables {

enum class Compression { none, gzip, zstd };

/// Replaces `path` by a file with these tables, in one step. Two equal `Tables` give the same bytes. `temporary`: name
/// of the file while it is written, on the same file system; empty: one beside `path`.
void write_tables(const std::string& path, const Tables& tables, Compression compression,
                  const std::string& temporary = {});

/// Reads and checks a tables file: groups, shapes against axes, axis rules, finite values, SHA-256 of
/// the contents. Throws Error.
Tables read_tables(const std::string& path);

/// True if the file begins with HDF5's signature.
bool is_hdf5(const std::string& path);

}  // namespace medulla::tables
