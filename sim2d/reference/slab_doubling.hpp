// The slow plain twin of SlabSolver: adding-doubling from a box-scheme layer on ungraded Gauss-Legendre directions.
#pragma once

#include <cstddef>
#include <vector>

namespace medulla::sim2d {

/// Raw densities per radian of theta_r between the directions of the rule, index [i * theta.size() + r]: light from
/// theta[i], exit at theta[r]. The unscattered light stands in the pair (forward, theta[r] = -theta[i]), its
/// energy over that direction's weight.
struct SlabDoubling {
    std::vector<double> theta, weight, back, forward;
};

/// @param sigma scattering coefficient [1 / radius], > 0   @param g mean cosine in (-1, 1)
/// @param directions of each hemisphere, >= 2; angular error falls as directions^-4, see the source for the layers'
/// @param absorption absorption coefficient beside sigma [1 / radius]; small negative ones serve differences
SlabDoubling slab_doubling(double sigma, double g, std::size_t directions, double absorption = 0);

}  // namespace medulla::sim2d
