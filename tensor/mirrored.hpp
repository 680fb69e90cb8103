// Nonnegative factors of a matrix whose rows come with their mirror images: X ~ C [B; mirror B] with C, B >= 0, where
// mirroring permutes the columns. Each row of B serves twice, so that half the rows are stored.
#pragma once

#include <cstdint>
#include <vector>

#include "tensor/product.hpp"

namespace medulla::tensor {

struct MirroredOptions {
    int rank = 16;            ///< rows of B
    int sweeps = 200;         ///< at most
    double tolerance = 1e-4;  ///< stop when ten sweeps lower the error by less than this share of it
    std::uint64_t seed = 1;
};

struct MirroredResult {
    RowMatrix B;       ///< [rank x columns]
    double error = 0;  ///< relative, Frobenius norm
    int sweeps = 0;
};

/// By hierarchical alternating least squares: each row of B and each column of C in turn is the best nonnegative one
/// for the others (Cichocki and Phan 2009). @param mirror a permutation of the columns that is its own inverse
MirroredResult mirrored_factors(const RowMatrix& X, const std::vector<Eigen::Index>& mirror,
                                const MirroredOptions& options);

/// Rows of B, then their mirror images.
RowMatrix with_mirrored(const RowMatrix& B, const std::vector<Eigen::Index>& mirror);

/// The nonnegative C of least |X - C F|, by coordinate descent: at most `sweeps` of them.
RowMatrix nonnegative_coefficients(const RowMatrix& X, const RowMatrix& F, int sweeps);

}  // namespace medulla::tensor
