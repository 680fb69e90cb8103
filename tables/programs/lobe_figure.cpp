#include "tables/programs/lobe_figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

using Sources = std::vector<std::unique_ptr<Source>>;

constexpr const char* colours[] = {plot::blue, plot::vermilion, plot::green};
constexpr plot::Stroke strokes[] = {plot::Stroke::dashed, plot::Stroke::dotted, plot::Stroke::dash_dot};

/// Value of an axis nearest to `wanted`; 0 where there is no such axis.
double nearest(const std::vector<Axis>& axes, const std::string& name, double wanted) {
    for (const Axis& axis : axes) {
        if (axis.name != name) continue;
        return *std::min_element(axis.values.begin(), axis.values.end(),
                                 [&](double a, double b) { return std::abs(a - wanted) < std::abs(b - wanted); });
    }
    return 0;
}

template <class T>
void add_once(std::vector<T>& list, const T& value) {
    if (std::find(list.begin(), list.end(), value) == list.end()) list.push_back(value);
}

/// A file's name as the legend has it: without its folder, unless that would make two names equal.
std::string label_of(const std::vector<std::string>& names, std::size_t s) {
    if (names[s] == "default") return "default pack";
    const auto base = [](const std::string& name) { return std::filesystem::path(name).filename().string(); };
    for (std::size_t other = 0; other < names.size(); ++other)
        if (other != s && base(names[other]) == base(names[s])) return names[s];
    return base(names[s]);
}

/// The greatest value; 1 if that is 0, as in a pack whose sum is nowhere positive.
double most(const std::vector<double>& values) {
    const double greatest = *std::max_element(values.begin(), values.end());
    return greatest > 0 ? greatest : 1;
}

/// The value below which the share `part` of the numbers lies.
double quantile(std::vector<double> values, double part) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// The contents of a row of panels: one kind of lobe at one absorption.
struct RowOf {
    TableKind kind;
    double absorption;
    bool absorbs;                 ///< whether there is such an axis
    std::vector<PlotPoint> at;    ///< a column each
    std::vector<double> offsets;  ///< h, or theta_i [radians]: a colour each
};

RowOf row_of(const Source& first, TableKind kind, double absorption, const std::vector<PlotPoint>& points) {
    const std::vector<Axis> axes = first.parameter_axes(kind);
    RowOf row{kind, nearest(axes, "absorption", absorption), kind == TableKind::azimuthal && first.absorbs(), {}, {}};
    for (const PlotPoint& point : points) {
        const PlotPoint at{nearest(axes, "sigma", point.sigma), nearest(axes, "g", point.g)};
        const auto same = [&](const PlotPoint& p) { return p.sigma == at.sigma && p.g == at.g; };
        if (std::none_of(row.at.begin(), row.at.end(), same)) row.at.push_back(at);
    }
    if (kind == TableKind::azimuthal)
        for (const double h : {0.0, 0.6, 0.95}) add_once(row.offsets, nearest(axes, "h", h));
    else
        for (const double degrees : {0, 30, 60}) add_once(row.offsets, nearest(axes, "theta_i", degrees * pi / 180));
    return row;
}

plot::Axis exit_axis_of(TableKind kind) {
    plot::Axis axis;
    const bool azimuthal = kind == TableKind::azimuthal;
    axis.label = azimuthal ? "azimuth φ [degrees]" : "outgoing inclination θᵣ [degrees]";
    axis.high = azimuthal ? 180 : 90, axis.low = -axis.high, axis.step = axis.high / 2;
    return axis;
}

std::string lobe_label(TableKind kind) {
    switch (kind) {
        case TableKind::azimuthal:
            return "azimuthal lobe [1/rad]";
        case TableKind::longitudinal_back:
            return "backward lobe [1/rad]";
        default:
            return "forward lobe [1/rad]";
    }
}

/// Panels of lobes, and of differences where there is a second file.
struct Panels {
    plot::Panel lobes, errors;
};

Panels panels_of(const Sources& sources, const std::vector<std::string>& names, const RowOf& row,
                 const PlotPoint& point) {
    Panels panels;
    panels.lobes.title = fmt::format("σ = {:.3g}, g = {:.3g}", point.sigma, point.g);
    if (row.absorbs) panels.lobes.title += fmt::format(", σₐ = {:.3g}", row.absorption);
    std::vector<double> shown;
    double reach = 0;
    std::vector<plot::Curve> further;
    for (std::size_t p = 0; p < row.offsets.size(); ++p) {
        Parameters at;
        at.sigma = point.sigma, at.g = point.g, at.absorption = row.absorption;
        (row.kind == TableKind::azimuthal ? at.h : at.theta_i) = row.offsets[p];
        const std::size_t bins = sources[0]->bins(row.kind);
        const std::vector<double> reference = sources[0]->lobe(row.kind, at, bins);
        const double peak = most(reference);
        for (std::size_t s = 0; s < sources.size(); ++s) {
            if (!sources[s]->has(row.kind) || (at.absorption != 0 && !sources[s]->absorbs())) continue;
            sources[s]->check(row.kind, at, names[s]);
            plot::Curve curve;
            const std::size_t own = sources[s]->bins(row.kind);
            curve.x = exit_axis(exit_name(row.kind), own).values;
            for (double& x : curve.x) x *= 180 / pi;
            curve.y = sources[s]->lobe(row.kind, at, own);
            shown.insert(shown.end(), curve.y.begin(), curve.y.end());
            if (s == 0) {
                curve.colour = colours[p], curve.width = 2.6;
                panels.lobes.curves.push_back(std::move(curve));
                continue;
            }
            curve.stroke = strokes[(s - 1) % std::size(strokes)], curve.width = 1;
            plot::Curve error;
            error.colour = colours[p], error.width = 1.4;
            if (s > 1) error.stroke = strokes[(s - 1) % std::size(strokes)];
            error.x = panels.lobes.curves[p].x;
            error.y = sources[s]->lobe(row.kind, at, bins);
            for (std::size_t b = 0; b < bins; ++b) {
                error.y[b] = 100 * (error.y[b] - reference[b]) / peak;
                reach = std::max(reach, std::abs(error.y[b]));
            }
            further.push_back(std::move(curve));
            panels.errors.curves.push_back(std::move(error));
        }
    }
    // Drawn last, over all coloured lobes.
    for (plot::Curve& curve : further) panels.lobes.curves.push_back(std::move(curve));
    // Every lobe of the slab falls to 0 at +-90 degrees: the least of its values would leave no room for the others.
    const double high = most(shown);
    panels.lobes.x = panels.errors.x = exit_axis_of(row.kind);
    panels.lobes.y = plot::log_axis("", std::max(quantile(shown, 0.03), high * 1e-4), high);
    panels.errors.y = plot::symmetric_axis("", reach);
    return panels;
}

void add_rows(plot::Figure& figure, const Sources& sources, const std::vector<std::string>& names, const RowOf& of) {
    plot::Row lobes, errors;
    errors.height = 112;
    bool compared = false;
    for (const PlotPoint& point : of.at) {
        Panels panels = panels_of(sources, names, of, point);
        compared = compared || !panels.errors.curves.empty();
        lobes.panels.push_back(std::move(panels.lobes));
        errors.panels.push_back(std::move(panels.errors));
    }
    lobes.panels[0].y.label = lobe_label(of.kind);
    errors.panels[0].y.label = "error [% of peak]";
    for (std::size_t p = 0; p < of.offsets.size(); ++p) {
        plot::Curve entry;
        entry.colour = colours[p], entry.width = 2.6;
        entry.label = of.kind == TableKind::azimuthal ? fmt::format("h = {:.2g}", of.offsets[p])
                                                      : fmt::format("θᵢ = {:.3g}°", of.offsets[p] * 180 / pi);
        lobes.legend.push_back(std::move(entry));
    }
    if (compared)
        for (plot::Panel& panel : lobes.panels) panel.x.label.clear(), panel.x.numbers = false;
    figure.rows.push_back(std::move(lobes));
    if (compared) figure.rows.push_back(std::move(errors));
}

}  // namespace

plot::Figure lobe_figure(const Sources& sources, const std::vector<std::string>& names,
                         const std::vector<PlotPoint>& points) {
    plot::Figure figure;
    figure.title = (names[0] == "default" ? "Scattered lobes of the " : "Scattered lobes of ") +
                   plot::printable(label_of(names, 0));
    for (std::size_t s = 1; s < sources.size(); ++s) {
        if (std::none_of(lobe_kinds.begin(), lobe_kinds.end(),
                         [&](TableKind kind) { return sources[0]->has(kind) && sources[s]->has(kind); }))
            throw Error("{}: expected a kind of lobe that {} has, found none", names[s], names[0]);
        plot::Curve entry;
        entry.stroke = strokes[(s - 1) % std::size(strokes)], entry.width = 1;
        entry.label = plot::printable(label_of(names, s));
        figure.legend.push_back(std::move(entry));
    }
    if (!figure.legend.empty()) {
        plot::Curve entry;
        entry.width = 2.6, entry.colour = plot::grey, entry.label = plot::printable(label_of(names, 0));
        figure.legend.insert(figure.legend.begin(), std::move(entry));
    }
    for (const TableKind kind : lobe_kinds) {
        if (!sources[0]->has(kind)) continue;
        std::vector<double> absorptions;  // drawn already
        for (const double absorption : {0, 1}) {
            const RowOf row = row_of(*sources[0], kind, absorption, points);
            if (std::find(absorptions.begin(), absorptions.end(), row.absorption) != absorptions.end()) continue;
            absorptions.push_back(row.absorption);
            add_rows(figure, sources, names, row);
        }
    }
    return figure;
}

}  // namespace medulla::tables
