// Hits on baked fibres: energy, sample against pdf, values against light in the fibre, near against far, symmetry.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "sim3d/fibre_tracer.hpp"
#include "sim3d/model/five_lobes.hpp"
#include "tests/support/small_bake.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;
using test::baked_preset;

namespace {

struct Random {
    std::mt19937_64 engine;
    float uniform() { return float(engine() >> 40) * 0x1p-24f; }
    RandomNumbers numbers() {
        RandomNumbers u;
        u.lobe = uniform(), u.azimuth = uniform(), u.longitude = uniform(), u.rows = uniform(), u.offset = uniform();
        return u;
    }
};

BakedMaterial opened(const char* preset) {
    const auto& bytes = baked_preset(preset);
    const BakedResult result = open_baked(bytes.data(), bytes.size());
    REQUIRE(result.status == BakedStatus::ok);
    return result.material;
}

constexpr int rows = 20, columns = 24;

/// p-value of samples in bins of equal (theta, phi) against the pdf's integral over them.
template <class Field>
double chi_squared(const Field& field, Random& r, int samples, int split, float scale = 1) {
    std::vector<double> share, counts(rows * columns, 0.0);
    const detail::GaussRule rule = detail::gauss_rule(0);
    for (int i = 0; i < rows; ++i)
        for (int j = 0; j < columns; ++j) {
            double sum = 0;
            for (int n = 0; n < split * split; ++n)
                for (int a = 0; a < 2 * rule.half; ++a)
                    for (int b = 0; b < 2 * rule.half; ++b) {
                        const double x = a & 1 ? double(rule.x[a / 2]) : -double(rule.x[a / 2]),
                                     y = b & 1 ? double(rule.x[b / 2]) : -double(rule.x[b / 2]);
                        const double theta = pi * ((i + (n / split + 0.5 + 0.5 * x) / split) / rows - 0.5),
                                     phi = pi * (2 * (j + (n % split + 0.5 + 0.5 * y) / split) / columns - 1);
                        sum += double(rule.w[a / 2]) * double(rule.w[b / 2]) / 4 * std::cos(theta) *
                               double(field.pdf(Angles{float(theta), float(phi)}));
                    }
            share.push_back(sum / (split * split) * (pi / rows) * (2 * pi / columns));
        }
    // Broken on purpose by a caller that expects a failure.
    for (std::size_t i = 0; i < share.size() / 2; ++i) share[i] *= double(scale);
    int valid = 0;
    for (int s = 0; s < samples; ++s) {
        const Sample<3> x = field.sample(r.numbers());
        if (!x.valid) continue;
        ++valid;
        const int i = std::clamp(int((double(x.angles.theta) / pi + 0.5) * rows), 0, rows - 1),
                  j = std::clamp(int((double(x.angles.phi) / pi + 1) / 2 * columns), 0, columns - 1);
        ++counts[std::size_t(i * columns + j)];
    }
    return test::chi_squared_p(counts, share, valid);
}

}  // namespace

TEST_CASE("baked fibre, energy: a white fibre keeps all of it", "[baked]") {
    // sigma_ma of the dog is 0; each sample's weight is then the energy of the whole hit, for one channel.
    const BakedMaterial dog = opened("dog");
    const float white[1] = {0};
    const BakedFibre<1> fibre = make_fibre(dog, white);
    Random r;
    for (int i = 0; i < 200; ++i) {
        const Angles known = {1.5f * (2 * r.uniform() - 1), 6.28f * r.uniform()};
        const BakedNear<1> near = near_field(fibre, known, 2 * r.uniform() - 1);
        const Sample<1> s = near.sample(r.numbers());
        REQUIRE(s.valid);
        CHECK(s.weight[0] == Approx(1).margin(2e-5));  // float sums of 40 terms, and of their quotients
        // The far field's lobes keep 1 - 1e-5 (kept_of_average); R's mean over 24 offsets is the rest.
        const BakedFar<1> far = far_field(fibre, known);
        double sum = double(far.scattered_energy()[0]);
        CHECK(sum > 0.3);
        CHECK(sum < 1);
    }
}

TEST_CASE("baked fibre, energy: the far field's mean", "[baked]") {
    const BakedMaterial dog = opened("dog");
    const float white[1] = {0};
    const BakedFibre<1> fibre = make_fibre(dog, white);
    Random r;
    for (const float theta : {0.0f, -0.7f, 1.2f}) {
        const BakedFar<1> far = far_field(fibre, Angles{theta, 0.3f});
        double mean = 0, square = 0;
        constexpr int count = 40000;
        for (int i = 0; i < count; ++i) {
            const Sample<1> s = far.sample(r.numbers());
            const double w = s.valid ? double(s.weight[0]) : 0;
            mean += w / count, square += w * w / count;
        }
        const double error = std::sqrt((square - mean * mean) / count);
        CHECK(std::abs(mean - 1) < 4 * error + 1e-3);  // closed forms of R over 24 nodes against the far quadrature's
    }
}

TEST_CASE("baked fibre, absorption darkens, and an infinite one leaves R", "[baked]") {
    const BakedMaterial fox = opened("red_fox");
    const Angles known = {0.4f, 0};
    float before = 2;
    for (const float sigma : {0.0f, 0.01f, 0.1f, 0.5f, 1.0f, 2.0f, 4.0f, 6.0f}) {
        const float colour[1] = {sigma};
        const float energy = near_field(make_fibre(fox, colour), known, 0.3f).scattered_energy()[0];
        CHECK(energy < before);
        before = energy;
    }
    const float black[1] = {1e6f};
    CHECK(near_field(make_fibre(fox, black), known, 0.3f).scattered_energy()[0] < 1e-6f);
}

TEST_CASE("baked fibre, samples have the density that pdf says", "[baked]") {
    Random r;
    for (const char* preset : {"red_fox", "human"}) {
        const BakedMaterial material = opened(preset);
        const float colour[3] = {0.1f, 0.4f, 1.5f};
        const BakedFibre<3> fibre = make_fibre(material, colour);
        for (const float theta : {0.5f, -1.1f}) {
            const Angles known = {theta, 0};
            CHECK(chi_squared(near_field(fibre, known, preset[0] == 'h' ? 0.2f : -0.6f), r, 100000, 4) > 1e-4);
            CHECK(chi_squared(far_field(fibre, known), r, 50000, 2) > 1e-4);
        }
        CHECK(chi_squared(far_field(fibre, Angles{0.2f, 0}, Offsets{-0.1f, 0.3f}), r, 50000, 2) > 1e-4);
        // A pdf that is 10 % off on one half of the sphere is found out.
        CHECK(chi_squared(near_field(fibre, Angles{0.5f, 0}, 0.1f), r, 100000, 2, 1.1f) < 1e-4);
    }
}

TEST_CASE("baked fibre, a sample says what value and pdf say", "[baked]") {
    const BakedMaterial fox = opened("red_fox");
    const BakedFibre<3> fibre = make_fibre(fox);
    Random r;
    for (int i = 0; i < 2000; ++i) {
        const Angles known = {1.4f * (2 * r.uniform() - 1), 6.28f * r.uniform()};
        const BakedNear<3> hit = near_field(fibre, direction_of(known), 2 * r.uniform() - 1);
        const Sample<3> s = hit.sample(r.numbers());
        REQUIRE(s.valid);
        const Evaluation<3> e = hit.evaluate(s.direction);
        CHECK(e.pdf == Approx(s.pdf).epsilon(1e-3));
        for (int c = 0; c < 3; ++c) {
            CHECK(e.value[c] == Approx(s.value[c]).epsilon(1e-3));
            CHECK(s.weight[c] <= 3.001f);  // the pdf is the mean of the channels
        }
    }
}

TEST_CASE("baked fibre, light at -h is the mirror image", "[baked]") {
    const BakedMaterial fox = opened("red_fox");
    const BakedFibre<3> fibre = make_fibre(fox);
    for (const float h : {0.1f, 0.5f, 0.95f})
        for (const float phi : {0.3f, 1.4f, 3.0f}) {
            const Angles known = {0.6f, 0};
            const BakedNear<3> a = near_field(fibre, known, h), b = near_field(fibre, known, -h);
            CHECK(a.value(Angles{0.2f, phi})[1] == Approx(b.value(Angles{0.2f, -phi})[1]).epsilon(1e-4));
        }
}

TEST_CASE("baked fibre, the far field is the mean of near fields", "[baked]") {
    const BakedMaterial fox = opened("red_fox");
    const BakedFibre<3> fibre = make_fibre(fox);
    for (const Offsets range : {Offsets{}, Offsets{-0.2f, 0.6f}}) {
        const Angles known = {-0.5f, 0};
        const BakedFar<3> far = far_field(fibre, known, range);
        double difference = 0, norm = 0;
        for (int i = 0; i < 12; ++i)
            for (int j = 0; j < 16; ++j) {
                const float theta = float(pi * ((i + 0.5) / 12 - 0.5)), phi = float(2 * pi * ((j + 0.5) / 16 - 0.5));
                double mean = 0;
                constexpr int offsets = 400;
                for (int n = 0; n < offsets; ++n) {
                    const float h = range.low + (range.high - range.low) * (float(n) + 0.5f) / offsets;
                    mean += double(near_field(fibre, known, h).scattered_density(theta, phi)[1]) / offsets;
                }
                const double value = double(far.scattered_density(theta, phi)[1]);
                difference += (value - mean) * (value - mean), norm += mean * mean;
            }
        CHECK(std::sqrt(difference / norm) < 0.02);  // eight offsets, of coefficients that are linear between five
    }
}

TEST_CASE("baked fibre, values against light in the fibre", "[baked]") {
    const BakedMaterial fox = opened("red_fox");
    // Paths of another seed, at lights that are neither nodes nor checks; the error stated is that of independent
    // checks.
    tables::FibreRequest request = test::small_fibre("red_fox");
    request.seed = 99, request.checks = 3, request.check_paths = 150000;
    tables::FibreLight light = tables::plan_of(request);
    for (std::size_t i = 0; i < light.checks.size(); ++i)
        light.checks[i] = tables::simulate_cell(light, light.cells.size() + i);
    const tables::BakeErrors errors =
        tables::errors_against(fox, light.checks, light.check_sigma_ca, request.rows, request.columns);
    CHECK(errors.lobes == 9);
    CHECK(errors.median < 1.5 * double(fox.header.worst_error));
    CHECK(errors.median < 0.12);
    for (const tables::LightCell& cell : light.checks) {
        const float white[1] = {0};
        const BakedNear<1> hit = near_field(make_fibre(fox, white), Angles{float(cell.theta_i), 0}, float(cell.h));
        // Without absorption in the cortex; sigma_ma is baked. Energies of R and of what entered: nodes are 42 degrees
        // and a quarter of the fibre's width apart.
        const double R = double(hit.part[0].A[0][0]);
        CHECK(R == Approx(cell.R).margin(0.04));
    }
}

TEST_CASE("baked fibre, bad input is black", "[baked]") {
    const BakedMaterial fox = opened("red_fox");
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float bad[3] = {nan, 0, 0}, good[3] = {0.1f, 0.2f, 0.3f};
    CHECK(make_fibre(fox, bad).fibre.status == FibreStatus::bad_parameters);
    CHECK(near_field(make_fibre(fox, bad), Angles{0.1f, 0}, 0.1f).value(Angles{0.1f, 0})[0] == 0);
    const BakedFibre<3> fibre = make_fibre(fox, good);
    CHECK(fibre.fibre.status == FibreStatus::ok);
    CHECK(!near_field(fibre, Vector{1, 0, 0}, 0.1f).sample({}).valid);
    CHECK(!near_field(fibre, Angles{0.1f, 0}, nan).sample({}).valid);
    CHECK(!far_field(fibre, Angles{0.1f, 0}, Offsets{0.5f, -0.5f}).sample({}).valid);
    CHECK(far_field(fibre, Angles{nan, 0}).value(Angles{0.1f, 0})[0] == 0);
    CHECK(!near_field(make_fibre(BakedMaterial{}, good), Angles{0.1f, 0}, 0.1f).sample({}).valid);
}
