#include "tables/table.hpp"

#include <algorithm>
#include <cmath>

#include "medulla/lookup.hpp"
#include "tables/error.hpp"

namespace medulla::tables {

const Axis& Table::axis(const std::string& axis_name) const {
    for (const Axis& a : axes)
        if (a.name == axis_name) return a;
    throw Error("table {}: no axis {}", name, axis_name);
}

bool Table::has_axis(const std::string& axis_name) const {
    return std::any_of(axes.begin(), axes.end(), [&](const Axis& a) { return a.name == axis_name; });
}

std::size_t Table::cells() const {
    std::size_t n = 1;
    for (std::size_t k = 0; k + 1 < axes.size(); ++k) n *= axes[k].size();
    return n;
}

std::vector<std::size_t> Table::position(std::size_t cell) const {
    std::vector<std::size_t> index(axes.size() - 1);
    for (std::size_t k = index.size(); k-- > 0;) {
        index[k] = cell % axes[k].size();
        cell /= axes[k].size();
    }
    return index;
}

std::string Table::describe(std::size_t cell) const {
    const std::vector<std::size_t> index = position(cell);
    std::string text;
    for (std::size_t k = 0; k < index.size(); ++k) {
        const double x = axes[k].values[index[k]];
        if (!text.empty()) text += ", ";
        if (axes[k].name == "side")
            text += x == 0 ? "back" : "forward";
        else
            text += fmt::format("{} {:g}", axes[k].name, x);
    }
    return text;
}

double Table::parameter(std::size_t cell, const std::string& axis_name) const {
    const std::vector<std::size_t> index = position(cell);
    for (std::size_t k = 0; k < index.size(); ++k)
        if (axes[k].name == axis_name) return axes[k].values[index[k]];
    throw Error("table {}: no axis {}", name, axis_name);
}

void Table::allocate() {
    const std::size_t n = cells();
    lobe.assign(n * bins(), 0.0f);
    for (auto* array : {&energy, &energy_error, &standard_error, &mean_length}) array->assign(n, 0.0);
}

std::vector<const Table*> Tables::present() const {
    std::vector<const Table*> list;
    if (azimuthal) list.push_back(&*azimuthal);
    if (longitudinal) list.push_back(&*longitudinal);
    return list;
}

std::optional<double> closed_form_energy(const Table& table, std::size_t cell) {
    if (table.name == "longitudinal")
        return longitudinal_energy(table.parameter(cell, "sigma"), table.parameter(cell, "theta_i"));
    if (table.has_axis("absorption") && table.parameter(cell, "absorption") > 0) return std::nullopt;
    return azimuthal_energy(table.parameter(cell, "sigma"), table.parameter(cell, "h"));
}

double extrapolate(const std::vector<double>& x, const std::vector<double>& y, double to) {
    double value = 0;
    for (std::size_t a = 0; a < x.size(); ++a) {
        double lagrange = 1;
        for (std::size_t b = 0; b < x.size(); ++b)
            if (b != a) lagrange *= (to - x[b]) / (x[a] - x[b]);
        value += lagrange * y[a];
    }
    return value;
}

std::vector<double> survival_lengths(const Table& table) {
    if (!table.has_axis("absorption")) return {};
    std::vector<double> lengths = table.mean_length;
    const std::vector<double>&sigma = table.axis("sigma").values, &h = table.axis("h").values;
    const auto unknown = [&](double s, double offset) { return !(azimuthal_energy(s, offset) > 0); };
    for (std::size_t cell = 0; cell < table.cells(); ++cell) {
        const double a = table.parameter(cell, "absorption"), s = table.parameter(cell, "sigma"),
                     offset = table.parameter(cell, "h");
        if (a == 0 || unknown(s, offset)) continue;
        const double left = table.energy[cell] / azimuthal_energy(s, offset);
        if (!(left > 0)) throw Error("table {}: {}: expected an energy > 0", table.name, table.describe(cell));
        lengths[cell] = -std::log(left) / a;
    }
    // Three known neighbours, `step` cells apart; where there are fewer, the polynomial through those.
    const auto extend = [&](std::size_t cell, std::ptrdiff_t step, const std::vector<double>& x) {
        std::vector<double> y;
        for (std::size_t i = 1; i <= x.size(); ++i)
            y.push_back(lengths[cell + static_cast<std::size_t>(step * static_cast<std::ptrdiff_t>(i))]);
        if (!x.empty()) lengths[cell] = extrapolate(x, y, 0);
    };
    std::vector<double> half_chords, thin;
    for (std::size_t i = h.size() - 1; i-- > 0 && half_chords.size() < 3;)
        half_chords.push_back(std::sqrt((1 - h[i]) * (1 + h[i])));
    for (std::size_t i = 1; i < sigma.size() && thin.size() < 3; ++i) thin.push_back(sigma[i]);
    const auto row = static_cast<std::ptrdiff_t>(table.cells() / sigma.size());
    for (const bool rim : {true, false})  // the rim first, so that sigma = 0 has neighbours there
        for (std::size_t cell = 0; cell < table.cells(); ++cell) {
            const double s = table.parameter(cell, "sigma"), offset = table.parameter(cell, "h");
            if (table.parameter(cell, "absorption") == 0) continue;
            if (rim && s > 0 && offset == 1) extend(cell, -1, half_chords);
            if (!rim && s == 0) extend(cell, row, thin);
        }
    return lengths;
}

std::vector<double> side_lobes(const Table& table, std::size_t side) {
    const std::size_t bins = table.bins(), sides = table.name == "longitudinal" ? 2 : 1;
    const std::size_t n = table.cells() / sides;
    std::vector<double> values(n * bins);
    for (std::size_t c = 0; c < n; ++c) {
        const float* from = table.lobe_of(c * sides + side);
        for (std::size_t b = 0; b < bins; ++b) values[c * bins + b] = static_cast<double>(from[b]);
    }
    return values;
}

}  // namespace medulla::tables
