// Sequentially truncated higher-order SVD: a tensor as a small core with an orthonormal basis per mode.
// Vannieuwenhoven, Vandebril, Meerbergen 2012; long modes by the blocked range finder of Martinsson & Voronin 2016.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "tensor/dense.hpp"

namespace medulla::tensor {

struct Hosvd {
    Tensor core;
    std::vector<Eigen::MatrixXd> bases;  ///< bases[k] is shape[k] x core.shape[k], orthonormal columns
    double error = 0;                    ///< |tensor - core x bases| / |tensor|, from the discarded part of each mode
};

/// Smallest truncation. Bases come from Gram matrices, whose rounding hides singular values below about 1e-8 of the
/// largest, so a smaller request is treated as this one.
constexpr double finest_truncation = 1e-7;

/// The smallest core, mode by mode with the longest last, whose relative error is at most `relative_error` >= 0.
/// Expects a valid, nonzero tensor whose squares neither overflow nor underflow. The result does not depend on the
/// number of threads.
Hosvd truncated_hosvd(const Tensor& tensor, double relative_error);

/// Tensor times matrix along one mode: result[.. j ..] = sum_i matrix(j, i) tensor[.. i ..].
Tensor multiply(const Tensor& tensor, const Eigen::MatrixXd& matrix, std::size_t mode);

}  // namespace medulla::tensor
