// Seconds and true error of the disc solver, slice by slice, per target error (whole tables: bench_simulation
// --tables). The true error is the relative L2 distance to the same solver on a much finer grid (--reference).
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "sim2d/disc/deterministic.hpp"
#include "tables/table/axis.hpp"

using namespace medulla;

namespace {

/// Processor time, which other work on the machine disturbs less than wall time.
double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double distance(const std::vector<double>& a, const std::vector<double>& b) {
    double error = 0, norm = 0;
    for (std::size_t i = 0; i < a.size(); ++i) error += (a[i] - b[i]) * (a[i] - b[i]), norm += b[i] * b[i];
    return std::sqrt(error / norm);
}

double median(std::vector<double> x) {
    std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
    return x[x.size() / 2];
}

sim2d::DiscOptions aiming_at(double target) {
    sim2d::DiscOptions options;
    options.target_error = target;
    return options;
}

}  // namespace

int main(int argc, char** argv) {
    std::string json;
    std::vector<double> targets = {3e-3, 1e-3}, sigmas = {0.1, 1, 4, 16}, gs = {-0.6, 0, 0.5, 0.8, 0.95};
    double reference = 5e-5;
    CLI::App app("Disc solver: seconds against true error");
    app.add_option("--target", targets, "target errors to measure");
    app.add_option("--sigma", sigmas);
    app.add_option("--g", gs);
    app.add_option("--reference", reference, "target error of the finer grid");
    app.add_option("--json", json, "write the numbers to FILE");
    CLI11_PARSE(app, argc, argv);

    // The default offsets, those of 24 nodes, and a few that are on no table.
    std::vector<double> h = tables::graded_axis("h", {0, 1, 16}).values;
    for (const double x : tables::graded_axis("h", {0, 1, 24}).values)
        if (x > 0.9 && x < 1) h.push_back(x);
    h.insert(h.end(), {0.95, 0.975, 0.985});
    nlohmann::json out;
    std::printf("%7s %6s %8s %8s | %9s %9s | %9s %9s %9s | %9s\n", "sigma", "g", "target", "seconds", "error", "worst",
                "estimated", "median", "least", "energy");
    std::printf("%33s| %19s | %9s %19s |\n", "", "median", "worst", "estimated / true");
    for (const double sigma : sigmas)
        for (const double g : gs) {
            sim2d::DiscOptions finest = aiming_at(reference);
            finest.estimate_error = false;
            const auto truth = sim2d::DiscSolver(g, finest).solve(sigma, h, 720);
            for (const double target : targets) {
                const double start = now();
                const auto solved = sim2d::DiscSolver(g, aiming_at(target)).solve(sigma, h, 720);
                const double seconds = now() - start;
                std::vector<double> error, ratio;
                double estimated = 0, energy = 0;
                for (std::size_t i = 0; i < h.size(); ++i) {
                    error.push_back(distance(solved[i].lobe, truth[i].lobe));
                    ratio.push_back(solved[i].standard_error / error.back());
                    estimated = std::max(estimated, solved[i].standard_error);
                    energy = std::max(energy, solved[i].energy_error);
                }
                const double worst = *std::max_element(error.begin(), error.end());
                const double least = *std::min_element(ratio.begin(), ratio.end());
                std::printf("%7g %6g %8.0e %8.3f | %9.1e %9.1e | %9.1e %9.1f %9.1f | %9.1e\n", sigma, g, target,
                            seconds, median(error), worst, estimated, median(ratio), least, energy);
                std::fflush(stdout);
                out["slices"].push_back({{"sigma", sigma},
                                         {"g", g},
                                         {"target", target},
                                         {"seconds", seconds},
                                         {"median_error", median(error)},
                                         {"worst_error", worst},
                                         {"worst_estimate", estimated},
                                         {"median_ratio", median(ratio)},
                                         {"least_ratio", least},
                                         {"energy_error", energy}});
            }
        }
    if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
}
