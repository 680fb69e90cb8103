// The vectorised inner part of the tracer: walks of order two and more through disc or slab, and what they pay into the
// bins. Nothing here knows energies, errors or closed forms: see tracer.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace medulla::sim2d {

enum class Medium { disc, slab };

/// How walks are followed and paid out: chosen per cell by cost and variance, without influence on the mean.
struct TracerPlan {
    std::uint32_t forced = 4;  ///< flights after the first that are kept inside by a weight where that is likely anyway
    float keep = 0.3f;         ///< such a flight ends by roulette where less than this share of it collides, in (0, 1]
    float turned = 1;        ///< of the escape weight: share of the nearest way out, the rest is the way ahead; (0, 1]
    float pay = 0.25f;       ///< a vertex whose escape weight is smaller is paid out by roulette
    std::uint32_t comb = 1;  ///< every comb-th bin gets a deposit, times comb; divides the bins
    std::uint32_t window = 0;  ///< bins about the peak of the phase function that always get theirs; multiple of 16
};

/// One cell as the kernel sees it. Bin b of the disc holds exit directions of angle -pi + [b, b + 1) w, of the slab
/// -pi/2 + [b, b + 1) w, w = 2 pi / bins: the forward side by theta_r, then the backward side by pi - theta_r.
struct TracerCell {
    Medium medium = Medium::disc;
    double sigma = 0;          ///< [1 / radius], > 0 as a float
    double g = 0;              ///< in (-1, 1)
    double h = 0;              ///< disc: offset of the ray, in [-1, 1]
    double theta_i = 0;        ///< slab: inclination of the direction towards the light [radians]
    std::uint32_t bins = 720;  ///< of the full circle; slab: even
    std::uint64_t seed = 1, cell = 0;
    TracerPlan plan;
    std::vector<double> absorption = {};  ///< disc: further sums of the same walks, light times exp(-absorption length)
};

/// The plan that measured best for a cell like this one.
TracerPlan plan_of(const TracerCell& cell);

/// Sums over walks, each of which carries the energy that was scattered at least once.
struct TracerSums {
    std::vector<double> bins;   ///< density per radian of the light scattered twice and more
    double length[2] = {0, 0};  ///< disc: path length of all scattered light, [0]; slab: of what `bins` holds, per side
    std::vector<double> absorbed = {};         ///< [absorption][bins], as `bins`
    std::vector<double> absorbed_length = {};  ///< [absorption]: path length of what `absorbed` holds
    std::uint64_t walks = 0, scatterings = 0, deposits = 0;
};

/// Follows walks of one cell. One object belongs to one thread.
class WalkTracer {
  public:
    explicit WalkTracer(const TracerCell& cell);
    ~WalkTracer();

    /// Adds the walks [first, first + count) of a randomisation (below 256) to `sums`; first + count <= 2^32.
    void trace(std::uint32_t randomisation, std::uint64_t first, std::uint64_t count, TracerSums& sums);

    struct State;

  private:
    std::unique_ptr<State> state_;
};

/// What the lanes draw for the scattering `order` of walks first, first + 1, ...: the words of sim2d/random.hpp's
/// philox, with the tracer's key. For the twin test.
std::vector<std::array<std::uint32_t, 4>> tracer_words(const TracerCell& cell, std::uint32_t order,
                                                       std::uint32_t randomisation, std::uint32_t first,
                                                       std::size_t count);

/// Key and counter of those words: philox(counter, key[0], key[1]).
struct TracerCounter {
    std::array<std::uint32_t, 4> counter;
    std::array<std::uint32_t, 2> key;
};
TracerCounter tracer_counter(const TracerCell& cell, std::uint32_t order, std::uint32_t randomisation,
                             std::uint32_t walk) noexcept;

/// Instruction set that the kernel runs on, and all that it could run on here, the best first.
const char* tracer_target();
std::vector<std::string> tracer_targets();

/// From now on the kernel runs on that one of tracer_targets(), "" for the best. For tests and benchmarks: not while
/// another thread traces.
void set_tracer_target(const std::string& name);

}  // namespace medulla::sim2d
