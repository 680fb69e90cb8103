// The disc solver against results that do not share its code: closed forms, another solver's lobes, the analog tracer.
// docs/physics.md, sections 1, 2 and 4.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "sim2d/disc/deterministic.hpp"
#include "sim2d/disc/single.hpp"
#include "sim2d/reference/analog.hpp"

using namespace medulla;
using namespace medulla::sim2d;

namespace {

/// Relative L2 distance of two lobes.
double distance(const std::vector<double>& a, const std::vector<double>& b) {
    REQUIRE(a.size() == b.size());
    double error = 0, norm = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        error += (a[i] - b[i]) * (a[i] - b[i]);
        norm += b[i] * b[i];
    }
    return std::sqrt(error / norm);
}

/// Bin averages of p from its integral, (1 / pi) atan((1 + g) / (1 - g) tan(t / 2)).
std::vector<double> phase_averages(double g, std::size_t bins) {
    const double width = 2 * pi / static_cast<double>(bins);
    const auto integral = [&](std::size_t edge) {
        if (edge == 0) return -0.5;
        if (edge == bins) return 0.5;
        return std::atan((1 + g) / (1 - g) * std::tan(0.5 * (-pi + static_cast<double>(edge) * width))) / pi;
    };
    std::vector<double> average(bins);
    for (std::size_t b = 0; b < bins; ++b) average[b] = (integral(b + 1) - integral(b)) / width;
    return average;
}

/// The formula of section 4 by the midpoint rule along the chord.
double single_by_midpoints(double sigma, double g, double h, double phi) {
    const int steps = 200000;
    const double half = std::sqrt(1 - h * h), step = 2 * half / steps;
    double sum = 0;
    for (int i = 0; i < steps; ++i) {
        const double t = (i + 0.5) * step, x = t - half;
        const double along = x * std::cos(phi) + h * std::sin(phi);
        const double d = -along + std::sqrt(along * along + 1 - x * x - h * h);
        sum += sigma * std::exp(-sigma * (t + d)) * step;
    }
    return sum * (1 - g * g) / (2 * pi * (1 + g * g - 2 * g * std::cos(phi)));
}

}  // namespace

TEST_CASE("disc, single scattering: closed form against the midpoint rule", "[disc]") {
    for (const double sigma : {0.01, 1.0, 16.0})
        for (const double h : {-0.7, 0.0, 0.3, 0.99})
            for (const double phi : {-3.0, -1.2, 0.0, 0.4, 2.0, 3.14}) {
                const double expected = single_by_midpoints(sigma, 0.6, h, phi) / disc_energy(sigma, h);
                // Midpoint rule of 200000 steps: (sigma L / 200000)^2 / 24 <= 1e-9, and (1 / 200000)^1.5 where the
                // path to the circle starts like a square root; the 40 Gauss points are documented to 1e-6.
                CHECK(disc_single_over_energy(sigma, 0.6, h, phi) == Approx(expected).epsilon(2e-6));
            }
}

TEST_CASE("disc, single scattering: bin averages include the narrow peak", "[disc]") {
    // sigma = 0: the averages of p itself, known from its integral. Gauss points per bin are chosen for a relative
    // error of 1e-8.
    for (const double g : {-0.9, 0.0, 0.5, 0.95, 0.999}) {
        const std::vector<double> lobe = disc_single_lobe(0, g, 0.3, 720), expected = phase_averages(g, 720);
        for (std::size_t b = 0; b < lobe.size(); ++b) CHECK(lobe[b] == Approx(expected[b]).epsilon(1e-7));
    }
}

TEST_CASE("disc, deterministic: sigma = 0 is the phase function, and small sigma tends to it", "[disc]") {
    for (const double g : {0.0, 0.7}) {
        const DiscSolver solver(g);
        const std::vector<double> h = {0, 0.6, 1}, expected = phase_averages(g, 90);
        for (const double sigma : {0.0, 1e-300, 1e-30, 1e-6})
            for (const Profile& p : solver.solve(sigma, h, 90)) {
                REQUIRE(std::isfinite(p.lobe[0]));
                // The difference is of the order of the mean optical depth, <= 2 sigma; rounding and quadrature: 1e-7.
                CHECK(distance(p.lobe, expected) < 1e-7 + 4 * sigma);
            }
        CHECK(solver.solve(0, h)[1].energy == 0);
        CHECK(solver.solve(1e-300, h)[0].energy == Approx(2e-300));
    }
}

TEST_CASE("disc, deterministic: un-normalised energy and normalisation", "[disc]") {
    // The solve does not use E, so single and multiple scattering must add up to it. Tolerance: the solver's target of
    // 1e-3, near the rim at h = 0.95 2e-3 (three points per mean free path), of energies near 1.
    for (const double sigma : {0.2, 3.0, 16.0})
        for (const double g : {-0.3, 0.0, 0.8}) {
            const std::vector<Profile> profiles = DiscSolver(g).solve(sigma, {0, 0.5, 0.8, 0.95}, 360);
            for (std::size_t i = 0; i < profiles.size(); ++i) {
                CAPTURE(sigma, g, i);
                CHECK(profiles[i].energy_error < (i < 3 ? 1e-3 : 2e-3));
                double sum = 0;
                for (const double x : profiles[i].lobe) sum += x;
                CHECK(sum * 2 * pi / 360 == Approx(1).epsilon(1e-12));
            }
        }
}

TEST_CASE("disc, deterministic: symmetry and continuity in h", "[disc]") {
    const DiscSolver solver(0.6);
    // The tangent ray is computed differently (from the source at the rim) than its neighbours (radiance over E).
    const std::vector<Profile> p = solver.solve(2, {1, 1 - 1e-6, 1 - 1e-12, 0.4, -0.4, -1}, 180);
    // 1 - h = 1e-6 shortens the path by 2 sigma sqrt(2e-6) = 6e-3 mean free paths.
    CHECK(distance(p[1].lobe, p[0].lobe) < 6e-3);
    CHECK(distance(p[2].lobe, p[0].lobe) < 1e-5);
    CHECK(p[0].energy == 0);
    for (std::size_t b = 0; b < 180; ++b) {
        CHECK(p[3].lobe[b] == Approx(p[4].lobe[179 - b]).epsilon(1e-6));
        CHECK(p[0].lobe[b] == Approx(p[5].lobe[179 - b]).epsilon(1e-6));
    }
}

TEST_CASE("disc, deterministic: the estimated error covers the difference from a finer grid", "[disc]") {
    const std::vector<double> h = {0, 0.3, 0.7, 0.9, 0.98, 1};
    for (const auto& [sigma, g, circles, modes, gap] :
         {std::tuple{0.5, 0.5, 40, 47, 0.1}, std::tuple{4.0, 0.3, 56, 55, 0.12}, std::tuple{2.0, 0.85, 44, 63, 0.06}}) {
        const std::vector<Profile> ours = DiscSolver(g).solve(sigma, h, 360);
        DiscOptions finer;
        finer.circles = circles, finer.modes = modes, finer.gap = gap, finer.rim = 0.002;
        const std::vector<Profile> reference = DiscSolver(g, finer).solve(sigma, h, 360);
        for (std::size_t i = 0; i < h.size(); ++i) {
            CAPTURE(sigma, g, h[i]);
            const double error = distance(ours[i].lobe, reference[i].lobe);
            CHECK(error <= ours[i].standard_error + reference[i].standard_error);
            CHECK(error < 1e-3);  // the target
            CHECK(error > 0);
        }
    }
}

TEST_CASE("disc, deterministic: agrees with the analog tracer", "[disc]") {
    const std::size_t bins = 36;
    for (const auto& [sigma, g, h] : {std::tuple{1.0, 0.8, 0.0}, std::tuple{3.0, 0.4, 0.7}}) {
        TraceOptions options;
        options.paths = 400000;
        const Profile traced = trace_disc(sigma, g, h, bins, options);
        const Profile solved = DiscSolver(g).solve(sigma, {h}, bins)[0];
        double chi2 = 0;
        for (std::size_t b = 0; b < bins; ++b) {
            const double width = 2 * pi / static_cast<double>(bins), p = solved.lobe[b] * width;
            const double variance = p * (1 - p) / static_cast<double>(options.paths);
            const double z = (traced.lobe[b] * width - p) / std::sqrt(variance);
            chi2 += z * z;
            CHECK(std::abs(z) < 5);  // 36 bins: 2e-5
        }
        CHECK(chi2 < 76);  // 35 degrees of freedom: 1e-4 above 76
    }
}

TEST_CASE("disc, deterministic: lobes of an independent solver", "[disc]") {
    nlohmann::json data;
    std::ifstream(MEDULLA_TEST_DATA "/disc_lobes.json") >> data;
    REQUIRE(data["cells"].size() == 11);
    for (const auto& cell : data["cells"]) {
        const double sigma = cell["sigma"], g = cell["g"], h = cell["h"], stated = cell["relative_error"];
        std::vector<double> reference = cell["lobe"];
        double sum = 0;
        for (const double x : reference) sum += x;
        for (double& x : reference) x /= sum * 2 * pi / static_cast<double>(reference.size());
        const Profile p = DiscSolver(g).solve(sigma, {h}, reference.size())[0];
        CAPTURE(sigma, g, h);
        CHECK(p.energy == Approx(cell["energy"].get<double>()).epsilon(1e-12));
        // That solver has one chord in the first ring and linear interpolation in psi: for g >= 0.5 near the centre its
        // error exceeds its estimate. The differences here are 2.2e-3, 1.4e-4 and 3.1e-3; 2e7 (6e6) traced paths,
        // projected on the difference, give 0.03 +- 0.08 and 0.19 +- 0.13 for the first and last (0: ours is right,
        // 1: the other).
        const bool understated = (sigma == 1 && g == 0.8) || (sigma == 2 && g == 0.5) || (sigma == 8 && g == 0.85);
        if (!understated) {
            CHECK(distance(p.lobe, reference) < stated + p.standard_error);
        } else if (sigma == 1) {
            TraceOptions options;
            options.paths = 3000000;
            const Profile traced = trace_disc(sigma, g, h, reference.size(), options);
            double projection = 0, norm = 0, variance = 0;
            for (std::size_t b = 0; b < reference.size(); ++b) {
                const double difference = reference[b] - p.lobe[b];
                projection += difference * (traced.lobe[b] - p.lobe[b]);
                norm += difference * difference;
                variance += difference * difference * p.lobe[b] * static_cast<double>(reference.size()) / (2 * pi) /
                            static_cast<double>(options.paths);
            }
            const double deviation = std::sqrt(variance) / norm;
            CHECK(std::abs(projection / norm) < 3 * deviation);
            CHECK(projection / norm < 1 - 3 * deviation);
        }
    }
}

TEST_CASE("disc, deterministic: errors are below the target and estimates cover them, near the rim and at high g",
          "[disc]") {
    // The hardest cells: narrow p, offsets from 0.9 to the tangent.
    const std::vector<double> h = {0, 0.5, 0.9, 0.95, 0.9781476, 0.9945219, 0.9976687, 1};
    for (const auto& [sigma, g] : {std::pair{1.0, 0.95}, std::pair{4.0, 0.95}, std::pair{8.0, 0.9}}) {
        DiscOptions finer;
        finer.target_error = 1e-4, finer.estimate_error = false;
        const std::vector<Profile> truth = DiscSolver(g, finer).solve(sigma, h, 720);
        const std::vector<Profile> ours = DiscSolver(g).solve(sigma, h, 720);
        double sum = 0;
        for (std::size_t i = 0; i < h.size(); ++i) {
            CAPTURE(sigma, g, h[i]);
            const double error = distance(ours[i].lobe, truth[i].lobe);
            CHECK(error < 1e-3);  // the default target
            CHECK(ours[i].standard_error >
                  0.5 * error - 1e-5);  // an estimate, not a bound; 1e-5: error of the reference
            sum += ours[i].standard_error / error;
        }
        CHECK(sum / static_cast<double>(h.size()) < 8);  // nor far above (documented: 1 to 5, more for narrow lobes)
    }
}

TEST_CASE("disc, deterministic: mean path length", "[disc]") {
    // Closed form: the mean path of isotropic uniform light in the disc is pi / 2 for every sigma and g; its offsets h
    // are uniform. Unscattered light travels c = 2 sqrt(1 - h^2).
    const int points = 48;
    std::vector<double> h;
    for (int i = 0; i < points; ++i) h.push_back(std::sin(0.5 * pi * (i + 0.5) / points));  // midpoints in asin h
    for (const auto& [sigma, g] :
         {std::pair{0.0, 0.5}, std::pair{1e-9, 0.0}, std::pair{0.5, 0.9}, std::pair{3.0, -0.7}, std::pair{10.0, 0.8}}) {
        double mean = 0;
        const std::vector<Profile> p = DiscSolver(g).solve(sigma, h, 8);
        for (int i = 0; i < points; ++i) {
            const double chord = 2 * std::sqrt(1 - h[i] * h[i]);
            mean += (p[i].energy * p[i].mean_length + chord * std::exp(-sigma * chord)) * std::sqrt(1 - h[i] * h[i]) *
                    0.5 * pi / points;
            CHECK(std::isfinite(p[i].mean_length));
            CHECK(p[i].mean_length > 0);
        }
        CAPTURE(sigma, g);
        // Error of the midpoint rule in asin h: 3e-4; of the solver's energies: 5e-4.
        CHECK(mean == Approx(0.5 * pi).epsilon(1e-3));
    }
}

TEST_CASE("disc, deterministic: absorption against the analog tracer's one set of paths", "[disc][absorption]") {
    const std::size_t bins = 24;
    const std::vector<double> absorption = {0, 0.02, 0.5, 3};
    for (const auto& [sigma, g, h] :
         {std::tuple{1.0, 0.8, 0.3}, std::tuple{4.0, 0.3, 0.8}, std::tuple{6.0, 0.9, 0.0}, std::tuple{0.0, 0.4, 0.6}}) {
        TraceOptions options;
        options.paths = 200000;
        const DiscSolver solver(g);
        const std::vector<Profile> traced = trace_disc(sigma, g, h, absorption, bins, options);
        const Profile free = trace_disc(sigma, g, h, bins, options);
        CHECK(traced[0].lobe == free.lobe);
        CHECK(traced[0].standard_error == free.standard_error);
        CHECK(traced[0].energy == free.energy);
        for (std::size_t j = 0; j < absorption.size(); ++j) {
            const Profile solved = solver.solve(sigma, absorption[j], {h}, bins)[0];
            CAPTURE(sigma, absorption[j], g, h);
            // The standard deviation of a length is below twice its mean here: 4 standard errors of 2 / sqrt(paths).
            CHECK(solved.mean_length == Approx(traced[j].mean_length).epsilon(4 * 2 / std::sqrt(200000.0)));
            CHECK(std::abs(solved.energy - traced[j].energy) <= 4 * traced[j].energy_error + solved.energy_error);
            if (j > 0 && sigma > 0) CHECK(solved.energy < traced[j - 1].energy);
            CHECK(solved.energy_error <= 1e-3 * solved.energy);
            // The expected distance of lobes is the standard error of the traced one; 1.6 times that is 8 sigma for 24
            // bins.
            CHECK(distance(traced[j].lobe, solved.lobe) < 1.6 * traced[j].standard_error);
            // Absorption changes the lobe, except at sigma = 0, where light scatters once.
            if (absorption[j] >= 0.5 && sigma > 0)
                CHECK(distance(traced[0].lobe, solved.lobe) > 5 * traced[j].standard_error);
        }
    }
}

TEST_CASE("disc, deterministic: isotropic uniform light loses pi / 2 per unit of absorption", "[disc][absorption]") {
    // Blanco and Fournier 2003: the mean path of all light is pi / 2 for every sigma and g, so the scattered energy
    // falls by pi / 2 minus the path of the unscattered share, both integrals over the chords. Midpoint rule in asin h
    // as above; mean_length against a central difference of energies for a > 0.
    for (const auto& [sigma, g] : {std::pair{0.5, 0.0}, std::pair{3.0, 0.7}}) {
        const DiscSolver solver(g);
        const int points = 40;
        std::vector<double> h;
        for (int i = 0; i < points; ++i) h.push_back(std::sin(0.5 * pi * (i + 0.5) / points));
        const double a = 1e-5;
        const std::vector<Profile> clear = solver.solve(sigma, 0, h, 8), little = solver.solve(sigma, a, h, 8);
        double lost = 0;  // energy lost by all light / a
        for (int i = 0; i < points; ++i) {
            const double half = std::sqrt(1 - h[i] * h[i]), through = std::exp(-2 * sigma * half);
            lost += (clear[i].energy - little[i].energy) / a * half * 0.5 * pi / points;
            lost += through * 2 * half * half * 0.5 * pi / points;
        }
        CAPTURE(sigma, g);
        CHECK(lost == Approx(0.5 * pi).epsilon(1e-3));
        // The same grid for both, so that its error cancels in the difference.
        DiscOptions fixed;
        fixed.circles = 16, fixed.modes = 46, fixed.estimate_error = false;
        const DiscSolver one(g, fixed);
        for (const double sigma_a : {0.3, 2.0}) {
            const double step = 0.01;
            const std::vector<Profile> below = one.solve(sigma, sigma_a - step, h, 8),
                                       here = one.solve(sigma, sigma_a, h, 8),
                                       above = one.solve(sigma, sigma_a + step, h, 8);
            for (int i = 0; i < points; ++i) {
                const double slope = std::log(below[i].energy / above[i].energy) / (2 * step);
                CAPTURE(sigma_a, h[i]);
                // Errors of lengths: 3e-5 / (share of collided light that leaves), which is above a quarter here.
                CHECK(here[i].mean_length == Approx(slope).epsilon(1e-3).margin(2e-4));
            }
        }
    }
}

TEST_CASE("disc, deterministic: limits of absorption", "[disc]") {
    const DiscSolver solver(0.6);
    const std::vector<double> h = {0, 0.7, 1};
    const std::vector<Profile> clear = solver.solve(3, h, 90), none = solver.solve(3, 0, h, 90);
    const std::vector<Profile> little = solver.solve(3, 1e-6, h, 90), much = solver.solve(3, 1000, h, 90);
    for (std::size_t i = 0; i < h.size(); ++i) {
        CHECK(none[i].lobe == clear[i].lobe);
        CHECK(none[i].energy == clear[i].energy);
        // d energy / d sigma_a = -energy mean_length. (1 - ratio) has an error of 1e-10 relative to 1e-6 * length.
        if (h[i] < 1)
            CHECK((1 - little[i].energy / clear[i].energy) / 1e-6 == Approx(clear[i].mean_length).epsilon(1e-3));
        // sigma_a -> infinity: single scattering with extinction sigma + sigma_a, a closed form. At most
        // sigma / (sigma + sigma_a) = 3e-3 of it is scattered again.
        CHECK(distance(much[i].lobe, [&] {
                  std::vector<double> lobe = disc_single_lobe(1003, 0.6, h[i], 90);
                  double sum = 0;
                  for (const double x : lobe) sum += x * 2 * pi / 90;
                  for (double& x : lobe) x /= sum;
                  return lobe;
              }()) < 3e-3);
    }
}

TEST_CASE("disc, deterministic: stress", "[disc][stress]") {
    const std::vector<double> h = {0, 5e-324, 0.5, 1 - 1e-7, 1, -1, -1 + 1e-12};
    for (const double g : {-0.99, -0.5, 0.0, 5e-324, 1e-300, 0.95, 0.999})
        for (const double sigma : {0.0, 5e-324, 1e-300, 1e-8, 1.0, 100.0, 1000.0}) {
            DiscOptions coarse;
            coarse.target_error = sigma < 100 ? 1e-2 : 1e-1;
            const std::vector<Profile> profiles = DiscSolver(g, coarse).solve(sigma, h, 72);
            for (std::size_t i = 0; i < h.size(); ++i) {
                CAPTURE(g, sigma, h[i]);
                const Profile& p = profiles[i];
                const double half = std::sqrt((1 - h[i]) * (1 + h[i]));
                CHECK(p.energy == Approx(-std::expm1(-2 * sigma * half)).epsilon(1e-12).margin(0));
                double sum = 0;
                bool density = true;
                for (const double x : p.lobe) density = density && std::isfinite(x) && x >= 0, sum += x * 2 * pi / 72;
                CHECK(density);
                CHECK(sum == Approx(1).epsilon(1e-12));
                CHECK((std::isfinite(p.mean_length) && std::isfinite(p.standard_error) && p.standard_error >= 0));
                // Within the range of the grids the estimate is small; from sigma = 100 on it is arbitrary.
                if (sigma <= 1) CHECK(p.standard_error < 5e-2);
            }
            CHECK(profiles[0].lobe == profiles[1].lobe);  // a denormal offset equals 0
        }
}

TEST_CASE("disc, deterministic: bad arguments", "[disc]") {
    CHECK_THROWS_AS(DiscSolver(1), std::invalid_argument);
    CHECK_THROWS_AS(DiscSolver(std::nan("")), std::invalid_argument);
    const DiscSolver solver(0);
    CHECK_THROWS_AS(solver.solve(-1, {0}), std::invalid_argument);
    CHECK_THROWS_AS(solver.solve(std::numeric_limits<double>::infinity(), {0}), std::invalid_argument);
    CHECK_THROWS_AS(solver.solve(1, {1.5}), std::invalid_argument);
    CHECK_THROWS_AS(solver.solve(1, {0}, 0), std::invalid_argument);
}

TEST_CASE("Stated errors include the iteration error left at the limit of steps", "[disc]") {
    // Lobes whose error still exceeds the target, against the converged ones.
    const std::vector<double> h = {0, 0.5, 0.9};
    int coarse = 0;
    for (const double sigma : {2.0, 16.0, 60.0})
        for (const double g : {-0.5, 0.0, 0.8})
            for (const double absorption : {0.0, 1.0}) {
                DiscOptions options;
                options.target_error = 1e-2;
                const std::vector<Profile> right = DiscSolver(g, options).solve(sigma, absorption, h, 72);
                for (const int steps : {1, 2, 4, 8}) {
                    options.most_steps = steps;
                    for (const bool two_grids : {true, false}) {
                        options.estimate_error = two_grids;
                        const std::vector<Profile> found = DiscSolver(g, options).solve(sigma, absorption, h, 72);
                        for (std::size_t i = 0; i < h.size(); ++i) {
                            CAPTURE(sigma, g, absorption, steps, h[i]);
                            const double error = distance(found[i].lobe, right[i].lobe);
                            CHECK(error <= found[i].standard_error + 1e-3);  // where the steps sufficed: float rounding
                            CHECK(std::abs(found[i].energy - right[i].energy) <= found[i].energy_error + 1e-3);
                            CHECK(std::abs(found[i].mean_length / right[i].mean_length - 1) <=
                                  found[i].standard_error + 2e-3);
                            coarse += error > 1e-2;
                        }
                    }
                }
            }
    CHECK(coarse > 100);
}
