// Strands from other programs' files: Cem Yuksel's .hair and the curves of pbrt scenes (docs/render.md lists what is
// read of each). Every failure is one line: file, place, expected, found.
#pragma once

#include <string>

#include "render/file.hpp"
#include "render/strands.hpp"

namespace medulla::render {

struct StrandFile {
    Placement placement;
    float radius = 0;        ///< overrides the file's [world units]; 0: the file's
    float radius_scale = 1;  ///< multiplies either
};

inline constexpr std::uint64_t greatest_strand_file = std::uint64_t(1) << 32;

/// The format is chosen by the end of the file's name.
Strands read_strands(const std::string& path, const std::string& bytes, const StrandFile& how);
Strands read_hair(const std::string& path, const std::string& bytes, const StrandFile& how);
Strands read_pbrt_curves(const std::string& path, const std::string& bytes, const StrandFile& how);

}  // namespace medulla::render
