// The truth in batches: light of the fast tracer, and its sums over offsets and inclinations. The jackknife over
// batches gives every number derived from it a standard error, and removes the bias of the noise from squared
// distances.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

#include "sim3d/fibre_profile.hpp"

namespace medulla::sim3d {

/// The light of one colour channel.
struct ChannelLight {
    std::array<double, class_count> energy = {};  ///< by Class
    std::vector<double> scattered;                ///< density per radian^2 over (theta_r, phi), theta_r-major
    /// Of R, TT and TRT: sums of energy times 1, theta_r and theta_r^2.
    std::array<std::array<double, 3>, 3> moments = {};

    double scattered_energy() const;
};

/// Means over some of the batches.
struct LightMeans {
    std::vector<ChannelLight> channels;
    std::array<double, class_count> white = {};    ///< energies without absorption
    double cortex_length = 0, medulla_length = 0;  ///< of scattered light, as FibreProfile counts them

    double white_scattered() const;
    void add(const LightMeans& other, double weight);
};

/// Means over all batches, and over all but one.
struct MeasuredLight {
    std::size_t theta_bins = 0, phi_bins = 0;  ///< of `scattered`
    LightMeans all;
    std::vector<LightMeans> without;  ///< [batch left out]

    /// Adds `weight` times other light of the same bins and batches, which is either independent of this or the same.
    void add(const MeasuredLight& other, double weight);
    /// Light at h and at -h: `scattered` becomes even in phi.
    void fold();
};

/// @param theta_bins coarser bins of `scattered`: a divisor of the profile's
MeasuredLight measured(const FibreProfile& profile, const Fibre& fibre, const FibreOptions& options,
                       std::size_t theta_bins);

/// f of all light, with its standard error. The bias of first order in 1 / batches is removed; a square has no other.
Estimate jackknife(const MeasuredLight& light, const std::function<double(const LightMeans&)>& f);
/// The same for a function of several lights; f(k) leaves out batch k of each, f(batches) none.
Estimate jackknife(std::size_t batches, const std::function<double(std::size_t)>& f);

/// A relative L2 distance, sqrt(square). The noise of the truth is subtracted: `square` is negative by chance where
/// they agree.
struct Distance {
    Estimate square;
    bool defined = false;  ///< false where there is no light, or too little against its noise

    double value() const;   ///< 0 where `square` is negative
    double error() const;   ///< from one standard error of `square` upwards
    bool resolved() const;  ///< above two standard errors of `square`; below it only `bound` is known
    double bound() const;   ///< value plus two standard errors
};

/// |a - b|^2 and |b|^2.
struct Squares {
    double difference = 0, norm = 0;
    void add(const Squares& other, double weight);
};
/// Of a times `scale_a` and of b times `scale_b`.
Squares squares(const std::vector<double>& a, double scale_a, const std::vector<double>& b, double scale_b);

/// sqrt(difference / norm); f as for jackknife.
Distance distance(std::size_t batches, const std::function<Squares(std::size_t)>& f);

}  // namespace medulla::sim3d
