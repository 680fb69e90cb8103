// The reference implementation: analog paths through the whole fibre, plain and in double precision.
#pragma once

#include "sim2d/random.hpp"
#include "sim3d/cuticle_surface.hpp"
#include "sim3d/fibre.hpp"
#include "sim3d/fibre_profile.hpp"

namespace medulla::sim3d {

/// Where a path left and what it met on its way.
struct PathExit {
    Vec3 direction{};  ///< unit; phi is counted from the light
    Class kind = Class::R;
    double cortex = 0, medulla = 0;  ///< lengths [radii]
    std::uint32_t collisions = 0, flights = 0;
    bool left = false;  ///< false: given up after most_flights
};

/// Follows single paths of one fibre and light. Threads may share it.
class FibreWalker {
  public:
    static constexpr std::uint32_t most_flights = 10000;

    FibreWalker(const Fibre& fibre, const Light& light);

    /// @param h offset of the ray, in [-1, 1]
    PathExit follow(double h, sim2d::RandomStream& random) const;

  private:
    Vec3 normal(double y, double z) const;
    void collide(Vec3& d, sim2d::RandomStream& random) const;
    bool crosses(Vec3& d, Vec3 n, double ratio, sim2d::RandomStream& random) const;

    Fibre fibre_;
    CuticleSurface surface_;
    double ratio_;  ///< eta_m / eta_c
    double stretch_, sin_azimuth_, cos_azimuth_;
    Vec3 travel_;
    double entry_y_, entry_z_, across_y_, across_z_;  ///< of the light in the stretched cross-section
};

/// All paths of a simulation. Absorption is a weight of what leaves, so one set of paths serves all channels. The same
/// arguments give the same bytes for any number of threads (a batch runs on one).
FibreProfile walk_fibre(const Fibre& fibre, const Light& light, const FibreOptions& options);

}  // namespace medulla::sim3d
