// Singly scattered light of the slab 0 < x < 2 in closed form, and exact integrals of planar Henyey-Greenstein.
// docs/physics.md, sections 1, 3 and 4.
#pragma once

namespace medulla::sim2d {

/// Path factor of light that enters a layer of optical depth `depth` at cosine `mu_i`, scatters once at t and leaves
/// at cosine `mu_r` through the side it came from: (1 / mu_i) integral exp(-t / mu_i - t / mu_r) dt over [0, depth]
/// = mu_r / (mu_r + mu_i) (1 - exp(-depth / mu_r - depth / mu_i)).
/// @param depth optical depth 2 sigma, >= 0   @param mu_i in [0, 1], 0 is the limit   @param mu_r >= 0
/// @return per unit incident energy, in [0, 1]; at mu_i = mu_r = 0 the limit mu_i -> 0 is taken first
double slab_back_factor(double depth, double mu_i, double mu_r) noexcept;

/// The same through the far side: (1 / mu_i) integral exp(-t / mu_i - (depth - t) / mu_r) dt
/// = b (exp(-a) - exp(-b)) / (b - a), a = depth / mu_r, b = depth / mu_i, without cancellation at a = b.
double slab_forward_factor(double depth, double mu_i, double mu_r) noexcept;

/// Mean path, in mean free paths, of the light of slab_back_factor: (integral of s exp(-s) over [0, b]) /
/// (1 - exp(-b)), b = depth / mu_r + depth / mu_i. Infinite depth / mu: its limit 1.
double slab_back_path(double depth, double mu_i, double mu_r) noexcept;

/// The same for slab_forward_factor with finite depth / mu_r: the shorter way over the whole depth, plus a part of the
/// difference to the longer one, weighted with exp(-s). mu_i = 0: 1 + depth / mu_r.
double slab_forward_path(double depth, double mu_i, double mu_r) noexcept;

/// A quantity of the light that leaves either side of the slab, per unit of scattered light.
struct SlabSides {
    double back = 0, forward = 0;
};

/// Path length times energy of light scattered exactly once, relative to slab_energy [radii]. Quadrature over the exit
/// directions, graded towards grazing and the phase function's peak: error 1e-9 for every sigma > 0, however small.
SlabSides slab_single_paths(double sigma, double g, double theta_i);

/// Raw density per radian of theta_r of the energy scattered exactly once that leaves on the side of the light.
/// Sign as in physics.md: theta_i is the inclination of the direction towards the light, so p is evaluated at
/// pi - (theta_r - theta_i).
/// @param sigma scattering coefficient [1 / radius], >= 0   @param g mean cosine in (-1, 1)
/// @param theta_i, theta_r inclinations [radians], |theta| <= pi/2; |theta_i| = pi/2 is the limit
double slab_single_back(double sigma, double g, double theta_i, double theta_r) noexcept;

/// As slab_single_back, for the far side: p is evaluated at theta_r + theta_i, so the peak lies at theta_r = -theta_i.
double slab_single_forward(double sigma, double g, double theta_i, double theta_r) noexcept;

/// Integral of p(t; g) over [a, b] [radians], 0 <= b - a <= 2 pi; exact also where the peak is far narrower than b - a.
double planar_hg_integral(double a, double b, double g) noexcept;

/// Energy scattered at least once: 1 - exp(-2 sigma / cos theta_i), 1 at grazing incidence (0 where sigma = 0).
double slab_energy(double sigma, double theta_i) noexcept;

/// cos(theta), and exactly 0 where theta is the double nearest to pi/2 or beyond it.
double slab_cosine(double theta) noexcept;

}  // namespace medulla::sim2d
