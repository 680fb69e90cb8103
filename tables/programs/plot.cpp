#include "tables/programs/plot.hpp"

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

/// Where the numbers of a panel lie on the page.
struct Scale {
    double low = INFINITY, high = -INFINITY, bottom = INFINITY, top = -INFINITY;  ///< log10 where logarithmic
    double x0, y0, w, h;

    double x(double value) const { return x0 + left + w * (value - low) / (high - low); }
    double y(double log_value) const { return y0 + ::medulla::tables::top + h * (top - log_value) / (top - bottom); }
};

Scale scale_of(const Panel& panel, double x0, double y0) {
    Scale scale;
    scale.x0 = x0, scale.y0 = y0, scale.w = width - left - right, scale.h = height - top - bottom;
    for (const Curve& curve : panel.curves)
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            const double x = panel.log_x ? std::log10(curve.x[i]) : curve.x[i];
            scale.low = std::min(scale.low, x), scale.high = std::max(scale.high, x);
            if (!(curve.y[i] > 0)) continue;
            scale.bottom = std::min(scale.bottom, std::log10(curve.y[i]));
            scale.top = std::max(scale.top, std::log10(curve.y[i]));
        }
    scale.top = std::ceil(scale.top * 4) / 4;
    if (panel.log_x) {
        scale.bottom = std::floor(scale.bottom * 4) / 4;
        scale.low = std::floor(scale.low * 4) / 4, scale.high = std::ceil(scale.high * 4) / 4;
    } else {
        scale.bottom = scale.top - decades;
    }
    return scale;
}

std::string ticks(const Panel& panel, const Scale& scale) {
    std::string out;
    const double x0 = scale.x0 + left, y0 = scale.y0 + top;
    for (double decade = std::ceil(scale.bottom); decade <= scale.top; ++decade) {
        out += line(x0, scale.y(decade), x0 + scale.w, scale.y(decade), "#ddd");
        out += text(x0 - 4, scale.y(decade) + 4, fmt::format("{:g}", std::pow(10, decade)), "end", 10);
    }
    const auto tick = [&](double x, const std::string& label) {
        out += line(scale.x(x), y0, scale.x(x), y0 + scale.h, "#eee");
        out += text(scale.x(x), y0 + scale.h + 14, label, "middle", 10);
    };
    if (panel.log_x) {
        for (double decade = std::ceil(scale.low); decade <= scale.high; ++decade)
            tick(decade, fmt::format("{:g}", std::pow(10, decade)));
        return out;
    }
    const double half_turns = scale.high > 2 ? 2 : 1;  // phi spans -180..180 degrees, theta_r -90..90
    for (int i = -2; i <= 2; ++i) {
        const double degrees = 45 * half_turns * i;
        tick(std::clamp(degrees * M_PI / 180, scale.low, scale.high), fmt::format("{:g}", degrees));
    }
    return out;
}

std::string draw(const Panel& panel, double x0, double y0) {
    const Scale scale = scale_of(panel, x0, y0);
    const double w = scale.w, h = scale.h;
    std::string out = text(x0 + left + w / 2, y0 + 16, panel.title, "middle", 12) + ticks(panel, scale);
    out += text(x0 + left, y0 + top - 4, panel.y_label, "start", 10);
    out += text(x0 + left + w / 2, y0 + height - 6, panel.x_label, "middle", 10);
    out += fmt::format("<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='none' stroke='#999'/>\n",
                       x0 + left, y0 + top, w, h);
    // Errors fall from left to right, so their legend stands at the upper right; lobes leave room below.
    double legend = panel.log_x ? y0 + top + 12 : y0 + top + h - 12 * static_cast<double>(panel.curves.size()) + 8;
    for (const Curve& curve : panel.curves) {
        out +=
            fmt::format("<polyline fill='none' stroke='{}' stroke-width='{}' {}points='", curve.colour,
                        curve.dashed ? 1.1 : 1.8, curve.dashed ? "stroke-dasharray='5 3' " : "stroke-opacity='0.55' ");
        std::string marks;
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            const double log_y = curve.y[i] > 0 ? std::log10(curve.y[i]) : scale.bottom;
            const double x = scale.x(panel.log_x ? std::log10(curve.x[i]) : curve.x[i]);
            const double y = scale.y(std::max(log_y, scale.bottom));
            out += fmt::format("{:.1f},{:.1f} ", x, y);
            if (curve.marks)
                marks += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='2.4' fill='{}'/>\n", x, y, curve.colour);
        }
        out += "'/>\n" + marks;
        if (curve.label.empty()) continue;
        out += panel.log_x ? text(x0 + left + w - 4, legend, curve.label, "end", 10, curve.colour.c_str())
                           : text(x0 + left + w / 2, legend, curve.label, "middle", 10, curve.colour.c_str());
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
