// The vectorised inner part of the tracer: follows paths through disc or slab from the second collision on and deposits
// their expected exits into the bins. Energies, errors and closed forms are added in tracer.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace medulla::sim2d {

enum class Medium { disc, slab };

/// How paths are traced and deposited: chosen per cell by cost and variance, without influence on the mean.
struct TracerPlan {
    std::uint32_t forced = 4;  ///< flights after the first that are forced to collide, with a weight
    float keep = 0.3f;         ///< a forced flight with a smaller probability to collide ends by roulette; (0, 1]
    float turned = 1;          ///< weight of the shortest way out in the escape estimate, the rest: straight on; (0, 1]
    float roulette = 0.25f;    ///< a vertex with a smaller escape estimate deposits with a probability below 1
    std::uint32_t comb = 1;    ///< only every comb-th bin gets a deposit, times comb; divides the bins
    std::uint32_t window = 0;  ///< bins around the phase function's peak that get all deposits; multiple of 16
};

/// One cell as the kernel sees it. Bin b of the disc covers exit directions of angle -pi + [b, b + 1) w, of the slab
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
    std::vector<double> absorption =
        {};  ///< disc: further sums of the same paths, weighted with exp(-absorption length)
};

/// The plan for a cell; plan.cpp names the measurement behind it.
TracerPlan plan_of(const TracerCell& cell);

/// Sums over paths. Each path carries the energy that was scattered at least once.
struct TracerSums {
    std::vector<double> bins;  ///< density per radian of light scattered at least twice
    double length[2] = {0,
                        0};  ///< disc: path length of all scattered light, [0]; slab: of the light in `bins`, per side
    std::vector<double> absorbed = {};         ///< [absorption][bins], as `bins`
    std::vector<double> absorbed_length = {};  ///< [absorption]: path length of the light in `absorbed`
    std::uint64_t paths = 0, scatterings = 0, deposits = 0;
};

/// Traces the paths of one cell. An object is used by one thread only.
class PathTracer {
  public:
    explicit PathTracer(const TracerCell& cell);
    ~PathTracer();

    /// Adds the paths [first, first + count) of a randomisation (below 256) to `sums`; first + count <= 2^32.
    void trace(std::uint32_t randomisation, std::uint64_t first, std::uint64_t count, TracerSums& sums);

    struct State;

  private:
    std::unique_ptr<State> state_;
};

/// Random words of the vectorised generator for the scattering `order` of paths first, first + 1, ...; a test compares
/// them with the scalar philox of sim2d/random.hpp under the tracer's key.
std::vector<std::array<std::uint32_t, 4>> tracer_words(const TracerCell& cell, std::uint32_t order,
                                                       std::uint32_t randomisation, std::uint32_t first,
                                                       std::size_t count);

/// Key and counter of those words: philox(counter, key[0], key[1]).
struct TracerCounter {
    std::array<std::uint32_t, 4> counter;
    std::array<std::uint32_t, 2> key;
};
TracerCounter tracer_counter(const TracerCell& cell, std::uint32_t order, std::uint32_t randomisation,
                             std::uint32_t path) noexcept;

/// Instruction set that the kernel runs on; all those that this machine offers, the best first.
const char* tracer_target();
std::vector<std::string> tracer_targets();

/// Selects one of tracer_targets() for all later calls; "" selects the best. For tests and benchmarks only, while no
/// other thread traces.
void set_tracer_target(const std::string& name);

}  // namespace medulla::sim2d
