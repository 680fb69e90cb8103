// One sample of one pixel: a path from the camera through fibres, skins and lights.
#pragma once

#include <cstdint>
#include <memory>

#include "render/film.hpp"
#include "render/geometry.hpp"
#include "render/lights.hpp"

namespace medulla::render {

class Shading;  // shading.hpp: all of the runtime, which only path.cpp needs to see

/// Which part of a fibre's width a vertex averages over.
enum class FieldChoice { one_offset, whole_width, multiscale };

/// By which model fibres scatter.
enum class FibreModel { fur, eq12, kajiya_kay, kajiya_kay_normalised, kim, marschner, zinke, deon, chiang, yan2015 };
inline constexpr const char* model_names[] = {
    "fur", "eq12", "kajiya-kay", "kajiya-kay-normalised", "kim", "marschner", "zinke", "deon", "chiang", "yan2015"};

/// Whether a model's lobes are the runtime's: `eq12` leaves out the residual one.
constexpr bool is_fur(FibreModel model) { return model == FibreModel::fur || model == FibreModel::eq12; }

struct Counts {
    std::uint64_t rays = 0, vertices = 0, nonfinite = 0;
    std::uint64_t clamped = 0;  ///< vertices whose fibre had parameters out of range, or NaN
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
    int averaged_vertices = 1;  ///< of a multi-scale path: later ones take the offset of the ray's own hit
    FibreModel model = FibreModel::fur;
    std::uint32_t lobes = 63;   ///< the lobes by which fibres scatter, a LobeMask; 63: all
    float clamp = 0;            ///< most that one vertex after the first may add [luminance]; 0: no limit, no bias
    bool sample_lights = true;  ///< next-event estimation; without it, lights are found by scattering alone
};

class PathTracer {
  public:
    PathTracer(const Scene& scene, const PathOptions& options);
    ~PathTracer();

    /// Radiance along one camera ray. Its random numbers are those of (seed, pixel, sample).
    /// @param timed whether to read the clock for the times in Counts
    /// @param layers null, or receives the layers of the radiance; the radiance is the same bits either way
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
