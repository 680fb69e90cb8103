// The models of one smooth cylinder: Zinke and Weber, d'Eon, Chiang. Reference values by mpmath in 30 digits, and by
// vector ray tracing of a cylinder.
#include "medulla/models/chiang.hpp"
#include "medulla/models/deon.hpp"
#include "medulla/models/marschner.hpp"
#include "medulla/models/zinke.hpp"
#include "tests/models/model_checks.hpp"

using namespace medulla;
using models::Chiang;
using models::DEon;
using models::Zinke;

namespace {

constexpr double degree = pi / 180;

template <class Model>
Model hair(float eta, float sigma, float alpha, float beta_m, float beta_n) {
    Model m;
    m.eta = eta, m.alpha = alpha, m.beta_m = beta_m, m.beta_n = beta_n;
    for (float& s : m.sigma_a) s = sigma;
    return m;
}
/// A_p at one offset, p = 0 .. 3, and the sum from p = 4 on.
std::vector<double> energies(float eta, float sigma, float theta, float h, bool tail = true) {
    const float sigma_a[1] = {sigma};
    const auto c = detail::cylinder<1>(eta, sigma_a, std::cos(theta));
    float A[5][1];
    detail::order_energies<1, 5>(c, detail::chord(c.at, h, std::sqrt((1 - h) * (1 + h))), tail, A);
    return {double(A[0][0]), double(A[1][0]), double(A[2][0]), double(A[3][0]), double(A[4][0])};
}

}  // namespace

TEST_CASE("cylinder: Fresnel terms, energies of the orders and their tail") {
    // F of a bare interface, exact, h = .6 and theta .3; at 69 degrees, h = 0.
    const auto at = detail::inclination(1.55f, std::cos(0.3f), Fresnel::exact);
    CHECK(detail::chord(at, 0.6f, 0.8f).cuticle.F == Approx(0.0526914716956).epsilon(2e-6));
    const auto grazing = detail::inclination(1.55f, std::cos(float(69 * degree)), Fresnel::exact);
    CHECK(detail::chord(grazing, 0.0f, 1.0f).cuticle.F == Approx(0.1677877251).epsilon(2e-6));
    // Means over h, theta .3: R, TT, TRT, p = 3 and the tail from p = 4; 1600 midpoints in gamma, which miss 2e-6 of R
    // at the rim.
    for (const float sigma : {0.2f, 0.0f}) {
        std::vector<double> mean(5, 0.0);
        for (int i = 0; i < 1600; ++i) {
            const double gamma = pi * ((i + 0.5) / 1600 - 0.5);
            const auto A = energies(1.55f, sigma, 0.3f, float(std::sin(gamma)));
            for (std::size_t p = 0; p < 5; ++p) mean[p] += A[p] * std::cos(gamma) * pi / 3200;
        }
        const std::vector<double> expected =
            sigma > 0
                ? std::vector<double>{.0780608343375, .584993894968, .0274392128111, .00213395000853, .000468963377127}
                : std::vector<double>{.0780608343375, .856547711841, .0572349308295, .00601178649245, .00214473649913};
        for (std::size_t p = 0; p < 5; ++p) CHECK(mean[p] == Approx(expected[p]).epsilon(2e-5));
    }
    // White: all orders add up to 1, to rounding, for every ray.
    for (const float eta : {1.0001f, 1.3f, 2.5f})
        for (const float theta : {0.0f, 1.0f, 1.57f})
            for (const float h : {0.0f, 0.7f, 0.9999f, 1.0f}) {
                double sum = 0;
                for (const double a : energies(eta, 0, theta, h)) sum += a;
                CHECK(sum == Approx(1).margin(5e-7));
            }
}

TEST_CASE("cylinder: where a ray leaves") {
    // By vector ray tracing: azimuth of the exit point, displacement along the fibre, length of the path.
    const double exits[2][4][3] = {{{-.3575711036, 0, 0},
                                    {-3.0793222437, -.6362328324, 2.0569636175},
                                    {.4821119235, -1.2724656648, 4.113927235},
                                    {-2.2396392165, -1.9086984972, 6.1708908525}},
                                   {{.9272952180, 0, 0},
                                    {-3.0012737084, 1.7393570069, 2.5371919155},
                                    {-.6466573277, 3.4787140138, 5.074383831},
                                    {0, 0, 0}}};
    const float setups[2][3] = {{1.55f, 0.5f, 0.35f}, {1.3f, -1.1f, -0.8f}};
    for (int k = 0; k < 2; ++k)
        for (int p = 0; p < (k == 0 ? 4 : 3); ++p) {
            const models::ExitPoint e = models::exit_point(setups[k][0], setups[k][1], setups[k][2], p);
            CHECK(e.azimuth == Approx(exits[k][p][0]).epsilon(2e-6));
            CHECK(e.displacement == Approx(exits[k][p][1]).epsilon(2e-6).margin(1e-7));
            CHECK(e.length == Approx(exits[k][p][2]).epsilon(2e-6).margin(1e-7));
            CHECK(e.offset == setups[k][2]);
        }
}

TEST_CASE("d'Eon: the longitudinal lobe") {
    // Density per unit of sin theta, by mpmath from the printed form.
    const double table[][4] = {{1e-6, .3, -.3, 417.59352812556}, {1e-4, .3, -.31, 25.368680092984},
                               {.01, .3, -.2, 2.5050747235505},  {.01, 1.4, -1.5, 25.443170745818},
                               {.04, -.7, .5, 1.4906097186875},  {.1, .3, -.3, 1.3399029501545},
                               {.25, .8, 0, .30150840976754},    {1, .3, .4, .45624052097461},
                               {10, .3, .4, .49441172138109},    {1000, 1, 1, .49964601597404}};
    for (const auto& row : table) {
        const auto M = detail::von_mises_fisher(float(row[0]), float(row[1]), 0);
        // An angle's rounding, 3e-8, over the deviation, times 10 deviations.
        CHECK(M.density(float(row[2]), float(std::cos(row[2]))) ==
              Approx(row[3]).epsilon(3e-6 + 3e-7 / std::sqrt(row[0])));
    }
    for (const double v : {1e-5, 1e-3, 0.1, 1.0, 100.0})
        for (const double theta : {0.0, 1.0, -1.5})
            for (const double shift : {0.0, 0.3}) {
                const auto M = detail::von_mises_fisher(float(v), float(theta), float(shift));
                double sum = 0;
                constexpr int n = 20000;
                for (int i = 0; i < n; ++i) {
                    const double t = pi * ((i + 0.5) / n - 0.5);
                    sum += double(M.density(float(t), float(std::cos(t)))) * std::cos(t) * pi / n;
                }
                INFO("v " << v << " theta " << theta << " shift " << shift);
                CHECK(sum == Approx(1).margin(3e-6 + 1e-7 / std::sqrt(v)));
            }
}

TEST_CASE("d'Eon: the azimuthal lobes") {
    // 1/2 integral over h of A_p D, eta 1.55, theta .3, sigma .2, beta_n .15, at phi = 0, .7, 2, 3.
    const double expected[4][4] = {{.011640428145, .011129459247, .012601179423, .011539958168},
                                   {1.509658e-14, 4.608170464e-7, .07154631378, .36903652064},
                                   {.033197261775, .0030901385268, 1.4327e-12, 0},
                                   {2e-11, 8.4590565e-7, .0011028414811, .00017074733272}};
    const auto field = far_field(hair<DEon<3>>(1.55f, 0.2f, 0, 0.1f, 0.15f), Angles{0.3f, 0});
    const float phi[] = {0, 0.7f, 2, 3};
    for (int p = 0; p < 4; ++p)
        for (int i = 0; i < 4; ++i) {
            INFO("p " << p << " phi " << phi[i]);
            CHECK(field.azimuthal(p, phi[i])[0] == Approx(expected[p][i]).epsilon(1e-5).margin(2e-8));
        }
    // The tail is even: its energy over 2 pi.
    CHECK(field.azimuthal(4, 1)[0] == Approx(.000468963377127 / (2 * pi)).epsilon(2e-5));
    // Narrow detectors tend to Marschner's N off the caustic.
    const auto narrow = far_field(hair<Zinke<3>>(1.55f, 0.2f, 0, 0.1f, 0.002f), Angles{0.3f, 0});
    CHECK(narrow.azimuthal(0, 1)[0] == Approx(.0107527285419).epsilon(2e-4));
    CHECK(narrow.azimuthal(1, 2.8f)[0] == Approx(.33602129383).epsilon(2e-4));
    CHECK(narrow.azimuthal(2, 0)[0] == Approx(.0357548499267).epsilon(2e-3));
}

TEST_CASE("white furnace of the cylinder's models") {
    for (const float theta : {0.0f, -0.8f, 1.4f}) {
        INFO("theta " << theta);
        const Angles known = {theta, 0};
        // Any order and its tail, 1; three orders, what R, TT and TRT carry: .9918 at theta .3.
        CHECK(test::energy_of(far_field(hair<DEon<3>>(1.55f, 0, 0.05f, 0.2f, 0.15f), known)) == Approx(1).margin(1e-5));
        CHECK(test::energy_of(far_field(hair<DEon<3, 2>>(1.55f, 0, 0.05f, 0.2f, 0.3f), known)) ==
              Approx(1).margin(1e-5));
        for (const float h : {0.0f, -0.5f, 0.97f}) {
            CHECK(test::energy_of(near_field(hair<Chiang<3>>(1.55f, 0, 0.03f, 0.3f, 0.3f), known, h)) ==
                  Approx(1).margin(1e-5));
            const auto near_hit = near_field(hair<Zinke<3>>(1.55f, 0, 0.05f, 0.15f, 0.15f), known, h);
            CHECK(test::energy_of(near_hit) == Approx(double(near_hit.albedo()[0])).margin(1e-5));
            CHECK(near_hit.albedo()[0] < 1);
        }
    }
    const auto zinke = far_field(hair<Zinke<3>>(1.55f, 0, 0, 0.15f, 0.15f), Angles{0.3f, 0});
    CHECK(test::energy_of(zinke) == Approx(.0780608343375 + .856547711841 + .0572349308295).margin(1e-5));
    // Without a tail, four orders: the last of them is p = 4.
    DEon<3> four = hair<DEon<3>>(1.55f, 0, 0, 0.2f, 0.15f);
    four.tail = false;
    const double lost = 1 - test::energy_of(far_field(four, Angles{0.3f, 0}));
    CHECK(lost > 2e-4);
    CHECK(lost < .00214473649913);
}

TEST_CASE("a far field is the mean of its near fields") {
    const Zinke<3> m = hair<Zinke<3>>(1.4f, 0.3f, 0.05f, 0.2f, 0.08f);
    const Angles known = {0.6f, 0.3f};
    const auto mean = far_field(m, known);
    for (const Angles drawn : {Angles{-0.5f, 0.4f}, Angles{-0.4f, 3.1f}, Angles{-0.9f, -2.5f}}) {
        double value = 0, pdf = 0;
        constexpr int n = 4000;
        for (int i = 0; i < n; ++i) {
            const auto e = near_field(m, known, float(2 * (i + 0.5) / n - 1)).evaluate(drawn);
            value += double(e.value[0]) / n, pdf += double(e.pdf) / n;
        }
        // 4000 midpoints in h miss 1e-4 of R at the rim; the mean itself is within 2e-6.
        CHECK(mean.value(drawn)[0] == Approx(value).epsilon(3e-4));
        CHECK(mean.pdf(drawn) == Approx(pdf).epsilon(3e-4));
    }
}

TEST_CASE("d'Eon: without tilt the longitudinal lobes are symmetric") {
    const auto M = [](float i, float r) { return detail::von_mises_fisher(0.05f, i, 0).density(r, std::cos(r)); };
    CHECK(M(0.3f, -0.8f) == Approx(M(-0.8f, 0.3f)).epsilon(1e-5));
    CHECK(M(1.4f, -0.2f) == Approx(M(-0.2f, 1.4f)).epsilon(1e-5));
}

TEST_CASE("cylinder: pdf and samples") {
    const Angles known[] = {{0.3f, 0}, {-1.1f, 0}};
    for (const Angles& k : known) {
        const auto check = [&](const auto& field, int samples) {
            CHECK(test::pdf_integral(field) == Approx(1).margin(1e-5));
            const double energy = test::energy_of(field);
            const auto s = test::check_samples(field, 11, samples, 2);
            CHECK(s.p > 1e-4);
            CHECK(s.p_broken < 1e-6);
            CHECK(std::abs(s.energy - energy) < 4 * s.error + 1e-5);
        };
        SECTION("Zinke near") { check(near_field(hair<Zinke<3>>(1.55f, 0.3f, 0.05f, 0.2f, 0.2f), k, 0.4f), 60000); }
        SECTION("Zinke far") { check(far_field(hair<Zinke<3>>(1.55f, 0.3f, 0.05f, 0.2f, 0.2f), k), 30000); }
        SECTION("d'Eon") { check(far_field(hair<DEon<3>>(1.55f, 0.3f, 0.05f, 0.25f, 0.2f), k), 30000); }
        SECTION("Chiang") { check(near_field(hair<Chiang<3>>(1.55f, 0.3f, 0.05f, 0.35f, 0.4f), k, -0.7f), 60000); }
    }
}

TEST_CASE("Chiang: a reflection leaves on the side of its surface, tilted towards the root") {
    const auto field = near_field(hair<Chiang<3>>(1.55f, 50, 0.0873f, 0.2f, 0.15f), Vector{0, 1, 0}, 0.5f);
    const auto at = [&](double x, double phi) {
        const double c = std::sqrt(1 - x * x);
        return field.value(Vector{float(x), float(c * std::cos(phi)), float(c * std::sin(phi))})[0];
    };
    const double turn = 2 * std::asin(0.5);  // h > 0 is at z < 0: the reflection turns by -2 asin(0.5)
    CHECK(at(0, -turn) > 20 * at(0, turn));
    // Scales rise from root to tip, so that their outer face looks to the root: R leaves at x = -sin(2 alpha).
    CHECK(at(-0.174, -turn) > 1.5 * at(0.174, -turn));
    CHECK(Chiang<3>::deviation_of(0.3f) == Approx(0.726 * 0.3 + 0.812 * 0.09 + 3.7 * std::pow(0.3, 20)).epsilon(1e-6));
}

TEST_CASE("cylinder: limits, and parameters that are wrong") {
    for (const float eta : {1.0001f, 1.55f, 10.0f})
        for (const float beta : {float(0.1 * degree), float(60 * degree)})
            for (const float sigma : {0.0f, 1e3f}) {
                INFO("eta " << eta << " beta " << beta << " sigma " << sigma);
                const float tilt = 0.2f, perceptual = beta < 0.1f ? 0.005f : 1.0f;
                test::check_finite(
                    [&](Angles k, float h) { return near_field(hair<Zinke<3>>(eta, sigma, tilt, beta, beta), k, h); });
                test::check_finite([&](Angles k, float h) {
                    return near_field(hair<Chiang<3>>(eta, sigma, tilt, perceptual, perceptual), k, h);
                });
                if (sigma > 0) continue;
                const float around = std::max(beta, 0.02f);  // at 0.1 degrees a mean takes 5000 offsets
                test::check_finite(
                    [&](Angles k, float) { return far_field(hair<DEon<3>>(eta, sigma, tilt, beta, around), k); });
            }
    test::check_finite([&](Angles k, float h) { return near_field(hair<Zinke<3>>(1.5f, 0, 0.1f, 0.1f, 0.1f), k, h); });
    const Angles k = {0, 0};
    CHECK(std::string(near_field(hair<Zinke<3>>(1, 0, 0, 0.1f, 0.1f), k, 0).wrong) == "eta");
    CHECK(std::string(far_field(hair<Zinke<3>>(1.5f, -1, 0, 0.1f, 0.1f), k).wrong) == "sigma_a");
    CHECK(std::string(far_field(hair<DEon<3>>(1.5f, 0, 0, 0.1f, 0), k).wrong) == "beta_n");
    CHECK(std::string(near_field(hair<Chiang<3>>(1.5f, 0, 1, 0.1f, 0.1f), k, 0).wrong) == "alpha");
    CHECK(near_field(hair<Chiang<3>>(1.5f, 0, 0, NAN, 0.1f), k, 0).value(k)[0] == 0);
    CHECK(near_field(hair<Zinke<3>>(1.5f, 0, 0, 0.1f, 0.1f), k, NAN).value(k)[0] == 0);
}
