// CP with every factor >= 0: coordinate descent column by column (HALS), with MTTKRPs on a HOSVD core.
// Cichocki & Phan 2009, "Fast local algorithms for large scale nonnegative matrix and tensor factorizations".
#include <chrono>
#include <cmath>
#include <limits>

#include "tensor/als.hpp"
#include "tensor/hosvd.hpp"

namespace medulla::tensor {

namespace {

/// Sweeps from nonnegative factors on core x bases, a tensor of norm 1 / scale. A column update is the exact minimum
/// over that column, so the error never rises.
Fit hals_sweeps(const Hosvd& hosvd, double scale, Factors start, const CpOptions& options) {
    const std::size_t order = start.size();
    const int max_sweeps = options.max_sweeps.value_or(500);
    const double tolerance = options.tolerance.value_or(1e-4), ridge = options.ridge.value_or(0.0);
    const SplitTensor core(hosvd.core.values.data(), hosvd.core.shape);
    Fit fit;
    fit.factors = std::move(start);
    Factors& factors = fit.factors;
    Factors inside(order);  // in the coordinates of the core
    std::vector<Eigen::MatrixXd> grams(order);
    const auto refresh = [&](std::size_t k) {
        inside[k] = hosvd.bases[k].transpose() * factors[k];
        grams[k] = factors[k].transpose() * factors[k];
    };
    const Eigen::Index rank = factors[0].cols();
    for (std::size_t k = 0; k < order; ++k) {
        normalise_columns(factors[k], factors[k]);
        if (k + 1 == order) factors[k] *= 1 / static_cast<double>(rank);
        refresh(k);
    }
    fit.weights = Eigen::VectorXd::Ones(rank);
    RowMatrix side;
    for (int sweep = 0; sweep < max_sweeps; ++sweep) {
        double product = 0;
        Eigen::MatrixXd gram;
        for (std::size_t k = 0; k < order; ++k) {
            if (k == 0) side = core.down(inside, scale);
            if (k == core.split()) side = core.across(inside, scale);
            const RowMatrix right = hosvd.bases[k] * core.mode(side, inside, k);
            gram = Eigen::MatrixXd::Ones(rank, rank);
            for (std::size_t m = 0; m < order; ++m)
                if (m != k) gram.array() *= grams[m].array();
            for (int pass = 0; pass < 3; ++pass)  // cheap compared with the MTTKRP
                for (Eigen::Index r = 0; r < rank; ++r) {
                    const double curvature = gram(r, r) + ridge;
                    if (!(curvature > 0)) continue;  // a vanished component
                    factors[k].col(r) =
                        (factors[k].col(r) +
                         (right.col(r) - factors[k] * gram.col(r) - ridge * factors[k].col(r)) / curvature)
                            .cwiseMax(0);
                }
            refresh(k);
            product = (right.array() * factors[k].array()).sum();
        }
        gram.array() *= grams[order - 1].array();
        // Balanced columns minimise the ridge and keep the Gram matrices well scaled.
        for (Eigen::Index r = 0; r < rank; ++r) {
            double log_mean = 0;
            for (const RowMatrix& f : factors) log_mean += std::log(f.col(r).norm()) / static_cast<double>(order);
            if (std::isfinite(log_mean))
                for (RowMatrix& f : factors) f.col(r) *= std::exp(log_mean) / f.col(r).norm();
        }
        for (std::size_t k = 0; k < order; ++k) refresh(k);
        // Components cannot cancel, so terms are of order 1: below 1e-7 their difference is rounding.
        fit.error = std::sqrt(std::max(0.0, 1 - 2 * product + gram.sum()));
        fit.trace.push_back(fit.error);
        fit.iterations = sweep + 1;
        if (fit.error < finest_truncation) {
            fit.stop = Stop::exact;
            break;
        }
        if (is_flat(fit.trace, tolerance)) {
            fit.stop = Stop::converged;
            break;
        }
    }
    for (RowMatrix& f : factors) {
        const Eigen::VectorXd norms = f.colwise().norm();
        fit.weights.array() *= norms.array();
        normalise_columns(f, f);
    }
    return fit;
}

}  // namespace

CpResult cp_nonnegative(const Tensor& tensor, const CpOptions& options) {
    const auto begin = std::chrono::steady_clock::now();
    require_valid(options);
    const Normalised input(tensor);
    CpResult result;
    if (input.norm() == 0) {
        result = zero_result(tensor.shape, options);
    } else {
        const Hosvd hosvd = truncated_hosvd(input.tensor(), options.truncation.value_or(1e-4));
        const double core_norm = norm(hosvd.core);
        Fit best = best_of(options.restarts.value_or(1), result.report, [&](int start) {
            Factors factors = gaussian_factors(tensor.shape, options.rank, options.seed, start);
            for (RowMatrix& f : factors) f = f.cwiseAbs();
            return hals_sweeps(hosvd, 1 / core_norm, std::move(factors), options);
        });
        best.weights *= core_norm / input.norm();
        store(best, input, hosvd.core.shape, result);
        result.report.truncation_error = hosvd.error;
        // The discarded part is not orthogonal to nonnegative factors, so the error is evaluated explicitly.
        result.report.relative_error = relative_error(tensor, result.model);
    }
    result.report.solver = "nonnegative";
    result.report.ridge = options.ridge.value_or(0.0);
    result.report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return result;
}

}  // namespace medulla::tensor
