// The linear solve behind DiscSolver: exit radiance under a plane wave, for every chord and mode.
#pragma once

#include <complex>
#include <vector>

#include "sim2d/disc/grid.hpp"

namespace medulla::sim2d {

/// Exit radiance of light scattered at least twice, by chord and mode, relative to the energy F of the first
/// collisions on the chord, sigma / (sigma + sigma_a) (1 - exp(-2 (sigma + sigma_a) sqrt(1 - b^2))):
/// I(b, phi) / F = c_0 + 2 Re sum over k >= 1 of c_k exp(i k phi).
struct DiscExit {
    std::vector<double> offset;               ///< b of the chords, increasing, in (0, 1]; the last is the tangent b = 1
    std::vector<std::complex<double>> lobes;  ///< c_k of chord m at m * modes + k
    std::vector<double> rest;  ///< of chord m: mean of the integral of exp(-sigma_a s) over the path s after the first
                               ///< collision [radii]
    std::vector<double> length;  ///< of chord m: mean of (t + s) exp(-sigma_a s), t the first flight and s the path
                                 ///< after it to the exit, less the mean of t [radii]
    std::size_t modes = 0;       ///< number of modes, k = 0 included
    int iterations = 0;
    double residual = 0;  ///< relative to the right-hand side, the worst mode
    /// Approximate bound of the relative error left by solves that reached their limit of steps; 0: none did.
    double unconverged = 0;
};

/// @param sigma scattering coefficient [1 / disc radius], > 0   @param sigma_a absorption coefficient, >= 0
/// @param tolerance residual at which the iteration stops   @param most_steps limit of steps at any residual
DiscExit solve_disc_transport(const DiscGrid& grid, double sigma, double sigma_a, double tolerance, int most_steps);

}  // namespace medulla::sim2d
