// The fast random solver: quasi-random paths whose vertices deposit the expected exit into every bin (next-event
// estimation); singly scattered light is a closed form. docs/physics.md, sections 1 to 4. The reference implementation
// is sim2d/reference/analog.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim2d/profile.hpp"

namespace medulla::sim2d {

struct TracerOptions {
    std::uint64_t paths = 16384;  ///< rounded up to a multiple of 16; with a target_error: at most. 1 to 2^35
    std::uint64_t seed = 1;
    std::uint64_t cell = 0;   ///< of the table: each cell has its own random numbers
    double target_error = 0;  ///< stop when standard_error is at most this; 0: spend all paths
};

/// A profile and the work it took.
template <class P>
struct Traced {
    P profile;
    std::uint64_t paths = 0;        ///< traced, each scattered at least twice
    std::uint64_t scatterings = 0;  ///< of all paths
    bool reached = false;           ///< standard_error <= target_error
};

/// C^N of a cell over `bins` bins of phi in (-pi, pi].
///
/// Sixteen independently shifted lattices give sixteen independent estimates; standard_error is the relative L2 error
/// of their mean. energy is the closed form (energy_error 0). The multiply scattered part is unbiased before it is
/// scaled to its exact share, E minus what leaves after one collision. The bias of that ratio is O(1 / paths), below
/// the standard error by a factor of the same order. The same arguments give the same bytes on one instruction set, for
/// any number of threads. A call runs on one thread; the caller distributes cells over threads.
/// @param sigma scattering coefficient [1 / disc radius], >= 0   @param g mean cosine, in (-1, 1)   @param h in [-1, 1]
/// @throws std::invalid_argument
Traced<Profile> trace_expected_disc(double sigma, double g, double h, std::size_t bins, const TracerOptions& options);

/// The same for every absorption of a list, from one set of paths: a path of length L is weighted with
/// exp(-absorption L), and singly scattered light is a closed form. Above absorption 0 an energy is a ratio too: of the
/// paths' weighted to their unweighted light, times E; energy_error is its standard error. Every cell meets
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
