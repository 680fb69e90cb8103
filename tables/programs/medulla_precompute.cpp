// medulla-precompute: simulates the tables. Words in, one HDF5 file out.
#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "sim2d/disc/deterministic.hpp"
#include "tables/job/forecast.hpp"
#include "tables/job/launcher.hpp"
#include "tables/job/precompute.hpp"
#include "tables/job/scene.hpp"
#include "tables/job/simulate.hpp"
#include "tables/programs/number.hpp"
#include "tables/programs/program.hpp"
#include "tables/store/json_text.hpp"

namespace {

using namespace medulla::tables;

struct Words {
    std::string output = "tables.h5", table = "both", sigma, g, h, theta, absorption, method = "auto",
                progress = "auto", compression = "zstd", shard = "auto", scene;
    std::size_t bins = 720;
    std::uint64_t paths = 100000, seed = 1;
    std::optional<double> target_error, time_budget;
    int threads = 0;
    bool json = false, resume = false, dry_run = false;
};

/// The axis `name` of a range given in words, whose numbers are in units of `unit`.
Axis axis_of(const std::string& words, const std::string& option, const std::string& name, std::size_t default_count,
             double unit = 1) {
    Range range = parse_range(words, option, default_count);
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

Request request_of(const Words& words) {
    try {
        Request request = default_request();
        request.azimuthal = words.table != "longitudinal";
        request.longitudinal = words.table != "azimuthal";
        const auto set = [](Axis& axis, const std::string& range, const char* option, double unit = 1) {
            if (!range.empty()) axis = axis_of(range, option, axis.name, axis.size() > 0 ? axis.size() : 8, unit);
        };
        set(request.sigma, words.sigma, "--sigma-range");
        set(request.g, words.g, "--g-range");
        set(request.h, words.h, "--h-range");
        set(request.theta_i, words.theta, "--theta-range", medulla::pi / 180);
        set(request.absorption, words.absorption, "--absorption-range");  // default: none
        request.bins = words.bins;
        request.paths = words.paths;
        request.target_error = words.target_error.value_or(0);
        request.time_budget = words.time_budget.value_or(0);
        request.seed = words.seed;
        request.threads = words.threads;
        request.method = method_of(words.method);
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

/// What --shard says; `auto` asks the launcher's environment, and says what it found.
std::optional<WorkerShare> share_named(const std::string& words) {
    try {
        if (words == "none") return std::nullopt;
        if (words != "auto") return parse_worker_share(words);
        const std::optional<Launched> found = launched([](const char* name) { return std::getenv(name); });
        if (!found) return std::nullopt;
        note("medulla-precompute: worker {} of {} by {} (--shard none: alone)\n", found->share.index,
             found->share.count, found->from);
        return found->share;
    } catch (const Error& error) {
        throw UsageError("{}{}", words == "auto" ? "--shard auto: " : "", error.what());
    }
}

Job job_of(const Words& words) {
    Job job;
    job.request = request_of(words);
    job.output = words.output;
    if (!words.scene.empty()) job.inputs = {words.scene};
    job.resume = words.resume;
    job.share = share_named(words.shard);
    job.progress = progress_of(words.progress);
    job.compression = compression_of(words.compression);
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

/// --dry-run: what would be simulated, and how long it will take. `share`: of the job without --scene.
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

/// A worker's last words: what it did, and what is to be done when all have.
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
    print("shard {}/{}: {} in {} after {}; when every shard is there: furtable merge {} -o {}\n", job.share->index,
          job.share->count, counted(report.slices, "slice"), report.folder, duration_text(seconds), report.folder,
          job.output);
}

void run(const Words& words) {
    Job job = job_of(words);
    double share = 1;
    if (!words.scene.empty()) {
        const double whole = total_cost(job);
        std::vector<std::string> notes;
        try {
            job.request = restrict_to(job.request, read_scene(words.scene), notes);
        } catch (const Error& error) {
            const std::string what = error.what();
            throw Error("{}{}", what.rfind(words.scene, 0) == 0 ? "" : words.scene + ": ", what);
        }
        for (const std::string& text : notes) note("{}: {}\n", words.scene, text);
        share = total_cost(job) / whole;
    }
    if (words.dry_run) return print_forecast(job, share, words.json);
    if (!words.json) print_messages();
    const auto start = std::chrono::steady_clock::now();
    const JobReport report = run_job(job);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (job.share && !report.was_complete) return print_share(job, report, seconds, words.json);
    nlohmann::ordered_json json = {{"output", json_name(words.output)},
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
        if (!words.json && above > 0)
            print("{}: {} of {} cells did not reach {:g}\n", table->name(), above, table->cells(),
                  job.request.target_error);
        if (!words.json)
            print("{}: {} x {} bins, {}, worst relative standard error of a lobe {:.2e}\n", table->name(),
                  counted(table->cells(), "cell"), table->bins(), table->method, worst);
    }
    if (words.json)
        print("{}\n", json_line(json));
    else if (report.was_complete)
        print("{} is complete\n", words.output);
    else
        print("{} written in {}\n", words.output, duration_text(seconds));
}

void declare(CLI::App& app, Words& words) {
    app.set_version_flag("--version", "medulla " MEDULLA_VERSION);
    app.add_option("-o,--output", words.output, "tables file to write")->capture_default_str();
    app.add_option("--table", words.table, "which table")
        ->check(CLI::IsMember({"azimuthal", "longitudinal", "both"}))
        ->capture_default_str();
    app.add_option("--sigma-range", words.sigma, "optical radii LO:HI[:N], nodes denser towards LO (default 0:16:24)");
    app.add_option("--g-range", words.g, "anisotropy LO:HI[:N], nodes denser towards HI (default 0:0.95:16)");
    app.add_option("--h-range", words.h, "offsets LO:HI[:N], nodes denser towards HI (default 0:1:16)");
    app.add_option("--theta-range", words.theta,
                   "inclinations in degrees LO:HI[:N], nodes denser towards HI (default 0:90:16)");
    app.add_option("--absorption-range", words.absorption,
                   "optical radii of absorption LO:HI[:N], nodes denser towards LO: a fifth axis of C^N, from the same "
                   "paths (default: none; N 8)");
    app.add_option("--scene", words.scene, "scene file (JSON): only the nodes that its materials can ask for");
    app.add_flag("--dry-run", words.dry_run, "say what would be simulated and how long it will take; write nothing");
    add_number(app, "--bins", words.bins, "exit directions over the full circle, even", {8, 4096})
        ->capture_default_str();
    app.add_option(
           "--method", words.method,
           fmt::format("how each cell is solved. deterministic: without noise, on grids for a relative L2 error "
                       "of {0:g} of each lobe (or of --target-error). auto: the same, and by walks (mc) in discs "
                       "of sigma above {1:g} and where a cell's own estimate of its error is above what --paths "
                       "counted paths would leave. analog, mc: random",
                       medulla::sim2d::DiscOptions{}.target_error, greatest_grid_sigma))
        ->check(CLI::IsMember({"auto", "analog", "mc", "deterministic"}))
        ->capture_default_str();
    // Each excludes the others. (An option group would do it too, but CLI11 2.1 does not end on stray words beside
    // one.)
    CLI::Option* paths =
        add_number(app, "--paths", words.paths,
                   "paths per cell of the random methods; without another stopping rule, auto's measure of a grid",
                   {1, most_paths})
            ->capture_default_str();
    CLI::Option* target =
        add_number(app, "--target-error", words.target_error,
                   fmt::format("instead: relative L2 standard error below which each cell is solved, {:g} to {:g}",
                               least_target, greatest_target),
                   {least_target, greatest_target})
            ->excludes(paths);
    add_number(
        app, "--time-budget", words.time_budget,
        "instead: seconds for the job, spent where error falls most (results then depend on the machine's speed)",
        above_zero)
        ->excludes(paths, target);
    add_number(app, "--seed", words.seed, "of the random methods")->capture_default_str();
    add_number(app, "--threads", words.threads, "0: all", {0, 1024})->capture_default_str();
    app.add_flag("--resume", words.resume, "go on from the slices kept in OUTPUT.shards/");
    app.add_option("--shard", words.shard,
                   "I/N: solve the I-th of N shares (1 <= I <= N) into OUTPUT.shards/, for furtable merge; auto: from "
                   "the environment that a Slurm array, srun or an MPI launcher makes; none")
        ->capture_default_str();
    app.add_option("--compression", words.compression, "of the tables file")
        ->check(CLI::IsMember({"zstd", "gzip", "none"}))
        ->capture_default_str();
    app.add_option("--progress", words.progress, "on standard error")
        ->check(CLI::IsMember({"auto", "bar", "plain", "none"}))
        ->capture_default_str();
    app.add_flag("--json", words.json, "print one JSON object on standard output");
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Simulates the scattering of a fur fibre's medulla into tables (HDF5).", "medulla-precompute");
    Words words;
    declare(app, words);
    return run_program(app, argc, argv, [&] { run(words); });
}
