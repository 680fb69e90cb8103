#include "tables/table/table.hpp"

#include <algorithm>
#include <cmath>

#include "sim2d/disc/single.hpp"
#include "sim2d/slab/single.hpp"
#include "tables/error.hpp"

namespace medulla::tables {

const char* name_of(TableId table) { return table == TableId::azimuthal ? "azimuthal" : "longitudinal"; }

const Axis& Table::axis(const std::string& axis_name) const {
    for (const Axis& a : axes)
        if (a.name == axis_name) return a;
    throw Error("table {}: no axis {}", name(), axis_name);
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
    throw Error("table {}: no axis {}", name(), axis_name);
}

void Table::allocate() {
    const std::size_t n = cells();
    lobe.assign(n * bins(), 0.0f);
    for (auto* array : {&energy, &energy_error, &standard_error, &mean_length}) array->assign(n, 0.0);
}

Table& Tables::at(TableId id) {
    std::optional<Table>& table = (*this)[id];
    if (!table) throw Error("there is no {} table", name_of(id));
    return *table;
}

const Table& Tables::at(TableId id) const { return const_cast<Tables&>(*this).at(id); }

std::vector<const Table*> Tables::present() const {
    std::vector<const Table*> list;
    for (const TableId id : table_ids)
        if (const std::optional<Table>& table = (*this)[id]) list.push_back(&*table);
    return list;
}

std::optional<double> closed_form_energy(const Table& table, std::size_t cell) {
    if (table.id == TableId::longitudinal)
        return sim2d::slab_energy(table.parameter(cell, "sigma"), table.parameter(cell, "theta_i"));
    if (table.has_axis("absorption") && table.parameter(cell, "absorption") > 0) return std::nullopt;
    return sim2d::disc_energy(table.parameter(cell, "sigma"), table.parameter(cell, "h"));
}

namespace {

/// Energy of a cell with absorption: at most that of its unabsorbed first collisions, and at most that at the next
/// lower absorption.
template <class Fail>
void check_absorbed(const Table& table, std::size_t cell, const Fail& fail) {
    const double sigma = table.parameter(cell, "sigma"), a = table.parameter(cell, "absorption"),
                 most = sigma / (sigma + a) * sim2d::disc_energy(sigma + a, table.parameter(cell, "h"));
    const double energy = table.energy[cell], error = table.energy_error[cell];
    if (!(energy <= most + 5 * error + 1e-12))
        fail(fmt::format("expected an energy of at most {:.9g}, found {:.9g} with standard error {:.2e}", most, energy,
                         error));
    const std::size_t step = table.axis("h").size(), along = table.position(cell)[2];
    if (along == 0) return;
    const double before = table.energy[cell - step], noise = std::hypot(error, table.energy_error[cell - step]);
    if (!(energy <= before + 5 * noise + 1e-12))
        fail(fmt::format(
            "expected at most the energy {:.9g} of less absorption, found {:.9g} with standard error {:.2e}", before,
            energy, noise));
}

}  // namespace

void check_cells(const Table& table, const std::string& where) {
    const std::size_t sides = table.sides();
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
        // A sum of floats, each with a relative rounding of 2^-24.
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
        if (!expected) {
            check_absorbed(table, cell, fail);
            continue;
        }
        if (!(std::abs(energy - *expected) <= 5 * std::sqrt(variance) + 1e-12))
            fail(fmt::format("expected energy {:.9g}, found {:.9g} with standard error {:.2e}", *expected, energy,
                             std::sqrt(variance)));
    }
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

namespace {

/// Mean over an interval of the exponential through the values at its ends; of the line where one is 0 (few analog
/// paths).
double logarithmic_mean(double a, double b) {
    if (!(a > 0 && b > 0)) return (a + b) / 2;
    const double ratio = std::log(b / a);
    return std::abs(ratio) > 1e-4 ? (b - a) / ratio : (a + b) / 2;  // relative error ratio^2 / 12
}

}  // namespace

std::vector<double> survival_lengths(const Table& table) {
    if (!table.has_axis("absorption")) return {};
    std::vector<double> lengths = table.mean_length;
    const std::vector<double>&sigma = table.axis("sigma").values, &absorption = table.axis("absorption").values,
          &h = table.axis("h").values;
    const auto unknown = [&](double s, double offset) { return !(sim2d::disc_energy(s, offset) > 0); };
    for (std::size_t cell = 0; cell < table.cells(); ++cell) {
        const double a = table.parameter(cell, "absorption"), s = table.parameter(cell, "sigma"),
                     offset = table.parameter(cell, "h");
        if (a == 0 || unknown(s, offset)) continue;
        const double left = table.energy[cell] / sim2d::disc_energy(s, offset);
        if (!(left > 0)) throw Error("table {}: {}: expected an energy > 0", table.name(), table.describe(cell));
        lengths[cell] = -std::log(left) / a;
    }
    // a l is the integral of the mean length over the absorption. Logarithmic means between nodes have errors of a few
    // percent, which are about the same in neighbours where l is known: the ratios of up to three neighbours, `step`
    // cells apart, are extrapolated and correct it.
    const std::size_t along = h.size(), row = table.cells() / sigma.size();
    const auto integrals = [&](std::size_t cell) {  // `cell` has the least absorption
        std::vector<double> sums{absorption[0] * table.mean_length[cell]};
        for (std::size_t k = 1; k < absorption.size(); ++k) {
            const double from = table.mean_length[cell + (k - 1) * along], to = table.mean_length[cell + k * along];
            sums.push_back(sums.back() + (absorption[k] - absorption[k - 1]) * logarithmic_mean(from, to));
        }
        return sums;
    };
    const auto extend = [&](std::size_t cell, std::ptrdiff_t step, const std::vector<double>& x) {
        const std::vector<double> here = integrals(cell);
        std::vector<std::vector<double>> ratios(absorption.size());
        for (std::size_t i = 1; i <= x.size(); ++i) {
            const std::size_t other = cell + static_cast<std::size_t>(step * static_cast<std::ptrdiff_t>(i));
            const std::vector<double> there = integrals(other);
            for (std::size_t k = 0; k < absorption.size(); ++k)
                ratios[k].push_back(there[k] > 0 ? lengths[other + k * along] / there[k] : 1);
        }
        for (std::size_t k = 0; k < absorption.size(); ++k)
            if (absorption[k] > 0 && !x.empty()) lengths[cell + k * along] = here[k] * extrapolate(x, ratios[k], 0);
    };
    std::vector<double> half_chords, thin;
    for (std::size_t i = h.size() - 1; i-- > 0 && half_chords.size() < 3;)
        half_chords.push_back(std::sqrt((1 - h[i]) * (1 + h[i])));
    for (std::size_t i = 1; i < sigma.size() && thin.size() < 3; ++i) thin.push_back(sigma[i]);
    for (const bool rim : {true, false})  // h = 1 first, so that sigma = 0 has neighbours there
        for (std::size_t cell = 0; cell < table.cells(); ++cell) {
            const double s = table.parameter(cell, "sigma"), offset = table.parameter(cell, "h");
            if (table.parameter(cell, "absorption") != absorption[0]) continue;
            if (rim && s > 0 && offset == 1) extend(cell, -1, half_chords);
            if (!rim && s == 0) extend(cell, static_cast<std::ptrdiff_t>(row), thin);
        }
    return lengths;
}

std::vector<double> side_lobes(const Table& table, std::size_t side) {
    const std::size_t bins = table.bins(), sides = table.sides();
    const std::size_t n = table.cells() / sides;
    std::vector<double> values(n * bins);
    for (std::size_t c = 0; c < n; ++c) {
        const float* from = table.lobe_of(c * sides + side);
        for (std::size_t b = 0; b < bins; ++b) values[c * bins + b] = static_cast<double>(from[b]);
    }
    return values;
}

}  // namespace medulla::tables
