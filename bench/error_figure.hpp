// Figures of error against cost, drawn from the numbers that a benchmark wrote.
#pragma once

#include <algorithm>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "plot/gnuplot.hpp"

namespace medulla::bench {

/// Adds rows of up to `columns` panels with logarithmic axes, all of one range that shows every point whose error is at
/// least `least` (> 0).
inline void add_panels(plot::Figure& figure, std::size_t columns, const std::string& cost, double least,
                       std::vector<plot::Panel> panels) {
    double low[2] = {1e300, 1e300}, high[2] = {0, 0};
    for (const plot::Panel& panel : panels)
        for (const plot::Curve& curve : panel.curves)
            for (std::size_t i = 0; i < curve.x.size(); ++i) {
                const double point[2] = {curve.x[i], std::max(curve.y[i], least)};
                for (int k = 0; k < 2; ++k) low[k] = std::min(low[k], point[k]), high[k] = std::max(high[k], point[k]);
            }
    for (std::size_t i = 0; i < panels.size(); ++i) {
        const bool last_row = i / columns == (panels.size() - 1) / columns;
        panels[i].x = plot::log_axis(last_row ? cost : "", low[0], high[0]);
        panels[i].y = plot::log_axis(i % columns == 0 ? "relative L2 error" : "", low[1], high[1]);
        if (i % columns == 0) figure.rows.emplace_back();
        figure.rows.back().panels.push_back(std::move(panels[i]));
    }
}

inline void save(const plot::Figure& figure, const std::string& file) {
    const auto format = plot::format_of(file);
    if (!format) throw std::runtime_error(file + ": expected a name that ends in .svg, .png or .html");
    std::ofstream(file, std::ios::binary) << plot::draw(figure, *format);
}

}  // namespace medulla::bench
