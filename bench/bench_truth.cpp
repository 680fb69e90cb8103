// The published model of ten animals against light in the whole fibre: docs/truth.md. Energies of the far field by
// class, total variation of the scattered light's shape, each with its noise.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/published_model.hpp"
#include "sim3d/fibre_tracer.hpp"

using namespace medulla;
using namespace medulla::sim3d;

int main(int argc, char** argv) {
    FibreOptions options;
    options.paths = 4000000, options.theta_bins = 60, options.phi_bins = 96;
    double theta_i = -40;
    std::string json;
    std::vector<std::string> animals;
    CLI::App app("The published model against light in the whole fibre");
    app.add_option("--paths", options.paths, "paths per animal");
    app.add_option("--seed", options.seed);
    app.add_option("--theta-i", theta_i, "inclination of the light [degrees]");
    app.add_option("--animal", animals, "these alone");
    app.add_option("--theta-bins", options.theta_bins);
    app.add_option("--phi-bins", options.phi_bins);
    app.add_option("--json", json, "write the numbers to FILE");
    CLI11_PARSE(app, argc, argv);

    Light light;
    light.theta_i = theta_i * pi / 180;
    nlohmann::json out;
    std::printf("theta_i = %g degrees, far field, %.3g paths an animal, bins of %.3g x %.3g degrees; (1e-4 of error)\n",
                theta_i, double(options.paths), 180.0 / double(options.theta_bins), 360.0 / double(options.phi_bins));
    std::printf("%-9s | %-62s | %-28s | %-15s | %s\n", "", "in three dimensions: R, TT, TRT and higher, s, Rs, sR",
                "model: R, TT, TRT, TTs, TRTs", "white scattered", "scattered shape: published, with cos, noise");
    for (const FurPreset& preset : fur_presets) {
        if (!animals.empty() && std::find(animals.begin(), animals.end(), preset.name) == animals.end()) continue;
        const Fibre fibre = bench::fibre_of(preset);
        const FibreProfile truth = trace_fibre(fibre, light, options);
        const bench::PublishedModel model =
            bench::published_model(fibre, light.theta_i, options.theta_bins, options.phi_bins);
        Fibre white = fibre;
        white.sigma_ca = {0}, white.sigma_ma = 0;
        FibreOptions fewer = options;
        fewer.paths = options.paths / 4 + 1;
        const Estimate white_truth = trace_fibre(white, light, fewer).energy(scattered);
        const bench::PublishedModel white_model = bench::published_model(white, light.theta_i, 1, 1);
        const double white_energy = white_model.energy[3] + white_model.energy[4];
        const DirectionalDensity shape = truth.density(scattered, 0, true);
        const double published = total_variation(shape, model.scattered),
                     cosine = total_variation(shape, model.with_cosine), noise = total_variation_noise(shape);
        const Classes sets[6] = {only(Class::R),
                                 only(Class::TT),
                                 only(Class::TRT) | only(Class::higher),
                                 only(Class::scattered),
                                 only(Class::reflected_scattered),
                                 only(Class::scattered_reflected)};
        nlohmann::json row = {{"animal", preset.name},
                              {"tv_published", published},
                              {"tv_cosine", cosine},
                              {"tv_noise", noise},
                              {"white_scattered", white_truth.value},
                              {"white_model", white_energy}};
        std::printf("%-9s |", preset.name);
        for (const Classes set : sets) {
            const Estimate e = truth.energy(set);
            std::printf(" %.4f(%.0f)", e.value, std::ceil(e.error * 1e4));
            row["truth"].push_back({e.value, e.error});
        }
        std::printf(" |");
        for (const double A : model.energy) {
            std::printf(" %.3f", A);
            row["model"].push_back(A);
        }
        std::printf(" | %.3f(%.0f) %.3f | %.4f %.4f %.4f\n", white_truth.value, std::ceil(white_truth.error * 1e3),
                    white_energy, published, cosine, noise);
        std::fflush(stdout);
        out["animals"].push_back(row);
    }
    if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
}
