// Pictures that a scene names, as linear radiance: OpenEXR, Radiance HDR and PNG. Every failure is one line.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "render/vector.hpp"

namespace medulla::render {

struct Image {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;  ///< row by row from the top; may have values that are not finite
};

inline constexpr std::uint64_t greatest_image_file = std::uint64_t(1) << 31;

/// The format is chosen by the end of the file's name.
/// @param linear whether PNG values are decoded from sRGB; otherwise they are taken as they are, in [0, 1]
Image read_image(const std::string& path, const std::string& bytes, bool linear = true);
Image read_png(const std::string& path, const std::string& bytes, bool linear);
Image read_exr(const std::string& path, const std::string& bytes);
Image read_hdr(const std::string& path, const std::string& bytes);

}  // namespace medulla::render
