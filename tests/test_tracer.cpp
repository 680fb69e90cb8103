// The fast tracer against the analog tracer, the deterministic solvers and closed forms (docs/physics.md, 2 to 4).
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>
#include <set>
#include <string>
#include <thread>

#include "sim2d/disc/deterministic.hpp"
#include "sim2d/disc/single.hpp"
#include "sim2d/quadrature.hpp"
#include "sim2d/reference/analog.hpp"
#include "sim2d/slab/deterministic.hpp"
#include "sim2d/slab/single.hpp"
#include "sim2d/tracer/kernel.hpp"
#include "sim2d/tracer/tracer.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;
using namespace medulla::sim2d;

namespace {

TracerOptions options(std::uint64_t paths, std::uint64_t seed = 1, double target = 0) {
    TracerOptions o;
    o.paths = paths, o.seed = seed, o.target_error = target;
    return o;
}

/// Squared relative L2 distance.
double distance2(const std::vector<double>& a, const std::vector<double>& b) {
    double d = 0, n = 0;
    for (std::size_t i = 0; i < a.size(); ++i) d += (a[i] - b[i]) * (a[i] - b[i]), n += b[i] * b[i];
    return d / n;
}

double sum(const std::vector<double>& v) { return std::accumulate(v.begin(), v.end(), 0.0); }

struct Moments {
    double mean, error;
};
Moments moments(const std::vector<double>& v) {
    const double n = static_cast<double>(v.size()), m = sum(v) / n;
    double s = 0;
    for (const double x : v) s += (x - m) * (x - m);
    return {m, std::sqrt(s / (n - 1) / n)};
}

/// p-value of an analog lobe of n paths, taking the fast one as exact.
double analog_p(const std::vector<double>& analog, const std::vector<double>& fast, double width, double n) {
    std::vector<double> counts, probability;
    for (std::size_t i = 0; i < fast.size(); ++i)
        counts.push_back(analog[i] * width * n), probability.push_back(fast[i] * width);
    return test::chi_squared_p(counts, probability, n);
}

TEST_CASE("The SIMD generator gives the same random words as the scalar Philox", "[tracer]") {
    TracerCell cell;
    cell.seed = 0x123456789ABCDEFull, cell.cell = 0xFEDCBA9876543210ull;
    for (const std::uint32_t order : {1u, 77u, 0xFFFFFFu})
        for (const std::uint32_t first : {0u, 0xFFFFFFF0u}) {
            const auto words = tracer_words(cell, order, 201, first, 37);
            for (std::uint32_t i = 0; i < words.size(); ++i) {
                const TracerCounter c = tracer_counter(cell, order, 201, first + i);
                CHECK(words[i] == philox(c.counter, c.key[0], c.key[1]));
            }
        }
}

TEST_CASE("Fast and analog tracer agree on both tables", "[tracer]") {
    // Bonferroni: 24 lobes at 1e-5 each. The error of the fast lobe is at most a tenth of that of the counts.
    const std::uint64_t paths = 40000;
    const auto n = static_cast<double>(paths);
    std::uint64_t cell = 0;
    for (const double sigma : {0.3, 2.0, 9.0})
        for (const double g : {-0.6, 0.4, 0.9}) {
            TraceOptions slow;
            slow.paths = paths, slow.cell = ++cell;
            const double h = 0.4, theta = 0.8;
            const Profile a = trace_disc(sigma, g, h, 48, slow);
            const Profile b = trace_expected_disc(sigma, g, h, 48, options(65536)).profile;
            INFO("sigma " << sigma << " g " << g);
            CHECK(analog_p(a.lobe, b.lobe, 2 * pi / 48, n) > 1e-5);
            CHECK(a.energy == Approx(b.energy).epsilon(1e-12));
            // 5 standard errors of a path length whose standard deviation is below three times its mean.
            CHECK(std::abs(a.mean_length - b.mean_length) < 15 * b.mean_length / std::sqrt(n));

            const SlabProfile c = trace_slab(sigma, g, theta, 24, slow);
            const SlabProfile d = trace_expected_slab(sigma, g, theta, 24, options(65536)).profile;
            for (const bool back : {true, false}) {
                const Profile &x = back ? c.back : c.forward, &y = back ? d.back : d.forward;
                const double here = n * x.energy / (c.back.energy + c.forward.energy);
                INFO("back " << back);
                CHECK(analog_p(x.lobe, y.lobe, pi / 24, here) > 1e-5);
                CHECK(std::abs(x.energy - y.energy) < 5 * std::hypot(x.energy_error, y.energy_error));
                CHECK(std::abs(x.mean_length - y.mean_length) < 15 * y.mean_length / std::sqrt(here));
            }
        }
}

TEST_CASE("Standard errors are those of independent repetitions against the deterministic solvers", "[tracer]") {
    // E[true error^2 - standard error^2] = 0 for an unbiased estimate with a correct error; tested at 5 standard errors
    // over 60 repetitions. The references' 1e-3 is negligible beside errors near 2 %: 0.3 % of the square.
    const std::vector<double> h{0.0, 0.55, 0.97}, theta{0.0, 0.7, 1.4};
    std::vector<double> all;  // ratio per cell: shows a common bias that is below the noise of single cells
    for (const double g : {0.0, 0.6, 0.95}) {
        const DiscSolver disc(g);
        const SlabSolver slab(g);
        for (const double sigma : {0.7, 8.0}) {
            const std::vector<Profile> exact = disc.solve(sigma, h, 360);
            const std::vector<SlabProfile> exact_slab = slab.solve(sigma, theta, 90);
            for (std::size_t i = 0; i < h.size(); ++i) {
                std::vector<double> difference[3], square[3];
                for (std::uint64_t seed = 1; seed <= 60; ++seed) {
                    const Profile p = trace_expected_disc(sigma, g, h[i], 360, options(512, seed)).profile;
                    const SlabProfile s = trace_expected_slab(sigma, g, theta[i], 90, options(512, seed)).profile;
                    const Profile* found[] = {&p, &s.back, &s.forward};
                    const Profile* truth[] = {&exact[i], &exact_slab[i].back, &exact_slab[i].forward};
                    for (std::size_t k = 0; k < 3; ++k) {
                        const double e = found[k]->standard_error;
                        difference[k].push_back(distance2(found[k]->lobe, truth[k]->lobe) - e * e);
                        square[k].push_back(e * e);
                    }
                }
                for (std::size_t k = 0; k < 3; ++k) {
                    const Moments m = moments(difference[k]);
                    const double scale = moments(square[k]).mean;
                    INFO("sigma " << sigma << " g " << g << " node " << i << " lobe " << k << " error "
                                  << std::sqrt(scale) << " excess " << m.mean / scale << " +- " << m.error / scale);
                    // The references' errors add their square to |true - found|^2, and a product that averages to 0.
                    CHECK(std::abs(m.mean) < 5 * m.error + 4e-6);
                    all.push_back(m.mean / scale);
                }
            }
        }
    }
    const Moments m = moments(all);
    CHECK(std::abs(m.mean) < 5 * m.error + 0.02);
}

TEST_CASE("Stated errors pass a chi-squared test for every stopping rule", "[tracer]") {
    // The slab's back energy over its stated error is Student's t of fifteen degrees, from sixteen randomisations:
    // p-values of independent repetitions are uniform. A target stops at runs that look good; they must pass as well.
    // Three tests at 1e-3.
    const double theta = 0.6;
    for (const TracerOptions& o : {options(1024), options(16384), options(1 << 20, 1, 0.03)}) {
        std::vector<double> p;
        for (const double g : {-0.5, 0.3, 0.8}) {
            const SlabSolver solver(g);
            for (const double sigma : {0.5, 2.0, 8.0}) {
                const double exact = solver.solve(sigma, {theta}, 24)[0].back.energy;
                TracerOptions run = o;
                for (run.seed = 1; run.seed <= 120; ++run.seed) {
                    const Profile back = trace_expected_slab(sigma, g, theta, 24, run).profile.back;
                    p.push_back(test::student_p((back.energy - exact) / back.energy_error, 15));
                }
            }
        }
        INFO("paths " << o.paths << " target " << o.target_error << " of " << p.size());
        CHECK(test::evenness_p(p, 20) > 1e-3);
    }
}

TEST_CASE("Mean path length: isotropic light on the disc pi / 2, on the slab pi, for every sigma and g", "[tracer]") {
    // Blanco and Fournier 2003: pi area / perimeter in the plane. Scattered and unscattered light together.
    const Quadrature rule = unit_gauss_legendre(24);
    for (const double sigma : {0.2, 2.0, 8.0})
        for (const double g : {-0.5, 0.0, 0.9}) {
            double disc = 0, slab = 0, disc_noise = 0;
            for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
                const double a = pi * (rule.nodes[i] - 0.5), weight = rule.weights[i] * pi * std::cos(a) / 2;
                const double chord = 2 * std::cos(a), e = disc_energy(sigma, std::sin(a));
                TracerOptions o = options(4096);
                o.cell = i;
                const double scattered = trace_expected_disc(sigma, g, std::sin(a), 16, o).profile.mean_length;
                disc += weight * (e * scattered + (1 - e) * chord);
                disc_noise += weight * weight * e * e * scattered * scattered / 4096;
                const double through = 2 / std::cos(a), f = slab_energy(sigma, a);
                const SlabProfile s = trace_expected_slab(sigma, g, a, 90, o).profile;
                slab += weight * (s.back.energy * s.back.mean_length + s.forward.energy * s.forward.mean_length +
                                  (1 - f) * through);
            }
            // The standard deviation of a path length is about its mean; 5 standard errors. The slab's has a heavier
            // tail: twice that.
            const double noise = 5 * std::sqrt(disc_noise);
            INFO("sigma " << sigma << " g " << g << " noise " << noise);
            CHECK(std::abs(disc - pi / 2) < noise + 1e-4);
            CHECK(std::abs(slab - pi) < 4 * noise + 1e-3);
        }
}

TEST_CASE("Every plan has the same mean", "[tracer]") {
    for (const Medium medium : {Medium::disc, Medium::slab})
        for (const double g : {-0.9, 0.3, 0.9}) {
            TracerCell cell;
            cell.medium = medium, cell.sigma = 3, cell.g = g, cell.h = 0.3, cell.theta_i = 0.9, cell.bins = 240;
            std::vector<TracerPlan> plans(5);
            plans[0].forced = 0, plans[0].roulette = 1e-6f,
            plans[0].turned = 1;  // analog flights, every vertex deposits
            plans[1].comb = 8;
            plans[2].comb = 8, plans[2].window = 48;
            plans[3].roulette = 3, plans[3].turned = 0.1f, plans[3].forced = 12, plans[3].keep = 0.9f;
            plans[4] = plan_of(cell);
            std::vector<std::vector<double>> mean(plans.size()), error(plans.size());
            for (std::size_t k = 0; k < plans.size(); ++k) {
                cell.plan = plans[k], cell.seed = k;
                PathTracer tracer(cell);
                std::vector<std::vector<double>> coarse(12);
                for (std::uint32_t r = 0; r < 24; ++r) {
                    TracerSums sums;
                    tracer.trace(r, 0, 512, sums);
                    REQUIRE(sums.paths == 512);
                    for (std::size_t c = 0; c < 12; ++c)
                        coarse[c].push_back(std::accumulate(sums.bins.begin() + std::ptrdiff_t(20 * c),
                                                            sums.bins.begin() + std::ptrdiff_t(20 * c + 20), 0.0));
                }
                for (const auto& c : coarse) {
                    const Moments m = moments(c);
                    mean[k].push_back(m.mean), error[k].push_back(m.error);
                }
            }
            for (std::size_t k = 1; k < plans.size(); ++k)
                for (std::size_t c = 0; c < 12; ++c) {
                    INFO("slab " << (medium == Medium::slab) << " g " << g << " plan " << k << " part " << c);
                    // 288 comparisons of t with 23 degrees of freedom: 6 fails one in 10^3 runs.
                    CHECK(std::abs(mean[k][c] - mean[0][c]) < 6 * std::hypot(error[k][c], error[0][c]));
                }
        }
}

TEST_CASE("Same bytes for any number of threads, other bytes for another seed or cell", "[tracer]") {
    const TracerOptions o = options(3000, 5);
    const auto disc = trace_expected_disc(4, 0.8, 0.3, 720, o);
    const auto slab = trace_expected_slab(4, 0.8, 0.3, 360, o);
    CHECK(disc.paths == 3008);
    std::vector<Traced<Profile>> discs(4);
    std::vector<Traced<SlabProfile>> slabs(4);
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            discs[t] = trace_expected_disc(4, 0.8, 0.3, 720, o);
            slabs[t] = trace_expected_slab(4, 0.8, 0.3, 360, o);
        });
    for (std::thread& t : threads) t.join();
    for (std::size_t t = 0; t < 4; ++t) {
        CHECK(discs[t].profile.lobe == disc.profile.lobe);
        CHECK(discs[t].profile.standard_error == disc.profile.standard_error);
        CHECK(slabs[t].profile.back.lobe == slab.profile.back.lobe);
        CHECK(slabs[t].profile.forward.mean_length == slab.profile.forward.mean_length);
    }
    TracerOptions other = o;
    other.cell = 1;
    CHECK(trace_expected_disc(4, 0.8, 0.3, 720, other).profile.lobe != disc.profile.lobe);
    CHECK(trace_expected_disc(4, 0.8, 0.3, 720, options(3000, 6)).profile.lobe != disc.profile.lobe);
}

TEST_CASE("target_error stops when it is reached, and says when it is not", "[tracer]") {
    const auto coarse = trace_expected_disc(4, 0.6, 0.3, 720, options(1 << 20, 1, 0.02));
    const auto fine = trace_expected_disc(4, 0.6, 0.3, 720, options(1 << 20, 1, 0.005));
    CHECK((coarse.reached && fine.reached && coarse.paths < fine.paths));
    CHECK((coarse.profile.standard_error <= 0.02 && fine.profile.standard_error <= 0.005));
    const auto never = trace_expected_slab(4, 0.6, 0.3, 360, options(2000, 1, 1e-9));
    CHECK((!never.reached && never.paths == 2000));
}

TEST_CASE("Mirror images", "[tracer]") {
    const std::size_t n = 180;
    const Profile centre = trace_expected_disc(2, 0.5, 0, n, options(1024)).profile;
    const SlabProfile normal = trace_expected_slab(2, 0.5, 0, n, options(1024)).profile;
    const Profile a = trace_expected_disc(2, 0.5, 0.6, n, options(65536, 1)).profile;
    Profile b = trace_expected_disc(2, 0.5, -0.6, n, options(65536, 2)).profile;
    std::reverse(b.lobe.begin(), b.lobe.end());
    for (std::size_t i = 0; i < n; ++i) {
        CHECK(centre.lobe[i] ==
              Approx(centre.lobe[n - 1 - i]).epsilon(1e-6));  // quadrature of the singly scattered lobe
        CHECK(normal.back.lobe[i] == Approx(normal.back.lobe[n - 1 - i]).epsilon(1e-6));
    }
    // The relative L2 error of a difference is sqrt(2) times that of either. It is a mean over bins, so a factor of 3
    // is far beyond its scatter.
    CHECK(std::sqrt(distance2(a.lobe, b.lobe)) < 3 * std::sqrt(2.0) * a.standard_error);
}

void check_lobe(const Profile& p, double width) {
    bool fine = true;
    for (const double x : p.lobe) fine = fine && std::isfinite(x) && x >= 0;
    CHECK(fine);
    CHECK(sum(p.lobe) * width == Approx(1).epsilon(1e-12));
    CHECK((std::isfinite(p.standard_error) && p.standard_error >= 0));
    CHECK((p.energy >= 0 && p.energy <= 1 && std::isfinite(p.energy_error)));
}

TEST_CASE("The tracer is finite and normalised at the ends of every range", "[tracer][stress]") {
    TracerOptions o = options(1);  // rounded up to sixteen, one per randomisation
    for (const double sigma : {0.0, 5e-324, 1e-300, 1e-38, 1e-8, 1.0, 1e3})
        for (const double g : {-0.99, 0.0, 0.999}) {
            for (const double h : {0.0, 5e-324, 1.0, 1 - 1e-7, -1.0}) {
                ++o.cell;
                INFO("sigma " << sigma << " g " << g << " h " << h);
                const auto t = trace_expected_disc(sigma, g, h, 24, o);
                CHECK(t.paths == 16);
                check_lobe(t.profile, 2 * pi / 24);
                CHECK(t.profile.energy == disc_energy(sigma, h));
                CHECK((std::isfinite(t.profile.mean_length) && t.profile.mean_length >= 0));
            }
            for (const double theta : {0.0, 5e-324, 89.99 * pi / 180, pi / 2, -pi / 2}) {
                ++o.cell;
                INFO("sigma " << sigma << " g " << g << " theta " << theta);
                const auto t = trace_expected_slab(sigma, g, theta, 12, o);
                check_lobe(t.profile.back, pi / 12), check_lobe(t.profile.forward, pi / 12);
                CHECK(t.profile.back.energy + t.profile.forward.energy ==
                      Approx(slab_energy(sigma, theta)).epsilon(1e-12).margin(1e-300));
                CHECK(!std::isnan(t.profile.back.mean_length));
            }
        }
    for (const std::size_t bins : {1, 7, 33})
        check_lobe(trace_expected_disc(2, 0.95, 0.1, bins, o).profile, 2 * pi / double(bins));
    o.seed = ~std::uint64_t{0}, o.cell = ~std::uint64_t{0};
    check_lobe(trace_expected_disc(2, 0.95, 0.1, 36, o).profile, 2 * pi / 36);
    // In the limit of an empty disc the lobe is the phase function.
    const Profile empty = trace_expected_disc(0, 0.5, 0.3, 90, options(1)).profile;
    for (std::size_t i = 0; i < 90; ++i) {
        const double low = -pi + double(i) * 2 * pi / 90;
        CHECK(empty.lobe[i] == Approx(planar_hg_integral(low, low + 2 * pi / 90, 0.5) * 90 / (2 * pi)).epsilon(1e-6));
    }
    CHECK_THROWS_AS(trace_expected_disc(-1, 0, 0, 8, {}), std::invalid_argument);
    CHECK_THROWS_AS(trace_expected_disc(1, 1, 0, 8, {}), std::invalid_argument);
    CHECK_THROWS_AS(trace_expected_disc(1, 0, 1.5, 8, {}), std::invalid_argument);
    CHECK_THROWS_AS(trace_expected_disc(std::nan(""), 0, 0, 8, {}), std::invalid_argument);
    CHECK_THROWS_AS(trace_expected_slab(1, 0, 2, 8, {}), std::invalid_argument);
    CHECK_THROWS_AS(trace_expected_slab(1, 0, 0, 0, {}), std::invalid_argument);
    CHECK_THROWS_AS(trace_expected_slab(1, 0, 0, 8, options(0)), std::invalid_argument);
}

TEST_CASE("Paths with absorption: lobes, energies and lengths agree with the deterministic solver",
          "[tracer][absorption]") {
    // As above: E[true error^2 - standard error^2] = 0 over independent repetitions, at 5 of its own standard errors,
    // for lobes and energies. Means over the repetitions at 5 standard errors. Errors of the reference: energies 2e-4,
    // lengths 1e-3 + 3e-5 / (share of collided light that leaves) (sim2d/disc/deterministic.hpp).
    const std::vector<double> absorption{0.0, 0.1, 1.0, 6.0}, h{0.0, 0.55, 0.97};
    for (const double g : {0.0, 0.6, 0.95}) {
        const DiscSolver solver(g);
        for (const double sigma : {0.05, 0.7, 8.0}) {
            std::vector<std::vector<Profile>> exact;
            for (const double a : absorption) exact.push_back(solver.solve(sigma, a, h, 360));
            for (std::size_t i = 0; i < h.size(); ++i) {
                std::vector<std::vector<double>> lobe(4), energy(4), excess(4), length(4);
                bool falls = true;
                for (std::uint64_t seed = 1; seed <= 40; ++seed) {
                    const auto found = trace_expected_disc(sigma, g, h[i], absorption, 360, options(512, seed)).profile;
                    for (std::size_t j = 0; j < 4; ++j) {
                        const Profile &p = found[j], &truth = exact[j][i];
                        const double e = p.standard_error, miss = p.energy - truth.energy;
                        lobe[j].push_back(distance2(p.lobe, truth.lobe) - e * e);
                        energy[j].push_back(p.energy), length[j].push_back(p.mean_length);
                        excess[j].push_back(miss * miss - p.energy_error * p.energy_error);
                        // The same paths: less energy is left, and it took the shorter paths.
                        if (j > 0) falls = falls && p.energy < found[j - 1].energy;
                    }
                }
                CHECK(falls);
                for (std::size_t j = 0; j < 4; ++j) {
                    const Profile& truth = exact[j][i];
                    const double extinction = sigma + absorption[j];
                    const double leaves = truth.energy / (disc_energy(extinction, h[i]) * sigma / extinction);
                    const Moments m = moments(lobe[j]), e = moments(energy[j]), x = moments(excess[j]),
                                  l = moments(length[j]);
                    INFO("sigma " << sigma << " g " << g << " h " << h[i] << " absorption " << absorption[j]);
                    INFO("lobe excess " << m.mean << " +- " << m.error << ", energy excess " << x.mean << " +- "
                                        << x.error);
                    INFO("energy " << e.mean << " +- " << e.error << " true " << truth.energy << " length " << l.mean
                                   << " +- " << l.error << " true " << truth.mean_length);
                    CHECK(std::abs(m.mean) < 5 * m.error + 4e-6 + 4 * truth.standard_error * truth.standard_error);
                    CHECK(std::abs(e.mean - truth.energy) < 5 * e.error + 2e-4 * truth.energy);
                    CHECK(std::abs(x.mean) < 5 * x.error + 4e-8 * truth.energy * truth.energy);
                    CHECK(std::abs(l.mean - truth.mean_length) <
                          5 * l.error + 1e-3 * truth.mean_length + 3e-5 / leaves);
                }
            }
        }
    }
}

TEST_CASE("Paths in the slab: mean path lengths on either side agree with the deterministic solver",
          "[tracer][paths]") {
    // Means over 20 repetitions at 5 standard errors. A mean path is a ratio, with a bias of O(1 / paths).
    for (const double g : {-0.5, 0.0, 0.9}) {
        const SlabSolver solver(g);
        for (const double sigma : {0.1, 1.0, 8.0})
            for (const double theta : {0.0, 1.2}) {
                const SlabProfile exact = solver.solve(sigma, {theta}, 90)[0];
                std::vector<double> back, forward;
                for (std::uint64_t seed = 1; seed <= 20; ++seed) {
                    const SlabProfile p = trace_expected_slab(sigma, g, theta, 90, options(4096, seed)).profile;
                    back.push_back(p.back.mean_length), forward.push_back(p.forward.mean_length);
                }
                const Moments b = moments(back), f = moments(forward);
                INFO("sigma " << sigma << " g " << g << " theta_i " << theta << " back " << b.mean << " +- " << b.error
                              << " true " << exact.back.mean_length << " forward " << f.mean << " +- " << f.error
                              << " true " << exact.forward.mean_length);
                CHECK(std::abs(b.mean - exact.back.mean_length) < 5 * b.error + 1e-3 * b.mean);
                CHECK(std::abs(f.mean - exact.forward.mean_length) < 5 * f.error + 1e-3 * f.mean);
            }
    }
}

TEST_CASE("Absorption 0 in the list gives the plain tracer's result, byte for byte", "[tracer][absorption]") {
    for (const double sigma : {0.0, 1e-8, 3.0}) {
        const Traced<Profile> plain = trace_expected_disc(sigma, 0.8, 0.4, 96, options(2048));
        const auto all = trace_expected_disc(sigma, 0.8, 0.4, {1.5, 0.0, 200.0}, 96, options(2048));
        CHECK(all.scatterings == plain.scatterings);
        CHECK(all.profile[1].lobe == plain.profile.lobe);
        CHECK(all.profile[1].standard_error == plain.profile.standard_error);
        CHECK(all.profile[1].energy == plain.profile.energy);
        CHECK(all.profile[1].mean_length == plain.profile.mean_length);
        // An empty disc: single scattering, a closed form, is everything.
        if (sigma < 1e-6)
            for (const std::size_t j : {0u, 2u}) {
                const double a = j == 0 ? 1.5 : 200;
                const std::vector<double> lobe = disc_single_lobe(a, 0.8, 0.4, 96);
                const double share = sum(lobe) * 2 * pi / 96;
                for (std::size_t b = 0; b < 96; ++b)
                    CHECK(all.profile[j].lobe[b] == Approx(lobe[b] / share).epsilon(1e-5).margin(1e-12));
                CHECK(all.profile[j].mean_length == Approx(disc_single_length(a, 0.8, 0.4) / share).epsilon(1e-5));
            }
    }
    CHECK_THROWS_AS(trace_expected_disc(1, 0, 0, {-1.0}, 8, {}), std::invalid_argument);
    CHECK_THROWS_AS(trace_disc(1, 0, 0, {std::nan("")}, 8, {}), std::invalid_argument);
}

TEST_CASE("Every instruction set traces the same paths", "[tracer]") {
    struct Restore {
        ~Restore() { set_tracer_target(""); }
    } restore;
    REQUIRE(!tracer_targets().empty());
    CHECK_THROWS_AS(set_tracer_target("no such"), std::invalid_argument);
    CHECK(tracer_targets().front() == tracer_target());
    std::vector<Profile> discs, backs;
    for (const std::string& target : tracer_targets()) {
        set_tracer_target(target);
        CHECK(target == tracer_target());
        discs.push_back(trace_expected_disc(3, 0.8, 0.3, 120, options(4096)).profile);
        backs.push_back(trace_expected_slab(3, 0.8, 0.3, 60, options(4096)).profile.back);
    }
    // The same random numbers with different rounding: paths diverge where 1e-7 decides, about one in 10^4 with some
    // ten decisions each. So the difference is 1e-2 of that of two independent runs; a tenth is far beyond it.
    for (std::size_t t = 1; t < discs.size(); ++t) {
        INFO(tracer_targets()[t] << ", difference over standard error "
                                 << std::sqrt(distance2(discs[t].lobe, discs[0].lobe)) / discs[0].standard_error);
        CHECK(std::sqrt(distance2(discs[t].lobe, discs[0].lobe)) < 0.1 * discs[0].standard_error);
        CHECK(std::sqrt(distance2(backs[t].lobe, backs[0].lobe)) < 0.1 * backs[0].standard_error);
    }
}

TEST_CASE("The last paths of the counter space are as random as the first, and different", "[tracer][stress]") {
    // 2^8 randomisations of 2^32 paths: the 2^40 paths of a cell.
    TracerCell cell;
    cell.sigma = 3, cell.g = 0.5, cell.h = 0.3, cell.bins = 24;
    cell.plan = plan_of(cell);
    const std::uint64_t count = 2048, last = (std::uint64_t{1} << 32) - count;
    PathTracer tracer(cell);
    std::vector<double> total[2];
    std::vector<std::vector<double>> bins[2];
    for (std::uint32_t r = 0; r < 24; ++r)
        for (const int end : {0, 1}) {
            TracerSums sums;
            tracer.trace(end ? 255 - r : r, end ? last : 0, count, sums);
            REQUIRE(sums.paths == count);
            for (const double x : sums.bins) REQUIRE((std::isfinite(x) && x >= 0));
            total[end].push_back(sum(sums.bins)), bins[end].push_back(sums.bins);
        }
    for (std::size_t r = 0; r < 24; ++r)
        for (std::size_t q = 0; q < 24; ++q) CHECK(bins[0][r] != bins[1][q]);
    // Student's t of 23 degrees of freedom exceeds 6 once in 10^5.
    const Moments a = moments(total[0]), b = moments(total[1]);
    CHECK(std::abs(a.mean - b.mean) < 6 * std::hypot(a.error, b.error));
    // Consecutive blocks and both ends: no random word of a path's first collisions occurs twice.
    std::set<std::array<std::uint32_t, 4>> seen;
    for (const std::uint32_t randomisation : {0u, 1u, 254u, 255u})
        for (const std::uint32_t order : {1u, 2u, 0xFFFFFEu})
            for (const std::uint32_t first : {0u, 0x7FFFFF00u, 0xFFFFFE00u})
                for (const auto& words : tracer_words(cell, order, randomisation, first, 512)) seen.insert(words);
    CHECK(seen.size() == 4 * 3 * 3 * 512);
}

}  // namespace
