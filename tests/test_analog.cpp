// The analog tracer against closed forms (docs/physics.md, sections 2 to 4).
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include "sim2d/reference/analog.hpp"

using namespace medulla;
using namespace medulla::sim2d;

namespace {

TraceOptions options(std::uint64_t paths, FirstCollision first, std::uint64_t cell = 0) {
    TraceOptions o;
    o.paths = paths;
    o.first = first;
    o.cell = cell;
    o.seed = 11;
    return o;
}

/// Singly scattered C^N by Simpson's rule along the chord.
double single_disc(double sigma, double g, double h, double phi) {
    const double half = std::sqrt(1 - h * h);
    const int n = 400;
    double sum = 0;
    for (int i = 0; i <= n; ++i) {
        const double t = 2 * half * i / n, x = -half + t;
        const double along = x * std::cos(phi) + h * std::sin(phi), across = x * std::sin(phi) - h * std::cos(phi);
        const double d = std::sqrt(std::max(0.0, 1 - across * across)) - along;
        sum += (i == 0 || i == n ? 1 : (i % 2 ? 4 : 2)) * std::exp(-sigma * (t + d));
    }
    return sigma * planar_hg_pdf(phi, g) * sum * 2 * half / n / 3;
}

}  // namespace

TEST_CASE("Disc: scattered energy is 1 - exp(-2 sigma sqrt(1 - h^2)) in every cell", "[analog]") {
    std::uint64_t cell = 0;
    for (const double sigma : {0.05, 0.5, 2.0, 8.0})
        for (const double g : {-0.5, 0.0, 0.6, 0.95})
            for (const double h : {0.0, 0.4, -0.9, 0.999}) {
                const Profile p = trace_disc(sigma, g, h, 36, options(20000, FirstCollision::analog, ++cell));
                const double expected = -std::expm1(-2 * sigma * std::sqrt(1 - h * h));
                CHECK(std::abs(p.energy - expected) <= 5 * p.energy_error);
            }
}

TEST_CASE("Slab: scattered energy is 1 - exp(-2 sigma / cos theta_i) in every cell", "[analog]") {
    std::uint64_t cell = 0;
    for (const double sigma : {0.05, 0.5, 4.0})
        for (const double g : {0.0, 0.8})
            for (const double theta_i : {0.0, 0.7, 1.4}) {
                const SlabProfile p = trace_slab(sigma, g, theta_i, 18, options(20000, FirstCollision::analog, ++cell));
                const double expected = -std::expm1(-2 * sigma / std::cos(theta_i)), n = 20000;
                const double error = std::sqrt(expected * (1 - expected) / n);
                CHECK(std::abs(p.back.energy + p.forward.energy - expected) <= 5 * error);
            }
}

TEST_CASE("Disc: at small sigma the lobe is the singly scattered one", "[analog]") {
    const double sigma = 0.02, g = 0.5, h = 0.3;
    const std::size_t bins = 24;
    const std::uint64_t paths = 400000;
    const Profile p = trace_disc(sigma, g, h, bins, options(paths, FirstCollision::forced));
    const double width = 2 * pi / static_cast<double>(bins);
    for (std::size_t b = 0; b < bins; ++b) {
        double expected = 0;  // bin average over 8 midpoints
        for (int i = 0; i < 8; ++i)
            expected += single_disc(sigma, g, h, -pi + (static_cast<double>(b) + (i + 0.5) / 8) * width) / 8;
        expected /= p.energy;
        const double probability = expected * width;
        const double noise = std::sqrt(probability * (1 - probability) / static_cast<double>(paths)) / width;
        // At most 1 - exp(-2 sigma) = 4 % of the scattered light is scattered again.
        CHECK(std::abs(p.lobe[b] - expected) < 5 * noise + 0.04 * p.lobe[b]);
    }
}

TEST_CASE("Disc: mirror symmetry and the sigma -> 0 limit", "[analog]") {
    const std::size_t bins = 16;
    const std::uint64_t paths = 200000;
    const Profile a = trace_disc(2, 0.6, 0.7, bins, options(paths, FirstCollision::forced, 1));
    const Profile b = trace_disc(2, 0.6, -0.7, bins, options(paths, FirstCollision::forced, 2));
    const Profile limit = trace_disc(0, 0.6, 0.7, bins, options(paths, FirstCollision::forced, 3));
    const double width = 2 * pi / bins;
    for (std::size_t i = 0; i < bins; ++i) {
        const double x = a.lobe[i], y = b.lobe[bins - 1 - i];
        CHECK(std::abs(x - y) < 5 * std::sqrt((x + y) / width / static_cast<double>(paths)));
        // Normalised lobe of an empty disc: the phase function, by its CDF atan((1 + g) / (1 - g) tan(t / 2)) / pi.
        const auto cdf = [](double t) {
            return std::abs(t) > pi - 1e-9 ? (t > 0 ? 0.5 : -0.5) : std::atan(4 * std::tan(t / 2)) / pi;
        };
        const double p = cdf(-pi + width * static_cast<double>(i + 1)) - cdf(-pi + width * static_cast<double>(i));
        CHECK(std::abs(limit.lobe[i] * width - p) < 5 * std::sqrt(p * (1 - p) / static_cast<double>(paths)));
    }
}

TEST_CASE("Slab: reciprocity, and the sign of theta_r", "[analog]") {
    const std::size_t bins = 12;
    const std::uint64_t paths = 400000;
    const double width = pi / bins, sigma = 1.2, g = 0.5;
    const auto centre = [&](std::size_t b) { return -pi / 2 + (static_cast<double>(b) + 0.5) * width; };
    // cos(theta_i) raw(theta_i -> theta_r), both averaged over bins: light from the centre of a bin
    // represents the bin, with a curvature error of order width^2: 5 % covers it for these twelve bins away from
    // grazing.
    const std::size_t i = 4, r = 8;
    const SlabProfile there = trace_slab(sigma, g, centre(i), bins, options(paths, FirstCollision::forced, 1));
    const SlabProfile back = trace_slab(sigma, g, centre(r), bins, options(paths, FirstCollision::forced, 2));
    const double a = std::cos(centre(i)) * there.back.energy * there.back.lobe[r];
    const double b = std::cos(centre(r)) * back.back.energy * back.back.lobe[i];
    const double noise = 5 * std::sqrt((a + b) / width / static_cast<double>(paths));
    CHECK(std::abs(a - b) < noise + 0.05 * a);

    // Straight on is theta_r = -theta_i.
    const SlabProfile peaked = trace_slab(0.3, 0.8, 0.6, 36, options(paths, FirstCollision::forced, 3));
    const auto peak =
        std::max_element(peaked.forward.lobe.begin(), peaked.forward.lobe.end()) - peaked.forward.lobe.begin();
    const double at = -pi / 2 + (static_cast<double>(peak) + 0.5) * pi / 36;
    CHECK(std::abs(at + 0.6) < 0.3);
}

TEST_CASE("Mean path length under isotropic uniform illumination is pi / 2 for every sigma and g", "[analog]") {
    std::uint64_t cell = 0;
    for (const double sigma : {0.1, 1.0, 4.0})
        for (const double g : {-0.6, 0.0, 0.5, 0.9}) {
            ++cell;
            const int paths = 40000;
            double sum = 0, squares = 0;
            for (int i = 0; i < paths; ++i) {
                RandomStream random(5, cell, static_cast<std::uint64_t>(i));
                // Isotropic uniform light on the circle: any point, the inward direction with density cos / 2.
                const double s = 2 * random.uniform() - 1, c = std::sqrt((1 - s) * (1 + s));
                const double length = follow_path({-1, 0, {c, s}}, sigma, g, random).length;
                sum += length, squares += length * length;
            }
            const double mean = sum / paths, deviation = std::sqrt((squares / paths - mean * mean) / paths);
            CHECK(std::abs(mean - pi / 2) < 5 * deviation);
        }
}

TEST_CASE("Paths end and stay finite at the ends of every range", "[analog][stress]") {
    std::uint64_t cell = 0;
    for (const double sigma : {0.0, 5e-324, 1e-300, 1e-8, 1.0, 1e3})
        for (const double g : {-0.99, 0.0, 0.999})
            for (const double h : {0.0, 5e-324, 1.0, 1 - 1e-7, -1.0}) {
                const Profile p = trace_disc(sigma, g, h, 8, options(20, FirstCollision::forced, ++cell));
                double sum = 0;
                for (const double x : p.lobe) {
                    CHECK((std::isfinite(x) && x >= 0));
                    sum += x * 2 * pi / 8;
                }
                CHECK(sum == Approx(1).epsilon(1e-12));
                CHECK((std::isfinite(p.mean_length) && p.mean_length >= 0));
                CHECK(p.energy ==
                      Approx(-std::expm1(-2 * sigma * std::sqrt((1 - h) * (1 + h)))).epsilon(1e-12).margin(0));
            }
    for (const double sigma : {0.0, 5e-324, 1e-8, 1e3})
        for (const double g : {-0.99, 0.0, 0.999})
            for (const double theta_i : {0.0, 5e-324, 89.99 * pi / 180, pi / 2}) {
                const SlabProfile p = trace_slab(sigma, g, theta_i, 8, options(20, FirstCollision::forced, ++cell));
                CHECK((std::isfinite(p.back.energy) && std::isfinite(p.forward.energy)));
                CHECK(p.back.energy + p.forward.energy ==
                      Approx(theta_i == pi / 2 ? (sigma > 0 ? 1 : 0) : -std::expm1(-2 * sigma / std::cos(theta_i)))
                          .epsilon(1e-9)
                          .margin(1e-300));
                for (const Profile* side : {&p.back, &p.forward})
                    for (const double x : side->lobe) CHECK((std::isfinite(x) && x >= 0));
            }
    const Profile one = trace_disc(1, 0.5, 0.2, 8, options(1, FirstCollision::forced));
    CHECK(one.standard_error == 0);  // one count in one bin: its multinomial variance is 0
    const Profile none = trace_disc(0, 0.5, 0.2, 8, options(1000, FirstCollision::analog));
    CHECK((none.energy == 0 && none.lobe.empty()));
    CHECK_THROWS(trace_disc(-1, 0, 0, 8, {}));
    CHECK_THROWS(trace_disc(1, 1, 0, 8, {}));
    CHECK_THROWS(trace_disc(1, 0, 1.5, 8, {}));
    CHECK_THROWS(trace_disc(std::nan(""), 0, 0, 8, {}));
}

TEST_CASE("Random numbers do not repeat over 2^40 paths", "[analog][stress]") {
    // Both ends of the 32 bits of a counter word, the last path, and paths that differ in one bit only. 44 streams of
    // 4096 numbers of 52 bits: by chance two are equal once in 2.8 10^5 runs; the streams here are fixed.
    std::vector<std::uint64_t> paths{0, (1ull << 32) - 1, (1ull << 40) - 1, (1ull << 40) - 2};
    for (int bit = 0; bit < 40; ++bit) paths.push_back(1ull << bit);
    std::set<double> seen;
    double sum = 0, squares = 0;
    for (const std::uint64_t path : paths) {
        RandomStream random(11, 5, path);
        for (int i = 0; i < 4096; ++i) {
            const double u = random.uniform();
            seen.insert(u), sum += u, squares += u * u;
        }
    }
    const double n = 4096.0 * static_cast<double>(paths.size());
    CHECK(static_cast<double>(seen.size()) == n);
    CHECK(std::abs(sum / n - 0.5) < 5 * std::sqrt(1 / 12.0 / n));
    CHECK(std::abs(squares / n - 1 / 3.0) < 5 * std::sqrt(4 / 45.0 / n));
    // The last paths end like the first: mean number of collisions of 2 x 3000 paths, 5 standard errors.
    double count[2] = {0, 0}, square = 0;
    for (std::uint64_t i = 0; i < 3000; ++i)
        for (const int end : {0, 1}) {
            RandomStream random(11, 5, end ? (1ull << 40) - 1 - i : i);
            const auto c = static_cast<double>(follow_path({-1, 0, {1, 0}}, 20, 0.5, random).scatterings);
            count[end] += c / 3000, square += c * c / 6000;
        }
    CHECK(count[0] != count[1]);
    CHECK(std::abs(count[0] - count[1]) < 5 * std::sqrt(2 * square / 3000));
}
