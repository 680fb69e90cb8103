// Variance and cost parameters of a cell's paths. Every plan has the same mean. The constants were fitted to the
// efficiencies that bench/bench_tracer prints over sigma 0.1 to 16 and g 0 to 0.95: each plan is within a third of the
// best one for its cell.
#include <algorithm>
#include <cmath>

#include "medulla/phase.hpp"
#include "sim2d/tracer/kernel.hpp"

namespace medulla::sim2d {

TracerPlan plan_of(const TracerCell& cell) {
    TracerPlan plan;
    const double gap = 1 - std::abs(cell.g), bins = cell.bins;
    plan.forced = 8;
    plan.keep = 0.3f;
    // A deposit costs as much as about twenty scatterings. In thin media there are few vertices, and roulette would
    // spoil the lattice; in thick media the variance is that of the paths, whatever share of their vertices deposits.
    plan.roulette = static_cast<float>(std::clamp(0.15 * std::pow(cell.sigma, 0.7), 1e-6, 0.5 + 0.5 * gap));
    // With a peaked phase function most light leaves straight on.
    plan.turned = static_cast<float>(std::max(0.07, 0.5 * gap));
    // Beyond four half-widths the squared phase function is below 1 % of its peak: a comb is enough there.
    const double half_widths = std::max(16.0, 4 * gap * bins / (2 * pi));
    const double window = 16 * std::ceil(half_widths / 8);
    std::uint32_t comb = 8;
    while (cell.bins % comb != 0) --comb;
    if (window + bins / comb < 0.5 * bins) plan.window = static_cast<std::uint32_t>(window), plan.comb = comb;
    return plan;
}

}  // namespace medulla::sim2d
