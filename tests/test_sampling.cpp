// sample against pdf: chi-squared over random furs, a broken pdf that must fail, furnace, weights, frame.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <vector>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;
using analytic::AnalyticPack;

namespace {

const AnalyticPack& pack() {
    static const AnalyticPack p;
    return p;
}

struct Random {
    std::mt19937_64 engine;
    float uniform() { return float(engine() >> 40) * 0x1p-24f; }
    RandomNumbers numbers() {
        RandomNumbers u;
        u.lobe = uniform(), u.azimuth = uniform(), u.azimuth2 = uniform(), u.longitude = uniform(),
        u.offset = uniform();
        return u;
    }
};

FurParameters<3> random_fur(Random& r, int i) {
    FurParameters<3> p = parameters_of<3>(fur_presets[i % fur_preset_count]);
    p.g = std::min(p.g, 0.6f);
    if (i % 2 == 0) return p;
    p.eta = 1.01f + 1.49f * r.uniform(), p.kappa = r.uniform(), p.layers = 5 * r.uniform();
    p.beta_n = 0.05f * std::pow(20.0f, r.uniform()), p.beta_m = 0.05f * std::pow(20.0f, r.uniform());
    p.sigma_ms = 5 * r.uniform(), p.sigma_ma = r.uniform() * r.uniform(), p.sigma_ca[0] = r.uniform();
    p.g = 1.2f * r.uniform() - 0.6f;
    return p;
}

constexpr int rows = 24, columns = 32;

/// Expected share of each bin, in coordinates (theta, phi), by 8 Gauss nodes a side in `split` pieces a side.
template <class Pdf>
std::vector<double> expected_shares(Pdf&& pdf, int split) {
    std::vector<double> share(rows * columns, 0.0);
    const GaussRule rule = gauss_rule(0);
    for (int i = 0; i < rows * split; ++i)
        for (int j = 0; j < columns * split; ++j) {
            double sum = 0;
            for (int a = 0; a < 2 * rule.half; ++a)
                for (int b = 0; b < 2 * rule.half; ++b) {
                    const double x = a & 1 ? double(rule.x[a / 2]) : -double(rule.x[a / 2]),
                                 y = b & 1 ? double(rule.x[b / 2]) : -double(rule.x[b / 2]);
                    const double theta = pi * ((i + 0.5 + 0.5 * x) / (rows * split) - 0.5),
                                 phi = pi * (2 * (j + 0.5 + 0.5 * y) / (columns * split) - 1);
                    sum += double(rule.w[a / 2]) * double(rule.w[b / 2]) / 4 * double(pdf(float(theta), float(phi)));
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

template <class Sampler>
Drawn draw(const Sampler& sampler, Random& r, int samples) {
    Drawn d;
    int invalid = 0;
    for (int s = 0; s < samples; ++s) {
        const FurSample<3> x = sampler.sample(r.numbers());
        invalid += !x.valid;
        const int i = std::min(rows - 1, int((double(x.theta_r) / pi + 0.5) * rows)),
                  j = std::min(columns - 1, std::max(0, int((double(x.phi) / pi + 1) / 2 * columns)));
        ++d.counts[std::size_t(std::max(0, i) * columns + j)];
        for (float w : x.weight) d.largest_weight = std::max(d.largest_weight, w);
        d.mean_weight += double(x.weight[0]) / samples;
    }
    CHECK(invalid == 0);
    return d;
}

int from_environment(const char* name, int otherwise) {
    const char* text = std::getenv(name);
    return text ? std::atoi(text) : otherwise;
}

}  // namespace

TEST_CASE("near samples pass chi-squared with Sidak's correction, a broken pdf fails", "[bcsdf]") {
    const int cases = from_environment("MEDULLA_CHI_CASES", 8),
              samples = from_environment("MEDULLA_CHI_SAMPLES", 100000);
    const double level = 1 - std::pow(1 - 0.01, 1.0 / cases);
    Random r{std::mt19937_64(11)};
    const auto tables = std::make_unique<UnfoldedTables>();
    int passed = 0, broken_caught = 0, unfolded = 0;
    float largest = 0;
    for (int i = 0; i < cases; ++i) {
        const FurParameters<3> p = random_fur(r, i);
        FurFibre<3> fibre;
        REQUIRE(usable(prepare(p, pack().view, fibre)));
        unfolded += i % 4 > 1 && unfold(fibre, *tables);
        NearField<3> near;
        near_field(fibre, i % 8 == 7 ? 1.52f : 2.8f * (r.uniform() - 0.5f), 2 * r.uniform() - 1, near);
        NearSampler<3> sampler;
        sampler.prepare(near);
        const Drawn d = draw(sampler, r, samples);
        const auto share = expected_shares([&](float t, float f) { return sampler.pdf_angular(t, f); }, 3);
        double whole = 0;
        for (double x : share) whole += x;
        CHECK(whole == Approx(1).epsilon(2e-4));  // Gauss nodes against kinks at the tables' knots
        const double value = chi_squared(share, d.counts, samples);
        if (value > level)
            ++passed;
        else
            std::printf("near case %d: p-value %.2g\n", i, value);
        // Broken: lobe R is said to be half as likely as it is drawn (its share goes to the others).
        NearSampler<3> broken = sampler;
        const float moved = 0.5f * broken.shares.share[0];
        broken.shares.share[0] -= moved, broken.shares.share[near.scattered ? 3 : 1] += moved;
        const auto wrong = expected_shares([&](float t, float f) { return broken.pdf_angular(t, f); }, 3);
        if (!(chi_squared(wrong, d.counts, samples) > level)) ++broken_caught;
        largest = std::max(largest, d.largest_weight);
        // The mean weight of channel 0 is its energy: 4 deviations of a mean of weights below 2.
        double energy = 0;
        for (int k = 0; k < (near.scattered ? 5 : 3); ++k) energy += double(near.energy.A[k][0]);
        CHECK(d.mean_weight == Approx(energy).margin(8 / std::sqrt(double(samples))));
    }
    CHECK(passed == cases);
    CHECK(unfolded >= cases / 4);
    CHECK(broken_caught >= cases - 1 - cases / 20);  // but where R itself is nearly absent
    CHECK(largest < 3 * 1.5f);  // the bound: channels times the table's overshoot between its knots
    std::printf("near: %d of %d pass chi-squared, %d of %d broken ones caught, largest weight %.3f\n", passed, cases,
                broken_caught, cases, double(largest));
}

TEST_CASE("far and interval samples pass chi-squared, a broken pdf fails", "[bcsdf]") {
    const int cases = from_environment("MEDULLA_CHI_CASES", 4),
              samples = from_environment("MEDULLA_CHI_SAMPLES", 40000);
    const double level = 1 - std::pow(1 - 0.01, 1.0 / cases);
    Random r{std::mt19937_64(12)};
    const auto tables = std::make_unique<UnfoldedTables>();
    int passed = 0, broken_caught = 0, unfolded = 0;
    float largest = 0;
    for (int i = 0; i < cases; ++i) {
        const FurParameters<3> p = random_fur(r, i + 3);
        FurFibre<3> fibre;
        REQUIRE(usable(prepare(p, pack().view, fibre)));
        unfolded += i % 4 > 1 && unfold(fibre, *tables);
        FarField<3> far;
        const float low = i % 2 ? 1.9f * r.uniform() - 1 : -1, high = i % 2 ? low + (1 - low) * r.uniform() : 1;
        far_field(fibre, 2.4f * (r.uniform() - 0.5f), {low, high}, far);
        FarSampler<3> sampler;
        sampler.prepare(far);
        const Drawn d = draw(sampler, r, samples);
        // pdf_angular is separable by lobe, but the test asks it as a renderer would: a coarser grid of nodes.
        const auto share = expected_shares([&](float t, float f) { return sampler.pdf_angular(t, f); }, 1);
        const double value = chi_squared(share, d.counts, samples);
        if (value > level)
            ++passed;
        else
            std::printf("far case %d: p-value %.2g\n", i, value);
        // Broken: the density of inclinations 0.1 away, a tenth of the widest lobe.
        const auto wrong = expected_shares([&](float t, float f) { return sampler.pdf_angular(t - 0.1f, f); }, 1);
        if (!(chi_squared(wrong, d.counts, samples) > level)) ++broken_caught;
        largest = std::max(largest, d.largest_weight);
        FarField<3> exact;
        far_field(fibre, far.near.longitudinal.theta_i, {low, high}, exact, FarQuality::fine);
        double energy = 0;
        for (int j = 0; j < 256; ++j)
            for (const auto& N : exact.lobes(0.0f, float(pi * (2 * (j + 0.5) / 256 - 1))).N)
                energy += double(N[0]) * 2 * pi / 256;
        CHECK(d.mean_weight == Approx(energy).margin(8 / std::sqrt(double(samples))));  // as for near
    }
    CHECK(passed == cases);
    CHECK(unfolded >= cases / 4);
    CHECK(broken_caught == cases);
    CHECK(largest < 3 * 1.5f);  // channels, and the scattered lobes' shifts about their mean
    std::printf("far: %d of %d pass chi-squared, %d of %d broken ones caught, largest weight %.3f\n", passed, cases,
                broken_caught, cases, double(largest));
}

TEST_CASE("truncated Gaussians are drawn as they are dense, also where the centre is outside", "[bcsdf]") {
    // In double, since a float angle cannot resolve the layer of 3e-6 that is left of the narrowest lobe at the edge.
    for (double centre : {0.0, 1.4, -1.5, 1.6, -1.9, 3.0})
        for (double deviation : {0.002, 0.1, 0.6, 1.5}) {
            const auto gaussian = truncated_gaussian(centre, deviation);
            // Between the images of i/64 and (i+1)/64 lies a mass of 1/64. The sampler stops at 2e-6 of the deviation
            // or of the edge's layer: against a 64-quantile that is at most 2e-4 of its mass; midpoints add (1/200)^2.
            for (int i = 1; i < 63; ++i) {
                const double a = sample(gaussian, i / 64.0), b = sample(gaussian, (i + 1) / 64.0);
                double piece = 0;
                for (int k = 0; k < 200; ++k) piece += gaussian.pdf(a + (b - a) * (k + 0.5) / 200) * (b - a) / 200;
                CHECK(piece == Approx(1.0 / 64).epsilon(4e-4));
            }
            CHECK(std::abs(sample(gaussian, 0.0)) <= pi / 2);
            CHECK(std::abs(sample(gaussian, 1 - 1e-9)) <= pi / 2);
            const auto narrow = truncated_gaussian(float(centre), float(deviation));
            CHECK(double(narrow.pdf(float(sample(gaussian, 0.3)))) ==
                  Approx(gaussian.pdf(sample(gaussian, 0.3))).epsilon(1e-4 + 2e-7 / deviation * (3 + gaussian.beyond)));
        }
}

namespace {

/// Integrals over theta_r of both sides of M^s.
BackForward side_integrals(const FurFibre<3>& fibre, const Longitudinal<3>& m) {
    constexpr int n = 2000;
    double back = 0, forward = 0;
    for (int i = 0; i < n; ++i) {
        const float theta_r = float(pi * ((i + 0.5) / n - 0.5));
        const BackForward at =
            m.tables ? m.tables->longitudinal_density(m.point, theta_r) : contracted_sides(fibre, m, theta_r);
        back += double(at.back) * pi / n, forward += double(at.forward) * pi / n;
    }
    return {float(back), float(forward)};
}

struct Furnace {
    double whole = 0;   ///< integral of the density over all exits
    double excess = 0;  ///< the part of it by which M^s is off 1
};

/// All that leaves a white fibre: M of the unscattered lobes integrates to 1, M^s to a lerp of its sides'.
template <class Field>
Furnace furnace(const Field& field, const Longitudinal<3>& m, const FurFibre<3>& fibre, bool scattered) {
    constexpr int n = 512;
    const BackForward sides = scattered ? side_integrals(fibre, m) : BackForward{1, 1};
    Furnace f;
    for (int j = 0; j < n; ++j) {
        const double phi = pi * (2 * (j + 0.5) / n - 1), t = std::abs(phi) / pi;
        const auto l = field.lobes(0.0f, float(phi));
        const double M = (1 - t) * double(sides.back) + t * double(sides.forward),
                     N = double(l.N[3][0]) + double(l.N[4][0]);
        f.whole += (double(l.N[0][0]) + double(l.N[1][0]) + double(l.N[2][0]) + N * M) * 2 * pi / n;
        f.excess += N * (M - 1) * 2 * pi / n;
    }
    return f;
}

/// F + (1 - F)(1 - F^2 x^2) of docs/bcsdf.md, averaged over [-1, 1]: midpoints as in test_bcsdf_far.cpp.
double white_energy(const FurFibre<3>& fibre, double theta_i, double h) {
    const auto& p = fibre.parameters;
    const auto at = inclination(double(p.eta), std::cos(theta_i), p.fresnel);
    const auto path = trace(at, double(p.kappa), double(p.layers), h, std::sqrt((1 - h) * (1 + h)));
    const double x = std::exp(-2 * path.s_m * double(p.sigma_ms) * at.inverse_cos_t), F = path.cuticle.F;
    return F + path.cuticle.T_ * (1 - F * F * (fibre.scattered ? x * x : 0.0));
}

}  // namespace

TEST_CASE("white furnace: near and far return what the model's energies say", "[bcsdf]") {
    Random r{std::mt19937_64(13)};
    const PackView packs[2] = {pack().view, open_pack(default_pack_words, default_pack_size).pack};
    const auto tables = std::make_unique<UnfoldedTables>();
    const char* names[4] = {"near, factors", "far, factors", "near, unfolded", "far, unfolded"};
    double least[4] = {2, 2, 2, 2}, most[4] = {}, over[4] = {}, under[4] = {}, excess[4] = {};
    for (int i = 0; i < from_environment("MEDULLA_FURNACE_CASES", 6); ++i) {
        FurParameters<3> p = random_fur(r, i);
        p.sigma_ma = p.sigma_ca[0] = p.sigma_ca[1] = p.sigma_ca[2] = 0;
        p.beta_n = std::max(p.beta_n, 0.05f), p.kappa = std::max(p.kappa, 0.01f);
        if (i % 3 == 2) p.sigma_ms = 30 * r.uniform();  // dense: nothing is lost, the sum is 1
        FurFibre<3> fibre;
        REQUIRE(prepare(p, packs[i / 2 % 2], fibre) == FurStatus::ok);
        const float theta_i = 3.0f * (r.uniform() - 0.5f), h = 2 * r.uniform() - 1;
        for (int how = 0; how < 4; how += 2) {
            if (how && !unfold(fibre, *tables)) continue;
            NearField<3> near;
            near_field(fibre, theta_i, h, near);
            FarField<3> far;
            far_field(fibre, theta_i, {-1, 1}, far);
            double mean_energy = 0;
            const double rim = std::asin(double(far.rim)), cut[4] = {-pi / 2, -rim, rim, pi / 2};
            for (int piece = 0; piece < 3; ++piece)
                for (int j = 0; j < 1000; ++j) {
                    const double t = pi * (j + 0.5) / 1000, a = cut[piece], b = cut[piece + 1];
                    const double gamma = a + (b - a) * (1 - std::cos(t)) / 2;
                    mean_energy += white_energy(fibre, double(theta_i), std::sin(gamma)) * std::cos(gamma) * (b - a) /
                                   4 * std::sin(t) * pi / 1000;
                }
            const Furnace whole[2] = {furnace(near, near.longitudinal, fibre, near.scattered),
                                      furnace(far, far.near.longitudinal, fibre, far.nodes > 0)};
            const double energy[2] = {white_energy(fibre, double(theta_i), double(h)), mean_energy};
            // Near: float, and lobes that carry less than 2^-24. Far: Gauss rules err by 1e-5 at most on a Gaussian
            // under one piece (rule_for), and by as much on the amplitude, in pieces that follow its scales; 1e-5 is
            // taken off (kept_of_average).
            const double above[2] = {2e-6, 1e-5}, below[2] = {2e-6, 3e-5};
            for (int k = 0; k < 2; ++k) {
                least[how + k] = std::min(least[how + k], whole[k].whole);
                most[how + k] = std::max(most[how + k], whole[k].whole);
                const double plain = whole[k].whole - whole[k].excess;
                over[how + k] = std::max(over[how + k], plain - energy[k]);
                under[how + k] = std::max(under[how + k], energy[k] - plain);
                excess[how + k] = std::max(excess[how + k], std::abs(whole[k].excess));
                INFO("case " << i << " " << names[how + k]);
                CHECK(plain <= energy[k] + above[k]);
                CHECK(plain >= energy[k] - below[k]);
                CHECK(energy[k] <= 1 + 1e-12);
                // C^M integrates to 1 to 2e-6, its dips below 0 held at 0 and all.
                CHECK(std::abs(whole[k].excess) < 2e-6);
                CHECK(whole[k].whole <= 1 + (k ? 0 : 1e-6));  // near: float sums of lobes that add up to 1
            }
        }
    }
    for (int k = 0; k < 4; ++k)
        std::printf("white furnace: %-14s %.7f to %.7f, %.1e over and %.1e under the model, C^M changes it by %.1e\n",
                    names[k], least[k], most[k], over[k], under[k], excess[k]);
}

TEST_CASE("light that is sampled and directions that are drawn tell of the same light", "[bcsdf]") {
    // A white sky seen by a camera's ray: the integral of `density` over the sphere is the albedo, and over `pdf` it is
    // the weight of a sample, near and far, at any inclination.
    Random r{std::mt19937_64(17)};
    for (const char* animal : {"bobcat", "cat", "human"})
        for (float theta_i : {0.0f, -0.7f, 1.4f}) {
            FurFibre<3> fibre;
            prepare(parameters_of<3>(*find_preset(animal)), pack().view, fibre);
            const Vector<float> omega_i = direction_of(Angles<float>{theta_i, 0.9f});
            NearField<3> near;
            near_field(fibre, theta_i, -0.3f, near);
            FarField<3> far;
            far_field(fibre, theta_i, OffsetRange{}, far);
            NearSampler<3> near_sampler;
            near_sampler.prepare(near);
            FarSampler<3> far_sampler;
            far_sampler.prepare(far);
            double albedo = 0;
            for (int k = 0; k < (near.scattered ? 5 : 3); ++k) albedo += double(near.energy.A[k][0]);
            const auto check = [&](const auto& sampler, auto where, int n, double tolerance) {
                constexpr int samples = 4000;
                double sky = 0, drawn = 0, square = 0;
                for (int i = 0; i < n; ++i)
                    for (int j = 0; j < 2 * n; ++j) {  // midpoints in theta and phi, d omega = cos theta d theta d phi
                        const Angles<float> at = {float(pi * ((i + 0.5) / n - 0.5)), float(pi * (j + 0.5) / n - pi)};
                        sky += double(density(fibre, omega_i, direction_of(at), where).value[0]) *
                               std::cos(double(at.theta)) * pi / n * pi / n;
                    }
                for (int s = 0; s < samples; ++s) {
                    const FurSample<3> x = sampler.sample(r.numbers());
                    const float w = density(fibre, omega_i, direction_of(x, omega_i), where).value[0] / x.pdf;
                    if (s < 50) CHECK(double(w) == Approx(double(x.weight[0])).epsilon(tolerance));
                    drawn += double(x.weight[0]) / samples, square += std::pow(double(x.weight[0]), 2) / samples;
                }
                INFO(animal << " " << theta_i << " sky " << sky << " drawn " << drawn);
                CHECK(sky == Approx(drawn).margin(2e-3 + 5 * std::sqrt((square - drawn * drawn) / samples)));
                if (n == 500) CHECK(sky == Approx(albedo).epsilon(2e-3));  // near
            };
            // An angle's rounding through vectors, 1e-6, over the narrowest lobe, 0.023 and less by alpha and beta_m,
            // at its tails, where a sample rarely lies: 1e-3. Far, the same sum twice, by eval's and the pdf's
            // averages.
            check(near_sampler, -0.3f, 500, 2e-3);
            if (animal[0] == 'b') check(far_sampler, OffsetRange{}, 60, 2e-2);
        }
}

TEST_CASE("what docs/bcsdf.md says of reciprocity and of Eq. 12's energy", "[bcsdf]") {
    const PackView shipped = open_pack(default_pack_words, default_pack_size).pack;
    const float degree = float(pi / 180);
    const struct {
        const char* animal;
        float a, b;
        double least, most;
    } pairs[] = {{"cat", 75, -10, 2.58, 3.33}, {"bobcat", 60, -20, 1.41, 1.72}};
    FurFibre<1> fibre;
    for (const auto& pair : pairs) {
        REQUIRE(prepare(parameters_of<1>(*find_preset(pair.animal)), shipped, fibre) == FurStatus::ok);
        FarField<1> there, back;
        far_field(fibre, pair.a * degree, OffsetRange{}, there), far_field(fibre, pair.b * degree, OffsetRange{}, back);
        double least = 1e9, most = 0;
        for (int i = 0; i <= 180; ++i) {
            const float phi = float(i) * degree;
            const double ratio = double(angular_density(there.lobes(pair.b * degree, phi)).value[0]) /
                                 double(angular_density(back.lobes(pair.a * degree, phi)).value[0]);
            least = std::min(least, ratio), most = std::max(most, ratio);
        }
        std::printf("%s: M N over M N with directions exchanged: %.2f to %.2f\n", pair.animal, least, most);
        CHECK(least == Approx(pair.least).epsilon(0.01));
        CHECK(most == Approx(pair.most).epsilon(0.01));
    }
    const double leaves[3][2] = {{0, 0.544}, {75, 4.72}, {85, 22.4}};  // bobcat, the light as i
    for (const auto& [inclination, energy] : leaves) {
        FarField<1> far;
        far_field(fibre, float(inclination) * degree, OffsetRange{}, far);
        double sum = 0;
        constexpr int n = 120;
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) {
                const float theta_r = float(pi * ((i + 0.5) / n - 0.5)), phi = float(2 * pi * (j + 0.5) / n - pi);
                sum += double(angular_density(far.lobes(theta_r, phi)).value[0]) * pi / n * 2 * pi / n *
                       std::pow(std::cos(double(theta_r)) / std::cos(inclination * pi / 180), 2);
            }
        std::printf("bobcat, light from %g degrees as i: %.3g of it leaves by Eq. 12\n", inclination, sum);
        CHECK(sum == Approx(energy).epsilon(0.01));
    }
}

TEST_CASE("directions, offsets and coverage", "[bcsdf]") {
    for (float theta : {-1.5f, -0.3f, 0.0f, 1.2f})
        for (float phi : {-3.0f, 0.0f, 1.0f}) {
            const Angles<float> a = angles_of(direction_of(Angles<float>{theta, phi}));
            CHECK(a.theta == Approx(theta).margin(2e-6));
            CHECK(a.phi == Approx(phi).margin(2e-6));
        }
    // Light from +y travels towards -y; its left normal (counter-clockwise by 90 degrees) is -z.
    CHECK(offset_of(Vector<float>{0, 1, 0}, Vector<float>{0, 5, -0.3f}) == Approx(0.3));
    const OffsetRange c = pixel_coverage(0.8f, 2.0f, 4.0f, 0.9f);
    CHECK(c.low == Approx(0.8 - 0.225));
    CHECK(c.high == 1.0f);
    CHECK(pixel_coverage(0.1f, 1e9f, 1e-3f, 1.0f).low == -1.0f);
    // R of a ray at h > 0 leaves at phi = -2 gamma_i: on the side it came in on (left of the light when seen along it).
    FurFibre<3> fibre;
    FurParameters<3> p = parameters_of<3>(*find_preset("human"));
    prepare(p, pack().view, fibre);
    const auto here = near_lobes(fibre, 0.0f, 0.0f, -2 * std::asin(0.5f), 0.5f),
               there = near_lobes(fibre, 0.0f, 0.0f, 2 * std::asin(0.5f), 0.5f);
    CHECK(here.N[0][0] > 1e3f * there.N[0][0]);
    // What a sampler draws, as directions: the same density, and the direction's own angles.
    NearField<3> near;
    near_field(fibre, std::asin(0.6f), -0.3f, near);
    NearSampler<3> sampler;
    sampler.prepare(near);
    const Vector<float> omega_i = {0.6f, 0.48f, 0.64f};
    Random r{std::mt19937_64(14)};
    for (int i = 0; i < 100; ++i) {
        const FurSample<3> s = sampler.sample(r.numbers());
        const Vector<float> omega_r = direction_of(s, omega_i);
        CHECK(omega_r.x == Approx(std::sin(s.theta_r)).margin(1e-6));
        CHECK(pdf(sampler, omega_i, omega_r) ==
              Approx(s.pdf).epsilon(2e-3));  // 1e-6 of angle over beta_n 0.065, beta_m
        const Colour<3> S = eval(fibre, omega_i, omega_r, -0.3f);
        // sum M N / cos theta_r = S cos^2 theta_i / cos theta_r, per steradian, over the pdf.
        CHECK(S.value[0] * 0.8f * 0.8f / std::cos(s.theta_r) / s.pdf == Approx(s.weight[0]).epsilon(4e-3));
    }
    const auto value = eval(fibre, Vector<float>{0.6f, 0.8f, 0}, Vector<float>{-0.6f, 0, 0.8f}, -0.3f);
    CHECK(value.value[1] ==
          Approx(eval(fibre, std::asin(0.6f), -std::asin(0.6f), float(pi / 2), -0.3f).value[1]).epsilon(1e-4));
}
