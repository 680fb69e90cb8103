#include "tables/programs/error_map_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace medulla::tables {
namespace {

using Stops = std::array<Colour, 5>;
// ColorBrewer's YlOrRd and RdBu by Cynthia Brewer, with a lighter middle: distinguishable with any colour vision.
constexpr Stops heat = {{{255, 250, 225}, {254, 204, 110}, {252, 141, 60}, {215, 48, 31}, {110, 0, 30}}};
constexpr Stops balance = {{{20, 70, 140}, {110, 170, 215}, {247, 247, 247}, {240, 150, 110}, {160, 15, 35}}};

Colour between(const Stops& stops, double share) {
    const double at = std::clamp(share, 0.0, 1.0) * double(stops.size() - 1);
    const auto i = std::min(static_cast<std::size_t>(at), stops.size() - 2);
    const double w = at - double(i);
    const auto mix = [&](int a, int b) { return static_cast<int>(std::lround((1 - w) * a + w * b)); };
    const Colour &a = stops[i], &b = stops[i + 1];
    return {mix(a.red, b.red), mix(a.green, b.green), mix(a.blue, b.blue)};
}

constexpr int levels = 48;

/// A density over bins as one path per level of colour, and the frame around it. `blank` bins are left out.
template <class Scale, class Blank>
std::string bins_svg(const sim3d::DirectionalDensity& d, const std::vector<double>& share, Scale&& scale,
                     Blank&& blank) {
    std::vector<std::string> path(levels + 1);
    for (std::size_t t = 0; t < d.theta_bins; ++t)
        for (std::size_t b = 0; b < d.phi_bins;) {
            const auto level_of = [&](std::size_t at) {
                const std::size_t i = t * d.phi_bins + at;
                return blank(i) ? -1 : static_cast<int>(std::lround(std::clamp(share[i], 0.0, 1.0) * levels));
            };
            const int level = level_of(b);
            std::size_t end = b + 1;
            while (end < d.phi_bins && level_of(end) == level) ++end;
            if (level >= 0)
                path[static_cast<std::size_t>(level)] +=
                    fmt::format("M{} {}h{}v1h-{}z", b, d.theta_bins - 1 - t, end - b, end - b);
            b = end;
        }
    std::string svg = "<path class=\"blank\" d=\"M34 6h288v144h-288z\"/>";
    svg += fmt::format("<g transform=\"translate(34 6) scale({:.4g} {:.4g})\" shape-rendering=\"crispEdges\">",
                       288.0 / double(d.phi_bins), 144.0 / double(d.theta_bins));
    for (int k = 0; k <= levels; ++k)
        if (!path[std::size_t(k)].empty())
            svg += fmt::format("<path fill=\"{}\" d=\"{}\"/>", scale(double(k) / levels).hex(), path[std::size_t(k)]);
    svg +=
        "</g><path class=\"frame\" d=\"M34 6h288v144h-288zM106 150v4M178 150v4M250 150v4M30 42h4M30 78h4M30 114h4\"/>";
    const auto label = [&](double x, double y, const char* anchor, const char* text) {
        svg += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"{}\">{}</text>", x, y, anchor, text);
    };
    label(34, 167, "start", "−180"), label(178, 167, "middle", "φ = 0"), label(322, 167, "end", "180");
    label(28, 15, "end", "90"), label(28, 82, "end", "θ<tspan dy=\"3\" font-size=\"9\">r</tspan>"),
        label(28, 150, "end", "−90");
    return svg;
}

std::string panel(const std::string& title, const std::string& svg, const std::string& low, const std::string& high,
                  Colour (*scale)(double), double from) {
    std::string stops;
    for (int k = 0; k <= 4; ++k) stops += "," + scale(from + (1 - from) * k / 4.0).hex();
    return fmt::format(
        "<figure><figcaption>{}</figcaption><svg viewBox=\"0 0 330 172\" role=\"img\" aria-label=\"{}\">{}</svg>"
        "<div class=\"bar\"><span>{}</span><i style=\"background:linear-gradient(90deg{})\"></i><span>{}</span></div>"
        "</figure>",
        title, title, svg, low, stops, high);
}

}  // namespace

std::string Colour::hex() const { return fmt::format("#{:02x}{:02x}{:02x}", red, green, blue); }
const char* Colour::ink() const { return 0.299 * red + 0.587 * green + 0.114 * blue > 112 ? "#000" : "#fff"; }
Colour plain_scale(double share) { return between(heat, share); }
Colour signed_scale(double share) { return between(balance, 0.5 + 0.5 * share); }

std::string lobe_pictures(const sim3d::LobePicture& p) {
    const std::size_t size = p.truth.value.size();
    double most = 0, reach = 0;
    for (std::size_t i = 0; i < size; ++i) {
        most = std::max({most, p.truth.value[i], p.model.value[i]});
        reach = std::max(
            {reach, std::abs(p.model.value[i] - p.truth.value[i]), std::abs(p.cosine.value[i] - p.truth.value[i])});
    }
    if (!(most > 0)) return "<p>No scattered light.</p>";
    const auto density = [&](const sim3d::DirectionalDensity& d, const char* title) {
        std::vector<double> share;
        for (const double x : d.value) share.push_back(x / most);
        const std::string svg = bins_svg(d, share, plain_scale, [](std::size_t) { return false; });
        return panel(title, svg, "0", fmt::format("{:.2g} rad⁻²", most), plain_scale, 0);
    };
    const auto difference = [&](const sim3d::DirectionalDensity& d, const char* title) {
        std::vector<double> share;
        for (std::size_t i = 0; i < size; ++i) share.push_back(0.5 + 0.5 * (d.value[i] - p.truth.value[i]) / reach);
        const auto noise = [&](std::size_t i) {
            return std::abs(d.value[i] - p.truth.value[i]) < 2 * p.truth.error[i];
        };
        const std::string svg = bins_svg(
            d, share, [](double x) { return signed_scale(2 * x - 1); }, noise);
        return panel(title, svg, fmt::format("−{:.2g}", reach), fmt::format("{:.2g}", reach), signed_scale, -1);
    };
    return "<div class=\"lobes\">" + density(p.truth, "truth") + density(p.model, "model") +
           difference(p.model, "model − truth") + difference(p.cosine, "model with cos θ<sub>r</sub> − truth") +
           "</div>";
}

std::string page_chart(const std::string& title, const std::vector<PageCurve>& curves) {
    double most = 0;
    for (const PageCurve& c : curves)
        for (const double y : c.y) most = std::max(most, y);
    const double step = most > 1.25 ? 0.5 : most > 0.5 ? 0.25 : most > 0.2 ? 0.1 : 0.05;
    const double top = std::max(step, std::ceil(most / step) * step);
    const auto px = [](double x) { return 34 + (x + 90) * 288 / 180; };
    const auto py = [&](double y) { return 150 - y / top * 140; };
    std::string svg = "<path class=\"frame\" d=\"M34 10h288v140h-288z\"/>", legend;
    for (double y = 0; y <= top * 1.001; y += step)
        svg += fmt::format(
            "<path class=\"grid\" d=\"M34 {0:.1f}h288\"/><text x=\"30\" y=\"{1:.1f}\" "
            "text-anchor=\"end\">{2:.3g}</text>",
            py(y), py(y) + 4, y);
    for (const int x : {-90, -45, 0, 45, 90})
        svg += fmt::format("<text x=\"{:.1f}\" y=\"167\" text-anchor=\"middle\">{}{}</text>", px(x), x < 0 ? "−" : "",
                           std::abs(x));
    for (const PageCurve& c : curves) {
        std::string points, marks;
        for (std::size_t i = 0; i < c.x.size(); ++i) {
            points += fmt::format("{:.1f},{:.1f} ", px(c.x[i]), py(c.y[i]));
            marks += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\"/>", px(c.x[i]), py(c.y[i]));
        }
        svg += fmt::format("<g class=\"{}\"><polyline points=\"{}\"/>{}</g>", c.style, points, marks);
        legend += fmt::format("<span class=\"{}\">{}</span>", c.style, c.label);
    }
    return fmt::format(
        "<figure><figcaption>{}</figcaption><svg viewBox=\"0 0 330 172\" role=\"img\" aria-label=\"{}\">{}</svg>"
        "<div class=\"key\">{}</div></figure>",
        title, title, svg, legend);
}

}  // namespace medulla::tables
