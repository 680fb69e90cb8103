// Discrete ordinates in the slab by eigen-modes: from one decomposition per (g, directions) to the exit radiance of
// light scattered twice and more, for any thickness and any incident angle. docs/physics.md, section 3.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "sim2d/slab/angles.hpp"

namespace medulla::sim2d {

/// Modes of one parity in theta (even: cos-like, odd: sin-like) on the N directions theta_j > 0.
///
/// With I+-(theta_j) the radiance towards larger and smaller x, S = I+ + I-, D = I+ - I-, tilde = sqrt(weight) times:
///   M D~' = -X S~ + s,   M S~' = -Y D~ + d,   X = 1 - (C + F)~, Y = 1 - (C - F)~   (optical depth as the unit)
/// where C scatters within a hemisphere and F across. With X = L L^T, Y = R R^T and L^-1 M R^-T = U diag(1/k) V^T
/// the modes exp(-+k tau) are S~ = L^-T u, D~ = +-R^-T v, and S~_m^T M D~_n = delta_mn / k_m: sources are projected
/// by inner products. Nothing is divided by mu, so grazing directions cost no precision.
struct SlabModes {
    Eigen::VectorXd k;
    Eigen::MatrixXd sum, difference;                  ///< S and D of mode m at node j, [j, m]
    Eigen::MatrixXd project_sum, project_difference;  ///< [m, j]: mode amplitudes of a source at the nodes
    /// Even parity: the phase function from node to node, within a hemisphere and across [j, j]; amplitude
    /// of mode m's sum (difference) for a source shaped like mode n's [m, n].
    Eigen::MatrixXd direct, across, sum_of_sum, difference_of_difference;
    bool conservative = false;  ///< mode 0 is the diffusion mode: S constant in tau, D linear (even parity only)
};

/// All modes of one g on N directions.
class SlabOrdinates {
  public:
    SlabOrdinates(double g, std::size_t count, bool resolved);

    /// Per direction and incident angle (columns): radiance of light scattered at least twice divided by
    /// 1 - exp(-depth / mu), per unit incident energy; a mean source function, smooth towards grazing.
    struct Exit {
        Eigen::MatrixXd back[2], forward[2];  ///< [parity]
    };
    /// Per direction of incidence: path [mean free paths] times energy of light scattered at least twice, divided by
    /// 1 - exp(-depth / mu).
    struct Paths {
        Eigen::VectorXd back, forward;
    };
    /// @param depth optical depth 2 sigma, > 0   @param theta_i in [0, pi/2] [radians], travelling towards +theta_i
    Exit multiply_scattered(double depth, const std::vector<double>& theta_i) const;

    /// By reciprocity: the path of incident light times its probability to leave on a side is the radiance of a source
    /// equal to that probability, which is the field of isotropic light on that side. One solve for all angles, with
    /// even modes only.
    Paths multiply_scattered_paths(double depth) const;

    const SlabDirections& directions() const noexcept { return directions_; }
    Interpolation interpolation() const noexcept { return resolved_ ? Interpolation::spectral : Interpolation::linear; }

  private:
    double g_;
    bool resolved_;
    SlabDirections directions_;
    std::vector<double> cell_edge_;  ///< N + 1 inclinations, falling: cell j = [cell_edge_[j+1], cell_edge_[j]]
    SlabModes modes_[2];

    SlabModes decompose(Parity parity) const;
};

}  // namespace medulla::sim2d
