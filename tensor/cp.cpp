// CP models: expansion, error, canonical form, degeneracy, the text of a report; and the choice of a solver.
#include "tensor/cp.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "tensor/mttkrp.hpp"
#include "tensor/solving.hpp"

namespace medulla::tensor {

namespace {

Factors row_major(const CpModel& model) { return Factors(model.factors.begin(), model.factors.end()); }

/// Inner products of the unweighted components of a canonical model.
Eigen::MatrixXd cosines_of(const CpModel& model) {
    Eigen::MatrixXd cosines = Eigen::MatrixXd::Ones(model.weights.size(), model.weights.size());
    for (const auto& factor : model.factors) cosines.array() *= (factor.transpose() * factor).array();
    return cosines;
}

}  // namespace

CpResult cp(const Tensor& tensor, Solver solver, const CpOptions& options) {
    switch (solver) {
        case Solver::als:
            return cp_als_compressed(tensor, options);
        case Solver::lm:
            return cp_lm(tensor, options);
        case Solver::nonnegative:
            return cp_nonnegative(tensor, options);
    }
    throw std::invalid_argument("cp: no such solver");
}

std::vector<std::size_t> CpModel::shape() const {
    std::vector<std::size_t> lengths;
    for (const auto& factor : factors) lengths.push_back(static_cast<std::size_t>(factor.rows()));
    return lengths;
}

Tensor expand(const CpModel& model) {
    Tensor result(model.shape());
    const Factors factors = row_major(model);
    const std::size_t last = factors.size() - 1;
    const Eigen::Index columns = factors[last].rows();
    const Eigen::Index rows = static_cast<Eigen::Index>(result.size()) / columns;
    constexpr Eigen::Index per_chunk = 64;
    const Eigen::Index chunks = (rows + per_chunk - 1) / per_chunk;
    Eigen::Map<RowMatrix> values(result.values.data(), rows, columns);
#pragma omp parallel for schedule(static) if (chunks > 1)
    for (Eigen::Index chunk = 0; chunk < chunks; ++chunk) {
        const Eigen::Index row = chunk * per_chunk, count = std::min(per_chunk, rows - row);
        RowMatrix left;
        khatri_rao_rows(factors, 0, last, row, count, left);
        left.array().rowwise() *= model.weights.transpose().array();
        values.middleRows(row, count).noalias() = left * factors[last].transpose();
    }
    return result;
}

double relative_error(const Tensor& tensor, const CpModel& model) {
    if (tensor.shape != model.shape()) throw std::invalid_argument("relative_error: the shapes differ");
    const double largest = max_abs(tensor);
    if (largest == 0) return model.weights.isZero(0) ? 0 : std::numeric_limits<double>::infinity();
    const int exponent = std::abs(std::ilogb(largest)) > 400 ? std::ilogb(largest) : 0;  // see Normalised
    const Eigen::VectorXd weights = model.weights.unaryExpr([exponent](double w) { return std::ldexp(w, -exponent); });
    Tensor copy;
    if (exponent != 0) copy = scaled(tensor, -exponent);
    const Tensor& source = exponent != 0 ? copy : tensor;
    const double scale = 1 / norm(source);
    return std::sqrt(
        SplitTensor(source.values.data(), source.shape).residual_squared(row_major(model), weights * scale, scale));
}

void canonicalise(CpModel& model) {
    const Eigen::Index rank = model.weights.size();
    const std::size_t order = model.factors.size();
    for (Eigen::Index r = 0; r < rank; ++r) {
        double weight = model.weights[r];
        for (auto& factor : model.factors) {
            const double length = factor.col(r).stableNorm();
            weight *= length;
            if (length > 0) factor.col(r) /= length;
        }
        if (weight == 0)
            for (auto& factor : model.factors) factor.col(r) = Eigen::VectorXd::Unit(factor.rows(), 0);
        for (std::size_t k = 0; k < order && weight != 0; ++k) {
            auto column = model.factors[k].col(r);
            Eigen::Index peak = 0;
            column.cwiseAbs().maxCoeff(&peak);
            if (k + 1 < order ? column[peak] < 0 : weight < 0) {
                column = -column;
                weight = -weight;
            }
        }
        model.weights[r] = weight;
    }
    std::vector<Eigen::Index> place(static_cast<std::size_t>(rank));
    std::iota(place.begin(), place.end(), Eigen::Index{0});
    std::stable_sort(place.begin(), place.end(),
                     [&](Eigen::Index a, Eigen::Index b) { return model.weights[a] > model.weights[b]; });
    CpModel sorted = model;
    for (Eigen::Index r = 0; r < rank; ++r) {
        const Eigen::Index from = place[static_cast<std::size_t>(r)];
        sorted.weights[r] = model.weights[from];
        for (std::size_t k = 0; k < order; ++k) sorted.factors[k].col(r) = model.factors[k].col(from);
    }
    model = std::move(sorted);
}

double norm(const CpModel& model) {
    return std::sqrt(std::max(0.0, model.weights.dot(cosines_of(model) * model.weights)));
}

Degeneracy degeneracy(const CpModel& model, double tensor_norm) {
    Degeneracy result;
    const Eigen::Index rank = model.weights.size();
    const Eigen::MatrixXd cosines = cosines_of(model);
    for (Eigen::Index r = 0; r < rank; ++r)
        for (Eigen::Index s = 0; s < r; ++s)
            if (model.weights[r] > 0 && model.weights[s] > 0)
                result.least_cosine = std::min(result.least_cosine, cosines(r, s));
    if (tensor_norm > 0) result.norm_ratio = (model.weights / tensor_norm).sum();
    return result;
}

std::string to_string(Stop stop) {
    constexpr const char* texts[] = {"converged", "sweeps spent", "exact to rounding", "no step lowers the objective",
                                     "the tensor is zero"};
    return texts[static_cast<std::size_t>(stop)];
}

std::string summary(const CpReport& report) {
    char text[256];
    std::snprintf(text, sizeof text, "%s: %d sweeps in %.3f s, relative error %.4g, stopped: %s%s",
                  report.solver.c_str(), report.iterations, report.seconds, report.relative_error,
                  to_string(report.stop).c_str(), report.degenerate() ? "; degenerate: components cancel" : "");
    std::string line = text;
    if (report.degenerate()) {
        std::snprintf(text, sizeof text, " (least cosine %.4f, norms add up to %.3g of the tensor's)",
                      report.degeneracy.least_cosine, report.degeneracy.norm_ratio);
        line += text;
    }
    return line;
}

}  // namespace medulla::tensor
