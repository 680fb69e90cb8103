// Light in the whole fibre against what is known in closed form, the two-dimensional solvers and independent programs.
// Errors come from 16 batches: five of them are exceeded once in 6000 times (Student's t).
#include <omp.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "medulla/detail/cross_section.hpp"
#include "medulla/fur_parameters.hpp"
#include "sim2d/disc/deterministic.hpp"
#include "sim2d/quadrature.hpp"
#include "sim3d/fibre_walk.hpp"
#include "tests/support/statistics.hpp"

using namespace medulla;
using namespace medulla::sim3d;
using namespace medulla::detail;

namespace {

constexpr double degree = pi / 180;

FibreOptions with(std::uint64_t paths, std::uint64_t cell = 0) {
    FibreOptions o;
    o.paths = paths, o.seed = 3, o.cell = cell;
    o.theta_bins = 18, o.phi_bins = 36;
    return o;
}

Light from(double theta_i, double h_low = -1, double h_high = 1) {
    Light light;
    light.theta_i = theta_i, light.h_low = h_low, light.h_high = h_high;
    return light;
}

bool agrees(const Estimate& e, double expected) { return std::abs(e.value - expected) <= 5 * e.error; }

/// A smooth fibre of a preset's coefficients.
Fibre smooth(const char* name) {
    const FurPreset& p = *find_preset(name);
    Fibre f;
    f.eta_c = double(p.eta), f.kappa = double(p.kappa), f.layers = double(p.layers), f.g = double(p.g);
    f.sigma_ca = {double(p.sigma_ca)}, f.sigma_ma = double(p.sigma_ma), f.sigma_ms = double(p.sigma_ms);
    return f;
}

/// Energies of R, TT, TRT and of all higher orders of unscattered light at h: the runtime's model in double.
void model(const Fibre& f, double theta_i, double h, double A[4]) {
    const auto at = medulla::detail::inclination(
        f.eta_c, std::cos(theta_i),
        f.reflectance == Reflectance::exact ? medulla::Fresnel::exact : medulla::Fresnel::bravais);
    const double c = std::sqrt(1 - h * h), x = std::sqrt(at.index_excess + c * c), s = at.fresnel_scale;
    const double F = medulla::detail::cuticle(f.layers, at.fresnel_index_excess, s * c, s * x).F;
    const double inside = h * at.inverse_index;
    const double s_m = std::sqrt(std::max(0.0, f.kappa * f.kappa - inside * inside));
    const double s_c = std::sqrt(1 - inside * inside) - s_m;
    const double left = std::exp(-2 * (s_c * f.sigma_ca[0] + s_m * (f.sigma_ma + f.sigma_ms)) * at.inverse_cos_t);
    A[0] = F, A[1] = (1 - F) * (1 - F) * left, A[2] = A[1] * F * left, A[3] = A[2] * F * left / (1 - F * left);
}

/// Their means over offsets. h = sin(t) takes the root at the rim away; the kink at the medulla's edge costs 1e-6.
void mean_model(const Fibre& f, double theta_i, double mean[4]) {
    const int n = 4000;
    for (int k = 0; k < 4; ++k) mean[k] = 0;
    for (int i = 0; i < n; ++i) {
        const double t = (i + 0.5) / n * pi / 2;
        double A[4];
        model(f, theta_i, std::sin(t), A);
        for (int k = 0; k < 4; ++k) mean[k] += A[k] * std::cos(t) * pi / 2 / n;
    }
}

}  // namespace

TEST_CASE("Fibre: without absorption all light leaves, whatever the fibre", "[sim3d]") {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> u(0, 1);
    for (int i = 0; i < 150; ++i) {
        Fibre f;
        f.eta_c = 1.01 + u(random), f.kappa = i % 10 == 0 ? 0 : i % 10 == 1 ? 1 : u(random);
        if (i % 3 == 0) f.eta_m = 1 + u(random);
        f.alpha = i % 2 == 0 ? 0 : 0.2 * u(random) - 0.1, f.beta_m = 0.6 * u(random),
        f.beta_n = i % 7 == 0 ? 0 : 0.6 * u(random);
        f.layers = 2 * u(random), f.sigma_ms = 8 * u(random), f.g = 1.8 * u(random) - 0.9;
        f.axis_ratio = i % 3 == 0 ? 1 : std::exp(2 * u(random) - 1);
        f.phase = i % 4 == 0 ? Phase::planar : Phase::hg3d;
        f.tilt = i % 5 == 0 ? Tilt::scale : Tilt::theta_r;
        f.reflectance = i % 3 == 1 ? Reflectance::bravais : Reflectance::exact;
        Light light = from(3 * u(random) - 1.5);
        light.azimuth = 6 * u(random);
        const FibreProfile r = walk_fibre(f, light, with(400, std::uint64_t(i)));
        // Scales that are tilted alike guide light along the fibre: some of it never leaves. So may, in a planar
        // medium, light whose inclination nothing but small facets change.
        if (f.alpha == 0 && f.phase == Phase::hg3d) CHECK(r.lost().value == 0);
        CHECK(std::abs(r.white_energy(all_classes).value + r.lost().value - 1) <= 1e-12);
        CHECK(std::abs(r.energy(all_classes).value + r.lost().value - 1) <= 1e-12);
    }
}

TEST_CASE("Fibre: energies of R, TT, TRT and beyond are the model's where cuticle and interface are smooth",
          "[sim3d]") {
    std::uint64_t cell = 0;
    const auto compare = [&](const Fibre& f, const Light& light, const double expected[4]) {
        const FibreProfile r = walk_fibre(f, light, with(400000, ++cell));
        for (const Class c : {Class::R, Class::TT, Class::TRT, Class::higher}) {
            const Estimate e = r.energy(only(c));
            CHECK(agrees(e, expected[static_cast<int>(c)]));
            CHECK(e.error < 1e-3);
        }
    };
    double A[4];
    Fibre hair;
    hair.sigma_ca = {0.3};
    mean_model(hair, 40 * degree, A);
    // An independent program's numbers, to their last digit.
    CHECK(std::abs(A[0] - 0.16139) < 1e-5);
    CHECK(std::abs(A[1] - 0.38179) < 1e-5);
    CHECK(std::abs(A[2] - 0.02818) < 1e-5);
    compare(hair, from(40 * degree), A);
    hair.reflectance = Reflectance::bravais;
    mean_model(hair, 40 * degree, A);
    compare(hair, from(40 * degree), A);
    for (const char* name : {"rabbit", "mouse"}) {
        mean_model(smooth(name), 0.7, A);
        compare(smooth(name), from(0.7), A);
        model(smooth(name), 0.7, -0.4, A);
        compare(smooth(name), from(0.7, -0.4, -0.4), A);
    }
}

TEST_CASE("Fibre: beyond the medulla's critical angle light is reflected there", "[sim3d]") {
    // TrT and TrRrT of Yan et al. 2015, zone II, from an independent evaluation of their Eqs. 9 to 14.
    Fibre f;
    f.eta_c = 1.5, f.eta_m = 1.35, f.kappa = 0.45, f.sigma_ca = {0.5}, f.sigma_ms = 2, f.layers = 0.6;
    f.reflectance = Reflectance::bravais;
    const FibreProfile r = walk_fibre(f, from(30 * degree, 0.68, 0.68), with(400000));
    CHECK(agrees(r.energy(only(Class::R)), 0.07652174));
    CHECK(agrees(r.energy(only(Class::TT)), 0.38961073));
    CHECK(agrees(r.energy(only(Class::TRT)), 0.01362051));
    CHECK(r.energy(scattered).value == 0);
}

TEST_CASE("Fibre: a planar phase function in a bare medulla gives the disc's C^N", "[sim3d]") {
    // theta is kept, so that the cross-section sees sigma_ms / cos theta; the index turns rays by 1e-4 at most.
    const std::size_t bins = 36;
    const double kappa = 0.8, theta_i = 0.6;
    Fibre f;
    f.eta_c = 1.0001, f.layers = 0, f.kappa = kappa, f.sigma_ms = 2 / kappa * std::cos(theta_i), f.g = 0.4;
    f.phase = Phase::planar;
    const sim2d::DiscSolver solver(f.g);
    const auto p_of = [&](const std::vector<double>& forward, const FibreProfile& r) {
        std::vector<double> counts(bins), expected(bins);
        const auto d = r.density(scattered);
        const double n = static_cast<double>(r.paths());
        double rest = 1, missed = n;
        for (std::size_t b = 0; b < bins; ++b) {
            for (std::size_t t = 0; t < d.theta_bins; ++t) counts[b] += d.value[t * bins + b] * d.bin_area() * n;
            expected[b] = forward[(b + bins / 2) % bins];  // phi = 0 is forward there
            rest -= expected[b], missed -= counts[b];
        }
        counts.push_back(missed), expected.push_back(rest);
        return test::chi_squared_p(counts, expected, n);
    };
    const double width = 2 * pi / double(bins);
    std::vector<double> mean(bins);
    const sim2d::Quadrature rule = sim2d::unit_gauss_legendre(24);
    const auto lobes = solver.solve(2, rule.nodes, bins), mirrored = [&] {
        std::vector<double> h;
        for (const double x : rule.nodes) h.push_back(-x);
        return solver.solve(2, h, bins);
    }();
    for (std::size_t i = 0; i < rule.nodes.size(); ++i)
        for (std::size_t b = 0; b < bins; ++b)
            mean[b] += 0.5 * kappa * rule.weights[i] * width *
                       (lobes[i].energy * lobes[i].lobe[b] + mirrored[i].energy * mirrored[i].lobe[b]);
    CHECK(p_of(mean, walk_fibre(f, from(theta_i), with(300000))) > 1e-4);
    const auto one = solver.solve(2, {0.5}, bins)[0];
    std::vector<double> lobe;
    for (const double x : one.lobe) lobe.push_back(x * one.energy * width);
    CHECK(p_of(lobe, walk_fibre(f, from(theta_i, 0.5 * kappa, 0.5 * kappa), with(300000))) > 1e-4);
}

TEST_CASE("Fibre: light scattered once is an integral along the chord", "[sim3d]") {
    const double sigma = 0.02, g = 0.6, theta_i = 0.6, h = 0.3;
    Fibre f;
    f.eta_c = 1 + 1e-6, f.layers = 0, f.kappa = 1, f.sigma_ms = sigma, f.g = g;
    FibreOptions o = with(600000);
    o.theta_bins = 6, o.phi_bins = 8;
    const FibreProfile r = walk_fibre(f, from(theta_i, h, h), o);
    const auto d = r.density(scattered);
    const double half = std::sqrt(1 - h * h), cos_i = std::cos(theta_i);
    const int fine = 16, steps = 40;
    std::vector<double> once(48);
    double all = 0;
    for (int t = 0; t < 6 * fine; ++t)
        for (int p = 0; p < 8 * fine; ++p) {
            const double theta = ((t + 0.5) / (6 * fine) - 0.5) * pi, phi = ((p + 0.5) / (8 * fine) - 0.5) * 2 * pi;
            // omega_i has azimuth 0: the light travels towards -y, its left is -z.
            const double cosine = -(std::sin(theta) * std::sin(theta_i) + std::cos(theta) * cos_i * std::cos(phi));
            const double phase = (1 - g * g) / (4 * pi * std::pow(1 + g * g - 2 * g * cosine, 1.5));
            double sum = 0;
            for (int s = 0; s < steps; ++s) {
                const double along = (s + 0.5) / steps * 2 * half, y = half - along, z = -h;
                const double b = y * std::cos(phi) + z * std::sin(phi);
                const double out = std::sqrt(b * b + 1 - y * y - z * z) - b;
                sum += std::exp(-sigma * (along / cos_i + out / std::cos(theta))) * 2 * half / cos_i / steps;
            }
            const double energy = sigma * sum * phase * std::cos(theta) * d.bin_area() / (fine * fine);
            once[std::size_t(t / fine * 8 + p / fine)] += energy, all += energy;
        }
    // What is scattered is known, so that what is scattered again is: it may be anywhere.
    const double again = -std::expm1(-2 * sigma * half / cos_i) - all;
    CHECK(again > 0);
    CHECK(again < 0.05 * all);
    for (std::size_t i = 0; i < 48; ++i) {
        const double seen = d.value[i] * d.bin_area(), noise = std::sqrt(once[i] / double(r.paths()));
        CHECK(seen - once[i] > -5 * noise);
        CHECK(seen - once[i] < 5 * noise + again);
    }
}

TEST_CASE("Fibre: the mean path of isotropic light", "[sim3d]") {
    // <L> = eta^2 4 V / S times the share of positions and directions inside that light can reach: those that can
    // escape, or that meet the medulla. Scattering, phase function, layers and roughness do not matter.
    const auto mean_path = [](const Fibre& f, std::uint64_t paths) {
        double sum = 0, squares = 0;
        for (std::uint64_t k = 0; k < paths; ++k) {
            sim2d::RandomStream random(9, 0, k);
            Light light;
            double x = 0;  // sin theta_i, with density ~ cos theta_i; azimuths by the width they see
            do x = 2 * random.uniform() - 1;
            while (random.uniform() > std::sqrt(1 - x * x));
            light.theta_i = std::asin(x);
            const double a = f.axis_ratio, widest = std::max(1.0, a);
            do light.azimuth = 2 * pi * random.uniform();
            while (random.uniform() * widest > std::hypot(a * std::sin(light.azimuth), std::cos(light.azimuth)));
            const PathExit e = FibreWalker(f, light).follow(2 * random.uniform() - 1, random);
            const double L = e.cortex + e.medulla;
            sum += L, squares += L * L;
        }
        const double n = static_cast<double>(paths), mean = sum / n;
        return Estimate{mean, std::sqrt((squares / n - mean * mean) / n)};
    };
    const auto reachable = [](double eta, double kappa) {
        double share = 0;
        const int n = 20000;  // impact b has density (4 / pi) sqrt(1 - b^2), the cosine to the axis is even
        for (int i = 0; i < n; ++i) {
            const double b = (i + 0.5) / n, escapes = 1 - (1 - 1 / (eta * eta)) / (1 - b * b);
            share += 4 / pi * std::sqrt(1 - b * b) / n * (b < kappa ? 1 : std::sqrt(std::max(0.0, escapes)));
        }
        return share;
    };
    Fibre f;
    f.layers = 0.5;
    CHECK(std::abs(2 * 1.55 * 1.55 * reachable(1.55, 0) - 2) < 1e-4);
    CHECK(agrees(mean_path(f, 40000), 2));
    for (const double kappa : {0.8, 1.0})
        for (const double layers : {0.5, 1.5}) {
            f.kappa = kappa, f.layers = layers, f.sigma_ms = 3, f.g = 0.3;
            CHECK(agrees(mean_path(f, 40000), 2 * f.eta_c * f.eta_c * reachable(f.eta_c, kappa)));
        }
    f.kappa = 1, f.sigma_ms = 8, f.g = 0.7, f.beta_m = 0.3, f.beta_n = 0.2;
    CHECK(agrees(mean_path(f, 40000), 2 * f.eta_c * f.eta_c));
    // 4 V / S of an elliptical fibre is 4 area / perimeter of its cross-section.
    f.beta_m = f.beta_n = 0, f.sigma_ms = 3, f.axis_ratio = 2.5;
    double perimeter = 0;
    for (int i = 0; i < 1000; ++i)
        perimeter += std::hypot(2.5 * std::sin(i * pi / 500), std::cos(i * pi / 500)) * 2 * pi / 1000;
    CHECK(agrees(mean_path(f, 40000), f.eta_c * f.eta_c * 4 * pi * 2.5 / perimeter));
    f.phase = Phase::planar, f.kappa = 0.7, f.eta_c = 1 + 1e-9, f.layers = 0;
    CHECK(agrees(mean_path(f, 40000), 4 * pi * 2.5 / perimeter));
}

TEST_CASE("Fibre: scattered energy of whole fibres is that of an independent program", "[sim3d]") {
    // Smooth cuticle, Table 4's coefficients, theta_i = 0.4, h = 0.5: 1,500,000 analog paths each, to three digits
    // (another program, another generator, another frame).
    const struct {
        const char* name;
        double energy;
    } animals[] = {{"bobcat", 0.325}, {"deer", 0.365},  {"springbok", 0.353}, {"red_fox", 0.414}, {"rabbit", 0.370},
                   {"cat", 0.670},    {"mouse", 0.595}, {"dog", 0.878},       {"raccoon", 0.544}};
    for (const auto& animal : animals) {
        const Estimate e = walk_fibre(smooth(animal.name), from(0.4, 0.5, 0.5), with(100000)).energy(scattered);
        CHECK(std::abs(e.value - animal.energy) <= 5 * e.error + 0.0005);
    }
}

TEST_CASE("Fibre: energy per radiance is reciprocal", "[sim3d]") {
    // f = density / cos^2 theta_r. Bins of 2 degrees about 1 and 41: f's curvature there changes their means by 1e-3.
    Fibre rough = smooth("rabbit");
    rough.beta_m = 0.7, rough.beta_n = 0.5;
    std::uint64_t cell = 40;
    for (const Fibre& f : {smooth("bobcat"), rough}) {
        FibreOptions o = with(400000);
        o.theta_bins = 90, o.phi_bins = 6;
        const auto at = [&](double theta_i, double theta_r) {
            o.cell = ++cell;
            const auto d = walk_fibre(f, from(theta_i * degree), o).density(all_classes, 0, true);
            const auto row = std::size_t((theta_r + 90) / 2) * 6;
            std::vector<Estimate> thirds;
            for (std::size_t i = 0; i < 3; ++i)
                thirds.push_back({d.value[row + i] / std::pow(std::cos(theta_r * degree), 2),
                                  d.error[row + i] / std::pow(std::cos(theta_r * degree), 2)});
            return thirds;
        };
        // Smooth R leaves at -theta_i alone: there, scattered light is compared; of the rough fibre, all.
        const auto there = at(1, 41), back = at(41, 1);
        for (std::size_t i = 0; i < 3; ++i) {
            CHECK(std::abs(there[i].value - back[i].value) <=
                  5 * std::hypot(there[i].error, back[i].error) + 1e-3 * there[i].value);
            CHECK(there[i].error < 0.04 * there[i].value);
        }
    }
}

TEST_CASE("Fibre: mirror images", "[sim3d]") {
    Fibre f = smooth("rabbit");
    f.alpha = 0.2, f.beta_m = 0.2, f.beta_n = 0.3, f.sigma_ca = {0}, f.sigma_ma = 0, f.axis_ratio = 1.5;
    Fibre turned = f;
    turned.alpha = -f.alpha;
    Light light = from(0.5, 0.1, 0.7), sideways = from(0.5, -0.7, -0.1), upside = from(-0.5, 0.1, 0.7);
    light.azimuth = upside.azimuth = 0.4, sideways.azimuth = -0.4;
    const std::uint64_t n = 100000;
    const auto a = walk_fibre(f, light, with(n, 1)).density(all_classes),
               b = walk_fibre(f, sideways, with(n, 2)).density(all_classes),
               c = walk_fibre(turned, upside, with(n, 3)).density(all_classes);
    const std::size_t phis = a.phi_bins;
    double x = 0, y = 0, cells_x = 0, cells_y = 0;
    const auto add = [&](double first, double second, double& sum, double& cells) {
        const double p = first * a.bin_area() * double(n), q = second * a.bin_area() * double(n);
        if (p + q < 20) return;
        sum += (p - q) * (p - q) / (p + q), cells += 1;
    };
    for (std::size_t t = 0; t < a.theta_bins; ++t)
        for (std::size_t p = 0; p < phis; ++p) {
            add(a.value[t * phis + p], b.value[t * phis + phis - 1 - p], x, cells_x);
            add(a.value[t * phis + p], c.value[(a.theta_bins - 1 - t) * phis + p], y, cells_y);
        }
    CHECK(cells_x > 300);
    CHECK(test::chi_squared_tail(x, cells_x) > 1e-4);
    CHECK(test::chi_squared_tail(y, cells_y) > 1e-4);
}

TEST_CASE("Fibre: one set of paths serves every absorption", "[sim3d]") {
    Fibre f = smooth("mouse");
    f.sigma_ca = {0, 0.2, 2}, f.sigma_ma = 0.1;
    const FibreProfile all = walk_fibre(f, from(0.3), with(100000));
    for (std::size_t c = 0; c < 3; ++c) {
        Fibre grey = f;
        grey.sigma_ca = {f.sigma_ca[c]};
        const FibreProfile one = walk_fibre(grey, from(0.3), with(100000));
        CHECK(one.density(all_classes).value == all.density(all_classes, c).value);
    }
    // The mean lengths are minus the energy's derivatives: to first order in 1e-4.
    Fibre clear = f;
    clear.sigma_ca = {1e-4}, clear.sigma_ma = 0;
    const FibreProfile thin = walk_fibre(clear, from(0.3), with(100000));
    const double lost = 1 - thin.energy(all_classes).value, length = thin.cortex_length(all_classes).value;
    CHECK(std::abs(lost / 1e-4 - length) < 1e-2 * length);
}

TEST_CASE("Fibre: the same bytes for any number of threads", "[sim3d]") {
    const int before = omp_get_max_threads();
    Fibre f = smooth("red_fox");
    f.beta_m = f.beta_n = 0.3;
    omp_set_num_threads(1);
    const FibreProfile one = walk_fibre(f, from(0.3), with(5000));
    omp_set_num_threads(3);
    const FibreProfile three = walk_fibre(f, from(0.3), with(5000));
    omp_set_num_threads(before);
    for (std::size_t b = 0; b < one.batches().size(); ++b) {
        CHECK(one.batches()[b].bins == three.batches()[b].bins);
        CHECK(one.batches()[b].medulla == three.batches()[b].medulla);
    }
    CHECK(walk_fibre(f, from(0.3), with(5000, 1)).batches()[0].bins != one.batches()[0].bins);
}

TEST_CASE("Fibre: a bad parameter is named", "[sim3d]") {
    const auto message = [](const Fibre& f, const Light& light, const FibreOptions& o) -> std::string {
        try {
            validate(f, light, o);
        } catch (const std::invalid_argument& e) {
            return e.what();
        }
        return "";
    };
    Fibre f;
    CHECK(message(f, {}, {}).empty());
    f.kappa = 1.5;
    CHECK(message(f, {}, {}) == "kappa: expected a value in [0, 1], found 1.5");
    f.kappa = 0, f.sigma_ca = {0.1, std::nan("")};
    CHECK(message(f, {}, {}).rfind("sigma_ca: expected values in [0, 1e9]", 0) == 0);
    f.sigma_ca = {};
    CHECK(message(f, {}, {}) == "sigma_ca: expected 1 to 64 channels, found 0");
    FibreOptions o;
    o.batches = 1;
    CHECK(message(Fibre(), {}, o) == "batches: expected 2 to 1024, found 1");
    o.batches = 1024, o.theta_bins = o.phi_bins = 4096;
    CHECK(message(Fibre(), {}, o).rfind("theta_bins, phi_bins: expected at most 2^31 sums", 0) == 0);
    CHECK(message(Fibre(), from(pi / 2), {}).rfind("theta_i: expected radians in (-pi/2, pi/2)", 0) == 0);
}
