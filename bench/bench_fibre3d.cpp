// Paths per second of the whole fibre in three dimensions, and what they are worth: the error of the scattered light's
// bins beside the time, of the reference implementation and of the fast tracer in the same process, on one thread.
#include <omp.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sim3d/fibre_tracer.hpp"
#include "sim3d/fibre_walk.hpp"
#include "sim3d/model/five_lobes.hpp"

using namespace medulla;
using namespace medulla::sim3d;

namespace {

/// Processor time: the machine's other work costs less of it than of the wall's.
double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// |a - b| / |b|, and the same of b's own errors.
struct Error {
    double distance = 0, own = 0;
};
Error relative(const DirectionalDensity& a, const DirectionalDensity& b) {
    double d = 0, e = 0, n = 0;
    for (std::size_t i = 0; i < b.value.size(); ++i) {
        d += (a.value[i] - b.value[i]) * (a.value[i] - b.value[i]), e += b.error[i] * b.error[i];
        n += b.value[i] * b.value[i];
    }
    return {std::sqrt(d / n), std::sqrt(e / n)};
}

}  // namespace

int main(int argc, char** argv) {
    FibreOptions options;
    options.theta_bins = 36, options.phi_bins = 72;
    std::uint64_t paths = 1000000, analog = 200000, truth = 16000000;
    double theta_i = -40;
    std::string json;
    std::vector<std::string> animals = {"mouse", "red_fox"};
    CLI::App app("Light in the whole fibre: paths per second, and error against time");
    app.add_option("--paths", paths, "of the fast tracer");
    app.add_option("--analog", analog, "of the reference implementation");
    app.add_option("--truth", truth,
                   "paths that errors are measured against, of the fast tracer, another seed; 0: none");
    app.add_option("--theta-i", theta_i, "inclination of the light [degrees]");
    app.add_option("--animal", animals);
    app.add_option("--json", json, "write the numbers to FILE");
    CLI11_PARSE(app, argc, argv);

    omp_set_num_threads(1);
    Light light;
    light.theta_i = theta_i * pi / 180;
    nlohmann::json out;
    std::printf("%s; one thread, processor time; relative L2 error of the scattered light over 36 x 72 bins\n",
                fibre_tracer_target());
    std::printf("%-9s %-8s %-6s | %9s %8s %8s | %9s %9s | %s\n", "animal", "cuticle", "method", "paths", "Mpaths/s",
                "flights", "estimated", "true", "seconds to 1 %, one sigma");
    for (const std::string& name : animals) {
        const FurPreset* preset = find_preset(name.c_str());
        if (preset == nullptr) return std::fprintf(stderr, "no animal %s\n", name.c_str()), 2;
        for (const bool rough : {false, true}) {
            Fibre fibre = fibre_of(parameters_of<3>(*preset), 1);
            if (!rough) fibre.alpha = fibre.beta_m = fibre.beta_n = 0;
            DirectionalDensity reference;
            if (truth > 0) {
                FibreOptions o = options;
                o.paths = truth, o.seed = 99;
                omp_set_num_threads(omp_get_num_procs());
                reference = trace_fibre(fibre, light, o).density(scattered);
                omp_set_num_threads(1);
            }
            for (const bool fast : {false, true})
                for (int quarter = 2; quarter >= 0; --quarter) {
                    FibreOptions o = options;
                    o.paths = (fast ? paths : analog) >> (2 * quarter);
                    const double start = now();
                    const FibreProfile p = fast ? trace_fibre(fibre, light, o) : walk_fibre(fibre, light, o);
                    const double seconds = now() - start;
                    const DirectionalDensity d = p.density(scattered);
                    const double noise = d.relative_error();
                    const Error error = truth > 0 ? relative(d, reference) : Error{};
                    // The reference's own noise is part of the distance.
                    const double true_error =
                        std::sqrt(std::max(0.0, error.distance * error.distance - error.own * error.own));
                    const double n = double(p.paths());
                    std::printf("%-9s %-8s %-6s | %9.0f %8.3f %8.1f | %9.4f %9.4f | %.2f\n", name.c_str(),
                                rough ? "rough" : "smooth", fast ? "fast" : "analog", n, n / seconds * 1e-6,
                                double(p.flights()) / n, noise, true_error, seconds * noise * noise * 1e4);
                    std::fflush(stdout);
                    out["runs"].push_back({{"animal", name},
                                           {"rough", rough},
                                           {"fast", fast},
                                           {"paths", n},
                                           {"seconds", seconds},
                                           {"estimated_error", noise},
                                           {"true_error", true_error}});
                }
        }
    }
    if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
}
