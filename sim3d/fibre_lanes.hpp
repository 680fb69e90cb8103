// What the lanes of the fast tracer read and write. Private to fibre_tracer.cpp and fibre_lanes-inl.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim2d/tracer/state.hpp"  // kLaneMargin
#include "sim3d/cuticle_surface.hpp"
#include "sim3d/fibre_profile.hpp"

namespace medulla::sim3d {

using sim2d::kLaneMargin;

/// Rays of a batch, one array per component. y and z lie in the stretched cross-section, where the rim is the unit
/// circle; s = 1 - y^2 - z^2 is kept beside them without cancellation. kind is the class that a path has if it leaves
/// now; index is its number in the batch.
struct LaneRays {
    std::vector<float> y, z, s, dx, dy, dz, weight, cortex, medulla;
    std::vector<std::uint32_t> kind, index;
    void reserve(std::size_t n) {
        for (auto* v : {&y, &z, &s, &dx, &dy, &dz, &weight, &cortex, &medulla}) v->assign(n + kLaneMargin, 0.0f);
        for (auto* v : {&kind, &index}) v->assign(n + kLaneMargin, 0u);
    }
};

/// One fibre and light as floats, and the sums of one batch.
struct LaneFibre {
    LaneFibre(const Fibre& fibre, const Light& light, const FibreOptions& options);

    CuticleSurface surface;
    float ring;  ///< 1 - kappa^2
    float sigma_ms, g, layers, eta, excess, tilt, along, around;
    float stretch, sin_azimuth, cos_azimuth;
    float travel_x, travel_y, travel_z, entry_y, entry_z, across_y, across_z, h_low, h_span;
    bool rough, bravais, planar;
    std::vector<float> rate;       ///< per channel -sigma_ca / log 2
    float medulla_rate, faintest;  ///< -sigma_ma / log 2; the largest `rate`
    std::uint32_t theta_bins, phi_bins;
    std::uint64_t seed, cell;
    std::uint32_t key[2], batch = 0;
    std::uint64_t first = 0;               ///< number in the batch of the first path of these lanes
    float stratum = 0, first_stratum = 0;  ///< width of a stratum of h, of [0, 1], and where theirs begin

    LaneRays rays;
    FibreSums* sums = nullptr;
};

/// A lane whose light meets facets in a way that lanes do not follow.
struct LaneMeeting {
    Vec3 d, normal;
    Side side;
    Next next;
    std::uint32_t index;
};
/// Follows it as the reference implementation does. @param order which flight: another one gets other random numbers
Side settle(const LaneFibre& fibre, LaneMeeting& meeting, std::uint32_t order);

}  // namespace medulla::sim3d
