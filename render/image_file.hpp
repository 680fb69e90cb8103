// Pictures on disk: PNG through the scene's exposure and tone curve, EXR as radiance.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "render/film.hpp"
#include "render/scene.hpp"

namespace medulla::render {

/// 8 bits a channel, sRGB.
void write_png(const Film& film, const Picture& picture, const std::string& path);
/// The same of another colour of each pixel.
void write_png(const Film& film, const std::function<Rgb(std::size_t)>& colour, const Picture& picture,
               const std::string& path);
/// One PNG for each lobe of the first vertex, and for direct and indirect light: prefix + "TTs.png" and so on. The
/// film must have layers.
void write_layer_pngs(const Film& film, const Picture& picture, const std::string& prefix);
/// R, G, B: linear radiance, primaries of sRGB; standard_error.Y: that of the luminance; the film's layers, if it
/// has them (docs/render.md names them). 32-bit floats.
void write_exr(const Film& film, const std::string& path);

/// Linear [0, infinity) to display-linear [0, 1].
float filmic(float x);

}  // namespace medulla::render
