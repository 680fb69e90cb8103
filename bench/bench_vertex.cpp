// A path vertex in nanoseconds, beside a plain hair BCSDF (chiang_hair.hpp) in the same process: make the fibre ready,
// take the hit's field, draw a direction with value and pdf, evaluate value and pdf for one light direction.
// Run: bench_vertex [--json] [--seconds S]; --json prints JSON instead of the table. With an nvcc it adds what
// vertex_kernel.cu needs of a GPU thread.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "chiang_hair.hpp"
#include "medulla/medulla.hpp"
#include "vertex_timing.hpp"

using namespace medulla;

namespace {

constexpr int hit_count = 1024;

/// What a path tracer brings to a vertex.
struct PathHit {
    chiang::Vector known, light;  ///< unit, away from the fibre; x along the fibre
    float h;
    float u[5];
    float sigma_ca[3];
};

/// Known directions as rays meet a fibre (in proportion to the width it shows them), h, light and numbers even.
std::vector<PathHit> random_hits() {
    std::mt19937 engine(1);
    std::uniform_real_distribution<float> uniform(0, 1);
    const auto direction = [&](bool seen) {
        for (;;) {
            const float x = 2 * uniform(engine) - 1, c = std::sqrt((1 - x) * (1 + x)), turn = uniform(engine);
            const float phi = 2 * float(pi) * turn;
            if (!seen || uniform(engine) < c) return chiang::Vector{x, c * std::cos(phi), c * std::sin(phi)};
        }
    };
    std::vector<PathHit> hits(hit_count);
    for (PathHit& hit : hits) {
        hit.known = direction(true), hit.light = direction(false);
        hit.h = 2 * uniform(engine) - 1;
        for (float& u : hit.u) u = uniform(engine);
        for (float& s : hit.sigma_ca) s = uniform(engine);
    }
    return hits;
}

float chiang_vertex(const PathHit& hit) {
    const chiang::Hair hair(1.55f, hit.sigma_ca, 0.3f, 0.3f, 0.0349f);
    const chiang::Hit at(hair, hit.known, hit.h);
    const float u[4] = {hit.u[0], hit.u[1], hit.u[2], hit.u[3]};
    const chiang::Sample s = at.sample(u);
    const chiang::Evaluation e = at.evaluate(hit.light);
    return s.pdf + s.value.value[0] + s.direction.x + e.pdf + e.value.value[1];
}

float inclination_of(const chiang::Vector& w) { return std::asin(std::min(1.0f, std::max(-1.0f, -w.x))); }

/// One material with dense tables, by the angles of Eq. 12.
float near_vertex(const FurFibre<3>& fibre, const PathHit& hit) {
    NearField<3> field;
    near_field(fibre, inclination_of(hit.known), hit.h, field);
    NearSampler<3> sampler;
    sampler.prepare(field);
    RandomNumbers u;
    u.lobe = hit.u[0], u.azimuth = hit.u[1], u.azimuth2 = hit.u[2], u.longitude = hit.u[3];
    const FurSample<3> s = sampler.sample(u);
    const float theta_r = inclination_of(hit.light);
    const float phi = wrap_angle(std::atan2(hit.light.z, hit.light.y) - std::atan2(hit.known.z, hit.known.y));
    return s.pdf + s.weight[0] + s.phi + sampler.pdf(theta_r, phi) + density(field, theta_r, phi).value[1];
}

}  // namespace

int main(int argc, char** argv) {
    bool json = false;
    double seconds = 4;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--json") == 0)
            json = true;
        else if (std::strcmp(argv[i], "--seconds") == 0 && i + 1 < argc)
            seconds = std::atof(argv[++i]);
        else
            return std::fprintf(stderr, "usage: bench_vertex [--json] [--seconds S]\n"), 2;
    }
    const std::vector<PathHit> hits = random_hits();
    FurFibre<3> fibre;
    prepare(parameters_of<3>(*find_preset("bobcat")), open_pack(default_pack_words, default_pack_size).pack, fibre);
    const auto tables = std::make_unique<UnfoldedTables>();
    if (!unfold(fibre, *tables)) return std::fprintf(stderr, "the default pack has no dense tables\n"), 1;

    bench::VertexTimes times(hit_count);
    times.add("one coat, near", [&](int i) { return near_vertex(fibre, hits[std::size_t(i)]); });
    times.add("hair (Chiang-style)", [&](int i) { return chiang_vertex(hits[std::size_t(i)]); });
    times.run(seconds);
    if (json)
        times.print_json();
    else
        times.print_table();
    return 0;
}
