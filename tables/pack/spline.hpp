// The cubic spline space of one pack axis, offline: fits node values or bin averages by the coefficients that
// medulla/axis.hpp evaluates. Knots are rounded to float first, so that both use the same ones.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "medulla/axis.hpp"

namespace medulla::tables {

/// Symmetry of a function about 0: none, f(-x) = f(x), or f(-x) = -f(x).
enum class Mirror { none, even, odd };

class Spline {
  public:
    /// Breakpoints in the spline coordinate, increasing, at least two.
    explicit Spline(const std::vector<double>& breakpoints);

    /// The spline that interpolates nodes of a parameter axis (in its own unit): not-a-knot ends from four nodes on,
    /// a parabola through three, a line through two, a constant through one. Where the first node is 0 and the function
    /// is even or odd there, its slope or its curvature is 0 instead (from two nodes on).
    static Spline through(Quantity quantity, const std::vector<double>& nodes, Mirror mirror = Mirror::none);

    std::uint32_t spans() const { return spans_; }
    /// Coefficients, one for each stored row.
    Eigen::Index size() const { return static_cast<Eigen::Index>(spans_) + 3; }
    AxisView<double> view() const;
    std::vector<Knot<float>> float_knots() const;

    /// Basis values at x (spline coordinate): value(x) = row . coefficients.
    Eigen::RowVectorXd basis(double x) const;
    /// Values at the nodes given to `through` -> coefficients.
    const Eigen::MatrixXd& from_nodes() const { return from_nodes_; }
    /// [size x free]: coefficients of the splines that are even or odd about the first breakpoint, and about the last
    /// one too where `both`; the columns are independent.
    Eigen::MatrixXd mirrored(Mirror mirror, bool both) const;
    /// [intervals x size]: averages of the basis between increasing edges (exact: Gauss between the knots).
    Eigen::MatrixXd averages(const std::vector<double>& edges) const;
    /// Integral of each basis function over the axis.
    Eigen::VectorXd integrals() const;

  private:
    std::uint32_t spans_;
    std::vector<Knot<double>> knots_;
    Eigen::MatrixXd from_nodes_;
};

}  // namespace medulla::tables
