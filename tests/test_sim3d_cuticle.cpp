// Facets of the cuticle: how they are drawn, where they send light, that they keep energy and are reciprocal.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <vector>

#include "medulla/config.hpp"
#include "sim3d/cuticle_surface.hpp"
#include "sim3d/fibre_walk.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;
using namespace medulla::sim3d;

namespace {
constexpr double degree = pi / 180;
double density(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * pi); }
double below(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }
}  // namespace

TEST_CASE("Cuticle: visible slopes have the density of their projected area", "[sim3d]") {
    for (const double mu : {-4.0, -1.2, -0.9, -0.2, 0.0, 0.3, 1.0, 3.0, 9.0}) {
        const double mass = mu * below(mu) + density(mu);
        if (mu > -3) CHECK(std::abs(visible_mass(mu) - mass) <= 1e-14);
        // Distribution of p: (mu (Phi(p) - Phi(-mu)) + phi(mu) - phi(p)) / mass over p > -mu.
        const int n = 40000, cells = 40;
        std::vector<double> counts(cells), probability(cells);
        const double low = std::max(-mu, -4.0), step = (std::max(4.0, low + 2) - low) / cells;
        for (int i = 0; i < n; ++i) {
            sim2d::RandomStream random(4, std::uint64_t(i), 7);
            const double p = sample_visible(mu, random);
            REQUIRE(p >= -mu);
            counts[std::size_t(std::min(cells - 1.0, std::max(0.0, (p - low) / step)))] += 1;
        }
        for (std::size_t k = 0; k < probability.size(); ++k) {
            const int fine = 200;
            for (int i = 0; i < fine; ++i) {
                const double p = low + (double(k) + (i + 0.5) / fine) * step;
                probability[k] += (mu + p) * density(p) * step / fine / mass;
            }
        }
        double rest = 1;
        for (const double p : probability) rest -= p;
        CHECK(std::abs(rest) < 2e-3);  // beyond the first and last cell
        probability.back() += rest;
        CHECK(test::chi_squared_p(counts, probability, n) > 1e-4);
    }
}

TEST_CASE("Cuticle: R has the closed density of its facets", "[sim3d]") {
    // One reflection at a visible facet of slopes (a, b): per steradian P(a, b) F / (4 Z m_r^4), m the half vector.
    Fibre f;
    f.alpha = 4 * degree, f.beta_m = 14 * degree, f.beta_n = 10 * degree;
    Light light;
    light.theta_i = 0.5, light.h_low = light.h_high = 0.4;
    FibreOptions o;
    o.paths = 1000000, o.theta_bins = 60, o.phi_bins = 90;
    const FibreProfile profile = walk_fibre(f, light, o);
    const auto d = profile.density(only(Class::R));
    const Vec3 i{std::sin(0.5), std::cos(0.5), 0}, r{0, std::sqrt(1 - 0.16), -0.4}, t{0, 0.4, std::sqrt(1 - 0.16)};
    const double tilt = std::tan(2 * degree), sm = 7 * degree, sn = 5 * degree;
    const double seen = dot(i, r) + tilt * i.x, K = std::hypot(sm * i.x, sn * dot(i, t));
    const double Z = K * (seen / K * below(seen / K) + density(seen / K));
    std::vector<double> counts, probability;
    double missed = double(profile.paths()), rest = 1;
    const int fine = 6;
    for (std::size_t a = 0; a < d.theta_bins; ++a)
        for (std::size_t b = 0; b < d.phi_bins; ++b) {
            double mean = 0;
            for (int u = 0; u < fine; ++u)
                for (int v = 0; v < fine; ++v) {
                    const double theta = ((double(a) + (u + 0.5) / fine) / double(d.theta_bins) - 0.5) * pi;
                    const double phi = ((double(b) + (v + 0.5) / fine) / double(d.phi_bins) - 0.5) * 2 * pi;
                    const Vec3 out{std::sin(theta), std::cos(theta) * std::cos(phi), std::cos(theta) * std::sin(phi)};
                    if (dot(out, r) <= 0 || dot(out, r) + tilt * out.x <= 0) continue;
                    Vec3 m = i + out;
                    m = m * (1 / std::sqrt(dot(m, m)));
                    const double mr = dot(m, r), x = (m.x / mr - tilt) / sm, y = dot(m, t) / mr / sn;
                    const double P = density(x) * density(y) / (sm * sn);
                    const double F = layered_reflectance(f.eta_c * f.eta_c - 1, dot(i, m), f.layers);
                    mean += P * F / (4 * Z * mr * mr * mr * mr) * std::cos(theta) / (fine * fine);
                }
            counts.push_back(d.value[a * d.phi_bins + b] * d.bin_area() * double(profile.paths()));
            probability.push_back(mean * d.bin_area());
            missed -= counts.back(), rest -= probability.back();
        }
    counts.push_back(missed), probability.push_back(rest);
    CHECK(1 - rest > 0.08);
    CHECK(test::chi_squared_p(counts, probability, double(profile.paths())) > 1e-4);
}

TEST_CASE("Cuticle: a surface as rough as can be keeps energy and is reciprocal", "[sim3d]") {
    // Flux from directions near i to directions near o, through facets that light meets several times, is that from -o
    // to -i: outside to outside, and outside to inside with the index's square.
    Fibre f;
    f.beta_m = 1.2, f.beta_n = 0.8, f.eta_c = 1.4, f.layers = 0.5;
    const CuticleSurface surface(f);
    const Vec3 normal{0, 1, 0};
    struct Cone {
        Vec3 axis;  ///< direction of travel
        Side side;
    };
    const auto unit = [](Vec3 a) { return a * (1 / std::sqrt(dot(a, a))); };
    const double cosine = 0.95;  // a cone's half-angle
    const auto flux = [&](Cone from, Cone to, std::uint64_t cell) {
        const int n = 300000;
        double sum = 0, squares = 0;
        for (int k = 0; k < n; ++k) {
            sim2d::RandomStream random(6, cell, std::uint64_t(k));
            const double c = cosine + (1 - cosine) * random.uniform(), s = std::sqrt(1 - c * c);
            const auto w = random.direction();
            const Vec3 e = unit({from.axis.y, -from.axis.x, 0});
            const Vec3 g{from.axis.y * e.z - from.axis.z * e.y, from.axis.z * e.x - from.axis.x * e.z,
                         from.axis.x * e.y - from.axis.y * e.x};
            Vec3 d = from.axis * c + e * (s * w.x) + g * (s * w.y);
            const double weight = std::abs(d.y);
            const Side left = surface.leave(d, from.side, normal, random);
            const double x = left == to.side && dot(d, to.axis) > cosine ? weight : 0;
            sum += x, squares += x * x;
        }
        return Estimate{sum / n, std::sqrt(squares) / n};
    };
    const Vec3 down = unit({0.8, -0.5, 0.3}), up = unit({-0.1, 0.6, 0.7}), in = unit({0.3, -0.6, -0.2});
    const Estimate a = flux({down, Side::outside}, {up, Side::outside}, 1),
                   b = flux({up * -1, Side::outside}, {down * -1, Side::outside}, 2);
    CHECK(a.error < 0.05 * a.value);
    CHECK(std::abs(a.value - b.value) <= 5 * std::hypot(a.error, b.error));
    const Estimate c = flux({down, Side::outside}, {in, Side::inside}, 3),
                   e = flux({in * -1, Side::inside}, {down * -1, Side::outside}, 4);
    const double n2 = f.eta_c * f.eta_c;  // radiance over index^2 is what is conserved
    CHECK(c.error < 0.05 * c.value);
    CHECK(std::abs(c.value - n2 * e.value) <= 5 * std::hypot(c.error, n2 * e.error));
}

TEST_CASE("Cuticle: small tilts shift, and small slopes widen, R, TT and TRT", "[sim3d]") {
    // At h = 0 and theta_i = 0 to first order: shifts alpha (1 - p eta), deviations beta for R and
    // (beta / 2) sqrt(2 (eta - 1)^2 + 4 (p - 1) eta^2) for p >= 1. What is dropped is angle^2 times eta^2: 3e-4.
    Fibre f;
    f.alpha = f.beta_m = f.beta_n = 0.5 * degree, f.layers = 3;
    const FibreWalker walker(f, Light());
    double count[3] = {}, sum[3] = {}, squares[3] = {};
    for (std::uint64_t k = 0; k < 300000; ++k) {
        sim2d::RandomStream random(8, 0, k);
        const PathExit e = walker.follow(0, random);
        const auto p = static_cast<std::size_t>(e.kind);
        if (p > 2) continue;
        const double theta = std::asin(e.direction.x) / f.alpha;
        count[p] += 1, sum[p] += theta, squares[p] += theta * theta;
    }
    const double eta = f.eta_c, shift[3] = {1, 1 - eta, 1 - 2 * eta};
    const double wide[3] = {1, std::sqrt(0.5) * (eta - 1), 0.5 * std::sqrt(2 * (eta - 1) * (eta - 1) + 4 * eta * eta)};
    for (std::size_t p = 0; p < 3; ++p) {
        const double mean = sum[p] / count[p], deviation = std::sqrt(squares[p] / count[p] - mean * mean);
        CHECK(std::abs(mean - shift[p]) <= 5 * wide[p] / std::sqrt(count[p]) + 3e-4 * eta * eta);
        CHECK(std::abs(deviation - wide[p]) <= 5 * wide[p] / std::sqrt(2 * count[p]) + 3e-4 * eta * eta);
    }
    f.tilt = Tilt::scale;  // the scales' own tilt: twice as much
    CHECK(std::abs(CuticleSurface(f).tilt() - std::tan(f.alpha)) < 1e-15);
}
