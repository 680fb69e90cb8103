// The fast random solver: quasi-random walks that pay their expected exits into every bin, singly scattered light in
// closed form. docs/physics.md, sections 1 to 4; its slow twin is sim2d/reference/analog.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim2d/profile.hpp"

namespace medulla::sim2d {

struct TracerOptions {
    std::uint64_t paths = 16384;  ///< walks, rounded up to a multiple of 16; with a target_error the most. 1 to 2^35
    std::uint64_t seed = 1;
    std::uint64_t cell = 0;   ///< which cell: another cell gets other random numbers
    double target_error = 0;  ///< stop when standard_error is at most this; 0: spend all paths
};

/// A profile and what it took.
template <class P>
struct Traced {
    P profile;
    std::uint64_t paths = 0;        ///< walks that were followed, each scattered twice or more
    std::uint64_t scatterings = 0;  ///< of all walks
    bool reached = false;           ///< standard_error <= target_error
};

/// C^N of a cell over `bins` bins of phi in (-pi, pi].
///
/// Sixteen independently shifted lattices give sixteen independent estimates; standard_error is the relative L2 error
/// of their mean. energy is the closed form (energy_error 0). The multiply scattered part is unbiased before it is
/// scaled to its exact share, E less what leaves after one collision; that quotient's bias is O(1 / paths), below the
/// standard error by a factor of the same order. The same arguments give the same bytes on one instruction set, for any
/// number of threads (a call runs on one; cells are the caller's to share out).
/// @param sigma scattering coefficient [1 / disc radius], >= 0   @param g mean cosine, in (-1, 1)   @param h in [-1, 1]
/// @throws std::invalid_argument
Traced<Profile> trace_expected_disc(double sigma, double g, double h, std::size_t bins, const TracerOptions& options);

/// The same for every absorption of a list, from one set of walks: light that went a path of length L counts
/// exp(-absorption L), singly scattered light in closed form. The energies above 0 absorption are a quotient too: of
/// the walks' weighted light over their light, times E; energy_error is its standard error. Every cell meets
/// target_error.
/// @param absorption [1 / disc radius], each >= 0   @return a profile for each
Traced<std::vector<Profile>> trace_expected_disc(double sigma, double g, double h,
                                                 const std::vector<double>& absorption, std::size_t bins,
                                                 const TracerOptions& options);

/// C^M of a cell over `bins_per_side` bins of theta_r in (-pi/2, pi/2) on each side. Each side's standard_error and
/// energy_error are its own; back + forward energy is the closed form. The worse of the two sides meets target_error.
/// @param theta_i inclination of the direction towards the light [radians], in [-pi/2, pi/2]
Traced<SlabProfile> trace_expected_slab(double sigma, double g, double theta_i, std::size_t bins_per_side,
                                        const TracerOptions& options);

}  // namespace medulla::sim2d
