// Result of every solver: a normalised exit lobe over bins, its energy and its errors.
#pragma once

#include <vector>

namespace medulla::sim2d {

/// Exit lobe of one table cell. Bin i of n covers [lo + i w, lo + (i + 1) w), w = (hi - lo) / n:
/// disc: phi in (-pi, pi], phi = 0 forward; slab: theta_r in (-pi/2, pi/2), one Profile per side.
/// Values are averages over the bin (not point values), so that sum(lobe) * w = 1.
struct Profile {
    std::vector<double> lobe;   ///< density per radian, normalised to integral 1
    double energy = 0;          ///< scattered energy per unit incident energy, in [0, 1]
    double energy_error = 0;    ///< standard error of `energy` (0 where it is a closed form)
    double standard_error = 0;  ///< relative L2 error of `lobe`: |error| / |lobe| over the bins
    /// Mean path length of the scattered light inside the medium [radii]; infinite in an empty slab.
    double mean_length = 0;
};

/// Both exit lobes of one (sigma, g, theta_i), each normalised to integral 1 over theta_r in (-pi/2, pi/2).
struct SlabProfile {
    Profile back;          ///< the side of the light
    Profile forward;       ///< the far side
    double raw_total = 0;  ///< back + forward energy before scaling to the closed form: the solver's energy balance
};

}  // namespace medulla::sim2d
