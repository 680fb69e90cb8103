// Alternating least squares sweeps, on whatever tensor they are given: the full one or a core.
// Rests on mttkrp.hpp and solving.hpp; internal to this folder.
#pragma once

#include "tensor/solving.hpp"

namespace medulla::tensor {

/// One start's outcome, for a tensor scaled to unit norm: unit columns, component norms apart.
struct Fit {
    Factors factors;
    Eigen::VectorXd weights;
    double error = 0;  ///< |scale * tensor - model|, the scaled tensor having norm 1
    double ridge = 0;  ///< in force
    int iterations = 0;
    Stop stop = Stop::sweeps;
    std::vector<double> trace;
};

/// ALS from given factors. `scale` is 1 / |tensor|.
Fit als_sweeps(const SplitTensor& tensor, double scale, Factors start, const CpOptions& options);

/// The model of a fit in the units of the input, canonical.
CpModel to_model(const Fit& fit, const Normalised& input);

}  // namespace medulla::tensor
