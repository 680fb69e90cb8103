// Noise-free C^N of the unit disc: one linear solve of the transport equation gives all h and phi of a (sigma, g).
// docs/physics.md, sections 2 and 4. Reciprocity: C^N(phi; h) = radiance that leaves along the chord of offset h in
// direction phi when a plane wave of unit radiance travels in direction 0.
#pragma once

#include <cstddef>
#include <vector>

#include "sim2d/profile.hpp"

namespace medulla::sim2d {

/// Values of 0 are chosen from sigma and g.
struct DiscOptions {
    double target_error = 1e-3;  ///< relative L2 error of a lobe that the grids are chosen for, in [1e-6, 0.1]
    int circles = 0;             ///< of the fine grid, >= 6
    int modes = 0;               ///< highest k in exp(i k alpha) on the fine grid, >= 8
    double gap = 0;              ///< largest gap between grazing directions on the fine grid [radians], > 0
    double rim = 0;              ///< step of acos(radius) from the rim inwards on the fine grid [radians], > 0
    bool estimate_error = true;  ///< solve a second, coarser grid
    int most_steps = 60;         ///< limit of the iteration, >= 1; standard_error includes the error left at the limit
};

/// All slices of one g. Threads may call `solve` at the same time; a solve runs on one thread and does not depend on
/// the others.
class DiscSolver {
  public:
    /// @param g mean cosine, in (-1, 1); the automatic grids are tuned for sigma <= 16 and g in [0, 0.95]
    explicit DiscSolver(double g, const DiscOptions& options = {});

    /// One Profile per h over `bins` bins of phi.
    /// @param sigma [1 / disc radius], >= 0   @param h offsets in [-1, 1]
    /// energy: closed form; energy_error: its difference from the un-normalised solution; standard_error: relative L2
    /// difference of two grids, extrapolated at third order, 0 without estimate_error, plus an approximate bound of the
    /// iteration's error if most_steps ran out; mean_length: of the scattered light. sigma = 0 is the limit.
    std::vector<Profile> solve(double sigma, const std::vector<double>& h, std::size_t bins = 720) const;

    /// The same with absorption: scattered light is weighted with exp(-sigma_a length).
    /// @param sigma_a absorption coefficient [1 / disc radius], >= 0
    /// energy: part of the solution; energy_error: from the two grids, or, without estimate_error, from two ways to
    /// compute the energy; mean_length: weighted too, -d log(energy) / d sigma_a, with a relative error of about 1e-3
    /// plus 3e-5 / (share of the collided light that leaves).
    std::vector<Profile> solve(double sigma, double sigma_a, const std::vector<double>& h, std::size_t bins) const;

  private:
    double g_;
    DiscOptions options_;
};

}  // namespace medulla::sim2d
