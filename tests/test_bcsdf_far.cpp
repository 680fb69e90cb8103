// The far field and intervals against the mean of the near field: one kernel, seen from further away.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <random>
#include <vector>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fur_reference.hpp"

using namespace medulla;
using analytic::AnalyticPack;

namespace {

const AnalyticPack& pack() {
    static const AnalyticPack p;
    return p;
}

/// The mean of the double-precision near field over [h1, h2]: midpoints in asin h, which takes out the fibre rim's
/// square root, in three pieces that end at the medulla's rim, each stepped evenly in an angle t, gamma = a + (b - a)
/// (1 - cos t) / 2, which takes out the medulla rim's square root: midpoints then converge faster than any power.
reference::Lobes mean_of_near(const FurParameters<3>& p, double theta_i, double phi, double h1, double h2, int n) {
    reference::Lobes mean;
    const double eta = double(p.eta), s = std::sin(theta_i);
    const double rim = std::min(1.0, double(p.kappa) * std::sqrt(eta * eta - s * s) / std::cos(theta_i));
    const double low = std::asin(h1), high = std::asin(h2), gamma_rim = std::asin(rim);
    const double cut[4] = {low, std::min(high, std::max(low, -gamma_rim)), std::min(high, std::max(low, gamma_rim)),
                           high};
    for (int piece = 0; piece < 3; ++piece) {
        const double a = cut[piece], b = cut[piece + 1];
        if (!(b > a)) continue;
        const int m = 60 + int(n * (b - a) / (high - low));
        for (int i = 0; i < m; ++i) {
            const double t = pi * (i + 0.5) / m, gamma = a + (b - a) * (1 - std::cos(t)) / 2;
            const auto l = reference::near_lobes(p, pack().view, theta_i, 0.0, phi, std::sin(gamma));
            const double w = std::cos(gamma) * (b - a) / 2 * std::sin(t) * pi / m / (h2 - h1);
            for (int k = 0; k < lobe_count; ++k)
                for (int c = 0; c < 3; ++c) mean.N[k][c] += w * l.N[k][c];
        }
    }
    return mean;
}

FurParameters<3> random_fur(std::mt19937& random, int i) {
    std::uniform_real_distribution<float> u(0, 1);
    FurParameters<3> p = parameters_of<3>(fur_presets[i % fur_preset_count]);
    p.sigma_ca[1] *= 2, p.sigma_ca[2] *= 0.1f;
    p.g = std::min(p.g, 0.6f);
    if (i % 2 == 0) return p;
    p.eta = 1.01f + 1.49f * u(random) * u(random), p.kappa = u(random), p.layers = 5 * u(random);
    p.beta_n = 0.00174533f * std::pow(600.0f, u(random));  // 0.1 to 60 degrees, evenly in the logarithm
    p.sigma_ms = 6 * u(random), p.sigma_ma = u(random) * u(random);
    p.fresnel = i % 4 == 1 ? Fresnel::exact : Fresnel::bravais;
    if (i % 6 == 1) p.sigma_ma = p.sigma_ca[0] = p.sigma_ca[1] = p.sigma_ca[2] = 0;
    return p;
}

}  // namespace

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

TEST_CASE("intervals and the far field are the mean of the near field, lobe by lobe", "[bcsdf]") {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> u(0, 1);
    const char* wanted = std::getenv("MEDULLA_FAR_CASES");  // more of them by hand
    const int cases = wanted ? std::atoi(wanted) : 12;
    std::vector<double> errors[lobe_count];
    for (int i = 0; i < cases; ++i) {
        const FurParameters<3> p = random_fur(random, i);
        const float theta_i = i % 5 == 4 ? 1.5f : 1.3f * (2 * u(random) - 1);
        float h1 = -1, h2 = 1;
        if (i % 3 == 1) h1 = 2 * u(random) - 1, h2 = h1 + (1 - h1) * u(random);
        if (i % 9 == 2) h1 = 0.9f, h2 = 1;
        FurFibre<3> fibre;
        REQUIRE(prepare(p, pack().view, fibre) == FurStatus::ok);
        FarField<3> far;
        far_field(fibre, theta_i, {h1, h2}, far);
        double error[lobe_count] = {}, norm[lobe_count] = {};
        // Midpoints per deviation of the narrowest lobe over the slope of 2: at least 6, so they are exact to float.
        const int directions = 24, n = int(std::max(120.0, 20 / double(p.beta_n)));
        for (int d = 0; d < directions; ++d) {
            double phi = 2 * pi * (d + double(u(random))) / directions - pi;
            if (d %
                2) {  // where a lobe of some offset leaves: a narrow range's beam would pass between even directions
                NearField<3> near;
                near_field(fibre, theta_i, h1 + (h2 - h1) * u(random), near);
                phi = double(near.centre[d / 2 % lobe_count] + 2 * p.beta_n * (u(random) - 0.5f));
            }
            const auto l = far.lobes(0.0f, float(phi));
            const auto r = mean_of_near(p, double(theta_i), double(float(phi)), double(h1), double(h2), n);
            for (int k = 0; k < lobe_count; ++k)
                for (int c = 0; c < 3; ++c) {
                    error[k] += std::pow(double(l.N[k][c]) - r.N[k][c], 2);
                    norm[k] += std::pow(r.N[k][c], 2);
                }
        }
        for (int k = 0; k < lobe_count; ++k) {
            if (!(norm[k] > 1e-16)) continue;
            const double relative = std::sqrt(error[k] / norm[k]);
            if (wanted && relative > 1e-3)
                std::printf("case %d lobe %s: %.2e  eta %g kappa %g beta_n %g theta_i %g h %g..%g layers %g ms %g\n", i,
                            lobe_names[k], relative, double(p.eta), double(p.kappa), double(p.beta_n), double(theta_i),
                            double(h1), double(h2), double(p.layers), double(p.sigma_ms));
            errors[k].push_back(relative);
            CHECK(relative < 1e-2);  // the target of one kernel
        }
    }
    for (int k = 0; wanted && k < lobe_count; ++k) {
        std::vector<double>& e = errors[k];
        if (e.empty()) continue;
        std::sort(e.begin(), e.end());
        std::printf("%-5s near against far, relative L2: median %.2e, 9 of 10 below %.2e, worst %.2e over %zu\n",
                    lobe_names[k], e[e.size() / 2], e[e.size() * 9 / 10], e.back(), e.size());
    }
}
