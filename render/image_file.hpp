// Pictures on disk: PNG through the scene's exposure and tone curve, EXR as radiance.
#pragma once

#include <string>

#include "render/film.hpp"
#include "render/scene.hpp"

namespace medulla::render {

/// 8 bits a channel, sRGB.
void write_png(const Film& film, const Picture& picture, const std::string& path);
/// R, G, B: linear radiance, primaries of sRGB; standard_error.Y: that of the luminance; the film's layers, if it
/// has them (docs/render.md names them). 32-bit floats.
void write_exr(const Film& film, const std::string& path);

/// Linear [0, infinity) to display-linear [0, 1].
float filmic(float x);

}  // namespace medulla::render
