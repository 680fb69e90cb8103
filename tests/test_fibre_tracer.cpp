// The fast tracer of the whole fibre against the reference implementation, closed forms and itself.
#include <omp.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "medulla/detail/cross_section.hpp"
#include "sim2d/tracer/kernel.hpp"
#include "sim3d/fibre_tracer.hpp"
#include "sim3d/fibre_walk.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;
using namespace medulla::sim3d;
using namespace medulla::detail;

namespace {

FibreOptions with(std::uint64_t paths, std::uint64_t cell = 0) {
    FibreOptions o;
    o.paths = paths, o.seed = 3, o.cell = cell, o.batches = 64;  // z of 64 batches is normal enough
    o.theta_bins = 18, o.phi_bins = 36;
    return o;
}

/// Sum of z^2 over bins that 100 paths of the reference implementation reached, and how many those are.
struct Distance {
    double z2 = 0, bins = 0;
    double p() const { return test::chi_squared_tail(z2 * 61 / 63, bins); }  // the mean of t^2 of 63 is 63 / 61
};
Distance distance(const FibreProfile& fast, const FibreProfile& reference, Classes classes, std::size_t channel) {
    const auto a = fast.density(classes, channel), b = reference.density(classes, channel);
    Distance d;
    for (std::size_t i = 0; i < a.value.size(); ++i) {
        const double noise2 = a.error[i] * a.error[i] + b.error[i] * b.error[i];
        if (!(b.value[i] * b.value[i] > 100 * b.error[i] * b.error[i])) continue;
        d.z2 += (a.value[i] - b.value[i]) * (a.value[i] - b.value[i]) / noise2, d.bins += 1;
    }
    return d;
}

struct Case {
    const char* name;
    Fibre fibre;
    Light light;
};
std::vector<Case> cases() {
    std::vector<Case> all(5);
    Fibre f;
    f.eta_c = 1.49, f.kappa = 0.7, f.sigma_ca = {0.4, 0.1}, f.sigma_ma = 0.1, f.sigma_ms = 2, f.g = 0.5, f.layers = 0.7;
    all[0] = {"smooth", f, {}};
    all[0].light.theta_i = 0.6;
    f.alpha = 0.06, f.beta_m = 0.15, f.beta_n = 0.33;
    all[1] = {"rough", f, {}};
    all[1].light.theta_i = -0.7;
    f.beta_m = 0.8, f.beta_n = 1, f.axis_ratio = 0.6, f.reflectance = Reflectance::bravais;
    all[2] = {"very rough, elliptical, as published", f, {}};
    all[2].light.theta_i = 1.2, all[2].light.azimuth = 0.8, all[2].light.h_low = -0.2;
    f.beta_m = f.beta_n = f.alpha = 0, f.axis_ratio = 1.8, f.phase = Phase::planar, f.g = -0.6, f.kappa = 1;
    all[3] = {"planar, no cortex", f, {}};
    all[3].light.theta_i = 0.3, all[3].light.azimuth = -0.5;
    f = Fibre();
    f.eta_c = 1.2, f.kappa = 0.4, f.sigma_ca = {2, 0}, f.sigma_ms = 20, f.g = 0.9, f.layers = 1.5, f.beta_n = 0.05;
    all[4] = {"thin, dense, one ray", f, {}};
    all[4].light.h_low = all[4].light.h_high = 0.3;
    return all;
}

}  // namespace

TEST_CASE("Fibre tracer: every class and direction is the reference implementation's, on every instruction set",
          "[sim3d]") {
    std::uint64_t cell = 0;
    for (const Case& c : cases()) {
        INFO(c.name);
        const FibreProfile reference = walk_fibre(c.fibre, c.light, with(250000, cell));
        std::vector<std::string> targets = sim2d::tracer_targets();
        targets.resize(std::min<std::size_t>(targets.size(), 3));  // the rest are narrower still
        for (const std::string& target : targets) {
            INFO(target);
            sim2d::set_tracer_target(target);
            const FibreProfile fast = trace_fibre(c.fibre, c.light, with(300000, ++cell));
            sim2d::set_tracer_target("");
            for (std::size_t channel : {0, 1}) {
                for (const Classes classes : {unscattered & ~only(Class::R), scattered}) {
                    const Distance d = distance(fast, reference, classes, channel);
                    INFO(channel << " " << classes << " " << d.z2 << " " << d.bins);
                    if (d.bins > 10) CHECK(d.p() > 1e-4);
                }
                for (std::size_t k = 0; k < class_count; ++k) {
                    const Estimate a = fast.energy(1u << k, channel), b = reference.energy(1u << k, channel);
                    INFO(class_names[k] << " " << a.value << " " << b.value);
                    // 4.5 errors: once in 30,000. A class of few paths has no error to speak of.
                    if (b.value * b.value > 30 * b.error * b.error)
                        CHECK(std::abs(a.value - b.value) <= 4.5 * std::hypot(a.error, b.error) + 3e-5);
                }
            }
            CHECK(fast.lost().value == 0);
        }
    }
}

TEST_CASE("Fibre tracer: closed energies of smooth hair to float precision", "[sim3d]") {
    // Deposits are expected values: of R, TT and TRT nothing is random but the place in the stratum of h.
    Fibre f;
    f.sigma_ca = {0.3};
    Light light;
    light.theta_i = 0.7;
    const FibreProfile r = trace_fibre(f, light, with(1000000));
    const auto at = medulla::detail::inclination(f.eta_c, std::cos(0.7), medulla::Fresnel::exact);
    double mean[2] = {};
    const int n = 20000;
    for (int i = 0; i < n; ++i) {
        const double t = (i + 0.5) / n * pi / 2, c = std::cos(t), x = std::sqrt(at.index_excess + c * c);
        const double F =
            medulla::detail::cuticle(f.layers, at.fresnel_index_excess, at.fresnel_scale * c, at.fresnel_scale * x).F;
        const double inside = std::sin(t) * at.inverse_index;
        const double left = std::exp(-2 * std::sqrt(1 - inside * inside) * f.sigma_ca[0] * at.inverse_cos_t);
        mean[0] += F * c * pi / 2 / n, mean[1] += (1 - F) * (1 - F) * left * c * pi / 2 / n;
    }
    const Estimate R = r.energy(only(Class::R)), TT = r.energy(only(Class::TT));
    CHECK(R.error < 1e-5);
    CHECK(TT.error < 1e-5);
    // 1e-5: floats, of which 1 - h at the rim is the worst.
    CHECK(std::abs(R.value - mean[0]) <= 5 * R.error + 1e-5);
    CHECK(std::abs(TT.value - mean[1]) <= 5 * TT.error + 1e-5);
}

TEST_CASE("Fibre tracer: white fibres lose nothing", "[sim3d]") {
    for (const Case& c : cases()) {
        INFO(c.name);
        Fibre f = c.fibre;
        f.alpha = 0;  // tilted scales guide light along the fibre
        f.sigma_ca = {0}, f.sigma_ma = 0;
        const FibreProfile r = trace_fibre(f, c.light, with(100000));
        const Estimate e = r.energy(all_classes);
        CHECK(std::abs(e.value - 1) <= 5 * e.error + 1e-5);
        CHECK(e.error < 0.01);
    }
}

TEST_CASE("Fibre tracer: the same bytes for any number of threads, other bytes for another cell", "[sim3d]") {
    const int before = omp_get_max_threads();
    const Case c = cases()[1];
    FibreOptions o = with(20000);
    o.batches = 6;
    omp_set_num_threads(1);
    const FibreProfile one = trace_fibre(c.fibre, c.light, o);
    omp_set_num_threads(3);
    const FibreProfile three = trace_fibre(c.fibre, c.light, o);
    omp_set_num_threads(before);
    for (std::size_t b = 0; b < 6; ++b) CHECK(one.batches()[b].bins == three.batches()[b].bins);
    o.cell = 1;
    CHECK(trace_fibre(c.fibre, c.light, o).batches()[0].bins != one.batches()[0].bins);
    CHECK(one.batches()[0].bins != one.batches()[1].bins);
}

TEST_CASE("Fibre tracer: two indices are the reference implementation's", "[sim3d]") {
    Fibre f;
    f.eta_m = f.eta_c;
    CHECK_NOTHROW(trace_fibre(f, {}, with(64)));
    f.eta_m = 1.3;
    CHECK_THROWS_AS(trace_fibre(f, {}, with(64)), std::invalid_argument);
}

TEST_CASE("Fibre tracer: stops at its target error, which is the distance from a longer run", "[sim3d]") {
    const Case c = cases()[1];
    FibreOptions o = with(40000000);
    o.target_error = 0.03;
    const FibreProfile r = trace_fibre(c.fibre, c.light, o);
    const auto d = r.density(scattered);
    CHECK(d.relative_error() <= 0.03);
    CHECK(r.paths() < 4000000);
    o.target_error = 0, o.paths = 4 * r.paths(), o.seed = 77;
    const auto longer = trace_fibre(c.fibre, c.light, o).density(scattered);
    double distance = 0, norm = 0;
    for (std::size_t i = 0; i < d.value.size(); ++i) {
        distance += (d.value[i] - longer.value[i]) * (d.value[i] - longer.value[i]);
        norm += longer.value[i] * longer.value[i];
    }
    // Both runs' errors; some 600 bins: the ratio's own deviation is about 4 %.
    const double ratio = std::sqrt(distance / norm) / std::hypot(d.relative_error(), longer.relative_error());
    CHECK(ratio > 0.8);
    CHECK(ratio < 1.2);
    // The most that may be spent is kept to.
    o = with(10000);
    o.target_error = 1e-6;
    CHECK(trace_fibre(c.fibre, c.light, o).paths() == 10048);
    CHECK_THROWS_AS(walk_fibre(c.fibre, c.light, o), std::invalid_argument);
}
