// The five lobes of Yan et al. 2017 in double precision and straight from the paper (with the errata of docs/bcsdf.md),
// C^N and C^M from the noise-free solvers: the model itself, without tables, factors or runtime.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "medulla/fur_parameters.hpp"
#include "sim3d/fibre_profile.hpp"

namespace medulla::sim3d {

/// The parameters of the runtime as a fibre in three dimensions, with `channels` (1 or 3) of their sigma_ca.
Fibre fibre_of(const FurParameters<3>& p, std::size_t channels);

/// What M^s is made of.
enum class Longitudinal {
    house,         ///< C^M at sigma_ms kappa / cos theta_t: docs/bcsdf.md
    authors,       ///< C^M at sigma_ms kappa: the authors' plug-in
    house_cosine,  ///< either times cos theta_r, each side over its integral: a cylinder's exits per solid angle
    authors_cosine,
};
inline constexpr std::size_t longitudinal_count = 4;

/// Offsets of the light, in [0, 1], all alike: equal for one ray, 0 and 1 for the far field (then `folded`).
struct OffsetRange {
    double low = 0, high = 1;
};

/// The lobes of one range of offsets: their mean.
struct FiveLobes {
    /// Per channel: R, TT, TRT, TTs, TRTs, and the residual lobe of the runtime (docs/bcsdf.md).
    std::vector<std::array<double, all_lobe_count>> energy;
    std::array<double, all_lobe_count> white = {};  ///< had nothing absorbed
    /// Mean lengths in cortex and medulla of TTs and TRTs over all light that meets the fibre, had nothing absorbed
    /// [radii]: the lengths that Eq. 20 takes for absorption.
    double cortex_length = 0, medulla_length = 0;
    /// Of TTs and TRTs, per channel and Longitudinal, averaged over bins; no errors. Zero where nothing scatters.
    std::vector<std::array<DirectionalDensity, longitudinal_count>> scattered;
};

/// @param reflectance Eq. 13's of the model, whatever `fibre` says   @param ranges of 0 <= low <= high <= 1
/// @param theta_bins, phi_bins of `scattered`; phi_bins divides 1440
std::vector<FiveLobes> five_lobes(const Fibre& fibre, Reflectance reflectance, double theta_i,
                                  const std::vector<OffsetRange>& ranges, std::size_t theta_bins, std::size_t phi_bins);

/// Mean of phi and -phi, of rows over phi: light at h and at -h.
void fold(std::vector<double>& rows, std::size_t phi_bins);
DirectionalDensity folded(DirectionalDensity d);

/// The same over phi alone, or over theta_r alone, as a density of one row or one column.
DirectionalDensity marginal(const DirectionalDensity& d, bool over_phi);

/// The product of its two marginals, over its integral: what no M(theta_r) N(phi) gets below.
DirectionalDensity product_of_marginals(const DirectionalDensity& d);

}  // namespace medulla::sim3d
