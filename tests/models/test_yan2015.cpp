// Yan et al. 2015. Reference values of energies and exits by an independent program that follows each path by vectors.
#include "medulla/medulla.hpp"
#include "medulla/models/yan2015.hpp"
#include "tests/models/model_checks.hpp"
#include "tests/support/fibre_of.hpp"

using namespace medulla;
using models::Yan2015;
using Lobe15 = models::Yan2015Lobe;

namespace {

constexpr double degree = pi / 180;

Yan2015<3> fur(float kappa, float eta_c, float eta_m, float sigma_ca, float sigma_ms, float layers) {
    Yan2015<3> m;
    m.kappa = kappa, m.eta_c = eta_c, m.eta_m = eta_m, m.sigma_ms = sigma_ms, m.layers = layers;
    for (float& s : m.sigma_ca) s = sigma_ca;
    m.g = 0.4f, m.alpha = 0.05f, m.beta = 0.15f;
    return m;
}
struct Expected {
    Lobe15 lobe;
    double A, centre;
};
template <std::size_t n>
void check_ray(const detail::Yan2015Ray<3>& ray, const Expected (&expected)[n], double E) {
    for (const Expected& e : expected) {
        const auto k = std::size_t(int(e.lobe));
        const bool scattered = k >= models::yan2015_scattered;
        INFO(models::yan2015_lobe_names[k]);
        // Printed to eight digits.
        CHECK(ray.A[k][1] == Approx(e.A * (scattered ? E : 1)).epsilon(3e-6).margin(6e-9));
        CHECK(std::remainder(double(ray.centre[k]) - e.centre - (scattered ? pi : 0), 2 * pi) ==
              Approx(0).margin(2e-6));
    }
}

}  // namespace

TEST_CASE("Yan 2015: energies and exits of the eleven lobes") {
    const auto ray = detail::yan2015_ray(fur(.8f, 1.5f, 1.35f, .5f, 2, .6f), std::cos(float(30 * degree)), 0.3f);
    const Expected enters[] = {{Lobe15::R, .06871700, -.60938531},         {Lobe15::TrT, .00252780, -.70327793},
                               {Lobe15::TrRrT, 5.1e-7, -.79717055},        {Lobe15::TttT, .02487597, 2.96224720},
                               {Lobe15::TtrtT, 3.23e-6, .34458702},        {Lobe15::TttRttT, 4.903e-5, .25069440},
                               {Lobe15::TttT_s, .74881542, -.08967273},    {Lobe15::TtrtT_s, 9.727e-5, -2.70733290},
                               {Lobe15::TttRttT_s, .00147590, -2.80122552}};
    check_ray(ray, enters, .96411585);
    CHECK(ray.offset == Approx(.25898021).epsilon(1e-6));
    CHECK(ray.inside);
    // Beyond the medulla's critical angle: what enters the cortex is reflected at the medulla.
    const auto total = detail::yan2015_ray(fur(.45f, 1.5f, 1.35f, .5f, 2, .6f), std::cos(float(30 * degree)), 0.68f);
    const Expected reflected[] = {{Lobe15::R, .07652174, -1.49552527},
                                  {Lobe15::TrT, .38961073, -3.0005149},
                                  {Lobe15::TrRrT, .01362051, 1.77768077}};
    check_ray(total, reflected, 0);
    CHECK(!total.inside);
    // A denser medulla, a ray on the other side.
    const auto other = detail::yan2015_ray(fur(.7f, 1.4f, 1.6f, .3f, 1.5f, 1.2f), std::cos(float(50 * degree)), -0.5f);
    const Expected denser[] = {{Lobe15::R, .184509357, 1.047197551},        {Lobe15::TrT, .004418641, 1.296739451},
                               {Lobe15::TrRrT, 5.417e-6, 1.546281351},      {Lobe15::TttT, .054314728, -2.510803217},
                               {Lobe15::TtrtT, 4.7259e-5, -.035160578},     {Lobe15::TttRttT, .000818494, .214381322},
                               {Lobe15::TttT_s, .648101299, .315394718},    {Lobe15::TtrtT_s, .000563912, 2.791037358},
                               {Lobe15::TttRttT_s, .009766544, 3.040579258}};
    check_ray(other, denser, .895711307);
    CHECK(std::abs(other.offset) == Approx(.326856073).epsilon(1e-6));
}

TEST_CASE("Yan 2015: with one index its lobes are those of 2017") {
    for (const float h : {0.0f, 0.4f, -0.8f, 0.97f})
        for (const float theta : {0.2f, -1.1f}) {
            const Yan2015<3> m = fur(.6f, 1.4f, 1.4f, .3f, 1.2f, .8f);
            FurParameters<3> p;
            p.eta = m.eta_c, p.kappa = m.kappa, p.layers = m.layers, p.sigma_ms = m.sigma_ms;
            for (float& s : p.sigma_ca) s = .3f;
            const auto ray = detail::yan2015_ray(m, std::cos(theta), h);
            const auto at = detail::inclination(p.eta, std::cos(theta), Fresnel::bravais);
            const auto path = detail::trace(at, p.kappa, p.layers, h, std::sqrt((1 - h) * (1 + h)));
            const auto e = detail::energies(path, detail::absorption(p, at.inverse_cos_t), path.s_m > 0);
            const auto A = [&](Lobe15 lobe) { return double(ray.A[int(lobe)][0]); };
            INFO("h " << h << " theta " << theta);
            CHECK(A(Lobe15::R) == Approx(double(e.A[0][0])).epsilon(1e-6));
            CHECK(A(Lobe15::TttT) + A(Lobe15::TT) == Approx(double(e.A[1][0])).epsilon(3e-6));
            CHECK(A(Lobe15::TttRttT) + A(Lobe15::TRT) == Approx(double(e.A[2][0])).epsilon(5e-6));
            CHECK(A(Lobe15::TttT_s) == Approx(double(e.A[3][0])).epsilon(3e-6));
            CHECK(A(Lobe15::TttRttT_s) == Approx(double(e.A[4][0])).epsilon(3e-6));
            for (const Lobe15 none : {Lobe15::TrT, Lobe15::TrRrT, Lobe15::TtrtT, Lobe15::TtrtT_s}) CHECK(A(none) == 0);
        }
}

TEST_CASE("Yan 2015: a medulla that is absent, and one that fills the fibre") {
    // kappa 0: R, TT and TRT of a cortex that absorbs.
    const auto hair = detail::yan2015_ray(fur(0, 1.5f, 1.3f, .4f, 3, .5f), 1, 0.5f);
    for (int k = 3; k < models::yan2015_lobe_count; ++k) CHECK(hair.A[k][0] == 0);
    CHECK(hair.A[1][0] > 0.3f);
    // Both sides of the medulla's rim, h = kappa eta'_c = .75: TT there is what goes round inside TrT, which takes
    // over where its F is 1.
    const Yan2015<3> m = fur(.5f, 1.5f, 1.4f, .4f, 3, .5f);
    const auto below = detail::yan2015_ray(m, 1, 0.7499f), above = detail::yan2015_ray(m, 1, 0.7501f);
    CHECK(below.A[int(Lobe15::TrT)][0] == Approx(above.A[int(Lobe15::TT)][0]).epsilon(0.03));  // sqrt of the step
    double sum = 0;
    for (const auto& A : detail::yan2015_ray(fur(1, 1.5f, 1.2f, 0, 3, .5f), 0.8f, 0.4f).A) sum += double(A[0]);
    CHECK(sum <= 1 + 1e-6);
    CHECK(sum > 0.9);
}

TEST_CASE("Yan 2015: M^s and D integrate to 1, the pdf too, and samples follow it") {
    for (const auto& preset : {models::yan2015_presets[0], models::yan2015_presets[6]}) {
        Yan2015<3> m = models::parameters_of<3>(preset);
        m.beta = std::max(m.beta, 0.1f);
        m.g = std::min(m.g, 0.5f);
        const test::OwnedTables tables(test::shipped(), ranges_of(m));
        REQUIRE(tables.get() != nullptr);
        for (const float theta : {-0.7f, 1.2f}) {
            const auto hit = near_field(m, tables.get(), Angles{theta, 0}, 0.35f);
            INFO(preset.name << " theta " << theta);
            REQUIRE(hit.wrong == nullptr);
            for (const float forwardness : {0.0f, 0.3f, 1.0f}) {
                double mass = 0;
                constexpr int n = 4000;
                for (int i = 0; i < n; ++i) {
                    const double t = pi * ((i + 0.5) / n - 0.5);
                    mass += double(hit.scattered_along(float(t), float(std::cos(t)), forwardness)) * pi / n;
                }
                CHECK(mass == Approx(1).margin(2e-3));  // 64 midpoints over a spline of narrow spans
            }
            CHECK(test::pdf_integral(hit, 24, 256) == Approx(1).margin(2e-5));
            const double energy = test::energy_of(hit, 24, 256);
            CHECK(energy == Approx(double(hit.albedo()[0])).epsilon(2e-3));
            const auto s = test::check_samples(hit, 4, 60000, 2);
            CHECK(s.p > 1e-4);
            CHECK(s.p_broken < 1e-6);
            CHECK(std::abs(s.energy - energy) < 4 * s.error + 1e-4);
        }
    }
}

TEST_CASE("Yan 2015: limits, and parameters that are wrong") {
    const Yan2015<3> base = fur(.7f, 1.5f, 1.4f, .2f, 2, .6f);
    const test::OwnedTables tables(test::shipped(), ranges_of(base));
    for (const float kappa : {0.0f, 1e-6f, 0.7f, 1.0f})
        for (const float eta_c : {1.0001f, 1.5f})
            for (const float eta_m : {1.0001f, 1.5f, 3.0f})
                for (const float beta : {float(0.1 * degree), float(60 * degree)}) {
                    Yan2015<3> m = base;
                    m.kappa = kappa, m.eta_c = eta_c, m.eta_m = eta_m, m.beta = beta;
                    INFO("kappa " << kappa << " eta " << eta_c << " " << eta_m << " beta " << beta);
                    test::check_finite([&](Angles known, float h) { return near_field(m, tables.get(), known, h); });
                }
    Yan2015<3> m = base;
    m.eta_m = 0.9f;
    CHECK(std::string(near_field(m, tables.get(), Angles{0, 0}, 0).wrong) == "eta_m");
    m = base, m.g = 1;
    CHECK(std::string(near_field(m, tables.get(), Angles{0, 0}, 0).wrong) == "g");
    // Tables of one material have C^M at another optical radius.
    FurParameters<3> p;
    p.kappa = .7f, p.sigma_ms = 2;
    const test::OwnedTables one(test::shipped(), ranges_of(p));
    CHECK(std::string(near_field(base, one.get(), Angles{0, 0}, 0).wrong) == "tables");
    // Without tables the unscattered lobes are left.
    const auto unscattered = near_field(base, nullptr, Angles{0, 0}, 0.2f);
    CHECK(unscattered.albedo()[0] > 0.01f);
    CHECK(unscattered.albedo()[0] < 0.3f);
    CHECK(test::energy_of(unscattered) == Approx(double(unscattered.albedo()[0])).margin(1e-5));
}
