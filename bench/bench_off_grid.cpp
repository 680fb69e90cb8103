// Errors of whole lobes at random parameters off every grid, everything included: the solver, the axes, interpolation,
// compression, rounding. Usage: bench_off_grid [--pairs N] [--lobes M] [--seed S] [--json FILE] SOURCE...
// SOURCE is a tables file, a pack or `default`. N random (sigma, g), M random offsets and inclinations at each; every
// parameter is uniform between two nodes of the default axes, and all intervals are equally likely.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "sim2d/disc/deterministic.hpp"
#include "sim2d/slab/deterministic.hpp"
#include "tables/job/request.hpp"
#include "tables/pack/source.hpp"

using namespace medulla::tables;

namespace {

struct Lobe {
    Parameters at;
    std::vector<double> truth;
};

/// Uniform between the nodes of an axis.
double between(const Axis& axis, std::mt19937_64& random) {
    const double u = std::uniform_real_distribution<double>(0, static_cast<double>(axis.size() - 1))(random);
    const auto i = std::min(static_cast<std::size_t>(u), axis.size() - 2);
    return axis.values[i] + (u - static_cast<double>(i)) * (axis.values[i + 1] - axis.values[i]);
}

double error_of(const Source& source, medulla::TableKind kind, const Lobe& lobe) {
    const std::vector<double> other = source.lobe(kind, lobe.at, lobe.truth.size());
    double misfit = 0, norm = 0;
    for (std::size_t b = 0; b < other.size(); ++b) {
        misfit += (other[b] - lobe.truth[b]) * (other[b] - lobe.truth[b]);
        norm += lobe.truth[b] * lobe.truth[b];
    }
    return std::sqrt(misfit / norm);
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Errors of lobes at random parameters");
    std::size_t pairs = 64, count = 8;
    std::uint64_t seed = 1;
    std::string json_file;
    std::vector<std::string> files;
    app.add_option("--pairs", pairs)->check(CLI::PositiveNumber);
    app.add_option("--lobes", count)->check(CLI::PositiveNumber);
    app.add_option("--seed", seed);
    app.add_option("--json", json_file);
    app.add_option("SOURCE", files)->required();
    CLI11_PARSE(app, argc, argv);

    const Request axes = default_request();
    std::mt19937_64 random(seed);
    struct Pair {
        double sigma, g;
        std::vector<double> h, theta_i;
    };
    std::vector<Pair> list(pairs);
    for (Pair& pair : list) {
        pair.sigma = between(axes.sigma, random), pair.g = between(axes.g, random);
        for (std::size_t i = 0; i < count; ++i) {
            pair.h.push_back(between(axes.h, random));
            pair.theta_i.push_back(between(axes.theta_i, random));
        }
    }
    const std::size_t kinds = lobe_kinds.size();
    std::vector<std::vector<Lobe>> truths(kinds, std::vector<Lobe>(pairs * count));
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t p = 0; p < pairs; ++p) {
        const Pair& pair = list[p];
        const auto disc = medulla::sim2d::DiscSolver(pair.g).solve(pair.sigma, pair.h, axes.bins);
        const auto slab = medulla::sim2d::SlabSolver(pair.g).solve(pair.sigma, pair.theta_i, axes.bins / 2);
        for (std::size_t i = 0; i < count; ++i) {
            Parameters at;
            at.sigma = pair.sigma, at.g = pair.g, at.h = pair.h[i], at.theta_i = pair.theta_i[i];
            const std::size_t cell = p * count + i;
            truths[0][cell] = {at, disc[i].lobe};
            truths[1][cell] = {at, slab[i].back.lobe};
            truths[2][cell] = {at, slab[i].forward.lobe};
        }
    }
    fmt::print("{} random (sigma, g), {} lobes at each\n{:<24} {:<22} {:>10} {:>10} {:>10}  {}\n", pairs, count,
               "source", "lobes", "median", "90 %", "worst", "worst at");
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const std::string& file : files) {
        const auto source = open_source(file);
        for (std::size_t k = 0; k < kinds; ++k) {
            const medulla::TableKind kind = lobe_kinds[k];
            if (!source->has(kind)) continue;
            std::vector<double> errors(truths[k].size());
#pragma omp parallel for schedule(dynamic, 16)
            for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = error_of(*source, kind, truths[k][i]);
            const auto worst =
                static_cast<std::size_t>(std::max_element(errors.begin(), errors.end()) - errors.begin());
            std::string where;
            for (const Axis& axis : source->parameter_axes(kind))
                where += fmt::format("{} {:.4g} ", axis.name, truths[k][worst].at[axis.name]);
            const double greatest = errors[worst];
            std::sort(errors.begin(), errors.end());
            const double median = errors[errors.size() / 2], most = errors[errors.size() * 9 / 10];
            fmt::print("{:<24} {:<22} {:>10.2e} {:>10.2e} {:>10.2e}  {}\n", file.substr(file.rfind('/') + 1),
                       name_of(kind), median, most, greatest, where);
            json.push_back({{"source", file.substr(file.rfind('/') + 1)},
                            {"lobes", name_of(kind)},
                            {"median", median},
                            {"p90", most},
                            {"worst", greatest},
                            {"worst_at", where}});
        }
    }
    if (!json_file.empty()) std::ofstream(json_file) << json.dump(1) << '\n';
}
