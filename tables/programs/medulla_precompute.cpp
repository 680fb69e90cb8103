// medulla-precompute: simulates the tables and writes them to an HDF5 file; or, for one material (--fibre), light in
// the whole fibre, to bake it or to compare the model with it (--error-map).
#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "sim2d/disc/deterministic.hpp"
#include "tables/job/forecast.hpp"
#include "tables/job/launcher.hpp"
#include "tables/job/precompute.hpp"
#include "tables/job/scene.hpp"
#include "tables/job/simulate.hpp"
#include "tables/programs/bake.hpp"
#include "tables/programs/error_map.hpp"
#include "tables/programs/number.hpp"
#include "tables/programs/program.hpp"
#include "tables/store/json_text.hpp"

namespace {

using namespace medulla::tables;

struct Arguments {
    std::string output = "tables.h5", table = "both", sigma, g, h, theta, absorption, method = "auto",
                progress = "auto", compression = "zstd", shard = "auto", scene, fibre, error_map;
    std::size_t bins = 720;
    std::uint64_t paths = 100000, seed = 1;
    std::optional<double> target_error, time_budget;
    int threads = 0;
    bool json = false, resume = false, dry_run = false;
};

/// The axis `name` of a range on the command line, in units of `unit`.
Axis axis_of(const std::string& text, const std::string& option, const std::string& name, std::size_t default_count,
             double unit = 1) {
    Range range = parse_range(text, option, default_count);
    const AxisRule& rule = axis_rule(name);
    const double high = name == "sigma" || name == "absorption" ? greatest_radius : rule.high;
    for (double* end : {&range.low, &range.high}) {
        const double typed = *end;
        *end *= unit;
        if (!(*end >= rule.low && *end <= high))
            throw Error("{}: expected {} in [{:g}, {:g}], found {:g}", option, unit == 1 ? "values" : "degrees",
                        rule.low / unit, high / unit, typed);
    }
    return graded_axis(name, range);
}

Request request_of(const Arguments& args) {
    try {
        Request request = default_request();
        request.azimuthal = args.table != "longitudinal";
        request.longitudinal = args.table != "azimuthal";
        const auto set = [](Axis& axis, const std::string& range, const char* option, double unit = 1) {
            if (!range.empty()) axis = axis_of(range, option, axis.name, axis.size() > 0 ? axis.size() : 8, unit);
        };
        set(request.sigma, args.sigma, "--sigma-range");
        set(request.g, args.g, "--g-range");
        set(request.h, args.h, "--h-range");
        set(request.theta_i, args.theta, "--theta-range", medulla::pi / 180);
        set(request.absorption, args.absorption, "--absorption-range");  // default: none
        request.bins = args.bins;
        request.paths = args.paths;
        request.target_error = args.target_error.value_or(0);
        request.time_budget = args.time_budget.value_or(0);
        request.seed = args.seed;
        request.threads = args.threads;
        request.method = method_of(args.method);
        check_request(request);
        return request;
    } catch (const Error& error) {
        throw UsageError("{}", error.what());
    }
}

ProgressMode progress_of(const std::string& name) {
    if (name == "bar") return ProgressMode::bar;
    if (name == "plain") return ProgressMode::plain;
    return name == "none" ? ProgressMode::none : ProgressMode::automatic;
}

Compression compression_of(const std::string& name) {
    if (name == "none") return Compression::none;
    return name == "gzip" ? Compression::gzip : Compression::zstd;
}

/// The worker share of --shard; `auto` reads the launcher's environment and prints the result.
std::optional<WorkerShare> share_named(const std::string& text) {
    try {
        if (text == "none") return std::nullopt;
        if (text != "auto") return parse_worker_share(text);
        const std::optional<Launched> found = launched([](const char* name) { return std::getenv(name); });
        if (!found) return std::nullopt;
        note("medulla-precompute: worker {} of {} by {} (--shard none: run alone)\n", found->share.index,
             found->share.count, found->from);
        return found->share;
    } catch (const Error& error) {
        throw UsageError("{}{}", text == "auto" ? "--shard auto: " : "", error.what());
    }
}

Job job_of(const Arguments& args) {
    Job job;
    job.request = request_of(args);
    job.output = args.output;
    if (!args.scene.empty()) job.inputs = {args.scene};
    job.resume = args.resume;
    job.share = share_named(args.shard);
    job.progress = progress_of(args.progress);
    job.compression = compression_of(args.compression);
    return job;
}

/// The slices of a job, or of a worker's share.
std::vector<SliceId> slices_of_job(const Job& job) {
    const std::vector<SliceId> all = slices_of(plan_of(job.request));
    return job.share ? share_of(job.request, all, *job.share) : all;
}

double total_cost(const Job& job) {
    double cost = 0;
    for (const SliceId& id : slices_of_job(job)) cost += static_cast<double>(expected_cost(job.request, id));
    return cost;
}

/// --dry-run: prints the size of the job and its expected duration. @param share cost relative to the job without
/// --scene
void print_forecast(const Job& job, double share, bool as_json) {
    const std::vector<SliceId> slices = slices_of_job(job);
    const Tables plan = plan_of(job.request);
    const Forecast expected = forecast(job.request, slices, 2);
    nlohmann::ordered_json json = {{"slices", expected.slices},
                                   {"cells", expected.cells},
                                   {"seconds", expected.seconds},
                                   {"core_seconds", expected.core_seconds},
                                   {"measured_slices", expected.measured},
                                   {"share_of_whole", share}};
    for (const Table* table : plan.present()) {
        if (!as_json) print("{}: {} x {} bins\n", table->name(), counted(table->cells(), "cell"), table->bins());
        for (std::size_t k = 0; k + 1 < table->axes.size(); ++k) {
            const Axis& axis = table->axes[k];
            json["tables"][table->name()][axis.name] = axis.values;
            if (!as_json)
                print("    {:<10} {:>11}, {:.6g} .. {:.6g} [{}]\n", axis.name, counted(axis.size(), "node"),
                      axis.values.front(), axis.values.back(), axis_rule(axis.name).unit);
        }
    }
    if (as_json) {
        print("{}\n", json_line(json));
        return;
    }
    if (share < 1) print("{:.2g} % of the cost of all nodes\n", 100 * share);
    print("{}, {}: about {} ({} of one core, as {} of the slices took)\n", counted(expected.slices, "slice"),
          counted(expected.cells, "cell"), duration_text(expected.seconds), duration_text(expected.core_seconds),
          expected.measured);
}

/// Final message of a worker: its work, and the merge command for when all workers have ended.
void print_share(const Job& job, const JobReport& report, double seconds, bool as_json) {
    if (as_json) {
        const nlohmann::ordered_json json = {{"shards", json_name(report.folder)},
                                             {"shard", job.share->index},
                                             {"of", job.share->count},
                                             {"slices", report.slices},
                                             {"kept_before", report.kept},
                                             {"seconds", seconds}};
        print("{}\n", json_line(json));
        return;
    }
    print("worker {}/{}: {} in {} after {}; when all workers have ended: furtable merge {} -o {}\n", job.share->index,
          job.share->count, counted(report.slices, "slice"), report.folder, duration_text(seconds), report.folder,
          job.output);
}

/// Throws UsageError for options beside those of a job with --fibre.
void allow_only(const CLI::App& app, std::initializer_list<const char*> allowed, const char* with) {
    for (const CLI::Option* option : app.get_options()) {
        const std::string name = option->get_name();
        if (option->count() > 0 && std::find(allowed.begin(), allowed.end(), name) == allowed.end())
            throw UsageError("{}: expected no option of the tables with {}, found this one", name, with);
    }
}

SimulateFibreArguments fibre_arguments(const CLI::App& app, const Arguments& args) {
    SimulateFibreArguments fibre;
    fibre.fibre = args.fibre;
    if (app.count("--output") > 0) fibre.output = args.output;
    if (app.count("--paths") > 0) fibre.paths = args.paths;
    if (app.count("--bins") > 0) {
        if (args.bins % 8 != 0 || args.bins < 16 || args.bins > 256)
            throw UsageError("--bins: expected a multiple of 8 in [16, 256] with --fibre, found {}", args.bins);
        fibre.bins = args.bins;
    }
    fibre.target_error = args.target_error, fibre.seed = args.seed, fibre.threads = args.threads;
    fibre.progress = progress_of(args.progress), fibre.compression = compression_of(args.compression);
    fibre.resume = args.resume, fibre.json = args.json;
    return fibre;
}

void run(const CLI::App& app, const Arguments& args) {
    if (app.count("--error-map") > 0) {
        if (app.count("--fibre") == 0) throw UsageError("--error-map: expected --fibre MATERIAL with it, found none");
        allow_only(app, {"--fibre", "--error-map", "--paths", "--seed", "--threads", "--progress", "--json"},
                   "--error-map");
        return run_error_map(
            {args.fibre, args.error_map, args.paths, args.seed, args.threads, progress_of(args.progress), args.json});
    }
    if (app.count("--fibre") > 0) {
        allow_only(app,
                   {"--fibre", "--output", "--paths", "--target-error", "--bins", "--seed", "--threads", "--resume",
                    "--compression", "--progress", "--json"},
                   "--fibre");
        return run_simulate_fibre(fibre_arguments(app, args));
    }
    Job job = job_of(args);
    double share = 1;
    if (!args.scene.empty()) {
        const double whole = total_cost(job);
        std::vector<std::string> notes;
        try {
            job.request = restrict_to(job.request, read_scene(args.scene), notes);
        } catch (const Error& error) {
            const std::string what = error.what();
            throw Error("{}{}", what.rfind(args.scene, 0) == 0 ? "" : args.scene + ": ", what);
        }
        for (const std::string& text : notes) note("{}: {}\n", args.scene, text);
        share = total_cost(job) / whole;
    }
    if (args.dry_run) return print_forecast(job, share, args.json);
    if (!args.json) print_messages();
    const auto start = std::chrono::steady_clock::now();
    const JobReport report = run_job(job);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (job.share && !report.was_complete) return print_share(job, report, seconds, args.json);
    nlohmann::ordered_json json = {{"output", json_name(args.output)},
                                   {"seconds", seconds},
                                   {"was_complete", report.was_complete},
                                   {"sha256", hex(contents_hash(report.tables))}};
    for (const Table* table : report.tables.present()) {
        double worst = 0;
        std::size_t above = 0;  // cells that did not reach --target-error
        for (const double e : table->standard_error) worst = std::max(worst, e), above += e > job.request.target_error;
        if (job.request.target_error == 0) above = 0;
        json["tables"][table->name()] = {{"cells", table->cells()},
                                         {"bins", table->bins()},
                                         {"method", table->method},
                                         {"worst_standard_error", worst}};
        if (job.request.target_error > 0) json["tables"][table->name()]["cells_above_target"] = above;
        if (!args.json && above > 0)
            print("{}: {} of {} cells did not reach {:g}\n", table->name(), above, table->cells(),
                  job.request.target_error);
        if (!args.json)
            print("{}: {} x {} bins, {}, worst relative standard error of a lobe {:.2e}\n", table->name(),
                  counted(table->cells(), "cell"), table->bins(), table->method, worst);
    }
    if (args.json)
        print("{}\n", json_line(json));
    else if (report.was_complete)
        print("{} is complete\n", args.output);
    else
        print("{} written in {}\n", args.output, duration_text(seconds));
}

void declare(CLI::App& app, Arguments& args) {
    app.set_version_flag("--version", "medulla " MEDULLA_VERSION);
    app.add_option("-o,--output", args.output, "tables file to write")->capture_default_str();
    app.add_option("--table", args.table, "which table")
        ->check(CLI::IsMember({"azimuthal", "longitudinal", "both"}))
        ->capture_default_str();
    app.add_option("--sigma-range", args.sigma, "optical radii LO:HI[:N], nodes denser towards LO (default 0:16:24)");
    app.add_option("--g-range", args.g, "anisotropy LO:HI[:N], nodes denser towards HI (default 0:0.95:16)");
    app.add_option("--h-range", args.h, "offsets LO:HI[:N], nodes denser towards HI (default 0:1:16)");
    app.add_option("--theta-range", args.theta,
                   "inclinations in degrees LO:HI[:N], nodes denser towards HI (default 0:90:16)");
    app.add_option("--absorption-range", args.absorption,
                   "optical radii of absorption LO:HI[:N], nodes denser towards LO: a fifth axis of C^N, from the same "
                   "paths (default: none; N 8)");
    app.add_option("--scene", args.scene, "scene file (JSON): only the nodes that its materials need");
    app.add_option("--fibre", args.fibre,
                   "in place of tables: simulate light in the whole fibre of one material in three dimensions, for "
                   "`furtable compress` to bake: a material file (JSON), or a preset of `furtable presets`. --paths "
                   "(400000) for each of 169 or 221 nodes (theta_i, h); --bins (48) of phi; --output is FIBRE.h5");
    app.add_option(
        "--error-map", args.error_map,
        "with --fibre, in place of its light: write a page (HTML) of where the five-lobe model of --fibre differs from "
        "light in "
        "the fibre in three dimensions, and by how much; --paths are traced for each of 88 cells (theta_i, h), and as "
        "many again in a smooth fibre");
    app.add_flag("--dry-run", args.dry_run, "print what would be simulated and how long it would take; write nothing");
    add_number(app, "--bins", args.bins, "exit directions over the full circle, even", {8, 4096})
        ->capture_default_str();
    app.add_option(
           "--method", args.method,
           fmt::format("how each cell is solved. deterministic: without noise, on grids for a relative L2 error "
                       "of {0:g} of each lobe (or of --target-error). auto: the same, but traces paths (mc) in discs "
                       "of sigma above {1:g} and in cells whose estimated error exceeds that of --paths analog "
                       "paths. analog, mc: random",
                       medulla::sim2d::DiscOptions{}.target_error, greatest_grid_sigma))
        ->check(CLI::IsMember({"auto", "analog", "mc", "deterministic"}))
        ->capture_default_str();
    // Each excludes the others. (An option group would do so too, but CLI11 2.1 loops forever on stray arguments with
    // one.)
    CLI::Option* paths =
        add_number(
            app, "--paths", args.paths,
            "paths per cell of the random methods, and the error that auto requires of a grid, unless another stopping "
            "rule is given",
            {1, most_paths})
            ->capture_default_str();
    CLI::Option* target =
        add_number(app, "--target-error", args.target_error,
                   fmt::format("instead: solve each cell to this relative L2 standard error, {:g} to {:g}",
                               least_target, greatest_target),
                   {least_target, greatest_target})
            ->excludes(paths);
    add_number(
        app, "--time-budget", args.time_budget,
        "instead: seconds for the job, spent where they reduce the error most (results then depend on the machine's "
        "speed)",
        above_zero)
        ->excludes(paths, target);
    add_number(app, "--seed", args.seed, "seed of the random methods")->capture_default_str();
    add_number(app, "--threads", args.threads, "number of threads, 0: all", {0, 1024})->capture_default_str();
    app.add_flag("--resume", args.resume, "continue from the slice files in OUTPUT.shards/");
    app.add_option(
           "--shard", args.shard,
           "worker share I/N: solve the I-th of N shares of the slices (1 <= I <= N) into OUTPUT.shards/, for furtable "
           "merge; auto: from "
           "the environment that a Slurm array, srun or an MPI launcher makes; none")
        ->capture_default_str();
    app.add_option("--compression", args.compression, "compression of the tables file")
        ->check(CLI::IsMember({"zstd", "gzip", "none"}))
        ->capture_default_str();
    app.add_option("--progress", args.progress, "progress on standard error")
        ->check(CLI::IsMember({"auto", "bar", "plain", "none"}))
        ->capture_default_str();
    app.add_flag("--json", args.json, "print one JSON object on standard output");
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Simulates the scattering of a fur fibre's medulla into tables (HDF5).", "medulla-precompute");
    Arguments args;
    declare(app, args);
    return run_program(app, argc, argv, [&] { run(app, args); });
}
