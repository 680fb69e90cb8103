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

/// The C^M of which M^s is made.
enum class Longitudinal {
    house,         ///< C^M at sigma_ms kappa / cos theta_t: docs/bcsdf.md
    authors,       ///< C^M at sigma_ms kappa: the authors' plug-in
    house_cosine,  ///< times cos theta_r, each side normalised: exits from a cylinder per solid angle
    authors_cosine,
};
inline constexpr std::size_t longitudinal_count = 4;

/// The form of the model.
struct ModelForm {
    Reflectance reflectance = Reflectance::bravais;  ///< Fresnel term of Eq. 13
    Scattering scattering = Scattering::published;   ///< energies of the scattered lobes, and which C^M they have
};

ModelForm form_of(const FurParameters<3>& p);

/// A range of offsets in [0, 1], with uniform weight: low = high for one ray, 0 and 1 for the far field (then
/// `folded`).
struct OffsetRange {
    double low = 0, high = 1;
};

/// The mean of the lobes over one range of offsets.
struct FiveLobes {
    Scattering form = Scattering::published;
    /// Per channel: R, TT, TRT, TTs, TRTs, and the residual lobe of the runtime (docs/bcsdf.md).
    std::vector<std::array<double, all_lobe_count>> energy;
    std::array<double, all_lobe_count> white = {};  ///< energies without absorption
    /// Mean lengths of TTs and TRTs in cortex and medulla without absorption, over all light that meets the fibre
    /// [radii]: the lengths that the form assumes for absorption.
    double cortex_length = 0, medulla_length = 0;
    /// Of TTs and TRTs, per channel and Longitudinal, averaged over bins; no errors. Zero where nothing scatters.
    std::vector<std::array<DirectionalDensity, longitudinal_count>> scattered;

    /// The C^M of the form.
    std::size_t own() const {
        return std::size_t(form == Scattering::corrected ? Longitudinal::house_cosine : Longitudinal::house);
    }
};

/// @param fibre its own reflectance is not used   @param ranges of 0 <= low <= high <= 1
/// @param theta_bins, phi_bins of `scattered`; phi_bins divides 1440
std::vector<FiveLobes> five_lobes(const Fibre& fibre, const ModelForm& form, double theta_i,
                                  const std::vector<OffsetRange>& ranges, std::size_t theta_bins, std::size_t phi_bins);

/// The mean over phi and -phi of every row, which is light at h and at -h.
void fold(std::vector<double>& rows, std::size_t phi_bins);
DirectionalDensity folded(DirectionalDensity d);

/// The marginal over phi, or over theta_r, as a density of one row or one column.
DirectionalDensity marginal(const DirectionalDensity& d, bool over_phi);

/// The product of the two marginals, normalised: the shape that the form M(theta_r) N(phi) can have.
DirectionalDensity product_of_marginals(const DirectionalDensity& d);

}  // namespace medulla::sim3d
