// The far field and intervals against the mean of the near field, and its mirror images.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fibre_of.hpp"
#include "tests/support/fur_reference.hpp"

using namespace medulla;
using analytic::pack;
using test::FibreOf;

namespace {

/// The mean of the double-precision near field over [h1, h2]: midpoints in asin h, which takes out the fibre rim's
/// square root, in pieces that end at the medulla's rim and at h = 0, where a low-rank lobe is not quite its own mirror
/// image; each stepped evenly in an angle t, gamma = a + (b - a) (1 - cos t) / 2, which takes out the medulla rim's
/// square root: midpoints then converge faster than any power.
reference::Lobes mean_of_near(const FurParameters<3>& p, const reference::Medulla& medulla, double theta_i, double phi,
                              double h1, double h2, int n) {
    reference::Lobes mean;
    const double eta = double(p.eta), s = std::sin(theta_i);
    const double rim = std::min(1.0, double(p.kappa) * std::sqrt(eta * eta - s * s) / std::cos(theta_i));
    const double low = std::asin(h1), high = std::asin(h2), gamma_rim = std::asin(rim);
    const auto clip = [&](double x) { return std::min(high, std::max(low, x)); };
    const double cut[5] = {low, clip(-gamma_rim), clip(0), clip(gamma_rim), high};
    for (int piece = 0; piece < 4; ++piece) {
        const double a = cut[piece], b = cut[piece + 1];
        if (!(b > a)) continue;
        const int m = 60 + int(n * (b - a) / (high - low));
        for (int i = 0; i < m; ++i) {
            const double t = pi * (i + 0.5) / m, gamma = a + (b - a) * (1 - std::cos(t)) / 2;
            const auto l = reference::near_lobes(p, &medulla, theta_i, 0.0, phi, std::sin(gamma));
            const double w = std::cos(gamma) * (b - a) / 2 * std::sin(t) * pi / m / (h2 - h1);
            for (int k = 0; k < all_lobe_count; ++k)
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

TEST_CASE("intervals and the far field are the mean of the near field, lobe by lobe", "[bcsdf]") {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> u(0, 1);
    const char* wanted = std::getenv("MEDULLA_FAR_CASES");  // more of them by hand
    const int cases = wanted ? std::atoi(wanted) : 12;
    std::vector<double> errors[all_lobe_count];
    for (int i = 0; i < cases; ++i) {
        const FurParameters<3> p = random_fur(random, i);
        const float theta_i = i % 5 == 4 ? 1.5f : 1.3f * (2 * u(random) - 1);
        float h1 = -1, h2 = 1;
        if (i % 3 == 1) h1 = 2 * u(random) - 1, h2 = h1 + (1 - h1) * u(random);
        if (i % 9 == 2) h1 = 0.9f, h2 = 1;
        const FibreOf fibre(p, pack().view);
        const reference::DenseReader medulla(pack().view, ranges_of(p), *fibre.owned);
        const FarField<3> far = far_field(fibre, Angles{theta_i, 0}, {h1, h2});
        double error[all_lobe_count] = {}, norm[all_lobe_count] = {};
        // Midpoints per deviation of the narrowest lobe over the slope of 2: at least 6, so they are exact to float.
        const int directions = 24, n = int(std::max(120.0, 20 / double(p.beta_n)));
        for (int d = 0; d < directions; ++d) {
            double phi = 2 * pi * (d + double(u(random))) / directions - pi;
            if (d %
                2) {  // where a lobe of some offset leaves: a narrow range's beam would pass between even directions
                const NearField<3> near = near_field(fibre, Angles{theta_i, 0}, h1 + (h2 - h1) * u(random));
                phi = double(near.centre[d / 2 % 3] + 2 * p.beta_n * (u(random) - 0.5f));
            }
            const auto l = far.lobes(0.0f, float(phi));
            const auto r = mean_of_near(p, medulla, double(theta_i), double(float(phi)), double(h1), double(h2), n);
            for (int k = 0; k < all_lobe_count; ++k)
                for (int c = 0; c < 3; ++c) {
                    error[k] += std::pow(double(l.N[k][c]) - r.N[k][c], 2);
                    norm[k] += std::pow(r.N[k][c], 2);
                }
        }
        for (int k = 0; k < all_lobe_count; ++k) {
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
    for (int k = 0; wanted && k < all_lobe_count; ++k) {
        std::vector<double>& e = errors[k];
        if (e.empty()) continue;
        std::sort(e.begin(), e.end());
        std::printf("%-8s near against far, relative L2: median %.2e, 9 of 10 below %.2e, worst %.2e over %zu\n",
                    lobe_names[k], e[e.size() / 2], e[e.size() * 9 / 10], e.back(), e.size());
    }
}

TEST_CASE("the far field's pdf is the mean of the near field's", "[bcsdf]") {
    std::mt19937 random(9);
    std::uniform_real_distribution<float> u(-1, 1);
    for (int i = 0; i < 6; ++i) {
        FurParameters<3> p = random_fur(random, 2 * i);
        p.beta_n = std::max(p.beta_n, 0.1f);
        const FibreOf fibre(p, pack().view);
        const Angles known = {1.2f * u(random), 0};
        const FarField<3> far = far_field(fibre, known);
        double error = 0, norm = 0;
        for (int d = 0; d < 12; ++d) {
            const Angles drawn = {std::max(-1.5f, std::min(1.5f, 0.2f * u(random) - known.theta)), 3.1f * u(random)};
            // Even steps in asin h, which take out the rim's root; the medulla's rim leaves n^-1.5 of an energy.
            double mean = 0;
            constexpr int n = 4000;
            for (int k = 0; k < n; ++k) {
                const double gamma = pi * ((k + 0.5) / n - 0.5);
                mean +=
                    double(near_field(fibre, known, float(std::sin(gamma))).pdf(drawn)) * std::cos(gamma) * pi / n / 2;
            }
            error += std::pow(double(far.pdf(drawn)) - mean, 2), norm += mean * mean;
        }
        CHECK(std::sqrt(error / norm) < 1e-2);  // the target of one kernel
    }
}

TEST_CASE("a far field of one offset is the near field there", "[bcsdf]") {
    FurParameters<3> p = parameters_of<3>(*find_preset("bobcat"));
    p.sigma_ca[1] *= 2;
    const FibreOf fibre(p, pack().view);
    for (float h : {-0.8f, -0.1f, 0.0f, 0.5f, 0.97f}) {
        const NearField<3> near = near_field(fibre, Angles{0.4f, 0}, h);
        const FarField<3> far = far_field(fibre, Angles{0.4f, 0}, {h, h});
        for (float phi : {near.centre[0], near.centre[1], near.centre[2] + 0.1f, 0.3f, -2.0f}) {
            const auto a = near.evaluate(Angles{-0.4f, phi}), b = far.evaluate(Angles{-0.4f, phi});
            // Within reach lies 1 - 1.4e-4 of a Gaussian, by whose inverse the rest is more; outside there is none.
            for (int c = 0; c < 3; ++c)
                CHECK(double(b.value[c]) == Approx(double(a.value[c])).epsilon(5e-4).margin(2e-3));
            CHECK(double(b.pdf) == Approx(double(a.pdf)).epsilon(5e-4).margin(2e-3));
        }
    }
}

TEST_CASE("the far field is its own mirror image, and a range's is that of its mirrored range", "[bcsdf]") {
    // h -> -h and phi -> -phi leave a fibre as it is. The quadrature of one half is the other's, so only rounding
    // differs: of an exit's angle, 5e-7, over the narrowest deviation, and of low-rank sums at h = 0.
    for (const char* animal : {"cat", "bobcat", "raccoon", "human"})
        for (FarQuality quality : {FarQuality::draft, FarQuality::standard, FarQuality::fine}) {
            FurParameters<3> p = parameters_of<3>(*find_preset(animal));
            const FibreOf fibre(p, pack().view);
            const double bound = 2e-6 + 5e-7 / double(p.beta_n);
            for (float theta_i : {0.0f, 0.7f, -1.4f})
                for (Offsets range : {Offsets{-1, 1}, Offsets{-0.3f, 0.9f}, Offsets{0.2f, 0.5f}}) {
                    const Angles known = {theta_i, 0};
                    const FarField<3> one = far_field(fibre, known, range, quality),
                                      other = far_field(fibre, known, {-range.high, -range.low}, quality);
                    double error[all_lobe_count] = {}, norm[all_lobe_count] = {};
                    for (int i = 0; i < 60; ++i) {
                        const float phi = float(pi * (i + 0.5) / 60);
                        const auto a = one.lobes(0.1f, phi), b = other.lobes(0.1f, -phi);
                        for (int k = 0; k < all_lobe_count; ++k) {
                            CHECK(a.M[k] == b.M[k]);
                            error[k] += std::pow(double(a.N[k][0]) - double(b.N[k][0]), 2);
                            norm[k] += std::pow(double(a.N[k][0]), 2);
                        }
                    }
                    for (int k = 0; k < all_lobe_count; ++k) {
                        if (!(norm[k] > 1e-16)) continue;
                        INFO(animal << " " << lobe_names[k] << " quality " << int(quality) << " theta_i " << theta_i
                                    << " from " << range.low);
                        CHECK(std::sqrt(error[k] / norm[k]) < bound);
                    }
                }
        }
}
