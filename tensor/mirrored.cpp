#include "tensor/mirrored.hpp"

#include <algorithm>
#include <cmath>
#include <random>

namespace medulla::tensor {
namespace {

constexpr double least = 1e-12;  // of the greatest entry: a factor that is 0 could not grow again

/// One sweep over the columns of C for fixed factors. @param G their Gram matrix  @param P X times their transpose
/// @return the greatest change of an entry
double improve(RowMatrix& C, const RowMatrix& G, const RowMatrix& P, double floor) {
    double greatest = 0;
#pragma omp parallel for schedule(static) reduction(max : greatest) if (C.rows() >= 256)
    for (Eigen::Index i = 0; i < C.rows(); ++i)
        for (Eigen::Index k = 0; k < C.cols(); ++k) {
            if (!(G(k, k) > 0)) continue;
            const double next = std::max(floor, C(i, k) + (P(i, k) - C.row(i).dot(G.row(k))) / G(k, k));
            greatest = std::max(greatest, std::abs(next - C(i, k)));
            C(i, k) = next;
        }
    return greatest;
}

}  // namespace

RowMatrix with_mirrored(const RowMatrix& B, const std::vector<Eigen::Index>& mirror) {
    RowMatrix F(2 * B.rows(), B.cols());
    F.topRows(B.rows()) = B;
    for (Eigen::Index j = 0; j < B.cols(); ++j) F.col(j).tail(B.rows()) = B.col(mirror[static_cast<std::size_t>(j)]);
    return F;
}

RowMatrix nonnegative_coefficients(const RowMatrix& X, const RowMatrix& F, int sweeps) {
    const RowMatrix G = multiplied(F, F.transpose()), P = multiplied(X, F.transpose());
    RowMatrix C = RowMatrix::Zero(X.rows(), F.rows());
    for (int s = 0; s < sweeps; ++s) {
        const double change = improve(C, G, P, 0);
        if (change <= 1e-7 * C.maxCoeff()) break;
    }
    return C;
}

MirroredResult mirrored_factors(const RowMatrix& X, const std::vector<Eigen::Index>& mirror,
                                const MirroredOptions& options) {
    const Eigen::Index rank = options.rank, rows = X.rows(), columns = X.cols();
    MirroredResult result;
    RowMatrix& B = result.B;
    B.resize(rank, columns);
    // Rows of X, each half mean: far apart, and nowhere 0.
    std::mt19937_64 random(options.seed);
    const Eigen::RowVectorXd mean = X.colwise().mean().cwiseMax(0);
    const double floor = least * std::max(X.maxCoeff(), 1e-300);
    for (Eigen::Index k = 0; k < rank; ++k) {
        const auto row = static_cast<Eigen::Index>(random() % static_cast<std::uint64_t>(rows));
        B.row(k) = (0.5 * X.row(row) + 0.5 * mean).cwiseMax(floor);
    }
    RowMatrix C = RowMatrix::Constant(rows, 2 * rank, 1.0 / static_cast<double>(rank));
    const double whole = X.squaredNorm();
    double checked = 2;
    for (result.sweeps = 0; result.sweeps < options.sweeps; ++result.sweeps) {
        const RowMatrix F = with_mirrored(B, mirror), G = multiplied(F, F.transpose()),
                        P = multiplied(X, F.transpose());
        for (int again = 0; again < 2; ++again) improve(C, G, P, floor);
        if (result.sweeps % 10 == 0) {
            // |X - C F|^2 = |X|^2 - 2 <C, P> + <C G, C>
            const double square = whole - 2 * C.cwiseProduct(P).sum() + multiplied(C, G).cwiseProduct(C).sum();
            result.error = std::sqrt(std::max(0.0, square) / whole);
            if (checked - result.error < options.tolerance * result.error) break;
            checked = result.error;
        }
        // A row of B is met as it is by C1 and mirrored by C2: normal equations (a, d; d, a) couple each column with
        // its mirror image.
        const auto C1 = C.leftCols(rank), C2 = C.rightCols(rank);
        const RowMatrix A = multiplied(C1.transpose(), C1) + multiplied(C2.transpose(), C2);
        RowMatrix D = multiplied(C1.transpose(), C2);
        D += RowMatrix(D.transpose());
        RowMatrix Q = multiplied(C1.transpose(), X);
        const RowMatrix R = multiplied(C2.transpose(), X);
        for (Eigen::Index j = 0; j < columns; ++j) Q.col(j) += R.col(mirror[static_cast<std::size_t>(j)]);
        Eigen::RowVectorXd r(columns), s(columns);
        for (Eigen::Index k = 0; k < rank; ++k) {
            const Eigen::RowVectorXd same = A.row(k) * B, across = D.row(k) * B;
            for (Eigen::Index j = 0; j < columns; ++j) s[j] = across[mirror[static_cast<std::size_t>(j)]];
            r = Q.row(k) - same - s;  // minus the gradient
            const double a = A(k, k), d = D(k, k), determinant = a * a - d * d;
            if (!(a > 0)) continue;
            if (determinant > 1e-6 * a * a) {
                for (Eigen::Index j = 0; j < columns; ++j) s[j] = r[mirror[static_cast<std::size_t>(j)]];
                r = (a * r - d * s) / determinant;
            } else {
                r /= a + std::abs(d);
            }
            B.row(k) = (B.row(k) + r).cwiseMax(floor);
        }
    }
    return result;
}

}  // namespace medulla::tensor
