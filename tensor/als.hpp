// Alternating least squares (ALS) sweeps on a tensor: the full one or a HOSVD core.
// Rests on mttkrp.hpp and solving.hpp; internal to this folder.
#pragma once

#include "tensor/solving.hpp"

namespace medulla::tensor {

/// Result of one start for a tensor of unit norm: factors with unit columns, and component norms in `weights`.
struct Fit {
    Factors factors;
    Eigen::VectorXd weights;
    double error = 0;  ///< |scale * tensor - model|, the scaled tensor having norm 1
    double ridge = 0;  ///< the penalty that was used
    int iterations = 0;
    Stop stop = Stop::sweeps;
    std::vector<double> trace;
};

/// The best of several starts; the report receives the error of each.
/// @param solve the fit of start number 0, 1, ..
template <class Solve>
Fit best_of(int starts, CpReport& report, Solve&& solve) {
    Fit best;
    for (int start = 0; start < starts; ++start) {
        Fit fit = solve(start);
        report.starts.push_back(fit.error);
        if (start == 0 || fit.error < best.error) best = std::move(fit);
    }
    return best;
}

/// ALS from given factors. `scale` is 1 / |tensor|.
Fit als_sweeps(const SplitTensor& tensor, double scale, Factors start, const CpOptions& options);

/// Stores a fit: its model in the units of the input, canonical, and what the report says of its solve on `core`.
void store(const Fit& fit, const Normalised& input, const std::vector<std::size_t>& core, CpResult& result);

}  // namespace medulla::tensor
