// A path vertex in nanoseconds, beside a hair BCSDF (models/chiang.hpp) in the same process: make the fibre, take
// the hit's field, draw a direction with value and pdf, evaluate value and pdf for one light direction. Run:
// bench_vertex [--json] [--seconds S] [--no-gpu]; --json prints JSON instead of the table. Where there is an nvcc,
// ptxas says what vertex_kernel.cu needs of a GPU thread; that takes a minute or two and no GPU.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "medulla/medulla.hpp"
#include "medulla/models/chiang.hpp"
#include "medulla/models/deon.hpp"
#include "medulla/models/kajiya_kay.hpp"
#include "medulla/models/kim.hpp"
#include "medulla/models/marschner.hpp"
#include "medulla/models/yan2015.hpp"
#include "medulla/models/zinke.hpp"
#include "nvcc_figures.hpp"
#include "tests/support/fibre_of.hpp"
#include "tests/support/fur_reference.hpp"
#include "vertex_timing.hpp"

using namespace medulla;

namespace {

constexpr int hit_count = 1024;

/// What a path tracer brings to a vertex.
struct PathHit {
    Vector known, light;  ///< unit, away from the fibre
    float h;
    float u[5];
    FurParameters<3> coat, corrected, textured_medulla, textured_colour, textured;
    Offsets interval;       ///< a fifth of the fibre about h
    float hair_sigma_a[3];  ///< of the models without a medulla
};

/// Known directions as rays meet a fibre (in proportion to the width it shows them); h, light and numbers even.
/// Textures vary the bobcat's parameters by half their value and more.
std::vector<PathHit> random_hits() {
    std::mt19937 engine(1);
    std::uniform_real_distribution<float> uniform(0, 1);
    const auto direction = [&](bool seen) {
        for (;;) {
            const float x = 2 * uniform(engine) - 1, c = std::sqrt((1 - x) * (1 + x));
            const float phi = 2 * float(pi) * uniform(engine);
            if (!seen || uniform(engine) < c) return Vector{x, c * std::cos(phi), c * std::sin(phi)};
        }
    };
    const auto between = [&](float low, float high) { return low + (high - low) * uniform(engine); };
    std::vector<PathHit> hits(hit_count);
    for (PathHit& hit : hits) {
        hit.known = direction(true), hit.light = direction(false);
        hit.h = between(-1, 1);
        for (float& u : hit.u) u = uniform(engine);
        for (float& s : hit.hair_sigma_a) s = uniform(engine);
        const float low = std::min(0.8f, std::max(-1.0f, hit.h - 0.1f));
        hit.interval = {low, low + 0.2f};
        hit.coat = parameters_of<3>(*find_preset("bobcat"));
        hit.textured_medulla = hit.textured_colour = hit.corrected = hit.coat;
        hit.corrected.scattering = Scattering::corrected;
        hit.textured_medulla.sigma_ms = between(0.5f, 4), hit.textured_medulla.sigma_ma = between(0, 0.5f);
        hit.textured_medulla.g = between(0, 0.7f), hit.textured_medulla.kappa = between(0.5f, 0.95f);
        for (float& s : hit.textured_colour.sigma_ca) s = between(0, 2);
        hit.textured_colour.beta_m = between(0.05f, 0.3f), hit.textured_colour.beta_n = between(0.05f, 0.4f);
        hit.textured_colour.alpha = between(0, 0.1f), hit.textured_colour.layers = between(0.4f, 2);
        hit.textured = hit.textured_colour;
        hit.textured.sigma_ms = hit.textured_medulla.sigma_ms, hit.textured.sigma_ma = hit.textured_medulla.sigma_ma;
        hit.textured.g = hit.textured_medulla.g, hit.textured.kappa = hit.textured_medulla.kappa;
    }
    return hits;
}

/// The vertex of any field.
template <class Field>
float vertex(const Field& field, const PathHit& hit) {
    const Sample<3> s = field.sample({hit.u[0], hit.u[1], hit.u[2], hit.u[3], hit.u[4]});
    const Evaluation<3> e = field.evaluate(hit.light);
    return s.pdf + s.value[0] + s.direction.x + e.pdf + e.value[1];
}

/// A hair of fixed roughness, its absorption from a texture.
template <class Model>
Model hair_of(const PathHit& hit) {
    Model m;
    m.eta = 1.55f, m.alpha = 0.0349f, m.beta_m = m.beta_n = 0.3f;
    for (int c = 0; c < 3; ++c) m.sigma_a[c] = hit.hair_sigma_a[c];
    return m;
}
models::Marschner<3> marschner_of(const PathHit& hit) {
    models::Marschner<3> m;
    for (int c = 0; c < 3; ++c) m.sigma_a[c] = hit.hair_sigma_a[c];
    return m;
}
models::KajiyaKay<3> kajiya_kay_of(const PathHit& hit, bool normalised) {
    models::KajiyaKay<3> m;
    for (int c = 0; c < 3; ++c) m.diffuse[c] = 0.07f * hit.hair_sigma_a[c], m.specular[c] = 0.3f;
    m.normalised = normalised;
    return m;
}
models::Kim<3> kim_of(const PathHit& hit) {
    models::Kim<3> m;
    for (int c = 0; c < 3; ++c) m.rho_R[c] = 0.3f, m.rho_T[c] = 0.5f * hit.hair_sigma_a[c];
    m.normalised = true;
    return m;
}

/// The pass that a wavefront renderer makes of it: all fields, then all samples, then all lights.
float batch(const std::vector<PathHit>& hits, const DenseTables* tables, std::vector<NearField<3>>& fields) {
    float sum = 0;
    for (int i = 0; i < hit_count; ++i) {
        const PathHit& hit = hits[std::size_t(i)];
        fields[std::size_t(i)] = near_field(make_fibre(hit.textured, tables), hit.known, hit.h);
    }
    for (int i = 0; i < hit_count; ++i) {
        const float(&u)[5] = hits[std::size_t(i)].u;
        const Sample<3> s = fields[std::size_t(i)].sample({u[0], u[1], u[2], u[3], u[4]});
        sum += s.pdf + s.value[0] + s.direction.x;
    }
    for (int i = 0; i < hit_count; ++i) {
        const Evaluation<3> e = fields[std::size_t(i)].evaluate(hits[std::size_t(i)].light);
        sum += e.pdf + e.value[1];
    }
    return sum;
}

/// Relative L2 of a value against another one over the hits.
template <class Value, class Exact>
double error_of(const std::vector<PathHit>& hits, Value&& value, Exact&& exact) {
    double difference = 0, norm = 0;
    for (const PathHit& hit : hits) {
        const double a = value(hit), b = exact(hit);
        difference += (a - b) * (a - b), norm += b * b;
    }
    return std::sqrt(difference / norm);
}

/// The paper's five lobes against the reference implementation in double, which reads the pack's factors.
double near_error(const std::vector<PathHit>& hits, FurParameters<3> PathHit::*parameters, const DenseTables* tables) {
    const reference::Factors factors(default_pack(), (hits[0].*parameters).scattering);
    return error_of(
        hits,
        [&](const PathHit& hit) {
            const NearField<3> field = near_field(make_fibre(hit.*parameters, tables), hit.known, hit.h);
            const float phi = angles_of(hit.light).phi - angles_of(hit.known).phi;
            const LobeMask five = all_lobes ^ lobe_bit(Lobe::residual);
            return double(angular_density(field.lobes(angles_of(hit.light).theta, phi), five)[0]);
        },
        [&](const PathHit& hit) {
            const Angles known = angles_of(hit.known), light = angles_of(hit.light);
            const auto lobes =
                reference::near_lobes(hit.*parameters, &factors, double(known.theta), double(light.theta),
                                      double(light.phi) - double(known.phi), double(hit.h));
            double sum = 0;
            for (int k = 0; k < 5; ++k) sum += lobes.M[k] * lobes.N[k][0];
            return sum;
        });
}

/// A mean over offsets against the near field at 20,000 of them, which is within 1e-6 of it (50,000 give the same).
template <class Range>
double mean_error(const std::vector<PathHit>& hits, const Fibre<3>& fibre, Range&& range) {
    const std::vector<PathHit> some(hits.begin(), hits.begin() + 100);
    return error_of(
        some, [&](const PathHit& hit) { return double(far_field(fibre, hit.known, range(hit)).value(hit.light)[0]); },
        [&](const PathHit& hit) {
            constexpr int offsets = 20000;
            const Offsets r = range(hit);
            double sum = 0;
            for (int k = 0; k < offsets; ++k) {
                const float h = r.low + (r.high - r.low) * (float(k) + 0.5f) / float(offsets);
                sum += double(near_field(fibre, hit.known, h).value(hit.light)[0]);
            }
            return sum / offsets;
        });
}

std::vector<bench::KernelFigures> gpu_figures() {
    const std::string nvcc = bench::find_nvcc();
    if (nvcc.empty()) return {};
    return bench::ptxas_figures(nvcc, MEDULLA_SOURCE "/bench/vertex_kernel.cu", MEDULLA_SOURCE "/runtime/include");
}

}  // namespace

int main(int argc, char** argv) {
    bool json = false, gpu = true;
    double seconds = 6;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--json") == 0)
            json = true;
        else if (std::strcmp(argv[i], "--no-gpu") == 0)
            gpu = false;
        else if (std::strcmp(argv[i], "--seconds") == 0 && i + 1 < argc)
            seconds = std::atof(argv[++i]);
        else
            return std::fprintf(stderr, "usage: bench_vertex [--json] [--seconds S] [--no-gpu]\n"), 2;
    }
    const std::vector<PathHit> hits = random_hits();
    TableRanges ranges = ranges_of(hits[0].coat), wide = ranges;
    for (const PathHit& hit : hits) wide = join(wide, ranges_of(hit.textured_medulla));
    const test::OwnedTables one(default_pack(), ranges), textured(default_pack(), wide),
        corrected(default_pack(), ranges_of(hits[0].corrected));
    for (const test::OwnedTables* tables : {&one, &textured, &corrected})
        if (tables->status() != TablesStatus::ok) return std::fprintf(stderr, "%s\n", describe(tables->status())), 1;
    const Fibre<3> coat = make_fibre(hits[0].coat, one.get());
    const auto near_row = [&hits](FurParameters<3> PathHit::*parameters, const DenseTables* tables) {
        return [&hits, parameters, tables](int i) {
            const PathHit& hit = hits[std::size_t(i)];
            return vertex(near_field(make_fibre(hit.*parameters, tables), hit.known, hit.h), hit);
        };
    };
    std::vector<NearField<3>> fields(hit_count);

    bench::VertexTimes times(hit_count);
    times.add("one coat, near", near_row(&PathHit::coat, one.get()), near_error(hits, &PathHit::coat, one.get()));
    // The reference takes an integral over theta_r for every hit.
    times.add("corrected coat, near", near_row(&PathHit::corrected, corrected.get()),
              near_error({hits.begin(), hits.begin() + 100}, &PathHit::corrected, corrected.get()));
    times.add("textured medulla, near", near_row(&PathHit::textured_medulla, textured.get()),
              near_error(hits, &PathHit::textured_medulla, textured.get()));
    times.add("textured colour, near", near_row(&PathHit::textured_colour, one.get()),
              near_error(hits, &PathHit::textured_colour, one.get()));
    times.add(
        "far",
        [&](int i) {
            const PathHit& hit = hits[std::size_t(i)];
            return vertex(far_field(make_fibre(hit.coat, one.get()), hit.known), hit);
        },
        mean_error(hits, coat, [](const PathHit&) { return Offsets{}; }));
    times.add(
        "interval",
        [&](int i) {
            const PathHit& hit = hits[std::size_t(i)];
            return vertex(far_field(make_fibre(hit.coat, one.get()), hit.known, hit.interval), hit);
        },
        mean_error(hits, coat, [](const PathHit& hit) { return hit.interval; }));
    times.add_block(
        "batch of 1024", hit_count, [&](int, int) { return batch(hits, textured.get(), fields); },
        near_error(hits, &PathHit::textured, textured.get()));
    const auto model_row = [&](const char* name, auto&& field) {
        times.add(name, [&hits, field](int i) {
            const PathHit& hit = hits[std::size_t(i)];
            return vertex(field(hit), hit);
        });
    };
    model_row("Kajiya-Kay", [](const PathHit& hit) { return far_field(kajiya_kay_of(hit, false), hit.known); });
    model_row("Kajiya-Kay, normalised",
              [](const PathHit& hit) { return far_field(kajiya_kay_of(hit, true), hit.known); });
    model_row("Kim", [](const PathHit& hit) { return far_field(kim_of(hit), hit.known); });
    model_row("Marschner", [](const PathHit& hit) { return far_field(marschner_of(hit), hit.known); });
    model_row("Zinke, near",
              [](const PathHit& hit) { return near_field(hair_of<models::Zinke<3>>(hit), hit.known, hit.h); });
    model_row("Zinke, far", [](const PathHit& hit) { return far_field(hair_of<models::Zinke<3>>(hit), hit.known); });
    model_row("d'Eon", [](const PathHit& hit) { return far_field(hair_of<models::DEon<3>>(hit), hit.known); });
    const auto bobcat = models::parameters_of<3>(models::yan2015_presets[0]);
    const test::OwnedTables double_cylinder(default_pack(), ranges_of(bobcat));
    model_row("Yan 2015, near", [bobcat, tables = double_cylinder.get()](const PathHit& hit) {
        return near_field(bobcat, tables, hit.known, hit.h);
    });
    model_row("hair (Chiang-style)",
              [](const PathHit& hit) { return near_field(hair_of<models::Chiang<3>>(hit), hit.known, hit.h); });
    times.run(seconds);

    const std::vector<bench::KernelFigures> kernels = gpu ? gpu_figures() : std::vector<bench::KernelFigures>();
    if (!json) {
        times.print_table();
        for (const bench::KernelFigures& k : kernels)
            std::printf("%s, %s: %d registers, %d bytes of stack, %d bytes spilled a thread\n", k.name.c_str(),
                        k.architecture.c_str(), k.registers, k.stack_bytes, k.spilled_bytes);
        if (gpu && kernels.empty()) std::printf("no figures of a GPU: no nvcc found, or it failed\n");
        return 0;
    }
    std::printf("{");
    times.print_json();
    std::printf(", \"gpu\": [");
    for (const bench::KernelFigures& k : kernels)
        std::printf(
            "%s\n  {\"kernel\": \"%s\", \"architecture\": \"%s\", \"registers\": %d, \"stack_bytes\": %d, "
            "\"spilled_bytes\": %d}",
            &k == &kernels.front() ? "" : ",", k.name.c_str(), k.architecture.c_str(), k.registers, k.stack_bytes,
            k.spilled_bytes);
    std::printf("]}\n");
    return 0;
}
