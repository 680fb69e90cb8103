// The planar Henyey-Greenstein triple: density, sampler, inverse (docs/physics.md, section 1).
#include <catch2/catch.hpp>
#include <cmath>

#include "medulla/phase.hpp"
#include "sim2d/random.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;

TEST_CASE("Phase function has integral 1, mean cosine g and Fourier coefficients g^|n|", "[phase]") {
    for (const double g : {-0.9, -0.3, 0.0, 0.2, 0.7, 0.95}) {
        // The error of the trapezoid rule for a periodic analytic function is |g|^n: 2e-9 at g = 0.95 with 400 points.
        const int n = 400;
        double moment[4] = {};
        for (int i = 0; i < n; ++i) {
            const double t = 2 * pi * i / n;
            for (int k = 0; k < 4; ++k) moment[k] += planar_hg_pdf(t, g) * std::cos(k * t) * 2 * pi / n;
        }
        for (int k = 0; k < 4; ++k) CHECK(moment[k] == Approx(std::pow(g, k)).margin(3e-9));
    }
}

TEST_CASE("Phase function is accurate at its peak as g -> 1", "[phase]") {
    // p(0; g) = (1 + g) / (2 pi (1 - g)); 1 - g is exact here.
    const double g = 1 - 0x1p-40;
    CHECK(planar_hg_pdf(0.0, g) == Approx((1 + g) / (2 * pi * 0x1p-40)).epsilon(1e-14));
    // The double nearest to pi differs by 1.2e-16, the half-angle by 6e-17, with a half-width of 2^-41: relative 2e-8.
    CHECK(planar_hg_pdf(pi, -g) == Approx((1 + g) / (2 * pi * 0x1p-40)).epsilon(1e-7));
}

TEST_CASE("Sampled directions follow the density", "[phase]") {
    const int samples = 200000, bins = 64;
    // Six tests share a level of 0.01 (Sidak): each may fail with probability 0.0017.
    for (const double g : {-0.95, -0.5, 0.0, 0.3, 0.8, 0.95}) {
        sim2d::RandomStream random(7, static_cast<std::uint64_t>(1000 + 1000 * g), 0);
        std::vector<double> counts(bins, 0.0), probability(bins, 0.0);
        double mean_cosine = 0;
        for (int i = 0; i < samples; ++i) {
            const Direction<double> w = sample_planar_hg(random.direction(), g);
            CHECK_FALSE(std::abs(w.x * w.x + w.y * w.y - 1) > 1e-12);
            mean_cosine += w.x / samples;
            const double u = (std::atan2(w.y, w.x) + pi) / (2 * pi);
            ++counts[static_cast<std::size_t>(std::min(bins - 1.0, u * bins))];
        }
        // CDF: atan((1 + g) / (1 - g) tan(t / 2)) / pi.
        const auto cdf = [&](double t) { return std::atan((1 + g) / (1 - g) * std::tan(t / 2)) / pi; };
        for (int b = 0; b < bins; ++b)
            probability[static_cast<std::size_t>(b)] = (b == bins - 1 ? 0.5 : cdf(-pi + 2 * pi * (b + 1) / bins)) -
                                                       (b == 0 ? -0.5 : cdf(-pi + 2 * pi * b / bins));
        CHECK(test::chi_squared_p(counts, probability, samples) > 0.0017);
        // Variance of cos t is (1 + g^2) / 2 - g^2 = (1 - g^2) / 2.
        CHECK(std::abs(mean_cosine - g) < 5 * std::sqrt((1 - g * g) / 2 / samples));
    }
}

TEST_CASE("The inverse returns the uniform direction", "[phase]") {
    sim2d::RandomStream random(3, 0, 0);
    for (int i = 0; i < 1000; ++i) {
        const double g = 1.9 * random.uniform() - 0.95;
        const Direction<double> z = random.direction(), back = invert_planar_hg(sample_planar_hg(z, g), g);
        // Conditioning of the map: derivative up to (1 + |g|) / (1 - |g|) = 39.
        CHECK(std::hypot(back.x - z.x, back.y - z.y) < 1e-13);
    }
}
