#include "tables/table.hpp"

#include <cmath>

#include "medulla/lookup.hpp"
#include "tables/error.hpp"

namespace medulla::tables {

const Axis& Table::axis(const std::string& axis_name) const {
    for (const Axis& a : axes)
        if (a.name == axis_name) return a;
    throw Error("table {}: no axis {}", name, axis_name);
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
    for (const Axis& axis : table.axes)
        if (axis.name == "absorption") return std::nullopt;
    return azimuthal_energy(table.parameter(cell, "sigma"), table.parameter(cell, "h"));
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
