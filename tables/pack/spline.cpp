#include "tables/pack/spline.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "tables/error.hpp"

namespace medulla::tables {

Spline::Spline(const std::vector<double>& breakpoints) : spans_(static_cast<std::uint32_t>(breakpoints.size() - 1)) {
    const auto n = static_cast<std::ptrdiff_t>(spans_);
    if (n < 1) throw Error("spline: expected at least two breakpoints, found {}", breakpoints.size());
    std::vector<double> exact = breakpoints;
    const double first = breakpoints.front(), last = breakpoints.back();
    for (std::ptrdiff_t i = 1; i <= 2; ++i) {
        // Ghost knots mirror the axis; a single span is mirrored about both ends.
        const auto inner = static_cast<std::size_t>(std::min(i, n));
        const double below = breakpoints[static_cast<std::size_t>(n) - inner], above = breakpoints[inner];
        const double twice = i > n ? last - first : 0;
        exact.insert(exact.begin(), 2 * first - above - twice);
        exact.push_back(2 * last - below + twice);
    }
    std::vector<double> t;
    for (const double x : exact) t.push_back(static_cast<double>(static_cast<float>(x)));
    for (std::size_t i = 0; i + 1 < t.size(); ++i)
        if (!(t[i] < t[i + 1]))
            throw Error("spline: breakpoints {:g} and {:g} are equal in float precision", t[i], t[i + 1]);
    for (std::size_t i = 0; i < t.size(); ++i) {
        const auto inverse = [&](std::size_t step) { return i + step < t.size() ? 1 / (t[i + step] - t[i]) : 0.0; };
        knots_.push_back({t[i], inverse(1), inverse(2), inverse(3)});
    }
}

Spline Spline::through(Quantity quantity, const std::vector<double>& nodes, Mirror mirror) {
    std::vector<double> points;
    for (const double x : nodes) points.push_back(spline_coordinate(quantity, x));
    std::vector<double> breakpoints = points;
    if (points.size() == 1) breakpoints.push_back(points[0] + 1);
    Spline spline(breakpoints);
    const Eigen::Index n = static_cast<Eigen::Index>(points.size()), size = spline.size();
    if (n == 1) {
        spline.from_nodes_ = Eigen::MatrixXd::Ones(size, 1);
        return spline;
    }
    // Derivatives of order 2 and 3 inside a span, exact for cubics: divided differences of four basis rows.
    const auto differences = [&](Eigen::Index span, int order) -> Eigen::RowVectorXd {
        const double a = spline.knots_[span + 2].t, step = (spline.knots_[span + 3].t - a) / 3;
        const Eigen::RowVectorXd f0 = spline.basis(a), f1 = spline.basis(a + step), f2 = spline.basis(a + 2 * step);
        if (order == 2) return (2 * f0 - 5 * f1 + 4 * f2 - spline.basis(a + 3 * step)) / (step * step);
        return (spline.basis(a + 3 * step) - 3 * f2 + 3 * f1 - f0) / (step * step * step);
    };
    Eigen::MatrixXd system(size, size);
    for (Eigen::Index i = 0; i < n; ++i) system.row(i) = spline.basis(points[static_cast<std::size_t>(i)]);
    if (n == 2) {  // a line: second and third derivative 0
        system.row(n) = differences(0, 2);
        system.row(n + 1) = differences(0, 3);
    } else if (n == 3) {  // one parabola
        system.row(n) = differences(0, 3);
        system.row(n + 1) = differences(1, 3);
    } else {  // not-a-knot
        system.row(n) = differences(0, 3) - differences(1, 3);
        system.row(n + 1) = differences(n - 2, 3) - differences(n - 3, 3);
    }
    if (mirror != Mirror::none && points.front() == 0) {
        // Knots mirror about 0, so the first basis function is the mirror image of the third.
        system.row(n).setZero();
        system(n, 0) = 1, system(n, 2) = mirror == Mirror::even ? -1 : 1;
    }
    for (Eigen::Index i = n; i < size; ++i) system.row(i) /= system.row(i).cwiseAbs().maxCoeff();
    spline.from_nodes_ = system.fullPivLu().inverse().leftCols(n);
    return spline;
}

AxisView<double> Spline::view() const { return {reinterpret_cast<const unsigned char*>(knots_.data()), spans_}; }

std::vector<Knot<float>> Spline::float_knots() const {
    std::vector<Knot<float>> list;
    for (const Knot<double>& k : knots_)
        list.push_back({static_cast<float>(k.t), static_cast<float>(k.inverse1), static_cast<float>(k.inverse2),
                        static_cast<float>(k.inverse3)});
    return list;
}

Eigen::RowVectorXd Spline::basis(double x) const {
    Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(size());
    const Cell<double> cell = locate(view(), x);
    const SplineWeights<double> weights = spline_weights(view(), cell);
    for (Eigen::Index j = 0; j < 4; ++j) row[cell.span + j] = weights.w[j];
    return row;
}

Eigen::MatrixXd Spline::averages(const std::vector<double>& edges) const {
    Eigen::MatrixXd means = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(edges.size()) - 1, size());
    const double gauss = 1 / std::sqrt(3.0);  // two nodes integrate cubics exactly
    for (std::size_t b = 0; b + 1 < edges.size(); ++b) {
        std::vector<double> cuts = {edges[b], edges[b + 1]};
        for (const Knot<double>& k : knots_)
            if (k.t > cuts.front() && k.t < cuts[1]) cuts.push_back(k.t);
        std::sort(cuts.begin(), cuts.end());
        for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
            const double half = (cuts[i + 1] - cuts[i]) / 2, centre = (cuts[i + 1] + cuts[i]) / 2;
            for (const double s : {-gauss, gauss})
                means.row(static_cast<Eigen::Index>(b)) += half / (edges[b + 1] - edges[b]) * basis(centre + s * half);
        }
    }
    return means;
}

Eigen::VectorXd Spline::integrals() const {
    return averages({view().lower(), view().upper()}).row(0).transpose() * (view().upper() - view().lower());
}

Eigen::MatrixXd Spline::mirrored(Mirror mirror, bool both) const {
    Eigen::MatrixXd all = Eigen::MatrixXd::Identity(size(), size());
    std::vector<Eigen::Index> dependent;
    // Ghost knots mirror the axis: about an end, the outer basis function is the mirror image of the third one.
    const auto fold = [&](Eigen::Index outer, Eigen::Index middle, Eigen::Index inner) {
        all(outer, inner) = mirror == Mirror::even ? 1 : -1;
        dependent.push_back(outer);
        if (mirror == Mirror::odd) dependent.push_back(middle);
    };
    if (mirror != Mirror::none) fold(0, 1, 2);
    if (mirror != Mirror::none && both) fold(size() - 1, size() - 2, size() - 3);
    Eigen::MatrixXd free(size(), size() - static_cast<Eigen::Index>(dependent.size()));
    Eigen::Index column = 0;
    for (Eigen::Index j = 0; j < size(); ++j)
        if (std::find(dependent.begin(), dependent.end(), j) == dependent.end()) free.col(column++) = all.col(j);
    return free;
}

}  // namespace medulla::tables
