// Small log-log panels of error against seconds as one SVG.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

namespace medulla::bench {

struct Point {
    double seconds, error;
};
struct Series {
    const char *name, *colour;
};
struct Panel {
    std::string title;
    int decades[2];  ///< of seconds, across; errors run from 1e-6 to 10
    std::vector<std::vector<Point>> points;
};

/// One panel of four in a row per cell; series[k] colours points[k].
inline std::string svg(const std::vector<Panel>& panels, const std::vector<Series>& series) {
    const double w = 250, h = 190, left = 46, bottom = 34, top = 20, right = 8;
    const std::size_t columns = 4, rows = (panels.size() + columns - 1) / columns;
    std::string out;
    const auto print = [&](const char* format, auto... values) {
        char text[400];
        std::snprintf(text, sizeof text, format, values...);
        out += text;
    };
    print(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%g\" height=\"%g\" font-family=\"sans-serif\" "
        "font-size=\"10\">\n<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
        w * double(columns), h * double(rows) + 24);
    const auto line = [&](double x1, double y1, double x2, double y2) {
        print("<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"#ddd\"/>\n", x1, y1, x2, y2);
    };
    for (std::size_t i = 0; i < panels.size(); ++i) {
        const Panel& panel = panels[i];
        const double x0 = w * double(i % columns) + left, y0 = h * double(i / columns) + top;
        const double width = w - left - right, height = h - top - bottom;
        const int low = panel.decades[0], high = panel.decades[1];
        const auto x = [&](double s) { return x0 + width * (std::log10(s) - low) / (high - low); };
        const auto y = [&](double e) { return y0 + height * (1 - std::log10(std::max(e, 1e-6))) / 7; };
        print("<text x=\"%.1f\" y=\"%.1f\">%s</text>\n", x0, y0 - 5, panel.title.c_str());
        for (int d = low; d <= high; d += 2) {
            const double at = x(std::pow(10, d));
            line(at, y0, at, y0 + height);
            print("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">1e%d s</text>\n", at, y0 + height + 12, d);
        }
        for (int d = -6; d <= 0; d += 2) {
            const double at = y(std::pow(10, d));
            line(x0, at, x0 + width, at);
            print("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">1e%d</text>\n", x0 - 4, at + 3, d);
        }
        print("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" stroke=\"#aaa\"/>\n", x0, y0,
              width, height);
        for (std::size_t k = 0; k < panel.points.size(); ++k) {
            print("<polyline fill=\"none\" stroke-width=\"1.6\" stroke=\"%s\" points=\"", series[k].colour);
            for (const Point& p : panel.points[k]) print("%.1f,%.1f ", x(p.seconds), y(p.error));
            out += "\"/>\n";
        }
    }
    const double foot = h * double(rows) + 14;
    for (std::size_t k = 0; k < series.size(); ++k)
        print("<text x=\"%g\" y=\"%g\" fill=\"%s\" font-size=\"13\">%s</text>\n", 60 + 110.0 * double(k), foot,
              series[k].colour, series[k].name);
    print("<text x=\"420\" y=\"%g\" font-size=\"13\">relative L2 error of a lobe (720 bins) against seconds</text>\n",
          foot);
    return out + "</svg>\n";
}

}  // namespace medulla::bench
