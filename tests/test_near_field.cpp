// The near field against the reference implementation in double, its energies, its limits and its ends of every range.
#include <algorithm>
#include <catch2/catch.hpp>
#include <random>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fibre_of.hpp"
#include "tests/support/fur_reference.hpp"

using namespace medulla;
using analytic::pack;
using test::FibreOf;

namespace {

TableRanges wide_ranges(Scattering form) { return {0, 0.79f, 0, 16, 0, 0, form_bit(form)}; }

/// Tables that cover every fibre of these tests.
const test::OwnedTables& wide_tables(Scattering form = Scattering::published) {
    static const test::OwnedTables tables[] = {{pack().view, wide_ranges(Scattering::published)},
                                               {pack().view, wide_ranges(Scattering::corrected)}};
    return tables[form == Scattering::corrected];
}

double total(const LobeValues<3>& l) {
    double sum = 0;
    for (float x : angular_density(l).value) sum += double(x);
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

TEST_CASE("near field equals the reference implementation in double, lobe by lobe", "[bcsdf]") {
    const reference::DenseReader read[] = {
        {pack().view, wide_ranges(Scattering::published), *wide_tables(Scattering::published)},
        {pack().view, wide_ranges(Scattering::corrected), *wide_tables(Scattering::corrected)}};
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
        p.scattering = i / 2 % 2 == 0 ? Scattering::published : Scattering::corrected;
        const float theta_i = 1.55f * (2 * u(random) - 1), h = 2 * u(random) - 1, phi = 6.28f * (u(random) - 0.5f);
        const float theta_r =
            std::max(-1.57f, std::min(1.57f, i % 2 ? 3.1f * (u(random) - 0.5f) : -theta_i + 0.1f * (u(random) - 0.5f)));
        const NearField<3> near = near_field(make_fibre(p, wide_tables(p.scattering).get()), Angles{theta_i, 0}, h);
        const LobeValues<3> l = near.lobes(theta_r, phi);
        const auto r = reference::near_lobes(p, &read[p.scattering == Scattering::corrected], double(theta_i),
                                             double(theta_r), double(phi), double(h));
        for (int k = 0; k < all_lobe_count; ++k) {
            // Float rounding of an angle of size 2 pi is 5e-7; over a deviation b it moves a Gaussian's exponent by
            // z * 5e-7 / b with z <= sqrt(2 * 30) where the lobe is worth comparing: 8e-6 / b, two such Gaussians.
            const double tolerance = 4e-5 + 1.6e-5 / double(std::min(p.beta_m / 2, p.beta_n));
            // The corrected M^s goes to 0 at grazing exits, by a slope of up to 1e-2 there, times theta_r's 5e-7.
            CHECK(double(l.M[k]) == Approx(r.M[k]).epsilon(tolerance).margin(k == 3 || k == 4 ? 5e-9 : 1e-10));
            // A scattered lobe is a signed sum of components of up to 1/pi: 5 in all, times float's 6e-8, and the
            // angle's 5e-7 times the slope of the highest harmonics.
            for (int c = 0; c < 3; ++c)
                CHECK(double(l.N[k][c]) == Approx(r.N[k][c]).epsilon(tolerance).margin(k == 3 || k == 4 ? 1e-6 : 1e-7));
            compared += r.M[k] > 0 && r.N[k][0] > 0;
        }
    }
    CHECK(compared > 14000);
}

TEST_CASE("value is the sum of lobes per steradian, and eq12 that of the paper's five over cos^2 theta_i", "[bcsdf]") {
    FurParameters<3> p = parameters_of<3>(*find_preset("bobcat"));
    p.sigma_ca[1] *= 2, p.sigma_ca[2] *= 0.1f;
    const FibreOf fibre(p, pack().view);
    std::mt19937 random(5);
    std::uniform_real_distribution<float> u(-1, 1);
    for (int i = 0; i < 500; ++i) {
        const Angles known = {1.5f * u(random), 3 * u(random)};
        const float theta_r = 1.5f * u(random), phi = 3 * u(random);
        const NearField<3> near = near_field(fibre, known, u(random));
        const LobeValues<3> l = near.lobes(theta_r, phi);
        const Colour<3> value = near.value(Angles{theta_r, known.phi + phi}), eq12 = near.eq12(theta_r, phi);
        for (int c = 0; c < 3; ++c) {
            double five = 0;
            for (int k = 0; k < lobe_count; ++k) five += double(l.M[k]) * double(l.N[k][c]);
            const double all = five + double(l.M[5]) * double(l.N[5][c]);
            // An angle's rounding over the narrowest lobe, as against the reference.
            CHECK(double(value[c]) == Approx(all / std::cos(double(theta_r))).epsilon(4e-4).margin(1e-9));
            CHECK(double(eq12[c]) == Approx(five / std::pow(std::cos(double(known.theta)), 2)).epsilon(1e-5));
        }
    }
}

TEST_CASE("kappa = 0 is exactly the hair model and reads no table", "[bcsdf]") {
    FurParameters<3> p = parameters_of<3>(*find_preset("human"));
    p.kappa = 0;
    const Fibre<3> hair = make_fibre(p, wide_tables().get()), without = make_fibre(p, nullptr);
    CHECK(hair.status == FibreStatus::ok);
    CHECK(without.status == FibreStatus::ok);
    for (float h : {-1.0f, -0.7f, 0.0f, 0.3f, 1.0f}) {
        const auto a = near_field(hair, Angles{0.3f, 0}, h).lobes(-0.31f, 2.9f),
                   b = near_field(without, Angles{0.3f, 0}, h).lobes(-0.31f, 2.9f);
        for (int k = 0; k < all_lobe_count; ++k) {
            CHECK(a.M[k] == b.M[k]);
            CHECK(a.N[k][0] == b.N[k][0]);
        }
        CHECK(a.N[3][0] == 0);
        CHECK(a.N[4][0] == 0);
    }
}

TEST_CASE("any number of channels: each is what one channel gives alone", "[bcsdf]") {
    constexpr FurParameters<7> seven = parameters_of<7>(*find_preset("deer"));
    static_assert(seven.kappa == 0.91f && seven.sigma_ca[6] == 1.39f, "presets are constants");
    FurParameters<7> p = seven;
    for (int c = 0; c < 7; ++c) p.sigma_ca[c] = 0.3f * float(c * c);
    const Fibre<7> all = make_fibre(p, wide_tables().get());
    for (int c = 0; c < 7; ++c) {
        FurParameters<1> q = parameters_of<1>(*find_preset("deer"));
        q.sigma_ca[0] = p.sigma_ca[c];
        const Fibre<1> one = make_fibre(q, wide_tables().get());
        const Angles known = {0.4f, 0};
        for (float phi : {0.2f, 2.9f}) {
            const Angles drawn = {-0.3f, phi};
            CHECK(near_field(all, known, 0.1f).value(drawn)[c] == near_field(one, known, 0.1f).value(drawn)[0]);
            CHECK(far_field(all, known).value(drawn)[c] == Approx(far_field(one, known).value(drawn)[0]).epsilon(1e-6));
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
        const FibreOf fibre(p, pack().view);
        const NearField<3> near = near_field(fibre, Angles{theta_i, 0}, h);
        constexpr int n = 256;
        double M[all_lobe_count] = {}, N[all_lobe_count] = {};
        for (int a = 0; a < n; ++a) {
            const auto l = near.lobes(0.0f, float(pi * (2 * a + 1) / n - pi));
            for (int k = 0; k < all_lobe_count; ++k) N[k] += double(l.N[k][0]) * 2 * pi / n;
        }
        constexpr int m = 4000;
        for (int a = 0; a < m; ++a) {
            const auto l = near.lobes(float(pi * (a + 0.5) / m - pi / 2), 0.7f);
            for (int k = 0; k < all_lobe_count; ++k) M[k] += double(l.M[k]) * pi / m;
        }
        double sum = 0;
        for (int k = 0; k < all_lobe_count; ++k) {
            sum += double(near.A[k][0]);
            if ((k == 3 || k == 4) && near.tables == nullptr) continue;
            // Trapezia are exact to float for wrapped Gaussians of >= 0.05 at 0.025; float sums and angles leave 1e-4.
            CHECK(N[k] == Approx(double(near.A[k][0])).epsilon(2e-4).margin(1e-7));
            CHECK(M[k] == Approx(1).epsilon(2e-3));  // midpoints on a cut edge: step / b
        }
        CHECK(sum <= 1 + 3.6e-7);  // six float roundings
        CHECK(sum == Approx(double(near.albedo()[0])).epsilon(4e-7));
        if (i % 2) CHECK(sum == Approx(1).epsilon(2e-6));
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
                        const Fibre<3> fibre = make_fibre(p, wide_tables().get());
                        for (float theta_i : thetas)
                            for (float h : hs) {
                                const NearField<3> near = near_field(fibre, Angles{theta_i, 0}, h);
                                for (float theta_r : {-theta_i, 0.3f, 1.5707962f})
                                    for (float phi : {0.0f, 3.14159265f, -2.0f, 700.0f}) {
                                        const Evaluation<3> e = near.evaluate(Angles{theta_r, phi});
                                        for (float v : {e.value[0], e.value[1], e.value[2], e.pdf})
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
        return total(
            near_field(make_fibre(p, wide_tables().get()), Angles{theta_i, 0}, h).lobes(-theta_i + 0.1f, 2.5f));
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
    const auto value = [](const FurParameters<3>& q, float theta_i, float phi, float h) {
        return total(near_field(make_fibre(q, wide_tables().get()), Angles{theta_i, 0}, h).lobes(-0.5f, phi));
    };
    // The medulla's rim, which a thin one has within the fibre: a jump would not shrink with the distance d.
    FurParameters<3> thin = p;
    thin.kappa = 0.5f;
    const auto at = detail::inclination(thin.eta, std::cos(0.6f));
    const float rim = thin.kappa / at.inverse_index;
    REQUIRE(rim < 1);
    for (float d : {1e-3f, 1e-4f, 1e-6f})
        for (float side : {1.0f, -1.0f}) {
            const Fibre<3> fibre = make_fibre(thin, wide_tables().get());
            const NearField<3> in = near_field(fibre, Angles{0.6f, 0}, side * (rim - d)),
                               out = near_field(fibre, Angles{0.6f, 0}, side * (rim + d));
            // Two chords through the medulla: 4 s_m (sigma_ms + sigma_ma) / cos theta_t, s_m = sqrt(2 kappa d / eta');
            // in the cortex, 4 s_m sigma_ca the other way, and F' d of the cuticle, some 2 d.
            const float s_m = std::sqrt(2 * thin.kappa * d * at.inverse_index);
            const double bound = double(4 * s_m * (thin.sigma_ms + thin.sigma_ma) * at.inverse_cos_t + 2 * d);
            for (int k = 0; k < all_lobe_count; ++k) CHECK(std::abs(double(in.A[k][0]) - double(out.A[k][0])) < bound);
            CHECK(in.A[3][0] > 0);  // the one is inside, the other is not
            CHECK(out.A[3][0] == 0);
            // At TT's brightest, of 1 / beta_n over the beams' shift 2 d / beta_n.
            CHECK(double(value(thin, 0.6f, in.centre[1], side * (rim - d))) ==
                  Approx(double(value(thin, 0.6f, in.centre[1], side * (rim + d)))).epsilon(bound + 20 * double(d)));
        }
    // phi through +-pi, h through 0, wide Gaussian's switch to harmonics.
    const auto close = [&](const FurParameters<3>& q1, const FurParameters<3>& q2, float t1, float t2, float phi1,
                           float phi2, float h1, float h2) {
        CHECK(value(q1, t1, phi1, h1) == Approx(value(q2, t2, phi2, h2)).epsilon(2e-4));
    };
    close(p, p, 0.6f, 0.6f, 3.14159f, -3.14159f, 0.3f, 0.3f);
    close(p, p, 0.6f, 0.6f, 2.0f, 2.0f, -1e-7f, 1e-7f);
    close(p, p, 1e-7f, -1e-7f, 2.0f, 2.0f, 0.3f, 0.3f);
    for (float seam : {1.2f, 0.25f})
        for (int lobe = 1; lobe <= 3; ++lobe) {  // R, TT and TRT cross at beta_n sqrt(lobe)
            FurParameters<3> below = p, above = p;
            below.beta_n = (seam - 1e-6f) / std::sqrt(float(lobe));
            above.beta_n = (seam + 1e-6f) / std::sqrt(float(lobe));
            close(below, above, 0.6f, 0.6f, 2.0f, 2.0f, 0.3f, 0.3f);
        }
}

TEST_CASE("R of tilted scales leaves towards the root, whichever way the fibre is turned", "[bcsdf]") {
    // Scales rise towards the tip by alpha, and their faces look at the root: light from straight aside leaves alpha
    // below it (Table 2: alpha_R = alpha, in an axis from tip to root).
    const float alpha = float(5 * pi / 180);
    FurParameters<1> p;
    p.alpha = alpha, p.beta_m = 0.02f;
    const Fibre<1> fibre = make_fibre(p, nullptr);
    const NearField<1> hit = near_field(fibre, Vector{0, 1, 0}, 0.0f).keep(lobe_bit(Lobe::R));
    // The lobe's mean x: R leaves at -sin(alpha), TT's and TRT's shifts have the other sign.
    double mean = 0, all = 0;
    for (int i = 0; i < 2000; ++i) {
        const float x = float((i + 0.5) / 1000 - 1);
        const double value = double(hit.value(Vector{x, std::sqrt(1 - x * x), 0})[0]);
        mean += double(x) * value, all += value;
    }
    CHECK(mean / all == Approx(-std::sin(double(alpha))).epsilon(0.01));  // beta_m^2 / 2 of curvature: 2e-4, and steps
    RandomNumbers u;
    u.azimuth = u.longitude = 0.5f;
    const Sample<1> s = hit.sample(u);
    REQUIRE(s.valid);
    CHECK(s.direction.x == Approx(-std::sin(alpha)).margin(1e-5));
    CHECK(s.angles.theta == Approx(alpha).margin(1e-5));
    const NearField<1> through = near_field(fibre, Vector{0, 1, 0}, 0.0f).keep(lobe_bit(Lobe::TT));
    CHECK(through.sample(u).direction.x == Approx(std::sin(alpha / 2)).margin(1e-5));
}

TEST_CASE("kept lobes add up to the whole, and their pdf is their own", "[bcsdf]") {
    FurParameters<3> p = parameters_of<3>(*find_preset("bobcat"));
    p.sigma_ca[1] *= 2, p.sigma_ca[2] *= 0.1f;
    const FibreOf fibre(p, pack().view);
    std::mt19937 random(6);
    std::uniform_real_distribution<float> u(-1, 1);
    for (int i = 0; i < 200; ++i) {
        const Angles known = {1.4f * u(random), 0.5f}, drawn = {1.4f * u(random), 3 * u(random)};
        const NearField<3> near = near_field(fibre, known, u(random));
        const FarField<3> far = far_field(fibre, known);
        const auto check = [&](const auto& whole) {
            double sum[3] = {};
            for (int k = 0; k < all_lobe_count; ++k) {
                const auto one = whole.keep(lobe_bit(static_cast<Lobe>(k)));
                const auto e = one.evaluate(drawn);
                for (int c = 0; c < 3; ++c) sum[c] += double(e.value[c]);
                RandomNumbers numbers;
                numbers.lobe = numbers.azimuth = numbers.longitude = numbers.rows = numbers.offset = 0.4f;
                const auto s = one.sample(numbers);
                if (s.valid) CHECK(s.lobe == static_cast<Lobe>(k));
                CHECK(whole.keep(0).value(drawn)[0] == 0);
                CHECK_FALSE(whole.keep(0).sample(numbers).valid);
            }
            const auto value = whole.value(drawn);
            for (int c = 0; c < 3; ++c) CHECK(sum[c] == Approx(double(value[c])).epsilon(2e-6));
        };
        check(near);
        if (i % 10 == 0) check(far);
        const NearField<3> two = near.keep(lobe_bit(Lobe::R) | lobe_bit(Lobe::TTs));
        for (int c = 0; c < 3; ++c)
            CHECK(double(two.albedo()[c]) == Approx(double(near.A[0][c]) + double(near.A[3][c])).epsilon(1e-6));
    }
}

TEST_CASE("of a grey fibre value is pdf times albedo", "[bcsdf]") {
    const FibreOf fibre(parameters_of<3>(*find_preset("bobcat")), pack().view);
    std::mt19937 random(7);
    std::uniform_real_distribution<float> u(-1, 1);
    for (int i = 0; i < 500; ++i) {
        const NearField<3> near = near_field(fibre, Angles{1.5f * u(random), 0}, u(random));
        const Evaluation<3> e = near.evaluate(Angles{1.5f * u(random), 3 * u(random)});
        // A dozen roundings.
        CHECK(double(e.value[1]) == Approx(double(e.pdf) * double(near.albedo()[1])).epsilon(1e-6));
    }
}
