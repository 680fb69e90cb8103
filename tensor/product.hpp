// Matrix products for the CP solvers, with the widest SIMD of the machine, chosen at run time. Eigen for storage and
// Google Highway for SIMD; internal to this folder.
#pragma once

#include <Eigen/Dense>

namespace medulla::tensor {

/// Row-major: the entries of one node for all components lie side by side.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

namespace detail {

/// A matrix of doubles: entry (i, j) is at[i * down + j * across].
struct Strided {
    const double* at;
    Eigen::Index down, across;
};
template <class Matrix>
Strided strided(const Matrix& m) {
    return {m.data(), m.rowStride(), m.colStride()};
}

/// c[i * stride + j] = (add ? itself : 0) + sum over k of a(i, k) b(k, j), k in order: where the machine has fused
/// multiply-add, the result does not depend on the width of its vectors.
void product(Strided a, Strided b, double* c, Eigen::Index stride, Eigen::Index rows, Eigen::Index inner,
             Eigen::Index columns, bool add);

}  // namespace detail

/// c = a * b. Any matrices, blocks and transposes of doubles; none of them may share memory with c.
template <class A, class B>
void multiply(const A& a, const B& b, RowMatrix& c) {
    c.resize(a.rows(), b.cols());
    detail::product(detail::strided(a), detail::strided(b), c.data(), c.rowStride(), a.rows(), a.cols(), b.cols(),
                    false);
}
template <class A, class B>
RowMatrix multiplied(const A& a, const B& b) {
    RowMatrix c;
    multiply(a, b, c);
    return c;
}
/// c += a * b, c row-major.
template <class A, class B, class C>
void add_product(const A& a, const B& b, C&& c) {
    detail::product(detail::strided(a), detail::strided(b), c.data(), c.rowStride(), a.rows(), a.cols(), b.cols(),
                    true);
}

}  // namespace medulla::tensor
