#include "tables/simulate.hpp"

#include <omp.h>

#include <atomic>
#include <cstring>
#include <exception>
#include <functional>

#include "sim2d/analog.hpp"
#include "sim2d/slab_deterministic.hpp"
#include "tables/error.hpp"

namespace medulla::tables {
namespace {

/// A cell's random numbers belong to its parameters, not to its place in a table: the same cell in another table, or
/// in a part of one, gets the same path set.
std::uint64_t cell_key(std::uint64_t kind, std::initializer_list<double> parameters) {
    const auto mix = [](std::uint64_t z) {  // splitmix64's finaliser
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    };
    std::uint64_t key = mix(kind + 0x9e3779b97f4a7c15u);
    for (const double x : parameters) {
        std::uint64_t bits;
        std::memcpy(&bits, &x, sizeof bits);
        key = mix(key ^ bits) + 0x9e3779b97f4a7c15u;
    }
    return key;
}

/// Stores a solved cell. Lobes are brought to integral 1 in the float that is stored.
void store(Table& table, std::size_t cell, const sim2d::Profile& profile) {
    if (profile.lobe.size() != table.bins())
        throw Error("{}: {}: the solver returned no lobe", table.name, table.describe(cell));
    for (std::size_t b = 0; b < table.bins(); ++b)
        table.lobe[cell * table.bins() + b] = static_cast<float>(profile.lobe[b]);
    table.energy[cell] = profile.energy;
    table.energy_error[cell] = profile.energy_error;
    table.standard_error[cell] = profile.standard_error;
    table.mean_length[cell] = profile.mean_length;
}

/// Runs `job(i)` for all i in parallel and rethrows the first error.
void parallel(std::size_t count, int threads, const std::function<void(std::size_t)>& job) {
    std::exception_ptr error;
    std::atomic<bool> failed{false};
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads > 0 ? threads : omp_get_max_threads())
    for (std::size_t i = 0; i < count; ++i) {
        if (failed) continue;
        try {
            job(i);
        } catch (...) {
#pragma omp critical
            if (!failed.exchange(true)) error = std::current_exception();
        }
    }
    if (error) std::rethrow_exception(error);
}

sim2d::TraceOptions trace_options(const Request& request, std::uint64_t cell) {
    sim2d::TraceOptions options;
    options.paths = request.paths;
    options.seed = request.seed;
    options.cell = cell;
    return options;
}

bool noise_free(Method method) { return method == Method::automatic || method == Method::deterministic; }

/// `auto` asks the random tracer where the noise-free solver's own estimate is worse than a thousandth.
bool wants_paths(Method method, double error) {
    if (method == Method::deterministic) return false;
    return method != Method::automatic || error > 1e-3;
}

void begin(Table& table, const Request& request) {
    table.method = name_of(request.method);
    table.seed = request.seed, table.paths = request.paths;
    if (request.method == Method::deterministic) table.seed = table.paths = 0;
    table.allocate();
}

Table simulate_azimuthal(const Request& request, ProgressMode mode) {
    Table table;
    table.name = "azimuthal";
    table.axes = {request.sigma, request.g, request.h, exit_axis("phi", request.bins)};
    begin(table, request);
    const std::size_t offsets = request.h.size(), slices = table.cells() / offsets;
    Progress progress(mode, "azimuthal", table.cells());
    parallel(slices, request.threads, [&](std::size_t slice) {
        const double sigma = request.sigma.values[slice / request.g.size()],
                     g = request.g.values[slice % request.g.size()];
        for (std::size_t i = 0; i < offsets; ++i) {
            const double h = request.h.values[i];
            store(table, slice * offsets + i,
                  sim2d::trace_disc(sigma, g, h, request.bins, trace_options(request, cell_key(0, {sigma, g, h}))));
            progress.add(1);
        }
    });
    return table;
}

Table simulate_longitudinal(const Request& request, ProgressMode mode) {
    Table table;
    table.name = "longitudinal";
    table.axes = {request.sigma, request.g, request.theta_i, {"side", {0, 1}}, exit_axis("theta_r", request.bins / 2)};
    begin(table, request);
    const std::vector<double>& g = request.g.values;
    const std::size_t angles = request.theta_i.size(), slices = table.cells() / (2 * angles);
    Progress progress(mode, "longitudinal", table.cells());
    // What depends on g alone is worked out once and shared by every sigma.
    std::vector<std::optional<sim2d::SlabSolver>> solvers(g.size());
    if (noise_free(request.method))
        parallel(g.size(), request.threads, [&](std::size_t i) { solvers[i].emplace(g[i]); });
    parallel(slices, request.threads, [&](std::size_t slice) {
        const double sigma = request.sigma.values[slice / g.size()];
        const std::size_t ig = slice % g.size();
        std::vector<sim2d::SlabProfile> solved;
        if (solvers[ig]) solved = solvers[ig]->solve(sigma, request.theta_i.values, table.bins());
        for (std::size_t i = 0; i < angles; ++i) {
            const double theta_i = request.theta_i.values[i];
            sim2d::SlabProfile both;
            if (!solved.empty()) both = std::move(solved[i]);
            const double error = solved.empty() ? 1 : std::max(both.back.standard_error, both.forward.standard_error);
            if (wants_paths(request.method, error)) {
                sim2d::SlabProfile traced = sim2d::trace_slab(
                    sigma, g[ig], theta_i, table.bins(), trace_options(request, cell_key(1, {sigma, g[ig], theta_i})));
                if (std::max(traced.back.standard_error, traced.forward.standard_error) < error)
                    both = std::move(traced);
            }
            const std::size_t cell = 2 * (slice * angles + i);
            store(table, cell, both.back);
            store(table, cell + 1, both.forward);
            progress.add(2);
        }
    });
    return table;
}

}  // namespace

Tables simulate(const Request& request, ProgressMode progress) {
    check_request(request);
    Tables tables;
    tables.program = "medulla " MEDULLA_VERSION;
    if (request.azimuthal) tables.azimuthal = simulate_azimuthal(request, progress);
    if (request.longitudinal) tables.longitudinal = simulate_longitudinal(request, progress);
    return tables;
}

}  // namespace medulla::tables
