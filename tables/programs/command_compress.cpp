// furtable compress and furtable diff: make a pack, and the error of one file against another.
#include <fmt/core.h>

#include <algorithm>

#include "tables/bake/fibre_file.hpp"
#include "tables/pack/compress.hpp"
#include "tables/programs/bake.hpp"
#include "tables/programs/commands.hpp"
#include "tables/programs/number.hpp"
#include "tables/store/json_text.hpp"
#include "tables/store/output.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {
namespace {

/// Of the pack that ships with the runtime.
constexpr std::size_t default_bytes = 153600;

struct CompressArguments {
    std::vector<std::string> files;
    std::string output, solver = "lm";
    std::optional<int> rank;
    std::optional<double> max_error;
    std::optional<std::size_t> max_bytes;
    std::uint64_t seed = 1;
    bool nonnegative = false, json = false;
    std::optional<int> sweeps;
    const CLI::Option* solver_given = nullptr;
};

const char* mirror_name(Mirror mirror) {
    return mirror == Mirror::none ? "whole" : (mirror == Mirror::even ? "even" : "odd");
}

/// Whether fit_error refers to normalised lobes.
bool is_nonnegative(const TableReport& report) { return report.parts[0].solve.solver == std::string("nonnegative"); }

/// Text for a pack without a size option: the error of its worst kind, and whether more components reduce it. They do
/// not if the squared error of the exit splines is more than 16 times that of the components, for every kind.
std::string distance_of(const CompressResult& result, int rank) {
    const LobeError& worst =
        *std::max_element(result.errors.begin(), result.errors.end(),
                          [](const LobeError& a, const LobeError& b) { return a.relative < b.relative; });
    const bool nearer = std::any_of(result.tables.begin(), result.tables.end(), [](const TableReport& report) {
        const double exit = report.exit_error * report.exit_error;
        return is_lobe(report.kind) && report.fit_error * report.fit_error - exit > exit / 16;
    });
    return fmt::format("rank {} is {:.1e} (relative L2) from the table, in its {} lobes; ", rank, worst.relative,
                       name_of(worst.kind)) +
           (nearer ? fmt::format(
                         "--max-bytes {}, the size of the built-in pack, takes more components and is more accurate",
                         default_bytes)
                   : "more components do not help: the error left is that of the exit splines");
}

nlohmann::ordered_json report_json(const TableReport& report) {
    nlohmann::ordered_json json = {
        {is_nonnegative(report) ? "relative_l2_in_pack" : "relative_l2_of_factors", report.fit_error},
        {"relative_l2_of_exit_spline", report.exit_error},
        {"relative_l2_of_rounding", report.rounding},
        {"relative_l2_of_input_noise", report.noise}};
    for (const PartReport& part : report.parts)
        json["parts"][mirror_name(part.mirror)] = {{"rank", part.rank},
                                                   {"solver", part.solve.solver},
                                                   {"iterations", part.solve.iterations},
                                                   {"stop", tensor::to_string(part.solve.stop)},
                                                   {"seconds", part.solve.seconds},
                                                   {"least_cosine", part.solve.degeneracy.least_cosine},
                                                   {"norm_ratio", part.solve.degeneracy.norm_ratio}};
    return json;
}

/// The tables of one file, or of two with one table each (on different axes).
Tables read_all(const std::vector<std::string>& files) {
    Tables all = read_tables(files[0]);
    for (std::size_t i = 1; i < files.size(); ++i) {
        Tables more = read_tables(files[i]);
        for (const TableId id : table_ids) {
            if (!more[id]) continue;
            if (all[id])
                throw Error("{}: expected another table than {}, found /{} in both", files[i], files[0], name_of(id));
            all[id] = std::move(more[id]);
        }
    }
    return all;
}

std::string file_name(const std::string& path) { return path.substr(path.rfind('/') + 1); }

void run_compress(const CompressArguments& args) {
    const std::string& first = args.files[0];
    const bool named = first.size() > 3 && first.compare(first.size() - 3, 3, ".h5") == 0;
    const std::string stem = named ? first.substr(0, first.size() - 3) : first;
    const Output output(args.output.empty() ? stem + ".furpack" : args.output, args.files);
    if (!args.json) print_messages();
    if (args.files.size() == 1 && is_fibre_file(first)) {
        if (args.solver_given->count() > 0 || args.nonnegative)
            throw UsageError("{}: expected neither --solver nor --nonnegative for the light of a fibre",
                             args.nonnegative ? "--nonnegative" : "--solver");
        return run_bake({first, args.rank, args.max_error, args.max_bytes, args.seed, args.sweeps, args.json}, output);
    }
    CompressOptions options;
    if (args.rank) options.rank = *args.rank;
    options.seed = args.seed;
    options.max_sweeps = args.sweeps;
    options.solver = args.solver == "als" ? tensor::Solver::als : tensor::Solver::lm;
    if (args.nonnegative) options.solver = tensor::Solver::nonnegative;
    options.max_error = args.max_error;
    options.max_bytes = args.max_bytes;
    const bool sized = options.max_error || options.max_bytes;
    std::string input;
    for (const std::string& file : args.files) input += (input.empty() ? "" : ", ") + json_name(file_name(file));
    const Tables tables = read_all(args.files);
    const CompressResult result = compress(tables, options, input);
    output.write(result.pack.data(), result.pack.size());
    if (args.json) {
        nlohmann::ordered_json json = {{"output", json_name(output.path())},
                                       {"bytes", result.pack.size()},
                                       {"seconds", result.solve_seconds},
                                       {"cpu_seconds", result.cpu_seconds}};
        for (const TableReport& report : result.tables)
            json["factors"][medulla::tables::name_of(report.kind)] = report_json(report);
        json["errors"] = to_json(result.errors);
        json["degeneracy"] = to_json(result.degeneracy);
        print("{}\n", json_line(json));
        return;
    }
    for (const TableReport& report : result.tables) {
        print("{}: {} {:.3e} relative L2 (exit spline {:.1e}), rounding {:.1e}, noise of the table {:.1e}\n",
              medulla::tables::name_of(report.kind), is_nonnegative(report) ? "in the pack" : "factors",
              report.fit_error, report.exit_error, report.rounding, report.noise);
        for (const PartReport& part : report.parts)
            print("  {:<8} rank {:>3}{}, {} {} iterations ({}), {:.2f} s; least cosine {:.3f}, norm ratio {:.1f}\n",
                  mirror_name(part.mirror), part.rank,
                  is_lobe(report.kind) && !sized && part.rank < options.rank ? " (all that this table can have)" : "",
                  part.solve.solver, part.solve.iterations, tensor::to_string(part.solve.stop), part.solve.seconds,
                  part.solve.degeneracy.least_cosine, part.solve.degeneracy.norm_ratio);
    }
    print(result.errors);
    print(result.degeneracy);
    print("{}: {} bytes in {:.2f} s ({:.2f} s of processor time)\n", output.path(), result.pack.size(),
          result.solve_seconds, result.cpu_seconds);
    if (!args.rank && !sized) print("{}\n", distance_of(result, options.rank));
}

struct DiffArguments {
    std::string a, b;
    bool json = false;
};

void run_diff(const DiffArguments& args) {
    const auto reference = open_source(args.a), candidate = open_source(args.b);
    for (const TableKind kind : lobe_kinds) {
        if (!reference->has(kind) || !candidate->has(kind)) continue;
        // The candidate is evaluated at all nodes of the reference and must cover them.
        Parameters low, high;
        for (const Axis& axis : reference->parameter_axes(kind)) {
            low.set(axis.name, axis.values.front());
            high.set(axis.name, axis.values.back());
        }
        candidate->check(kind, low, args.b);
        candidate->check(kind, high, args.b);
    }
    std::vector<LobeError> errors;
    try {
        errors = compare(*reference, *candidate);
    } catch (const Error& error) {
        throw Error("{} and {}: {}", args.a, args.b, error.what());
    }
    if (errors.empty()) throw Error("{} and {}: expected a table that both have, found none", args.a, args.b);
    PackDegeneracy degeneracy;
    if (args.b == "default" || !is_hdf5(args.b)) {
        const std::vector<unsigned char> bytes = read_pack(args.b);
        degeneracy = degeneracy_of(open_pack(bytes.data(), bytes.size()).pack);
    }
    if (args.json) {
        nlohmann::ordered_json json = {{"errors", to_json(errors)}};
        if (!degeneracy.empty()) json["degeneracy"] = to_json(degeneracy);
        print("{}\n", json_line(json));
        return;
    }
    print(errors);
    print(degeneracy);
}

}  // namespace

nlohmann::ordered_json to_json(const std::vector<LobeError>& errors) {
    nlohmann::ordered_json json;
    for (const LobeError& error : errors) {
        nlohmann::ordered_json& one = json[name_of(error.kind)];
        one = {{"relative_l2", error.relative}, {"worst_lobe", error.worst},  {"worst_at", error.worst_at},
               {"energy_error", error.energy},  {"least_value", error.least}, {"lobes", error.lobes}};
        if (error.survival) one["survival_error"] = *error.survival;
        one["noise"] = error.noise;
        one["relative_l2_with_noise"] = error.claim, one["worst_lobe_with_noise"] = error.worst_claim;
        if (error.kind != TableKind::azimuthal) one["back_share_error"] = error.back_share;
    }
    return json;
}

nlohmann::ordered_json to_json(const PackDegeneracy& degeneracy) {
    nlohmann::ordered_json json;
    for (const auto& [kind, d] : degeneracy)
        json[name_of(kind)] = {{"least_cosine", d.least_cosine}, {"norm_ratio", d.norm_ratio}};
    return json;
}

void print(const std::vector<LobeError>& errors) {
    print("{:<22} {:>12} {:>12} {:>14}  {}\n", "lobes", "relative L2", "worst lobe", "energy error", "worst at");
    for (const LobeError& error : errors)
        print("{:<22} {:>12.3e} {:>12.3e} {:>14.1e}  {}\n", name_of(error.kind), error.relative, error.worst,
              error.energy, error.worst_at);
    for (const LobeError& error : errors)
        if (error.survival)
            print("{}: greatest error of the share that absorption leaves {:.1e}\n", name_of(error.kind),
                  *error.survival);
    for (const LobeError& error : errors)
        if (error.noise > 0)
            print("{}: the reference's noise is {:.1e}; with it {:.3e}, worst lobe {:.3e}{}\n", name_of(error.kind),
                  error.noise, error.claim, error.worst_claim,
                  error.relative < error.noise ? ": no error below the noise is known" : "");
    for (const LobeError& error : errors)
        if (error.kind == TableKind::longitudinal_back)
            print("share of energy that leaves backward: largest error {:.1e}\n", error.back_share);
}

void print(const PackDegeneracy& degeneracy) {
    for (const auto& [kind, d] : degeneracy)
        print("{}: component norms add up to {:.1f} times the table's, least cosine {:.3f}\n", name_of(kind),
              d.norm_ratio, d.least_cosine);
}

void add_compress(CLI::App& app, Action& action) {
    add_command<CompressArguments>(
        app, action, "compress", "tables.h5 -> low-rank pack",
        [](CLI::App& command, CompressArguments& args) {
            command
                .add_option("FILE", args.files,
                            "tables file, or two with one table each; or the light of a fibre (medulla-precompute "
                            "--fibre), to bake it")
                ->required()
                ->expected(1, 2);
            command.add_option("-o,--output", args.output, "pack to write (default: FILE with .furpack)");
            auto* size = command.add_option_group("size")->require_option(0, 1);
            add_number(*size, "--rank", args.rank,
                       "components of each part: lobes have a mirror-even and an odd one (default 16). A pack "
                       "stores them padded with zeros to a multiple of 8, so that 4 take the bytes of 8. Of a fibre: "
                       "exit functions, a multiple of 4 up to 24 (default 12)",
                       {1, static_cast<int>(max_rank / 2)});
            add_number(*size, "--max-error", args.max_error,
                       "smallest pack that keeps this relative L2, rounding included; of a fibre: of the worst lobe",
                       above_zero);
            add_number(*size, "--max-bytes", args.max_bytes, "least error within this many bytes",
                       {1, std::numeric_limits<std::size_t>::max()});
            args.solver_given =
                command.add_option("--solver", args.solver, "alternating least squares or Levenberg-Marquardt")
                    ->check(CLI::IsMember({"als", "lm"}))
                    ->capture_default_str();
            command
                .add_flag("--nonnegative", args.nonnegative,
                          "factors >= 0: each component is a density; by coordinate descent")
                ->excludes("--solver");
            add_number(command, "--seed", args.seed, "of the solver's start")->capture_default_str();
            add_number(command, "--sweeps", args.sweeps,
                       "most steps of a solve (default: of lm 100, of als 500); more leave a little less error",
                       {1, 100000});
            command.add_flag("--json", args.json, "print one JSON object");
        },
        run_compress);
}

void add_diff(CLI::App& app, Action& action) {
    add_command<DiffArguments>(
        app, action, "diff", "error of B against A",
        [](CLI::App& command, DiffArguments& args) {
            command.add_option("A", args.a, "reference: tables file or pack")->required();
            command.add_option("B", args.b, "tables file or pack")->required();
            command.add_flag("--json", args.json, "print one JSON object");
        },
        run_diff);
}

}  // namespace medulla::tables
