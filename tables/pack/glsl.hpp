// A pack as GLSL: its words, and the functions of medulla/lookup.hpp over them.
#pragma once

#include <string>
#include <vector>

namespace medulla::tables {

/// GLSL of version 3.30 or ES 3.00 on: the valid pack `bytes` as an array, and functions that contract it and look
/// lobes up, all of whose names begin with `name`. Its sums are those of the runtime, term by term. Throws Error for a
/// pack that is not laid out in words.
std::string glsl_source(const std::vector<unsigned char>& bytes, const std::string& name);

}  // namespace medulla::tables
