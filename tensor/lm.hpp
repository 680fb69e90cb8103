// Damped Gauss-Newton for CP: all factors move at once, which avoids the swamps that stall ALS.
// Tomasi & Bro 2006; Sorber, Van Barel, De Lathauwer 2013 for the structure of the normal equations.
#pragma once

#include "tensor/als.hpp"

namespace medulla::tensor {

/// Minimises |scale * tensor - model|^2 / 2 + ridge / 2 sum_k |factor_k|^2 by Levenberg-Marquardt steps.
/// `scale` is 1 / |tensor|. A step solves (J^T J + ridge + damping) d = -gradient: the longest mode's block, I kron a
/// rank x rank matrix, is eliminated exactly, so that iterations cost nothing per node of it, and conjugate gradients
/// preconditioned with the other modes' diagonal blocks solve the Schur complement.
/// Stops as Stop describes, with `tolerance` applied over the last half of all steps.
Fit lm_steps(const SplitTensor& tensor, double scale, Factors start, double ridge, int max_steps, double tolerance);

}  // namespace medulla::tensor
