// Unfolded tables against the factors they were multiplied out from: the fast path and its slow twin.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"

using namespace medulla;

namespace {

const PackView& default_view() {
    static const PackView view = open_pack(default_pack_words, default_pack_size).pack;
    return view;
}

struct Query {
    float theta_i, theta_r, phi, h;
};

Query random_query(std::mt19937& random) {
    std::uniform_real_distribution<float> u(0, 1);
    const float theta_i = 3.1415f * (u(random) - 0.5f), around = 1.2f * (u(random) - 0.5f) - theta_i;
    return {theta_i, std::max(-1.5707f, std::min(1.5707f, around)), 12.5f * (u(random) - 0.5f), 2 * u(random) - 1};
}

}  // namespace

TEST_CASE("unfolded tables say what the factors say, near and far", "[bcsdf]") {
    std::mt19937 random(11);
    const auto tables = std::make_unique<UnfoldedTables>();
    for (const FurPreset& preset : fur_presets) {
        FurFibre<3> slow;
        REQUIRE(prepare(parameters_of<3>(preset), default_view(), slow) == FurStatus::ok);
        FurFibre<3> fast = slow;
        REQUIRE(unfold(fast, *tables));
        REQUIRE(fast.tables == tables.get());
        double error[3] = {}, norm[3] = {};
        const auto add = [&](int i, float a, float b) {
            error[i] += std::pow(double(a) - double(b), 2), norm[i] += std::pow(double(b), 2);
        };
        for (int i = 0; i < 1500; ++i) {
            const Query q = random_query(random);
            const auto a = near_lobes(fast, q.theta_i, q.theta_r, q.phi, q.h),
                       b = near_lobes(slow, q.theta_i, q.theta_r, q.phi, q.h);
            for (int k = 0; k < 3; ++k) CHECK((a.M[k] == b.M[k] && a.N[k][0] == b.N[k][0]));  // the same code
            add(0, a.M[3], b.M[3]);
            for (int k = 3; k < 5; ++k) add(1, a.N[k][0], b.N[k][0]);
            if (i % 50) continue;
            FarField<3> far_fast, far_slow;
            far_field(fast, q.theta_i, OffsetRange{}, far_fast), far_field(slow, q.theta_i, OffsetRange{}, far_slow);
            const auto c = far_fast.lobes(q.theta_r, q.phi), d = far_slow.lobes(q.theta_r, q.phi);
            for (int k = 3; k < 5; ++k) add(2, c.N[k][0], d.N[k][0]);
        }
        // A twentieth of the pack's own error (2e-3, docs/accuracy.md), of which it then makes 0.13 % more.
        for (int i = 0; i < 3; ++i) CHECK(std::sqrt(error[i] / norm[i]) < 1e-4);
    }
}

TEST_CASE("unfolded lobes read eight abreast are those read four abreast", "[bcsdf]") {
    std::mt19937 random(16);
    std::uniform_real_distribution<float> u(0, 1);
    const auto tables = std::make_unique<UnfoldedTables>();
    for (const FurPreset& preset : fur_presets) {
        FurFibre<3> fibre;
        REQUIRE(prepare(parameters_of<3>(preset), default_view(), fibre) == FurStatus::ok);
        REQUIRE(unfold(fibre, *tables));
        const float sigma = fibre.parameters.sigma_ms * fibre.parameters.kappa;
        const float ends[4] = {0.0f, float(pi), -float(pi), 1e-7f};
        for (int i = 0; i < 2000; ++i) {
            const Query q = random_query(random);
            const float h = i < 4 ? 0.0f : (i < 8 ? 1.0f : std::abs(q.h)), y0 = i < 8 ? ends[i % 4] : q.phi,
                        y1 = 12.5f * (u(random) - 0.5f), theta_r = i < 8 ? ends[i % 4] / 2 : q.theta_r;
            const AzimuthalPoint around = tables->azimuthal_at(tables->sigma_at(sigma * (1 + 0.2f * u(random))), h);
            const LongitudinalPoint along = tables->longitudinal_at(std::abs(q.theta_i));
            const ScatteredDensities a = scattered_densities(*tables, around, along, y0, y1, theta_r, q.phi);
            const TwoDensities b = tables->azimuthal_densities(around, y0, y1),
                               c = azimuthal_densities(*tables, around.sigma, h, y0, y1);
            const float M =
                blend_sides(tables->longitudinal_density(along, theta_r), std::abs(wrap_angle(q.phi)) * float(1 / pi));
            // Weights of sigma, h and the exit, each to three roundings of 6e-8; C^M falls to 0 at its ends.
            CHECK(double(a.D[0]) == Approx(double(b.TTs)).epsilon(6e-7));
            CHECK(double(a.D[1]) == Approx(double(b.TRTs)).epsilon(6e-7));
            CHECK(double(a.M) == Approx(double(M)).epsilon(6e-7).margin(2e-7));
            CHECK(double(c.TTs) == Approx(double(b.TTs)).epsilon(6e-7));
            CHECK(double(c.TRTs) == Approx(double(b.TRTs)).epsilon(6e-7));
        }
    }
}

TEST_CASE("holding an unfolded lobe at 0 hides no NaN", "[bcsdf]") {
    const auto tables = std::make_unique<UnfoldedTables>();
    FurFibre<3> fibre;
    REQUIRE(prepare(parameters_of<3>(*find_preset("cat")), default_view(), fibre) == FurStatus::ok);
    REQUIRE(unfold(fibre, *tables));
    const float nan = std::numeric_limits<float>::quiet_NaN();
    NearField<3> near;
    near_field(fibre, 0.3f, 0.4f, near);
    AzimuthalPoint azimuthal = near.point;
    CHECK(tables->azimuthal_density(azimuthal, 0.5f) > 0);
    azimuthal.sigma = Four(nan);
    CHECK(std::isnan(tables->azimuthal_density(azimuthal, 0.5f)));
    LongitudinalPoint longitudinal = tables->longitudinal_at(0.3f);
    CHECK(tables->longitudinal_density(longitudinal, 0.2f).back > 0);
    longitudinal.weight = Four(nan);
    CHECK(std::isnan(tables->longitudinal_density(longitudinal, 0.2f).back));
    CHECK(std::isnan(tables->longitudinal_density(longitudinal, 0.2f).forward));
    // Through every door: one exit, a batch of exits, a batch of queries.
    for (float* table : {tables->azimuthal, tables->longitudinal}) {
        const std::size_t size =
            table == tables->azimuthal ? std::size(tables->azimuthal) : std::size(tables->longitudinal);
        const std::vector<float> kept(table, table + size);
        std::fill(table, table + size, nan);
        float theta_i[16], h[16], theta_r[16], phi[16];
        for (int i = 0; i < 16; ++i) theta_i[i] = 0.3f, h[i] = 0.4f, theta_r[i] = -0.2f, phi[i] = 0.4f * float(i) - 3;
        Colour<3> S[16];
        CHECK(std::isnan(near.eval(theta_r[0], phi[0]).value[0]));
        eval(near, 16, theta_r, phi, S);
        for (const Colour<3>& at : S) CHECK(std::isnan(at.value[0]));
        eval(fibre, 16, theta_i, h, theta_r, phi, S);
        for (const Colour<3>& at : S) CHECK(std::isnan(at.value[0]));
        std::copy(kept.begin(), kept.end(), table);
    }
}

TEST_CASE("unfolded lobes integrate to their energies, to the ends of every range", "[bcsdf]") {
    const auto tables = std::make_unique<UnfoldedTables>();
    FurFibre<3> fibre;
    REQUIRE(prepare(parameters_of<3>(*find_preset("cat")), default_view(), fibre) == FurStatus::ok);
    REQUIRE(unfold(fibre, *tables));
    for (float theta_i : {0.0f, 1e-30f, -0.8f, 1.5f, -1.5707962f})
        for (float h : {0.0f, 1e-20f, -0.4f, 0.99999994f, 1.0f, -1.0f}) {
            NearField<3> near;
            near_field(fibre, theta_i, h, near);
            constexpr int n = 1440;  // even steps: exact where the lobe is wide, 1e-3 where its peak has 0.5 degrees
            double N[2] = {}, M = 0;
            for (int i = 0; i < n; ++i) {
                const auto l = near.lobes(float(pi * (i + 0.5) / n - pi / 2), float(2 * pi * (i + 0.5) / n - pi));
                for (int k = 0; k < 2; ++k) N[k] += double(l.N[3 + k][0]) * 2 * pi / n;
                CHECK(l.M[3] >= 0);
            }
            for (int i = 0; i < n; ++i) M += double(near.lobes(float(pi * (i + 0.5) / n - pi / 2), 1.0f).M[3]) * pi / n;
            if (!near.scattered) continue;
            for (int k = 0; k < 2; ++k)
                CHECK(N[k] == Approx(double(near.energy.A[3 + k][0])).epsilon(3e-3).margin(1e-7));
            CHECK(M ==
                  Approx(1).epsilon(1e-2));  // a signed lobe held to 0 has more, by what dips below (docs/bcsdf.md)
        }
}

namespace {

/// Integrals over theta_r of C^M back and forward as they are read: two Gauss nodes on each sixteenth of a span are
/// exact for a cubic, and where one is cut at 0 err by the slope there times 1e-7.
std::array<double, 2> side_integrals(const UnfoldedTables& tables, const AxisView<float>& theta_r, float theta_i) {
    const LongitudinalPoint point = tables.longitudinal_at(theta_i);
    std::array<double, 2> sum = {};
    constexpr int parts = 16;
    for (std::int32_t i = 0; i < std::int32_t(theta_r.spans); ++i)
        for (int k = 0; k < 2 * parts; ++k) {
            const double a = double(theta_r.breakpoint(i)), width = (double(theta_r.breakpoint(i + 1)) - a) / parts;
            const double y = a + width * (k / 2 + 0.5 + (k % 2 ? 0.5 : -0.5) * 0.57735026918962576);
            for (double side : {-1.0, 1.0}) {
                const BackForward at = tables.longitudinal_density(point, float(side * y));
                sum[0] += double(at.back) * width / 2, sum[1] += double(at.forward) * width / 2;
            }
        }
    return sum;
}

}  // namespace

TEST_CASE("C^M integrates to 1 as it is read, dips held at 0 and all", "[bcsdf]") {
    const auto tables = std::make_unique<UnfoldedTables>();
    std::mt19937 random(14);
    std::uniform_real_distribution<float> u(0, 1);
    double at_nodes = 0, between = 0, factors_off = 0, signed_over = 0;
    for (const FurPreset& preset : fur_presets) {
        FurFibre<3> fibre;
        REQUIRE(prepare(parameters_of<3>(preset), default_view(), fibre) == FurStatus::ok);
        Longitudinal<3> m;
        FurFibre<3> factors = fibre;
        REQUIRE(unfold(fibre, *tables));
        const AxisView<float> theta_r = fibre.back.view.axis(fibre.back.view.parameter_axes()),
                              theta = fibre.back.view.axis(fibre.back.last_axis);
        for (std::uint32_t j = 0; j <= theta.spans; ++j) {
            const float x = from_spline_coordinate(Quantity::theta_i, theta.breakpoint(std::int32_t(j)));
            for (double sum : side_integrals(*tables, theta_r, x)) at_nodes = std::max(at_nodes, std::abs(sum - 1));
        }
        for (int i = 0; i < 200; ++i) {
            const float x = i % 4 ? 1.5707963f * u(random) : 1.5707963f - 0.1f * u(random);
            for (double sum : side_integrals(*tables, theta_r, x)) between = std::max(between, std::abs(sum - 1));
            for (const bool exact : {true, false}) {
                factors.exact_energy = exact;
                longitudinal_at(factors, x, m);
                if (!m.valid) continue;
                double& off = exact ? factors_off : signed_over;
                off = std::max(off, std::abs(double(clamped_integral(factors.back.view, m.back)) - 1));
                off = std::max(off, std::abs(double(clamped_integral(factors.forward.view, m.forward)) - 1));
            }
        }
    }
    std::printf("C^M as it is read: unfolded %.1e off 1 at the nodes, %.1e between; factors %.1e, signed %.1e\n",
                at_nodes, between, factors_off, signed_over);
    // Weights are cubics in power form, whose coefficients of up to 10 are rounded to 6e-8, in theta_i and in theta_r.
    CHECK(at_nodes < 2e-6);
    // Dips of neighbouring nodes are alike: their blend is the blend's dip to far below that.
    CHECK(between < 2e-6);
    CHECK(factors_off < 1e-6);  // rounding of two reciprocals; test_compress integrates such lobes by quadrature
    CHECK(signed_over > factors_off);
}

TEST_CASE("a batch of exits is its exits one by one", "[bcsdf]") {
    std::mt19937 random(12);
    const auto tables = std::make_unique<UnfoldedTables>();
    for (const FurPreset& preset : fur_presets) {
        FurParameters<3> p = parameters_of<3>(preset);
        p.sigma_ca[1] *= 2, p.sigma_ca[2] *= 0.1f;
        FurFibre<3> fibres[2];
        REQUIRE(prepare(p, default_view(), fibres[0]) == FurStatus::ok);
        REQUIRE(prepare(p, default_view(), fibres[1]) == FurStatus::ok);
        REQUIRE(unfold(fibres[1], *tables));
        for (int i = 0; i < 40; ++i) {
            NearField<3> near;
            const Query at = random_query(random);
            near_field(fibres[i % 2], at.theta_i, i == 39 ? 1.5f : at.h, near);  // 1.5: not valid
            constexpr int count = 53;
            float theta_r[count], phi[count];
            for (int k = 0; k < count; ++k) {
                const Query q = random_query(random);
                theta_r[k] = k == 7 ? 1.6f : q.theta_r, phi[k] = k == 9 ? std::nanf("") : (k == 11 ? 1e5f : q.phi);
            }
            Colour<3> S[count + 1];
            S[count].value[0] = 42;
            eval(near, count, theta_r, phi, S);
            CHECK(S[count].value[0] == 42);
            Colour<3> one[count];
            float most = 0;
            for (int k = 0; k < count; ++k)
                one[k] = near.eval(theta_r[k], phi[k]), most = std::max(most, one[k].value[0]);
            for (int k = 0; k < count; ++k)
                // The same sums in another order, and 1 / cos^2 as a factor: some ten roundings of 6e-8. Weights, whose
                // products are fused for one exit and not in a batch, are off by that too: of a lobe at its brightest.
                for (int c = 0; c < 3; ++c)
                    CHECK(double(S[k].value[c]) ==
                          Approx(double(one[k].value[c])).epsilon(2e-6).margin(1e-12 + 1e-7 * double(most)));
        }
    }
}

TEST_CASE("a batch of queries is its queries one by one", "[bcsdf]") {
    std::mt19937 random(15);
    const auto tables = std::make_unique<UnfoldedTables>();
    double largest = 0;
    for (const FurPreset& preset : fur_presets)
        for (const char* how : {"factors", "unfolded", "no medulla"}) {
            FurParameters<3> p = parameters_of<3>(preset);
            p.sigma_ca[1] *= 2, p.sigma_ca[2] *= 0.1f;
            p.fresnel = preset.name[0] < 'd' ? Fresnel::exact : Fresnel::bravais;
            if (how[0] == 'n') p.sigma_ms = 0;
            FurFibre<3> fibre;
            REQUIRE(prepare(p, default_view(), fibre) == FurStatus::ok);
            if (how[0] == 'u') REQUIRE(unfold(fibre, *tables));
            constexpr int count = 403;
            float theta_i[count], h[count], theta_r[count], phi[count];
            for (int i = 0; i < count; ++i) {
                const Query q = random_query(random);
                theta_i[i] = q.theta_i, h[i] = q.h, theta_r[i] = q.theta_r, phi[i] = q.phi;
                if (i % 4 > 1) theta_i[i] = theta_i[i - 1];
                if (i % 4 == 3) h[i] = h[i - 1];
                if (i % 5 == 4) {  // where a lobe leaves
                    NearField<3> near;
                    near_field(fibre, theta_i[i], h[i], near);
                    phi[i] = near.centre[i / 5 % 3];
                }
                // Out of range, one of each four, at each place in it.
                if (i / 16 == 1) h[i] = i % 5 == 1 ? (i % 2 ? 1.5f : std::nanf("")) : h[i];
                if (i / 16 == 2) theta_i[i] = i % 5 == 1 ? (i % 2 ? 1.6f : std::nanf("")) : theta_i[i];
                if (i / 16 == 3) theta_r[i] = i % 5 == 1 ? (i % 2 ? -1.6f : std::nanf("")) : theta_r[i];
                if (i / 16 == 4) phi[i] = i % 5 == 1 ? (i % 2 ? 1e5f : std::nanf("")) : phi[i];
                if (i / 16 == 5 && i % 5 == 1) theta_i[i] = -1.57079637f;  // the axis itself
                if (i / 4 == 24) theta_i[i] = 1.5707963f;                  // the last that is not
                if (i / 4 == 25) h[i] = i % 2 ? 1.0f : -1.0f;
            }
            Colour<3> S[count + 1];
            S[count].value[0] = 42;
            eval(fibre, count, theta_i, h, theta_r, phi, S);
            CHECK(S[count].value[0] == 42);
            double error = 0, norm = 0;
            for (int i = 0; i < count; ++i) {
                const Colour<3> one = eval(fibre, theta_i[i], theta_r[i], phi[i], h[i]);
                const double cosine = std::abs(theta_i[i]) < 1.58f ? std::cos(double(theta_i[i])) : 0;
                // Pointwise as test_bcsdf_near.cpp has it for a float and a double: what an angle's rounding moves.
                const double tolerance = 4e-5 + 1.6e-5 / double(std::min(p.beta_m / 2, p.beta_n));
                for (int c = 0; c < 3; ++c) {
                    const double a = double(S[i].value[c]), b = double(one.value[c]);
                    CHECK(a == Approx(b).epsilon(tolerance).margin(1e-12));
                    CHECK((a == 0) == (b == 0));
                    if (i / 16 >= 1 && i / 16 < 6 && i % 5 == 1) CHECK(a == 0);
                    error += std::pow((a - b) * cosine * cosine, 2), norm += std::pow(b * cosine * cosine, 2);
                }
            }
            // Twenty roundings of 6e-8, and an angle's 5e-7 over the narrowest lobe, 0.023, at one deviation.
            INFO(preset.name << " " << how);
            CHECK(std::sqrt(error / norm) < 1.2e-6 + 5e-7 / double(std::min(p.beta_m / 2, p.beta_n)));
            largest = std::max(largest, std::sqrt(error / norm));
        }
    std::printf("batches of queries: relative L2 of %.1e against one by one\n", largest);
}

TEST_CASE("tables that do not fit are refused and change nothing", "[bcsdf]") {
    const auto tables = std::make_unique<UnfoldedTables>();
    FurParameters<3> p = parameters_of<3>(*find_preset("bobcat"));
    FurFibre<3> fibre;
    p.eta = 1.1f;  // sqrt(sigma) over a range of 1.55
    REQUIRE(prepare(p, default_view(), fibre) == FurStatus::ok);
    const float before = near_lobes(fibre, 0.3f, -0.2f, 2.0f, 0.4f).N[3][0];
    CHECK_FALSE(unfold(fibre, *tables));
    CHECK(fibre.tables == nullptr);
    CHECK(near_lobes(fibre, 0.3f, -0.2f, 2.0f, 0.4f).N[3][0] == before);
    p.eta = 1.5f, p.kappa = 0;
    REQUIRE(prepare(p, default_view(), fibre) == FurStatus::ok);
    CHECK_FALSE(unfold(fibre, *tables));  // nothing to unfold
}

TEST_CASE("samplers draw from unfolded tables what they draw from factors", "[bcsdf]") {
    const auto tables = std::make_unique<UnfoldedTables>();
    FurFibre<3> slow;
    REQUIRE(prepare(parameters_of<3>(*find_preset("bobcat")), default_view(), slow) == FurStatus::ok);
    FurFibre<3> fast = slow;
    REQUIRE(unfold(fast, *tables));
    NearField<3> near[2];
    FarField<3> far[2];
    NearSampler<3> a[2];
    FarSampler<3> b[2];
    const FurFibre<3>* fibres[2] = {&slow, &fast};
    for (int i = 0; i < 2; ++i) {
        near_field(*fibres[i], 0.5f, 0.3f, near[i]), far_field(*fibres[i], 0.5f, OffsetRange{}, far[i]);
        a[i].prepare(near[i]), b[i].prepare(far[i]);
    }
    std::mt19937 random(3);
    std::uniform_real_distribution<float> u(0, 0.999f);
    for (int i = 0; i < 200; ++i) {
        const RandomNumbers numbers = {u(random), u(random), u(random), u(random), u(random)};
        const auto s = a[0].sample(numbers), t = a[1].sample(numbers);
        // Distributions of 1e-4 of a lobe apart (the first test here), drawn by the same numbers: 2 pi times that.
        CHECK(double(s.phi) == Approx(double(t.phi)).margin(1e-3));
        CHECK(double(s.theta_r) == Approx(double(t.theta_r)).margin(1e-3));
        CHECK(double(a[1].pdf(s.theta_r, s.phi)) == Approx(double(s.pdf)).epsilon(1e-3));
        CHECK(double(s.weight[0]) == Approx(double(t.weight[0])).epsilon(2e-3));
        const auto v = b[0].sample(numbers);
        CHECK(double(b[1].pdf(v.theta_r, v.phi)) == Approx(double(v.pdf)).epsilon(1e-3));
    }
}

TEST_CASE("far samplers hold little scattered light to the same floor, unfolded or not", "[bcsdf]") {
    // A distribution is divided by its integral before it is held to 2 % of the even density: it was not, by rows.
    FurParameters<3> p = parameters_of<3>(*find_preset("cat"));
    p.g = 0.9f, p.beta_n = 0.1f;
    const auto tables = std::make_unique<UnfoldedTables>();
    for (float sigma : {0.02f, 0.1f, 2.0f})
        for (float theta_i : {0.3f, -1.2f})
            for (OffsetRange range : {OffsetRange{-1, 1}, OffsetRange{0.1f, 0.6f}, OffsetRange{-0.9f, -0.2f}}) {
                p.sigma_ms = sigma;
                FurFibre<3> fibre;
                REQUIRE(prepare(p, default_view(), fibre) == FurStatus::ok);
                FarField<3> fields[2];
                FarSampler<3> samplers[2];
                far_field(fibre, theta_i, range, fields[0]);
                REQUIRE(unfold(fibre, *tables));
                far_field(fibre, theta_i, range, fields[1]);
                for (int i = 0; i < 2; ++i) samplers[i].prepare(fields[i]);  // each as its field was prepared
                for (int side = 0; side < 2; ++side)
                    for (int k = 0; k <= samplers[0].azimuth[side].bins; ++k) {
                        const float y = samplers[0].azimuth[side].edge[k];
                        CHECK(double(samplers[1].azimuth[side].pdf(y)) ==
                              Approx(double(samplers[0].azimuth[side].pdf(y))).epsilon(2e-3).margin(2e-4));
                    }
            }
}
