#include "tables/pack/compress.hpp"
#include "tables/store/json_text.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>
#include <tuple>
#include <utility>

#include "tables/error.hpp"
#include "tables/pack/rounding.hpp"

namespace medulla::tables {
namespace {

constexpr int rank_step = static_cast<int>(rank_multiple), greatest_rank = static_cast<int>(max_rank);
/// Average bits per number: where rounding balances truncated components (an estimate before any solve), and where more
/// components would gain less than more bits.
constexpr double usual_bits = 9, ample_bits = 12.5;
/// Rank of the energies: at more, only rounding is left. The slab's have three short axes, the disc's with absorption
/// four. A small pack spends at most a 17th of its bytes on them.
int energy_rank(const Part& part, const CompressOptions& options) {
    const int most = part.kind == TableKind::survival ? 48 : 32;
    if (!options.max_bytes) return most;
    const double room = static_cast<double>(*options.max_bytes) / 17 / part.component_bytes(usual_bits);
    return std::clamp(static_cast<int>(room / rank_step) * rank_step, rank_step, most);
}
/// Rank of the pilot solves, which measure how hard each part is.
constexpr int pilot_rank = 32;
/// Bytes reserved for the provenance text while components are distributed; bits get what it does not use.
constexpr std::size_t text_room = 800;
/// Errors fall about as rank^-2 in bench/bench_compress (docs/accuracy.md); only the distribution of components uses
/// it.
constexpr double decay = 2;

/// Relative L2 standard error of all lobes of one kind together.
double table_noise(const Table& table, TableKind kind) {
    const std::size_t sides = table.sides();
    double noise = 0, total = 0;
    for (std::size_t cell = side_of(kind); cell < table.cells(); cell += sides) {
        double norm = 0;
        for (std::size_t b = 0; b < table.bins(); ++b)
            norm += static_cast<double>(table.lobe_of(cell)[b]) * static_cast<double>(table.lobe_of(cell)[b]);
        noise += norm * table.standard_error[cell] * table.standard_error[cell];
        total += norm;
    }
    return std::sqrt(noise / total);
}

/// A part, its rank and the solve at that rank.
struct Solve {
    const Part* part;
    int rank = 0;
    tensor::CpResult result = {};
    double error = 0;  ///< relative L2 of the kind, without the exit spline's part

    /// Error expected at another rank.
    double expected(double other) const { return error * std::pow(other / rank, -decay); }
};
using Solves = std::vector<Solve>;

PackedTable pack_kind(const Solves& solves, std::size_t first, std::size_t last, std::pair<float, float> range);

/// Relative L2 error of one kind's lobes as evaluated from a pack: normalised and clamped to 0.
double error_in_pack(const Solve& solve, const Source& tables) {
    std::vector<unsigned char> pack = write_pack({pack_kind({solve}, 0, 1, {0, 0})}, "{}");
    return compare(tables, *pack_source(std::move(pack), "the new pack")).at(0).relative;
}

/// Decomposes every part that has a rank but no model of that rank. Parts are independent, so the result does not
/// depend on the number of threads. Non-negative factors are fitted to whole lobes without their integral, which the
/// pack normalises: their error is that of the pack.
void run(Solves& solves, const CompressOptions& options, bool pilot, const Source* tables) {
    std::vector<char> renewed(solves.size(), 0);
    // Dynamic scheduling takes them in order; the last kinds are the longest.
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t i = solves.size(); i > 0; --i) {
        Solve& solve = solves[i - 1];
        if (solve.rank < 1 || solve.result.model.rank() == solve.rank) continue;
        tensor::CpOptions settings;
        settings.rank = solve.rank;
        settings.seed = options.seed;
        if (pilot)
            settings.restarts = 1;
        else
            settings.max_sweeps = options.max_sweeps;
        // Energies are fast to solve, and nothing else corrects their errors.
        if (!solve.part->lobes()) settings.max_sweeps = std::max(400, options.max_sweeps.value_or(0));
        // Energies are no densities: their factors need not be non-negative.
        const bool signed_factors = !solve.part->lobes() && options.solver == tensor::Solver::nonnegative;
        solve.result = tensor::cp(solve.part->values, signed_factors ? tensor::Solver::lm : options.solver, settings);
        solve.error = solve.part->share * solve.result.report.relative_error;
        renewed[i - 1] = solve.part->lobes();
    }
    for (std::size_t i = 0; i < solves.size() && tables != nullptr; ++i) {
        if (!renewed[i]) continue;
        const double whole = error_in_pack(solves[i], *tables), spline = solves[i].part->exit_error;
        solves[i].error = std::sqrt(std::max(0.0, whole * whole - spline * spline));
    }
}

int padded(int rank) { return static_cast<int>(padded_rank(static_cast<std::uint32_t>(rank))); }

/// Number of stored components of a kind.
int stored_rank(const Solves& solves, TableKind kind) {
    int sum = 0;
    for (const Solve& solve : solves)
        if (solve.part->kind == kind) sum += padded(solve.rank) * solve.part->copies();
    return sum;
}

/// Range [first, last) of each kind's solves, which are adjacent.
std::vector<std::pair<std::size_t, std::size_t>> kinds_of(const Solves& solves) {
    std::vector<std::pair<std::size_t, std::size_t>> ranges;
    for (std::size_t i = 0; i < solves.size(); ++i) {
        if (i == 0 || solves[i].part->kind != solves[i - 1].part->kind) ranges.emplace_back(i, i);
        ranges.back().second = i + 1;
    }
    return ranges;
}

/// Real-valued rank that minimises the sum of squared errors at 1 / lambda per byte: with errors falling as
/// rank^-decay, rank^(2 decay + 1) is proportional to error^2 / (bytes of a component).
double share_of(const Solve& solve, double lambda) {
    const double unit = solve.error * std::pow(solve.rank, decay);
    return std::pow(lambda * unit * unit / solve.part->component_bytes(usual_bits), 1 / (2 * decay + 1));
}

/// Largest lambda with fits(lambda), by bisection of its logarithm; `fits` is monotone and true for small values.
template <class Fits>
double greatest(Fits fits) {
    double low = -60, high = 120;
    for (int i = 0; i < 60; ++i) {
        const double middle = (low + high) / 2;
        (fits(std::exp(middle)) ? low : high) = middle;
    }
    return std::exp(low);
}

PackedTable pack_kind(const Solves& solves, std::size_t first, std::size_t last, std::pair<float, float> range) {
    std::vector<const Part*> parts;
    std::vector<const tensor::CpModel*> models;
    for (std::size_t i = first; i < last; ++i)
        if (solves[i].rank > 0) parts.push_back(solves[i].part), models.push_back(&solves[i].result.model);
    return join(parts, models, range);
}

/// Bytes of a pack with these ranks and `bits` per number on average.
std::size_t pack_bytes(const Solves& solves, double bits) {
    std::vector<PackedTable> tables;
    double more = 0;  // than 8 bits
    for (const auto& [first, last] : kinds_of(solves)) {
        const Part& part = *solves[first].part;
        int rank = 0;
        for (std::size_t i = first; i < last; ++i) rank += solves[i].rank * part.copies();
        PackedTable table{part.kind, part.axes, Eigen::VectorXd::Zero(rank), solves[first].rank, 0, 0};
        for (PackedAxis& axis : table.axes) axis.coefficients = Eigen::MatrixXd::Zero(axis.spline.size(), rank);
        table.bits.assign(table.stride() / rank_multiple, 8);
        more += (bits / 8 - 1) * static_cast<double>(table.rows() * table.stride());
        tables.push_back(std::move(table));
    }
    return write_pack(tables, std::string(text_room, ' ')).size() + static_cast<std::size_t>(more);
}

void share_bytes(Solves& solves, std::size_t bytes, double bits) {
    const Solves pilot = solves;
    const auto set = [&](double lambda) {
        for (std::size_t i = 0; i < solves.size(); ++i) {
            if (!solves[i].part->lobes()) continue;
            const double share = share_of(pilot[i], lambda) / rank_step;
            solves[i].rank = rank_step * std::clamp(static_cast<int>(share), 1, greatest_rank / 2 / rank_step);
        }
    };
    const auto fits = [&](double lambda) {
        set(lambda);
        return pack_bytes(solves, bits) <= bytes;
    };
    if (!fits(0)) return;  // the smallest ranks; compress() reports whether their pack is too large
    set(greatest(fits));
    // Bytes left over by rounding down go where they help most.
    for (;;) {
        std::size_t best = solves.size();
        double most = 0;
        for (std::size_t i = 0; i < solves.size(); ++i) {
            const int step = rank_step * solves[i].part->copies();
            if (!solves[i].part->lobes() || stored_rank(solves, solves[i].part->kind) + step > greatest_rank) continue;
            const double now = pilot[i].expected(solves[i].rank), then = pilot[i].expected(solves[i].rank + rank_step);
            const double gain = (now * now - then * then) / solves[i].part->component_bytes(usual_bits);
            if (gain <= most) continue;
            solves[i].rank += rank_step;
            if (pack_bytes(solves, bits) <= bytes) best = i, most = gain;
            solves[i].rank -= rank_step;
        }
        if (best == solves.size()) return;
        solves[best].rank += rank_step;
    }
}

/// Solves of high rank take seconds, and a hundred steps do not reach their optimum.
bool too_large(const Solves& solves, const CompressOptions& options) {
    return !options.max_sweeps &&
           std::any_of(solves.begin(), solves.end(), [](const Solve& solve) { return solve.rank > 96; });
}

/// Distributes bytes by the pilots' errors; where ranks would be too large, bytes are spent on bits instead.
void share_first(Solves& solves, const CompressOptions& options) {
    const Solves pilots = solves;
    share_bytes(solves, *options.max_bytes, usual_bits);
    if (too_large(solves, options)) share_bytes(solves = pilots, *options.max_bytes, ample_bits);
}

/// Exit splines far finer than a kind's expected error waste bytes: takes the coarsest of a few splines whose error is
/// at most a third of it. The pilot's error of a part is used for its coarser one as well.
/// @param shared ranks after the distribution of bytes   @param pilots those of changed parts lose their models
/// @return whether any part changed
bool coarsen_exits(const Tables& tables, const ExitSpans& spans, std::vector<Part>& parts, const Solves& shared,
                   Solves& pilots) {
    bool changed = false;
    for (const auto& [first, last] : kinds_of(pilots)) {
        const TableKind kind = parts[first].kind;
        if (!is_lobe(kind)) continue;
        double expected = 0;
        for (std::size_t i = first; i < last; ++i) expected = std::hypot(expected, pilots[i].expected(shared[i].rank));
        const auto too_coarse = [expected](auto from, auto to) {
            double exit = 0;
            for (; from != to; ++from) exit = std::hypot(exit, from->exit_error);
            return exit > expected / 3;
        };
        if (too_coarse(&parts[first], &parts[first] + (last - first))) continue;
        for (std::size_t eighths = 7; eighths >= 4; --eighths) {
            std::vector<Part> coarse = lobe_parts_of(tables, kind, spans[kind] * eighths / 8);
            if (too_coarse(coarse.begin(), coarse.end()) || coarse.size() != last - first) break;
            std::move(coarse.begin(), coarse.end(), parts.begin() + static_cast<std::ptrdiff_t>(first));
            for (std::size_t i = first; i < last; ++i) pilots[i].result = {};
            changed = true;
        }
    }
    return changed;
}

double kind_error(const Solves& solves, std::size_t first, std::size_t last) {
    double sum = 0;
    for (std::size_t i = first; i < last; ++i)
        sum += solves[i].error * solves[i].error + solves[i].part->exit_error * solves[i].part->exit_error;
    return std::sqrt(sum);
}

/// The solves as tables of a pack, with the bits that the options require; with max_bytes, lobes get the bytes left.
std::vector<PackedTable> pack_tables(const Solves& solves, const CompressOptions& options, std::size_t text_bytes) {
    std::vector<PackedTable> tables;
    for (const auto& [first, last] : kinds_of(solves)) tables.push_back(pack_kind(solves, first, last, {0, 0}));
    std::vector<PackedTable*> lobes;
    for (std::size_t i = 0; i < tables.size(); ++i) {
        const auto [first, last] = kinds_of(solves)[i];
        const double error = std::pow(kind_error(solves, first, last), 2);
        if (!is_lobe(tables[i].kind) || (!options.max_error && !options.max_bytes))
            set_bits({&tables[i]}, error / 16);  // adds 3 %
        else if (options.max_error)
            set_bits({&tables[i]}, std::pow(*options.max_error, 2) - error);
        else
            lobes.push_back(&tables[i]), set_bits({&tables[i]}, INFINITY);
    }
    if (!options.max_bytes) return tables;
    const std::size_t least = write_pack(tables, std::string(text_bytes, ' ')).size();
    if (least < *options.max_bytes) set_bits(lobes, 0, *options.max_bytes - least);
    return tables;
}

/// Squared errors of a pack's lobes.
struct Balance {
    double components = 0, rounding = 0;  ///< from truncated components and from rounding
    double bits = 0;                      ///< per number on average
};
Balance balance_of(const Solves& solves, const CompressOptions& options) {
    const std::vector<PackedTable> tables = pack_tables(solves, options, text_room);
    Balance sum;
    std::vector<const PackedTable*> lobes;
    for (std::size_t i = 0; i < tables.size(); ++i) {
        if (!is_lobe(tables[i].kind)) continue;
        const auto [first, last] = kinds_of(solves)[i];
        sum.components += std::pow(kind_error(solves, first, last), 2);
        sum.rounding += rounding_error(tables[i]);
        lobes.push_back(&tables[i]);
    }
    sum.bits = mean_bits(lobes);
    return sum;
}

/// Distributes again with the errors of the solves in place of the pilots', as long as that lowers the total error.
void share_again(Solves& solves, const CompressOptions& options, const Source* tables) {
    Balance now = balance_of(solves, options);
    for (int tries = 0; tries < 4 && !too_large(solves, options); ++tries) {
        Solves next = solves;
        const double excess = now.rounding / (balanced_rounding * now.components);
        share_bytes(next, *options.max_bytes, now.bits + 0.5 * std::log2(excess));
        run(next, options, false, tables);
        const Balance then = balance_of(next, options);
        if (!(then.components + then.rounding < now.components + now.rounding)) return;
        solves = std::move(next), now = then;
    }
}

/// Smallest ranks, in steps of the format, with at most `error`: predicted from the last solve, solved, and predicted
/// again until the prediction is confirmed.
void solve_to(Solves& solves, double error, const CompressOptions& options, const Source* tables) {
    for (const auto& [first, last] : kinds_of(solves)) {
        if (!solves[first].part->lobes()) {
            solves[first].rank = energy_rank(*solves[first].part, options);
            continue;
        }
        double spline = 0;
        for (std::size_t i = first; i < last; ++i) spline += solves[i].part->exit_error * solves[i].part->exit_error;
        const double room = error * error - spline;
        if (!(room > 0))
            throw Error("--max-error: the exit splines of the {} leave {:.2e}, expected {:.2e}",
                        name_of(solves[first].part->kind), std::sqrt(spline), error);
        Solves best;
        // Counts stored components: whole non-negative lobes store two per component.
        const int copies = solves[first].part->copies(), step = rank_step * copies;
        int least = 2 * greatest_rank, floor = 0;
        for (int tries = 0; tries < 8; ++tries) {
            Solves next(solves.begin() + static_cast<std::ptrdiff_t>(first),
                        solves.begin() + static_cast<std::ptrdiff_t>(last));
            const auto too_coarse = [&](double lambda) {
                double sum = 0;
                for (const Solve& solve : next) {
                    const double e = solve.expected(std::max(1.0, share_of(solve, lambda)));
                    sum += e * e;
                }
                return sum > room;
            };
            const double lambda = greatest(too_coarse);
            int total = 0;
            for (Solve& solve : next) {
                solve.rank = rank_step * static_cast<int>(std::ceil(share_of(solve, lambda) / rank_step));
                const int others = rank_step * static_cast<int>(next.size() - 1);
                solve.rank = std::clamp(solve.rank, rank_step, greatest_rank / copies - others);
                total += solve.rank * copies;
            }
            // Between a total that was too small and one that sufficed nothing is left to try.
            if (total >= least || total > greatest_rank) total = std::min(least - step, greatest_rank);
            // Every part needs at least one block of components.
            if (total <= floor || total < step * static_cast<int>(next.size())) break;
            while (stored_rank(next, next[0].part->kind) > total)
                std::max_element(next.begin(), next.end(), [](const Solve& a, const Solve& b) {
                    return a.rank < b.rank;
                })->rank -= rank_step;
            run(next, options, false, tables);
            std::copy(next.begin(), next.end(), solves.begin() + static_cast<std::ptrdiff_t>(first));
            if (kind_error(solves, first, last) <= error) {
                least = total, best = next;
                if (least - step <= floor) break;
            } else {
                floor = total;
                if (total >= greatest_rank) break;
            }
        }
        if (best.empty())
            throw Error("--max-error: {} components of the {} leave {:.2e}, expected {:.2e}", floor,
                        name_of(solves[first].part->kind), kind_error(solves, first, last), error);
        std::copy(best.begin(), best.end(), solves.begin() + static_cast<std::ptrdiff_t>(first));
    }
}

std::string provenance(const Tables& tables, const CompressOptions& options, const std::string& input,
                       const std::vector<TableReport>& reports) {
    nlohmann::ordered_json json;
    json["program"] = tables.program;
    json["input"] = input;
    json["seed"] = options.seed;
    for (const Table* table : tables.present()) {
        nlohmann::ordered_json& out = json["tables"][table->name()];
        out = {{"method", table->method}, {"seed", table->seed}, {"paths", table->paths}};
        if (table->target_error > 0) out["target_error"] = table->target_error;
        if (table->time_budget > 0) out["time_budget"] = table->time_budget;
    }
    for (const TableReport& report : reports) {
        nlohmann::ordered_json& fit = json["fit"][name_of(report.kind)];
        for (const PartReport& part : report.parts) fit["ranks"].push_back(part.rank);
        fit["solver"] = report.parts[0].solve.solver;
        fit["relative_l2"] = report.fit_error;
        fit["input_noise"] = report.noise;
    }
    return json_line(json);
}

std::pair<float, float> range_of(const Part& part, const Tables& tables) {
    std::vector<double> values = part.values.values;
    if (part.lobes()) values = side_lobes(tables.at(table_of(part.kind)), side_of(part.kind));
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    return {static_cast<float>(*low), static_cast<float>(*high)};
}

TableReport report_of(const Solves& solves, std::size_t first, std::size_t last, const Tables& tables) {
    TableReport report;
    report.kind = solves[first].part->kind;
    report.fit_error = kind_error(solves, first, last);
    double spline = 0;
    for (std::size_t i = first; i < last; ++i) {
        report.parts.push_back(
            {solves[i].part->mirror, solves[i].result.report, solves[i].rank, solves[i].part->share});
        spline += solves[i].part->exit_error * solves[i].part->exit_error;
    }
    report.exit_error = std::sqrt(spline);
    if (solves[first].part->lobes()) report.noise = table_noise(tables.at(table_of(report.kind)), report.kind);
    return report;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

CompressResult compress(const Tables& tables, const CompressOptions& options, const std::string& input) {
    const auto start = std::chrono::steady_clock::now();
    const std::clock_t cpu_start = std::clock();
    std::vector<Part> parts =
        (options.solver == tensor::Solver::nonnegative ? whole_lobes_of : parts_of)(tables, options.spans);
    Solves solves;
    const bool searched = options.max_error || options.max_bytes;
    const int rank = searched ? pilot_rank : options.rank;
    for (const Part& part : parts) solves.push_back({&part, part.lobes() ? rank : energy_rank(part, options)});
    std::unique_ptr<Source> source;
    if (options.solver == tensor::Solver::nonnegative) source = table_source(tables);
    if (searched) run(solves, options, true, source.get());
    // Leaves room for the rounding error.
    if (options.max_error)
        solve_to(solves, *options.max_error / std::sqrt(1 + balanced_rounding), options, source.get());
    if (options.max_bytes) {
        const Solves pilots = solves;
        share_first(solves, options);
        if (options.solver != tensor::Solver::nonnegative) {
            const Solves shared = std::exchange(solves, pilots);
            if (coarsen_exits(tables, options.spans, parts, shared, solves))
                share_first(solves, options);
            else
                solves = shared;
        }
    }
    run(solves, options, false, source.get());
    if (options.max_bytes) share_again(solves, options, source.get());
    CompressResult result;
    for (const auto& [first, last] : kinds_of(solves)) result.tables.push_back(report_of(solves, first, last, tables));
    const std::string text = provenance(tables, options, input, result.tables);
    std::vector<PackedTable> packed = pack_tables(solves, options, text.size());
    for (std::size_t i = 0; i < packed.size(); ++i) {
        std::tie(packed[i].low, packed[i].high) = range_of(*solves[kinds_of(solves)[i].first].part, tables);
        result.tables[i].rounding = std::sqrt(rounding_error(packed[i]));
    }
    result.pack = write_pack(packed, text);
    if (options.max_bytes && result.pack.size() > *options.max_bytes)
        throw Error("--max-bytes: expected at least {} for these tables, found {}", result.pack.size(),
                    *options.max_bytes);
    result.solve_seconds = seconds_since(start);
    result.cpu_seconds = static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC;
    result.degeneracy = degeneracy_of(open_pack(result.pack.data(), result.pack.size()).pack);
    if (!source) source = table_source(tables);
    result.errors = compare(*source, *pack_source(result.pack, "the new pack"));
    result.seconds = seconds_since(start);
    return result;
}

}  // namespace medulla::tables
