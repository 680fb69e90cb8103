// Run time against error of the three solvers, analog, random and deterministic: cell by cell, for the default tables
// (--tables), and the random solver against the deterministic one over every (sigma, g) of both tables (--compare).
#include <omp.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "bench_lobes.hpp"
#include "error_figure.hpp"
#include "sim2d/random.hpp"
#include "sim2d/tracer/kernel.hpp"
#include "tables/job/request.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;
using namespace medulla::sim2d;
using bench::Lobes;
using bench::TableCell;
using nlohmann::json;

namespace {

enum Method { kAnalog, kRandom, kDeterministic, kMethods };
const char* const kNames[] = {"analog", "random", "deterministic"};

struct Point {
    double seconds, error;
};
using Points = std::vector<Point>[kMethods];

/// Processor time of all threads, which other work on the machine disturbs less than wall time.
double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }
double wall() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

double median(std::vector<double> v) {
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return v[v.size() / 2];
}

json to_json(const Points& points) {
    json out;
    for (std::size_t m = 0; m < kMethods; ++m)
        for (const Point& p : points[m]) out[kNames[m]].push_back({p.seconds, p.error});
    return out;
}

// Cells ---------------------------------------------------------------------------------------------------------------

const TableCell kCells[] = {{true, 0.3, 0.0, 0.3},  {true, 0.3, 0.8, 0.3},  {true, 2, 0.0, 0.6},
                            {true, 2, 0.8, 0.6},    {true, 12, 0.0, 0.3},   {true, 12, 0.9, 0.3},
                            {false, 0.3, 0.0, 0.5}, {false, 0.3, 0.8, 0.5}, {false, 2, 0.0, 1.2},
                            {false, 2, 0.8, 1.2},   {false, 12, 0.0, 0.5},  {false, 12, 0.9, 0.5}};

/// On one thread, one after the other in one process; the reference is a deterministic solution on a finer grid.
json measure(const TableCell& c) {
    Points points;
    const Lobes truth = solve_deterministic(c, bench::kFinest);
    const auto add = [&](Method method, auto&& run) {
        const double start = now();
        const Lobes found = run();
        const double seconds = now() - start;
        points[method].push_back({seconds, bench::distance(found, truth)});
    };
    for (const std::uint64_t paths : {512, 4096, 32768, 262144}) {
        add(kAnalog, [&] { return trace_analog(c, 4 * paths).lobes; });
        add(kRandom, [&] { return trace_random(c, paths, 0).lobes; });
    }
    for (const bench::Resolution& r : bench::kResolutions)
        add(kDeterministic, [&] { return solve_deterministic(c, r); });
    std::printf("%s\n", title(c).c_str());
    for (std::size_t m = 0; m < kMethods; ++m) {
        std::printf("  %-14s", kNames[m]);
        for (const Point& p : points[m]) std::printf("  %9.5f s %.2e", p.seconds, p.error);
        std::printf("\n");
    }
    std::fflush(stdout);
    return {{"cell", title(c)}, {"seconds_error", to_json(points)}};
}

// Tables --------------------------------------------------------------------------------------------------------------

struct Errors {
    std::vector<double> estimated, actual, energy;
};

/// One table by the deterministic solver on all threads, and its error against a finer grid if requested.
void solve_table(bool disc, double target, double reference, Errors& e) {
    const tables::Request axes = tables::default_request();
    const std::size_t slices = axes.sigma.size() * axes.g.size();
    const std::vector<double>& along = disc ? axes.h.values : axes.theta_i.values;
    std::vector<std::optional<bench::SliceSolver>> ours_at(axes.g.size()), truth_at(axes.g.size());
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t i = 0; i < axes.g.size(); ++i) {
        ours_at[i].emplace(disc, axes.g.values[i], target, true);
        if (reference > 0) truth_at[i].emplace(disc, axes.g.values[i], reference, false);
    }
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t s = 0; s < slices; ++s) {
        // The expensive end first: large sigma.
        const std::size_t slice = slices - 1 - s;
        const double sigma = axes.sigma.values[slice / axes.g.size()];
        const std::size_t ig = slice % axes.g.size();
        const bench::Slice ours = ours_at[ig]->solve(sigma, along);
        bench::Slice truth;
        if (reference > 0) truth = truth_at[ig]->solve(sigma, along);
#pragma omp critical
        for (std::size_t i = 0; i < ours.size(); ++i)
            for (std::size_t k = 0; k < ours[i].size(); ++k) {
                e.estimated.push_back(ours[i][k].standard_error), e.energy.push_back(ours[i][k].energy_error);
                if (reference > 0) e.actual.push_back(bench::relative_l2(ours[i][k].lobe, truth[i][k].lobe));
            }
    }
}

/// Seconds of both tables. Random methods: mean time of random cells times the number of cells; analog extrapolated
/// from 20000 paths by 1 / error^2.
json measure_tables(double reference, std::size_t cells) {
    json out;
    const auto report = [&](Method method, double target, double seconds, json more) {
        more.update({{"method", kNames[method]}, {"error", target}, {"processor_s", seconds}});
        out.push_back(more);
        std::fflush(stdout);
    };
    for (const double target : {1e-2, 3e-3, 1e-3}) {
        double start = now(), start_wall = wall();
        Errors disc, slab;
        solve_table(true, target, 0, disc);
        const double disc_wall = wall() - start_wall;
        solve_table(false, target, 0, slab);
        const double seconds = now() - start, both_wall = wall() - start_wall;
        const double worst = *std::max_element(disc.estimated.begin(), disc.estimated.end());
        const double energy = *std::max_element(disc.energy.begin(), disc.energy.end());
        const double worst_slab = *std::max_element(slab.estimated.begin(), slab.estimated.end());
        std::printf(
            "both tables, deterministic, target %.0e: %.1f s on %d threads (disc %.1f), %.1f processor seconds\n"
            "  worst estimated error: disc %.1e, slab %.1e; error of the disc's energy before scaling %.1e at most\n",
            target, both_wall, omp_get_max_threads(), disc_wall, seconds, worst, worst_slab, energy);
        json more = {{"wall_s", both_wall},
                     {"threads", omp_get_max_threads()},
                     {"worst_estimate", worst},
                     {"worst_estimate_slab", worst_slab},
                     {"worst_energy_before_scaling", energy}};
        if (reference > 0) {
            Errors e;
            solve_table(true, target, reference, e);
            std::vector<double> ratio;
            for (std::size_t i = 0; i < e.actual.size(); ++i) ratio.push_back(e.estimated[i] / e.actual[i]);
            const double most = *std::max_element(e.actual.begin(), e.actual.end());
            const auto above = std::count_if(e.actual.begin(), e.actual.end(), [&](double x) { return x > target; });
            std::printf(
                "  true error of %zu lobes against target %.1e: median %.1e, worst %.1e, %td above the target; "
                "estimated / true: median %.1f, least %.2f\n",
                e.actual.size(), reference, median(e.actual), most, above, median(ratio),
                *std::min_element(ratio.begin(), ratio.end()));
            more.update({{"reference", reference}, {"median_error", median(e.actual)}, {"worst_error", most}});
        }
        report(kDeterministic, target, seconds, more);
    }
    const tables::Request axes = tables::default_request();
    std::vector<std::vector<double>> cost(3);  // analog to error 1; random to 1e-2 and 3e-3
    RandomStream random(7, 0, 0);
    const auto pick = [&](const std::vector<double>& v, std::size_t first) {
        return v[first + static_cast<std::size_t>(random.uniform() * static_cast<double>(v.size() - first))];
    };
    for (std::size_t i = 0; i < 2 * cells; ++i) {
        const bool disc = i % 2 == 0;
        // sigma = 0 is closed form.
        const TableCell c{disc, pick(axes.sigma.values, 1), pick(axes.g.values, 0),
                          pick(disc ? axes.h.values : axes.theta_i.values, 0)};
        double start = now();
        const double error = trace_analog(c, 20000).error;
        cost[0].push_back((now() - start) * error * error);
        for (const int k : {1, 2}) {
            start = now();
            trace_random(c, 1 << 22, k == 1 ? 1e-2 : 3e-3);
            cost[static_cast<std::size_t>(k)].push_back(now() - start);
        }
    }
    const double table_cells =
        static_cast<double>((axes.sigma.size() - 1) * axes.g.size() * (axes.h.size() + axes.theta_i.size()));
    const auto estimate = [&](Method method, double target, const std::vector<double>& each, double factor) {
        double sum = 0, squares = 0;
        for (const double x : each) sum += x, squares += x * x;
        const double n = static_cast<double>(each.size()), mean = sum / n;
        const double seconds = table_cells * factor * mean;
        const double error = table_cells * factor * std::sqrt((squares / n - mean * mean) / (n - 1));
        std::printf("both tables, %s, to %.0e: %.3g +- %.1g processor seconds, from %zu cells\n", kNames[method],
                    target, seconds, error, each.size());
        report(method, target, seconds, {{"processor_s_error", error}, {"from_cells", each.size()}});
    };
    for (const double target : {1e-2, 3e-3, 1e-3}) estimate(kAnalog, target, cost[0], 1 / (target * target));
    estimate(kRandom, 1e-2, cost[1], 1);
    estimate(kRandom, 3e-3, cost[2], 1);
    return out;
}

// Random against deterministic ----------------------------------------------------------------------------------------

constexpr int kRepetitions = 8;

/// Eight independent runs of the random solver per (sigma, g), each cell at another offset or inclination. Differences
/// of their mean lobe from the deterministic one, projected on three functions of the bins, are noise if both are
/// right: t-values of seven degrees of freedom, whose p-values are uniform over twenty classes.
/// Stated errors are correct if true squares minus stated squares are 0 on average.
/// @return whether p-values are uniform, in all nine tests at 1e-3 each, and errors correct within 5 deviations
bool compare(json& out) {
    const tables::Request axes = tables::default_request();
    const char* const functions[] = {"cos", "cos 4", "random signs"};
    bool agree = true;
    for (const bool disc : {true, false}) {
        const std::vector<double>& along = disc ? axes.h.values : axes.theta_i.values;
        const std::size_t sides = disc ? 1 : 2;
        std::vector<std::vector<double>> p(3 * sides);
        std::vector<double> excess;  // (true error^2 - stated error^2) / stated error^2
        std::size_t skipped = 0;
        for (std::size_t ig = 0; ig < axes.g.size(); ++ig) {
            const bench::SliceSolver solver(disc, axes.g.values[ig], 3e-4, true);
            for (std::size_t is = 0; is < axes.sigma.size(); ++is) {
                const TableCell c{disc, axes.sigma.values[is], axes.g.values[ig],
                                  along[(7 * is + 3 * ig) % along.size()]};
                const bench::Profiles exact = solver.solve(c.sigma, {c.along})[0];
                std::vector<bench::Profiles> found;
                for (std::uint64_t r = 0; r < kRepetitions; ++r)
                    found.push_back(bench::random_profiles(c, 256, r + 1, ig * axes.sigma.size() + is));
                for (std::size_t side = 0; side < sides; ++side) {
                    const std::vector<double>& truth = exact[side].lobe;
                    double square[kRepetitions], stated[kRepetitions], all = 0;
                    for (std::size_t r = 0; r < kRepetitions; ++r) {
                        square[r] = std::pow(bench::relative_l2(found[r][side].lobe, truth), 2);
                        all += stated[r] = std::pow(found[r][side].standard_error, 2);
                    }
                    // Where the noise is close to the error of the deterministic solver, the difference contains both:
                    // at twenty times that error it adds at most 1/400.
                    if (std::sqrt(all / kRepetitions) < 20 * exact[side].standard_error + 1e-5) {
                        ++skipped;
                        continue;
                    }
                    // Normalised by the errors of the other repetitions, so that the mean is 0 if errors are correct.
                    double sum = 0;
                    for (std::size_t r = 0; r < kRepetitions; ++r)
                        sum += (square[r] - stated[r]) / (all - stated[r]) * (kRepetitions - 1) / kRepetitions;
                    excess.push_back(sum);
                    for (std::size_t k = 0; k < 3; ++k) {
                        RandomStream signs(99, is, ig);
                        std::vector<double> value(kRepetitions, 0.0);
                        for (std::size_t b = 0; b < truth.size(); ++b) {
                            const double phi = 2 * pi * (double(b) + 0.5) / double(truth.size());
                            const double f =
                                k == 2 ? (signs.uniform() < 0.5 ? -1 : 1) : std::cos(k == 0 ? phi : 4 * phi);
                            for (std::size_t r = 0; r < kRepetitions; ++r)
                                value[r] += f * (found[r][side].lobe[b] - truth[b]);
                        }
                        double mean = 0, variance = 0;
                        for (const double v : value) mean += v / kRepetitions;
                        for (const double v : value) variance += (v - mean) * (v - mean) / (kRepetitions - 1);
                        p[3 * side + k].push_back(
                            test::student_p(mean / std::sqrt(variance / kRepetitions), kRepetitions - 1));
                    }
                }
            }
        }
        double mean = 0, deviation = 0;
        for (const double x : excess) mean += x / double(excess.size());
        for (const double x : excess) deviation += (x - mean) * (x - mean);
        deviation = std::sqrt(deviation) / double(excess.size());
        std::printf(
            "random against deterministic, %s: %zu (sigma, g), %zu lobes, %zu skipped: below the error of the other\n"
            "  (true / stated error of the random solver)^2 - 1: %.3f +- %.3f\n",
            disc ? "disc" : "slab", axes.sigma.size() * axes.g.size(), excess.size(), skipped, mean, deviation);
        agree = agree && std::abs(mean) < 5 * deviation;
        json tests;
        for (std::size_t t = 0; t < p.size(); ++t) {
            const double chi = test::evenness_p(p[t], 20);
            const double least = *std::min_element(p[t].begin(), p[t].end());
            // Bonferroni for the most extreme of n.
            const bool good = chi > 1e-3 && least * double(p[t].size()) > 1e-3;
            agree = agree && good;
            const char* lobe = disc ? "lobe" : (t < 3 ? "back" : "forward");
            std::printf("  %-7s on %-12s chi-squared p = %.3f, least p of %zu = %.1e: %s\n", lobe, functions[t % 3],
                        chi, p[t].size(), least, good ? "noise" : "NOT noise");
            tests.push_back({{"lobe", lobe},
                             {"function", functions[t % 3]},
                             {"chi_squared_p", chi},
                             {"least_p", least},
                             {"lobes", p[t].size()}});
        }
        std::fflush(stdout);
        out.push_back({{"table", disc ? "azimuthal" : "longitudinal"},
                       {"lobes", excess.size()},
                       {"skipped", skipped},
                       {"excess", mean},
                       {"excess_error", deviation},
                       {"tests", tests}});
    }
    return agree;
}

// Figure --------------------------------------------------------------------------------------------------------------

/// Of the numbers that --json writes.
plot::Figure figure_of(const json& numbers) {
    const char* const colours[] = {plot::grey, plot::blue, plot::vermilion};
    const char* const labels[] = {"analog tracer", "Monte Carlo tracer", "deterministic solver"};
    const auto curve = [&](std::size_t method) {
        plot::Curve c;
        c.label = labels[method], c.colour = colours[method], c.width = 2, c.marks = true;
        return c;
    };
    plot::Figure figure;
    figure.title = "Relative L2 error of a lobe (720 bins) against processor seconds";
    for (std::size_t m = 0; m < kMethods; ++m) figure.legend.push_back(curve(m));
    std::vector<plot::Panel> panels;
    for (const json& cell : numbers.value("cells", json::array())) {
        plot::Panel panel;
        panel.title = plot::printable(cell.at("cell"));
        for (std::size_t m = 0; m < kMethods; ++m) {
            plot::Curve c = curve(m);
            for (const json& point : cell.at("seconds_error").at(kNames[m]))
                c.x.push_back(point.at(0)), c.y.push_back(point.at(1));
            panel.curves.push_back(std::move(c));
        }
        panels.push_back(std::move(panel));
    }
    bench::add_panels(figure, 4, "processor seconds of one cell", 1e-6, std::move(panels));
    if (!numbers.contains("tables")) return figure;
    plot::Panel panel;
    panel.title = "both default tables, by target error";
    for (std::size_t m = 0; m < kMethods; ++m) {
        plot::Curve c = curve(m);
        for (const json& row : numbers.at("tables"))
            if (row.at("method") == kNames[m]) c.x.push_back(row.at("processor_s")), c.y.push_back(row.at("error"));
        panel.curves.push_back(std::move(c));
    }
    bench::add_panels(figure, 4, "processor seconds of both tables", 1e-6, {panel});
    return figure;
}

}  // namespace

int main(int argc, char** argv) {
    std::string json_file, figure_file, numbers_file;
    bool cells_too = true, tables = false, compared = false;
    double reference = 0;
    std::size_t cells = 32;
    CLI::App app("Run time against error of the solvers");
    app.add_flag("!--no-cells", cells_too, "skip the twelve cells");
    app.add_flag("--tables", tables, "time both default tables too");
    app.add_option("--reference", reference, "with --tables: target error of a finer grid for the true errors");
    app.add_option("--cells", cells, "with --tables: cells per table for the estimate of the random methods' time");
    app.add_flag("--compare", compared, "random against deterministic over every (sigma, g) of both tables");
    app.add_option("--json", json_file, "write the numbers to FILE");
    app.add_option("--figure", figure_file, "draw them into FILE: .svg, .png or .html");
    app.add_option("--from", numbers_file, "measure nothing: draw the numbers that --json wrote into FILE");
    CLI11_PARSE(app, argc, argv);

    if (!numbers_file.empty()) {
        bench::save(figure_of(json::parse(std::ifstream(numbers_file))), figure_file);
        return 0;
    }
    json out = {{"instruction_set", tracer_target()}};
    for (const TableCell& c : kCells)
        if (cells_too) out["cells"].push_back(measure(c));
    if (tables) out["tables"] = measure_tables(reference, cells);
    const bool agree = !compared || compare(out["compare"]);
    if (!json_file.empty()) std::ofstream(json_file) << out.dump(1) << '\n';
    if (!figure_file.empty()) bench::save(figure_of(out), figure_file);
    return agree ? 0 : 1;
}
