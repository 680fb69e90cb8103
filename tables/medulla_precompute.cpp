// medulla-precompute: simulates the tables. Words in, one HDF5 file out.
#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "tables/precompute.hpp"
#include "tables/program.hpp"

namespace {

using namespace medulla::tables;

struct Words {
    std::string output = "tables.h5", table = "both", sigma, g, h, theta, absorption, method = "auto",
                progress = "auto", compression = "zstd", shard = "auto";
    std::size_t bins = 720;
    std::uint64_t paths = 100000, seed = 1;
    int threads = 0;
    bool json = false, resume = false;
};

/// The axis of a range given in words; the default one where there are none.
Axis axis_of(const std::string& words, const std::string& option, const Axis& standard, double unit = 1) {
    if (words.empty()) return standard;
    Range range = parse_range(words, option, standard.size());
    range.low *= unit, range.high *= unit;
    return graded_axis(standard.name, range);
}

Request request_of(const Words& words) {
    try {
        Request request = default_request();
        request.azimuthal = words.table != "longitudinal";
        request.longitudinal = words.table != "azimuthal";
        request.sigma = axis_of(words.sigma, "--sigma-range", request.sigma);
        request.g = axis_of(words.g, "--g-range", request.g);
        request.h = axis_of(words.h, "--h-range", request.h);
        request.theta_i = axis_of(words.theta, "--theta-range", request.theta_i, medulla::pi / 180);
        if (!words.absorption.empty())
            request.absorption = graded_axis("absorption", parse_range(words.absorption, "--absorption-range", 8));
        request.bins = words.bins;
        request.paths = words.paths;
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

/// What --shard says; `auto` asks the launcher's environment.
std::optional<Shard> shard_of(const std::string& words) {
    try {
        if (words == "auto") return launcher_shard([](const char* name) { return std::getenv(name); });
        if (words == "none") return std::nullopt;
        return parse_shard(words);
    } catch (const Error& error) {
        throw UsageError("{}", error.what());
    }
}

Job job_of(const Words& words) {
    Job job;
    job.request = request_of(words);
    job.output = words.output;
    job.resume = words.resume;
    job.shard = shard_of(words.shard);
    job.progress = progress_of(words.progress);
    job.compression = compression_of(words.compression);
    return job;
}

/// A worker's last words: what it did, and what is to be done when all have.
void print_share(const Job& job, const JobReport& report, double seconds, bool as_json) {
    if (as_json) {
        const nlohmann::ordered_json json = {{"shards", report.shards},    {"shard", job.shard->index},
                                             {"of", job.shard->count},     {"slices", report.slices},
                                             {"kept_before", report.kept}, {"seconds", seconds}};
        fmt::print("{}\n", json.dump());
        return;
    }
    fmt::print("shard {}/{}: {} slices in {} after {}; when every shard is there: furtable merge {} -o {}\n",
               job.shard->index, job.shard->count, report.slices, report.shards, duration_text(seconds), report.shards,
               job.output);
}

void run(const Words& words) {
    const Job job = job_of(words);
    const auto start = std::chrono::steady_clock::now();
    const JobReport report = run_job(job);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (job.shard && !report.was_complete) return print_share(job, report, seconds, words.json);
    nlohmann::ordered_json json = {{"output", words.output},
                                   {"seconds", seconds},
                                   {"was_complete", report.was_complete},
                                   {"sha256", hex(contents_hash(report.tables))}};
    for (const Table* table : report.tables.present()) {
        double worst = 0;
        for (const double e : table->standard_error) worst = std::max(worst, e);
        json["tables"][table->name] = {{"cells", table->cells()},
                                       {"bins", table->bins()},
                                       {"method", table->method},
                                       {"worst_standard_error", worst}};
        if (!words.json)
            fmt::print("{}: {} cells x {} bins, {}, worst relative standard error of a lobe {:.2e}\n", table->name,
                       table->cells(), table->bins(), table->method, worst);
    }
    if (words.json)
        fmt::print("{}\n", json.dump());
    else if (report.was_complete)
        fmt::print("{} is complete\n", words.output);
    else
        fmt::print("{} written in {}\n", words.output, duration_text(seconds));
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
    app.add_option("--bins", words.bins, "exit directions over the full circle, even")->capture_default_str();
    app.add_option("--method", words.method, "how each cell is solved")
        ->check(CLI::IsMember({"auto", "analog", "mc", "deterministic"}))
        ->capture_default_str();
    app.add_option("--paths", words.paths, "paths per cell of the random methods")->capture_default_str();
    app.add_option("--seed", words.seed, "of the random methods")->capture_default_str();
    app.add_option("--threads", words.threads, "0: all")->capture_default_str();
    app.add_flag("--resume", words.resume, "go on from the slices kept in OUTPUT.shards/");
    app.add_option("--shard", words.shard,
                   "I/N: solve the I-th of N shares (1 <= I <= N) into OUTPUT.shards/, for furtable merge; auto: from "
                   "SLURM_ARRAY_TASK_ID, _COUNT or OMPI_COMM_WORLD_RANK, _SIZE; none")
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
