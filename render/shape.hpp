// The built-in shapes: area, points spread evenly over it, and a mesh of the skin.
#pragma once

#include <cstdint>
#include <vector>

#include "render/random.hpp"
#include "render/scene.hpp"

namespace medulla::render {

struct SurfacePoint {
    Vec3 position, normal;
};

float area_of(const Shape& shape);
SurfacePoint sample_surface(const Shape& shape, Sequence& random);

struct Mesh {
    std::vector<Vec3> positions, normals;
    std::vector<std::uint32_t> indices;  ///< three a triangle, counter-clockwise seen from outside
    Rgb albedo;
};
Mesh mesh_of(const Shape& shape, Rgb albedo);
Mesh mesh_of(const Ground& ground);

}  // namespace medulla::render
