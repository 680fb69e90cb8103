#include "tables/pack/source.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <tuple>

#include "medulla/baked.hpp"
#include "medulla/default_pack.hpp"
#include "medulla/lookup.hpp"
#include "tables/error.hpp"
#include "tables/pack/spline.hpp"
#include "tables/parallel.hpp"
#include "tables/store/file.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {
namespace {

/// Lobes of a table, interpolated by the same splines as in a pack.
class TableSource : public Source {
  public:
    explicit TableSource(Tables tables) : tables_(std::move(tables)) {
        for (const Table* table : tables_.present())
            for (const Axis& axis : parameters_of(*table))
                splines_.emplace(table->name() + axis.name, Spline::through(quantity_of(axis.name), axis.values));
        if (tables_.azimuthal) lengths_ = survival_lengths(*tables_.azimuthal);
    }

    bool has(TableKind kind) const override { return find(kind) != nullptr; }
    std::vector<Axis> parameter_axes(TableKind kind) const override { return parameters_of(*find(kind)); }
    std::size_t bins(TableKind kind) const override { return find(kind)->bins(); }

    std::vector<double> lobe(TableKind kind, const Parameters& at, std::size_t bins) const override {
        const Table& table = *find(kind);
        const std::size_t own = table.bins();
        if (own % bins != 0 && bins % own != 0)
            throw Error("expected {} bins to divide or be a multiple of the table's {}", bins, own);
        std::vector<double> values(own, 0.0);
        for_nodes(table, at, [&](std::size_t cell, double weight) {
            const float* from = table.lobe_of(cell + side_of(kind));
            for (std::size_t b = 0; b < own; ++b) values[b] += weight * static_cast<double>(from[b]);
        });
        std::vector<double> out(bins, 0.0);
        if (bins <= own) {
            const std::size_t n = own / bins;
            for (std::size_t b = 0; b < own; ++b) out[b / n] += values[b] / static_cast<double>(n);
        } else {
            for (std::size_t b = 0; b < bins; ++b) out[b] = values[b / (bins / own)];
        }
        return out;
    }

    double noise(TableKind kind, const Parameters& at) const override {
        const Table& table = *find(kind);
        double noise = 0;
        for_nodes(table, at, [&](std::size_t cell, double weight) {
            noise += weight * table.standard_error[cell + side_of(kind)];
        });
        return std::abs(noise);
    }

    double signed_back_fraction(const Parameters& at) const override {
        const Table& table = *tables_.longitudinal;
        double back = 0, total = 0;
        for_nodes(table, at, [&](std::size_t cell, double weight) {
            back += weight * table.energy[cell];
            total += weight * (table.energy[cell] + table.energy[cell + 1]);
        });
        return total > 0 ? back / total : 0.5;  // no scattered energy: any share
    }

    double signed_survival_length(const Parameters& at) const override {
        if (lengths_.empty()) return 0;
        double length = 0;
        for_nodes(*tables_.azimuthal, at, [&](std::size_t cell, double weight) { length += weight * lengths_[cell]; });
        return length;
    }

  private:
    static std::vector<Axis> parameters_of(const Table& table) {
        std::vector<Axis> list;
        for (const Axis& axis : table.axes)
            if (axis.name != "side" && !axis_rule(axis.name).bins) list.push_back(axis);
        return list;
    }
    const Table* find(TableKind kind) const {
        const std::optional<Table>& table = tables_[table_of(kind)];
        return table ? &*table : nullptr;
    }
    /// Calls f(first cell of the node, weight) for every node with a weight; longitudinal nodes own two cells.
    template <class F>
    void for_nodes(const Table& table, const Parameters& at, F f) const {
        std::vector<std::pair<std::size_t, double>> nodes = {{0, 1.0}};  // cells of the axes so far, with weights
        for (const Axis& axis : parameters_of(table)) {
            Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(static_cast<Eigen::Index>(axis.size()));
            const double x = at[axis.name];
            const auto found = std::find(axis.values.begin(), axis.values.end(), x);
            const Spline& spline = splines_.at(table.name() + axis.name);
            if (found != axis.values.end())
                row[found - axis.values.begin()] = 1;
            else
                row = spline.basis(spline_coordinate(quantity_of(axis.name), x)) * spline.from_nodes();
            std::vector<std::pair<std::size_t, double>> next;
            for (const auto& [node, weight] : nodes)
                for (std::size_t i = 0; i < axis.size(); ++i) {
                    const double here = weight * row[static_cast<Eigen::Index>(i)];
                    if (here != 0) next.emplace_back(node * axis.size() + i, here);
                }
            nodes = std::move(next);
        }
        for (const auto& [node, weight] : nodes) f(node * table.sides(), weight);
    }

    Tables tables_;
    std::map<std::string, Spline> splines_;
    std::vector<double> lengths_;  ///< survival_lengths
};

/// Limits of a pack: nodes of an axis as in a tables file, and lobes that a program can list.
constexpr std::uint32_t most_nodes = 4096, most_lobes = 10000000;

/// Lobes of a pack, by the runtime's own contraction.
class PackSource : public Source {
  public:
    PackSource(std::vector<unsigned char> bytes, const std::string& path) : bytes_(std::move(bytes)) {
        const OpenResult opened = open_pack(bytes_.data(), bytes_.size());
        if (opened.status != PackStatus::ok) throw Error("{}: expected a pack: {}", path, describe(opened.status));
        pack_ = opened.pack;
        for (const TableView& table : pack_.tables)
            if (table) check_nodes(table, path);
        for (const TableKind kind : lobe_kinds)
            noise_[static_cast<std::size_t>(kind)] = stated(pack_, kind, "input_noise", 0.0);
    }

    bool has(TableKind kind) const override { return static_cast<bool>(pack_[kind]); }

    std::vector<Axis> parameter_axes(TableKind kind) const override {
        const TableView& table = pack_[kind];
        std::vector<Axis> list;
        for (std::uint32_t k = 0; k < table.parameter_axes(); ++k) {
            const auto quantity = static_cast<Quantity>(table.layout.axes[k].quantity);
            Axis axis{medulla::tables::name_of(quantity), {}};
            for (std::uint32_t i = 0; i < table.layout.axes[k].nodes && i <= table.layout.axes[k].spans; ++i)
                axis.values.push_back(from_spline_coordinate(
                    quantity, static_cast<double>(table.axis(k).knot(static_cast<std::int32_t>(i)).t)));
            list.push_back(std::move(axis));
        }
        return list;
    }

    std::size_t bins(TableKind kind) const override {
        const TableView& table = pack_[kind];
        return table.layout.axes[table.parameter_axes()].nodes;
    }

    std::vector<double> lobe(TableKind kind, const Parameters& at, std::size_t bins) const override {
        const TableView& table = pack_[kind];
        const Contraction contraction = contract(table, query(at));
        const std::uint32_t exit = table.parameter_axes(), rows = table.layout.axes[exit].spans + 3;
        // Spline coefficients for y > 0 and y < 0: even part plus and minus the odd one.
        std::vector<double> coefficients[2] = {std::vector<double>(rows), std::vector<double>(rows)};
        for (std::uint32_t j = 0; j < rows; ++j) {
            const unsigned char* block = table.row(exit, j);
            double part[2] = {0, 0};
            for (std::uint32_t first = 0; first < table.layout.rank_stride; first += rank_multiple) {
                const std::uint32_t bits = table.bits(first);
                for (std::uint32_t r = 0; r < rank_multiple; ++r)
                    part[first < table.even_stride() ? 0 : 1] +=
                        static_cast<double>(contraction.weight[first + r]) * load_number(block, bits, r);
                block += bits;
            }
            const auto scale = static_cast<double>(contraction.inverse_integral);
            coefficients[0][j] = (part[0] + part[1]) * scale, coefficients[1][j] = (part[0] - part[1]) * scale;
        }
        // Averages of medulla::lobe: bins where the low-rank sum may become negative, and is clamped to 0, are split
        // into sixteen.
        const std::vector<Point>&coarse = gauss_points(kind, bins, 1), &fine = gauss_points(kind, bins, 16);
        std::vector<double> out(bins, 0.0);
        const auto add = [&](std::size_t bin, const std::vector<Point>& points) {
            const std::size_t count = points.size() / bins;
            for (std::size_t i = bin * count; i < (bin + 1) * count; ++i) {
                const double* c = &coefficients[points[i].negative ? 1 : 0][points[i].span];
                double value = 0;
                for (std::uint32_t t = 0; t < 4; ++t) value += points[i].basis[t] * c[t];
                out[bin] += points[i].weight * std::max(value, 0.0);
            }
        };
        for (std::size_t bin = 0; bin < bins; ++bin) {
            bool undershoots = false;
            for (std::size_t i = 3 * bin; i < 3 * bin + 3; ++i) {
                const double* c = &coefficients[coarse[i].negative ? 1 : 0][coarse[i].span];
                undershoots = undershoots || std::min({c[0], c[1], c[2], c[3]}) < 0;
            }
            add(bin, undershoots ? fine : coarse);
        }
        return out;
    }

    double noise(TableKind kind, const Parameters&) const override { return noise_[static_cast<std::size_t>(kind)]; }

    double signed_back_fraction(const Parameters& at) const override {
        const TableView& table = pack_[TableKind::back_fraction];
        if (!table) throw Error("the pack has no table of the slab's energies");
        return static_cast<double>(scalar(table, contract(table, query(at))));
    }

    double signed_survival_length(const Parameters& at) const override {
        if (!absorbs()) return 0;
        const TableView& table = pack_[TableKind::survival];
        if (!table) throw Error("the pack has no table of what absorption leaves");
        return static_cast<double>(scalar(table, contract(table, query(at))));
    }

  private:
    /// The runtime does not use node counts, so open_pack does not bound them; programs evaluate one lobe per node.
    static void check_nodes(const TableView& table, const std::string& path) {
        double lobes = 1;
        for (std::uint32_t k = 0; k < table.layout.axis_count; ++k) {
            const std::uint32_t nodes = table.layout.axes[k].nodes;
            if (nodes < 1 || nodes > most_nodes)
                throw Error("{}: {}: expected 1 to {} nodes on an axis, found {}", path,
                            name_of(static_cast<TableKind>(table.layout.kind)), most_nodes, nodes);
            if (k < table.parameter_axes()) lobes *= nodes;
        }
        if (lobes > most_lobes)
            throw Error("{}: {}: expected at most {} lobes, found {:g}", path,
                        name_of(static_cast<TableKind>(table.layout.kind)), most_lobes, lobes);
    }

    struct Point {
        std::uint32_t span;
        bool negative;
        double basis[4], weight;
    };
    static LobeQuery query(const Parameters& at) {
        LobeQuery q;
        q.sigma = static_cast<float>(at.sigma), q.g = static_cast<float>(at.g), q.h = static_cast<float>(at.h);
        q.theta_i = static_cast<float>(at.theta_i), q.absorption = static_cast<float>(at.absorption);
        return q;
    }
    /// The spline basis at three Gauss points of each part of a bin, computed once per number of bins.
    const std::vector<Point>& gauss_points(TableKind kind, std::size_t bins, int parts) const {
        const std::lock_guard<std::mutex> lock(mutex_);
        std::vector<Point>& points = points_[{kind, bins, parts}];
        if (!points.empty()) return points;
        const TableView& table = pack_[kind];
        const AxisView<float> axis = table.axis(table.parameter_axes());
        const double high = static_cast<double>(axis.upper()), width = 2 * high / static_cast<double>(bins) / parts;
        const double node[3] = {0.5 - std::sqrt(0.15), 0.5, 0.5 + std::sqrt(0.15)},
                     weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
        for (std::size_t part = 0; part < bins * static_cast<std::size_t>(parts); ++part)
            for (int i = 0; i < 3; ++i) {
                const auto y = static_cast<float>((static_cast<double>(part) + node[i]) * width - high);
                const Cell<float> cell = locate(axis, std::abs(y));
                const SplineWeights<float> w = spline_weights(axis, cell);
                points.push_back({cell.span, y < 0, {w.w[0], w.w[1], w.w[2], w.w[3]}, weight[i] / parts});
            }
        return points;
    }

    std::vector<unsigned char> bytes_;
    PackView pack_;
    std::array<double, lobe_kinds.size()> noise_ = {};
    mutable std::mutex mutex_;
    mutable std::map<std::tuple<TableKind, std::size_t, int>, std::vector<Point>> points_;
};

double norm2(const std::vector<double>& v) {
    double sum = 0;
    for (const double x : v) sum += x * x;
    return sum;
}

}  // namespace

double Parameters::operator[](const std::string& axis) const {
    Parameters copy = *this;
    return *copy.field(axis);
}

void Parameters::set(const std::string& axis, double value) { *field(axis) = value; }

double* Parameters::field(const std::string& axis) {
    if (axis == "sigma") return &sigma;
    if (axis == "g") return &g;
    if (axis == "h") return &h;
    if (axis == "theta_i") return &theta_i;
    if (axis == "absorption") return &absorption;
    throw Error("axis '{}' is no parameter of a lobe", axis);
}

const char* name_of(TableKind kind) {
    constexpr const char* names[] = {"azimuthal", "longitudinal back", "longitudinal forward", "longitudinal energies",
                                     "azimuthal survival"};
    static_assert(std::size(names) == table_kinds);
    return names[static_cast<std::size_t>(kind)];
}

TableId table_of(TableKind kind) {
    const bool disc = kind == TableKind::azimuthal || kind == TableKind::survival;
    return disc ? TableId::azimuthal : TableId::longitudinal;
}

std::size_t side_of(TableKind kind) { return kind == TableKind::longitudinal_forward ? 1 : 0; }

const char* exit_name(TableKind kind) { return kind == TableKind::azimuthal ? "phi" : "theta_r"; }

void Source::check(TableKind kind, const Parameters& at, const std::string& path) const {
    if (!has(kind)) throw Error("{}: expected a table of {} lobes, found none", path, name_of(kind));
    if (kind == TableKind::azimuthal && at.absorption != 0 && !absorbs())
        throw Error("{}: expected absorption 0, since there is no such axis, found {:g}", path, at.absorption);
    if (const std::string text = beyond(kind, at); !text.empty()) throw Error("{}: {}", path, text);
}

std::string Source::beyond(TableKind kind, const Parameters& at) const {
    if (!has(kind)) return "";
    for (const Axis& axis : parameter_axes(kind)) {
        const double x = at[axis.name], low = axis.values.front(), high = axis.values.back();
        // A pack stores its axes as floats: the end of an axis is accepted within their rounding.
        const double slack = 1e-6 * std::max(std::abs(low), std::abs(high));
        // Messages have angles in degrees, as on the command line.
        const double unit = axis.name == "theta_i" ? pi / 180 : 1;
        if (!(x >= low - slack && x <= high + slack))
            return fmt::format("{} expected in [{:g}, {:g}]{}, found {:g}", axis.name, low / unit, high / unit,
                               unit == 1 ? "" : " degrees", x / unit);
    }
    return "";
}

double stated(const PackView& pack, TableKind kind, const char* what, double otherwise) {
    const auto text = nlohmann::json::parse(pack.text, pack.text + pack.text_bytes, nullptr, false);
    const auto place = nlohmann::json::json_pointer(fmt::format("/fit/{}/{}", name_of(kind), what));
    if (!text.is_object() || !text.contains(place) || !text[place].is_number()) return otherwise;
    const double value = text[place].get<double>();
    return value >= 0 ? value : otherwise;
}

double Source::back_fraction(const Parameters& at) const { return std::clamp(signed_back_fraction(at), 0.0, 1.0); }

double Source::survival(const Parameters& at) const { return survival_of(at.absorption, signed_survival_length(at)); }

bool Source::absorbs() const {
    if (!has(TableKind::azimuthal)) return false;
    const std::vector<Axis> axes = parameter_axes(TableKind::azimuthal);
    return std::any_of(axes.begin(), axes.end(), [](const Axis& axis) { return axis.name == "absorption"; });
}

double energy_of(const Source& source, TableKind kind, const Parameters& at) {
    if (kind == TableKind::azimuthal) return azimuthal_energy(at.sigma, at.h) * source.survival(at);
    const double back = source.back_fraction(at), total = longitudinal_energy(at.sigma, at.theta_i);
    return total * (kind == TableKind::longitudinal_back ? back : 1 - back);
}

std::unique_ptr<Source> table_source(Tables tables) { return std::make_unique<TableSource>(std::move(tables)); }

std::unique_ptr<Source> pack_source(std::vector<unsigned char> bytes, const std::string& path) {
    return std::make_unique<PackSource>(std::move(bytes), path);
}

std::unique_ptr<Source> open_source(const std::string& path) {
    if (path != "default" && is_hdf5(path)) return table_source(read_tables(path));
    return pack_source(read_pack(path, true), path);
}

std::vector<unsigned char> read_pack(const std::string& path, bool or_tables) {
    constexpr std::uint64_t greatest_pack = std::uint64_t{1} << 32;  // its offsets have 32 bits
    if (path == "default") {
        const auto* bytes = reinterpret_cast<const unsigned char*>(default_pack_words);
        return {bytes, bytes + default_pack_size};
    }
    std::vector<unsigned char> bytes = read_file(path, greatest_pack);
    const OpenResult opened = open_pack(bytes.data(), bytes.size());
    const bool is_baked_magic =
        bytes.size() >= sizeof baked_magic && std::memcmp(bytes.data(), baked_magic, sizeof baked_magic) == 0;
    if (opened.status != PackStatus::ok)
        throw Error("{}: expected a {}pack of version {}: {}", path, or_tables ? "tables file (HDF5) or a " : "",
                    pack_version,
                    !or_tables && is_hdf5(path) ? "found a tables file (HDF5)"
                    : is_baked_magic            ? "found a baked material, which has no tables"
                                                : describe(opened.status));
    return bytes;
}

std::vector<LobeError> compare(const Source& reference, const Source& candidate) {
    std::vector<LobeError> errors;
    for (const TableKind kind : lobe_kinds) {
        if (!reference.has(kind) || !candidate.has(kind)) continue;
        const std::vector<Axis> axes = reference.parameter_axes(kind);
        const std::size_t bins = reference.bins(kind);
        LobeError error;
        error.kind = kind;
        error.lobes = 1;
        for (const Axis& axis : axes) error.lobes *= axis.size();
        const bool survives = kind == TableKind::azimuthal && reference.absorbs() && candidate.absorbs();
        std::vector<double> misfit(error.lobes), norm(error.lobes), energy(error.lobes), least(error.lobes),
            survival(error.lobes, 0.0);
        const auto parameters = [&](std::size_t index) {
            Parameters at;
            for (std::size_t k = axes.size(); k-- > 0; index /= axes[k].size())
                at.set(axes[k].name, axes[k].values[index % axes[k].size()]);
            return at;
        };
        std::vector<double> noise(error.lobes), back_share(error.lobes, 0.0);
        const bool shares = kind != TableKind::azimuthal && reference.has(TableKind::back_fraction) &&
                            candidate.has(TableKind::back_fraction);
        const std::atomic<bool> never{false};
        in_parallel(error.lobes, 0, never, [&](std::size_t i) {
            const Parameters at = parameters(i);
            const std::vector<double> a = reference.lobe(kind, at, bins);
            std::vector<double> b = candidate.lobe(kind, at, bins);
            noise[i] = reference.noise(kind, at);
            if (shares && at.sigma > 0)  // else there is no energy
                back_share[i] = std::abs(candidate.back_fraction(at) - reference.back_fraction(at));
            const double width = (kind == TableKind::azimuthal ? 2 * pi : pi) / static_cast<double>(bins);
            double sum = 0, low = b[0];
            for (std::size_t j = 0; j < bins; ++j) {
                sum += b[j];
                low = std::min(low, b[j]);
                b[j] -= a[j];
            }
            norm[i] = norm2(a), misfit[i] = norm2(b), energy[i] = std::abs(sum * width - 1), least[i] = low;
            if (survives) survival[i] = std::abs(candidate.survival(at) - reference.survival(at));
        });
        if (survives) error.survival = *std::max_element(survival.begin(), survival.end());
        double total = 0, total_misfit = 0, total_noise = 0;
        error.least = least[0];
        std::size_t worst = 0;
        for (std::size_t i = 0; i < error.lobes; ++i) {
            total += norm[i];
            total_misfit += misfit[i];
            total_noise += norm[i] * noise[i] * noise[i];
            error.worst_claim = std::max(error.worst_claim, std::sqrt(misfit[i] / norm[i] + noise[i] * noise[i]));
            error.energy = std::isnan(energy[i]) ? energy[i] : std::max(error.energy, energy[i]);  // NaN propagates
            error.least = std::min(error.least, least[i]);
            if (misfit[i] * norm[worst] > misfit[worst] * norm[i]) worst = i;
        }
        error.relative = std::sqrt(total_misfit / total);
        error.worst = std::sqrt(misfit[worst] / norm[worst]);
        error.noise = std::sqrt(total_noise / total), error.claim = std::hypot(error.relative, error.noise);
        error.back_share = *std::max_element(back_share.begin(), back_share.end());
        const Parameters at = parameters(worst);
        for (const Axis& axis : axes)
            error.worst_at += fmt::format("{}{} {:g}", error.worst_at.empty() ? "" : ", ", axis.name, at[axis.name]);
        errors.push_back(error);
    }
    return errors;
}

}  // namespace medulla::tables
