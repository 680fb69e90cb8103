// Light scattered exactly once in the unit disc: the closed form of docs/physics.md, section 4, as bin averages.
// Relative to the scattered energy E, so that sigma -> 0 and |h| -> 1 are ordinary values.
#pragma once

#include <cstddef>
#include <vector>

namespace medulla::sim2d {

/// E(sigma, h) = 1 - exp(-2 sigma sqrt(1 - h^2)): energy scattered at least once.
/// @param sigma [1 / disc radius], >= 0   @param h offset of the ray, in [-1, 1]
double disc_energy(double sigma, double h);

/// Singly scattered C^N / E at one exit direction:
/// p(phi; g) times the mean of exp(-sigma d(t, phi)) over the density of the first collision within the chord.
/// @param phi exit direction [radians]   @param g mean cosine, in (-1, 1)
double disc_single_over_energy(double sigma, double g, double h, double phi);

/// Averages of the above over `bins` bins of phi in (-pi, pi], by Gauss points in each bin; their number follows the
/// width 1 - |g| of the phase function. Relative error below 1e-6 for sigma <= 16, |g| <= 0.95 and 720 bins.
/// The sum of the averages times 2 pi / bins is the fraction of E that leaves after one collision.
std::vector<double> disc_single_lobe(double sigma, double g, double h, std::size_t bins);

/// Integral over phi of the same light times its path length [radii].
double disc_single_length(double sigma, double g, double h);

}  // namespace medulla::sim2d
