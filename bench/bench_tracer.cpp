// The random solver by itself: scatterings per second, efficiency against the analog tracer over the default axes, and
// z-scores against the deterministic solvers. All on one thread, measured in turn in one process.
// Usage: bench_tracer [--cells N] [--zscores] [--json FILE]; --zscores visits all (sigma, g) of both tables (minutes).
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

#include "sim2d/analog.hpp"
#include "sim2d/disc_deterministic.hpp"
#include "sim2d/random.hpp"
#include "sim2d/slab_deterministic.hpp"
#include "sim2d/tracer.hpp"
#include "sim2d/tracer_kernel.hpp"
#include "tables/request.hpp"

using namespace medulla;
using namespace medulla::sim2d;

namespace {

constexpr std::size_t kBins = 720;

/// Processor time: the machine's other work costs less of it than of the wall's.
double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Seconds of the fastest of `runs` runs: other work on the machine only adds.
template <class Run>
double seconds(int runs, Run&& run) {
    double best = HUGE_VAL;
    for (int i = 0; i < runs; ++i) {
        const double start = now();
        run();
        best = std::min(best, now() - start);
    }
    return best;
}

double relative_l2(const std::vector<double>& a, const std::vector<double>& b) {
    double d = 0, n = 0;
    for (std::size_t i = 0; i < a.size(); ++i) d += (a[i] - b[i]) * (a[i] - b[i]), n += b[i] * b[i];
    return std::sqrt(d / n);
}

double quantile(std::vector<double> v, double q) {
    std::sort(v.begin(), v.end());
    return v[std::min(v.size() - 1, static_cast<std::size_t>(q * static_cast<double>(v.size())))];
}

std::string json;
void write(const char* format, ...) __attribute__((format(printf, 1, 2)));
void write(const char* format, ...) {
    char text[512];
    va_list list;
    va_start(list, format);
    std::vsnprintf(text, sizeof text, format, list);
    va_end(list);
    json += text;
}

/// Walks with payments withheld: scattering, flights, compaction and the choice of who would be paid.
void events_per_second() {
    std::printf("Scatterings per second on one core, %s, walks without payments\n", tracer_target());
    json += "\"events\":[";
    const char* comma = "";
    for (const Medium medium : {Medium::disc, Medium::slab})
        for (const double sigma : {2.0, 16.0, 100.0}) {
            TracerCell cell;
            cell.medium = medium, cell.sigma = sigma, cell.g = 0.9, cell.h = 0.3, cell.theta_i = 0.3;
            cell.plan.forced = 0, cell.plan.pay = 1e30f;
            TracerSums sums;
            WalkTracer tracer(cell);
            std::uint64_t walks = static_cast<std::uint64_t>(4e6 / sigma);
            const double t = seconds(5, [&] {
                sums = {};
                tracer.trace(0, 0, walks, sums);
            });
            const double rate = static_cast<double>(sums.scatterings) / t;
            const char* name = medium == Medium::disc ? "disc" : "slab";
            std::printf("  %s sigma %5.1f: %6.1f million\n", name, sigma, rate * 1e-6);
            write("%s{\"medium\":\"%s\",\"sigma\":%g,\"per_second\":%.4g}", comma, name, sigma, rate), comma = ",";
            std::fflush(stdout);
        }
    json += "]";
}

struct Cell {
    double sigma, g, along;  ///< h or theta_i
};

/// Error and time of either tracer; the slab's error is that of its worse lobe.
struct Spent {
    double error, time;
    double efficiency() const { return 1 / (error * error * time); }
};

double worse(const SlabProfile& p) { return std::max(p.back.standard_error, p.forward.standard_error); }

Spent analog(bool disc, const Cell& c, std::uint64_t paths, int runs) {
    TraceOptions o;
    o.paths = paths;
    Spent s{};
    s.time = seconds(runs, [&] {
        s.error = disc ? trace_disc(c.sigma, c.g, c.along, kBins, o).standard_error
                       : worse(trace_slab(c.sigma, c.g, c.along, kBins / 2, o));
    });
    return s;
}

Spent fast(bool disc, const Cell& c, double target, int runs) {
    TracerOptions o;
    o.paths = 1 << 21, o.target_error = target;
    Spent s{};
    s.time = seconds(runs, [&] {
        s.error = disc ? trace_expected_disc(c.sigma, c.g, c.along, kBins, o).profile.standard_error
                       : worse(trace_expected_slab(c.sigma, c.g, c.along, kBins / 2, o).profile);
    });
    return s;
}

/// 1 / (variance x time) over cells of the default axes drawn at random (sigma = 0 is closed form and left out).
void efficiency(std::size_t cells, double target) {
    const tables::Request axes = tables::default_request();
    std::printf("Efficiency 1 / (variance x time) over the analog tracer's, 720 bins, to %.1f %%, %zu random cells\n",
                target * 100, cells);
    json += ",\"efficiency\":[";
    const char* comma = "";
    for (const bool disc : {true, false}) {
        const std::vector<double>& along = disc ? axes.h.values : axes.theta_i.values;
        std::vector<double> ratios;
        RandomStream random(20, disc, 0);
        const auto pick = [&](const std::vector<double>& v, std::size_t first) {
            const double n = static_cast<double>(v.size() - first);
            return v[first + static_cast<std::size_t>(random.uniform() * n)];
        };
        for (std::size_t i = 0; i < cells; ++i) {
            const Cell c{pick(axes.sigma.values, 1), pick(axes.g.values, 0), pick(along, 0)};
            const Spent a = analog(disc, c, 20000, 2), f = fast(disc, c, target, 2);
            ratios.push_back(f.efficiency() / a.efficiency());
            write(
                "%s{\"medium\":\"%s\",\"sigma\":%.6g,\"g\":%.6g,\"%s\":%.6g,\"analog_error\":%.4g,\"analog_s\":%.4g,"
                "\"error\":%.4g,\"s\":%.4g,\"ratio\":%.4g}",
                comma, disc ? "disc" : "slab", c.sigma, c.g, disc ? "h" : "theta_i", c.along, a.error, a.time, f.error,
                f.time, ratios.back());
            comma = ",";
        }
        std::printf("  %s: median %.0f, worst quarter below %.0f, worst %.0f\n", disc ? "disc" : "slab",
                    quantile(ratios, 0.5), quantile(ratios, 0.25), quantile(ratios, 0));
        std::fflush(stdout);
    }
    json += "]";
}

/// (true error / standard error) over all (sigma, g) of the default axes, a few offsets of each. Its mean square is 1
/// if the errors are honest and the two solvers agree to well below them.
void z_scores() {
    const tables::Request axes = tables::default_request();
    std::printf("Random against deterministic, all %zu (sigma, g), errors in standard errors\n",
                axes.sigma.size() * axes.g.size());
    json += ",\"zscores\":[";
    const char* comma = "";
    for (const bool disc : {true, false}) {
        const std::vector<double>& along = disc ? axes.h.values : axes.theta_i.values;
        const std::vector<double> picked{along[0], along[along.size() / 2], along[along.size() - 2]};
        std::vector<double> z;
        double square = 0;
        for (const double g : axes.g.values) {
            const DiscSolver disc_solver(g);
            const SlabSolver slab_solver(g);
            for (const double sigma : axes.sigma.values) {
                const auto exact = disc ? disc_solver.solve(sigma, picked, kBins) : std::vector<Profile>();
                const auto exact_slab = disc ? std::vector<SlabProfile>() : slab_solver.solve(sigma, picked, kBins / 2);
                for (std::size_t i = 0; i < picked.size(); ++i) {
                    TracerOptions o;
                    o.paths = 2048, o.cell = z.size();
                    std::vector<Profile> found, truth;
                    if (disc) {
                        found = {trace_expected_disc(sigma, g, picked[i], kBins, o).profile}, truth = {exact[i]};
                    } else {
                        const SlabProfile p = trace_expected_slab(sigma, g, picked[i], kBins / 2, o).profile;
                        found = {p.back, p.forward}, truth = {exact_slab[i].back, exact_slab[i].forward};
                    }
                    for (std::size_t k = 0; k < found.size(); ++k) {
                        // Where the noise is below what the deterministic solver promises there is nothing to see.
                        if (found[k].standard_error < 3 * truth[k].standard_error + 1e-4) continue;
                        const double ratio = relative_l2(found[k].lobe, truth[k].lobe) / found[k].standard_error;
                        z.push_back(ratio), square += ratio * ratio;
                        write(
                            "%s{\"medium\":\"%s\",\"sigma\":%.6g,\"g\":%.6g,\"along\":%.6g,\"error\":%.4g,\"z\":%.4g}",
                            comma, disc ? "disc" : "slab", sigma, g, picked[i], found[k].standard_error, ratio);
                        comma = ",";
                    }
                }
            }
        }
        std::printf("  %s: %zu lobes, root mean square %.3f, median %.2f, 99 %% below %.2f, largest %.2f\n",
                    disc ? "disc" : "slab", z.size(), std::sqrt(square / static_cast<double>(z.size())),
                    quantile(z, 0.5), quantile(z, 0.99), quantile(z, 1));
        std::fflush(stdout);
    }
    json += "]";
}

}  // namespace

int main(int argc, char** argv) {
    std::size_t cells = 64;
    bool zscores = false;
    std::string file;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--cells") == 0 && i + 1 < argc)
            cells = static_cast<std::size_t>(std::max(1L, std::atol(argv[++i])));
        else if (std::strcmp(argv[i], "--zscores") == 0)
            zscores = true;
        else if (std::strcmp(argv[i], "--json") == 0 && i + 1 < argc)
            file = argv[++i];
        else
            return std::fprintf(stderr, "usage: bench_tracer [--cells N] [--zscores] [--json FILE]\n"), 2;
    }
    json = "{";
    events_per_second();
    efficiency(cells, 5e-3);
    if (zscores) z_scores();
    json += "}\n";
    if (file.empty()) return 0;
    std::FILE* out = std::fopen(file.c_str(), "w");
    if (out == nullptr) return std::fprintf(stderr, "%s: cannot be written\n", file.c_str()), 1;
    std::fwrite(json.data(), 1, json.size(), out);
    std::fclose(out);
    return 0;
}
