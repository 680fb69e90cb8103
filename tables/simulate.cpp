#include "tables/simulate.hpp"

#include <omp.h>

#include <atomic>
#include <cstring>
#include <exception>
#include <functional>
#include <optional>

#include "sim2d/analog.hpp"
#include "sim2d/disc_deterministic.hpp"
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

/// Relative L2 error that counting `paths` exits would leave on a lobe: sum p (1 - p) / (n sum p^2), p the bins'
/// shares.
double tracer_error(const sim2d::Profile& profile, std::uint64_t paths) {
    double sum = 0, squares = 0;
    for (const double value : profile.lobe) sum += value, squares += value * value;
    return std::sqrt((sum * sum / squares - 1) / static_cast<double>(paths));
}

/// Whether a cell is (also) traced: always by the random methods; by `auto` where counting paths would beat the
/// noise-free solver's own estimate.
bool wants_paths(const Request& request, const sim2d::Profile& solved) {
    if (request.method != Method::automatic) return request.method != Method::deterministic;
    return solved.standard_error > tracer_error(solved, request.paths);
}

double worst_error(const sim2d::SlabProfile& p) { return std::max(p.back.standard_error, p.forward.standard_error); }

/// What depends on g alone is worked out once and shared by every sigma; empty for the random methods.
template <class Solver>
std::vector<std::optional<Solver>> solvers_of(const Request& request) {
    std::vector<std::optional<Solver>> solvers(request.g.size());
    if (request.method == Method::automatic || request.method == Method::deterministic)
        parallel(solvers.size(), request.threads, [&](std::size_t i) { solvers[i].emplace(request.g.values[i]); });
    return solvers;
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
    const std::vector<double>& g = request.g.values;
    const std::size_t offsets = request.h.size(), slices = table.cells() / offsets;
    Progress progress(mode, "azimuthal", table.cells());
    const auto solvers = solvers_of<sim2d::DiscSolver>(request);
    parallel(slices, request.threads, [&](std::size_t slice) {
        // The costly end first: great sigma.
        slice = slices - 1 - slice;
        const double sigma = request.sigma.values[slice / g.size()];
        const std::size_t ig = slice % g.size();
        std::vector<sim2d::Profile> solved(offsets);
        if (solvers[ig]) solved = solvers[ig]->solve(sigma, request.h.values, request.bins);
        for (std::size_t i = 0; i < offsets; ++i) {
            const double h = request.h.values[i];
            if (wants_paths(request, solved[i])) {
                sim2d::Profile traced = sim2d::trace_disc(sigma, g[ig], h, request.bins,
                                                          trace_options(request, cell_key(0, {sigma, g[ig], h})));
                if (!solvers[ig] || traced.standard_error < solved[i].standard_error) solved[i] = std::move(traced);
            }
            store(table, slice * offsets + i, solved[i]);
        }
        progress.add(offsets);
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
    const auto solvers = solvers_of<sim2d::SlabSolver>(request);
    parallel(slices, request.threads, [&](std::size_t slice) {
        const double sigma = request.sigma.values[slice / g.size()];
        const std::size_t ig = slice % g.size();
        std::vector<sim2d::SlabProfile> solved(angles);
        if (solvers[ig]) solved = solvers[ig]->solve(sigma, request.theta_i.values, table.bins());
        for (std::size_t i = 0; i < angles; ++i) {
            const double theta_i = request.theta_i.values[i];
            if (wants_paths(request, solved[i].back) || wants_paths(request, solved[i].forward)) {
                sim2d::SlabProfile traced = sim2d::trace_slab(
                    sigma, g[ig], theta_i, table.bins(), trace_options(request, cell_key(1, {sigma, g[ig], theta_i})));
                if (!solvers[ig] || worst_error(traced) < worst_error(solved[i])) solved[i] = std::move(traced);
            }
            const std::size_t cell = 2 * (slice * angles + i);
            store(table, cell, solved[i].back);
            store(table, cell + 1, solved[i].forward);
        }
        progress.add(2 * angles);
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
