// Plain CP-ALS on the full tensor: the slow twin of every faster solver, and the paper's own method.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <chrono>
#include <cmath>
#include <random>

#include "tensor/cp.hpp"

namespace medulla::tensor {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Matricised tensor times Khatri-Rao product for one mode, the product never formed: the tensor is contracted with
/// one factor after the other, the last axes first.
MatrixXd mttkrp(const std::vector<double>& x, const std::vector<std::size_t>& shape, const std::vector<MatrixXd>& u,
                std::size_t mode) {
    const Index rank = u[0].cols();
    Index left = 1, right = 1;
    for (std::size_t k = 0; k < mode; ++k) left *= static_cast<Index>(shape[k]);
    for (std::size_t k = mode + 1; k < shape.size(); ++k) right *= static_cast<Index>(shape[k]);
    const auto n = static_cast<Index>(shape[mode]);
    const auto products = [&](std::size_t first, std::size_t last) {  // Khatri-Rao of a few small factors
        MatrixXd p = MatrixXd::Ones(1, rank);
        for (std::size_t k = first; k < last; ++k) {
            MatrixXd next(p.rows() * u[k].rows(), rank);
            for (Index i = 0; i < p.rows(); ++i)
                for (Index j = 0; j < u[k].rows(); ++j)
                    next.row(i * u[k].rows() + j) = p.row(i).cwiseProduct(u[k].row(j));
            p = std::move(next);
        }
        return p;
    };
    const MatrixXd a = products(0, mode), b = products(mode + 1, shape.size());
    // Every row of the result belongs to one thread, so sums have one order for any number of threads.
    MatrixXd result = MatrixXd::Zero(n, rank);
    if (right == 1) {
        const Eigen::Map<const RowMajor> matrix(x.data(), left, n);
#pragma omp parallel for schedule(static)
        for (Index block = 0; block < n; block += 32) {
            const Index rows = std::min<Index>(32, n - block);
            result.middleRows(block, rows).noalias() = matrix.middleCols(block, rows).transpose() * a;
        }
        return result;
    }
#pragma omp parallel for schedule(static)
    for (Index i = 0; i < n; ++i) {
        const Eigen::Map<const RowMajor, 0, Eigen::OuterStride<>> slice(x.data() + i * right, left, right,
                                                                        Eigen::OuterStride<>(n * right));
        const MatrixXd contracted = slice * b;
        result.row(i) = contracted.cwiseProduct(a).colwise().sum();
    }
    return result;
}

/// Solves f * gram = m for f, with a small ridge; a rank-revealing solve where Cholesky fails.
MatrixXd solve_normal(const MatrixXd& gram, const MatrixXd& m, double ridge) {
    const Index rank = gram.rows();
    const MatrixXd damped = gram + MatrixXd::Identity(rank, rank) * (ridge * gram.trace() / static_cast<double>(rank));
    const Eigen::LLT<MatrixXd> cholesky(damped);
    if (cholesky.info() == Eigen::Success) {
        const MatrixXd f = cholesky.solve(m.transpose()).transpose();
        if (f.allFinite()) return f;
    }
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(damped);
    const double least = eigen.eigenvalues().maxCoeff() * 1e-14;  // below it a direction is rounding
    const VectorXd inverse = eigen.eigenvalues().unaryExpr([&](double w) { return w > least ? 1 / w : 0.0; });
    return m * eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
}

VectorXd normalise(MatrixXd& factor) {
    VectorXd norms = factor.colwise().norm();
    for (Index r = 0; r < norms.size(); ++r)
        if (norms[r] > 0) factor.col(r) /= norms[r];
    return norms;
}

MatrixXd gram_product(const std::vector<MatrixXd>& grams, std::size_t skip) {
    MatrixXd product = MatrixXd::Ones(grams[0].rows(), grams[0].cols());
    for (std::size_t k = 0; k < grams.size(); ++k)
        if (k != skip) product = product.cwiseProduct(grams[k]);
    return product;
}

}  // namespace

CpResult cp_als(const Tensor& tensor, const CpOptions& options) {
    const auto start = std::chrono::steady_clock::now();
    const double scale = checked_scale(tensor);
    const std::size_t order = tensor.order();
    CpResult result;
    result.report.solver = "als";
    std::vector<MatrixXd> u;
    std::mt19937_64 random(options.seed);
    for (const std::size_t n : tensor.shape) {
        MatrixXd factor(static_cast<Index>(n), options.rank);
        for (Index r = 0; r < factor.cols(); ++r)
            for (Index i = 0; i < factor.rows(); ++i)
                factor(i, r) = static_cast<double>(random() >> 11) * 0x1p-53;  // [0, 1): the same on every platform
        normalise(factor);
        u.push_back(std::move(factor));
    }
    VectorXd weights = VectorXd::Zero(options.rank);
    if (scale == 0) {
        result.model = {weights, u};
        result.report.stop = Stop::zero_tensor;
        return result;
    }
    std::vector<double> x(tensor.values);
    double norm2 = 0;
    for (double& v : x) {
        v /= scale;
        norm2 += v * v;
    }
    std::vector<MatrixXd> grams;
    for (const MatrixXd& factor : u) grams.push_back(factor.transpose() * factor);
    double error = 1;
    std::vector<double> history;
    for (int sweep = 0; sweep < options.max_sweeps; ++sweep) {
        MatrixXd m;
        for (std::size_t k = 0; k < order; ++k) {
            m = mttkrp(x, tensor.shape, u, k);
            u[k] = solve_normal(gram_product(grams, k), m, options.ridge);
            weights = normalise(u[k]);
            grams[k] = u[k].transpose() * u[k];
        }
        // |X - M|^2 from the last mode's product, without another pass; its rounding floor is about 1e-8 |X|.
        const double inner = m.cwiseProduct(u.back() * weights.asDiagonal()).sum();
        const double model2 = weights.dot(gram_product(grams, order) * weights);
        error = std::sqrt(std::max(0.0, norm2 + model2 - 2 * inner) / norm2);
        history.push_back(error);
        result.report.iterations = sweep + 1;
        if (error < 1e-8) {
            // Near an exact fit the formula above is all cancellation: look at the residual itself.
            result.model = {weights * scale, u};
            error = relative_error(result.model, tensor);
            if (error < 1e-14 * std::sqrt(static_cast<double>(tensor.size()))) {
                result.report.stop = Stop::exact;
                break;
            }
            history.back() = error;
        }
        const std::size_t n = history.size();
        // Ten sweeps in a row that together won less than ten tolerances: a swamp moves more than that.
        if (n > 10 && history[n - 11] - error < 10 * options.tolerance * error) {
            result.report.stop = Stop::converged;
            break;
        }
    }
    result.model = {weights * scale, u};
    result.report.relative_error = relative_error(result.model, tensor);
    result.report.degeneracy.norm_ratio = weights.sum() / std::sqrt(norm2);
    MatrixXd cosines = gram_product(grams, order);
    result.report.degeneracy.least_cosine = cosines.minCoeff();
    result.report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result;
}

}  // namespace medulla::tensor
