// C^N of the unit disc without noise: one linear solve of the transport equation gives all h and phi of a (sigma, g).
// docs/physics.md, sections 2 and 4. Reciprocity: C^N(phi; h) = radiance that leaves along the chord of offset h in
// direction phi when a plane wave of unit radiance travels in direction 0.
#pragma once

#include <cstddef>
#include <vector>

#include "sim2d/profile.hpp"

namespace medulla::sim2d {

/// 0 means: chosen from sigma and g.
struct DiscOptions {
    double target_error = 1e-3;  ///< relative L2 error of a lobe that the grids aim at, in [1e-6, 0.1]
    int circles = 0;             ///< of the fine grid, >= 6
    int modes = 0;               ///< highest k in exp(i k alpha) on the fine grid, >= 8
    double gap = 0;              ///< largest gap between grazing directions on the fine grid [radians], > 0
    double rim = 0;              ///< step of acos(radius) from the rim inwards on the fine grid [radians], > 0
    bool estimate_error = true;  ///< solve a second, coarser grid
};

/// All slices of one g. Threads may call `solve` at the same time;
/// one solve runs on one thread, and its result does not depend on the others.
class DiscSolver {
  public:
    /// @param g mean cosine, in (-1, 1); the automatic grids are measured for sigma <= 16, [0, 0.95]
    explicit DiscSolver(double g, const DiscOptions& options = {});

    /// One Profile per h over `bins` bins of phi.
    /// @param sigma [1 / disc radius], >= 0   @param h offsets in [-1, 1]
    /// energy: closed form; energy_error: what the un-normalised answer misses of it; standard_error: relative L2
    /// difference of two grids over what a third-order error makes of it, 0 without estimate_error; mean_length: of the
    /// scattered light. sigma = 0 is the limit.
    std::vector<Profile> solve(double sigma, const std::vector<double>& h, std::size_t bins = 720) const;

    /// The same in a medium that absorbs too: scattered light weighted by exp(-sigma_a length).
    /// @param sigma_a absorption coefficient [1 / disc radius], >= 0
    /// energy (and the lobe of integral 1 beside it) is solved for; energy_error: from the two grids, without
    /// estimate_error from two ways to compute it; mean_length: weighted too, -d log(energy) / d sigma_a,
    /// to about 1e-3 of it and 3e-5 over the share of the collided light that leaves.
    std::vector<Profile> solve(double sigma, double sigma_a, const std::vector<double>& h, std::size_t bins) const;

  private:
    double g_;
    DiscOptions options_;
};

}  // namespace medulla::sim2d
