// The field's models against light in the whole fibre: relative L2 error of the far field's lobe, all classes of light
// together, for three of the animals, and what a white fibre returns. docs/models.md. Every model has the same
// material, by medulla/models/from_fur.hpp.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "medulla/detail/gauss_legendre.hpp"
#include "medulla/models/from_fur.hpp"
#include "sim3d/fibre_tracer.hpp"
#include "sim3d/model/five_lobes.hpp"
#include "tests/support/fibre_of.hpp"

using namespace medulla;

namespace {

using Parameters = FurParameters<1>;
/// Energy per steradian about a direction.
using Value = std::function<float(Angles drawn)>;
struct Model {
    const char* name;
    std::function<Value(const Fibre<1>&, Angles known, float h)> make;
    bool near_field;  ///< depends on h
};

template <class Make>
Model far_model(const char* name, Make make) {
    return {name,
            [make](const Fibre<1>& fibre, Angles known, float) -> Value {
                return [field = make(fibre, known)](Angles drawn) { return field.value(drawn)[0]; };
            },
            false};
}
template <class Make>
Model near_model(const char* name, Make make) {
    return {name,
            [make](const Fibre<1>& fibre, Angles known, float h) -> Value {
                return [field = make(fibre, known, h)](Angles drawn) { return field.value(drawn)[0]; };
            },
            true};
}

std::vector<Model> all_models() {
    using namespace models;
    const auto far = [](const Fibre<1>& f, Angles known) { return far_field(f, known, Offsets{}, FarQuality::fine); };
    return {
        far_model("fur", far),
        far_model("eq12",
                  [far](const Fibre<1>& f, Angles k) { return far(f, k).keep(all_lobes ^ lobe_bit(Lobe::residual)); }),
        far_model("kajiya-kay",
                  [](const Fibre<1>& f, Angles k) { return far_field(kajiya_kay_of(f.parameters, false), k); }),
        far_model("kajiya-kay-normalised",
                  [](const Fibre<1>& f, Angles k) { return far_field(kajiya_kay_of(f.parameters, true), k); }),
        far_model("kim", [](const Fibre<1>& f, Angles k) { return far_field(kim_of(f.parameters), k); }),
        far_model("marschner", [](const Fibre<1>& f, Angles k) { return far_field(marschner_of(f.parameters), k); }),
        far_model("zinke", [](const Fibre<1>& f, Angles k) { return far_field(zinke_of(f.parameters), k); }),
        far_model("deon", [](const Fibre<1>& f, Angles k) { return far_field(deon_of(f.parameters), k); }),
        near_model("chiang",
                   [](const Fibre<1>& f, Angles k, float h) { return near_field(chiang_of(f.parameters), k, h); }),
        near_model("yan2015", [](const Fibre<1>& f, Angles k,
                                 float h) { return near_field(yan2015_of(f.parameters), f.tables, k, h); }),
    };
}

/// With tables that every model can read: C^M for any optical radius.
test::FibreOf<1> tabled(const Parameters& p) {
    TableRanges ranges = ranges_of(p);
    ranges.eta = 0;
    return {p, test::shipped(), ranges};
}

/// Energy per radian^2 averaged over each bin and folded, as the simulation has it: 8 x 4 nodes a bin, and of a near
/// field 96 midpoints of asin h in [0, pi/2], since -h is the mirror image: exits lie 1.2 deviations of 1.6 degrees
/// apart or closer.
std::vector<double> lobe_of(const Model& model, const Fibre<1>& fibre, Angles known, std::size_t rows,
                            std::size_t columns) {
    std::vector<double> sum(rows * columns, 0.0);
    const detail::GaussRule rule = detail::gauss_rule(0);
    const int offsets = model.near_field ? 96 : 1;
    for (int k = 0; k < offsets; ++k) {
        const double gamma = pi / 2 * (k + 0.5) / offsets;
        const Value value = model.make(fibre, known, float(std::sin(gamma)));
        const double weight = model.near_field ? pi / 2 / offsets * std::cos(gamma) : 1.0;
        for (std::size_t i = 0; i < rows; ++i)
            for (std::size_t j = 0; j < columns; ++j) {
                double mean = 0;
                for (int a = 0; a < 2 * rule.half; ++a)
                    for (int b = 0; b < 4; ++b) {
                        const double x = a & 1 ? double(rule.x[a / 2]) : -double(rule.x[a / 2]),
                                     theta = pi * ((double(i) + 0.5 + 0.5 * x) / double(rows) - 0.5),
                                     phi = pi * (2 * (double(j) + (b + 0.5) / 4) / double(columns) - 1);
                        mean += double(rule.w[a / 2]) / 8 * std::cos(theta) *
                                double(value(Angles{float(theta), float(phi)}));
                    }
                sum[i * columns + j] += 0.5 * weight * mean;
                sum[i * columns + columns - 1 - j] += 0.5 * weight * mean;
            }
    }
    return sum;
}

}  // namespace

int main(int argc, char** argv) {
    sim3d::FibreOptions options;
    options.paths = 4000000, options.theta_bins = 60, options.phi_bins = 96;
    double theta_i = -40;
    std::string json;
    std::vector<std::string> animals = {"human", "red_fox", "dog"}, names;
    CLI::App app("The field's models against light in the whole fibre");
    app.add_option("--paths", options.paths, "paths per animal");
    app.add_option("--seed", options.seed);
    app.add_option("--theta-i", theta_i, "inclination of the light [degrees]")->check(CLI::Range(-85.0, 85.0));
    app.add_option("--animal", animals, "of Table 4");
    app.add_option("--model", names, "these alone");
    app.add_option("--json", json, "write the numbers to FILE");
    CLI11_PARSE(app, argc, argv);

    const Angles known = {float(theta_i * pi / 180), 0};
    sim3d::Light light;
    light.theta_i = theta_i * pi / 180;
    const std::size_t bins = options.theta_bins * options.phi_bins;
    const double area = pi / double(options.theta_bins) * 2 * pi / double(options.phi_bins);
    std::vector<Model> models = all_models();
    if (!names.empty())
        models.erase(std::remove_if(
                         models.begin(), models.end(),
                         [&](const Model& m) { return std::find(names.begin(), names.end(), m.name) == names.end(); }),
                     models.end());

    struct Truth {
        test::FibreOf<1> fibre;
        std::vector<double> lobe;
        double energy, noise;
    };
    std::vector<Truth> truths;
    nlohmann::json out;
    std::printf("theta_i = %g degrees, %.3g paths an animal, bins of %.3g x %.3g degrees\n", theta_i,
                double(options.paths), 180.0 / double(options.theta_bins), 360.0 / double(options.phi_bins));
    std::printf("%-22s %9s", "", "furnace");
    for (const std::string& animal : animals) {
        const FurPreset* preset = find_preset(animal.c_str());
        if (preset == nullptr) return std::fprintf(stderr, "bench_models: no animal %s\n", animal.c_str()), 1;
        const sim3d::FibreProfile profile = trace_fibre(sim3d::fibre_of(parameters_of<3>(*preset), 1), light, options);
        const sim3d::DirectionalDensity lobe = profile.density(sim3d::all_classes, 0, true);
        truths.push_back({tabled(parameters_of<1>(*preset)), lobe.value, profile.energy(sim3d::all_classes).value,
                          lobe.relative_error()});
        std::printf(" | %19s", animal.c_str());
        out["truth"].push_back({{"animal", animal}, {"energy", truths.back().energy}, {"noise", truths.back().noise}});
    }
    std::printf("\n%-22s %9s", "light in the fibre", "1");
    for (const Truth& t : truths) std::printf(" | %9.4f %9.2g", t.energy, t.noise);
    std::printf("   energy, noise of the lobe\n");
    for (const Model& model : models) {
        nlohmann::json row = {{"model", model.name}};
        const auto energy_of = [&](const std::vector<double>& lobe) {
            double sum = 0;
            for (const double v : lobe) sum += v * area;
            return sum;
        };
        // White: the fox without absorption.
        Parameters white = parameters_of<1>(*find_preset("red_fox"));
        white.sigma_ca[0] = white.sigma_ma = 0;
        const test::FibreOf<1> white_fibre = tabled(white);
        const double furnace = energy_of(lobe_of(model, white_fibre, known, options.theta_bins, options.phi_bins));
        std::printf("%-22s %9.4f", model.name, furnace);
        row["furnace"] = furnace;
        for (const Truth& t : truths) {
            const std::vector<double> lobe = lobe_of(model, t.fibre, known, options.theta_bins, options.phi_bins);
            double difference = 0, norm = 0;
            for (std::size_t i = 0; i < bins; ++i)
                difference += (lobe[i] - t.lobe[i]) * (lobe[i] - t.lobe[i]), norm += t.lobe[i] * t.lobe[i];
            const double energy = energy_of(lobe), error = std::sqrt(difference / norm);
            std::printf(" | %9.4f %9.3f", energy, error);
            std::fflush(stdout);
            row["animals"].push_back({{"energy", energy}, {"error", error}});
        }
        std::printf("\n");
        out["models"].push_back(row);
    }
    std::printf("of each animal: energy, relative L2 error of the lobe\n");
    if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
}
