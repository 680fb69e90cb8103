// What rays meet: strands as Embree's round B-spline curves, skins and ground as triangles.
//
// Ray origins are not offset from the surface. Instead, a ray ignores the primitive that it starts on: on a fibre, its
// own strand within four radii of the start (the fibre model has already carried the light through the fibre), on a
// skin, its own triangle. Back faces are never hit, so neither the far side of a fibre nor a neighbouring triangle
// below the start stops a ray.
#pragma once

#include <embree3/rtcore.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

#include "render/groom.hpp"
#include "render/shape.hpp"

namespace medulla::render {

inline constexpr std::uint32_t nothing = 0xffffffffu;

/// The primitive that a ray starts on; nothing for camera rays.
struct Start {
    std::uint32_t geometry = nothing, part = 0;  ///< part: strand or triangle
    float along = 0, reach = 0;                  ///< of a strand, both in segments
};

struct Ray {
    Vec3 origin, direction;
    Start start;
};

struct Hit {
    float distance = 0;
    std::uint32_t geometry = nothing, primitive = 0;
    float u = 0, v = 0;
    explicit operator bool() const { return geometry != nothing; }
};

/// A hit on a strand, with the axis of the curve there.
struct StrandHit {
    Vec3 axis, tangent;  ///< the point of the axis; from root to tip, unit
    float radius;
    float along;  ///< [0, 1] from root to tip
    std::uint32_t strand;
    Start start;
};

struct SkinHit {
    Vec3 position, normal, facet_normal;
    Rgb albedo;
    Start start;
};

class Geometry {
  public:
    explicit Geometry(const Scene& scene);

    Hit nearest(const Ray& ray) const;
    bool blocked(const Ray& ray, float distance) const;

    bool is_strand(const Hit& hit) const { return hit.geometry < strands_.size(); }
    const Strands& strands(const Hit& hit) const { return strands_[hit.geometry]; }
    StrandHit strand_hit(const Hit& hit) const;
    SkinHit skin_hit(const Hit& hit) const;

    const std::vector<Strands>& layers() const { return strands_; }
    std::size_t strand_count() const;
    std::size_t bytes() const { return std::size_t(bytes_); }  ///< that Embree has allocated

  private:
    struct Release {
        void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
        void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
        void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
    };
    template <class Handle>
    using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

    void add(Strands& strands);
    void add(const Mesh& mesh);
    // Embree reads the strands and counts its bytes until the device is released: both outlive it.
    std::vector<Strands> strands_;
    std::vector<Mesh> meshes_;
    std::atomic<std::int64_t> bytes_{0};
    Owned<RTCDevice> device_;
    Owned<RTCScene> scene_;
};

}  // namespace medulla::render
