// Pictures as SVG: panels of curves with a logarithmic y axis; lobes over the exit angle, errors over bytes or seconds.
#pragma once

#include <string>
#include <vector>

namespace medulla::tables {

struct Curve {
    std::string label;  ///< for the legend; empty: none
    std::string colour;
    bool dashed = false, marks = false;
    std::vector<double> x, y;
};

struct Panel {
    std::string title, x_label, y_label = {};
    std::vector<Curve> curves = {};
    bool log_x = false;  ///< decades on both axes; else x is an angle in radians and y spans three decades
};

/// Panels in rows of `columns`.
std::string svg(const std::string& title, const std::vector<Panel>& panels, std::size_t columns);

}  // namespace medulla::tables
