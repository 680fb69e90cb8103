// The output of `furtable export --format glsl`, compiled as C++ with a small vec4 and compared with the runtime: the
// same sums in the same order give the same bits; only 1 - exp(-x) has another formula. Shaders use the signed
// contraction. glsl_values ABSORBING.furpack
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

#include "medulla/medulla.hpp"

namespace {

std::vector<unsigned char> absorbing;

std::uint32_t word_of(const void* pack, int i) {
    std::uint32_t word;
    std::memcpy(&word, static_cast<const unsigned char*>(pack) + 4 * i, sizeof word);
    return word;
}

}  // namespace

namespace glsl {

using uint = std::uint32_t;
using std::exp, std::floor, std::sqrt;

struct vec4 {
    float x, y, z, w;
};
vec4 operator+(vec4 a, vec4 b) { return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w}; }
vec4 operator*(vec4 a, vec4 b) { return {a.x * b.x, a.y * b.y, a.z * b.z, a.w * b.w}; }
vec4 operator*(float s, vec4 a) { return {s * a.x, s * a.y, s * a.z, s * a.w}; }
float uintBitsToFloat(uint bits) {
    float x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}

// In place of the embedded arrays, which tests/programs.py compares with the pack.
#define BUILT_IN_WORD(i) word_of(medulla::default_pack_words, i)
#define ABSORBING_WORD(i) word_of(absorbing.data(), i)
#include "absorbing.glsl"
#include "built_in.glsl"

}  // namespace glsl

namespace {

using namespace medulla;

int failures = 0;
double worst = 0;  // relative difference where the formulas differ

void same(const char* what, float expected, float found) {
    if (std::memcmp(&expected, &found, sizeof found) == 0 || (expected == 0 && found == 0)) return;
    if (failures++ < 10) std::printf("%s: expected %.9g, found %.9g\n", what, double(expected), double(found));
}

/// 4e-7: rounding of exp(-x) where 1 - exp(-x) is 0.22, and of the five products around it.
void near(const char* what, float expected, float found) {
    const double off = std::abs(double(found) / double(expected) - 1);
    if (expected == found) return;
    worst = std::fmax(worst, off);
    if (off > 4e-7) same(what, expected, found);
}

}  // namespace

int main(int, char** argv) {
    std::ifstream file(argv[1], std::ios::binary);
    absorbing.assign(std::istreambuf_iterator<char>(file), {});
    const OpenResult plain = open_pack(default_pack_words, default_pack_size);
    const OpenResult opened = open_pack(absorbing.data(), absorbing.size());
    if (plain.status != PackStatus::ok || opened.status != PackStatus::ok || !absorbs(opened.pack)) {
        std::printf("no packs\n");
        return 1;
    }
    std::mt19937 random(1);
    const auto uniform = [&](float low, float high) {
        return low + (high - low) * float(random() >> 8) / float(1 << 24);
    };
    const int count = 20000;
    for (int i = 0; i < count; ++i) {
        // Some outside the axes, at their ends, beyond a full turn, or on a node.
        const float sigma = i % 7 == 0 ? 0.0f : uniform(0, 20) * uniform(0, 1),
                    g = i % 11 == 0 ? 0.95f : uniform(-0.1f, 0.97f);
        const float h = i % 13 == 0 ? 1.0f : uniform(-1, 1), phi = uniform(-20, 20), absorption = uniform(0, 3);
        const float theta_i = i % 17 == 0 ? float(pi / 2) : uniform(-1.57f, 1.57f), theta_r = uniform(-1.57f, 1.57f);
        LobeQuery query;
        query.sigma = sigma, query.g = g, query.h = std::abs(h);
        const TableView& table = plain.pack[TableKind::azimuthal];
        same("lobe", lobe(table, contract_signed(table, query), phi),
             glsl::built_in_lobe(glsl::built_in_AZIMUTHAL,
                                 glsl::built_in_contract(glsl::built_in_AZIMUTHAL, {sigma, g, 0, std::abs(h)}), phi));
        const float sign = h < 0 ? -1.0f : 1.0f;
        const auto of_disc = [&](const PackView& pack) {
            const TableView& disc = pack[TableKind::azimuthal];
            return azimuthal_energy(sigma, h) * survival(pack, sigma, g, h, query.absorption) *
                   lobe(disc, contract_signed(disc, query), sign * phi);
        };
        near("azimuthal", of_disc(plain.pack), glsl::built_in_azimuthal(sigma, g, h, phi));
        query.theta_i = std::abs(theta_i);
        for (const TableKind kind : {TableKind::longitudinal_back, TableKind::longitudinal_forward}) {
            const TableView& slab = plain.pack[kind];
            same("longitudinal", lobe(slab, contract_signed(slab, query), theta_i < 0 ? -theta_r : theta_r),
                 glsl::built_in_longitudinal(kind == TableKind::longitudinal_forward, sigma, g, theta_i, theta_r));
        }
        const TableView& shares = plain.pack[TableKind::back_fraction];
        same("back_fraction", scalar(shares, contract(shares, query)), glsl::built_in_back_fraction(sigma, g, theta_i));
        same("survival", survival(opened.pack, sigma, g, h, absorption),
             glsl::absorbing_survival(sigma, g, h, absorption));
        query.absorption = absorption;
        near("azimuthal, absorbing", of_disc(opened.pack), glsl::absorbing_azimuthal(sigma, g, h, phi, absorption));
    }
    std::printf("%d queries, %d differ from the runtime; largest difference by 1 - exp(-x) %.1e\n", count, failures,
                worst);
    return failures == 0 ? 0 : 1;
}
