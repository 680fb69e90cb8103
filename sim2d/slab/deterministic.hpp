// Noise-free solver of the slab table C^M: eigen-modes of the transport equation on graded directions (one
// decomposition per g serves every sigma), singly scattered light in closed form. docs/physics.md, section 3.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "sim2d/profile.hpp"

namespace medulla::sim2d {

struct SlabOptions {
    /// Directions per quarter circle; 0: chosen by g.
    std::size_t directions = 0;
    /// Where g needs more than twice as many (|g| > 0.99), the phase function is averaged over cells.
    std::size_t max_directions = 480;
    /// Solve again with 0.8 of the directions for the standard errors.
    bool estimate_error = true;
};

/// Solves the slab 0 < x < 2 without absorption for one g. Calls are const and independent: threads may share it.
class SlabSolver {
  public:
    /// @param g mean cosine, in (-1, 1)   @throws std::invalid_argument
    explicit SlabSolver(double g, const SlabOptions& options = {});
    ~SlabSolver();
    SlabSolver(SlabSolver&&) noexcept;
    SlabSolver& operator=(SlabSolver&&) noexcept;

    /// One SlabProfile per theta_i. Lobes are bin averages of the density per radian.
    /// Where an energy is 0 the lobe is its limit: sigma -> 0 at fixed theta_i gives p over its integral on that side,
    /// theta_i = pi/2 the light that scatters on the surface.
    /// standard_error: relative L2 difference of two resolutions, which bounds the error of the finer one where the
    /// directions resolve the phase function (times 4, a standard error, where they do not), plus 1e-8 for rounding.
    /// energy_error: difference of the energies likewise, plus the defect of raw_total and 1e-8 of the smaller side.
    /// Both are 0 without estimate_error. mean_length: relative error 1e-6 where the directions resolve the phase
    /// function and sigma >= 0.05, 1e-5 for sigma >= 0.005, 3e-4 in thinner slabs. It diverges as log(1 / sigma) for
    /// sigma -> 0, from light scattered along the slab. The same arguments give the same bytes for any number of
    /// threads; the other angles of theta_i may change the last digits of one.
    /// @param sigma scattering coefficient [1 / radius], finite, >= 0
    /// @param theta_i inclinations of the light [radians], |theta_i| <= pi/2
    /// @param bins_per_side bins over (-pi/2, pi/2), >= 1   @throws std::invalid_argument
    std::vector<SlabProfile> solve(double sigma, const std::vector<double>& theta_i,
                                   std::size_t bins_per_side = 360) const;

    /// Raw (not normalised) densities at single directions.
    struct Raw {
        double back, forward;
    };
    /// out[i][r]: raw densities per radian of theta_r at theta_r[r] for light from theta_i[i]; units as in solve.
    std::vector<std::vector<Raw>> raw(double sigma, const std::vector<double>& theta_i,
                                      const std::vector<double>& theta_r) const;

    double g() const noexcept;
    std::size_t directions() const noexcept;  ///< per quarter circle, of the finer resolution
    bool resolved() const noexcept;           ///< the directions resolve the phase function's peak

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace medulla::sim2d
