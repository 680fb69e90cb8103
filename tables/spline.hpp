// The cubic spline space of one pack axis, offline: fits that turn node values or bin averages into the coefficients
// that medulla/axis.hpp evaluates. Knots are rounded to float first, so both sides use the same ones.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "medulla/axis.hpp"

namespace medulla::tables {

class Spline {
  public:
    /// Breakpoints in the spline coordinate, increasing. A periodic axis names its first point again at the end.
    Spline(const std::vector<double>& breakpoints, bool periodic);

    /// The spline that interpolates nodes of a parameter axis (in its own unit): not-a-knot ends from four nodes on,
    /// a parabola through three, a line through two, a constant through one.
    static Spline through(Quantity quantity, const std::vector<double>& nodes);

    std::uint32_t spans() const { return spans_; }
    bool periodic() const { return periodic_; }
    /// Free coefficients: spans + 3, or spans where periodic (the stored rows repeat the first three).
    Eigen::Index size() const { return periodic_ ? spans_ : spans_ + 3; }
    Eigen::Index rows() const { return static_cast<Eigen::Index>(spans_) + 3; }
    AxisView<double> view() const;
    std::vector<Knot<float>> float_knots() const;

    /// Basis values at x (spline coordinate): value(x) = row . coefficients.
    Eigen::RowVectorXd basis(double x) const;
    /// Values at the nodes given to `through` -> coefficients.
    const Eigen::MatrixXd& from_nodes() const { return from_nodes_; }
    /// [bins x size]: averages of the basis over `bins` equal bins of the whole axis (exact: Gauss between the knots).
    Eigen::MatrixXd bin_averages(std::size_t bins) const;
    /// Integral of each basis function over the axis.
    Eigen::VectorXd integrals() const;
    /// Coefficients as stored rows: a periodic spline repeats its first three.
    Eigen::MatrixXd stored_rows(const Eigen::MatrixXd& coefficients) const;

  private:
    std::uint32_t spans_;
    bool periodic_;
    std::vector<Knot<double>> knots_;
    Eigen::MatrixXd from_nodes_;
};

}  // namespace medulla::tables
