// Both forms of the scattered lobes against light in the whole fibre: docs/truth.md, 'Two forms'. Energies over
// absorption, the scattered lobe, and R, with the gain of each correction apart; ten animals, or random materials.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "sim3d/fibre_tracer.hpp"
#include "sim3d/model/five_lobes.hpp"
#include "sim3d/model/measured_light.hpp"

using namespace medulla;
using namespace medulla::sim3d;

namespace {

constexpr std::size_t theta_bins = 30, phi_bins = 48;
constexpr ModelForm published, corrected = {Reflectance::exact, Scattering::corrected};

/// Relative errors, collected.
struct Errors {
    std::vector<double> all;
    void add(double model, double truth) { all.push_back(model / truth - 1); }
    double share(double of) const {
        std::vector<double> sorted;
        for (const double x : all) sorted.push_back(std::abs(x));
        std::sort(sorted.begin(), sorted.end());
        return sorted.empty() ? 0 : sorted[static_cast<std::size_t>(of * double(sorted.size() - 1))];
    }
    std::string text() const {
        char line[64];
        std::snprintf(line, sizeof line, "%.3f %.3f %.3f", share(0.5), share(0.9), share(1));
        return line;
    }
    nlohmann::json json() const { return {share(0.5), share(0.9), share(1)}; }
};

/// Relative L2 error of a scattered lobe. @param scale of the model
double lobe_error(const DirectionalDensity& model, double scale, const DirectionalDensity& truth) {
    const Squares s = squares(model.value, scale, truth.value, 1);
    return std::sqrt(s.difference / s.norm);
}

/// The absorption that goes with a fibre: its own as it is printed, and, in the medulla, none and twice its own.
std::vector<double> medulla_absorptions(double own) { return {own, 0, 2 * own + 0.05}; }

}  // namespace

int main(int argc, char** argv) {
    FibreOptions options;
    options.paths = 400000, options.theta_bins = theta_bins, options.phi_bins = phi_bins;
    int materials = 0;
    bool smooth = false;
    std::string json;
    std::vector<std::string> animals;
    CLI::App app("The published and the corrected form against light in the whole fibre");
    app.add_option("--paths", options.paths, "paths per light");
    app.add_option("--seed", options.seed);
    app.add_option("--animal", animals, "these alone");
    app.add_option("--random", materials, "random materials in place of the animals")->check(CLI::Range(1, 100000));
    app.add_flag("--smooth", smooth, "leave out the cuticle's tilt and roughness");
    app.add_option("--json", json, "write the numbers to FILE");
    CLI11_PARSE(app, argc, argv);

    struct Row {
        std::string name;
        Fibre fibre;
        std::vector<double> inclinations, medulla;
    };
    std::vector<Row> rows;
    std::mt19937_64 random(options.seed);
    std::uniform_real_distribution<double> u(0, 1);
    for (int i = 0; i < materials; ++i) {
        Fibre f;
        f.kappa = 0.2 + 0.79 * std::sqrt(u(random)), f.eta_c = 1.2 + 0.5 * u(random), f.layers = 0.4 + 2 * u(random);
        f.sigma_ms = 0.3 * std::pow(25, u(random)), f.g = 0.85 * u(random);
        f.alpha = 0.08 * u(random), f.beta_m = 0.03 + 0.17 * u(random), f.beta_n = 0.03 + 0.2 * u(random);
        f.sigma_ca = {0.03 * std::pow(50, u(random))}, f.sigma_ma = 0.01 * std::pow(50, u(random));
        const double theta_i = std::asin(0.98 * (2 * u(random) - 1)) * 180 / pi;
        rows.push_back({std::to_string(i), f, {theta_i}, {f.sigma_ma}});
    }
    for (const FurPreset& preset : fur_presets) {
        if (materials > 0) break;
        if (!animals.empty() && std::find(animals.begin(), animals.end(), preset.name) == animals.end()) continue;
        Fibre f = fibre_of(parameters_of<3>(preset), 1);
        f.sigma_ca = {double(preset.sigma_ca), 0};  // the printed one, white, then the coat's three colours
        for (const float x : preset.coat) f.sigma_ca.push_back(double(x));
        rows.push_back({preset.name, f, {0, -40, 70}, medulla_absorptions(f.sigma_ma)});
    }

    std::printf(
        "Energy of scattered light: relative error, median, 90 %%, worst (animals: 5 sigma_ca x 3 sigma_ma), "
        "published | corrected || as printed: truth, published, corrected || relative L2 error of the scattered lobe: "
        "published, with the cosine alone, with escape and return alone, both || R: truth, published Fresnel term, "
        "exact\n");
    Errors all[2];
    nlohmann::json out;
    for (const Row& row : rows) {
        for (const double theta_i : row.inclinations) {
            Errors errors[2];
            char line[256] = "";
            nlohmann::json numbers;
            for (const double sigma_ma : row.medulla) {
                Fibre f = row.fibre;
                f.sigma_ma = sigma_ma;
                if (smooth) f.alpha = f.beta_m = f.beta_n = 0;
                Light light;
                light.theta_i = theta_i * pi / 180;
                const FibreProfile truth = trace_fibre(f, light, options);
                ++options.cell;
                FiveLobes model[2];
                for (const int k : {0, 1})
                    model[k] =
                        five_lobes(f, k == 0 ? published : corrected, light.theta_i, {{0, 1}}, theta_bins, phi_bins)[0];
                const auto energy = [](const FiveLobes& m, std::size_t c) { return m.energy[c][3] + m.energy[c][4]; };
                for (std::size_t c = 0; c < f.sigma_ca.size(); ++c)
                    for (const int k : {0, 1}) {
                        const double found = truth.energy(scattered, c).value;
                        errors[k].add(energy(model[k], c), found), all[k].add(energy(model[k], c), found);
                    }
                if (sigma_ma != row.medulla[0]) continue;
                const DirectionalDensity lobe = truth.density(scattered, 0, true);
                const DirectionalDensity plain = folded(model[0].scattered[0][std::size_t(Longitudinal::house)]),
                                         cosine =
                                             folded(model[0].scattered[0][std::size_t(Longitudinal::house_cosine)]);
                const double scale = energy(model[1], 0) / energy(model[0], 0);
                const double lobes[] = {lobe_error(plain, 1, lobe), lobe_error(cosine, 1, lobe),
                                        lobe_error(plain, scale, lobe), lobe_error(cosine, scale, lobe)};
                const double R[] = {truth.energy(only(Class::R)).value, model[0].energy[0][0], model[1].energy[0][0]};
                const double printed[] = {truth.energy(scattered).value, energy(model[0], 0), energy(model[1], 0)};
                std::snprintf(line, sizeof line, "%.3f %.3f %.3f || %.2f %.2f %.2f %.2f || %.3f %.3f %.3f", printed[0],
                              printed[1], printed[2], lobes[0], lobes[1], lobes[2], lobes[3], R[0], R[1], R[2]);
                numbers = {{"animal", row.name}, {"theta_i", theta_i}, {"printed", printed}, {"lobe", lobes}, {"R", R}};
            }
            numbers["energy"] = {errors[0].json(), errors[1].json()};
            out["rows"].push_back(numbers);
            std::printf("%-9s %5.1f | %s | %s || %s\n", row.name.c_str(), theta_i, errors[0].text().c_str(),
                        errors[1].text().c_str(), line);
            std::fflush(stdout);
        }
    }
    std::printf("all             | %s | %s\n", all[0].text().c_str(), all[1].text().c_str());
    out["all"] = {all[0].json(), all[1].json()};
    if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
}
