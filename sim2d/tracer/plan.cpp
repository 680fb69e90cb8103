// How a cell's walks are paid out. Every plan has the same mean; these were measured over sigma 0.1 to 16, g 0 to 0.95
// (bench/bench_tracer.cpp prints the efficiencies), and lie within a third of the best one of each cell.
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
    // A deposit costs as much as some twenty scatterings. In thin media walks are few and their lattice is worth
    // keeping whole; in thick ones the variance is that of the walks, whatever share of their vertices is paid.
    plan.pay = static_cast<float>(std::clamp(0.15 * std::pow(cell.sigma, 0.7), 1e-6, 0.5 + 0.5 * gap));
    // Of a peaked phase function most light that leaves goes straight on.
    plan.turned = static_cast<float>(std::max(0.07, 0.5 * gap));
    // Outside four half-widths of the peak there is 1 % of its square: a comb is enough there.
    const double half_widths = std::max(16.0, 4 * gap * bins / (2 * pi));
    const double window = 16 * std::ceil(half_widths / 8);
    std::uint32_t comb = 8;
    while (cell.bins % comb != 0) --comb;
    if (window + bins / comb < 0.5 * bins) plan.window = static_cast<std::uint32_t>(window), plan.comb = comb;
    return plan;
}

}  // namespace medulla::sim2d
