#include "tables/simulate.hpp"

#include <omp.h>

#include <cmath>
#include <cstring>
#include <exception>
#include <mutex>
#include <optional>

#include "sim2d/analog.hpp"
#include "sim2d/disc_deterministic.hpp"
#include "sim2d/slab_deterministic.hpp"
#include "tables/error.hpp"
#include "tables/schedule.hpp"

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
void store(Slice& slice, std::size_t cell, const sim2d::Profile& profile) {
    if (profile.lobe.size() != slice.bins) throw Error("cell {}: the solver returned no lobe", cell);
    for (std::size_t b = 0; b < slice.bins; ++b)
        slice.lobe[cell * slice.bins + b] = static_cast<float>(profile.lobe[b]);
    slice.energy[cell] = profile.energy;
    slice.energy_error[cell] = profile.energy_error;
    slice.standard_error[cell] = profile.standard_error;
    slice.mean_length[cell] = profile.mean_length;
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

bool solves(const Request& request) {
    return request.method == Method::automatic || request.method == Method::deterministic;
}

/// What depends on g alone: made once, by the first slice that needs it, and shared by every sigma.
template <class Solver>
class SolversByG {
  public:
    explicit SolversByG(const std::vector<double>& g) : g_(g), made_(g.size()), solvers_(g.size()) {}

    const Solver& at(std::size_t i) {
        std::call_once(made_[i], [&] { solvers_[i].emplace(g_[i]); });
        return *solvers_[i];
    }

  private:
    const std::vector<double>& g_;
    std::vector<std::once_flag> made_;
    std::vector<std::optional<Solver>> solvers_;
};

/// Program, version and compiler: another compiler may round otherwise.
std::string program_text() { return "medulla " MEDULLA_VERSION " (" MEDULLA_COMPILER ")"; }

void begin(Table& table, const Request& request) {
    table.method = name_of(request.method);
    table.seed = request.seed, table.paths = request.paths;
    if (request.method == Method::deterministic) table.seed = table.paths = 0;
}

}  // namespace

Tables plan_of(const Request& request) {
    check_request(request);
    Tables plan;
    plan.program = program_text();
    if (request.azimuthal) {
        plan.azimuthal.emplace();
        plan.azimuthal->name = "azimuthal";
        plan.azimuthal->axes = {request.sigma, request.g, request.h, exit_axis("phi", request.bins)};
        if (request.absorption.size() > 0)
            plan.azimuthal->axes.insert(plan.azimuthal->axes.begin() + 2, request.absorption);
        begin(*plan.azimuthal, request);
    }
    if (request.longitudinal) {
        plan.longitudinal.emplace();
        plan.longitudinal->name = "longitudinal";
        plan.longitudinal->axes = {
            request.sigma, request.g, request.theta_i, {"side", {0, 1}}, exit_axis("theta_r", request.bins / 2)};
        begin(*plan.longitudinal, request);
    }
    return plan;
}

struct SliceSolver::State {
    explicit State(const Request& wanted)
        : request(wanted), plan(plan_of(request)), discs(request.g.values), slabs(request.g.values) {}

    const Request request;
    const Tables plan;
    mutable SolversByG<sim2d::DiscSolver> discs;
    mutable SolversByG<sim2d::SlabSolver> slabs;

    Slice azimuthal(double sigma, std::size_t ig) const {
        const std::vector<double>& offsets = request.h.values;
        const double g = request.g.values[ig];
        // Without an axis of absorption: none. Cells are [absorption][h].
        const std::vector<double> absorption =
            request.absorption.size() > 0 ? request.absorption.values : std::vector<double>{0.0};
        const std::size_t count = offsets.size();
        Slice slice(absorption.size() * count, request.bins);
        std::vector<sim2d::Profile> solved;
        for (std::size_t j = 0; solves(request) && j < absorption.size(); ++j)
            for (sim2d::Profile& profile : discs.at(ig).solve(sigma, absorption[j], offsets, request.bins))
                solved.push_back(std::move(profile));
        solved.resize(slice.cells);
        for (std::size_t i = 0; i < count; ++i) {
            const double h = offsets[i];
            bool wanted = false;
            for (std::size_t j = 0; j < absorption.size(); ++j)
                wanted = wanted || wants_paths(request, solved[j * count + i]);
            if (!wanted) continue;
            std::vector<sim2d::Profile> traced = sim2d::trace_disc(sigma, g, h, absorption, request.bins,
                                                                   trace_options(request, cell_key(0, {sigma, g, h})));
            for (std::size_t j = 0; j < absorption.size(); ++j) {
                sim2d::Profile& profile = solved[j * count + i];
                if (!wants_paths(request, profile)) continue;
                if (!solves(request) || traced[j].standard_error < profile.standard_error)
                    profile = std::move(traced[j]);
            }
        }
        for (std::size_t cell = 0; cell < slice.cells; ++cell) store(slice, cell, solved[cell]);
        return slice;
    }

    Slice longitudinal(double sigma, std::size_t ig) const {
        const std::vector<double>& angles = request.theta_i.values;
        const double g = request.g.values[ig];
        Slice slice(2 * angles.size(), request.bins / 2);
        std::vector<sim2d::SlabProfile> solved(angles.size());
        if (solves(request)) solved = slabs.at(ig).solve(sigma, angles, slice.bins);
        for (std::size_t i = 0; i < angles.size(); ++i) {
            const double theta_i = angles[i];
            if (wants_paths(request, solved[i].back) || wants_paths(request, solved[i].forward)) {
                sim2d::SlabProfile traced = sim2d::trace_slab(sigma, g, theta_i, slice.bins,
                                                              trace_options(request, cell_key(1, {sigma, g, theta_i})));
                if (!solves(request) || worst_error(traced) < worst_error(solved[i])) solved[i] = std::move(traced);
            }
            store(slice, 2 * i, solved[i].back);
            store(slice, 2 * i + 1, solved[i].forward);
        }
        return slice;
    }
};

SliceSolver::SliceSolver(const Request& request) : state_(std::make_unique<State>(request)) {}
SliceSolver::~SliceSolver() = default;

const Tables& SliceSolver::plan() const { return state_->plan; }

Slice SliceSolver::solve(const SliceId& id) const {
    const double sigma = state_->request.sigma.values.at(id.sigma);
    return id.table == TableName::azimuthal ? state_->azimuthal(sigma, id.g) : state_->longitudinal(sigma, id.g);
}

void in_parallel(std::size_t count, int threads, const std::atomic<bool>& stop,
                 const std::function<void(std::size_t)>& job) {
    std::exception_ptr error;
    std::atomic<bool> failed{false};
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads > 0 ? threads : omp_get_max_threads())
    for (std::size_t i = 0; i < count; ++i) {
        if (failed || stop) continue;
        try {
            job(i);
        } catch (...) {
#pragma omp critical
            if (!failed.exchange(true)) error = std::current_exception();
        }
    }
    if (error) std::rethrow_exception(error);
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
