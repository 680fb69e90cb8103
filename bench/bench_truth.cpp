// The published model of ten animals against light in the whole fibre: docs/truth.md. Energies by class, and how far
// the scattered light's shape is from the model's, with the causes apart and the noise beside them.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sim3d/fibre_tracer.hpp"
#include "sim3d/model/error_map.hpp"

using namespace medulla;
using namespace medulla::sim3d;

namespace {

/// |a - b| / |b| of densities as they are.
double relative_distance(const DirectionalDensity& a, const DirectionalDensity& b) {
    double d = 0, n = 0;
    for (std::size_t i = 0; i < b.value.size(); ++i)
        d += (a.value[i] - b.value[i]) * (a.value[i] - b.value[i]), n += b.value[i] * b.value[i];
    return std::sqrt(d / n);
}

/// --sigma: at which sigma C^M times cos theta_r is nearer to the truth, sigma_ms kappa / cos theta_t or sigma_ms
/// kappa: relative L2 errors of the scattered shape over light from all directions, with the noise of their difference.
nlohmann::json compare_sigma(const FurPreset& preset, std::uint64_t paths, std::uint64_t seed) {
    ErrorMapOptions options;
    options.paths = paths, options.seed = seed;
    const ErrorMap map = error_map(fibre_of(parameters_of<3>(preset), 1), {}, options);
    const Causes& causes = map.causes[0];
    nlohmann::json row = {{"animal", preset.name}};
    std::printf("%-9s |", preset.name);
    for (const std::size_t near : {0u, 1u}) {
        const Distance &house = causes.shape[near][std::size_t(Longitudinal::house_cosine)],
                       &authors = causes.shape[near][std::size_t(Longitudinal::authors_cosine)];
        const Estimate &lobe = causes.sigma[near], &over_theta = causes.sigma_over_theta[near];
        std::printf(" %.4f %.4f %+.2f(%.2f) %+.2f(%.2f) |", house.value(), authors.value(), lobe.value * 1e3,
                    lobe.error * 1e3, over_theta.value * 1e3, over_theta.error * 1e3);
        row[near ? "offsets" : "far"] = {{"over_cos", {house.value(), house.error()}},
                                         {"plain", {authors.value(), authors.error()}},
                                         {"difference", {lobe.value, lobe.error}},
                                         {"difference_over_theta_r", {over_theta.value, over_theta.error}}};
    }
    for (const LightError& light : map.far) {
        const Estimate& e = light.channels[0].sigma;
        row["by_theta_i"].push_back({light.theta_i * 180 / pi, e.value, e.error});
        std::printf(" %+.1f(%.1f)", e.value * 1e3, e.error * 1e3);
    }
    std::printf("\n");
    std::fflush(stdout);
    return row;
}

}  // namespace

int main(int argc, char** argv) {
    FibreOptions options;
    options.paths = 4000000, options.theta_bins = 60, options.phi_bins = 96;
    double theta_i = -40;
    std::optional<double> h;
    bool smooth = false, sigma = false;
    std::string json;
    std::vector<std::string> animals;
    CLI::App app("The published model against light in the whole fibre");
    app.add_option("--paths", options.paths, "paths per animal");
    app.add_option("--seed", options.seed);
    app.add_option("--theta-i", theta_i, "inclination of the light [degrees]");
    app.add_option("--offset", h, "one ray, of this h; without: the far field")->check(CLI::Range(0.0, 1.0));
    app.add_flag("--smooth", smooth, "leave out the cuticle's tilt and roughness");
    app.add_flag("--sigma", sigma, "instead: which sigma C^M wants, over light from all directions; --paths per cell");
    app.add_option("--animal", animals, "these alone");
    app.add_option("--theta-bins", options.theta_bins);
    app.add_option("--phi-bins", options.phi_bins);
    app.add_option("--json", json, "write the numbers to FILE");
    CLI11_PARSE(app, argc, argv);

    Light light;
    light.theta_i = theta_i * pi / 180;
    if (h) light.h_low = light.h_high = *h;
    nlohmann::json out;
    const auto wanted = [&](const FurPreset& preset) {
        return animals.empty() || std::find(animals.begin(), animals.end(), preset.name) != animals.end();
    };
    if (sigma) {
        std::printf(
            "C^M times cos theta_r, relative L2 of the scattered shape: at sigma_ms kappa / cos theta_t, at sigma_ms "
            "kappa, 1000 times the second's square minus the first's (standard error), the same over theta_r alone | "
            "single offsets | 1000 times the difference in the far field by theta_i, -75 to 75 degrees\n");
        for (const FurPreset& preset : fur_presets)
            if (wanted(preset)) out["animals"].push_back(compare_sigma(preset, options.paths, options.seed));
        if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
        return 0;
    }
    std::printf("theta_i = %g degrees, %s, %s cuticle, %.3g paths an animal, bins of %.3g x %.3g degrees\n", theta_i,
                h ? "one ray" : "far field", smooth ? "smooth" : "rough", double(options.paths),
                180.0 / double(options.theta_bins), 360.0 / double(options.phi_bins));
    std::printf(
        "Energies of R, TT, TRT and higher, s, Rs, sR in three dimensions (error in units of 1e-4) | of the "
        "model's R, TT, TRT, TTs, TRTs | scattered light without absorption: 3D (1e-3), model\n");
    std::printf(
        "Total variation of the scattered shape: published, at the authors' sigma, with the cosine, with the cosine "
        "at the authors' sigma | with the cosine: over phi, over theta_r | of the product of its own marginals | "
        "noise | relative L2 of the scattered lobe: published, its shape, with the cosine\n");
    for (const FurPreset& preset : fur_presets) {
        if (!wanted(preset)) continue;
        Fibre fibre = fibre_of(parameters_of<3>(preset), 1);
        if (smooth) fibre.alpha = fibre.beta_m = fibre.beta_n = 0;
        const FibreProfile truth = trace_fibre(fibre, light, options);
        const OffsetRange range = h ? OffsetRange{*h, *h} : OffsetRange{0, 1};
        const FiveLobes model = five_lobes(fibre, {}, light.theta_i, {range}, options.theta_bins, options.phi_bins)[0];
        const double model_energy = model.energy[0][3] + model.energy[0][4];
        const auto shape = [&](Longitudinal which) {
            const DirectionalDensity& d = model.scattered[0][std::size_t(which)];
            return h ? d : folded(d);
        };
        Fibre white = fibre;
        white.sigma_ca = {0}, white.sigma_ma = 0;
        FibreOptions fewer = options;
        fewer.paths = options.paths / 4 + 1;
        const Estimate white_truth = trace_fibre(white, light, fewer).energy(scattered);
        const double white_energy = model.white[3] + model.white[4];

        nlohmann::json row = {
            {"animal", preset.name}, {"white_scattered", white_truth.value}, {"white_model", white_energy}};
        std::printf("%-9s |", preset.name);
        const Classes sets[] = {only(Class::R),
                                only(Class::TT),
                                only(Class::TRT) | only(Class::higher),
                                only(Class::scattered),
                                only(Class::reflected_scattered),
                                only(Class::scattered_reflected)};
        for (const Classes set : sets) {
            const Estimate e = truth.energy(set);
            std::printf(" %.4f(%.0f)", e.value, std::ceil(e.error * 1e4));
            row["truth"].push_back({e.value, e.error});
        }
        std::printf(" |");
        for (int k = 0; k < lobe_count; ++k)
            std::printf(" %.3f", model.energy[0][std::size_t(k)]),
                row["model"].push_back(model.energy[0][std::size_t(k)]);
        std::printf(" | %.3f(%.0f) %.3f\n", white_truth.value, std::ceil(white_truth.error * 1e3), white_energy);

        out["animals"].push_back(row);
        if (!(model_energy > 0)) continue;  // one ray that misses the medulla
        const DirectionalDensity lobe = truth.density(scattered, 0, !h);
        const DirectionalDensity published = shape(Longitudinal::house);
        const DirectionalDensity cosine = shape(Longitudinal::house_cosine);
        DirectionalDensity scaled[2] = {published, cosine};
        const double all = truth.energy(scattered).value / model_energy;
        for (DirectionalDensity& d : scaled)
            for (double& v : d.value) v *= all;
        const std::vector<double> numbers = {total_variation(lobe, published),
                                             total_variation(lobe, shape(Longitudinal::authors)),
                                             total_variation(lobe, cosine),
                                             total_variation(lobe, shape(Longitudinal::authors_cosine)),
                                             total_variation(marginal(lobe, true), marginal(cosine, true)),
                                             total_variation(marginal(lobe, false), marginal(cosine, false)),
                                             total_variation(lobe, product_of_marginals(lobe)),
                                             total_variation_noise(lobe),
                                             relative_distance(published, lobe),
                                             relative_distance(scaled[0], lobe),
                                             relative_distance(scaled[1], lobe)};
        out["animals"].back()["shape"] = numbers;
        std::printf("%-9s | %.3f %.3f %.3f %.3f | %.3f %.3f | %.3f | %.3f | %.2f %.2f %.2f\n", "", numbers[0],
                    numbers[1], numbers[2], numbers[3], numbers[4], numbers[5], numbers[6], numbers[7], numbers[8],
                    numbers[9], numbers[10]);
        std::fflush(stdout);
    }
    if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
}
