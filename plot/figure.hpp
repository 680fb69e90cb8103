// A figure as data: rows of panels, curves in them, legends outside them. plot/gnuplot.hpp draws it.
// Text is UTF-8 without markup; names from outside go through printable().
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace medulla::plot {

/// Colours that readers with any colour vision tell apart: Okabe and Ito, "Color universal design", 2008.
inline constexpr const char *blue = "#0072b2", *vermilion = "#d55e00", *green = "#009e73", *purple = "#cc79a7",
                            *sky = "#56b4e9", *orange = "#e69f00", *black = "#000000", *grey = "#777777";

enum class Stroke { solid, dashed, dotted, dash_dot };

struct Curve {
    std::string label;  ///< in a legend; a panel's own curves have none
    std::string colour = black;
    Stroke stroke = Stroke::solid;
    double width = 1.5;  ///< [px]
    bool marks = false;  ///< a dot at every point
    std::vector<double> x = {}, y = {};
};

struct Axis {
    std::string label;
    double low = 0, high = 1;
    bool log = false;
    double step = 0;      ///< between ticks of a linear axis
    bool numbers = true;  ///< at the ticks
};

struct Panel {
    std::string title;
    Axis x, y;
    std::vector<Curve> curves;
};

struct Row {
    std::vector<Panel> panels;
    std::vector<Curve> legend;  ///< to the right of the row
    double height = 180;        ///< of the panels [px]
};

struct Figure {
    std::string title;
    std::vector<Curve> legend;  ///< below the title
    std::vector<Row> rows;
};

/// Logarithmic axis from the greatest power of ten times 1, 2 or 5 below `low` to the least above `high`; 0 < low <=
/// high.
Axis log_axis(const std::string& label, double low, double high);

/// Axis symmetric about 0 that contains `reach`, with two ticks on either side.
Axis symmetric_axis(const std::string& label, double reach);

/// Indices of the points, first and last among them, between which straight lines stay within `tolerance` of every y.
std::vector<std::size_t> thinned(const std::vector<double>& x, const std::vector<double>& y, double tolerance);

/// The text with '?' in place of control characters and of what is not UTF-8.
std::string printable(const std::string& text);

}  // namespace medulla::plot
