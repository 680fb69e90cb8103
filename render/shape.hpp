// Shapes of a scene: area, uniform points on them, and a mesh of the skin.
#pragma once

#include "render/mesh.hpp"
#include "render/random.hpp"
#include "render/scene.hpp"

namespace medulla::render {

float area_of(const Shape& shape);
SurfacePoint sample_surface(const Shape& shape, Sequence& random);

Mesh mesh_of(const Shape& shape, Rgb albedo);
Mesh mesh_of(const Ground& ground);

}  // namespace medulla::render
