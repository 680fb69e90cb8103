// Shared parts of the CP solvers: scaled input, Gaussian starts, small symmetric solves and the stopping rule.
// Internal to this folder.
#pragma once

#include <cstdint>

#include "tensor/cp.hpp"
#include "tensor/mttkrp.hpp"

namespace medulla::tensor {

/// Throws std::invalid_argument where an option is outside its range.
void require_valid(const CpOptions& options);

/// A valid tensor, scaled by a power of two such that squares neither overflow nor underflow. Copied only if that is
/// necessary.
class Normalised {
  public:
    explicit Normalised(const Tensor& tensor);  ///< throws as require_valid(tensor); borrows the tensor
    const Tensor& tensor() const { return exponent_ == 0 ? original_ : copy_; }
    double norm() const { return norm_; }  ///< of tensor(); 0 for the zero tensor
    /// A weight found for tensor() / norm(), in the units of the input.
    double restore(double weight) const;

  private:
    const Tensor& original_;
    Tensor copy_;
    int exponent_ = 0;
    double norm_ = 0;
};

/// Independent standard normal entries, a pure function of (seed, start, mode, entry).
Factors gaussian_factors(const std::vector<std::size_t>& shape, int rank, std::uint64_t seed, int start);

/// A with A * gram = right, gram symmetric and non-negative definite: Cholesky on the gram scaled to a unit diagonal,
/// or, where that is singular to rounding, the least-norm solution by eigenvalues.
RowMatrix solve_gram(const Eigen::MatrixXd& gram, const RowMatrix& right);

/// Norms of the columns; each column divided by its own. A zero column keeps its direction of before, the one in `old`.
Eigen::VectorXd normalise_columns(RowMatrix& factor, const RowMatrix& old);

/// Stop::converged: the error fell by less than `tolerance` of itself over the last half of all sweeps, at least ten.
/// A plateau must last as long as all sweeps before it, so that a temporary one (a swamp) does not end the solve.
bool is_flat(const std::vector<double>& trace, double tolerance);

/// Relative error from rounding alone: each cell sums `rank` products of `order` factors whose magnitudes add
/// up to norm_ratio times the tensor's.
double rounding_floor(std::size_t order, int rank, double norm_ratio);

/// The result for the zero tensor: weight 0 everywhere.
CpResult zero_result(const std::vector<std::size_t>& shape, const CpOptions& options);

}  // namespace medulla::tensor
