// furtable query: one lobe from either file, in columns, CSV or JSON.
#include <fmt/core.h>

#include "tables/programs/commands.hpp"
#include "tables/programs/number.hpp"
#include "tables/store/json_text.hpp"

namespace medulla::tables {
namespace {

struct QueryWords {
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

void run_query(const QueryWords& words) {
    const bool azimuthal = words.table == "azimuthal";
    if (azimuthal && (!*words.h || *words.theta)) throw UsageError("query: --table azimuthal needs --h, not --theta");
    if (!azimuthal && (!*words.theta || *words.h))
        throw UsageError("query: --table longitudinal needs --theta, not --h");
    Parameters at = words.at;
    // Negative offsets and inclinations are mirror images of the stored ones.
    const bool mirrored = azimuthal ? at.h < 0 : words.theta_degrees < 0;
    at.h = std::abs(at.h);
    at.theta_i = std::abs(words.theta_degrees) * pi / 180;
    const auto source = open_source(words.file);
    const std::vector<TableKind> kinds =
        azimuthal ? std::vector<TableKind>{TableKind::azimuthal}
                  : std::vector<TableKind>{TableKind::longitudinal_back, TableKind::longitudinal_forward};
    if (!azimuthal && *words.absorption) throw UsageError("query: --absorption needs --table azimuthal");
    for (const TableKind kind : kinds) source->check(kind, at, words.file);
    const std::size_t bins = words.bins > 0 ? words.bins : source->bins(kinds[0]);
    std::vector<Column> columns = {{exit_name(kinds[0]), exit_axis(exit_name(kinds[0]), bins).values}};
    nlohmann::ordered_json json = {{"table", words.table}, {"sigma", at.sigma}, {"g", at.g}};
    if (azimuthal)
        json["h"] = words.at.h;
    else
        json["theta_i"] = words.theta_degrees * pi / 180;
    if (azimuthal && source->absorbs()) json["absorption"] = at.absorption;
    for (const TableKind kind : kinds) {
        std::vector<double> lobe = source->lobe(kind, at, bins);
        if (mirrored) std::reverse(lobe.begin(), lobe.end());
        const double energy = energy_of(*source, kind, at);
        if (azimuthal)
            for (double& value : lobe) value *= energy;  // C^N itself; C^M of the papers is normalised
        const std::string name = azimuthal ? "density" : (kind == TableKind::longitudinal_back ? "back" : "forward");
        json[azimuthal ? "energy" : "energy_" + name] = energy;
        columns.push_back({name, std::move(lobe)});
    }
    if (words.json) {
        for (const Column& column : columns) json[column.name] = column.values;
        print("{}\n", json_line(json));
        return;
    }
    std::string names;
    for (const Column& column : columns) names += (names.empty() ? "" : (words.csv ? "," : " ")) + column.name;
    if (!words.csv)
        for (const auto& [key, value] : json.items()) print("# {} {}\n", key, json_line(value));
    print("{}{}\n", words.csv ? "" : "# ", names);
    print_columns(columns, words.csv ? "," : " ");
}

}  // namespace

void add_query(CLI::App& app, Action& action) {
    add_command<QueryWords>(
        app, action, "query", "one lobe: exit angle [radians] and density [1/radian] per line",
        [](CLI::App& command, QueryWords& words) {
            command.add_option("FILE", words.file, "tables file, pack, or 'default'")->required();
            command.add_option("--table", words.table, "which table")
                ->required()
                ->check(CLI::IsMember({"azimuthal", "longitudinal"}));
            add_number(command, "--sigma", words.at.sigma, "optical radius of scattering")->required();
            add_number(command, "--g", words.at.g, "mean cosine")->required();
            words.h = add_number(command, "--h", words.at.h, "offset in [-1, 1] (azimuthal)");
            words.theta = add_number(command, "--theta", words.theta_degrees, "inclination in degrees (longitudinal)");
            words.absorption = add_number(command, "--absorption", words.at.absorption,
                                          "optical radius of absorption, where there is such an axis");
            add_number(command, "--bins", words.bins, "exit directions to print (default: the table's own)",
                       {2, 100000});
            auto* csv = command.add_flag("--csv", words.csv, "comma-separated with one header line");
            command.add_flag("--json", words.json, "print one JSON object")->excludes(csv);
        },
        run_query);
}

}  // namespace medulla::tables
