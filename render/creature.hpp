// A body of blended balls: the smooth union of spheres, as triangles.
#pragma once

#include <vector>

#include "render/mesh.hpp"

namespace medulla::render {

struct Ball {
    Vec3 centre;
    float radius;
    float fur = 1;  ///< multiplies the length of the hairs here
};

/// f = -blend log sum exp(-(|p - centre| - radius) / blend): below 0 inside, and smooth everywhere except at the
/// centres.
struct Blend {
    const std::vector<Ball>& balls;
    float blend;  ///< width of the seams [the balls' unit]

    struct Value {
        float f;
        Vec3 gradient;
        float fur;
    };
    Value at(Vec3 p) const;
};

/// The surface f = 0 by marching tetrahedra, with vertices moved onto it. The same balls give the same triangles.
Mesh creature(const std::vector<Ball>& balls, float blend, const Placement& placement);

/// A standing fox of length 3 that looks along x, with its feet on y = 0.
const std::vector<Ball>& fox();

}  // namespace medulla::render
