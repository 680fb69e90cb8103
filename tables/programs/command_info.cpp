// furtable info and furtable verify: contents of a file, and whether they are valid.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "medulla/lookup.hpp"
#include "tables/bake/baked_file.hpp"
#include "tables/bake/fibre_file.hpp"
#include "tables/programs/bake.hpp"
#include "tables/programs/commands.hpp"
#include "tables/programs/number.hpp"
#include "tables/store/json_text.hpp"
#include "tables/store/slices.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {
namespace {

struct InfoArguments {
    std::vector<std::string> files;
    bool json = false;
};

bool is_tables(const std::string& path) { return path != "default" && is_hdf5(path); }

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
}

nlohmann::ordered_json axis_json(const Axis& axis) {
    return {{"name", axis.name}, {"unit", axis_rule(axis.name).unit}, {"nodes", axis.size()}, {"values", axis.values}};
}

nlohmann::ordered_json info(const std::string& path) {
    if (is_baked(path)) return baked_info(path);
    if (is_fibre_file(path)) return fibre_info(path);
    nlohmann::ordered_json json = {{"file", json_name(path)}};
    if (is_tables(path)) {
        const Tables tables = read_tables(path);
        json["kind"] = "tables";
        json["program"] = tables.program;
        json["sha256"] = hex(contents_hash(tables));
        json["configuration"] = hex(configuration_hash(tables));
        for (const Table* table : tables.present()) {
            nlohmann::ordered_json& out = json["tables"][table->name()];
            out["method"] = table->method;
            out["seed"] = table->seed;
            out["paths"] = table->paths;
            if (table->target_error > 0) out["target_error"] = table->target_error;
            if (table->time_budget > 0) out["time_budget"] = table->time_budget;
            for (const Axis& axis : table->axes) out["axes"].push_back(axis_json(axis));
            out["standard_error"] = {
                {"median", median(table->standard_error)},
                {"worst", *std::max_element(table->standard_error.begin(), table->standard_error.end())}};
        }
        return json;
    }
    const std::vector<unsigned char> bytes = read_pack(path, true);
    const PackView pack = open_pack(bytes.data(), bytes.size()).pack;
    const auto source = pack_source(bytes, path);
    json["kind"] = "pack";
    json["format_version"] = pack_version;
    json["bytes"] = bytes.size();
    for (const TableView& table : pack.tables) {
        if (!table) continue;
        const auto kind = static_cast<TableKind>(table.layout.kind);
        nlohmann::ordered_json& out = json["tables"][name_of(kind)];
        out["rank"] = table.layout.even_rank + table.layout.odd_rank;
        out["even_rank"] = table.layout.even_rank;
        for (const Axis& axis : source->parameter_axes(kind)) out["axes"].push_back(axis_json(axis));
        if (table.has_exit())
            out["exit"] = {{"name", exit_name(kind)},
                           {"bins", source->bins(kind)},
                           {"spans", table.layout.axes[table.parameter_axes()].spans}};
    }
    json["provenance"] =
        parse_json<nlohmann::ordered_json>(pack.text, pack.text + pack.text_bytes, path + ": provenance");
    return json;
}

void print_axes(const nlohmann::ordered_json& axes) {
    for (const auto& axis : axes) {
        const std::vector<double> values = axis["values"];
        print("    {:<10} {:>11}, {:.6g} .. {:.6g} [{}]\n", axis["name"].get<std::string>(),
              counted(values.size(), "node"), values.front(), values.back(), axis["unit"].get<std::string>());
    }
}

/// `auto` uses no paths in cells where its grids reach the error of that many paths.
std::string how_solved(const nlohmann::ordered_json& table) {
    const std::string method = one_line(table["method"].get<std::string>());
    const auto paths = table["paths"].get<std::uint64_t>();
    std::string text = fmt::format("method {}", method);
    if (method == "auto" && paths > 0)
        return text + fmt::format(": without paths, or with {} (seed {}) where these give a smaller error", paths,
                                  table["seed"].get<std::uint64_t>());
    if (method != "deterministic") text += fmt::format(", seed {}", table["seed"].get<std::uint64_t>());
    if (paths > 0) text += fmt::format(", paths {}", paths);
    return text;
}

void run_info(const InfoArguments& args) {
    for (const std::string& file : args.files) {
        const nlohmann::ordered_json json = info(file);
        if (args.json) {
            print("{}\n", json_line(json));
            continue;
        }
        if (json["kind"] == "baked material") {
            print("{}: baked material of version {}, {} bytes\n", file, baked_version,
                  json["bytes"].get<std::size_t>());
            print_baked_info(json);
            continue;
        }
        if (json["kind"] == "light of a fibre") {
            print("{}: light of a fibre, written by {}\n", file, one_line(json["program"].get<std::string>()));
            print_fibre_info(json);
            continue;
        }
        const bool tables = json["kind"] == "tables";
        print("{}: {}\n", file,
              tables ? fmt::format("tables, written by {}", one_line(json["program"].get<std::string>()))
                     : fmt::format("pack of version {}, {} bytes", pack_version, json["bytes"].get<std::size_t>()));
        for (const auto& [name, table] : json["tables"].items()) {
            if (tables)
                print("  {}: {}\n    standard error of a lobe: median {:.2e}, worst {:.2e}\n", name, how_solved(table),
                      table["standard_error"]["median"].get<double>(), table["standard_error"]["worst"].get<double>());
            else
                print("  {}: rank {}\n", name, table["rank"].get<int>());
            for (const char* goal : {"target_error", "time_budget"})
                if (table.contains(goal)) print("    {} {:g}\n", goal, table[goal].get<double>());
            print_axes(table["axes"]);
            if (table.contains("exit"))
                print("    {:<10} {:>5} bins as {} spline spans\n", table["exit"]["name"].get<std::string>(),
                      table["exit"]["bins"].get<std::size_t>(), table["exit"]["spans"].get<int>());
        }
        if (tables) print("  SHA-256 of the contents: {}\n", json["sha256"].get<std::string>());
        if (!tables) print("  provenance: {}\n", json_line(json["provenance"]));
    }
}

// --- verify ------------------------------------------------------------------------------------------------------

struct VerifyArguments {
    std::vector<std::string> files;
    std::optional<double> max_undershoot;
    bool json = false;
};

// The limits of verify follow from the relative L2 error e that the provenance of a pack states for each kind: the
// values of a table lie in a known range, so an excess of the pack over that range is part of its error.

/// For a pack that states no error.
constexpr double unstated_error = 1e-2;
/// Limits of the negative undershoot over the lobe's integral. Measured on packs of ranks 1 to 32 of tables with
/// 4 x 3 x 4, 5 x 3 x 4 and 10 x 6 x 8 nodes: at most 4.2 times the e that the pack states, or more than
/// most_undershoot, where the factors no longer represent a density.
constexpr double undershoot_per_error = 6, most_undershoot = 0.5;
/// The error of one of N shares is at most e times the root of the sum of their squares, e sqrt(N), plus rounding. It
/// is less than most_share_excess / 5 in every pack that the tests write.
constexpr double share_rounding = 1e-4, most_share_excess = 0.05;

double stated_error(const PackView& pack, TableKind kind) { return stated(pack, kind, "relative_l2", unstated_error); }

/// Relative L2 distance of a lobe from its mirror image.
double asymmetry(const std::vector<double>& lobe) {
    double difference = 0, norm = 0;
    for (std::size_t b = 0; b < lobe.size(); ++b) {
        const double d = lobe[b] - lobe[lobe.size() - 1 - b];
        difference += d * d, norm += lobe[b] * lobe[b];
    }
    return std::sqrt(difference / norm);
}

/// Checks beyond those of reading: lobes are mirror-symmetric for light at h = 0 or theta_i = 0.
void verify_table(const Table& table, const std::string& path) {
    const char* offset = table.id == TableId::longitudinal ? "theta_i" : "h";
    for (std::size_t cell = 0; cell < table.cells(); ++cell) {
        if (table.parameter(cell, offset) != 0) continue;
        const double noise = table.standard_error[cell];
        const double found = asymmetry({table.lobe_of(cell), table.lobe_of(cell) + table.bins()});
        if (found > 5 * std::sqrt(2.0) * noise + 1e-6)
            throw Error(
                "{}: /{}: {}: expected a mirror-symmetric lobe, found asymmetry {:.2e} at standard error {:.2e}", path,
                table.name(), table.describe(cell), found, noise);
    }
}

/// Checks the share of the slab's light that leaves backward at every node.
void verify_shares(const PackView& view, const Source& pack, const std::string& path) {
    if (!pack.has(TableKind::back_fraction)) return;
    const std::vector<Axis> axes = pack.parameter_axes(TableKind::back_fraction);
    const double nodes = static_cast<double>(axes[0].size() * axes[1].size() * axes[2].size());
    const double most =
        std::min(stated_error(view, TableKind::back_fraction) * std::sqrt(nodes) + share_rounding, most_share_excess);
    Parameters at;
    for (const double sigma : axes[0].values)
        for (const double g : axes[1].values)
            for (const double theta_i : axes[2].values) {
                at.sigma = sigma, at.g = g, at.theta_i = theta_i;
                const double share = pack.signed_back_fraction(at);
                if (!(share >= -most && share <= 1 + most))
                    throw Error(
                        "{}: {}: sigma {:g}, g {:g}, theta_i {:g}: expected a share within {:.1e} of [0, 1], "
                        "found {:g}",
                        path, name_of(TableKind::back_fraction), sigma, g, theta_i, most, share);
            }
}

/// Checks at every node that survival is 1 at absorption 0 and falls along the axis, and that its length is >= 0 within
/// the error that the pack states.
void verify_survival(const PackView& view, const Source& pack, const std::string& path) {
    const std::vector<Axis> axes = pack.parameter_axes(TableKind::azimuthal);  // sigma, g, absorption, h
    const double nodes = static_cast<double>(axes[0].size() * axes[1].size() * axes[2].size() * axes[3].size());
    const double most = std::min(stated_error(view, TableKind::survival) * std::sqrt(nodes) + share_rounding, 1.0);
    for (const double sigma : axes[0].values)
        for (const double g : axes[1].values)
            for (const double h : axes[3].values) {
                double before = 1;
                for (const double a : axes[2].values) {
                    Parameters at;
                    at.sigma = sigma, at.g = g, at.absorption = a, at.h = h;
                    const double left = pack.survival(at), length = pack.signed_survival_length(at);
                    if (!(length >= -most))
                        throw Error(
                            "{}: sigma {:g}, g {:g}, absorption {:g}, h {:g}: expected a length >= 0, found {:g}", path,
                            sigma, g, a, h, length);
                    if (!(left > 0 && (a == 0 ? left == 1 : left < before)))
                        throw Error(
                            "{}: sigma {:g}, g {:g}, absorption {:g}, h {:g}: expected less to be left than {:g}, "
                            "found {:g}",
                            path, sigma, g, a, h, before, left);
                    before = left;
                }
            }
}

/// Largest negative undershoot of a kind at any node: what clamping a signed lobe to 0 adds to its integral 1. It is at
/// most the L1 error of the lobe.
double largest_undershoot(const PackView& pack, const Source& source, TableKind kind) {
    double greatest = 0;
    const std::vector<Axis> axes = source.parameter_axes(kind);
    std::size_t nodes = 1;
    for (const Axis& axis : axes) nodes *= axis.size();
    for (std::size_t node = 0; node < nodes; ++node) {
        Parameters at;
        std::size_t rest = node;
        for (const Axis& axis : axes) at.set(axis.name, axis.values[rest % axis.size()]), rest /= axis.size();
        LobeQuery query;
        query.sigma = static_cast<float>(at.sigma), query.g = static_cast<float>(at.g);
        query.h = static_cast<float>(at.h), query.theta_i = static_cast<float>(at.theta_i);
        query.absorption = static_cast<float>(at.absorption);
        const double whole = clamped_integral(pack[kind], contract_signed(pack[kind], query));
        greatest = std::max(greatest, whole - 1);
    }
    return greatest;
}

/// Results for a valid file: cells of tables; largest errors and degeneracy of a pack.
struct Verified {
    std::optional<std::size_t> cells;
    std::optional<double> energy_error, undershoot;
    PackDegeneracy degeneracy;
    bool of_fibre = false;  ///< its light, or baked
};

/// Checks every node of a pack: finite, >= 0, integral 1; shares of energy in [0, 1]; and a negative undershoot of at
/// most `max_undershoot` or, without it, what the error that the pack states permits.
void verify_pack(const PackView& pack, const Source& source, const std::string& path,
                 std::optional<double> max_undershoot, Verified& found) {
    verify_shares(pack, source, path);
    found.energy_error = 0;
    for (const LobeError& error : compare(source, source)) {
        if (!(error.energy <= 1e-3) || !(error.least >= 0))  // bins where clamping starts have errors of about 1e-5
            throw Error("{}: {} lobes: expected densities >= 0 of integral 1, found {:g} (error of the integral {:g})",
                        path, name_of(error.kind), error.least, error.energy);
        found.energy_error = std::max(*found.energy_error, error.energy);
    }
    if (source.absorbs()) verify_survival(pack, source, path);
    found.undershoot = 0;
    for (const TableKind kind : lobe_kinds) {
        if (!source.has(kind)) continue;
        const double stated = stated_error(pack, kind), undershoot = largest_undershoot(pack, source, kind);
        const double limit = max_undershoot.value_or(std::min(undershoot_per_error * stated, most_undershoot));
        if (!(undershoot <= limit))
            throw Error(
                "{}: {} lobes: expected integral 1 with a negative undershoot of at most {:.2e}{}, found {:.2e}", path,
                name_of(kind), limit,
                max_undershoot ? "" : fmt::format(" (the pack states an error of {:.1e})", stated), undershoot);
        found.undershoot = std::max(*found.undershoot, undershoot);
    }
}

/// Throws Error with the defect.
Verified verify(const std::string& file, std::optional<double> max_undershoot) {
    Verified found;
    if (is_baked(file)) {
        read_baked(file);
        found.of_fibre = true;
        return found;
    }
    if (is_fibre_file(file)) {
        found.cells = read_fibre(file).cells.size();
        found.of_fibre = true;
        return found;
    }
    if (is_tables(file)) {
        const Tables tables = read_tables(file);
        found.cells = 0;
        for (const Table* table : tables.present()) {
            verify_table(*table, file);
            *found.cells += table->cells();
        }
    } else {
        const std::vector<unsigned char> bytes = read_pack(file, true);
        const PackView pack = open_pack(bytes.data(), bytes.size()).pack;
        verify_pack(pack, *pack_source(bytes, file), file, max_undershoot, found);
        found.degeneracy = degeneracy_of(pack);
    }
    return found;
}

template <class T>
nlohmann::ordered_json or_null(const std::optional<T>& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

void run_verify(const VerifyArguments& args) {
    nlohmann::ordered_json json;
    bool all_good = true;
    for (const std::string& file : args.files) {
        Verified found;
        std::optional<std::string> error;
        try {
            found = verify(file, args.max_undershoot);
        } catch (const Error& wrong) {
            error = wrong.what();
            all_good = false;
            say("furtable", *error);
        }
        const nlohmann::ordered_json degeneracy = to_json(found.degeneracy);
        json[json_name(file)] = {
            {"ok", !error},
            {"error", error ? nlohmann::ordered_json(json_name(*error)) : nlohmann::ordered_json(nullptr)},
            {"cells", or_null(found.cells)},
            {"energy_error", or_null(found.energy_error)},
            {"undershoot", or_null(found.undershoot)},
            {"degeneracy", degeneracy}};
        if (args.json || error) continue;
        if (found.cells && found.of_fibre)
            print("{}: ok: SHA-256, {} finite and >= 0\n", file, counted(*found.cells, "cell"));
        else if (found.cells)
            print("{}: ok: SHA-256, {} finite and >= 0, with correct integrals, energies and symmetry\n", file,
                  counted(*found.cells, "cell"));
        else if (found.of_fibre)
            print("{}: ok: checksum, structure, functions >= 0 of integral 1\n", file);
        else
            print(
                "{}: ok: checksum, structure, lobes >= 0 of integral 1 within {:.1e}; negative undershoot at most "
                "{:.1e}\n",
                file, *found.energy_error, *found.undershoot);
        print(found.degeneracy);
    }
    if (args.json) print("{}\n", json_line(json));
    if (!all_good) throw Reported();
}

}  // namespace

void add_info(CLI::App& app, Action& action) {
    add_command<InfoArguments>(
        app, action, "info", "axes, sizes, errors, provenance",
        [](CLI::App& command, InfoArguments& args) {
            command.add_option("FILE", args.files, "tables file, pack, or 'default': the pack built in")
                ->required()
                ->expected(1);
            command.add_flag("--json", args.json, "print one JSON object");
        },
        run_info);
}

void add_verify(CLI::App& app, Action& action) {
    add_command<VerifyArguments>(
        app, action, "verify", "structure, checksums, energies, symmetry, finite, non-negative",
        [](CLI::App& command, VerifyArguments& args) {
            command.add_option("FILE", args.files, "tables files and packs; all are checked, also after a bad one")
                ->required();
            add_number(command, "--max-undershoot", args.max_undershoot,
                       fmt::format("limit of a pack's negative undershoot: the integral that clamping lobes to 0 adds "
                                   "(default: {:g} times the error that the pack states for the kind, at most {:g}). "
                                   "`diff` measures the accuracy of a pack",
                                   undershoot_per_error, most_undershoot),
                       {0, std::numeric_limits<double>::max()});
            command.add_flag("--json", args.json, "print one JSON object: an entry with the same keys for every file");
        },
        run_verify);
}

}  // namespace medulla::tables
