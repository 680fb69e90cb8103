// CP-ALS: each factor in turn becomes the least-squares solution with the others fixed.
// Kolda & Bader 2009, section 3.4; the ridge on balanced factors is Tikhonov's, see CpOptions.
#include "tensor/als.hpp"

#include <chrono>
#include <cmath>
#include <limits>

namespace medulla::tensor {

namespace {

/// Hadamard product of the Grams of all modes but `skip` (pass the order to skip none).
Eigen::MatrixXd gram_product(const std::vector<Eigen::MatrixXd>& grams, std::size_t skip) {
    Eigen::MatrixXd product = Eigen::MatrixXd::Ones(grams[0].rows(), grams[0].cols());
    for (std::size_t k = 0; k < grams.size(); ++k)
        if (k != skip) product.array() *= grams[k].array();
    return product;
}

}  // namespace

Fit als_sweeps(const SplitTensor& tensor, double scale, Factors start, const CpOptions& options) {
    const std::size_t order = tensor.shape().size();
    const double ridge = options.ridge.value_or(0.0), epsilon = std::numeric_limits<double>::epsilon();
    const int max_sweeps = options.max_sweeps.value_or(500);
    const double tolerance = options.tolerance.value_or(1e-6);
    Fit fit;
    fit.ridge = ridge;
    fit.factors = std::move(start);
    Factors& factors = fit.factors;
    std::vector<Eigen::MatrixXd> grams(order);
    for (std::size_t k = 0; k < order; ++k) {
        normalise_columns(factors[k], factors[k]);
        grams[k] = factors[k].transpose() * factors[k];
    }
    const Eigen::Index rank = factors[0].cols();
    fit.weights = Eigen::VectorXd::Constant(rank, 1 / std::sqrt(static_cast<double>(rank)));
    RowMatrix side, matricised;
    for (int sweep = 0; sweep < max_sweeps; ++sweep) {
        for (std::size_t k = 0; k < order; ++k) {
            if (k == 0) side = tensor.down(factors, scale);
            if (k == tensor.split()) side = tensor.across(factors, scale);
            matricised = tensor.mode(side, factors, k);
            Eigen::MatrixXd gram = gram_product(grams, k);
            RowMatrix right = matricised;
            // Balanced columns have length w^(1/N). The others are stored with unit length, t = w^((N-1)/N) taken out,
            // so the penalty on this factor times t is ridge / t^2. A component of weight 0 stays 0.
            for (Eigen::Index r = 0; r < rank && ridge > 0 && order > 1; ++r) {
                const double t2 = std::pow(fit.weights[r], 2 - 2 / static_cast<double>(order));
                if (ridge < t2 / epsilon) {
                    gram(r, r) += ridge / t2;
                } else {
                    gram.row(r).setZero();
                    gram.col(r).setZero();
                    right.col(r).setZero();
                }
            }
            RowMatrix factor = solve_gram(gram, right);
            fit.weights = normalise_columns(factor, factors[k]);
            factors[k] = std::move(factor);
            grams[k] = factors[k].transpose() * factors[k];
        }
        // |x - m|^2 = 1 - 2 <x, m> + |m|^2, with the rounding of terms up to (sum of weights)^2.
        const double total = fit.weights.sum();
        const double product = (matricised.array() * factors[order - 1].array()).colwise().sum().matrix() * fit.weights;
        double squared = 1 - 2 * product + fit.weights.dot(gram_product(grams, order) * fit.weights);
        if (squared < 1e5 * epsilon * (1 + total * total))
            squared = tensor.residual_squared(factors, fit.weights, scale);
        fit.error = std::sqrt(squared);
        fit.trace.push_back(fit.error);
        fit.iterations = sweep + 1;
        if (fit.error <= rounding_floor(order, options.rank, total)) {
            fit.stop = Stop::exact;
            break;
        }
        if (is_flat(fit.trace, tolerance)) {
            fit.stop = Stop::converged;
            break;
        }
    }
    return fit;
}

void store(const Fit& fit, const Normalised& input, const std::vector<std::size_t>& core, CpResult& result) {
    CpModel& model = result.model;
    model.factors.assign(fit.factors.begin(), fit.factors.end());
    model.weights = fit.weights;
    canonicalise(model);
    for (double& weight : model.weights) weight = input.restore(weight);
    CpReport& report = result.report;
    report.iterations = fit.iterations;
    report.stop = fit.stop;
    report.trace = fit.trace;
    report.core = core;
    report.degeneracy = degeneracy(model, input.restore(1));
}

CpResult cp_als(const Tensor& tensor, const CpOptions& options) {
    const auto begin = std::chrono::steady_clock::now();
    require_valid(options);
    const Normalised input(tensor);
    CpResult result;
    if (input.norm() == 0) {
        result = zero_result(tensor.shape, options);
    } else {
        const SplitTensor split(input.tensor().values.data(), tensor.shape);
        const Fit best = best_of(options.restarts.value_or(1), result.report, [&](int start) {
            return als_sweeps(split, 1 / input.norm(),
                              gaussian_factors(tensor.shape, options.rank, options.seed, start), options);
        });
        store(best, input, tensor.shape, result);
        result.report.relative_error = best.error;
    }
    result.report.solver = "als";
    result.report.ridge = options.ridge.value_or(0.0);
    result.report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return result;
}

}  // namespace medulla::tensor
