// The slow plain twin of SlabSolver: adding-doubling from a box-scheme layer on ungraded Gauss-Legendre directions.
#pragma once

#include <cstddef>
#include <vector>

namespace medulla::sim2d {

/// Raw densities per radian of theta_r between the directions of the rule, index [i * theta.size() + r]: light from
/// theta[i], exit at theta[r]. The pair of unscattered light (forward, theta[r] = -theta[i]) is not separated: NaN-free
/// but meaningless, skip it.
struct SlabDoubling {
    std::vector<double> theta, back, forward;
};

/// @param sigma scattering coefficient [1 / radius], > 0   @param g mean cosine in (-1, 1)
/// @param directions of each hemisphere, >= 2; angular error falls as directions^-4, see the source for the layers'
SlabDoubling slab_doubling(double sigma, double g, std::size_t directions);

}  // namespace medulla::sim2d
