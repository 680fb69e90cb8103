// furtable compress and furtable diff: make a pack, and say how far one file is from another.
#include <fmt/core.h>

#include "tables/pack/compress.hpp"
#include "tables/programs/commands.hpp"
#include "tables/programs/number.hpp"
#include "tables/store/json_text.hpp"
#include "tables/store/output.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {
namespace {

/// Of the pack that ships with the runtime.
constexpr std::size_t default_bytes = 153600;

struct CompressWords {
    std::vector<std::string> files;
    std::string output, solver = "lm";
    std::optional<int> rank;
    std::optional<double> max_error;
    std::optional<std::size_t> max_bytes;
    std::uint64_t seed = 1;
    bool nonnegative = false, json = false;
    std::optional<int> sweeps;
};

const char* mirror_name(Mirror mirror) {
    return mirror == Mirror::none ? "whole" : (mirror == Mirror::even ? "even" : "odd");
}

/// Whether fit_error is of normalised lobes.
bool is_nonnegative(const TableReport& report) { return report.parts[0].solve.solver == std::string("nonnegative"); }

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

/// The tables of one file, or of two that hold one kind each (on axes of their own).
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

void run_compress(const CompressWords& words) {
    const std::string& first = words.files[0];
    const bool named = first.size() > 3 && first.compare(first.size() - 3, 3, ".h5") == 0;
    const std::string stem = named ? first.substr(0, first.size() - 3) : first;
    const Output output(words.output.empty() ? stem + ".furpack" : words.output, words.files);
    if (!words.json) print_messages();
    CompressOptions options;
    if (words.rank) options.rank = *words.rank;
    options.seed = words.seed;
    options.max_sweeps = words.sweeps;
    options.solver = words.solver == "als" ? tensor::Solver::als : tensor::Solver::lm;
    if (words.nonnegative) options.solver = tensor::Solver::nonnegative;
    options.max_error = words.max_error;
    options.max_bytes = words.max_bytes;
    std::string input;
    for (const std::string& file : words.files) input += (input.empty() ? "" : ", ") + json_name(file_name(file));
    const Tables tables = read_all(words.files);
    const CompressResult result = compress(tables, options, input);
    output.write(result.pack.data(), result.pack.size());
    // Who asked for no size is told what the default pack's would give.
    const bool unsized = !words.rank && !options.max_error && !options.max_bytes;
    const auto larger = [&] {
        options.max_bytes = default_bytes;
        return compress(tables, options, input);
    };
    if (words.json) {
        nlohmann::ordered_json json = {{"output", json_name(output.path())},
                                       {"bytes", result.pack.size()},
                                       {"seconds", result.solve_seconds},
                                       {"cpu_seconds", result.cpu_seconds}};
        for (const TableReport& report : result.tables)
            json["factors"][medulla::tables::name_of(report.kind)] = report_json(report);
        json["errors"] = to_json(result.errors);
        json["degeneracy"] = to_json(result.degeneracy);
        if (unsized) {
            const CompressResult more = larger();
            json["max_bytes_153600"] = {{"bytes", more.pack.size()}, {"errors", to_json(more.errors)}};
        }
        print("{}\n", json_line(json));
        return;
    }
    for (const TableReport& report : result.tables) {
        print("{}: {} {:.3e} relative L2 (exit spline {:.1e}), rounding {:.1e}, noise of the table {:.1e}\n",
              medulla::tables::name_of(report.kind), is_nonnegative(report) ? "in the pack" : "factors",
              report.fit_error, report.exit_error, report.rounding, report.noise);
        for (const PartReport& part : report.parts)
            print("  {:<8} rank {:>3}, {} {} iterations ({}), {:.2f} s; least cosine {:.3f}, norm ratio {:.1f}\n",
                  mirror_name(part.mirror), part.rank, part.solve.solver, part.solve.iterations,
                  tensor::to_string(part.solve.stop), part.solve.seconds, part.solve.degeneracy.least_cosine,
                  part.solve.degeneracy.norm_ratio);
    }
    print(result.errors);
    print(result.degeneracy);
    print("{}: {} bytes in {:.2f} s ({:.2f} s of processor time)\n", output.path(), result.pack.size(),
          result.solve_seconds, result.cpu_seconds);
    if (!unsized) return;
    print("for comparison, solving for --max-bytes {} (give a size, --rank 16 say, to leave it out) ..\n",
          default_bytes);
    flush_output();
    std::string errors;
    for (const LobeError& error : larger().errors)
        errors += fmt::format("{}{} {:.1e}", errors.empty() ? "" : ", ", name_of(error.kind), error.relative);
    print("with --max-bytes {}: {}\n", default_bytes, errors);
}

struct DiffWords {
    std::string a, b;
    bool json = false;
};

void run_diff(const DiffWords& words) {
    const auto reference = open_source(words.a), candidate = open_source(words.b);
    for (const TableKind kind : lobe_kinds) {
        if (!reference->has(kind) || !candidate->has(kind)) continue;
        // The candidate must cover the reference's nodes; it is asked at each of them.
        Parameters low, high;
        for (const Axis& axis : reference->parameter_axes(kind)) {
            low.set(axis.name, axis.values.front());
            high.set(axis.name, axis.values.back());
        }
        candidate->check(kind, low, words.b);
        candidate->check(kind, high, words.b);
    }
    std::vector<LobeError> errors;
    try {
        errors = compare(*reference, *candidate);
    } catch (const Error& error) {
        throw Error("{} and {}: {}", words.a, words.b, error.what());
    }
    if (errors.empty()) throw Error("{} and {}: expected a table that both have, found none", words.a, words.b);
    PackDegeneracy degeneracy;
    if (words.b == "default" || !is_hdf5(words.b)) {
        const std::vector<unsigned char> bytes = read_pack(words.b);
        degeneracy = degeneracy_of(open_pack(bytes.data(), bytes.size()).pack);
    }
    if (words.json) {
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
            print("share of energy that leaves backward: off by at most {:.1e}\n", error.back_share);
}

void print(const PackDegeneracy& degeneracy) {
    for (const auto& [kind, d] : degeneracy)
        print("{}: component norms add up to {:.1f} times the table's, least cosine {:.3f}\n", name_of(kind),
              d.norm_ratio, d.least_cosine);
}

void add_compress(CLI::App& app, Action& action) {
    add_command<CompressWords>(
        app, action, "compress", "tables.h5 -> low-rank pack",
        [](CLI::App& command, CompressWords& words) {
            command.add_option("FILE", words.files, "tables file, or two with one table each")
                ->required()
                ->expected(1, 2);
            command.add_option("-o,--output", words.output, "pack to write (default: FILE with .furpack)");
            auto* size = command.add_option_group("size")->require_option(0, 1);
            add_number(*size, "--rank", words.rank,
                       "components of each part: lobes have a mirror-even and an odd one (default 16). A pack "
                       "stores them padded with zeros to a multiple of 8, so that 4 take the bytes of 8",
                       {1, static_cast<int>(max_rank / 2)});
            add_number(*size, "--max-error", words.max_error,
                       "smallest pack that keeps this relative L2, rounding included", above_zero);
            add_number(*size, "--max-bytes", words.max_bytes, "least error within this many bytes",
                       {1, std::numeric_limits<std::size_t>::max()});
            command.add_option("--solver", words.solver, "alternating least squares or Levenberg-Marquardt")
                ->check(CLI::IsMember({"als", "lm"}))
                ->capture_default_str();
            command
                .add_flag("--nonnegative", words.nonnegative,
                          "factors >= 0: each component is a density; by coordinate descent")
                ->excludes("--solver");
            add_number(command, "--seed", words.seed, "of the solver's start")->capture_default_str();
            add_number(command, "--sweeps", words.sweeps,
                       "most steps of a solve (default: of lm 100, of als 500); more leave a little less error",
                       {1, 100000});
            command.add_flag("--json", words.json, "print one JSON object");
        },
        run_compress);
}

void add_diff(CLI::App& app, Action& action) {
    add_command<DiffWords>(
        app, action, "diff", "error of B against A",
        [](CLI::App& command, DiffWords& words) {
            command.add_option("A", words.a, "reference: tables file or pack")->required();
            command.add_option("B", words.b, "tables file or pack")->required();
            command.add_flag("--json", words.json, "print one JSON object");
        },
        run_diff);
}

}  // namespace medulla::tables
