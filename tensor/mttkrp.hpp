// The matricised tensor times Khatri-Rao product (MTTKRP): the expensive step of every CP solver, for all modes at
// about the cost of two. Internal to this folder.
#pragma once

#include <cstddef>
#include <vector>

#include "tensor/product.hpp"

namespace medulla::tensor {

/// One per mode, shape[k] x rank.
using Factors = std::vector<RowMatrix>;

/// A tensor seen as a matrix: modes [0, split) down, modes [split, order) across. Borrows the values.
/// Products with the factors of one side serve every mode of the other side (a dimension tree of depth one).
/// The Khatri-Rao product is formed block by block and never stored as a whole. Every entry is summed in an order fixed
/// by the shape, so results do not depend on the number of threads.
class SplitTensor {
  public:
    SplitTensor(const double* values, std::vector<std::size_t> shape);

    const std::vector<std::size_t>& shape() const { return shape_; }
    std::size_t split() const { return split_; }  ///< order 1: 1, so that nothing lies across

    /// rows x rank: the tensor contracted with the factors of the modes across, times `scale`.
    RowMatrix down(const Factors& factors, double scale) const;
    /// columns x rank: the tensor contracted with the factors of the modes down, times `scale`.
    RowMatrix across(const Factors& factors, double scale) const;
    /// The MTTKRP of `mode` from down() (mode < split) or across(), and the factors of that side.
    RowMatrix mode(const RowMatrix& side, const Factors& factors, std::size_t mode) const;

    /// |scale * tensor - sum_r weights[r] outer products|^2, by explicit subtraction.
    double residual_squared(const Factors& factors, const Eigen::VectorXd& weights, double scale) const;

  private:
    const double* values_;
    std::vector<std::size_t> shape_;
    std::size_t split_;
    Eigen::Index rows_ = 1, columns_ = 1;
};

/// Rows [begin, begin + count) of the Khatri-Rao product of factors [first, last), last mode fastest.
/// An empty range of modes is a single row of ones.
void khatri_rao_rows(const Factors& factors, std::size_t first, std::size_t last, Eigen::Index begin,
                     Eigen::Index count, RowMatrix& rows);

}  // namespace medulla::tensor
