// The Gaussians of the lobes, four at a time and alone, their sampler, the cosine at the axis and the Gauss rules.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "medulla/medulla.hpp"

using namespace medulla;
using namespace medulla::detail;

TEST_CASE("Gaussians of four lobes at a time are what they are one by one", "[bcsdf]") {
    std::mt19937 random(4);
    std::uniform_real_distribution<float> u(0, 1);
    for (int i = 0; i < 4000; ++i) {
        const float theta_i = i % 5 ? 3.1415925f * (u(random) - 0.5f) : 1.5707963f, alpha = i % 3 ? 0.1f : 1.5f;
        const float beta = 1e-4f * std::pow(4e4f, u(random)), theta_r = 3.1415925f * (u(random) - 0.5f);
        const float shift[4] = {1, -0.5f, -1.5f, -2.5f}, rough[4] = {1, 0.5f, 1.5f, 2.5f};
        float centre[4], deviation[4];
        for (int p = 0; p < 4; ++p) centre[p] = shift[p] * alpha - theta_i, deviation[p] = rough[p] * beta;
        const auto M = truncated_gaussians(four_at(centre), four_at(deviation));
        const WrappedGaussians D = wrapped_gaussians(beta);
        const float phi = 20 * (u(random) - 0.5f);
        const Four delta = Four(phi) - four_at(centre);
        const Four m = M.pdf(theta_r), d = D.pdf(delta), joint = joint_pdf(M, D, theta_r, delta);
        for (int p = 0; p < 4; ++p) {
            const auto one = truncated_gaussian(centre[p], deviation[p]);
            CHECK(M[p].origin == one.origin);
            CHECK(M[p].beyond == one.beyond);
            CHECK(double(M[p].peak) == Approx(double(one.peak)).epsilon(1e-6));  // a few roundings
            // An exponent of up to 87 rounded twice to 6e-8.
            CHECK(double(lane(m, p)) == Approx(double(one.pdf(theta_r))).epsilon(1.1e-5).margin(1e-30));
            CHECK(double(lane(joint, p)) ==
                  Approx(double(lane(m, p)) * double(lane(d, p))).epsilon(1.1e-5).margin(1e-30));
            if (p == 3) continue;
            // z = x / deviation is rounded alike; turns are counted from the nearest of each.
            const double tolerance = 1e-5 + 2e-5 / double(beta);  // as the near field against its reference
            CHECK(double(lane(d, p)) == Approx(double(D[p].pdf(phi - centre[p]))).epsilon(tolerance).margin(1e-12));
        }
        CHECK(double(lane(d, 3)) == Approx(0.5 / pi).epsilon(1e-6));  // the residual lobe is even
    }
}

TEST_CASE("truncated Gaussians are drawn as they are dense, also where the centre is outside", "[bcsdf]") {
    int compared = 0;
    for (double centre : {0.0, 1.4, -1.5, 1.6, -1.9, 3.0})
        for (double deviation : {0.002, 0.1, 0.6, 1.5}) {
            const auto exact = truncated_gaussian(centre, deviation);
            const auto narrow = truncated_gaussian(float(centre), float(deviation));
            // Width of the distribution at its narrowest: of the Gaussian, or of the layer that is left at the edge. An
            // inclination near pi/2 is rounded to 1.2e-7, and the quantile is right to 2e-6 of a deviation (2e-5 of
            // where the tail's sampler stops, scaled_tail_mass in float): both moved by the density, against 1/64.
            const double width = deviation / (1 + exact.beyond);
            const double moved = 64 * (1.2e-7 / width + 2e-5);
            double before = -pi / 2;
            for (int i = 1; i <= 64; ++i) {
                const double at = double(sample(narrow, float(i) / 64));
                CHECK(at >= before - 1e-7);
                double piece = 0;
                // Midpoints, in steps that the density sees as even: 400 add (1/400)^2.
                for (int k = 0; k < 400; ++k) piece += exact.pdf(before + (at - before) * (k + 0.5) / 400);
                piece *= (at - before) / 400;
                // The first and last pieces reach to the edges, 5.5 deviations and more away; midpoints are too few.
                // A float angle cannot resolve the layer of 3e-6 that is left of the narrowest lobe at an edge.
                if (i > 1 && i < 64 && moved < 0.1) {
                    CHECK(piece == Approx(1.0 / 64).epsilon(4e-4 + moved));
                    ++compared;
                }
                before = at;
            }
            for (float u : {0.0f, 1e-30f, 0.99999994f, 1.0f}) {
                const float theta = sample(narrow, u);
                CHECK(std::abs(theta) <= float(pi / 2));
            }
            const double at = double(sample(narrow, 0.3f));
            CHECK(double(narrow.pdf(float(at))) ==
                  Approx(exact.pdf(at)).epsilon(1e-4 + 2e-7 / deviation * (3 + exact.beyond)));
        }
    CHECK(compared > 20 * 62);
}

TEST_CASE("wrapped Gaussians integrate to 1 and are drawn as they are dense", "[bcsdf]") {
    for (float deviation : {1e-4f, 0.05f, 0.25f, 0.7f, 1.2f, 1.3f, 4.0f}) {
        const auto gaussian = wrapped_gaussian(deviation);
        const int n = 4000;
        const double reach = std::min(pi, 8 * double(deviation));
        double sum = 0;
        for (int i = 0; i < n; ++i) sum += double(gaussian.pdf(float(reach * (2 * (i + 0.5) / n - 1)))) * 2 * reach / n;
        CHECK(sum == Approx(1).epsilon(2e-6));  // float sums of midpoints that are exact
        // Shares of [-x, x] drawn by even steps: each step may fall on either side of an end.
        const int draws = 20000;
        for (double x : {0.3 * reach, 0.7 * reach}) {
            double share = 0;
            int drawn = 0;
            for (int i = 0; i < n; ++i) share += double(gaussian.pdf(float(x * (2 * (i + 0.5) / n - 1)))) * 2 * x / n;
            for (int i = 0; i < draws; ++i)
                drawn += std::abs(double(sample(gaussian, (float(i) + 0.5f) / float(draws)))) < x;
            // A deviation of 4 is some thirteen pieces laid upon one another, each with two ends.
            CHECK(double(drawn) / draws == Approx(share).margin(30.0 / draws));
        }
        for (float u : {0.0f, 1e-30f, 1.0f}) CHECK(std::abs(sample(gaussian, u)) <= float(pi));
    }
}

TEST_CASE("the cosine of four inclinations keeps its digits to pi/2", "[bcsdf]") {
    const float last = 1.57079625f;  // float(pi/2) is beyond pi/2, and its cosine below 0
    double worst = 0;
    for (int i = 0; i <= 100000; ++i) {
        const float power = std::pow(10.0f, -8 * float(i) / 100000);
        for (float x : {last * float(i) / 100000, last - last * power, 0.78539816f + 1e-4f * power})
            for (float y : {x, -x}) {
                const double exact = std::cos(double(y));
                worst = std::max(worst, std::abs(double(lane(detail::cosine(Four(y)), 1)) / exact - 1));
            }
    }
    CHECK(worst < 2e-7);
    CHECK(double(lane(detail::cosine(Four(float(pi / 2))), 0)) == Approx(std::cos(double(float(pi / 2)))));
}

TEST_CASE("Gauss rules integrate polynomials", "[bcsdf]") {
    for (int rule = 0; rule < gauss_rules; ++rule) {
        const GaussRule r = gauss_rule(rule);
        for (int degree : {0, 2, 4 * r.half - 2}) {
            double sum = 0;
            for (int i = 0; i < r.half; ++i) sum += 2 * double(r.w[i]) * std::pow(double(r.x[i]), degree);
            CHECK(sum == Approx(2.0 / (degree + 1)).epsilon(1e-5));  // degree 46 of floats near 1
        }
    }
}
