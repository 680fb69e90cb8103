// An axis of a simulated table: its name, its values, and the rules for the axes of files. The runtime's counterpart is
// AxisView.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "medulla/axis.hpp"

namespace medulla::tables {

/// One axis of a table. Values of parameter axes are nodes; those of exit axes (phi, theta_r) are centres of equal
/// bins.
struct Axis {
    std::string name;  ///< sigma, g, absorption, h, theta_i, side, phi or theta_r
    std::vector<double> values;

    std::size_t size() const { return values.size(); }
};

/// Unit, meaning and legal values of an axis.
struct AxisRule {
    const char* name;
    const char* unit;
    const char* meaning;
    double low, high;  ///< smallest and largest legal value
    bool bins;         ///< an exit axis
};

/// The rule of an axis name; throws Error if there is none.
const AxisRule& axis_rule(const std::string& name);

/// Throws Error, with `where` in front, unless the values are finite, strictly increasing and inside the rule's range.
void check_axis(const Axis& axis, const std::string& where);

/// Runtime quantity of an axis name; throws Error for `side`, which is no axis of a pack.
Quantity quantity_of(const std::string& name);
const char* name_of(Quantity quantity);

/// Centres of `bins` equal bins: phi over (-pi, pi], theta_r over (-pi/2, pi/2).
Axis exit_axis(const std::string& name, std::size_t bins);

/// Width of one bin of an exit axis [radians].
double bin_width(const Axis& axis);

/// LO:HI[:N] on the command line.
struct Range {
    double low, high;
    std::size_t count;
};

/// Parses LO:HI[:N]; throws Error that names `option`, the expected and the found text.
Range parse_range(const std::string& text, const std::string& option, std::size_t default_count);

/// Nodes of a parameter axis over a range, denser where lobes change fastest (docs/accuracy.md):
/// sigma and absorption towards 0 (u^2.5), g towards 1 (1 - v^1.5, v = 1 - u), theta_i towards 90 degrees
/// (1 - 1.2 v^2 / (v + 0.2): uniform in the spline's variable there, in theta_i below), and asin h towards 90 degrees
/// (1 - v^1.5). `range` is in the axis's own unit (theta_i: radians).
Axis graded_axis(const std::string& name, const Range& range);

}  // namespace medulla::tables
