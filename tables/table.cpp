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

void check_cells(const Table& table, const std::string& where) {
    const std::size_t sides = table.name == "longitudinal" ? 2 : 1;
    const double width = bin_width(table.exit());
    for (std::size_t cell = 0; cell < table.cells(); ++cell) {
        const auto fail = [&](const std::string& what) {
            throw Error("{}: {}: {}", where, table.describe(cell), what);
        };
        double sum = 0;
        for (std::size_t b = 0; b < table.bins(); ++b) {
            const auto value = static_cast<double>(table.lobe_of(cell)[b]);
            if (!(value >= 0)) fail(fmt::format("expected a density >= 0, found {:g}", value));
            sum += value * width;
        }
        // Sums of float values: each is rounded by 2^-24 relative.
        if (!(std::abs(sum - 1) <= 1e-6)) fail(fmt::format("expected a lobe of integral 1, found {:.9g}", sum));
        for (const auto* array : {&table.energy, &table.energy_error, &table.standard_error, &table.mean_length})
            if (!((*array)[cell] >= 0))
                fail(fmt::format("expected an energy, errors and a length >= 0, found {:g}", (*array)[cell]));
        if (cell % sides != 0) continue;
        double energy = 0, variance = 0;
        for (std::size_t s = 0; s < sides; ++s) {
            energy += table.energy[cell + s];
            variance += table.energy_error[cell + s] * table.energy_error[cell + s];
        }
        const std::optional<double> expected = closed_form_energy(table, cell);
        if (!(energy <= 1 + 1e-12) || (expected && !(std::abs(energy - *expected) <= 5 * std::sqrt(variance) + 1e-12)))
            fail(fmt::format("expected energy {:.9g}, found {:.9g} with standard error {:.2e}", expected.value_or(1),
                             energy, std::sqrt(variance)));
    }
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
