// The near field against a plain double-precision twin written from physics.md, and at the ends of every range.
#include <catch2/catch.hpp>
#include <random>

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

double total(const LobeValues<3>& l) {
    double sum = 0;
    for (int p = 0; p < lobe_count; ++p)
        for (int c = 0; c < 3; ++c) sum += double(l.M[p]) * double(l.N[p][c]);
    return sum;
}

}  // namespace

TEST_CASE("the analytic pack is valid and gives its closed forms back", "[bcsdf]") {
    const auto opened = open_pack(pack().bytes.data(), pack().bytes.size());
    REQUIRE(opened.status == PackStatus::ok);
    for (float g : {0.0f, 0.3f, 0.5f})
        for (float h : {0.0f, 0.4f, 0.99f})
            for (float phi = -3; phi < 3.2f; phi += 0.4f) {
                LobeQuery q;
                q.sigma = 2, q.g = g, q.h = h;
                const TableView& t = pack().view[TableKind::azimuthal];
                // Splines of 48 spans carry harmonics to 15: (15 * 2 pi / 48)^4 / 384 of the highest, g^14, plus int16.
                CHECK(lobe(t, contract(t, q), phi) ==
                      Approx(analytic::azimuthal_density(2, g, h, phi, 15)).margin(3e-4));
            }
}

TEST_CASE("a search that starts from an index finds the same cell on uneven axes", "[bcsdf]") {
    std::vector<double> t = {0, 1e-3, 2e-3, 4e-3, 4.1e-3, 0.3, 0.5, 0.50001, 0.9, 16};
    {
        const auto knots = analytic::packed_knots<float>(analytic::with_ghosts(t));
        const AxisView<float> axis = {reinterpret_cast<const unsigned char*>(knots.data()),
                                      std::uint32_t(t.size() - 1)};
        const AxisIndex<float> index = index_axis(axis);
        std::mt19937 random(3);
        std::uniform_real_distribution<float> u(0, 1);
        for (int i = 0; i < 20000; ++i) {
            const float power = std::pow(u(random), 8.0f), knot = float(t[std::size_t(i) % t.size()]);
            const float x =
                i % 3 == 0 ? 18 * power - 1 : (i % 3 == 1 ? knot : std::nextafter(knot, i % 2 ? -1.0f : 20.0f));
            const Cell<float> a = locate(axis, x), b = locate(axis, index, x);
            REQUIRE(a.span == b.span);
            REQUIRE(a.x == b.x);
        }
    }
}

TEST_CASE("near field equals the double-precision twin", "[bcsdf]") {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> u(0, 1);
    int compared = 0;
    for (int i = 0; i < 4000; ++i) {
        FurParameters<3> p = parameters_of<3>(fur_presets[i % fur_preset_count]);
        if (i % 3 == 0) {
            p.eta = 1.0001f + 1.4999f * u(random), p.kappa = u(random), p.layers = 5 * u(random);
            p.beta_m = 0.02f + u(random), p.beta_n = 0.02f + u(random), p.g = 0.6f * u(random);
        }
        p.sigma_ca[1] *= 2, p.sigma_ca[2] *= 0.1f;
        p.fresnel = i % 2 == 0 ? Fresnel::bravais : Fresnel::exact;
        const float theta_i = 1.55f * (2 * u(random) - 1), h = 2 * u(random) - 1, phi = 6.28f * (u(random) - 0.5f);
        const float theta_r =
            std::max(-1.57f, std::min(1.57f, i % 2 ? 3.1f * (u(random) - 0.5f) : -theta_i + 0.1f * (u(random) - 0.5f)));
        FurFibre<3> fibre;
        REQUIRE(prepare(p, pack().view, fibre) == FurStatus::ok);
        const LobeValues<3> l = near_lobes(fibre, theta_i, theta_r, phi, h);
        const auto r = reference::near_lobes(p, pack().view, theta_i, theta_r, phi, h);
        for (int k = 0; k < lobe_count; ++k) {
            // Float rounding of an angle of size 2 pi is 5e-7; over a deviation b it moves a Gaussian's exponent by
            // z * 5e-7 / b with z <= sqrt(2 * 30) where the lobe is worth comparing: 8e-6 / b, two such Gaussians.
            const double tolerance = 4e-5 + 1.6e-5 / double(std::min(p.beta_m / 2, p.beta_n));
            CHECK(double(l.M[k]) == Approx(r.M[k]).epsilon(tolerance).margin(1e-10));
            // A scattered lobe is a signed sum of 16 components of up to 1/pi: 5 in all, times float's 6e-8, and the
            // angle's 5e-7 times the slope of the highest harmonics.
            for (int c = 0; c < 3; ++c)
                CHECK(double(l.N[k][c]) == Approx(r.N[k][c]).epsilon(tolerance).margin(k < 3 ? 1e-7 : 1e-6));
            compared += r.M[k] > 0 && r.N[k][0] > 0;
        }
    }
    CHECK(compared > 10000);
}

TEST_CASE("Gaussians of three lobes abreast are what they are one by one", "[bcsdf]") {
    std::mt19937 random(4);
    std::uniform_real_distribution<float> u(0, 1);
    for (int i = 0; i < 4000; ++i) {
        const float theta_i = i % 5 ? 3.1415925f * (u(random) - 0.5f) : 1.5707963f, alpha = i % 3 ? 0.1f : 1.5f;
        const float beta = 1e-4f * std::pow(4e4f, u(random)), theta_r = 3.1415925f * (u(random) - 0.5f);
        const float centre[4] = {alpha - theta_i, -0.5f * alpha - theta_i, -1.5f * alpha - theta_i, 0};
        const auto M = truncated_gaussians(four_at(centre), Four(beta, 0.5f * beta, 1.5f * beta, 1));
        const WrappedGaussians D = wrapped_gaussians(beta, 1.4f * beta, 1.7f * beta);
        const float phi = 20 * (u(random) - 0.5f);
        const Four m = M.pdf(theta_r), d = D.pdf(four_at(centre), phi),
                   joint = joint_pdf(M, D, four_at(centre), theta_r, phi);
        for (int p = 0; p < 3; ++p) {
            const auto one = truncated_gaussian(centre[p], (p == 0 ? 1.0f : (p == 1 ? 0.5f : 1.5f)) * beta);
            CHECK(M[p].origin == one.origin);
            CHECK(M[p].beyond == one.beyond);
            CHECK(double(M[p].peak) == Approx(double(one.peak)).epsilon(1e-6));  // a few roundings
            // An exponent of up to 87 rounded twice to 6e-8.
            CHECK(double(lane(m, p)) == Approx(double(one.pdf(theta_r))).epsilon(1.1e-5).margin(1e-30));
            // z = x / deviation is rounded alike; turns are counted from the nearest of each.
            const double tolerance = 1e-5 + 2e-5 / double(beta);  // as near_lobes against its twin
            CHECK(double(lane(d, p)) == Approx(double(D[p].pdf(phi - centre[p]))).epsilon(tolerance).margin(1e-12));
            CHECK(double(lane(joint, p)) ==
                  Approx(double(lane(m, p)) * double(lane(d, p))).epsilon(1.1e-5).margin(1e-30));
        }
        CHECK(lane(d, 3) == 0);
    }
}

TEST_CASE("the cosine of four inclinations keeps its digits to pi/2", "[bcsdf]") {
    const float last = 1.57079625f;  // float(pi/2) is beyond pi/2, and its cosine below 0
    double worst = 0;
    for (int i = 0; i <= 100000; ++i) {
        const float power = std::pow(10.0f, -8 * float(i) / 100000);
        for (float x : {last * float(i) / 100000, last - last * power, 0.78539816f + 1e-4f * power})
            for (float y : {x, -x}) {
                const double exact = std::cos(double(y));
                worst = std::max(worst, std::abs(double(lane(real_math::cosine(Four(y)), 1)) / exact - 1));
            }
    }
    CHECK(worst < 2e-7);
    CHECK(double(lane(real_math::cosine(Four(float(pi / 2))), 0)) == Approx(std::cos(double(float(pi / 2)))));
}

TEST_CASE("kappa = 0 is exactly the hair model and reads no table", "[bcsdf]") {
    FurParameters<3> p = parameters_of<3>(*find_preset("human"));
    p.kappa = 0;
    FurFibre<3> hair, without;
    REQUIRE(prepare(p, pack().view, hair) == FurStatus::ok);
    REQUIRE(prepare(p, PackView{}, without) == FurStatus::ok);  // an empty pack would crash a lookup
    for (float h : {-1.0f, -0.7f, 0.0f, 0.3f, 1.0f}) {
        const auto a = near_lobes(hair, 0.3f, -0.31f, 2.9f, h), b = near_lobes(without, 0.3f, -0.31f, 2.9f, h);
        for (int k = 0; k < lobe_count; ++k) {
            CHECK(a.M[k] == b.M[k]);
            CHECK(a.N[k][0] == b.N[k][0]);
        }
        CHECK(a.N[3][0] == 0);
        CHECK(a.N[4][0] == 0);
    }
    p.kappa = 0.5f;
    FurFibre<3> lacking;
    CHECK(prepare(p, PackView{}, lacking) == FurStatus::no_azimuthal_table);
    CHECK(near_lobes(lacking, 0.3f, -0.3f, 0.1f, 0.1f).N[3][0] == 0);
    const AnalyticPack azimuthal_only(4, 2, true, false);
    CHECK(prepare(p, azimuthal_only.view, lacking) == FurStatus::no_longitudinal_table);
    p.eta = 1;
    CHECK(prepare(p, pack().view, lacking) == FurStatus::bad_eta);
    CHECK(total(near_lobes(lacking, 0.3f, -0.3f, 0.1f, 0.1f)) == 0);
}

TEST_CASE("any number of channels: each is what one channel gives alone", "[bcsdf]") {
    constexpr FurParameters<7> seven = parameters_of<7>(*find_preset("deer"));
    static_assert(seven.kappa == 0.91f && seven.sigma_ca[6] == 1.39f, "presets are constants");
    FurParameters<7> p = seven;
    for (int c = 0; c < 7; ++c) p.sigma_ca[c] = 0.3f * float(c * c);
    FurFibre<7> all;
    REQUIRE(prepare(p, pack().view, all) == FurStatus::ok);
    for (int c = 0; c < 7; ++c) {
        FurParameters<1> q = parameters_of<1>(*find_preset("deer"));
        q.sigma_ca[0] = p.sigma_ca[c];
        FurFibre<1> one;
        REQUIRE(prepare(q, pack().view, one) == FurStatus::ok);
        for (float phi : {0.2f, 2.9f}) {
            CHECK(eval(all, 0.4f, -0.3f, phi, 0.1f).value[c] == eval(one, 0.4f, -0.3f, phi, 0.1f).value[0]);
            // The far field skips scattered nodes by the brightest channel's energy.
            CHECK(eval(all, 0.4f, -0.3f, phi, OffsetRange{}).value[c] ==
                  Approx(eval(one, 0.4f, -0.3f, phi, OffsetRange{}).value[0]).epsilon(1e-6));
        }
    }
}

TEST_CASE("lobes integrate to their energies, and energies to at most 1", "[bcsdf]") {
    std::mt19937 random(2);
    std::uniform_real_distribution<float> u(0, 1);
    for (int i = 0; i < 60; ++i) {
        FurParameters<3> p = parameters_of<3>(fur_presets[i % fur_preset_count]);
        p.beta_m = 0.05f + u(random), p.beta_n = 0.05f + 0.9f * u(random), p.g = 0.5f * u(random);
        if (i % 2) p.sigma_ma = p.sigma_ca[0] = p.sigma_ca[1] = p.sigma_ca[2] = 0;  // white
        if (i % 5 == 0) p.kappa = 1;
        const float theta_i = i % 4 ? 3.0f * (u(random) - 0.5f) : 1.5706f, h = i % 7 ? 2 * u(random) - 1 : 1.0f;
        FurFibre<3> fibre;
        REQUIRE(prepare(p, pack().view, fibre) == FurStatus::ok);
        NearField<3> near;
        near_field(fibre, theta_i, h, near);
        constexpr int n = 256;
        double M[lobe_count] = {}, N[lobe_count] = {};
        for (int a = 0; a < n; ++a) {
            const double phi = pi * (2 * a + 1) / n - pi;
            const auto l = near.lobes(0.0f, float(phi));
            for (int k = 0; k < lobe_count; ++k) N[k] += double(l.N[k][0]) * 2 * pi / n;
        }
        constexpr int m = 4000;
        for (int a = 0; a < m; ++a) {
            const auto l = near.lobes(float(pi * (a + 0.5) / m - pi / 2), 0.7f);
            for (int k = 0; k < lobe_count; ++k) M[k] += double(l.M[k]) * pi / m;
        }
        double sum = 0;
        for (int k = 0; k < lobe_count; ++k) {
            // Trapezia are exact to float for wrapped Gaussians of >= 0.05 at 0.025; float sums and angles leave 1e-4.
            if (k < 3 || near.scattered) CHECK(N[k] == Approx(double(near.energy.A[k][0])).epsilon(2e-4).margin(1e-7));
            if (k < 3 || near.scattered) CHECK(M[k] == Approx(1).epsilon(2e-3));  // midpoints on a cut edge: step / b
            sum += double(near.energy.A[k][0]);
        }
        CHECK(sum <= 1 + 3e-7);  // five float roundings
        if (i % 2) {
            // White: F + (1 - F)(1 - F^2 x^2), x = exp(-2 s_m sigma_ms / cos theta_t); exact to float.
            const double F = double(near.energy.A[0][0]), T = 1 - F;
            const double x = T > 1e-3 && near.energy.A[1][0] > 0 ? double(near.energy.A[1][0]) / (T * T) : 0;
            if (T > 1e-3) CHECK(sum == Approx(F + T * (1 - F * F * x * x)).epsilon(2e-6));
        }
    }
}

TEST_CASE("near field is finite and non-negative at the ends of every range", "[bcsdf]") {
    const float etas[] = {1.0001f, 1.5f, 2.5f}, kappas[] = {0, 1e-6f, 0.5f, 1}, layers[] = {0, 1e-3f, 1, 5};
    const float betas[] = {0.00174533f, 0.2f, 1.04719755f}, sigmas[] = {0, 1e-30f, 2, 1e9f};
    const float thetas[] = {0, 1e-30f, 0.5f, -1.2f, 1.5706218f, -1.5707962f, 1.57079637f};
    const float hs[] = {0, 1e-20f, -0.5f, 0.99999994f, 1, -1};
    int count = 0;
    for (float eta : etas)
        for (float kappa : kappas)
            for (float l : layers)
                for (float beta : betas)
                    for (float sigma : sigmas) {
                        FurParameters<3> p;
                        p.eta = eta, p.kappa = kappa, p.layers = l, p.beta_m = p.beta_n = beta, p.sigma_ms = sigma,
                        p.g = 0.4f, p.alpha = 0.1f;
                        p.sigma_ca[0] = sigma;
                        FurFibre<3> fibre;
                        REQUIRE(prepare(p, pack().view, fibre) == FurStatus::ok);
                        for (float theta_i : thetas)
                            for (float h : hs) {
                                NearField<3> near;
                                near_field(fibre, theta_i, h, near);
                                for (float theta_r : {-theta_i, 0.3f, 1.5707962f})
                                    for (float phi : {0.0f, 3.14159265f, -2.0f, 700.0f}) {
                                        const auto value = near.eval(theta_r, phi);
                                        for (float v : value.value)
                                            if (!(v >= 0 && v <= 3.4e38f))
                                                FAIL("theta_i " << theta_i << " h " << h << " eta " << eta << " value "
                                                                << v);
                                        ++count;
                                    }
                            }
                    }
    CHECK(count > 200000);
}

TEST_CASE("each parameter's limit is where it goes to", "[bcsdf]") {
    // Next to its limit, a fibre differs from the fibre at the limit by what the parameter's own size says.
    const auto value = [](const FurParameters<3>& p, float theta_i, float h) {
        FurFibre<3> fibre;
        REQUIRE(prepare(p, pack().view, fibre) == FurStatus::ok);
        return total(near_lobes(fibre, theta_i, -theta_i + 0.1f, 2.5f, h));
    };
    FurParameters<3> fur = parameters_of<3>(*find_preset("bobcat"));
    for (float theta_i : {0.0f, 0.6f, 1.4f})
        for (float h : {-0.6f, 0.2f}) {
            const auto close = [&](auto&& set, float near, float at, double tolerance) {
                FurParameters<3> a = fur, b = fur;
                set(a, near), set(b, at);
                CHECK(value(a, theta_i, h) == Approx(value(b, theta_i, h)).epsilon(tolerance).margin(tolerance));
            };
            // Up to 1 / cos theta_t = 1.25, chords of 4 and a factor of 10 from one lobe to their sum: 50 times the
            // step.
            close([](FurParameters<3>& p, float x) { p.sigma_ms = x; }, 1e-6f, 0, 5e-5);
            close([](FurParameters<3>& p, float x) { p.sigma_ma = x; }, 1e-6f, 0, 5e-5);
            close([](FurParameters<3>& p, float x) { p.sigma_ca[0] = x; }, 1e-6f, 0, 5e-5);
            close([](FurParameters<3>& p, float x) { p.layers = x; }, 1e-6f, 0, 5e-5);
            close([](FurParameters<3>& p, float x) { p.g = x; }, 1e-6f, 0, 5e-5);
            close([](FurParameters<3>& p, float x) { p.kappa = x; }, 0.999999f, 1, 5e-3);  // s_m ~ a square root
            if (h < 0 || theta_i > 0) continue;
            // A medulla that ends before h / eta' is no longer seen at all; at h = 0, its chord is 2 kappa.
            FurParameters<3> a = fur, b = fur;
            a.kappa = 1e-6f, b.kappa = 0;
            CHECK(value(a, theta_i, 0) == Approx(value(b, theta_i, 0)).epsilon(5e-5).margin(5e-5));
        }
}

TEST_CASE("near field is continuous across its seams", "[bcsdf]") {
    FurParameters<3> p = parameters_of<3>(*find_preset("cat"));
    p.beta_n = 0.2f;
    FurFibre<3> fibre;
    REQUIRE(prepare(p, pack().view, fibre) == FurStatus::ok);
    const Inclination<float> at = inclination(p.eta, std::cos(0.6f));
    const float rim = p.kappa / at.inverse_index;
    if (rim < 1) {  // the medulla's rim: s_m ~ sqrt(2 kappa d), a jump would not shrink with d
        const auto a = near_lobes(fibre, 0.6f, -0.5f, 2.5f, rim - 1e-6f),
                   b = near_lobes(fibre, 0.6f, -0.5f, 2.5f, rim + 1e-6f);
        CHECK(total(a) == Approx(total(b)).epsilon(0.02));  // 2 sigma sqrt(2 * 0.87 * 1e-6 / eta'): 0.7 %
    }
    // Centre leaving the hemisphere (truncation), wide Gaussian's switch to harmonics, phi through +-pi, h through 0.
    const auto close = [&](const FurParameters<3>& q1, const FurParameters<3>& q2, float t1, float t2, float phi1,
                           float phi2, float h1, float h2) {
        FurFibre<3> f1, f2;
        prepare(q1, pack().view, f1), prepare(q2, pack().view, f2);
        CHECK(total(near_lobes(f1, t1, -0.5f, phi1, h1)) ==
              Approx(total(near_lobes(f2, t2, -0.5f, phi2, h2))).epsilon(2e-4));
    };
    close(p, p, 0.6f, 0.6f, 3.14159f, -3.14159f, 0.3f, 0.3f);
    close(p, p, 0.6f, 0.6f, 2.0f, 2.0f, -1e-7f, 1e-7f);
    close(p, p, 1e-7f, -1e-7f, 2.0f, 2.0f, 0.3f, 0.3f);
    FurParameters<3> wide = p, wider = p;
    wide.beta_n = 1.19999f, wider.beta_n = 1.20001f;
    close(wide, wider, 0.6f, 0.6f, 2.0f, 2.0f, 0.3f, 0.3f);
    wide.beta_n = 0.249999f, wider.beta_n = 0.250001f;
    close(wide, wider, 0.6f, 0.6f, 2.0f, 2.0f, 0.3f, 0.3f);
}
