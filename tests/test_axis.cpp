// The axis type, its mapping pair and its splines, shared by the runtime and the offline programs.
#include <catch2/catch.hpp>
#include <cmath>

#include "medulla/axis.hpp"
#include "tables/error.hpp"
#include "tables/pack/spline.hpp"
#include "tables/table/axis.hpp"

using namespace medulla;
using namespace medulla::tables;

TEST_CASE("locate and position are inverse, and values outside are clamped", "[axis]") {
    const Spline open({0, 0.1, 0.5, 2, 3.5});
    for (double x = 0; x <= 3.5; x += 0.01) {
        const Cell<double> cell = locate(open.view(), x);
        CHECK(position(cell) == x);
        CHECK((open.view().knot(static_cast<int>(cell.span)).t <= x &&
               x <= open.view().knot(static_cast<int>(cell.span) + 1).t));
    }
    CHECK(locate(open.view(), -7.0).x == 0);
    CHECK((locate(open.view(), 9.0).x == 3.5 && locate(open.view(), 9.0).span == 3));
    CHECK(std::isnan(locate(open.view(), std::nan("")).x));
}

TEST_CASE("Spline weights are non-negative and sum to 1", "[axis]") {
    const Spline spline({0, 0.1, 0.5, 2, 3.5});
    for (double x = 0; x <= 3.5; x += 0.007) {
        const SplineWeights<double> w = spline_weights(spline.view(), locate(spline.view(), x));
        double sum = 0;
        for (const double v : w.w) {
            CHECK(v >= -1e-16);
            sum += v;
        }
        CHECK(sum == Approx(1).epsilon(1e-14));
    }
}

TEST_CASE("A spline through nodes reproduces its nodes, and polynomials of its degree", "[axis]") {
    for (const std::vector<double>& nodes :
         {std::vector<double>{0.3}, {0, 1}, {0, 0.2, 1}, {0, 0.1, 0.4, 1}, {0, 0.1, 0.4, 1, 2, 2.5}}) {
        const Spline spline = Spline::through(Quantity::g, nodes);
        const int degree = std::min<int>(3, static_cast<int>(nodes.size()) - 1);
        Eigen::VectorXd values(static_cast<Eigen::Index>(nodes.size()));
        const auto f = [&](double x) { return std::pow(x - 0.7, degree) + 1; };
        for (std::size_t i = 0; i < nodes.size(); ++i) values[static_cast<Eigen::Index>(i)] = f(nodes[i]);
        const Eigen::VectorXd coefficients = spline.from_nodes() * values;
        for (double x = nodes.front(); x <= nodes.back(); x += 0.05)
            // Knots are rounded to float, so a node differs from its knot by 2^-24; the polynomial itself is exact.
            CHECK(spline.basis(x).dot(coefficients) == Approx(f(x)).margin(1e-6));
    }
}

TEST_CASE("Mirrored splines are even or odd about their ends, and include every such cubic spline", "[axis]") {
    const Spline spline({0, 0.1, 0.5, 1.2, 2});
    for (const Mirror mirror : {Mirror::even, Mirror::odd})
        for (const bool both : {false, true}) {
            const Eigen::MatrixXd free = spline.mirrored(mirror, both);
            // Continuity of two derivatives gives one condition at an even end and two at an odd one.
            CHECK(free.cols() == spline.size() - (mirror == Mirror::even ? 1 : 2) * (both ? 2 : 1));
            const Eigen::VectorXd c = free * Eigen::VectorXd::LinSpaced(free.cols(), 1, -2);
            const auto f = [&](double x) { return spline.basis(x).dot(c); };
            for (const double end : both ? std::vector<double>{0, 2} : std::vector<double>{0}) {
                const double inward = end == 0 ? 1 : -1, step = 1e-3;
                const double f0 = f(end), f1 = f(end + inward * step), f2 = f(end + inward * 2 * step),
                             f3 = f(end + inward * 3 * step);
                // Exact for cubics up to rounding, 1e-16 / step^2; knots are rounded to float, 6e-8 of a slope.
                if (mirror == Mirror::even)
                    CHECK((-11 * f0 + 18 * f1 - 9 * f2 + 2 * f3) / (6 * step) == Approx(0).margin(1e-5));
                if (mirror == Mirror::odd) CHECK(f0 == Approx(0).margin(1e-6));
                if (mirror == Mirror::odd)
                    CHECK((2 * f0 - 5 * f1 + 4 * f2 - f3) / (step * step) == Approx(0).margin(1e-4));
            }
        }
}

TEST_CASE("A spline through nodes of an even or odd function is even or odd", "[axis]") {
    for (const std::vector<double>& nodes : {std::vector<double>{0, 1}, {0, 0.4, 1}, {0, 0.2, 0.5, 0.8, 1}}) {
        for (const Mirror mirror : {Mirror::even, Mirror::odd}) {
            const Spline spline = Spline::through(Quantity::g, nodes, mirror);
            Eigen::VectorXd values(static_cast<Eigen::Index>(nodes.size()));
            const auto f = [&](double x) { return mirror == Mirror::even ? 2 - 0.7 * x * x : 1.3 * x; };
            for (std::size_t i = 0; i < nodes.size(); ++i) values[static_cast<Eigen::Index>(i)] = f(nodes[i]);
            const Eigen::VectorXd c = spline.from_nodes() * values;
            for (double x = 0; x <= 1; x += 0.05) CHECK(spline.basis(x).dot(c) == Approx(f(x)).margin(1e-6));
        }
    }
}

TEST_CASE("Bin averages of a spline are its exact averages", "[axis]") {
    const Spline spline({-3, -1, -0.5, 0.25, 1, 3});
    const Eigen::VectorXd c = Eigen::VectorXd::LinSpaced(spline.size(), 1, 2);
    std::vector<double> edges;
    for (int b = 0; b <= 12; ++b) edges.push_back(-3 + 0.5 * b);
    const Eigen::VectorXd averages = spline.averages(edges) * c;
    for (int b = 0; b < 12; ++b) {
        double sum = 0;
        const int n = 2000;
        for (int i = 0; i < n; ++i) sum += spline.basis(-3 + 0.5 * (b + (i + 0.5) / n)).dot(c) / n;
        CHECK(averages[b] == Approx(sum).epsilon(1e-6));  // midpoint rule: (0.5 / 2000)^2
    }
    CHECK(averages.mean() * 6 == Approx(spline.integrals().dot(c)).epsilon(1e-12));
}

TEST_CASE("The spline coordinate of h is tan(asin(h) / 2), accurate at h = 1", "[axis]") {
    for (const double h : {0.0, 1e-300, 0.3, 0.9, 1 - 1e-7, 1.0}) {
        const double c = spline_coordinate(Quantity::h, h);
        CHECK(c == Approx(std::tan(std::asin(h) / 2)).epsilon(1e-8));  // asin loses half its digits at 1
        CHECK(from_spline_coordinate(Quantity::h, c) == Approx(h).epsilon(1e-15));
    }
}

TEST_CASE("Every spline coordinate has its inverse, and is finite where rounding leaves the axis", "[axis]") {
    for (const Quantity q : {Quantity::sigma, Quantity::g, Quantity::h, Quantity::theta_i})
        for (const double x : {0.0, 1e-12, 0.25, 0.999, 1.0}) {
            CHECK(from_spline_coordinate(q, spline_coordinate(q, x)) == Approx(x).epsilon(1e-14));
            if (x > 0) CHECK(spline_coordinate(q, x) > spline_coordinate(q, 0.9 * x));
        }
    CHECK(spline_coordinate(Quantity::theta_i, float(pi / 2)) >= 0.999999f);  // float(pi/2) lies above pi/2
    CHECK(spline_coordinate(Quantity::theta_i, 1.6f) > 1);                    // beyond the end: clamped later
}

TEST_CASE("Ranges: accepted and refused text", "[axis]") {
    CHECK(parse_range("0:16:24", "--x", 3).count == 24);
    CHECK(parse_range("0:16", "--x", 3).count == 3);
    CHECK(parse_range("2:2:1", "--x", 3).count == 1);
    CHECK(parse_range("2:2", "--x", 3).count == 1);
    for (const char* wrong : {"", "1", "a:b", "1:2:3:4", "2:1", "1:2:0", "1:2:1.5", "1:2:1", "2:2:5", "nan:1", "0:inf",
                              "1:2:-3", "0:1:99999"})
        CHECK_THROWS_AS(parse_range(wrong, "--x", 3), Error);
    const Axis sigma = graded_axis("sigma", {0, 16, 24});
    CHECK((sigma.values.front() == 0 && sigma.values.back() == 16 && sigma.size() == 24));
    CHECK_NOTHROW(check_axis(sigma, "test"));
    CHECK_THROWS_AS(check_axis({"h", {0, 1.5}}, "test"), Error);
    CHECK_THROWS_AS(check_axis({"h", {0.5, 0.5}}, "test"), Error);
    CHECK_THROWS_AS(check_axis({"g", {1.0}}, "test"), Error);
    CHECK_THROWS_AS(check_axis({"phi", {0, 1, 2}}, "test"), Error);
    CHECK_NOTHROW(check_axis(exit_axis("phi", 720), "test"));
}
