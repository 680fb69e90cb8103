// The corrected form's energy of scattered light, by integrals over all directions: docs/bcsdf.md, 'Escape and return'.
// The runtime has four directions in their place (medulla/detail/escape.hpp); bench_escape measures the difference.
#pragma once

#include "sim3d/fibre.hpp"

namespace medulla::sim3d {

/// Of light that collides in the medulla, the share that leaves it and is not absorbed there.
double left_by_medulla(const Fibre& fibre);

/// Of the scattered light that left the medulla, the share that leaves the fibre in the end.
/// @param sigma_ca absorption of the cortex; that of `fibre` is not used
double escape(const Fibre& fibre, double sigma_ca);

}  // namespace medulla::sim3d
