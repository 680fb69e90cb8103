// Baked materials on disk.
#pragma once

#include <string>
#include <vector>

namespace medulla::tables {

/// Bytes that open_baked accepts. Throws Error that says what else the file is.
std::vector<unsigned char> read_baked(const std::string& path);

/// Whether it is a plain file that begins as a baked material, of any version.
bool is_baked(const std::string& path);

}  // namespace medulla::tables
