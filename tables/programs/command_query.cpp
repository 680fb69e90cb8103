// furtable query: one lobe from either file, in columns, CSV or JSON.
#include <fmt/core.h>

#include <algorithm>
#include <limits>

#include "tables/programs/commands.hpp"
#include "tables/programs/number.hpp"
#include "tables/store/json_text.hpp"

namespace medulla::tables {
namespace {

struct QueryArguments {
    std::string file, table;
    Parameters at;
    double theta_degrees = 0;
    std::size_t bins = 0;
    bool csv = false, json = false;
    const CLI::Option *h = nullptr, *theta = nullptr, *absorption = nullptr;
};

struct Column {
    std::string name;
    std::vector<double> values;
};

void print_columns(const std::vector<Column>& columns, const char* separator) {
    for (std::size_t row = 0; row < columns[0].values.size(); ++row) {
        for (std::size_t c = 0; c < columns.size(); ++c)
            print("{}{:.9g}", c == 0 ? "" : separator, columns[c].values[row]);
        print("\n");
    }
}

/// Says where a value lies outside its bounds and is clamped: splines overshoot between nodes, truncated components
/// anywhere.
void say_clamped(const std::string& what, double value, double low, double high, nlohmann::ordered_json& clamped) {
    if (value >= low && value <= high) return;
    say("furtable",
        fmt::format("query: {} {:g} of the splines is clamped to {:g}", what, value, value < low ? low : high));
    clamped[what] = value;
}

void run_query(const QueryArguments& args) {
    const bool azimuthal = args.table == "azimuthal";
    if (azimuthal && (!*args.h || *args.theta)) throw UsageError("query: --table azimuthal needs --h, not --theta");
    if (!azimuthal && (!*args.theta || *args.h)) throw UsageError("query: --table longitudinal needs --theta, not --h");
    Parameters at = args.at;
    // Negative offsets and inclinations are mirror images of the stored ones.
    const bool mirrored = azimuthal ? at.h < 0 : args.theta_degrees < 0;
    at.h = std::abs(at.h);
    at.theta_i = std::abs(args.theta_degrees) * pi / 180;
    const auto source = open_source(args.file);
    const std::vector<TableKind> kinds =
        azimuthal ? std::vector<TableKind>{TableKind::azimuthal}
                  : std::vector<TableKind>{TableKind::longitudinal_back, TableKind::longitudinal_forward};
    if (!azimuthal && *args.absorption) throw UsageError("query: --absorption needs --table azimuthal");
    for (const TableKind kind : kinds) source->check(kind, at, args.file);
    const std::size_t bins = args.bins > 0 ? args.bins : source->bins(kinds[0]);
    std::vector<Column> columns = {{exit_name(kinds[0]), exit_axis(exit_name(kinds[0]), bins).values}};
    nlohmann::ordered_json json = {{"table", args.table}, {"sigma", at.sigma}, {"g", at.g}};
    if (azimuthal)
        json["h"] = args.at.h;
    else
        json["theta_i"] = args.theta_degrees * pi / 180;
    if (azimuthal && source->absorbs()) json["absorption"] = at.absorption;
    nlohmann::ordered_json clamped;
    constexpr double unbounded = std::numeric_limits<double>::infinity();
    if (!azimuthal)
        say_clamped("back_share", source->signed_back_fraction(at), 0, 1, clamped);
    else if (source->absorbs())
        say_clamped("survival_length", source->signed_survival_length(at), 0, unbounded, clamped);
    for (const TableKind kind : kinds) {
        std::vector<double> lobe = source->lobe(kind, at, bins);
        if (mirrored) std::reverse(lobe.begin(), lobe.end());
        const std::string name = azimuthal ? "density" : (kind == TableKind::longitudinal_back ? "back" : "forward");
        say_clamped(name, *std::min_element(lobe.begin(), lobe.end()), 0, unbounded, clamped);
        for (double& value : lobe) value = std::max(value, 0.0);
        const double energy = energy_of(*source, kind, at);
        if (azimuthal)
            for (double& value : lobe) value *= energy;  // C^N itself; C^M of the papers is normalised
        json[azimuthal ? "energy" : "energy_" + name] = energy;
        columns.push_back({name, std::move(lobe)});
    }
    if (!clamped.empty()) json["clamped"] = clamped;
    if (args.json) {
        for (const Column& column : columns) json[column.name] = column.values;
        print("{}\n", json_line(json));
        return;
    }
    std::string names;
    for (const Column& column : columns) names += (names.empty() ? "" : (args.csv ? "," : " ")) + column.name;
    if (!args.csv)
        for (const auto& [key, value] : json.items()) print("# {} {}\n", key, json_line(value));
    print("{}{}\n", args.csv ? "" : "# ", names);
    print_columns(columns, args.csv ? "," : " ");
}

}  // namespace

void add_query(CLI::App& app, Action& action) {
    add_command<QueryArguments>(
        app, action, "query", "one lobe: exit angle [radians] and density [1/radian] per line",
        [](CLI::App& command, QueryArguments& args) {
            command.add_option("FILE", args.file, "tables file, pack, or 'default'")->required();
            command.add_option("--table", args.table, "which table")
                ->required()
                ->check(CLI::IsMember({"azimuthal", "longitudinal"}));
            add_number(command, "--sigma", args.at.sigma, "optical radius of scattering")->required();
            add_number(command, "--g", args.at.g, "mean cosine")->required();
            args.h = add_number(command, "--h", args.at.h, "offset in [-1, 1] (azimuthal)");
            args.theta = add_number(command, "--theta", args.theta_degrees, "inclination in degrees (longitudinal)");
            args.absorption = add_number(command, "--absorption", args.at.absorption,
                                         "optical radius of absorption, where there is such an axis");
            add_number(command, "--bins", args.bins, "exit directions to print (default: the table's own)",
                       {2, 100000});
            auto* csv = command.add_flag("--csv", args.csv, "comma-separated with one header line");
            command.add_flag("--json", args.json, "print one JSON object")->excludes(csv);
        },
        run_query);
}

}  // namespace medulla::tables
