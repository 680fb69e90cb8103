// The plain analog path tracer of the disc and the slab: the reference implementation for every other solver.
// docs/physics.md, sections 1 to 3.
#pragma once

#include <cstdint>
#include <vector>

#include "sim2d/profile.hpp"
#include "sim2d/random.hpp"

namespace medulla::sim2d {

/// How the first collision is drawn. `forced` draws it inside the medium, so that every path is scattered. Then every
/// cell has a lobe, also in the limits sigma = 0, h = 1 and theta_i = 90 degrees, and the energy is a closed form.
enum class FirstCollision { analog, forced };

struct TraceOptions {
    std::uint64_t paths = 100000;  ///< below 2^40
    std::uint64_t seed = 1;
    std::uint64_t cell = 0;  ///< of the table: each cell has its own random numbers
    FirstCollision first = FirstCollision::forced;
};

/// C^N of a cell over `bins` bins of phi in (-pi, pi].
/// @param sigma scattering coefficient [1 / disc radius], >= 0   @param g mean cosine, in (-1, 1)   @param h in [-1, 1]
/// standard_error: sqrt(sum over bins of the variance of the bin) / |lobe|, for N scattered paths with n_b in bin b
/// sum n_b (1 - n_b / N) / sum n_b^2. With no scattered path the lobe is empty, the energy 0 and the error 1.
Profile trace_disc(double sigma, double g, double h, std::size_t bins, const TraceOptions& options);

/// The same for every absorption of a list, from one set of paths: a path of length L has weight w = exp(-absorption
/// L). n_b becomes the sum of w in bin b, its variance sum w^2 - n_b^2 / N; the energy is a sum of weights with a
/// standard error, and mean_length is weighted too. At absorption 0 it is the profile above, byte for byte.
/// @param absorption [1 / disc radius], each >= 0
std::vector<Profile> trace_disc(double sigma, double g, double h, const std::vector<double>& absorption,
                                std::size_t bins, const TraceOptions& options);

/// C^M of a cell over `bins_per_side` bins of theta_r in (-pi/2, pi/2) on each side.
/// @param theta_i inclination of the direction towards the light [radians], in [-pi/2, pi/2]
SlabProfile trace_slab(double sigma, double g, double theta_i, std::size_t bins_per_side, const TraceOptions& options);

/// A ray: position and unit direction.
struct Ray {
    double x, y;
    Direction<double> direction;
};

/// End of a path: the ray where it leaves the unit disc, the path length inside, the number of collisions.
struct Exit {
    Ray ray;
    double length;
    std::uint64_t scatterings;
};

/// Follows one path through the unit disc from `start` (inside or on the circle) until it leaves.
Exit follow_path(Ray start, double sigma, double g, RandomStream& random);

}  // namespace medulla::sim2d
