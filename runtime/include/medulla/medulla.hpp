// medulla: the fur fibre's scattering core in any renderer. The only header to include; C++17, the standard library
// alone; no allocation, no exceptions, no globals with constructors; every function is pure and thread-safe.
//
// Use.
//   FurFibre<3> fibre;                              once per material
//   prepare(parameters_of<3>(*find_preset("bobcat")), open_pack(default_pack_words, default_pack_size).pack, fibre);
//                                                   its FurStatus says what is wrong with parameters or pack
//   UnfoldedTables tables; unfold(fibre, tables);   optional, 153 KB a material: near field 36 times as fast
//   eval(fibre, theta_i, theta_r, phi, h)           near field: a ray at offset h
//   eval(fibre, theta_i, theta_r, phi, range)       mean over offsets; OffsetRange{} is the far field
//   eval(fibre, omega_i, omega_r, h or range)       the same from directions in the fibre's frame
//   density(fibre, omega_i, omega_r, h or range)    energy per steradian, as the samplers' pdf is
//   eval(near, count, theta_r, phi, S)              many exits of a NearField at once
//   eval(fibre, count, theta_i, h, theta_r, phi, S) many queries at once (h comes second here)
//   NearField<3> near; near_field(fibre, theta_i, h, near);     prepared for many exits: near.eval(theta_r, phi),
//   FarField<3> far; far_field(fibre, theta_i, range, far);     density(near, theta_r, phi), and so of far
//   NearSampler<3> sampler; sampler.prepare(near);              FarSampler<3> of a FarField
//   FurSample<3> s = sampler.sample(random_numbers);            theta_r, phi, pdf, weight; sampler.pdf(theta_r, phi)
// docs/bcsdf.md has every formula.
//
// Frame. The fibre runs along x, from tip to root; (y, z) is its cross-section. A direction has inclination theta =
// asin x in [-pi/2, pi/2] and azimuth phi = atan2(z, y), both in radians. omega_i points from the fibre to the light,
// omega_r to where light leaves; phi = phi_r - phi_i: 0 is back towards the light, pi straight on. alpha > 0 turns R
// towards +x. h in [-1, 1] is the offset of the incoming ray [fibre radii] along the left normal (counter-clockwise in
// (y, z)) of its direction of travel -omega_i.
//
// i and r. 'i' is the direction that is known, with its h: the camera ray's in path tracing; 'r' is what is drawn. The
// model is not reciprocal, and Eq. 12 with the light as i does not keep energy (docs/bcsdf.md, 'Value and measure').
//
// Value. S = sum over lobes of M N / cos^2 theta_i (Eq. 12 of Yan et al. 2017). The cosine is the caller's, as with a
// BSDF: with the light as i, L_r = integral of L_i S cos(theta_i) d omega_i, cos(theta_i) = sqrt(1 - x^2) of omega_i.
//
// Measure. Every M integrates to 1 over theta_r, every N to its lobe's energy A over phi: sum M N is energy per
// radian^2 of (theta_r, phi), and sum M N / cos theta_r energy per steradian: `density`. With the camera as i, radiance
// is the integral of L_r density d omega_r; a light that is sampled gives L_r density / (its pdf per steradian).
// `pdf_angular` is per radian^2, `pdf` per steradian; a sample's `weight` is density / pdf: it multiplies a path's
// throughput as it is, no cosine is left to add.
#pragma once

#include "medulla/axis.hpp"
#include "medulla/batch.hpp"
#include "medulla/config.hpp"
#include "medulla/cross_section.hpp"
#include "medulla/default_pack.hpp"
#include "medulla/exit_distribution.hpp"
#include "medulla/exit_rows.hpp"
#include "medulla/far_field.hpp"
#include "medulla/frame.hpp"
#include "medulla/fur_fibre.hpp"
#include "medulla/fur_parameters.hpp"
#include "medulla/gauss_legendre.hpp"
#include "medulla/gaussian.hpp"
#include "medulla/held_integral.hpp"
#include "medulla/lanes.hpp"
#include "medulla/lookup.hpp"
#include "medulla/near_field.hpp"
#include "medulla/pack.hpp"
#include "medulla/phase.hpp"
#include "medulla/queries.hpp"
#include "medulla/real_math.hpp"
#include "medulla/sampling.hpp"
#include "medulla/unfolded.hpp"
#include "medulla/unscattered.hpp"
