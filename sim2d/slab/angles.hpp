// Directions of the slab solver: quadrature nodes graded towards grazing, and quadrature points inside the bins.
// Gauss-Legendre in t on (-1, 1) with theta = (pi/2) m(t), m = (7 t - t^7) / 6: m' = 0 at the ends, nearly uniform
// inside.
#pragma once

#include <cstddef>
#include <vector>

#include "sim2d/quadrature.hpp"

namespace medulla::sim2d {

/// The N directions theta > 0 of a 2N-point rule over (-pi/2, pi/2), from grazing (index 0) to the normal.
struct SlabDirections {
    std::vector<double> t;            ///< node of the Gauss rule, in (0, 1)
    std::vector<double> theta;        ///< inclination [radians]
    std::vector<double> mu;           ///< cosine, computed from pi/2 - theta: keeps its relative precision at grazing
    std::vector<double> weight;       ///< of the integral over theta; the N weights sum to pi/2
    std::vector<double> barycentric;  ///< weights of the Lagrange interpolation in t through all 2N nodes
};
SlabDirections slab_directions(std::size_t count);

/// The t of the inclination pi/2 - from_grazing, in [0, 1]. @param from_grazing in [0, pi/2] [radians]
double slab_t_of(double from_grazing);

/// Interpolation from the N node values of an even or an odd function of theta to one t in [0, 1].
/// @param row receives N coefficients. Spectral: Lagrange in t. Linear: in theta, constant beyond the last node.
enum class Parity { even, odd };
enum class Interpolation { spectral, linear };
void slab_interpolation_row(const SlabDirections& directions, double t, double theta, Parity parity,
                            Interpolation interpolation, double* row);

/// Quadrature points of theta in [0, pi/2] grouped by bin. Bin i of n is [-pi/2 + i w, -pi/2 + (i+1) w); `upper` is
/// the bin of +theta, `lower` = n - 1 - upper that of -theta (the same one for the middle bin of an odd n).
struct SlabBins {
    std::size_t count = 0;  ///< bins over (-pi/2, pi/2)
    struct Group {
        std::size_t upper, lower, first, last;  ///< points [first, last)
    };
    std::vector<Group> groups;
    std::vector<double> theta, mu, weight;   ///< weight: of the integral over theta
    std::vector<double> sin_half, cos_half;  ///< of theta / 2
};
/// @param g decides how many points a bin needs for the phase function's peak
SlabBins slab_bins(std::size_t count, double g);

}  // namespace medulla::sim2d
