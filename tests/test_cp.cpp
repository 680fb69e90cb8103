// CP models and plain ALS: properties of every solve, for any tensor.
#include <omp.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "tensor/cp.hpp"
#include "tensor/mttkrp.hpp"

using namespace medulla::tensor;

namespace {

constexpr double eps = std::numeric_limits<double>::epsilon();

CpModel random_model(const std::vector<std::size_t>& shape, int rank, unsigned seed) {
    std::mt19937_64 bits(seed);
    std::normal_distribution<double> normal;
    CpModel model;
    model.weights = Eigen::VectorXd::Ones(rank);
    for (std::size_t n : shape)
        model.factors.push_back(
            Eigen::MatrixXd::NullaryExpr(static_cast<Eigen::Index>(n), rank, [&] { return normal(bits); }));
    return model;
}

/// Sum of outer products by its definition, cell by cell.
double cell(const CpModel& model, const std::vector<std::size_t>& index) {
    double sum = 0;
    for (Eigen::Index r = 0; r < model.weights.size(); ++r) {
        double term = model.weights[r];
        for (std::size_t k = 0; k < index.size(); ++k) term *= model.factors[k](static_cast<Eigen::Index>(index[k]), r);
        sum += term;
    }
    return sum;
}

std::vector<std::size_t> unravel(const std::vector<std::size_t>& shape, std::size_t position) {
    std::vector<std::size_t> index(shape.size());
    for (std::size_t k = shape.size(); k-- > 0; position /= shape[k]) index[k] = position % shape[k];
    return index;
}

const std::vector<std::vector<std::size_t>> shapes = {{9}, {7, 70}, {5, 6, 7}, {4, 3, 5, 300}, {3, 4, 2, 5, 6}};

}  // namespace

TEST_CASE("cells and norm of a tensor at any scale", "[tensor]") {
    Tensor t({2, 3, 4});
    CHECK(t.size() == 24);
    t({1, 2, 3}) = 5;
    CHECK(t.values[23] == 5);
    CHECK(index_text(t.shape, 23) == "[1, 2, 3]");
    t({0, 1, 0}) = 12;
    for (int e : {-1060, -500, 0, 500, 1019})  // 13 2^e: from denormal to the largest
        CHECK(norm(scaled(t, e)) == std::ldexp(13.0, e));
    CHECK(norm(Tensor({3, 1})) == 0);
    CHECK_THROWS_AS(Tensor({2, 0}), std::invalid_argument);
    CHECK_THROWS_AS(Tensor(std::vector<std::size_t>{}), std::invalid_argument);
    t.values.pop_back();
    CHECK_THROWS_WITH(require_valid(t), Catch::Contains("24 cells"));
}

TEST_CASE("expand is the sum of outer products, and the MTTKRP its gradient", "[cp]") {
    for (const auto& shape : shapes) {
        const CpModel model = random_model(shape, 4, 11);
        const Tensor x = expand(model);
        REQUIRE(x.shape == shape);
        double worst = 0, largest = max_abs(x);
        for (std::size_t p = 0; p < x.size(); ++p)
            worst = std::max(worst, std::abs(x.values[p] - cell(model, unravel(shape, p))));
        CHECK(worst <= 64 * eps * largest);  // a few dozen roundings of terms near the largest

        const CpModel other = random_model(shape, 3, 12);
        const Factors factors(other.factors.begin(), other.factors.end());
        const SplitTensor split(x.values.data(), shape);
        RowMatrix side = split.down(factors, 2.0);
        for (std::size_t k = 0; k < shape.size(); ++k) {
            if (k == split.split()) side = split.across(factors, 2.0);
            const RowMatrix fast = split.mode(side, factors, k);
            Eigen::MatrixXd slow = Eigen::MatrixXd::Zero(fast.rows(), fast.cols()), magnitude = slow;
            for (std::size_t p = 0; p < x.size(); ++p) {
                const auto index = unravel(shape, p);
                for (Eigen::Index r = 0; r < slow.cols(); ++r) {
                    double term = 2 * x.values[p];
                    for (std::size_t m = 0; m < shape.size(); ++m)
                        if (m != k) term *= other.factors[m](static_cast<Eigen::Index>(index[m]), r);
                    slow(static_cast<Eigen::Index>(index[k]), r) += term;
                    magnitude(static_cast<Eigen::Index>(index[k]), r) += std::abs(term);
                }
            }
            // Either sum of n terms is within n eps of the sum of magnitudes.
            const double n = static_cast<double>(x.size() / shape[k]);
            CHECK(((fast - slow).cwiseAbs().array() <= 2 * n * eps * magnitude.array()).all());
        }
        const double explicit_squared = split.residual_squared(factors, Eigen::VectorXd::Zero(3),
                                                               1.0);  // of the zero model: the norm of the tensor
        CHECK(std::sqrt(explicit_squared) == Approx(norm(x)).epsilon(1e-13));
    }
}

TEST_CASE("canonical form: unit columns, descending weights, signs by rule, same tensor", "[cp]") {
    CpModel model = random_model({5, 4, 6}, 4, 3);
    model.weights << -2, 3, 0, -1;
    const Tensor before = expand(model);
    canonicalise(model);
    CHECK(relative_error(before, model) < 32 * eps);
    for (const auto& factor : model.factors)
        for (Eigen::Index r = 0; r < 4; ++r) CHECK(factor.col(r).norm() == Approx(1).epsilon(8 * eps));
    for (Eigen::Index r = 0; r + 1 < 4; ++r) CHECK(model.weights[r] >= model.weights[r + 1]);
    CHECK(model.weights[3] == 0);
    for (std::size_t k = 0; k < 2; ++k)
        for (Eigen::Index r = 0; r < 4; ++r)
            CHECK(model.factors[k].col(r).maxCoeff() == model.factors[k].col(r).cwiseAbs().maxCoeff());
    const CpModel once = model;
    canonicalise(model);
    CHECK((model.weights - once.weights).norm() <= 32 * eps * once.weights.norm());
}

TEST_CASE("degeneracy: cosines and norms of known components", "[cp]") {
    CpModel model;
    model.weights = Eigen::Vector2d(3, 2);
    Eigen::MatrixXd same = Eigen::MatrixXd::Zero(2, 2), turned(2, 2);
    same.row(0).setOnes();
    turned << 1, -0.6, 0, 0.8;
    model.factors = {same, turned};
    const Degeneracy d = degeneracy(model, 2.5);
    CHECK(d.least_cosine == Approx(-0.6));
    CHECK(d.norm_ratio == Approx(2.0));
    CHECK(degeneracy(model, 0.4).norm_ratio == Approx(12.5));
}

TEST_CASE("ALS recovers a synthetic rank-5 tensor to 1e-10 for orders 2 to 5", "[cp][als]") {
    for (const std::vector<std::size_t>& shape :
         std::vector<std::vector<std::size_t>>{{12, 30}, {8, 9, 10}, {7, 6, 8, 50}, {5, 6, 5, 6, 7}}) {
        const Tensor x = expand(random_model(shape, 5, 5));
        CpOptions options;
        options.rank = 5;
        options.restarts = 3;
        options.max_sweeps = 2000;
        options.tolerance = 1e-3;
        const CpResult result = cp_als(x, options);
        CAPTURE(shape.size(), summary(result.report));
        CHECK(result.report.relative_error < 1e-10);
        CHECK(relative_error(x, result.model) < 1e-10);
        CHECK(result.report.starts.size() == 3);
        CHECK(result.report.iterations == static_cast<int>(result.report.trace.size()));
        CHECK((result.report.stop == Stop::exact || result.report.stop == Stop::converged));
    }
}

TEST_CASE("ALS: the error never rises and the report is correct", "[cp][als]") {
    Tensor x = expand(random_model({8, 9, 10, 11}, 12, 8));
    std::mt19937_64 bits(9);
    std::normal_distribution<double> normal;
    for (double& v : x.values) v += normal(bits);
    for (double ridge : {0.0, 1e-5}) {
        CpOptions options;
        options.rank = 10;
        options.max_sweeps = 60;
        options.ridge = ridge;
        const CpResult result = cp_als(x, options);
        CHECK(result.report.relative_error == Approx(relative_error(x, result.model)).epsilon(1e-8));
        CHECK(result.report.trace.back() == result.report.relative_error);
        // With a ridge the sum of error and penalty falls; the error may rise by at most the penalty.
        const double slack = ridge == 0 ? 1e-12 : ridge * 4 * 10;
        for (std::size_t i = 1; i < result.report.trace.size(); ++i)
            CHECK(result.report.trace[i] <= result.report.trace[i - 1] + slack);
        CHECK(result.report.ridge == ridge);
        CHECK_FALSE(summary(result.report).empty());
    }
}

TEST_CASE("same bytes for 1, 2 and 5 threads, different starts for different seeds", "[cp][als]") {
    Tensor x = expand(random_model({20, 9, 10, 110}, 6, 8));
    CpOptions options;
    options.rank = 4;
    options.max_sweeps = 8;
    const int threads = omp_get_max_threads();
    std::vector<CpResult> results;
    for (int n : {1, 2, 5}) {
        omp_set_num_threads(n);
        results.push_back(cp_als(x, options));
    }
    omp_set_num_threads(threads);
    for (const CpResult& r : results) {
        CHECK(r.model.weights == results[0].model.weights);
        for (std::size_t k = 0; k < 4; ++k) CHECK(r.model.factors[k] == results[0].model.factors[k]);
        CHECK(r.report.trace == results[0].report.trace);
    }
    options.seed = 2;
    CHECK(cp_als(x, options).model.weights != results[0].model.weights);
}

TEST_CASE("invalid tensors and options out of range are refused by name", "[cp]") {
    Tensor x = expand(random_model({3, 4, 5}, 2, 1));
    x({2, 0, 4}) = std::nan("");
    CHECK_THROWS_WITH(cp_als(x, {}), Catch::Contains("[2, 0, 4]") && Catch::Contains("not a number"));
    x({2, 0, 4}) = -INFINITY;
    CHECK_THROWS_WITH(cp_als(x, {}), Catch::Contains("[2, 0, 4]") && Catch::Contains("infinite"));
    x({2, 0, 4}) = 0;
    CpOptions options;
    options.rank = 0;
    CHECK_THROWS_WITH(cp_als(x, options), Catch::Contains("rank 0"));
    options = {};
    options.ridge = -1;
    CHECK_THROWS_AS(cp_als(x, options), std::invalid_argument);
}
