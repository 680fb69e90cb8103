// The matrix product of the CP solvers against its definition, for every instruction set.
#include <catch2/catch.hpp>
#include <limits>
#include <random>

#include "sim2d/tracer/kernel.hpp"  // selects the instruction set of everything that Highway dispatches
#include "tensor/product.hpp"

using namespace medulla::tensor;

namespace {

using ColumnMatrix = Eigen::MatrixXd;

template <class Matrix>
Matrix random_matrix(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
    std::mt19937_64 bits(seed);
    std::uniform_real_distribution<double> even(-1, 1);
    return Matrix::NullaryExpr(rows, columns, [&] { return even(bits); });
}

/// |c - (a b + before)| within the rounding of `inner` products and sums, for any order or fusion.
template <class A, class B>
void check(const A& a, const B& b, const RowMatrix& before, const RowMatrix& c) {
    const double eps = std::numeric_limits<double>::epsilon();
    bool good = true;
    for (Eigen::Index i = 0; i < c.rows(); ++i)
        for (Eigen::Index j = 0; j < c.cols(); ++j) {
            long double sum = before(i, j), size = std::abs(before(i, j));
            for (Eigen::Index k = 0; k < a.cols(); ++k) {
                const long double term = static_cast<long double>(a(i, k)) * b(k, j);
                sum += term, size += std::abs(term);
            }
            good = good && std::abs(c(i, j) - sum) <= (static_cast<double>(a.cols()) + 1) * eps * size;
        }
    CHECK(good);
}

}  // namespace

TEST_CASE("Products of any shape and storage agree with the definition, on every instruction set", "[cp][product]") {
    for (const std::string& target : medulla::sim2d::tracer_targets()) {
        medulla::sim2d::set_tracer_target(target);
        for (const Eigen::Index rows : {1, 5, 6, 13})
            for (const Eigen::Index inner : {0, 1, 7, 40})
                for (const Eigen::Index columns : {1, 3, 8, 31, 33, 70}) {
                    CAPTURE(target, rows, inner, columns);
                    const RowMatrix a = random_matrix<RowMatrix>(rows, inner, 1);
                    const RowMatrix b = random_matrix<RowMatrix>(inner, columns, 2);
                    const ColumnMatrix a_columns = a, b_columns = b;
                    const RowMatrix a_turned = a.transpose(), b_turned = b.transpose();
                    const RowMatrix zero = RowMatrix::Zero(rows, columns);
                    check(a, b, zero, multiplied(a, b));
                    check(a, b, zero, multiplied(a_columns, b_columns));
                    check(a, b, zero, multiplied(a_turned.transpose(), b_turned.transpose()));
                    // Into a block of a larger matrix, whose other entries are unchanged.
                    RowMatrix wide = random_matrix<RowMatrix>(rows + 2, columns + 3, 3);
                    const RowMatrix old = wide;
                    add_product(a, b, wide.block(1, 2, rows, columns));
                    check(a, b, old.block(1, 2, rows, columns), wide.block(1, 2, rows, columns));
                    wide.block(1, 2, rows, columns) = old.block(1, 2, rows, columns);
                    CHECK(wide == old);
                }
    }
    medulla::sim2d::set_tracer_target("");
}

TEST_CASE("Vectors of any width with fused multiply-add give the same product", "[cp][product]") {
    const RowMatrix a = random_matrix<RowMatrix>(50, 90, 4), b = random_matrix<RowMatrix>(90, 61, 5);
    std::vector<RowMatrix> found;
    for (const std::string& target : medulla::sim2d::tracer_targets()) {
        if (target.rfind("AVX", 0) != 0) continue;
        medulla::sim2d::set_tracer_target(target);
        found.push_back(multiplied(a, b));
    }
    medulla::sim2d::set_tracer_target("");
    for (const RowMatrix& other : found) CHECK(other == found[0]);
}
