#include "tensor/cp.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace medulla::tensor {

Tensor expand(const CpModel& model) {
    Tensor tensor;
    for (const Eigen::MatrixXd& factor : model.factors) tensor.shape.push_back(static_cast<std::size_t>(factor.rows()));
    const Eigen::Index rank = model.weights.size();
    // Row i of `partial` is the product of the factors so far at the i-th index tuple.
    Eigen::MatrixXd partial = model.weights.transpose();
    for (std::size_t k = 0; k + 1 < model.factors.size(); ++k) {
        const Eigen::MatrixXd& factor = model.factors[k];
        Eigen::MatrixXd next(partial.rows() * factor.rows(), rank);
        for (Eigen::Index i = 0; i < partial.rows(); ++i)
            for (Eigen::Index j = 0; j < factor.rows(); ++j)
                next.row(i * factor.rows() + j) = partial.row(i).cwiseProduct(factor.row(j));
        partial = std::move(next);
    }
    const Eigen::MatrixXd& last = model.factors.back();
    tensor.values.resize(static_cast<std::size_t>(partial.rows() * last.rows()));
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
        tensor.values.data(), partial.rows(), last.rows()) = partial * last.transpose();
    return tensor;
}

double relative_error(const CpModel& model, const Tensor& tensor) {
    const double scale = checked_scale(tensor);
    if (scale == 0) return model.weights.size() == 0 || model.weights.isZero(0) ? 0 : 1;
    CpModel scaled = model;
    scaled.weights /= scale;
    const Tensor expanded = expand(scaled);
    double misfit = 0, norm = 0;
    for (std::size_t i = 0; i < tensor.size(); ++i) {
        const double x = tensor.values[i] / scale, d = expanded.values[i] - x;
        misfit += d * d;
        norm += x * x;
    }
    return std::sqrt(misfit / norm);
}

const char* to_string(Stop stop) {
    switch (stop) {
        case Stop::converged:
            return "converged";
        case Stop::sweeps:
            return "sweep limit";
        case Stop::exact:
            return "exact to rounding";
        case Stop::zero_tensor:
            return "zero tensor";
    }
    return "?";
}

const char* to_string(Solver solver) { return solver == Solver::als ? "als" : "lm"; }

CpResult cp(const Tensor& tensor, Solver, const CpOptions& options) { return cp_als(tensor, options); }

}  // namespace medulla::tensor
