// A pack as GLSL: its 32-bit words, and the functions of medulla/lookup.hpp on them.
#pragma once

#include <string>
#include <vector>

namespace medulla::tables {

/// GLSL from version 3.30 or ES 3.00 on: the valid pack `bytes` as an array, and functions that contract it and look up
/// lobes. All names begin with `name`. Sums have the order of the runtime. Throws Error for a pack whose parts do not
/// start at 32-bit words.
std::string glsl_source(const std::vector<unsigned char>& bytes, const std::string& name);

}  // namespace medulla::tables
