#include "tables/job/cost.hpp"

#include <algorithm>
#include <utility>

namespace medulla::tables {

std::uint64_t expected_cost(const Request& request, const SliceId& id) {
    const double sigma = request.sigma.values.at(id.sigma), g = request.g.values.at(id.g);
    const bool disc = id.table == TableId::azimuthal;
    const auto cells = static_cast<double>(disc ? request.h.size() : request.theta_i.size());
    const auto absorptions = disc && request.absorption.size() > 0 ? static_cast<double>(request.absorption.size()) : 1;
    double cost = 0;
    // Fitted to the seconds that scripts/measure-slices prints for sigma <= 16, g <= 0.95: within a factor of 2 of
    // each.
    if (request.method == Method::automatic || request.method == Method::deterministic) {
        const double peak = 1 / (1 - (g < 0 ? -g : g));
        cost += disc ? 2e4 + 60 * peak * peak + (550 + 85 * peak) * sigma * sigma : 1e4 + 150 * peak * peak;
        cost *= absorptions;  // each is a solve of its own; the random methods trace one set of paths for all
    }
    if (request.method == Method::analog || request.method == Method::mc)
        cost += cells * static_cast<double>(request.paths) * (0.2 + (disc ? 0.15 : 0.26) * sigma);
    return static_cast<std::uint64_t>(cost) + 1;
}

std::vector<SliceId> by_cost(const Request& request, std::vector<SliceId> slices) {
    std::vector<std::pair<std::uint64_t, SliceId>> costly;
    for (const SliceId& id : slices) costly.emplace_back(expected_cost(request, id), id);
    std::stable_sort(costly.begin(), costly.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    for (std::size_t i = 0; i < slices.size(); ++i) slices[i] = costly[i].second;
    return slices;
}

}  // namespace medulla::tables
