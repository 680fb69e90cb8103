// Canonical polyadic (CP) decomposition: a tensor as a sum of rank-one terms, and what a solve reports.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "tensor/dense.hpp"

namespace medulla::tensor {

/// X[i, j, ..] = sum over r of weights[r] * factors[0](i, r) * factors[1](j, r) * ..
/// Columns have unit length, weights are >= 0 and descend; in every factor but the last, a column's entry of greatest
/// magnitude is positive.
struct CpModel {
    Eigen::VectorXd weights;
    std::vector<Eigen::MatrixXd> factors;
};

Tensor expand(const CpModel& model);

/// |expand(model) - tensor| / |tensor| (0 / 0 = 0), computed without overflow.
double relative_error(const CpModel& model, const Tensor& tensor);

/// How close components come to cancelling each other.
struct Degeneracy {
    double least_cosine = 0;  ///< least inner product of two unit components, in [-1, 1]; -1: they cancel
    double norm_ratio = 0;    ///< sum of the components' norms over the tensor's norm
};

enum class Stop { converged, sweeps, exact, zero_tensor };
const char* to_string(Stop stop);

struct CpReport {
    std::string solver;
    int iterations = 0;
    double relative_error = 0;
    Stop stop = Stop::sweeps;
    Degeneracy degeneracy;
    double seconds = 0;
};

struct CpResult {
    CpModel model;
    CpReport report;
};

struct CpOptions {
    int rank = 16;
    int max_sweeps = 500;
    double tolerance = 1e-9;  ///< converged: the error fell by less than this part of itself per sweep over 10 sweeps
    double ridge = 1e-12;     ///< relative to the mean diagonal of the normal equations
    std::uint64_t seed = 1;
    int restarts = 1;  ///< complete solves from different starts; the best is kept
};

enum class Solver { als, lm };
const char* to_string(Solver solver);

/// Alternating least squares on the full tensor. The error never rises but by rounding.
CpResult cp_als(const Tensor& tensor, const CpOptions& options);

/// The solver that is named.
CpResult cp(const Tensor& tensor, Solver solver, const CpOptions& options);

}  // namespace medulla::tensor
