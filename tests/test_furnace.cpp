// White furnace: what a fibre that absorbs nothing returns, near and far, and the residual lobe's closed form.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fibre_of.hpp"
#include "tests/support/fur_reference.hpp"

using namespace medulla;
using test::FibreOf;
using test::shipped;

namespace {

FurParameters<1> random_white_fur(std::mt19937& random, int i) {
    std::uniform_real_distribution<float> u(0, 1);
    FurParameters<1> p = parameters_of<1>(fur_presets[i % fur_preset_count]);
    p.sigma_ma = p.sigma_ca[0] = 0;
    if (i % 2) {
        p.eta = 1.01f + 1.49f * u(random), p.kappa = 0.01f + 0.99f * u(random), p.layers = 5 * u(random);
        p.beta_n = 0.05f * std::pow(20.0f, u(random)), p.beta_m = 0.05f * std::pow(20.0f, u(random));
        p.sigma_ms = 5 * u(random), p.g = 1.5f * u(random) - 0.75f, p.alpha = 0.3f * (u(random) - 0.5f);
        p.fresnel = i % 4 == 1 ? Fresnel::exact : Fresnel::bravais;
    }
    if (i % 3 == 2) p.sigma_ms = 30 * u(random);
    if (i % 11 == 5) p.kappa = 0;
    p.beta_n = std::max(p.beta_n, 0.05f);
    return p;
}

/// Two Gauss nodes on each eighth of each span of an exit axis, both halves: exact for cubics, and where one is cut at
/// 0 the error is the slope there times 1e-6.
template <class Visit>
void visit_exit_nodes(const detail::AxisPlan& axis, Visit&& visit) {
    constexpr int parts = 8;
    for (std::int32_t i = 0; i < std::int32_t(axis.spans); ++i)
        for (int k = 0; k < 2 * parts; ++k) {
            const double width = (axis.knot(i + 1) - axis.knot(i)) / parts;
            const double y = axis.knot(i) + width * (k / 2 + 0.5 + (k % 2 ? 0.5 : -0.5) * 0.57735026918962576);
            visit(y, width / 2), visit(-y, width / 2);
        }
}

/// Integrals over theta_r of M of every lobe; of the scattered ones backward and forward.
struct Longitudinal {
    double M[all_lobe_count] = {}, back = 0, forward = 0;
};
template <class Field>
Longitudinal longitudinal(const Field& field, const detail::TablesPlan& plan) {
    Longitudinal sums;
    visit_exit_nodes(plan.axis[5], [&](double y, double weight) {
        const auto back = field.lobes(float(y), 0.0f), forward = field.lobes(float(y), float(pi));
        sums.back += weight * double(back.M[3]), sums.forward += weight * double(forward.M[3]);
    });
    // Truncated Gaussians are smooth between the edges: 8 nodes in each of 96 pieces, 0.033 wide.
    const detail::GaussRule rule = detail::gauss_rule(0);
    for (int piece = 0; piece < 96; ++piece)
        for (int i = 0; i < 2 * rule.half; ++i) {
            const double x = (i & 1 ? 1.0 : -1.0) * double(rule.x[i / 2]), width = pi / 96;
            const auto l = field.lobes(float(width * (piece + 0.5 + 0.5 * x) - pi / 2), 0.0f);
            for (int k : {0, 1, 2, 5}) sums.M[k] += width / 2 * double(rule.w[i / 2]) * double(l.M[k]);
        }
    return sums;
}

/// All that leaves: the integral of sum M N over all exits.
/// @param centre of a lobe's own coordinate, and its sign: where its table's breakpoints lie
template <class Field>
double furnace(const Field& field, const detail::TablesPlan& plan, const float (&centre)[2], float side) {
    const Longitudinal M = longitudinal(field, plan);
    double whole = 0;
    constexpr int n = 512;  // even steps: exact for wrapped Gaussians of 0.05 and more
    for (int j = 0; j < n; ++j) {
        const auto l = field.lobes(0.0f, float(pi * (2 * (j + 0.5) / n - 1)));
        for (int k : {0, 1, 2, 5}) whole += double(l.N[k][0]) * M.M[k] * 2 * pi / n;
    }
    for (int p = 0; field.tables != nullptr && p < 2; ++p)
        visit_exit_nodes(plan.axis[4], [&](double y, double weight) {
            const double phi = double(centre[p]) + double(side) * y, t = std::abs(std::remainder(phi, 2 * pi)) / pi;
            const auto l = field.lobes(0.0f, float(phi));
            whole += weight * double(l.N[3 + p][0]) * ((1 - t) * M.back + t * M.forward);
        });
    return whole;
}

}  // namespace

TEST_CASE("white furnace: near and far return what comes in", "[bcsdf]") {
    const char* wanted = std::getenv("MEDULLA_FURNACE_CASES");
    const int cases = wanted ? std::atoi(wanted) : 10;
    std::mt19937 random(13);
    std::uniform_real_distribution<float> u(-1, 1);
    double least[2] = {2, 2}, most[2] = {}, albedo_error = 0;
    for (int i = 0; i < cases; ++i) {
        FurParameters<1> p = random_white_fur(random, i);
        p.scattering = i % 3 == 1 ? Scattering::corrected : Scattering::published;
        const PackView& view = i / 2 % 2 ? shipped() : analytic::pack().view;
        TableRanges ranges = ranges_of(p);
        if (i % 4 > 1) ranges.g_low -= 0.1f, ranges.g_high += 0.1f, ranges.sigma_high *= 1.2f;
        const FibreOf<1> fibre(p, view, ranges);
        REQUIRE((fibre.tables != nullptr || p.kappa == 0));
        detail::TablesPlan plan;
        detail::plan_tables(view, ranges, plan);
        const Angles known = {i % 13 == 12 ? 1.57f : 1.5f * u(random), 0};
        const NearField<1> near = near_field(fibre, known, u(random));
        const FarField<1> far = far_field(fibre, known);
        const float none[2] = {};
        const double whole[2] = {furnace(near, plan, near.scattered_centre, near.side), furnace(far, plan, none, 1)};
        for (int k = 0; k < 2; ++k) least[k] = std::min(least[k], whole[k]), most[k] = std::max(most[k], whole[k]);
        albedo_error = std::max(albedo_error, std::abs(double(near.albedo()[0]) - 1));
        INFO("case " << i << " theta_i " << known.theta << " eta " << p.eta << " kappa " << p.kappa << " sigma "
                     << p.sigma_ms << " g " << p.g << " beta " << p.beta_m << " " << p.beta_n << " layers "
                     << p.layers);
        // Six energies in float, and what a polynomial leaves of a Gaussian's mass (2e-7).
        CHECK(std::abs(whole[0] - 1) < 1e-6);
        CHECK(std::abs(double(near.albedo()[0]) - 1) < 1e-6);
        // Gauss rules are accurate to 1e-5 on a Gaussian under one piece (rule_for), and 1e-5 is subtracted for that.
        CHECK(whole[1] <= 1);
        CHECK(whole[1] >= 1 - 2e-5);
    }
    std::printf("white furnace, %d fibres: near %.7f to %.7f (energies within %.1e), far %.7f to %.7f\n", cases,
                least[0], most[0], albedo_error, least[1], most[1]);
}

TEST_CASE("energies are those of the reference implementation, with the residual lobe summed crossing by crossing",
          "[bcsdf]") {
    std::mt19937 random(21);
    std::uniform_real_distribution<double> u(0, 1);
    double worst = 0;
    for (int i = 0; i < 2000; ++i) {
        FurParameters<3> p;
        p.eta = float(1.01 + 1.49 * u(random)), p.kappa = float(u(random)), p.layers = float(5 * u(random));
        p.sigma_ms = float(3 * u(random)), p.sigma_ma = float(i % 3 ? u(random) : 0);
        for (float& s : p.sigma_ca) s = float(i % 2 ? u(random) : 0);
        p.fresnel = i % 4 < 2 ? Fresnel::bravais : Fresnel::exact;
        const double theta_i = 3.1 * (u(random) - 0.5), h = i % 10 ? 2 * u(random) - 1 : 1 - 1e-9 * u(random);
        // In double, by the runtime's own formulas.
        const auto at = detail::inclination(double(p.eta), std::cos(theta_i), p.fresnel);
        const auto path = detail::trace(at, double(p.kappa), double(p.layers), h, std::sqrt((1 - h) * (1 + h)));
        FurParameters<3, double> q;
        q.kappa = double(p.kappa), q.sigma_ms = double(p.sigma_ms), q.sigma_ma = double(p.sigma_ma);
        for (int c = 0; c < 3; ++c) q.sigma_ca[c] = double(p.sigma_ca[c]);
        const auto e = detail::energies(path, detail::absorption(q, at.inverse_cos_t), path.s_m > 0);
        for (int c = 0; c < 3; ++c) {
            const double F = path.cuticle.F, share = e.A[3][c] / (F < 1 ? 1 - F : 1),
                         through = std::exp(-2 * (path.s_c * q.sigma_ca[c] + path.s_m * (q.sigma_ms + q.sigma_ma)) *
                                            at.inverse_cos_t);
            const double sum = reference::residual_energy(F, share, through);
            // A sum of up to 1e7 terms where F is nearly 1, each of 1e-16.
            CHECK(e.A[5][c] == Approx(sum).epsilon(1e-9).margin(1e-15));
            worst = std::max(worst, std::abs(e.A[5][c] - sum));
            double all = 0;
            for (const auto& A : e.A) all += A[c];
            CHECK(all <= 1 + 1e-12);
            if (i % 6 == 0) CHECK(all == Approx(1).epsilon(1e-12));  // nothing absorbs
        }
    }
    std::printf("residual energies: %.1e from the sum over crossings\n", worst);
}
