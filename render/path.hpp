// One sample of one pixel: a path from the camera through fibres, skins and lights.
#pragma once

#include <cstdint>
#include <memory>

#include "render/film.hpp"
#include "render/geometry.hpp"
#include "render/lights.hpp"

namespace medulla::render {

class Shading;  // shading.hpp: all of the runtime, which only path.cpp needs to see

/// What of a fibre's width a vertex takes in.
enum class FieldChoice { one_offset, whole_width, multiscale };

struct Counts {
    std::uint64_t rays = 0, vertices = 0, nonfinite = 0;
    std::uint64_t clamped = 0;  ///< vertices whose fibre had parameters out of range, or that are no numbers
    /// Of the samples that were timed [ns].
    std::uint64_t traversal = 0, shading = 0, all = 0;
    Counts& operator+=(const Counts& o) {
        rays += o.rays, vertices += o.vertices, nonfinite += o.nonfinite, clamped += o.clamped;
        traversal += o.traversal, shading += o.shading, all += o.all;
        return *this;
    }
};

struct PathOptions {
    FieldChoice field = FieldChoice::one_offset;
    std::uint32_t lobes = 63;   ///< by which fibres scatter: a LobeMask, all of them
    float clamp = 0;            ///< most that one vertex after the first may add [luminance]; 0: no limit, no bias
    bool sample_lights = true;  ///< next-event estimation; without it lights are only met
};

class PathTracer {
  public:
    PathTracer(const Scene& scene, const PathOptions& options);
    ~PathTracer();

    /// Radiance along one camera ray. Its random numbers are those of (seed, pixel, sample).
    /// @param timed whether to spend clock readings on the shares of Counts
    /// @param layers null, or what the radiance is made of; the radiance is the same bits
    Rgb sample(int x, int y, std::uint32_t sample, std::uint32_t seed, bool timed, Counts& counts,
               Layers* layers = nullptr) const;

    const Geometry& geometry() const { return geometry_; }

  private:
    Ray camera_ray(int x, int y, Random& random) const;
    template <bool Timed>
    Rgb trace(Ray ray, Random& random, Counts& counts, Layers* layers) const;

    const Scene& scene_;
    PathOptions options_;
    Geometry geometry_;
    Lights lights_;
    std::unique_ptr<Shading> shading_;
    Vec3 forward_, right_, up_;
    float pixel_angle_;  ///< of a pixel's cone
};

}  // namespace medulla::render
