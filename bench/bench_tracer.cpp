// The fast random solver: collisions per second, efficiency against the analog tracer over the default axes, and
// z-scores against the deterministic solvers. All on one thread, measured in turn in one process.
// Usage: bench_tracer [--cells N] [--json FILE]; --zscores visits all (sigma, g) of both tables (minutes).
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

#include "sim2d/random.hpp"
#include "sim2d/reference/analog.hpp"
#include "sim2d/tracer/kernel.hpp"
#include "sim2d/tracer/tracer.hpp"
#include "tables/job/request.hpp"

using namespace medulla;
using namespace medulla::sim2d;

namespace {

constexpr std::size_t kBins = 720;

/// Processor time, which other work on the machine disturbs less than wall time.
double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Seconds of the fastest of `runs` runs, since other work on the machine can only slow a run down.
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

/// Paths without deposits: scattering, flights, compaction and the selection of depositing vertices.
void events_per_second() {
    std::printf("Million collisions per second on one core, paths without deposits\n");
    json += "\"events\":[";
    const char* comma = "";
    for (const std::string& target : tracer_targets()) {
        set_tracer_target(target);
        std::printf("  %-8s", target.c_str());
        for (const Medium medium : {Medium::disc, Medium::slab})
            for (const double sigma : {2.0, 16.0, 100.0}) {
                TracerCell cell;
                cell.medium = medium, cell.sigma = sigma, cell.g = 0.9, cell.h = 0.3, cell.theta_i = 0.3;
                cell.plan.forced = 0, cell.plan.roulette = 1e30f;
                TracerSums sums;
                PathTracer tracer(cell);
                const auto count = static_cast<std::uint64_t>(4e6 / sigma);
                const double t = seconds(5, [&] {
                    sums = {};
                    tracer.trace(0, 0, count, sums);
                });
                const double rate = static_cast<double>(sums.scatterings) / t;
                const char* name = medium == Medium::disc ? "disc" : "slab";
                std::printf("  %s sigma %g: %.1f", name, sigma, rate * 1e-6);
                write("%s{\"target\":\"%s\",\"medium\":\"%s\",\"sigma\":%g,\"per_second\":%.4g}", comma, target.c_str(),
                      name, sigma, rate);
                comma = ",";
            }
        std::printf("\n");
        std::fflush(stdout);
    }
    set_tracer_target("");
    json += "]";
}

struct Cell {
    double sigma, g, along;  ///< h or theta_i
};

/// Error and time of a tracer; the slab's error is that of its worse lobe.
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

/// 1 / (variance x time) over random cells of the default axes (without sigma = 0, a closed form).
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

}  // namespace

int main(int argc, char** argv) {
    std::size_t cells = 64;
    std::string file;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--cells") == 0 && i + 1 < argc)
            cells = static_cast<std::size_t>(std::max(1L, std::atol(argv[++i])));
        else if (std::strcmp(argv[i], "--json") == 0 && i + 1 < argc)
            file = argv[++i];
        else
            return std::fprintf(stderr, "usage: bench_tracer [--cells N] [--json FILE]\n"), 2;
    }
    json = "{";
    events_per_second();
    efficiency(cells, 5e-3);
    json += "}\n";
    if (file.empty()) return 0;
    std::FILE* out = std::fopen(file.c_str(), "w");
    if (out == nullptr) return std::fprintf(stderr, "%s: cannot be written\n", file.c_str()), 1;
    std::fwrite(json.data(), 1, json.size(), out);
    std::fclose(out);
    return 0;
}
