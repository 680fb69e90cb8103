// What a simulation of the whole fibre returns: light by class and direction, in independent batches, so that every
// number made of it has a standard error.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim3d/fibre.hpp"

namespace medulla::sim3d {

/// What became of a path. "Inside" counts reflections at the cuticle from inside.
enum class Class : int {
    R,                    ///< never entered
    TT,                   ///< passed through without a collision
    TRT,                  ///< reflected once inside, no collision
    higher,               ///< reflected inside twice or more, no collision
    scattered,            ///< collided, never reflected inside: what TTs stands for
    reflected_scattered,  ///< reflected inside once before the first collision, never after: what TRTs stands for
    scattered_reflected,  ///< reflected inside after a collision, or more than once before it: not in the model
};
inline constexpr std::size_t class_count = 7;
inline constexpr const char* class_names[class_count] = {"R", "TT", "TRT", "higher", "s", "Rs", "sR"};

/// Set of classes, one bit each.
using Classes = std::uint32_t;
constexpr Classes only(Class c) { return 1u << static_cast<int>(c); }
inline constexpr Classes unscattered = 0x0F, scattered = 0x70, all_classes = 0x7F;

/// @param reflections inside the cuticle, before the first collision and after it
constexpr Class class_of(bool collided, std::uint32_t before, std::uint32_t after) {
    if (!collided) return before == 0 ? Class::TT : before == 1 ? Class::TRT : Class::higher;
    if (after > 0 || before > 1) return Class::scattered_reflected;
    return before == 0 ? Class::scattered : Class::reflected_scattered;
}

/// Energy, as a share of what meets the fibre, with its standard error.
struct Estimate {
    double value = 0, error = 0;
};

/// Energy per radian^2 of (theta_r, phi), averaged over each bin, theta_r-major; phi = 0 is back towards the light.
struct DirectionalDensity {
    std::size_t theta_bins = 0, phi_bins = 0;
    std::vector<double> value, error;
    double bin_area() const;        ///< [radians^2]
    double relative_error() const;  ///< |error| / |value| over the bins; 0 where there is no light
};

/// Light that left, of one batch of paths. One object belongs to one thread.
class FibreSums {
  public:
    FibreSums() = default;
    FibreSums(const Fibre& fibre, const FibreOptions& options);

    /// @param weight of the path without absorption   @param cortex, medulla lengths of the path there [radii]
    void add(Class c, std::size_t bin, double weight, double cortex, double medulla);
    /// Bin of a unit direction (theta_r = asin x, phi = atan2(z, y)); the ends belong to the first and last bin.
    std::size_t bin_of(double x, double y, double z) const;

    std::vector<double> bins;                                               ///< [class][channel][theta_r][phi]
    std::array<double, class_count> white = {}, cortex = {}, medulla = {};  ///< weights; weights times lengths
    double lost = 0;                                                        ///< weight of paths that were given up
    std::uint64_t paths = 0, flights = 0;

  private:
    std::vector<double> sigma_ca_;
    double sigma_ma_ = 0;
    std::size_t theta_bins_ = 0, phi_bins_ = 0;
};

/// The result: batches of the same number of paths each.
class FibreProfile {
  public:
    FibreProfile(const Fibre& fibre, const FibreOptions& options, std::vector<FibreSums> batches);

    Estimate energy(Classes classes, std::size_t channel = 0) const;
    Estimate white_energy(Classes classes) const;  ///< had nothing absorbed
    Estimate lost() const;                         ///< of white energy: paths cut off after 10^4 flights
    /// Mean length in cortex or medulla over all light that meets the fibre, had nothing absorbed [radii]: minus the
    /// derivative of the energy by sigma_ca or sigma_ma where both are 0.
    Estimate cortex_length(Classes classes) const;
    Estimate medulla_length(Classes classes) const;

    /// @param folded mean of phi and -phi: for the far field of a circular fibre, which is even
    DirectionalDensity density(Classes classes, std::size_t channel = 0, bool folded = false) const;

    std::uint64_t paths() const;
    std::uint64_t flights() const;
    const std::vector<FibreSums>& batches() const { return batches_; }

  private:
    template <class Value>
    Estimate estimate(Value&& value) const;

    std::size_t channels_, theta_bins_, phi_bins_;
    std::vector<FibreSums> batches_;
};

/// Half the L1 distance of two densities, each over its integral first.
double total_variation(const DirectionalDensity& a, const DirectionalDensity& b);

/// What `total_variation` shows of two densities that differ by the noise of `a` alone: half the sum over bins of
/// E|normal variable| = sqrt(2/pi) error.
double total_variation_noise(const DirectionalDensity& a);

}  // namespace medulla::sim3d
