// Bin averages of light scattered exactly once in the slab, and its path length; tracer.cpp adds the paths' deposits.
// docs/physics.md, sections 3 and 4.
#pragma once

#include <cstddef>
#include <vector>

namespace medulla::sim2d {

/// Densities per radian over the bins of theta_r and integrals of density times path length [radii], both over the
/// energy that was scattered at least once.
struct SlabSingle {
    std::vector<double> back, forward;
    double back_length = 0, forward_length = 0;
};

/// @param sigma [1 / radius], > 0   @param g mean cosine, in (-1, 1)   @param theta_i [radians], in [-pi/2, pi/2]
SlabSingle slab_single_lobes(double sigma, double g, double theta_i, std::size_t bins_per_side);

}  // namespace medulla::sim2d
