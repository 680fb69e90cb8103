// The tables file (HDF5): docs/formats.md. Everything read is checked before it is used.
#pragma once

#include <string>

#include "tables/store/output.hpp"
#include "tables/table/table.hpp"

namespace medulla::tables {

enum class Compression { none, gzip, zstd };

/// Writes a file with these tables, in one step. Two equal `Tables` give the same bytes. `temporary`: as in Output.
void write_tables(const Output& output, const Tables& tables, Compression compression,
                  const std::string& temporary = {});
void write_tables(const std::string& path, const Tables& tables, Compression compression);

/// Reads and checks a tables file: groups, shapes against axes, axis rules, finite values, SHA-256 of
/// the contents. Throws Error.
Tables read_tables(const std::string& path);

/// True if it is a plain file that begins with HDF5's signature.
bool is_hdf5(const std::string& path);

}  // namespace medulla::tables
