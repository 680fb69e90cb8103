// What is simulated in three dimensions: a fibre, the light that meets it, and how much work to spend.
// Lengths in fibre radii, coefficients per radius, angles in radians. docs/truth.md has the physics.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace medulla::sim3d {

/// Phase function of the medulla.
enum class Phase {
    hg3d,    ///< Henyey-Greenstein in space: (1 - g^2) / (4 pi (1 + g^2 - 2 g cos t)^1.5)
    planar,  ///< Henyey-Greenstein in the cross-section, theta kept: scatterers drawn out along the axis, the medium of
             ///< the two-dimensional tables
};

/// Reflectance of one interface of the cuticle (Eq. 13 of Yan et al. 2017 stacks `layers` of them).
enum class Reflectance {
    exact,    ///< the dielectric of index eta_c, met at the facet's cosine
    bravais,  ///< as published: index eta' in the facet's cross-section, both polarisations
};

/// What `alpha` is.
enum class Tilt {
    theta_r,  ///< shift of R in theta_r, as the papers' lobes have it: the scales are tilted by alpha / 2
    scale,    ///< tilt of the scales themselves: R is shifted by 2 alpha
};

/// A cylinder of cuticle (an interface), cortex and medulla.
struct Fibre {
    double eta_c = 1.55;                 ///< refractive index of cortex and cuticle [1], in (1, 10]
    std::optional<double> eta_m = {};    ///< of the medulla [1], in [1, 10]; none: eta_c, no interface
    double kappa = 0;                    ///< radius of the medulla [fibre radii], in [0, 1]
    double alpha = 0;                    ///< tilt, see Tilt [radians], in [-pi/4, pi/4]
    double beta_m = 0, beta_n = 0;       ///< roughness along and around: deviation of R's angle, twice that of the
                                         ///< facets' slopes [radians], in [0, 2]; both 0: smooth
    double layers = 1;                   ///< of the cuticle [1], in [0, 1000]; 0.5 is one interface
    std::vector<double> sigma_ca = {0};  ///< absorption of the cortex, a value per colour channel [1 / radius], >= 0
    double sigma_ma = 0;                 ///< absorption of the medulla [1 / radius], >= 0
    double sigma_ms = 0;                 ///< scattering of the medulla [1 / radius], in [0, 1e6]
    double g = 0;                        ///< mean cosine of the phase function [1], in (-1, 1)
    double axis_ratio = 1;               ///< the cross-section is an ellipse of semi-axes axis_ratio along y and 1
                                         ///< along z, in [0.1, 10]; the medulla is the same ellipse times kappa
    Phase phase = Phase::hg3d;
    Reflectance reflectance = Reflectance::exact;
    Tilt tilt = Tilt::theta_r;
};

/// Parallel light from omega_i = (sin theta_i, cos theta_i cos azimuth, cos theta_i sin azimuth), the fibre along x
/// from tip to root, as the papers' theta is counted.
struct Light {
    double theta_i = 0;             ///< inclination of the direction towards the light [radians], in (-pi/2, pi/2)
    double h_low = -1, h_high = 1;  ///< offsets that are lit, in [-1, 1]: equal for one ray, -1 and 1 for the far
                                    ///< field. h is counted along the left normal of the direction of travel, in units
                                    ///< of half the fibre's width as the light sees it
    double azimuth = 0;             ///< [radians]; a circular fibre does not see it
};

/// Work, randomness and bins of one simulation.
struct FibreOptions {
    std::uint64_t paths = 1000000;  ///< shared out among the batches, rounded up; 1 to 2^40
    /// Stop when the scattered light's density (first channel) has this relative L2 error; 0: spend
    /// all paths. The fast tracer's alone.
    double target_error = 0;
    std::uint64_t seed = 1;
    std::uint64_t cell = 0;                       ///< which cell: another cell gets other random numbers
    std::size_t batches = 16;                     ///< independent estimates that the errors come from, 2 to 1024
    std::size_t theta_bins = 90, phi_bins = 144;  ///< of theta_r in [-pi/2, pi/2] and of phi in [-pi, pi]
};

/// @throws std::invalid_argument that names the field, what was expected and what was found
void validate(const Fibre& fibre, const Light& light, const FibreOptions& options);

}  // namespace medulla::sim3d
