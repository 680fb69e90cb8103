#include "tables/job/forecast.hpp"

#include <omp.h>

#include <algorithm>

namespace medulla::tables {

Forecast forecast(const Request& request, const std::vector<SliceId>& slices, double patience) {
    const SliceSolver solver(request);
    const std::vector<SliceId> costly = by_cost(request, slices);
    Forecast out;
    out.slices = slices.size();
    double expected = 0;
    for (const SliceId& id : slices) {
        out.cells += slice_cells(solver.plan().at(id.table));
        expected += static_cast<double>(expected_cost(request, id));
    }
    // With a budget, the first, coarse solve.
    const double target = request.time_budget > 0 ? greatest_target : request.target_error;
    // Positions in the order of cost: middle, quarters, eighths ..: the most expensive come last, if at all.
    std::vector<double> places;
    for (double step = 0.5; step > 1.0 / 64; step /= 2)
        for (double place = 1 - step; place > 0; place -= 2 * step) places.push_back(place);
    double spent = 0, spent_expected = 0;
    std::vector<bool> seen(costly.size(), false);
    for (const double place : places) {
        const auto i = static_cast<std::size_t>(place * static_cast<double>(costly.size()));
        if (i >= costly.size() || seen[i] || (out.measured > 0 && spent > patience)) continue;
        seen[i] = true;
        const double start = omp_get_wtime();
        solver.solve(costly[i], target);
        spent += omp_get_wtime() - start;
        spent_expected += static_cast<double>(expected_cost(request, costly[i]));
        ++out.measured;
    }
    if (out.measured == 0) return out;
    out.core_seconds = spent / spent_expected * expected;
    const int threads = request.threads > 0 ? request.threads : omp_get_max_threads();
    out.seconds = std::max(request.time_budget, out.core_seconds / threads);
    return out;
}

}  // namespace medulla::tables
