// Reference implementation for SlabSolver: adding-doubling from a box-scheme layer on plain Gauss-Legendre directions.
#pragma once

#include <cstddef>
#include <vector>

namespace medulla::sim2d {

/// Raw densities per radian of theta_r between the directions of the rule, index [i * theta.size() + r]: light from
/// theta[i], exit at theta[r]. The unscattered light is in the pair (forward, theta[r] = -theta[i]): its
/// energy divided by the weight of that direction.
struct SlabDoubling {
    std::vector<double> theta, weight, back, forward;
};

/// @param sigma scattering coefficient [1 / radius], > 0   @param g mean cosine in (-1, 1)
/// @param directions of each hemisphere, >= 2; angular error falls as directions^-4, see the source for the layers'
/// @param absorption absorption coefficient beside sigma [1 / radius]; small negative values serve finite differences
SlabDoubling slab_doubling(double sigma, double g, std::size_t directions, double absorption = 0);

}  // namespace medulla::sim2d
