// Pictures of lobes as SVG: panels of curves over the exit angle, one line style per file.
#pragma once

#include <string>
#include <vector>

namespace medulla::tables {

struct Curve {
    std::string label;  ///< for the legend; empty: none
    std::string colour;
    bool dashed = false;
    std::vector<double> x, y;
};

struct Panel {
    std::string title, x_label;
    std::vector<Curve> curves;
};

/// Panels in rows of `columns`, densities on a logarithmic axis of three decades below the greatest.
std::string svg(const std::string& title, const std::vector<Panel>& panels, std::size_t columns);

}  // namespace medulla::tables
