// Strands grown on a shape: Poisson-disc roots, then each strand point by point. The same bytes for the same seed.
#pragma once

#include <cstdint>
#include <vector>

#include "render/shape.hpp"

namespace medulla::render {

Strands grow(const Shape& shape, const Layer& layer);
/// The strand of a single fibre, through its points.
Strands strand_of(const SingleFibre& fibre);

/// At most `count` points of the surface, no two of them nearer than `distance` in space.
std::vector<SurfacePoint> poisson_disc(const Shape& shape, float distance, std::size_t count, std::uint32_t seed);

}  // namespace medulla::render
