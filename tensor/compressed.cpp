// The fast solvers: solve on the core of a truncated HOSVD, then expand the factors with its bases.
// Bro & Andersson 1998: |x - m|^2 = |core - m_core|^2 + |x - core x bases|^2, so only the truncation is lost.
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>

#include "tensor/als.hpp"
#include "tensor/hosvd.hpp"
#include "tensor/lm.hpp"

namespace medulla::tensor {

namespace {

/// A core to solve on. Not movable, since `split` borrows the core's values.
struct Level {
    Hosvd hosvd;
    double norm;  ///< of the core
    SplitTensor split;
    explicit Level(Hosvd h)
        : hosvd(std::move(h)),
          norm(medulla::tensor::norm(hosvd.core)),
          split(hosvd.core.values.data(), hosvd.core.shape) {}
    Level(const Level&) = delete;
    Level& operator=(const Level&) = delete;

    double total_error(const Fit& fit, double tensor_norm) const {
        return std::hypot(fit.error * norm / tensor_norm, hosvd.error);
    }
};

/// Factors with the weights distributed evenly over the modes.
Factors balanced(const Fit& fit) {
    Factors factors = fit.factors;
    const double share = 1 / static_cast<double>(factors.size());
    for (RowMatrix& f : factors) f = f * fit.weights.array().pow(share).matrix().asDiagonal();
    return factors;
}

/// The same factors in the coordinates of other bases of the same space.
Factors changed_basis(Factors factors, const std::vector<Eigen::MatrixXd>& from,
                      const std::vector<Eigen::MatrixXd>& to) {
    for (std::size_t k = 0; k < factors.size(); ++k) factors[k] = (to[k].transpose() * (from[k] * factors[k])).eval();
    return factors;
}

/// Flips components whose inner product with the tensor is negative. @return the multiple of the model that is then the
/// closest to the tensor
double align_signs(const Level& level, Factors& factors) {
    const RowMatrix matricised = level.split.mode(level.split.down(factors, 1 / level.norm), factors, 0);
    Eigen::RowVectorXd products = (matricised.array() * factors[0].array()).colwise().sum();
    for (Eigen::Index r = 0; r < products.size(); ++r)
        if (products[r] < 0) factors[0].col(r) *= -1;
    Eigen::MatrixXd gram = Eigen::MatrixXd::Ones(products.size(), products.size());
    for (const RowMatrix& f : factors) gram.array() *= (f.transpose() * f).eval().array();
    return products.cwiseAbs().sum() / gram.sum();
}

/// About a fifth of the error of smooth tensors at this rank; if the error turns out smaller, a finer core follows.
double first_truncation(int rank) { return rank <= 16 ? 3e-3 : rank <= 48 ? 1e-3 : 2e-4; }

/// The steps of both compressed solvers: a first solve, then finer cores while the error is close to the truncation.
struct Recipe {
    double truncation;                                            ///< of the first core
    std::function<Fit(const Level&, CpReport&)> first;            ///< all starts
    std::function<Fit(const Level&, const Fit&, Factors)> again;  ///< continues on a finer core
};

CpResult solve_compressed(const Tensor& tensor, const CpOptions& options, const Recipe& recipe, const char* name) {
    const auto begin = std::chrono::steady_clock::now();
    require_valid(options);
    const Normalised input(tensor);
    CpResult result;
    CpReport& report = result.report;
    if (input.norm() == 0) {
        result = zero_result(tensor.shape, options);
    } else {
        double truncation = options.truncation.value_or(recipe.truncation);
        auto level = std::make_unique<Level>(truncated_hosvd(input.tensor(), truncation));
        Fit fit = recipe.first(*level, report);
        // A truncation of a fifth of the error adds a fiftieth to it.
        while (!options.truncation && truncation > finest_truncation &&
               level->total_error(fit, input.norm()) < 5 * truncation) {
            truncation = std::max(finest_truncation, truncation / 30);
            auto finer = std::make_unique<Level>(truncated_hosvd(input.tensor(), truncation));
            const int before = fit.iterations;
            std::vector<double> trace = std::move(fit.trace);
            fit = recipe.again(*finer, fit, changed_basis(balanced(fit), level->hosvd.bases, finer->hosvd.bases));
            trace.insert(trace.end(), fit.trace.begin(), fit.trace.end());
            fit.trace = std::move(trace);
            fit.iterations += before;
            level = std::move(finer);
        }
        for (std::size_t k = 0; k < fit.factors.size(); ++k)
            fit.factors[k] = (level->hosvd.bases[k] * fit.factors[k]).eval();
        fit.weights *= level->norm / input.norm();
        store(fit, input, level->hosvd.core.shape, result);
        report.truncation_error = level->hosvd.error;
        report.ridge = fit.ridge;
        report.relative_error = level->total_error(fit, input.norm());
        // Gram matrices resolve the truncation to 1e-8 at best: for small errors, evaluate explicitly.
        if (report.relative_error < 1e-5) report.relative_error = relative_error(tensor, result.model);
    }
    report.solver = name;
    report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return result;
}

}  // namespace

CpResult cp_als_compressed(const Tensor& tensor, const CpOptions& options) {
    Recipe recipe;
    recipe.truncation = first_truncation(options.rank);
    recipe.first = [&](const Level& level, CpReport& report) {
        return best_of(options.restarts.value_or(1), report, [&](int start) {
            return als_sweeps(level.split, 1 / level.norm,
                              gaussian_factors(level.hosvd.core.shape, options.rank, options.seed, start), options);
        });
    };
    recipe.again = [&](const Level& level, const Fit&, Factors start) {
        return als_sweeps(level.split, 1 / level.norm, std::move(start), options);
    };
    return solve_compressed(tensor, options, recipe, "compressed als");
}

CpResult cp_lm(const Tensor& tensor, const CpOptions& options) {
    const double tolerance = options.tolerance.value_or(1e-3);
    const int steps = options.max_sweeps.value_or(100);
    const auto solve = [&](const Level& level, Factors start, double ridge) {
        return lm_steps(level.split, 1 / level.norm, std::move(start), ridge, steps, tolerance);
    };
    Recipe recipe;
    recipe.truncation = first_truncation(options.rank);
    recipe.first = [&](const Level& level, CpReport& report) {
        const double ridge = options.ridge.value_or(options.rank < 32 ? 1e-5 : 1e-6);
        const int starts = options.restarts.value_or(options.rank <= 32 ? 2 : 1);
        Fit best = best_of(starts, report, [&](int start) {
            Factors factors = gaussian_factors(level.hosvd.core.shape, options.rank, options.seed, start);
            // Column lengths of `rank` equal orthogonal components whose sum has the norm of the tensor.
            for (RowMatrix& f : factors)
                f *= std::pow(options.rank, -0.5 / static_cast<double>(factors.size())) /
                     std::sqrt(static_cast<double>(f.rows()));
            const double gain = align_signs(level, factors);
            Fit fit = solve(level, factors, ridge);
            if (!(fit.error < 1)) {
                // Steps can end at the zero model, a saddle point, but not from a start closer to the tensor than 0.
                for (RowMatrix& f : factors) f *= std::pow(gain, 1 / static_cast<double>(factors.size()));
                fit = solve(level, std::move(factors), ridge);
            }
            return fit;
        });
        // If components still cancel, more ridge: a degenerate model is returned only on request.
        while (!options.ridge && best.weights.sum() > 10 && best.ridge < 0.1) {
            Fit next = solve(level, balanced(best), 4 * best.ridge);
            next.trace.insert(next.trace.begin(), best.trace.begin(), best.trace.end());
            next.iterations += best.iterations;
            best = std::move(next);
        }
        return best;
    };
    recipe.again = [&](const Level& level, const Fit& before, Factors start) {
        // Such a good fit allows a smaller ridge, as long as components do not start to cancel.
        double ridge = before.ridge;
        Fit fit = solve(level, std::move(start), ridge);
        while (!options.ridge && ridge > 0 && (fit.stop == Stop::converged || fit.stop == Stop::stalled)) {
            ridge = ridge > 1e-15 ? ridge / 100 : 0;
            Fit next = solve(level, balanced(fit), ridge);
            if (next.weights.sum() > 10 || next.error > 0.98 * fit.error) break;
            next.trace.insert(next.trace.begin(), fit.trace.begin(), fit.trace.end());
            next.iterations += fit.iterations;
            fit = std::move(next);
        }
        return fit;
    };
    return solve_compressed(tensor, options, recipe, "lm");
}

}  // namespace medulla::tensor
