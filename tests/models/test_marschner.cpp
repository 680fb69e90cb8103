// Marschner et al. 2003. Reference values by mpmath in 30 digits: exact roots, exact Fresnel terms.
#include "medulla/models/marschner.hpp"
#include "tests/models/model_checks.hpp"

using namespace medulla;
using models::Marschner;

namespace {

constexpr double degree = pi / 180;

Marschner<3> hair(float eta = 1.55f, float sigma = 0.2f) {
    Marschner<3> m;
    m.eta = eta;
    for (float& s : m.sigma_a) s = sigma;
    m.alpha_R = float(-7 * degree), m.beta_R = float(7 * degree);
    return m;
}
/// N as the roots give it: glints of no energy, and a fade that reaches 6e-4 degrees and takes 0.5 %
/// of TRT away.
Marschner<3> bare(float eta = 1.55f, float sigma = 0.2f) {
    Marschner<3> m = hair(eta, sigma);
    m.glint = 0, m.glint_width = 1e-5f;
    return m;
}
double N(const Marschner<3>& m, int p, double phi, double theta_d) {
    return double(far_field(m, Angles{0, 0}).azimuthal(float(theta_d), float(phi)).N[p][0]);
}
/// By n midpoints in phi; where a root appears or crowds the error is that of one cell.
double energy(const Marschner<3>& m, int p, double theta_d, int n = 20000) {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += N(m, p, pi * (2 * (i + 0.5) / n - 1), theta_d);
    return sum * 2 * pi / n;
}

}  // namespace

TEST_CASE("Marschner: azimuthal lobes at exact roots") {
    const Marschner<3> m = bare();
    CHECK(N(m, 0, 0, 0.3) == Approx(.0116680125367).epsilon(5e-6));
    CHECK(N(m, 0, 1, 0.3) == Approx(.0107527285419).epsilon(5e-6));
    CHECK(N(m, 0, 2.5, 0.3) == Approx(.0169865283132).epsilon(5e-6));
    CHECK(N(m, 1, 2, 0.3) == Approx(.0631046321122).epsilon(1e-5));
    CHECK(N(m, 1, 2.8, 0.3) == Approx(.33602129383).epsilon(5e-6));
    CHECK(N(m, 1, pi, 0.3) == Approx(.406217169547).epsilon(5e-6));
    CHECK(N(m, 1, -2.8, 0.3) == Approx(.33602129383).epsilon(5e-6));
    CHECK(N(m, 2, 0, 0.3) == Approx(.0357548499267).epsilon(5e-6));
    // Here phi_c = .2694: a root next to the fold has lost half its digits.
    CHECK(N(m, 2, .2, 0.3) == Approx(.0475875325468).epsilon(2e-5));
    CHECK(N(m, 2, .28, 0.3) == Approx(.000897793470).epsilon(1e-4));
    CHECK(N(m, 2, .35, 0.3) == Approx(.000165583232).epsilon(1e-4));
    CHECK(N(m, 2, .5, 0.3) == 0);
    // Midpoints: TT ends in a corner; TRT crowds as 1 / sqrt(x) at its fold, of which 200,000 miss 0.25 %.
    CHECK(energy(m, 0, 0.3, 2000) == Approx(.0780608343375).epsilon(2e-5));
    CHECK(energy(m, 1, 0.3) == Approx(.584993894968).epsilon(2e-5));
    CHECK(energy(m, 2, 0.3, 200000) == Approx(.0274392128111).epsilon(0.01));
    const Marschner<3> white = bare(1.55f, 0);
    CHECK(energy(white, 1, 0.3) == Approx(.856547711841).epsilon(2e-5));
    CHECK(energy(white, 2, 0.3, 200000) == Approx(.0572349308295).epsilon(0.01));
}

TEST_CASE("Marschner: the integral over h by brute force is what the roots give") {
    const Marschner<3> m = bare();
    // 2 million rays: a cell of 0.1 radians has 20,000 and more, of which one is in doubt at each end.
    const double cells[3][2] = {{0.4, 0.5}, {2.6, 2.7}, {0.05, 0.15}};
    for (int p = 0; p < 3; ++p) {
        const double low = cells[p][0], high = cells[p][1];
        double mean = 0;
        for (int i = 0; i < 64; ++i) mean += N(m, p, low + (high - low) * (i + 0.5) / 64, 0.3) / 64;
        INFO("p " << p);
        CHECK(double(brute_force_azimuthal(m, p, 0.3f, float(low), float(high), 2000000)[0]) ==
              Approx(mean).epsilon(3e-4));
    }
    // Over the fold, phi_c = .2694: the integrable peak of TRT, by midpoints on both sides; the fade takes 0.5 % away.
    double mean = 0;
    for (int i = 0; i < 200000; ++i) mean += N(m, 2, 0.22 + 0.1 * (i + 0.5) / 200000, 0.3) / 200000;
    const double brute = double(brute_force_azimuthal(m, 2, 0.3f, 0.22f, 0.32f, 2000000)[0]);
    CHECK(mean == Approx(brute).epsilon(0.02));
    CHECK(mean < brute);
}

TEST_CASE("Marschner: caustics and glints") {
    const double table[][4] = {{1.2, 0.9237604307, 1.158540993, 24.66911001},
                               {1.4, 0.8246211251, 0.5802939156, 6.833146752},
                               {1.55, 0.729725976, 0.3249061599, 3.424353904},
                               {1.8, 0.5033222957, 0.07872916752, 1.17016548}};
    for (const auto& row : table) {
        const detail::Caustic c = detail::caustic(detail::inclination(float(row[0]), 1.0f, Fresnel::exact));
        CHECK(c.h == Approx(row[1]).epsilon(1e-6));
        CHECK(c.phi == Approx(row[2]).epsilon(3e-6));
        CHECK(c.curvature == Approx(row[3]).epsilon(3e-6));
    }
    const detail::Caustic none = detail::caustic(detail::inclination(2.1f, 1.0f, Fresnel::exact));
    CHECK(none.h == 0);
    // Energies of TRT with glints at theta 0, four digits.
    const double width[] = {10, 15, 25};
    const double expected[3][3] = {{.0198, .0159, .0136}, {.0720, .0680, .0658}, {.137, .133, .131}};
    const float strength[] = {0.5f, 2.5f, 5};
    for (int k = 0; k < 3; ++k)
        for (int w = 0; w < 3; ++w) {
            Marschner<3> m = hair();
            m.glint = strength[k], m.glint_width = float(width[w] * degree);
            CHECK(energy(m, 2, 0, 4000) == Approx(expected[k][w]).epsilon(6e-3));
        }
    // k_G = 2^(1/4) Gamma(1/4) / 8 keeps the energy of narrow glints: what is left is of the next order in w_c.
    Marschner<3> m = hair();
    m.glint = 0.538950137f, m.glint_width = float(1 * degree);
    CHECK(energy(m, 2, 0) == Approx(0.02717).epsilon(0.02));
    // Glints merge at eta' = 2 without a step; the printed smoothstep is infinite there.
    m.glint = 2.5f, m.glint_width = float(15 * degree);
    const double merge[][2] = {{1.99, .1490}, {2.001, .1504}, {2.15, .1260}, {2.31, .0933}};
    for (const auto& row : merge) {
        m.eta = float(row[0]);
        CHECK(N(m, 2, 0, 0) == Approx(row[1]).epsilon(1e-3));
    }
}

TEST_CASE("Marschner: S as printed, reciprocal, and energies") {
    // S with glints of no reach. His axis runs from root to tip: theta = -theta(Marschner).
    const Marschner<3> m = bare();
    const auto S = [&](double i, double r, double phi) {
        return double(far_field(m, Angles{float(-i), 0}).value(Angles{float(-r), float(phi)})[0]) / std::cos(r);
    };
    CHECK(S(.3, -.2, .1) == Approx(0.0670982904628).epsilon(2e-5));
    CHECK(S(.3, -.2, 2.8) == Approx(2.34791787594).epsilon(2e-5));
    CHECK(S(-.6, .9, 3) == Approx(1.25618771389).epsilon(2e-5));
    for (const double phi : {0.15, -0.4, 2.9}) CHECK(S(.5, -.8, phi) == Approx(S(-.8, .5, -phi)).epsilon(5e-5));

    // White, energies of R, TT, TRT: .0782 + .8616 + .0536 at theta 0 without glints; as printed, M integrates to about
    // 2 over theta_r.
    Marschner<3> white = hair(1.55f, 0);
    white.glint = 0.538950137f, white.glint_width = 0.02f, white.alpha_R = 0;
    const double printed = test::energy_of(far_field(white, Angles{0, 0}), 24, 4096);
    white.normalised = true;
    const double normalised = test::energy_of(far_field(white, Angles{0, 0}), 24, 4096);
    CHECK(printed == Approx(1.95 * normalised).epsilon(0.02));
    CHECK(normalised == Approx(0.994).margin(0.003));
}

TEST_CASE("Marschner: pdf and samples") {
    struct Setup {
        float eta, theta, beta, width;
        bool normalised;
    };
    for (const Setup& s : {Setup{1.55f, 0.3f, 0.1f, 0.2f, false}, Setup{1.3f, -0.9f, 0.15f, 0.1f, true},
                           Setup{2.2f, 0.5f, 0.2f, 0.3f, true}}) {
        Marschner<3> m = hair(s.eta, 0.3f);
        m.beta_R = s.beta, m.glint_width = s.width, m.normalised = s.normalised;
        const auto field = far_field(m, Angles{s.theta, 0});
        INFO("eta " << s.eta);
        // The pdf has the fold's integrable peak, which midpoints resolve to a part of one cell of TRT's share.
        CHECK(test::pdf_integral(field, 12, 4096) == Approx(1).margin(2e-3));
        const double energy = test::energy_of(field, 24, 2048);
        const auto checked =
            test::check_samples(field, 8, 50000, 6, 0.5);  // at the fold a rounding of phi takes TRT away
        CHECK(checked.p > 1e-4);
        CHECK(checked.p_broken < 1e-6);
        CHECK(std::abs(checked.energy - energy) < 4 * checked.error + 5e-4 * energy);
    }
}

TEST_CASE("Marschner: limits, and parameters that are wrong") {
    for (const float eta : {1.0001f, 1.55f, 2.0f, 10.0f})
        for (const float beta : {float(0.1 * degree), float(60 * degree)})
            for (const bool normalised : {false, true}) {
                Marschner<3> m = hair(eta, eta > 1.5f ? 0.0f : 50.0f);
                m.beta_R = beta, m.normalised = normalised;
                INFO("eta " << eta << " beta " << beta);
                test::check_finite([&](Angles known, float) { return far_field(m, known); });
            }
    // As eta -> 1 all light goes on: TT's energy is 1.
    const Marschner<3> thin = bare(1.0001f, 0);
    double forward = 0;
    for (int i = 0; i < 20000; ++i) forward += N(thin, 1, pi + 4e-2 * ((i + 0.5) / 10000 - 1), 0) * 8e-2 / 20000;
    CHECK(forward == Approx(1).epsilon(2e-3));
    Marschner<3> m = hair();
    m.glint_width = 0;
    CHECK(std::string(far_field(m, Angles{0, 0}).wrong) == "glint_width");
    m = hair(1);
    CHECK(std::string(far_field(m, Angles{0, 0}).wrong) == "eta");
}
