// sample against pdf: chi-squared over random furs, a broken pdf that must fail, weights, every random number's ends.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fibre_of.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;
using analytic::pack;
using test::FibreOf;
using test::shipped;

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

FurParameters<3> random_fur(Random& r, int i) {
    FurParameters<3> p = parameters_of<3>(fur_presets[i % fur_preset_count]);
    p.g = std::min(p.g, 0.6f);
    p.scattering = i % 3 == 1 ? Scattering::corrected : Scattering::published;
    if (i % 2 == 0) return p;
    p.eta = 1.01f + 1.49f * r.uniform(), p.kappa = r.uniform(), p.layers = 5 * r.uniform();
    p.beta_n = 0.05f * std::pow(20.0f, r.uniform()), p.beta_m = 0.05f * std::pow(20.0f, r.uniform());
    p.sigma_ms = 5 * r.uniform(), p.sigma_ma = r.uniform() * r.uniform(), p.sigma_ca[0] = r.uniform();
    p.g = 1.2f * r.uniform() - 0.6f;
    return p;
}

/// A fibre's own tables or, for every other two cases, those of a coat whose g and sigma come from textures.
FibreOf<3> random_fibre(const FurParameters<3>& p, const PackView& view, int i) {
    TableRanges ranges = ranges_of(p);
    if (i % 4 > 1) {
        ranges.g_low = std::max(-0.9f, p.g - 0.3f), ranges.g_high = std::min(0.9f, p.g + 0.2f);
        ranges.sigma_low *= 0.5f, ranges.sigma_high *= 1.5f;
    }
    return FibreOf<3>(p, view, ranges);
}

constexpr int rows = 24, columns = 32;

/// Expected share of each bin, in coordinates (theta, phi), by 8 Gauss nodes a side in `split` pieces a side.
/// @param pdf per steradian
template <class Pdf>
std::vector<double> expected_shares(Pdf&& pdf, int split) {
    std::vector<double> share(rows * columns, 0.0);
    const detail::GaussRule rule = detail::gauss_rule(0);
    for (int i = 0; i < rows * split; ++i)
        for (int j = 0; j < columns * split; ++j) {
            double sum = 0;
            for (int a = 0; a < 2 * rule.half; ++a)
                for (int b = 0; b < 2 * rule.half; ++b) {
                    const double x = a & 1 ? double(rule.x[a / 2]) : -double(rule.x[a / 2]),
                                 y = b & 1 ? double(rule.x[b / 2]) : -double(rule.x[b / 2]);
                    const double theta = pi * ((i + 0.5 + 0.5 * x) / (rows * split) - 0.5),
                                 phi = pi * (2 * (j + 0.5 + 0.5 * y) / (columns * split) - 1);
                    sum += double(rule.w[a / 2]) * double(rule.w[b / 2]) / 4 * std::cos(theta) *
                           double(pdf(float(theta), float(phi)));
                }
            share[std::size_t((i / split) * columns + j / split)] +=
                sum * (pi / (rows * split)) * (2 * pi / (columns * split));
        }
    return share;
}

/// p-value of `counts` against `share`; bins of fewer than 10 expected are pooled.
double chi_squared(const std::vector<double>& share, const std::vector<int>& counts, int samples) {
    double statistic = 0, pooled = 0, seen = 0;
    int degrees = -1;
    for (std::size_t i = 0; i < share.size(); ++i) {
        const double e = share[i] * samples;
        if (e < 10) {
            pooled += e, seen += counts[i];
            continue;
        }
        statistic += (counts[i] - e) * (counts[i] - e) / e, ++degrees;
    }
    if (pooled > 10) statistic += (seen - pooled) * (seen - pooled) / pooled, ++degrees;
    return degrees > 0 ? test::chi_squared_tail(statistic, degrees) : 1;
}

struct Drawn {
    std::vector<int> counts = std::vector<int>(rows * columns, 0);
    float largest_weight = 0;
    double mean_weight = 0;
};

template <class Field>
Drawn draw(const Field& field, Random& r, int samples) {
    Drawn d;
    int invalid = 0;
    for (int s = 0; s < samples; ++s) {
        const Sample<3> x = field.sample(r.numbers());
        invalid += !x.valid;
        const int i = std::min(rows - 1, int((double(x.angles.theta) / pi + 0.5) * rows)),
                  j = std::min(columns - 1, std::max(0, int((double(x.angles.phi) / pi + 1) / 2 * columns)));
        ++d.counts[std::size_t(std::max(0, i) * columns + j)];
        for (float w : x.weight.value) d.largest_weight = std::max(d.largest_weight, w);
        d.mean_weight += double(x.weight[0]) / samples;
    }
    CHECK(invalid == 0);
    return d;
}

int from_environment(const char* name, int otherwise) {
    const char* text = std::getenv(name);
    return text ? std::atoi(text) : otherwise;
}

/// A weight is at most each lobe's energy over its probability, and so at most the number of channels.
template <int Channels>
float greatest_weight(const NearField<Channels>& near) {
    float greatest = 0;
    for (const auto& A : near.A)
        for (int c = 0; c < Channels && A[near.lanes - 1] > 0; ++c)
            greatest = std::max(greatest, A[c] / A[near.lanes - 1]);
    return greatest;
}

}  // namespace

TEST_CASE("near samples pass chi-squared with Sidak's correction, a broken pdf fails", "[bcsdf]") {
    const int cases = from_environment("MEDULLA_CHI_CASES", 8),
              samples = from_environment("MEDULLA_CHI_SAMPLES", 100000);
    const double level = 1 - std::pow(1 - 0.01, 1.0 / cases);
    Random r{std::mt19937_64(11)};
    int passed = 0, broken_caught = 0, textured = 0;
    float largest = 0;
    for (int i = 0; i < cases; ++i) {
        const FibreOf<3> fibre = random_fibre(random_fur(r, i), i % 3 ? pack().view : shipped(), i);
        textured += fibre.tables->g_rows > 1;
        const NearField<3> near =
            near_field(fibre, Angles{i % 8 == 7 ? 1.52f : 2.8f * (r.uniform() - 0.5f), 0}, 2 * r.uniform() - 1);
        const Drawn d = draw(near, r, samples);
        const auto expected = expected_shares([&](float t, float f) { return near.pdf(Angles{t, f}); }, 4);
        double whole = 0;
        for (double x : expected) whole += x;
        CHECK(whole == Approx(1).epsilon(2e-4));  // Gauss nodes against kinks at the tables' knots
        const double value = chi_squared(expected, d.counts, samples);
        if (value > level)
            ++passed;
        else
            std::printf("near case %d: p-value %.2g\n", i, value);
        // Broken: lobe R is said to be half as likely as it is drawn (its share goes to the others).
        NearField<3> broken = near;
        constexpr int share = NearField<3>::lanes - 1;
        const float moved = 0.5f * broken.A[0][share];
        broken.A[0][share] -= moved, broken.A[near.A[3][share] > 0 ? 3 : 1][share] += moved;
        const auto wrong = expected_shares([&](float t, float f) { return broken.pdf(Angles{t, f}); }, 3);
        if (!(chi_squared(wrong, d.counts, samples) > level)) ++broken_caught;
        CHECK(d.largest_weight <= greatest_weight(near) * 1.00001f);
        largest = std::max(largest, d.largest_weight);
        // The mean weight of channel 0 is its energy: 4 deviations of a mean of weights below 2.
        CHECK(d.mean_weight == Approx(double(near.albedo()[0])).margin(8 / std::sqrt(double(samples))));
    }
    CHECK(passed == cases);
    CHECK(textured >= cases / 4);
    CHECK(broken_caught >= cases - 1 - cases / 20);  // but where R itself is nearly absent
    CHECK(largest <= 3.00003f);                      // the number of channels
    std::printf("near: %d of %d pass chi-squared, %d of %d broken ones caught, largest weight %.3f\n", passed, cases,
                broken_caught, cases, double(largest));
}

TEST_CASE("far and interval samples pass chi-squared, a broken pdf fails", "[bcsdf]") {
    const int cases = from_environment("MEDULLA_CHI_CASES", 4),
              samples = from_environment("MEDULLA_CHI_SAMPLES", 40000);
    const double level = 1 - std::pow(1 - 0.01, 1.0 / cases);
    Random r{std::mt19937_64(12)};
    int passed = 0, broken_caught = 0, textured = 0;
    float largest = 0;
    for (int i = 0; i < cases; ++i) {
        const FibreOf<3> fibre = random_fibre(random_fur(r, i + 3), i % 3 ? pack().view : shipped(), i);
        textured += fibre.tables->g_rows > 1;
        const float low = i % 2 ? 1.9f * r.uniform() - 1 : -1, high = i % 2 ? low + (1 - low) * r.uniform() : 1;
        const Angles known = {2.4f * (r.uniform() - 0.5f), 0};
        const FarField<3> far = far_field(fibre, known, {low, high});
        const Drawn d = draw(far, r, samples);
        // The pdf is separable by lobe, but the test evaluates it as a renderer would: a coarser grid of nodes.
        const auto share = expected_shares(
            [&](float t, float f) {
                return far.pdf(Angles{t, f});
            },
            samples > 200000 ? 2 : 1);
        const double value = chi_squared(share, d.counts, samples);
        if (value > level)
            ++passed;
        else
            std::printf("far case %d: p-value %.2g\n", i, value);
        // Broken: the density of inclinations 0.1 away, a tenth of the widest lobe.
        const auto wrong = expected_shares(
            [&](float t, float f) {
                const float shifted = std::max(-1.5707f, t - 0.1f);
                return far.pdf(Angles{shifted, f}) * std::cos(shifted) / std::cos(t);
            },
            1);
        if (!(chi_squared(wrong, d.counts, samples) > level)) ++broken_caught;
        largest = std::max(largest, d.largest_weight);
        const FarField<3> exact = far_field(fibre, known, {low, high}, FarQuality::fine);
        double energy = 0;
        for (int j = 0; j < 256; ++j)
            for (const auto& N : exact.lobes(0.0f, float(pi * (2 * (j + 0.5) / 256 - 1))).N)
                energy += double(N[0]) * 2 * pi / 256;
        CHECK(d.mean_weight == Approx(energy).margin(8 / std::sqrt(double(samples))));  // as for near
    }
    CHECK(passed == cases);
    CHECK(textured >= cases / 4);
    CHECK(broken_caught == cases);
    CHECK(largest <= 3.00003f);  // the number of channels
    std::printf("far: %d of %d pass chi-squared, %d of %d broken ones caught, largest weight %.3f\n", passed, cases,
                broken_caught, cases, double(largest));
}

TEST_CASE("a grey fibre's weights are its albedo, near, and at most 1, far", "[bcsdf]") {
    Random r{std::mt19937_64(18)};
    for (int i = 0; i < 40; ++i) {
        FurParameters<3> p = random_fur(r, i);
        p.sigma_ca[0] = p.sigma_ca[1];
        const FibreOf<3> fibre = random_fibre(p, i % 3 ? pack().view : shipped(), i);
        const Angles known = {3.1f * (r.uniform() - 0.5f), 0};
        const NearField<3> near = near_field(fibre, known, 2 * r.uniform() - 1);
        const FarField<3> far = far_field(fibre, known);
        for (int s = 0; s < 200; ++s) {
            const Sample<3> x = near.sample(r.numbers());
            REQUIRE(x.valid);
            CHECK(double(x.weight[1]) == Approx(double(near.albedo()[1])).epsilon(1e-5));
            if (s % 10 == 0) CHECK(far.sample(r.numbers()).weight[1] <= 1.00001f);
        }
    }
}

TEST_CASE("a sample is what its direction evaluates to", "[bcsdf]") {
    Random r{std::mt19937_64(14)};
    for (int i = 0; i < 20; ++i) {
        const FurParameters<3> p = random_fur(r, i);
        const FibreOf<3> fibre = random_fibre(p, shipped(), i);
        const Vector known = direction_of(Angles{2.8f * (r.uniform() - 0.5f), 6 * r.uniform()});
        const float h = 2 * r.uniform() - 1;
        const NearField<3> near = near_field(fibre, known, h);
        const FarField<3> far = far_field(fibre, known, Offsets{-0.7f, 0.9f});
        const auto check = [&](const auto& field) {
            const Sample<3> s = field.sample(r.numbers());
            REQUIRE(s.valid);
            const double length = std::sqrt(std::pow(double(s.direction.x), 2) + std::pow(double(s.direction.y), 2) +
                                            std::pow(double(s.direction.z), 2));
            CHECK(length == Approx(1).epsilon(1e-6));
            CHECK(s.direction.x == Approx(-std::sin(s.angles.theta)).margin(1e-6));
            // 1e-6 of angle over the narrowest deviation, 0.023, at up to five deviations; next to the axis, phi is
            // what rounding leaves of it.
            const Evaluation<3> e = field.evaluate(s.direction);
            if (std::abs(s.direction.x) < 0.9999f) {
                CHECK(e.pdf == Approx(s.pdf).epsilon(4e-3));
                for (int c = 0; c < 3; ++c) CHECK(e.value[c] == Approx(s.value[c]).epsilon(4e-3).margin(1e-12));
            }
            for (int c = 0; c < 3; ++c) CHECK(s.weight[c] == Approx(s.value[c] / s.pdf).epsilon(1e-6));
        };
        for (int k = 0; k < 50; ++k) check(near);
        for (int k = 0; k < 5; ++k) check(far);
    }
}

TEST_CASE("every random number in [0, 1], both ends included, gives a direction", "[bcsdf]") {
    Random r{std::mt19937_64(19)};
    const float ends[] = {0.0f, 1e-38f, 0.5f, 0.99999994f, 1.0f};
    long drawn = 0;
    const auto check = [&](const auto& field, const char* what, const RandomNumbers& u) {
        const Sample<3> s = field.sample(u);
        const float length2 =
            s.direction.x * s.direction.x + s.direction.y * s.direction.y + s.direction.z * s.direction.z;
        const bool good = s.valid && std::abs(length2 - 1) < 1e-6f && s.pdf > 0 && s.pdf < 3.4e38f &&
                          s.weight[0] >= 0 && s.weight[0] < 3.0001f && s.weight[1] >= 0 && s.weight[1] < 3.0001f;
        if (!good)
            FAIL_CHECK(what << " lobe " << u.lobe << " azimuth " << u.azimuth << " longitude " << u.longitude
                            << " rows " << u.rows << " offset " << u.offset << ": valid " << s.valid << " from "
                            << lobe_names[int(s.lobe)] << " theta " << s.angles.theta << " pdf " << s.pdf);
        ++drawn;
    };
    for (int i = 0; i < 16; ++i) {
        const FibreOf<3> fibre = random_fibre(random_fur(r, i), i % 2 ? pack().view : shipped(), i);
        const Angles known = {i % 5 == 4 ? 1.5f : 2.8f * (r.uniform() - 0.5f), 0};
        const float h = i % 7 == 3 ? 0.0f : 2 * r.uniform() - 1;
        const NearField<3> near = near_field(fibre, known, h);
        const FarField<3> far = far_field(fibre, known, i % 3 ? Offsets() : Offsets{-0.2f, 0.8f});
        NearField<3> one[all_lobe_count];
        for (int k = 0; k < all_lobe_count; ++k) one[k] = near.keep(lobe_bit(static_cast<Lobe>(k)));
        for (int k = 0; k < 5 * 5 * 5 * 5; ++k) {
            RandomNumbers u;
            u.lobe = ends[k % 5], u.azimuth = ends[k / 5 % 5], u.longitude = ends[k / 25 % 5], u.rows = ends[k / 125];
            u.offset = ends[(k + k / 5) % 5];
            check(near, "near", u);
            for (int lobe = 0; lobe < all_lobe_count; ++lobe)
                if (one[lobe].A[lobe][NearField<3>::lanes - 1] > 0) check(one[lobe], lobe_names[lobe], u);
            if (k % 5 == i % 5 || i == 0) check(far, "far", u);
        }
        for (int k = 0; k < 5; ++k) {
            RandomNumbers u = r.numbers();
            u.offset = ends[k];
            check(far, "far", u);
        }
    }
    CHECK(drawn > 40000);
}

TEST_CASE("light that is sampled and directions that are drawn tell of the same light", "[bcsdf]") {
    // A white sky seen by a camera's ray: the integral of `value` over the sphere is the albedo, and over `pdf` it is
    // the weight of a sample, near and far, at any inclination.
    Random r{std::mt19937_64(17)};
    for (const char* animal : {"bobcat", "cat", "human"})
        for (float theta_i : {0.0f, -0.7f, 1.4f}) {
            const FibreOf fibre(parameters_of<3>(*find_preset(animal)), pack().view);
            const Vector known = direction_of(Angles{theta_i, 0.9f});
            const NearField<3> near = near_field(fibre, known, -0.3f);
            const FarField<3> far = far_field(fibre, known);
            const auto check = [&](const auto& field, int n) {
                constexpr int samples = 4000;
                double sky = 0, drawn = 0, square = 0;
                for (int i = 0; i < n; ++i)
                    for (int j = 0; j < 2 * n; ++j) {  // midpoints in theta and phi, d omega = cos theta d theta d phi
                        const Angles at = {float(pi * ((i + 0.5) / n - 0.5)), float(pi * (j + 0.5) / n - pi)};
                        sky += double(field.value(direction_of(at))[0]) * std::cos(double(at.theta)) * pi / n * pi / n;
                    }
                for (int s = 0; s < samples; ++s) {
                    const Sample<3> x = field.sample(r.numbers());
                    drawn += double(x.weight[0]) / samples, square += std::pow(double(x.weight[0]), 2) / samples;
                }
                INFO(animal << " " << theta_i << " sky " << sky << " drawn " << drawn);
                CHECK(sky == Approx(drawn).margin(2e-3 + 5 * std::sqrt(std::abs(square - drawn * drawn) / samples)));
                return sky;
            };
            CHECK(check(near, 500) == Approx(double(near.albedo()[0])).epsilon(2e-3));
            if (animal[0] == 'b') check(far, 60);
        }
}

TEST_CASE("what docs/bcsdf.md says of reciprocity and of Eq. 12's energy", "[bcsdf]") {
    const float degree = float(pi / 180);
    constexpr LobeMask paper = all_lobes ^ lobe_bit(Lobe::residual);
    const struct {
        const char* animal;
        float a, b;
        double least, most;
    } pairs[] = {{"cat", 75, -10, 2.58, 3.33}, {"bobcat", 60, -20, 1.41, 1.72}};
    for (const auto& pair : pairs) {
        const FibreOf fibre(parameters_of<1>(*find_preset(pair.animal)), shipped());
        const FarField<1> there = far_field(fibre, Angles{pair.a * degree, 0}),
                          back = far_field(fibre, Angles{pair.b * degree, 0});
        double least = 1e9, most = 0;
        for (int i = 0; i <= 180; ++i) {
            const float phi = float(i) * degree;
            const double ratio = double(angular_density(there.lobes(pair.b * degree, phi), paper)[0]) /
                                 double(angular_density(back.lobes(pair.a * degree, phi), paper)[0]);
            least = std::min(least, ratio), most = std::max(most, ratio);
        }
        std::printf("%s: M N over M N with directions exchanged: %.2f to %.2f\n", pair.animal, least, most);
        CHECK(least == Approx(pair.least).epsilon(0.01));
        CHECK(most == Approx(pair.most).epsilon(0.01));
    }
    const FibreOf fibre(parameters_of<1>(*find_preset("bobcat")), shipped());
    const double leaves[3][2] = {{0, 0.544}, {75, 4.72}, {85, 22.4}};  // bobcat, the light as i
    for (const auto& [inclination, energy] : leaves) {
        const FarField<1> far = far_field(fibre, Angles{float(inclination) * degree, 0});
        double sum = 0;
        constexpr int n = 120;
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) {
                const float theta_r = float(pi * ((i + 0.5) / n - 0.5)), phi = float(2 * pi * (j + 0.5) / n - pi);
                sum += double(far.eq12(theta_r, phi)[0]) * std::pow(std::cos(double(theta_r)), 2) * pi / n * 2 * pi / n;
            }
        std::printf("bobcat, light from %g degrees as i: %.3g of it leaves by Eq. 12\n", inclination, sum);
        CHECK(sum == Approx(energy).epsilon(0.01));
    }
}
