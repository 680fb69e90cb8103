#include "tables/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace medulla::tables {
namespace {

constexpr double width = 300, height = 220, left = 46, right = 10, top = 26, bottom = 34;
constexpr double decades = 3;

std::string text(double x, double y, const std::string& what, const char* anchor, int size,
                 const char* colour = "#333") {
    return fmt::format("<text x='{:.1f}' y='{:.1f}' text-anchor='{}' font-size='{}' fill='{}'>{}</text>\n", x, y,
                       anchor, size, colour, what);
}

std::string line(double x1, double y1, double x2, double y2, const char* colour) {
    return fmt::format("<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' stroke='{}' stroke-width='0.7'/>\n", x1,
                       y1, x2, y2, colour);
}

std::string draw(const Panel& panel, double x0, double y0) {
    double greatest = 0, low = INFINITY, high = -INFINITY;
    for (const Curve& curve : panel.curves)
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            greatest = std::max(greatest, curve.y[i]);
            low = std::min(low, curve.x[i]), high = std::max(high, curve.x[i]);
        }
    const double log_top = std::ceil(std::log10(std::max(greatest, 1e-300)) * 4) / 4, log_bottom = log_top - decades;
    const double w = width - left - right, h = height - top - bottom;
    const auto px = [&](double x) { return x0 + left + w * (x - low) / (high - low); };
    const auto py = [&](double log_y) { return y0 + top + h * (log_top - log_y) / decades; };
    std::string out = text(x0 + left + w / 2, y0 + 16, panel.title, "middle", 12);
    for (double decade = std::ceil(log_bottom); decade <= log_top; ++decade) {
        out += line(x0 + left, py(decade), x0 + left + w, py(decade), "#ddd");
        out += text(x0 + left - 4, py(decade) + 4, fmt::format("{:g}", std::pow(10, decade)), "end", 10);
    }
    const double half_turns = high > 2 ? 2 : 1;  // phi spans -180..180 degrees, theta_r -90..90
    for (int tick = -2; tick <= 2; ++tick) {
        const double degrees = 45 * half_turns * tick, x = px(std::clamp(degrees * M_PI / 180, low, high));
        out += line(x, y0 + top, x, y0 + top + h, "#eee");
        out += text(x, y0 + top + h + 14, fmt::format("{:g}", degrees), "middle", 10);
    }
    out += text(x0 + left + w / 2, y0 + height - 6, panel.x_label, "middle", 10);
    out += fmt::format("<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='none' stroke='#999'/>\n",
                       x0 + left, y0 + top, w, h);
    double legend = y0 + top + h - 12 * static_cast<double>(panel.curves.size()) + 8;
    for (const Curve& curve : panel.curves) {
        out +=
            fmt::format("<polyline fill='none' stroke='{}' stroke-width='{}' {}points='", curve.colour,
                        curve.dashed ? 1.1 : 1.8, curve.dashed ? "stroke-dasharray='5 3' " : "stroke-opacity='0.55' ");
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            const double log_y = curve.y[i] > 0 ? std::log10(curve.y[i]) : log_bottom;
            out += fmt::format("{:.1f},{:.1f} ", px(curve.x[i]), py(std::max(log_y, log_bottom)));
        }
        out += "'/>\n";
        if (curve.label.empty()) continue;
        out += text(x0 + left + w / 2, legend, curve.label, "middle", 10, curve.colour.c_str());
        legend += 12;
    }
    return out;
}

}  // namespace

std::string svg(const std::string& title, const std::vector<Panel>& panels, std::size_t columns) {
    const std::size_t rows = (panels.size() + columns - 1) / columns;
    const double w = width * static_cast<double>(columns), h = 30 + height * static_cast<double>(rows);
    std::string out = fmt::format(
        "<svg xmlns='http://www.w3.org/2000/svg' width='{0:.0f}' height='{1:.0f}' viewBox='0 0 {0:.0f} {1:.0f}' "
        "font-family='DejaVu Sans, Helvetica, sans-serif'>\n<rect width='100%' height='100%' fill='white'/>\n",
        w, h);
    out += text(w / 2, 20, title, "middle", 14, "#000");
    for (std::size_t i = 0; i < panels.size(); ++i)
        out +=
            draw(panels[i], width * static_cast<double>(i % columns), 30 + height * static_cast<double>(i / columns));
    return out + "</svg>\n";
}

}  // namespace medulla::tables
