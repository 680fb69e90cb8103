// Tensors that break CP solvers, and properties that must hold for every solver.
#include <omp.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "bench/stand_in.hpp"
#include "tensor/cp.hpp"
#include "tensor/hosvd.hpp"

using namespace medulla::tensor;

namespace {

constexpr double eps = std::numeric_limits<double>::epsilon();

struct Named {
    const char* name;
    CpResult (*solve)(const Tensor&, const CpOptions&);
};
const Named solvers[] = {{"als", cp_als}, {"compressed als", cp_als_compressed}, {"lm", cp_lm}};
const Named all_solvers[] = {
    {"als", cp_als}, {"compressed als", cp_als_compressed}, {"lm", cp_lm}, {"nonnegative", cp_nonnegative}};

Tensor random_tensor(const std::vector<std::size_t>& shape, unsigned seed) {
    std::mt19937_64 bits(seed);
    std::normal_distribution<double> normal;
    Tensor x(shape);
    for (double& v : x.values) v = normal(bits);
    return x;
}

/// Sum of `rank` outer products with factors drawn from N(mean, 1).
Tensor low_rank(const std::vector<std::size_t>& shape, int rank, unsigned seed, double mean = 0) {
    std::mt19937_64 bits(seed);
    std::normal_distribution<double> normal(mean);
    CpModel model;
    model.weights = Eigen::VectorXd::Ones(rank);
    for (std::size_t n : shape)
        model.factors.push_back(
            Eigen::MatrixXd::NullaryExpr(static_cast<Eigen::Index>(n), rank, [&] { return normal(bits); }));
    return expand(model);
}

/// Checks any result: finite, canonical, with the error of its model.
void check_whole(const Tensor& x, const CpResult& result, int rank) {
    CAPTURE(summary(result.report));
    REQUIRE(result.model.rank() == rank);
    REQUIRE(result.model.shape() == x.shape);
    CHECK(result.model.weights.allFinite());
    CHECK((result.model.weights.array() >= 0).all());
    for (int r = 0; r + 1 < rank; ++r) CHECK(result.model.weights[r] >= result.model.weights[r + 1]);
    for (const auto& f : result.model.factors) {
        CHECK(f.allFinite());
        // A length is a sum of up to 720 rounded squares.
        CHECK((f.colwise().norm().array() - 1).abs().maxCoeff() < 720 * eps);
    }
    // e^2 from the identity has rounding of a few eps (1 + norm_ratio^2), which is below 1e-5 e^2, or else subtracted
    // cell by cell. The discarded part of the HOSVD is known to 1e-8 and matters from 1e-5 up.
    const double truth = relative_error(x, result.model);
    CHECK(result.report.relative_error == Approx(truth).epsilon(1e-4).margin(1e-13));
}

}  // namespace

TEST_CASE("HOSVD has at most the requested error, with orthonormal bases, at every order", "[hosvd]") {
    for (const std::vector<std::size_t>& shape : std::vector<std::vector<std::size_t>>{
             {50}, {300}, {20, 90}, {90, 20}, {9, 100, 11}, {6, 7, 8, 150}, {4, 5, 6, 5, 4}, {1, 7, 1, 80}}) {
        Tensor x = low_rank(shape, 4, 2);
        const Tensor noise = random_tensor(shape, 3);
        const double level = 0.01 * norm(x) / norm(noise);
        for (std::size_t p = 0; p < x.size(); ++p) x.values[p] += level * noise.values[p];
        for (double bound : {0.3, 0.05, 1e-3, 0.0}) {
            const Hosvd h = truncated_hosvd(x, bound);
            Tensor back = h.core;
            for (std::size_t k = 0; k < shape.size(); ++k) {
                const Eigen::Index n = h.bases[k].cols();
                CHECK((h.bases[k].transpose() * h.bases[k] - Eigen::MatrixXd::Identity(n, n)).norm() <
                      1e-13 * static_cast<double>(n));
                back = multiply(back, h.bases[k], k);
            }
            for (std::size_t p = 0; p < x.size(); ++p) back.values[p] -= x.values[p];
            const double error = norm(back) / norm(x);
            CAPTURE(shape.size(), bound, h.error);
            CHECK(error <= std::max(bound, finest_truncation) * (1 + 1e-6));
            CHECK(error == Approx(h.error).epsilon(1e-6).margin(3e-8));  // 3e-8: about sqrt(eps), see hosvd.hpp
        }
    }
}

TEST_CASE("the fast solvers recover low-rank tensors to 1e-10, also at a higher rank", "[cp][stress]") {
    const Tensor x = low_rank({9, 8, 7, 70}, 5, 4);
    for (const Named& s : solvers)
        for (int rank : {5, 8}) {
            CpOptions options;
            options.rank = rank;
            options.max_sweeps = 2000;
            options.restarts = 2;
            options.tolerance = 1e-2;
            const CpResult result = s.solve(x, options);
            CAPTURE(s.name, rank, summary(result.report));
            CHECK(relative_error(x, result.model) < 1e-10);
            check_whole(x, result, rank);
        }
}

TEST_CASE("any order from 1 to 5, axes of one node, rank above every dimension", "[cp][stress]") {
    for (const std::vector<std::size_t>& shape : std::vector<std::vector<std::size_t>>{
             {1}, {6}, {5, 4}, {1, 1}, {3, 4, 5}, {1, 5, 4}, {4, 1, 5, 1}, {1, 1, 1, 9}, {3, 2, 4, 2, 3}}) {
        const Tensor x = random_tensor(shape, 6);
        for (const Named& s : all_solvers)
            for (int rank : {1, 2, 24}) {
                CpOptions options;
                options.rank = rank;
                options.max_sweeps = 40;
                const CpResult result = s.solve(x, options);
                CAPTURE(s.name, shape.size(), rank);
                check_whole(x, result, rank);
                if (s.solve != cp_nonnegative) CHECK(result.report.relative_error < 1);
            }
    }
}

TEST_CASE("zero tensor, zero slices, duplicate slices", "[cp][stress]") {
    for (const Named& s : all_solvers) {
        CAPTURE(s.name);
        CpOptions options;
        options.rank = 3;
        const Tensor zero({4, 3, 5});
        const CpResult nothing = s.solve(zero, options);
        CHECK(nothing.report.stop == Stop::zero_tensor);
        CHECK(nothing.report.relative_error == 0);
        CHECK(nothing.model.weights.isZero(0));
        CHECK(norm(expand(nothing.model)) == 0);

        Tensor x = low_rank({6, 7, 8}, 3, 5, 2.0);
        for (std::size_t j = 0; j < 7; ++j)
            for (std::size_t k = 0; k < 8; ++k) {
                x({2, j, k}) = 0;
                x({4, j, k}) = x({1, j, k});
            }
        options.max_sweeps = 300;
        const CpResult result = s.solve(x, options);
        check_whole(x, result, 3);
        // A zero slice gets zero rows, a duplicate slice equal rows, up to the rounding of a solve whose Gram matrices
        // have condition numbers up to 1e6 here, times the truncation where there is one.
        const Eigen::MatrixXd& f = result.model.factors[0];
        CHECK(f.row(2).norm() < 1e-6);
        CHECK((f.row(4) - f.row(1)).norm() < 1e-6);
    }
}

TEST_CASE("scales from 1e-170 to 1e170 give the same model, scaled", "[cp][stress]") {
    const Tensor x = low_rank({6, 5, 7}, 6, 7);
    for (const Named& s : all_solvers) {
        CpOptions options;
        options.rank = 4;
        options.max_sweeps = 60;
        const CpResult plain = s.solve(x, options);
        for (int exponent : {-1000, -565, 565, 1000}) {  // 1e170 = 2^565
            const CpResult other = s.solve(scaled(x, exponent), options);
            CAPTURE(s.name, exponent);
            // A power of two is exact and changes nothing else.
            CHECK(other.report.relative_error == Approx(plain.report.relative_error).epsilon(1e-12));
            for (int r = 0; r < 4; ++r)
                CHECK(std::ldexp(other.model.weights[r], -exponent) == Approx(plain.model.weights[r]).epsilon(1e-9));
        }
        Tensor decimal = x;
        for (double scale : {1e-170, 1e170}) {
            for (std::size_t p = 0; p < x.size(); ++p) decimal.values[p] = x.values[p] * scale;
            check_whole(decimal, s.solve(decimal, options), 4);
        }
    }
}

TEST_CASE("a border-rank tensor: plain ALS diverges and reports it, a ridge bounds it", "[cp][stress]") {
    // de Silva & Lim 2008: a a b + a b a + b a a has rank 3, and rank-2 models come arbitrarily close by cancellation.
    Tensor x({2, 2, 2});
    x({0, 0, 1}) = x({0, 1, 0}) = x({1, 0, 0}) = 1;
    CpOptions options;
    options.rank = 2;
    options.max_sweeps = 30000;
    options.tolerance = 0;
    const CpResult plain = cp_als(x, options);
    CAPTURE(summary(plain.report));
    CHECK(plain.report.stop == Stop::sweeps);
    CHECK(plain.report.degenerate());
    CHECK(plain.report.degeneracy.least_cosine < -0.9);
    CHECK_THAT(summary(plain.report), Catch::Contains("degenerate"));
    for (const Named& s : solvers) {
        options.ridge = 1e-3;
        const CpResult bounded = s.solve(x, options);
        CAPTURE(s.name, summary(bounded.report));
        // F <= 1/2 at the zero model bounds the model: sum of ridge |factor|^2 <= 1 allows weights up to (1e3/3)^1.5.
        // The minimum is where penalty and error balance.
        CHECK_FALSE(bounded.report.degenerate());
        CHECK(bounded.report.relative_error < 0.2);
    }
    options.ridge.reset();
    CHECK_FALSE(cp_lm(x, options).report.degenerate());
}

TEST_CASE("heavy noise: no solver is worse than the zero model, no error rises", "[cp][stress]") {
    Tensor x = low_rank({8, 9, 10, 30}, 3, 9);
    const Tensor noise = random_tensor(x.shape, 10);
    const double level = 3 * norm(x) / norm(noise);
    for (std::size_t p = 0; p < x.size(); ++p) x.values[p] += level * noise.values[p];
    for (const Named& s : all_solvers) {
        CpOptions options;
        options.rank = 8;
        options.max_sweeps = 80;
        const CpResult result = s.solve(x, options);
        CAPTURE(s.name);
        check_whole(x, result, 8);
        CHECK(result.report.relative_error < 1);
        // Sweeps without a ridge lower the error itself; LM lowers error plus penalty, which is 1e-5 times a sum of
        // squares, 4 sum w^(1/2) < 4 * 8 for weights below 1.
        const double slack = s.solve == cp_lm ? 1e-5 * 32 : 1e-12;
        for (std::size_t i = 1; i < result.report.trace.size(); ++i)
            CHECK(result.report.trace[i] <= result.report.trace[i - 1] + slack);
    }
}

TEST_CASE("every solver refuses a cell that is not finite, with its index", "[cp][stress]") {
    Tensor x = low_rank({5, 4, 6}, 2, 12);
    for (const Named& s : all_solvers)
        for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
            CAPTURE(s.name, bad);
            x({3, 1, 4}) = bad;
            CHECK_THROWS_WITH(s.solve(x, {}), Catch::Contains("[3, 1, 4]") &&
                                                  Catch::Contains(std::isnan(bad) ? "not a number" : "infinite"));
        }
}

TEST_CASE("a temporary plateau (swamp) does not end ALS", "[cp][stress]") {
    // Nearly collinear factors: ALS stays at a nearly constant error for hundreds of sweeps before it converges.
    std::mt19937_64 bits(3);
    std::normal_distribution<double> normal;
    CpModel model;
    model.weights = Eigen::VectorXd::Ones(3);
    for (int k = 0; k < 3; ++k) {
        Eigen::MatrixXd f(8, 3);
        for (int i = 0; i < 8; ++i) {
            f(i, 0) = normal(bits);
            for (int r = 1; r < 3; ++r) f(i, r) = f(i, 0) + 0.3 * normal(bits);
        }
        model.factors.push_back(f);
    }
    const Tensor x = expand(model);
    CpOptions options;
    options.rank = 3;
    options.max_sweeps = 20000;
    for (const Named& s : solvers) {
        const CpResult through = s.solve(x, options);
        CAPTURE(s.name, summary(through.report));
        CHECK(through.report.relative_error < 1e-10);
    }
    const CpResult result = cp_als(x, options);
    // There is a plateau: at some sweep after the 20th the error fell by less than 1 % over ten sweeps.
    const auto& t = result.report.trace;
    bool plateau = false;
    for (std::size_t i = 20; i + 10 < t.size(); ++i) plateau |= t[i] > 1e-6 && t[i + 10] > 0.99 * t[i];
    CHECK(plateau);
}

TEST_CASE("nonnegative: every factor is >= 0, and a nonnegative tensor is recovered", "[cp][stress]") {
    std::mt19937_64 bits(4);
    std::exponential_distribution<double> positive;
    CpModel model;
    model.weights = Eigen::VectorXd::Ones(3);
    for (int n : {8, 9, 10})
        model.factors.push_back(Eigen::MatrixXd::NullaryExpr(n, 3, [&] { return positive(bits); }));
    const Tensor x = expand(model);
    CpOptions options;
    options.rank = 3;
    options.max_sweeps = 3000;
    options.restarts = 3;
    const CpResult result = cp(x, Solver::nonnegative, options);
    for (const auto& f : result.model.factors) CHECK(f.minCoeff() >= 0);
    CAPTURE(summary(result.report));
    CHECK(result.report.relative_error < 1e-3);
    // Components of one sign cannot cancel: |sum|^2 >= sum of squares >= (sum of norms)^2 / rank.
    CHECK(result.report.degeneracy.norm_ratio <= std::sqrt(3.0) * (1 + result.report.relative_error));
}

TEST_CASE("the stand-in table: LM beats ALS, ranks 1 to 96, components do not cancel", "[cp][stress]") {
    const Tensor table = single_scattering_table(10, 8, 8, 180);
    double last = 1;
    for (int rank : {1, 4, 16, 48, 96}) {
        CpOptions options;
        options.rank = rank;
        options.max_sweeps = 50;
        const CpResult lm = cp(table, Solver::lm, options);
        check_whole(table, lm, rank);
        CAPTURE(rank, summary(lm.report));
        CHECK(lm.report.relative_error < last);
        CHECK_FALSE(lm.report.degenerate());
        last = lm.report.relative_error;
        if (rank != 16) continue;
        options.max_sweeps = 300;
        const CpResult als = cp(table, Solver::als, options), full = cp_als(table, options);
        check_whole(table, als, rank);
        CHECK(lm.report.relative_error < std::min(als.report.relative_error, full.report.relative_error));
    }
}

TEST_CASE("the fast solvers give the same bytes for 1, 2 and 5 threads", "[cp][stress]") {
    const Tensor table = single_scattering_table(10, 8, 16, 360);
    const int threads = omp_get_max_threads();
    for (const Named& s : all_solvers) {
        CpOptions options;
        options.rank = 24;
        options.max_sweeps = 5;
        options.restarts = 1;
        std::vector<CpResult> results;
        for (int n : {1, 2, 5}) {
            omp_set_num_threads(n);
            results.push_back(s.solve(table, options));
        }
        omp_set_num_threads(threads);
        CAPTURE(s.name);
        for (const CpResult& r : results) {
            CHECK(r.model.weights == results[0].model.weights);
            for (std::size_t k = 0; k < 4; ++k) CHECK(r.model.factors[k] == results[0].model.factors[k]);
        }
    }
}
