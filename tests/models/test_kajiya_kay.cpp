// Kajiya and Kay, and Kim, who multiplies their specular lobe by an azimuthal one. Reference values by mpmath, from the
// printed formulas.
#include "medulla/models/kajiya_kay.hpp"
#include "medulla/models/kim.hpp"
#include "tests/models/model_checks.hpp"

using namespace medulla;
using models::KajiyaKay;
using models::Kim;

namespace {

KajiyaKay<3> kajiya_kay(float diffuse, float specular, float exponent, bool normalised) {
    KajiyaKay<3> m;
    for (int c = 0; c < 3; ++c) m.diffuse[c] = diffuse, m.specular[c] = specular;
    m.exponent = exponent, m.normalised = normalised;
    return m;
}
Kim<3> kim(float rho_R, float rho_T, float exponent, float sharpness, bool normalised) {
    Kim<3> m;
    for (int c = 0; c < 3; ++c) m.rho_R[c] = rho_R, m.rho_T[c] = rho_T;
    m.exponent = exponent, m.sharpness = sharpness, m.normalised = normalised;
    return m;
}
constexpr double degree = pi / 180;

}  // namespace

TEST_CASE("Kajiya-Kay: the power of the cosine and its integral") {
    // Z_p by mpmath, with the regularised incomplete beta function.
    const double p20 = 0.553539364154, p12 = 0.69495747914;
    CHECK(detail::power_of_cosine_integral(0, 20) == Approx(p20).epsilon(1e-6));
    CHECK(detail::power_of_cosine_integral(float(80 * degree), 20) == Approx(0.435045618472).epsilon(1e-6));
    CHECK(detail::power_of_cosine_integral(0, 12.5f) == Approx(p12).epsilon(1e-6));
    CHECK(detail::power_of_cosine_integral(float(30 * degree), 1) == Approx(1.86602540378).epsilon(1e-6));
    CHECK(detail::power_of_cosine_integral(float(80 * degree), 1) == Approx(1.17364817767).epsilon(1e-6));
    // p -> infinity: a Gaussian of deviation 1 / sqrt(p), whose first correction is -1 / (4 p).
    CHECK(detail::power_of_cosine_integral(0, 1e6f) == Approx(std::sqrt(2 * pi / 1e6)).epsilon(1e-5));
    for (const float x : {0.0f, 0.01f, 0.3f, 1.5f})
        for (const float p : {1.0f, 20.0f, 1e5f})
            CHECK(detail::power_of_cosine(x, p) ==
                  Approx(std::pow(std::cos(double(x)), double(p))).epsilon(2e-3).margin(1e-30));
}

TEST_CASE("Kajiya-Kay: printed values and energies") {
    // S of K_d .1, k_s .3, p 20; `value` is S times the cosine of the light's inclination, and the light is drawn.
    const auto printed = far_field(kajiya_kay(0.1f, 0.3f, 20, false), Angles{-0.3f, 0});
    CHECK(printed.value(Angles{0.4f, 2})[0] == Approx(0.39466655095 * std::cos(0.4)).epsilon(1e-5));
    const auto normalised = far_field(kajiya_kay(0.2f, 0.3f, 20, true), Angles{0.4f, 0});
    CHECK(normalised.value(Angles{-0.3f, 2})[0] == Approx(0.0965297711151 / std::cos(0.3)).epsilon(1e-5));
    // Energy of the printed specular lobe for light from theta_i: integral of S cos^2 theta_r; it grows without bound
    // at grazing light.
    const double degrees[] = {0, 30, 60, 80, 89};
    const double expected[] = {3.319899927, 2.920754463, 1.896674056, 1.354111147, 5.128528424};
    for (int i = 0; i < 5; ++i) {
        const Angles light = {float(degrees[i] * degree), 0};
        const double energy = test::sphere_integral(
            [&](Angles w) {
                const double S =
                    double(far_field(kajiya_kay(0, 1, 20, false), w).value(light)[0]) / std::cos(double(light.theta));
                return S * std::cos(double(w.theta));
            },
            24, 1);
        CHECK(energy == Approx(expected[i]).epsilon(2e-5));  // 1 / cos 89 degrees: 60 roundings
    }
}

TEST_CASE("Kajiya-Kay: normalised energies, pdf and samples") {
    for (const float theta : {0.0f, 0.7f, -1.4f})
        for (const bool normalised : {false, true}) {
            const auto field = far_field(kajiya_kay(0.3f, 0.6f, 30, normalised), Angles{theta, 0});
            INFO("theta " << theta << " normalised " << normalised);
            // Floats, 3000 of them.
            CHECK(test::pdf_integral(field, 24, 8) == Approx(1).margin(5e-6));
            const double energy = test::energy_of(field, 24, 8);
            if (normalised) CHECK(energy == Approx(0.9).margin(1e-5));
            const auto s = test::check_samples(field, 5, 40000);
            CHECK(s.p > 1e-4);  // six setups
            CHECK(s.p_broken < 1e-6);
            CHECK(std::abs(s.energy - energy) < 4 * s.error);
        }
    // The diffuse lobe is reciprocal, the specular one is not.
    const auto S = [](float K, float k, float a, float b) {
        return double(far_field(kajiya_kay(K, k, 20, false), Angles{b, 0}).value(Angles{a, 0})[0]) /
               std::cos(double(a));
    };
    CHECK(S(1, 0, 0.2f, 1.1f) == Approx(S(1, 0, 1.1f, 0.2f)).epsilon(1e-6));
    CHECK(S(0, 1, -0.2f, 0.5f) / S(0, 1, 0.5f, -0.2f) == Approx(std::cos(0.5) / std::cos(0.2)).epsilon(1e-5));
}

TEST_CASE("Kim: values, energies, pdf and samples") {
    // N of rho_R .5, rho_T 1, k 3 at theta_r = -theta_i, where the power is 1.
    const auto field = far_field(kim(0.5f, 1, 20, 3, false), Angles{0, 0});
    CHECK(field.value(Angles{0, 0})[0] == Approx(0.5).epsilon(1e-6));
    CHECK(field.value(Angles{0, 1})[0] == Approx(0.438791280945).epsilon(1e-6));
    CHECK(field.value(Angles{0, float(pi) - 0.3f})[0] == Approx(0.696329034507).epsilon(1e-6));
    CHECK(field.value(Angles{0, float(pi)})[0] == Approx(1).epsilon(1e-6));
    // The printed N_T has phi - pi for both signs of phi, which is wrong for phi < 0 unless k is whole.
    CHECK(far_field(kim(0, 1, 20, 2.5f, false), Angles{0, 0}).value(Angles{0, 0.1f - float(pi)})[0] ==
          Approx(0.96891242).epsilon(1e-6));
    for (const bool normalised : {false, true}) {
        const auto some = far_field(kim(0.3f, 0.5f, 40, 2.5f, normalised), Angles{0.6f, 0});
        // N_T has corners at +-pi (1 - 1 / (2 k)): 2 pi / 4096 of its slope.
        CHECK(test::pdf_integral(some, 24, 4096) == Approx(1).margin(2e-6));
        const double energy = test::energy_of(some, 24, 4096);
        if (normalised) CHECK(energy == Approx(0.8).margin(5e-6));
        const auto s = test::check_samples(some, 6, 40000, 4);
        CHECK(s.p > 1e-4);
        CHECK(s.p_broken < 1e-6);
        CHECK(std::abs(s.energy - energy) < 4 * s.error);
    }
}

TEST_CASE("Kajiya-Kay and Kim: limits, and parameters that are wrong") {
    for (const float p : {1.0f, 1e6f})
        for (const bool normalised : {false, true}) {
            test::check_finite(
                [&](Angles known, float) { return far_field(kajiya_kay(0.2f, 0.7f, p, normalised), known); });
            test::check_finite(
                [&](Angles known, float) { return far_field(kim(0.2f, 0.7f, p, 0.5f, normalised), known); });
            test::check_finite(
                [&](Angles known, float) { return far_field(kim(0.2f, 0.7f, p, 1e4f, normalised), known); });
        }
    const auto wrong = far_field(kajiya_kay(0.2f, 0.7f, 0.5f, true), Angles{0, 0});
    CHECK(std::string(wrong.wrong) == "exponent");
    CHECK(wrong.value(Angles{0, 0})[0] == 0);
    CHECK(!wrong.sample({}).valid);
    CHECK(std::string(far_field(kim(0.2f, NAN, 20, 2, true), Angles{0, 0}).wrong) == "rho_T");
    CHECK(std::string(far_field(kim(0.2f, 0.1f, 20, 0.4f, true), Angles{0, 0}).wrong) == "sharpness");
    CHECK(models::wrong_parameter(kajiya_kay(-1, 0, 2, true)).name == std::string("diffuse"));
    CHECK(models::wrong_parameter(kajiya_kay(0, 0, 2, true)).name == nullptr);
}
