// The error of the five-lobe model of one material against light in the fibre (the truth): energies and the scattered
// lobe over inclination and offset, in the far field and for light from all directions, and the causes of the error.
// Densities are energy per radian^2 of (theta_r, phi).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "sim3d/model/five_lobes.hpp"
#include "sim3d/model/measured_light.hpp"

namespace medulla::sim3d {

struct ErrorMapOptions {
    std::uint64_t paths = 100000;  ///< per cell of the map
    std::uint64_t seed = 1;
    std::size_t inclinations = 11;        ///< theta_i = -pi/2 + k pi / (inclinations + 1), k = 1, 2, ..
    std::size_t offsets = 8;              ///< number of ranges of |h|, of equal width
    std::size_t theta_bins = 30;          ///< of the scattered lobe, a divisor of 180
    std::size_t phi_bins = 48;            ///< of the scattered lobe, even, a divisor of 1440
    std::size_t batches = 16;             ///< of paths, for standard errors
    std::function<void()> progress = {};  ///< called after each cell, from any thread, map_cells(options) times
};

/// Number of steps of the computation: the cells of the map, and a smooth fibre and the model for every inclination.
std::size_t map_cells(const ErrorMapOptions& options);

/// One light and one colour channel: the truth against the model.
struct ChannelError {
    std::array<Estimate, class_count> truth = {};   ///< energies by Class
    Estimate scattered;                             ///< sum of the last three
    std::array<double, all_lobe_count> model = {};  ///< energies by Lobe
    Distance lobe;                                  ///< of the scattered lobe as it is
    Distance shape;   ///< of the model's scattered lobe times a factor that makes its energy the truth's
    Distance cosine;  ///< the same with C^M times cos theta_r, as the corrected form has it anyway
    /// Square of the same with C^M at sigma_ms kappa, minus that of `cosine`: linear in the truth, so that its noise
    /// has no bias to subtract. Above 0, sigma_ms kappa / cos theta_t is nearer to the truth.
    Estimate sigma;
    /// Of R, TT, TRT in the far field of one inclination: mean of theta_r + theta_i, and deviation of theta_r
    /// [radians]. Value and error are 0 where there is too little light. The model's are alpha_p and beta_p of Table 2.
    std::array<Estimate, 3> shift = {}, deviation = {};

    double model_scattered() const { return model[3] + model[4]; }
};

struct LightError {
    double theta_i = 0;
    OffsetRange offsets;  ///< of |h|: 0 to 1 is the far field
    std::vector<ChannelError> channels;
};

/// One light: the truth against the model's lobes of the same bins and channels.
LightError light_error(const MeasuredLight& truth, const FiveLobes& model, double theta_i, const OffsetRange& offsets);

/// The causes of the error of the scattered light, for light from all directions. Index 0: the far field, 1: single
/// ranges of offsets.
struct Causes {
    std::array<std::array<Distance, longitudinal_count>, 2> shape;  ///< by Longitudinal
    std::array<Distance, 2> over_phi, over_theta;                   ///< of the marginals, with the cosine
    std::array<Distance, 2> product;                  ///< of the truth from the product of its own marginals
    std::array<Estimate, 2> sigma, sigma_over_theta;  ///< as ChannelError::sigma, of the lobe and of its marginal
    Distance cuticle;                                 ///< far field: of light in a smooth fibre from the truth
    Estimate entering;   ///< model - truth of the scattered energy, as far as the share of light that scatters differs
    Estimate absorbing;  ///< the rest of it: the share of the scattered light that is absorbed differs
    Estimate cortex_length, medulla_length;                    ///< mean lengths of a path of scattered light [radii]
    double model_cortex_length = 0, model_medulla_length = 0;  ///< those that the model assumes
    double R_smooth = 0;  ///< energy of R of a smooth cuticle by the exact Fresnel term
};

/// A lobe of scattered light.
struct LobePicture {
    double theta_i = 0;
    OffsetRange offsets;
    DirectionalDensity truth, model, cosine;  ///< `truth` has errors
};

struct ErrorMap {
    std::vector<double> theta_i;
    std::vector<OffsetRange> offsets;
    std::vector<LightError> cells;      ///< [theta_i][offsets]
    std::vector<LightError> far;        ///< [theta_i]
    LightError all;                     ///< light from all directions alike: far field weighted with cos^2 theta_i
    std::vector<Causes> causes;         ///< [channel]
    std::vector<LobePicture> pictures;  ///< of the channel in the middle
    std::uint64_t paths = 0;            ///< of the truth
    Estimate lost;                      ///< energy of paths that were given up, see FibreProfile, worst cell
};

/// @param fibre the truth's, with the exact Fresnel term
/// The same arguments give the same bytes on one instruction set for any number of threads.
ErrorMap error_map(const Fibre& fibre, const ModelForm& form, const ErrorMapOptions& options);

}  // namespace medulla::sim3d
