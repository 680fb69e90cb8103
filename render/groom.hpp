// Strands grown on a shape: Poisson-disc roots, then each strand point by point. The same bytes for the same seed.
#pragma once

#include <cstdint>
#include <vector>

#include "render/shape.hpp"

namespace medulla::render {

struct CurvePoint {
    float x, y, z, radius;
};

/// Uniform cubic B-splines, all of the same number of segments: segments + 3 points a strand.
struct Strands {
    int segments = 1;
    std::vector<Stop> along;
    float colour_noise = 0;
    std::uint32_t seed = 0;
    std::vector<CurvePoint> points;
    std::size_t count() const { return points.size() / std::size_t(segments + 3); }
    /// Factor of sigma_ca.
    float colour_of(std::uint32_t strand) const {
        return colour_noise == 0 ? 1 : std::exp(colour_noise * (2 * unit_float(hash(seed ^ 0x2545f491u, strand)) - 1));
    }
};

Strands grow(const Shape& shape, const Layer& layer);
/// The fibre through its points.
Strands strand_of(const SingleFibre& fibre);

/// Points of the surface no two of which are nearer than `distance`, in space; at most `count` of them.
std::vector<SurfacePoint> poisson_disc(const Shape& shape, float distance, std::size_t count, std::uint32_t seed);

}  // namespace medulla::render
