// Scaling, starts, small symmetric solves and the stopping rule of the CP solvers.
#include "tensor/solving.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace medulla::tensor {

namespace {

// Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators": SplitMix64's finaliser.
std::uint64_t mix(std::uint64_t z) {
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

double uniform(std::uint64_t bits) { return (static_cast<double>(bits >> 11) + 0.5) * 0x1p-53; }

}  // namespace

void require_valid(const CpOptions& options) {
    if (options.rank < 1) throw std::invalid_argument("cp: rank " + std::to_string(options.rank) + " is below 1");
    if (options.max_sweeps && *options.max_sweeps < 1)
        throw std::invalid_argument("cp: max_sweeps " + std::to_string(*options.max_sweeps) + " is below 1");
    if (options.restarts && *options.restarts < 1)
        throw std::invalid_argument("cp: restarts " + std::to_string(*options.restarts) + " is below 1");
    if (options.tolerance && !(*options.tolerance >= 0)) throw std::invalid_argument("cp: tolerance must be 0 or more");
    if (options.ridge && !(*options.ridge >= 0 && std::isfinite(*options.ridge)))
        throw std::invalid_argument("cp: ridge must be 0 or more, and finite");
    if (options.truncation && !(*options.truncation >= 0 && *options.truncation < 1))
        throw std::invalid_argument("cp: truncation must be in [0, 1)");
}

Normalised::Normalised(const Tensor& tensor) : original_(tensor) {
    require_valid(tensor);
    const double largest = max_abs(tensor);
    if (largest == 0) return;
    // Up to 2^+-400, squares and sums of 2^60 of them stay in range: see norm().
    const int exponent = std::ilogb(largest);
    if (std::abs(exponent) > 400) {
        exponent_ = exponent;
        copy_ = scaled(tensor, -exponent);
    }
    norm_ = medulla::tensor::norm(this->tensor());
}

double Normalised::restore(double weight) const { return std::ldexp(weight * norm_, exponent_); }

Factors gaussian_factors(const std::vector<std::size_t>& shape, int rank, std::uint64_t seed, int start) {
    Factors factors;
    for (std::size_t k = 0; k < shape.size(); ++k) {
        RowMatrix factor(static_cast<Eigen::Index>(shape[k]), rank);
        const std::uint64_t key = mix(mix(mix(seed) + static_cast<std::uint64_t>(start)) + k);
        for (Eigen::Index i = 0; i < factor.size(); ++i) {
            const std::uint64_t bits = mix(key + static_cast<std::uint64_t>(i));
            // Box & Muller 1958.
            factor.data()[i] = std::sqrt(-2 * std::log(uniform(bits))) *
                               std::cos(2 * static_cast<double>(EIGEN_PI) * uniform(mix(bits)));
        }
        factors.push_back(std::move(factor));
    }
    return factors;
}

RowMatrix solve_gram(const Eigen::MatrixXd& gram, const RowMatrix& right) {
    const double epsilon = std::numeric_limits<double>::epsilon();
    const Eigen::VectorXd scale =
        gram.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });  // 0: a vanished component
    const Eigen::MatrixXd unit = scale.asDiagonal() * gram * scale.asDiagonal();
    Eigen::MatrixXd solution = scale.asDiagonal() * right.transpose();
    const Eigen::LLT<Eigen::MatrixXd> cholesky(unit);
    // Below rank * eps the smallest eigenvalue is rounding of the largest, and a Cholesky solve would divide by it.
    const double smallest = static_cast<double>(gram.rows()) * epsilon;
    if (cholesky.info() == Eigen::Success && cholesky.rcond() > smallest) {
        cholesky.solveInPlace(solution);
    } else {
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit);
        const double cutoff = smallest * eigen.eigenvalues().cwiseAbs().maxCoeff();
        const Eigen::VectorXd inverse =
            eigen.eigenvalues().unaryExpr([cutoff](double v) { return v > cutoff ? 1 / v : 0.0; });
        solution = eigen.eigenvectors() * (inverse.asDiagonal() * (eigen.eigenvectors().transpose() * solution)).eval();
    }
    return (scale.asDiagonal() * solution).transpose();
}

Eigen::VectorXd normalise_columns(RowMatrix& factor, const RowMatrix& old) {
    Eigen::VectorXd norms(factor.cols());
    for (Eigen::Index r = 0; r < factor.cols(); ++r) {
        norms[r] = factor.col(r).stableNorm();
        if (norms[r] > 0)
            factor.col(r) /= norms[r];
        else
            factor.col(r) = old.col(r);
    }
    return norms;
}

bool is_flat(const std::vector<double>& trace, double tolerance) {
    if (trace.size() < 20 || tolerance == 0) return false;
    const double then = trace[trace.size() - 1 - trace.size() / 2], now = trace.back();
    return then - now < tolerance * then;
}

double rounding_floor(std::size_t order, int rank, double norm_ratio) {
    return 4 * std::numeric_limits<double>::epsilon() * (static_cast<double>(order) + std::sqrt(rank)) *
           std::max(1.0, norm_ratio);
}

CpResult zero_result(const std::vector<std::size_t>& shape, const CpOptions& options) {
    CpResult result;
    result.model.weights = Eigen::VectorXd::Zero(options.rank);
    for (std::size_t n : shape)
        result.model.factors.push_back(Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(n), options.rank));
    canonicalise(result.model);
    result.report.stop = Stop::zero_tensor;
    result.report.degeneracy = degeneracy(result.model, 0);
    result.report.core = shape;
    return result;
}

}  // namespace medulla::tensor
