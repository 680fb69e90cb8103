// The bake: error of scattered lobes against bytes, for one material or all ten animals, beside the published model's
// error on the same lights; time to simulate and to bake; and a path vertex beside the factored model's. Run:
// bench_bake [LIGHT.h5 | PRESET]...; a preset is simulated first, which takes a minute on two cores.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "error_figure.hpp"
#include "medulla/baked_field.hpp"
#include "medulla/medulla.hpp"
#include "tables/bake/bake.hpp"
#include "tables/bake/fibre_file.hpp"
#include "tables/parallel.hpp"
#include "tests/support/fibre_of.hpp"
#include "vertex_timing.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

FibreLight simulated(const std::string& preset) {
    FibreRequest request;
    request.material = preset_material(preset, "bench_bake");
    FibreLight light = plan_of(request);
    const std::size_t nodes = light.cells.size();
    const std::atomic<bool> never{false};
    in_parallel(nodes + light.checks.size(), 0, never, [&](std::size_t i) {
        LightCell cell = simulate_cell(light, i);
        (i < nodes ? light.cells[i] : light.checks[i - nodes]) = std::move(cell);
    });
    return light;
}

/// Median and worst relative L2 error of TTs + TRTs, as published, on the lights that a bake is checked with.
BakeErrors published_errors(const FibreLight& light) {
    std::vector<double> each;
    BakeErrors result;
    const std::size_t rows = light.request.rows, columns = light.request.columns;
    FurParameters<3> fur = light.request.material.fur;
    fur.fresnel = Fresnel::bravais;
    for (std::size_t c = 0; c < light.check_sigma_ca.size(); ++c) {
        for (float& sigma : fur.sigma_ca) sigma = float(light.check_sigma_ca[c]);
        const test::FibreOf<3> fibre(fur, default_pack());
        for (const LightCell& cell : light.checks) {
            const NearField<3> hit = near_field(fibre, Angles{float(cell.theta_i), 0}, float(cell.h));
            double difference = 0, noise = 0, norm = 0;
            for (std::size_t b = 0; b < rows * columns; ++b) {
                const double theta = pi * ((double(b / columns) + 0.5) / double(rows) - 0.5),
                             phi = 2 * pi * ((double(b % columns) + 0.5) / double(columns) - 0.5);
                const auto lobes = hit.lobes(float(theta), float(phi));
                const double model = double(angular_density(lobes, lobe_bit(Lobe::TTs) | lobe_bit(Lobe::TRTs))[0]);
                const double truth = double(cell.density[c * rows * columns + b]),
                             error = double(cell.error[c * rows * columns + b]);
                difference += (model - truth) * (model - truth), noise += error * error, norm += truth * truth;
            }
            if (!(norm > 100 * noise)) continue;
            each.push_back(std::sqrt(std::max(0.0, difference - noise) / (norm - noise)));
        }
    }
    std::sort(each.begin(), each.end());
    result.lobes = each.size();
    if (!each.empty()) result.median = each[each.size() / 2], result.worst = each.back();
    return result;
}

/// Hits as a path tracer has them: known directions in proportion to the width that they see.
struct Hit {
    Vector known, light;
    float h, u[5];
};
std::vector<Hit> random_hits(int count) {
    std::mt19937 engine(1);
    std::uniform_real_distribution<float> uniform(0, 1);
    const auto direction = [&](bool seen) {
        for (;;) {
            const float x = 2 * uniform(engine) - 1, c = std::sqrt((1 - x) * (1 + x));
            const float phi = 2 * float(pi) * uniform(engine);
            if (!seen || uniform(engine) < c) return Vector{x, c * std::cos(phi), c * std::sin(phi)};
        }
    };
    std::vector<Hit> hits(static_cast<std::size_t>(count));
    for (Hit& hit : hits) {
        hit.known = direction(true), hit.light = direction(false), hit.h = 2 * uniform(engine) - 1;
        for (float& u : hit.u) u = uniform(engine);
    }
    return hits;
}

template <class Field>
float vertex(const Field& field, const Hit& hit) {
    const Sample<3> s = field.sample({hit.u[0], hit.u[1], hit.u[2], hit.u[3], hit.u[4]});
    const Evaluation<3> e = field.evaluate(hit.light);
    return s.pdf + s.value[0] + s.direction.x + e.pdf + e.value[1];
}

}  // namespace

int main(int argc, char** argv) {
    std::vector<std::string> lights;
    std::vector<int> ranks = {8, 12, 16, 20};
    std::string json, figure;
    double seconds = 4;
    CLI::App app("The bake: error against bytes and time");
    app.add_option("LIGHT", lights, "files of medulla-precompute --fibre, or presets (default: all ten)");
    app.add_option("--rank", ranks, "numbers of exit functions");
    app.add_option("--seconds", seconds, "of timing vertices");
    app.add_option("--json", json, "write the numbers to FILE");
    app.add_option("--figure", figure, "draw error against bytes: .svg, .png or .html");
    CLI11_PARSE(app, argc, argv);
    if (lights.empty())
        for (const FurPreset& preset : fur_presets) lights.push_back(preset.name);

    nlohmann::ordered_json out;
    std::vector<plot::Panel> panels;
    std::vector<unsigned char> first;
    std::printf("relative L2 error of scattered lobes at random (theta_i, h) and sigma_ca 0.05, 0.35, 1.2\n");
    std::printf("%-10s %9s | %4s %7s %8s %8s %8s | %18s\n", "material", "simulate", "rank", "bytes", "bake [s]",
                "median", "worst", "published, worst");
    for (const std::string& name : lights) {
        const bool file = name.size() > 3 && name.compare(name.size() - 3, 3, ".h5") == 0;
        const double start = now();
        const FibreLight light = file ? read_fibre(name) : simulated(name);
        const double simulation = file ? 0 : now() - start;
        const BakeErrors published = published_errors(light);
        nlohmann::ordered_json& entry = out["materials"][light.request.material.name];
        if (!file) entry["simulate_seconds"] = simulation;
        entry["published"] = {{"median", published.median}, {"worst", published.worst}};
        plot::Panel panel;
        panel.title = light.request.material.name;
        plot::Curve median, worst, line;
        median.marks = worst.marks = true, worst.stroke = plot::Stroke::dashed, line.stroke = plot::Stroke::dotted;
        for (const int rank : ranks) {
            BakeOptions options;
            options.functions = rank;
            const BakeResult result = bake(light, options, name);
            std::printf("%-10s %7.0f s | %4d %7zu %8.1f %8.4f %8.4f | %9.3f %8.3f\n",
                        light.request.material.name.c_str(), simulation, rank, result.pack.size(), result.seconds,
                        result.errors.median, result.errors.worst, published.median, published.worst);
            std::fflush(stdout);
            entry["bakes"].push_back({{"rank", rank},
                                      {"bytes", result.pack.size()},
                                      {"seconds", result.seconds},
                                      {"median", result.errors.median},
                                      {"worst", result.errors.worst},
                                      {"lobes", result.errors.lobes}});
            const double bytes = double(result.pack.size());
            median.x.push_back(bytes), median.y.push_back(result.errors.median);
            worst.x.push_back(bytes), worst.y.push_back(result.errors.worst);
            line.x.push_back(bytes), line.y.push_back(published.median);
            if (rank == BakeOptions{}.functions || first.empty()) first = result.pack;
        }
        panel.curves = {median, worst, line};
        panels.push_back(panel);
    }
    if (!figure.empty()) {
        plot::Figure drawn;
        bench::add_panels(drawn, 5, "bytes", 1e-3, panels);
        bench::save(drawn, figure);
    }

    const std::vector<Hit> hits = random_hits(1024);
    const BakedMaterial material = open_baked(first.data(), first.size()).material;
    FurParameters<3> fur = material.parameters();
    const test::FibreOf<3> factored(fur, default_pack());
    const BakedFibre<3> fibre = make_fibre(material);
    bench::VertexTimes times(1024);
    const auto at = [&](int i) -> const Hit& { return hits[std::size_t(i)]; };
    times.add("baked, near", [&](int i) { return vertex(near_field(fibre, at(i).known, at(i).h), at(i)); });
    times.add("baked, far", [&](int i) { return vertex(far_field(fibre, at(i).known), at(i)); });
    times.add("factored, far", [&](int i) { return vertex(far_field(factored, at(i).known), at(i)); });
    times.add("factored, near", [&](int i) { return vertex(near_field(factored, at(i).known, at(i).h), at(i)); });
    times.run(seconds);
    times.print_table();
    if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
}
