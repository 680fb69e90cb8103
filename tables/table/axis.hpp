// A table's axis: a name, its values, and the rules every file's axis must keep. Offline twin of the runtime's
// AxisView.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "medulla/axis.hpp"

namespace medulla::tables {

/// One axis of a table. Parameter axes hold nodes; exit axes (phi, theta_r) hold the centres of equal bins.
struct Axis {
    std::string name;  ///< sigma, g, absorption, h, theta_i, side, phi or theta_r
    std::vector<double> values;

    std::size_t size() const { return values.size(); }
};

/// Ways an axis name is known to the project.
struct AxisRule {
    const char* name;
    const char* unit;
    const char* meaning;
    double low, high;  ///< legal values, both ends included
    bool bins;         ///< an exit axis
};

/// The rule of an axis name; throws Error if there is none.
const AxisRule& axis_rule(const std::string& name);

/// Throws Error, with `where` in front, unless the values are finite, strictly increasing and inside the rule's range.
void check_axis(const Axis& axis, const std::string& where);

/// Runtime quantity of an axis name; throws Error for `side`, which packs do not have.
Quantity quantity_of(const std::string& name);
const char* name_of(Quantity quantity);

/// Centres of `bins` equal bins: phi over (-pi, pi], theta_r over (-pi/2, pi/2).
Axis exit_axis(const std::string& name, std::size_t bins);

/// Width of one bin of an exit axis [radians].
double bin_width(const Axis& axis);

/// LO:HI[:N] of the command line. Without N, `count` is the axis's default.
struct Range {
    double low, high;
    std::size_t count;
};

/// Reads LO:HI[:N]; throws Error that names `option`, what was expected and what was found.
Range parse_range(const std::string& text, const std::string& option, std::size_t default_count);

/// Nodes of a parameter axis over a range, graded where lobes change fastest (docs/accuracy.md):
/// sigma and absorption towards 0 (u^2.5), g towards 1 (1 - v^1.5, v = 1 - u), theta_i towards 90 degrees
/// (1 - 1.2 v^2 / (v + 0.2): even steps of the spline's variable there, of theta_i below), and asin h towards 90
/// degrees (1 - v^1.5). `range` is in the axis's own unit (theta_i: radians).
Axis graded_axis(const std::string& name, const Range& range);

}  // namespace medulla::tables
