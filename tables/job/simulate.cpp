#include "tables/job/simulate.hpp"

#include <cmath>
#include <cstring>
#include <mutex>
#include <optional>

#include "sim2d/disc/deterministic.hpp"
#include "sim2d/reference/analog.hpp"
#include "sim2d/slab/deterministic.hpp"
#include "sim2d/tracer/tracer.hpp"
#include "tables/error.hpp"
#include "tables/job/cost.hpp"
#include "tables/parallel.hpp"

namespace medulla::tables {
namespace {

/// Key of a cell's random numbers. It depends on the cell's parameters, not on its position in a table, so that the
/// same cell in another table, or in a part of one, gets the same paths.
std::uint64_t cell_key(std::uint64_t kind, std::initializer_list<double> parameters) {
    const auto mix = [](std::uint64_t z) {  // splitmix64's finaliser
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    };
    std::uint64_t key = mix(kind + 0x9e3779b97f4a7c15u);
    for (const double x : parameters) {
        const double same = x + 0.0;  // -0 becomes 0
        std::uint64_t bits;
        std::memcpy(&bits, &same, sizeof bits);
        key = mix(key ^ bits) + 0x9e3779b97f4a7c15u;
    }
    return key;
}

/// Stores a solved cell, its lobe as floats.
void store(Slice& slice, std::size_t cell, const sim2d::Profile& profile) {
    if (profile.lobe.size() != slice.bins) throw Error("cell {}: the solver returned no lobe", cell);
    if (!(profile.standard_error >= 0)) throw Error("cell {}: the solver gave no error", cell);
    for (std::size_t b = 0; b < slice.bins; ++b)
        slice.lobe[cell * slice.bins + b] = static_cast<float>(profile.lobe[b]);
    slice.energy[cell] = profile.energy;
    slice.energy_error[cell] = profile.energy_error;
    slice.standard_error[cell] = profile.standard_error;
    slice.mean_length[cell] = profile.mean_length;
}

/// Stopping rule of a cell.
struct Goal {
    double target_error;  ///< relative L2 of a lobe; 0: after `paths`
    std::uint64_t paths;  ///< of the random methods; with a target: at most
};

Goal goal_of(const Request& request, double target_error) {
    return {target_error, target_error > 0 ? std::uint64_t{1} << 35 : request.paths};
}

double worst_error(const sim2d::Profile& p) { return p.standard_error; }
double worst_error(const sim2d::SlabProfile& p) { return std::max(p.back.standard_error, p.forward.standard_error); }
/// One offset of the disc, for every absorption.
double worst_error(const std::vector<sim2d::Profile>& cells) {
    double e = 0;
    for (const sim2d::Profile& p : cells) e = std::max(e, worst_error(p));
    return e;
}

/// Runs the analog tracer, starting again with the number of paths that counting statistics predict, until the error is
/// at most the target.
template <class Trace>
auto count_until(const Goal& goal, Trace&& trace) {
    for (std::uint64_t paths = goal.target_error > 0 ? 4096 : goal.paths;;) {
        auto counted = trace(paths);
        if (goal.target_error == 0 || paths >= goal.paths) return counted;
        const double ratio = worst_error(counted) / goal.target_error;
        if (ratio <= 1) return counted;
        // An error estimate from few counts is rough: at most 64 times as many at once.
        const double wanted = std::clamp(1.05 * ratio * ratio, 2.0, 64.0) * static_cast<double>(paths);
        paths = static_cast<std::uint64_t>(
            std::min(static_cast<double>(goal.paths), wanted));  // if wanted is NaN, goal.paths
    }
}

/// Relative L2 error of a lobe from counting `paths` exits: sum p (1 - p) / (n sum p^2), p the bins'
/// shares.
double counting_error(const sim2d::Profile& profile, std::uint64_t paths) {
    double sum = 0, squares = 0;
    for (const double value : profile.lobe) sum += value, squares += value * value;
    return std::sqrt((sum * sum / squares - 1) / static_cast<double>(paths));
}

/// `auto` traces a cell whose noise-free error estimate exceeds this.
double error_of_paths(const sim2d::Profile& p, const Goal& goal) {
    return goal.target_error > 0 ? goal.target_error : counting_error(p, goal.paths);
}
double error_of_paths(const sim2d::SlabProfile& p, const Goal& goal) {
    return std::min(error_of_paths(p.back, goal), error_of_paths(p.forward, goal));
}
double error_of_paths(const std::vector<sim2d::Profile>& cells, const Goal& goal) {
    double e = error_of_paths(cells.front(), goal);
    for (const sim2d::Profile& p : cells) e = std::min(e, error_of_paths(p, goal));
    return e;
}

/// Solves the cells of a slice: `exact(aim)` gives all cells without noise, `trace(i, goal)` one cell by the fast
/// random solver, `count(i, paths)` one cell by the analog tracer.
template <class Exact, class Trace, class Count>
auto solve_cells(const Request& request, bool grids_reach, double target_error, std::size_t count_of_cells,
                 Exact&& exact, Trace&& trace, Count&& count) {
    using Profiles = decltype(exact(0.0));
    const Goal goal = goal_of(request, target_error);
    Profiles solved;
    if (request.method == Method::analog) {
        for (std::size_t i = 0; i < count_of_cells; ++i)
            solved.push_back(count_until(goal, [&](std::uint64_t paths) { return count(i, paths); }));
        return solved;
    }
    if (request.method == Method::mc || (request.method == Method::automatic && !grids_reach)) {
        for (std::size_t i = 0; i < count_of_cells; ++i) solved.push_back(trace(i, goal).profile);
        return solved;
    }
    const auto worst = [](const Profiles& cells) {
        double e = 0;
        for (const auto& p : cells) e = std::max(e, worst_error(p));
        return e;
    };
    double aim = target_error > 0 ? target_error : sim2d::DiscOptions{}.target_error;
    solved = exact(aim);
    // Grids are chosen for an error; if their error estimate is larger, finer ones are tried.
    for (int again = 0; again < 4 && target_error > 0 && worst(solved) > target_error; ++again) {
        aim = std::max(least_target, aim * std::min(0.7, target_error / worst(solved)));
        Profiles finer = exact(aim);
        if (!(worst(finer) < worst(solved))) break;
        solved = std::move(finer);
    }
    // Tracing has no deadline, so with a time budget the grids' result is final.
    if (request.method == Method::deterministic || request.time_budget > 0) return solved;
    for (std::size_t i = 0; i < count_of_cells; ++i) {
        if (worst_error(solved[i]) <= error_of_paths(solved[i], goal)) continue;
        auto traced = trace(i, goal).profile;
        if (worst_error(traced) < worst_error(solved[i])) solved[i] = std::move(traced);
    }
    return solved;
}

/// The slab's modes of each g: computed by the first slice that needs them and shared by every sigma.
class SlabsByG {
  public:
    explicit SlabsByG(const std::vector<double>& g) : g_(g), made_(g.size()), solvers_(g.size()) {}

    const sim2d::SlabSolver& at(std::size_t i) {
        std::call_once(made_[i], [&] { solvers_[i].emplace(g_[i]); });
        return *solvers_[i];
    }

  private:
    const std::vector<double>& g_;
    std::vector<std::once_flag> made_;
    std::vector<std::optional<sim2d::SlabSolver>> solvers_;
};

/// Program, version and compiler, since another compiler may round differently.
std::string program_text() { return "medulla " MEDULLA_VERSION " (" MEDULLA_COMPILER ")"; }

void begin(Table& table, const Request& request) {
    table.method = name_of(request.method);
    table.seed = request.seed, table.paths = request.paths;
    table.target_error = request.target_error, table.time_budget = request.time_budget;
    if (request.method == Method::deterministic) table.seed = table.paths = 0;
    if (request.target_error > 0 || request.time_budget > 0) table.paths = 0;  // unlimited
}

}  // namespace

Tables plan_of(const Request& request) {
    check_request(request);
    Tables plan;
    plan.program = program_text();
    if (request.azimuthal) {
        plan.azimuthal.emplace();
        plan.azimuthal->id = TableId::azimuthal;
        plan.azimuthal->axes = {request.sigma, request.g, request.h, exit_axis("phi", request.bins)};
        if (request.absorption.size() > 0)
            plan.azimuthal->axes.insert(plan.azimuthal->axes.begin() + 2, request.absorption);
        begin(*plan.azimuthal, request);
    }
    if (request.longitudinal) {
        plan.longitudinal.emplace();
        plan.longitudinal->id = TableId::longitudinal;
        plan.longitudinal->axes = {
            request.sigma, request.g, request.theta_i, {"side", {0, 1}}, exit_axis("theta_r", request.bins / 2)};
        begin(*plan.longitudinal, request);
    }
    return plan;
}

/// The request with 0 in place of -0: a solver that divides by sigma = -0 would fly backwards for ever.
Request without_negative_zeros(Request request) {
    for (Axis* axis : {&request.sigma, &request.g, &request.h, &request.theta_i, &request.absorption})
        for (double& value : axis->values) value += 0.0;
    return request;
}

struct SliceSolver::State {
    explicit State(const Request& wanted)
        : request(without_negative_zeros(wanted)), plan(plan_of(request)), slabs(request.g.values) {}

    const Request request;
    const Tables plan;
    mutable SlabsByG slabs;

    template <class Options>
    Options options(std::uint64_t paths, std::uint64_t cell) const {
        Options options;
        options.paths = paths, options.seed = request.seed, options.cell = cell;
        return options;
    }
    sim2d::TracerOptions options(const Goal& goal, std::uint64_t cell) const {
        auto all = options<sim2d::TracerOptions>(goal.paths, cell);
        all.target_error = goal.target_error;
        return all;
    }

    Slice azimuthal(const SliceId& id, double target_error) const {
        const std::vector<double>& offsets = request.h.values;
        const double sigma = request.sigma.values[id.sigma], g = request.g.values[id.g];
        const std::size_t bins = request.bins;
        // Without an axis of absorption: none.
        const std::vector<double> absorption =
            request.absorption.size() > 0 ? request.absorption.values : std::vector<double>{0.0};
        const auto key = [&](std::size_t i) { return cell_key(0, {sigma, g, offsets[i]}); };
        const std::vector<std::vector<sim2d::Profile>> solved = solve_cells(
            request, sigma <= greatest_grid_sigma, target_error, offsets.size(),
            [&](double aim) {
                sim2d::DiscOptions grids;
                grids.target_error = aim;
                const sim2d::DiscSolver solver(g, grids);
                std::vector<std::vector<sim2d::Profile>> cells(offsets.size());
                for (const double a : absorption) {
                    std::vector<sim2d::Profile> row = solver.solve(sigma, a, offsets, bins);
                    for (std::size_t i = 0; i < offsets.size(); ++i) cells[i].push_back(std::move(row[i]));
                }
                return cells;
            },
            [&](std::size_t i, const Goal& goal) {
                return sim2d::trace_expected_disc(sigma, g, offsets[i], absorption, bins, options(goal, key(i)));
            },
            [&](std::size_t i, std::uint64_t paths) {
                return sim2d::trace_disc(sigma, g, offsets[i], absorption, bins,
                                         options<sim2d::TraceOptions>(paths, key(i)));
            });
        Slice slice(absorption.size() * offsets.size(), bins);  // cells are [absorption][h]
        for (std::size_t j = 0; j < absorption.size(); ++j)
            for (std::size_t i = 0; i < offsets.size(); ++i) store(slice, j * offsets.size() + i, solved[i][j]);
        return slice;
    }

    Slice longitudinal(const SliceId& id, double target_error) const {
        const std::vector<double>& angles = request.theta_i.values;
        const double sigma = request.sigma.values[id.sigma], g = request.g.values[id.g];
        const std::size_t bins = request.bins / 2;
        const auto key = [&](std::size_t i) { return cell_key(1, {sigma, g, angles[i]}); };
        const std::vector<sim2d::SlabProfile> solved = solve_cells(
            request, true, target_error, angles.size(),
            [&](double) { return slabs.at(id.g).solve(sigma, angles, bins); },
            [&](std::size_t i, const Goal& goal) {
                return sim2d::trace_expected_slab(sigma, g, angles[i], bins, options(goal, key(i)));
            },
            [&](std::size_t i, std::uint64_t paths) {
                return sim2d::trace_slab(sigma, g, angles[i], bins, options<sim2d::TraceOptions>(paths, key(i)));
            });
        Slice slice(2 * angles.size(), bins);
        for (std::size_t i = 0; i < angles.size(); ++i) {
            store(slice, 2 * i, solved[i].back);
            store(slice, 2 * i + 1, solved[i].forward);
        }
        return slice;
    }
};

SliceSolver::SliceSolver(const Request& request) : state_(std::make_unique<State>(request)) {}
SliceSolver::~SliceSolver() = default;

const Tables& SliceSolver::plan() const { return state_->plan; }

Slice SliceSolver::solve(const SliceId& id) const { return solve(id, state_->request.target_error); }

Slice SliceSolver::solve(const SliceId& id, double target_error) const {
    return id.table == TableId::azimuthal ? state_->azimuthal(id, target_error)
                                          : state_->longitudinal(id, target_error);
}

Tables simulate(const Request& request, ProgressMode mode) {
    const SliceSolver solver(request);
    Tables tables = solver.plan();
    std::size_t cells = 0;
    for (auto* table : {&tables.azimuthal, &tables.longitudinal})
        if (*table) (*table)->allocate(), cells += (*table)->cells();
    const std::vector<SliceId> slices = by_cost(request, slices_of(tables));
    Progress progress(mode, "simulate", cells);
    const std::atomic<bool> never{false};
    in_parallel(slices.size(), request.threads, never, [&](std::size_t i) {
        const Slice slice = solver.solve(slices[i]);
        put_slice(tables, slices[i], slice);
        progress.add(slice.cells);
    });
    return tables;
}

}  // namespace medulla::tables
