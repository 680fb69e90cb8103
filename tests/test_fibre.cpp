// What a renderer is told of bad input, and that none of it becomes NaN light: parameters, offsets, directions, tables.
#include <catch2/catch.hpp>
#include <cfenv>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fibre_of.hpp"

using namespace medulla;
using test::FibreOf;
using test::shipped;

namespace {

const float no_number = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();

/// The number of a parameter; of sigma_ca the second channel's.
float& number_of(FurParameters<3>& p, Parameter which) {
    switch (which) {
        case Parameter::eta:
            return p.eta;
        case Parameter::kappa:
            return p.kappa;
        case Parameter::alpha:
            return p.alpha;
        case Parameter::beta_m:
            return p.beta_m;
        case Parameter::beta_n:
            return p.beta_n;
        case Parameter::layers:
            return p.layers;
        case Parameter::sigma_ms:
            return p.sigma_ms;
        case Parameter::sigma_ma:
            return p.sigma_ma;
        case Parameter::sigma_ca:
            return p.sigma_ca[1];
        default:
            return p.g;
    }
}

bool is_black(const Evaluation<3>& e) { return e.value[0] == 0 && e.value[1] == 0 && e.value[2] == 0 && e.pdf == 0; }
bool is_light(const Evaluation<3>& e) {
    for (float x : {e.value[0], e.value[1], e.value[2], e.pdf})
        if (!(x >= 0 && x <= 3.4e38f)) return false;
    return true;
}

}  // namespace

TEST_CASE("each parameter out of its range is named, and the fibre is black or clamped", "[bcsdf]") {
    const FibreOf good(parameters_of<3>(*find_preset("bobcat")), shipped());
    CHECK(good.status == FibreStatus::ok);
    CHECK(good.out_of_range == 0);
    const float least[] = {1.0000001f, 0, -1.5707964f, 1e-4f, 1e-4f, 0, 0, 0, 0, -0.99999994f},
                most[] = {10, 1, 1.5707964f, 4, 4, 1000, 1e9f, 1e9f, 1e9f, 0.99999994f};
    const Angles known = {0.3f, 0}, drawn = {-0.28f, 2.9f};
    for (int i = 0; i < parameter_count; ++i) {
        const auto which = static_cast<Parameter>(i);
        for (float end : {least[i], most[i]}) {  // both ends are inside
            FurParameters<3> p = good.parameters;
            number_of(p, which) = end;
            INFO(parameter_names[i] << " " << end);
            CHECK(out_of_range(p) == 0);
        }
        for (float bad : {no_number, -no_number, infinity, -infinity, std::nextafter(least[i], -infinity),
                          std::nextafter(most[i], infinity), -20.0f}) {
            FurParameters<3> p = good.parameters;
            number_of(p, which) = bad;
            INFO(parameter_names[i] << " " << bad);
            const Fibre<3> black = make_fibre(p, good.tables), clamp = make_fibre(p, good.tables, OutOfRange::clamp);
            CHECK(black.status == FibreStatus::bad_parameters);
            CHECK(black.out_of_range == 1u << i);
            CHECK(clamp.status == FibreStatus::clamped_parameters);
            CHECK(clamp.out_of_range == 1u << i);
            CHECK(out_of_range(clamp.parameters) == 0);
            CHECK(is_black(near_field(black, known, 0.2f).evaluate(drawn)));
            CHECK(is_black(far_field(black, known).evaluate(drawn)));
            CHECK_FALSE(near_field(black, known, 0.2f).sample({0.5f, 0.5f, 0.5f, 0.5f, 0.5f}).valid);
            CHECK_FALSE(far_field(black, known).sample({0.5f, 0.5f, 0.5f, 0.5f, 0.5f}).valid);
            CHECK(near_field(black, known, 0.2f).albedo()[0] == 0);
            CHECK(near_field(black, known, 0.2f).keep(1).albedo()[0] == 0);
            CHECK(near_field(black, known, 0.2f).eq12(0.1f, 0.2f)[0] == 0);
            CHECK(is_light(near_field(clamp, known, 0.2f).evaluate(drawn)));
            CHECK(is_light(far_field(clamp, known).evaluate(drawn)));
            CHECK(near_field(clamp, known, 0.2f).albedo()[0] <= 1 + 1e-6f);
        }
    }
    // As an artist's texture has them: each a little too much.
    FurParameters<3> p = good.parameters;
    p.kappa = 1.2f, p.g = -1.2f, p.sigma_ca[0] = -0.1f;
    CHECK(make_fibre(p, good.tables).out_of_range ==
          (1u << int(Parameter::kappa) | 1u << int(Parameter::g) | 1u << int(Parameter::sigma_ca)));
    CHECK(clamped(p).kappa == 1);
    CHECK(clamped(p).sigma_ca[0] == 0);
    for (int s = 0; s <= static_cast<int>(FibreStatus::bad_parameters); ++s)
        CHECK(std::string(describe(static_cast<FibreStatus>(s))) != "unknown status");
}

TEST_CASE("tables that are absent or too small are said to be, and the fibre is usable", "[bcsdf]") {
    const FurParameters<3> p = parameters_of<3>(*find_preset("bobcat"));
    const FibreOf good(p, shipped());
    const Angles known = {0.3f, 0}, drawn = {-0.28f, 2.9f};
    const Fibre<3> without = make_fibre(p, nullptr);
    CHECK(without.status == FibreStatus::no_tables);
    const auto a = near_field(good, known, 0.2f).lobes(-0.28f, 2.9f),
               b = near_field(without, known, 0.2f).lobes(-0.28f, 2.9f);
    for (int k = 0; k < 3; ++k) CHECK(a.M[k] * a.N[k][0] == b.M[k] * b.N[k][0]);
    CHECK(b.M[3] * b.N[3][0] == 0);
    CHECK(is_light(far_field(without, known).evaluate(drawn)));
    FurParameters<3> q = p;
    for (float bad : {p.g - 0.01f, p.g + 0.01f}) {
        q.g = bad;
        CHECK(make_fibre(q, good.tables).status == FibreStatus::beyond_tables);
    }
    q = p, q.sigma_ms *= 1.01f;
    CHECK(make_fibre(q, good.tables).status == FibreStatus::beyond_tables);
    q.sigma_ms = 0.98f * p.sigma_ms;
    CHECK(make_fibre(q, good.tables).status == FibreStatus::beyond_tables);
    q = p, q.eta = 1.2f;  // a lower index: longer paths at grazing
    CHECK(make_fibre(q, good.tables).status == FibreStatus::beyond_tables);
    CHECK(is_light(near_field(make_fibre(q, good.tables), Angles{1.5f, 0}, 0.2f).evaluate(drawn)));
    // Colour, roughness, tilt and layers ask nothing of tables.
    q = p, q.sigma_ca[1] = 5, q.beta_m = q.beta_n = 1, q.alpha = 0.2f, q.layers = 3;
    CHECK(make_fibre(q, good.tables).status == FibreStatus::ok);
    // What is beyond the pack itself is beyond the tables: their ends are the pack's.
    q = p, q.sigma_ms = 1000;
    const FibreOf dense(q, shipped());
    CHECK(dense.status == FibreStatus::beyond_tables);
    CHECK(is_light(near_field(dense, known, 0.2f).evaluate(drawn)));
}

TEST_CASE("offsets a rounding beyond the rim are at the rim, and a NaN is black", "[bcsdf]") {
    const FibreOf fibre(parameters_of<3>(*find_preset("bobcat")), shipped());
    const Angles known = {0.3f, 0}, drawn = {-0.28f, 3.0f};
    for (float side : {1.0f, -1.0f}) {
        const Evaluation<3> rim = near_field(fibre, known, side).evaluate(drawn);
        for (float h : {1.0000001f, 1.001f, 7.0f, infinity}) {
            const Evaluation<3> beyond = near_field(fibre, known, side * h).evaluate(drawn);
            for (int c = 0; c < 3; ++c) CHECK(beyond.value[c] == rim.value[c]);
            CHECK(beyond.pdf == rim.pdf);
        }
        CHECK(is_light(rim));
        CHECK_FALSE(is_black(rim));
    }
    CHECK(is_black(near_field(fibre, known, no_number).evaluate(drawn)));
    CHECK_FALSE(near_field(fibre, known, no_number).sample({0.5f, 0.5f, 0.5f, 0.5f, 0.5f}).valid);
    for (const Offsets& bad : {Offsets{no_number, 1}, Offsets{0, no_number}, Offsets{0.5f, 0.4f}})
        CHECK(is_black(far_field(fibre, known, bad).evaluate(drawn)));
    const Evaluation<3> whole = far_field(fibre, known).evaluate(drawn),
                        more = far_field(fibre, known, Offsets{-infinity, 3}).evaluate(drawn);
    CHECK(whole.value[0] == more.value[0]);
}

TEST_CASE("directions of any length are those of length 1, and none, NaN and along the fibre is black", "[bcsdf]") {
    const FibreOf fibre(parameters_of<3>(*find_preset("bobcat")), shipped());
    const Vector known = {0.3f, 0.5f, -0.8f}, drawn = {-0.2f, 0.6f, 0.77f};
    const auto scaled = [](Vector w, float s) { return Vector{s * w.x, s * w.y, s * w.z}; };
    const Evaluation<3> near = near_field(fibre, known, 0.3f).evaluate(drawn),
                        far = far_field(fibre, known).evaluate(drawn);
    for (float a : {1e-6f, 0.01f, 3.0f, 1e6f})
        for (float b : {1e-6f, 1.0f, 1e6f}) {
            const Evaluation<3> n = near_field(fibre, scaled(known, a), 0.3f).evaluate(scaled(drawn, b)),
                                f = far_field(fibre, scaled(known, a)).evaluate(scaled(drawn, b));
            // Two angles' rounding, 3e-7, over the narrowest lobe, 0.1 (TT's beta_m / 2), at three deviations.
            CHECK(n.value[1] == Approx(near.value[1]).epsilon(2e-5));
            CHECK(n.pdf == Approx(near.pdf).epsilon(2e-5));
            CHECK(f.value[1] == Approx(far.value[1]).epsilon(2e-5));
        }
    for (const Vector& bad :
         {Vector{0, 0, 0}, Vector{no_number, 0, 1}, Vector{0, no_number, 1}, Vector{0, 0, no_number},
          Vector{infinity, 0, 1}, Vector{0, infinity, 1}, Vector{1, 0, 0}, Vector{-1, 0, 0}, Vector{1, 1e-9f, 0},
          Vector{1e-20f, 1e-20f, 0}, Vector{3e38f, 3e38f, 3e38f}}) {
        INFO(bad.x << " " << bad.y << " " << bad.z);
        CHECK(is_black(near_field(fibre, bad, 0.3f).evaluate(drawn)));
        CHECK(is_black(near_field(fibre, known, 0.3f).evaluate(bad)));
        CHECK(is_black(far_field(fibre, bad).evaluate(drawn)));
        CHECK(is_black(far_field(fibre, known).evaluate(bad)));
        CHECK_FALSE(near_field(fibre, bad, 0.3f).sample({0.5f, 0.5f, 0.5f, 0.5f, 0.5f}).valid);
        CHECK_FALSE(far_field(fibre, bad).sample({0.5f, 0.5f, 0.5f, 0.5f, 0.5f}).valid);
    }
    for (const Angles& bad : {Angles{no_number, 0}, Angles{0, no_number}, Angles{1.6f, 0}, Angles{-1.6f, 0},
                              Angles{infinity, 0}, Angles{0, infinity}, Angles{1.57079637f, 0}}) {
        CHECK(is_black(near_field(fibre, bad, 0.3f).evaluate(drawn)));
        CHECK(is_black(near_field(fibre, known, 0.3f).evaluate(bad)));
        CHECK(is_black(far_field(fibre, known).evaluate(bad)));
    }
}

TEST_CASE("all four rounding modes give the same light, and no operation is invalid or divides by 0", "[bcsdf]") {
    struct Light {
        float near, pdf, far, weight;
    };
    const auto light = [](int mode, const FurParameters<3>& p, const DenseTables* tables, Angles known, Angles drawn,
                          float h) {
        Light l;
        std::fesetround(mode), std::feclearexcept(FE_ALL_EXCEPT);
        const Fibre<3> fibre = make_fibre(p, tables);
        const Evaluation<3> e = near_field(fibre, known, h).evaluate(drawn);
        l.near = e.value[1], l.pdf = e.pdf;
        l.far = far_field(fibre, known, Offsets{-0.4f, 0.9f}).value(drawn)[1];
        l.weight = near_field(fibre, known, h).sample({0.3f, 0.4f, 0.6f, 0.7f, 0.2f}).weight[1];
        const RandomNumbers ends = {1, 0, 1, 0, 1};
        far_field(fibre, known).sample(ends);
        const int raised = std::fetestexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
        std::fesetround(FE_TONEAREST);
        CHECK(raised == 0);
        return l;
    };
    std::mt19937 random(3);
    std::uniform_real_distribution<float> u(-1, 1);
    for (const char* animal : {"bobcat", "raccoon", "human"}) {
        FurParameters<3> p = parameters_of<3>(*find_preset(animal));
        p.beta_m = p.beta_n = 0.3f;
        const FibreOf fibre(p, shipped());
        for (int i = 0; i < 40; ++i) {
            const float h = i == 0 ? 1.0f : (i == 1 ? 0.0f : u(random));
            if (i % 10 == 3) p.kappa = 0;
            if (i % 10 == 4) p = fibre.parameters;
            p.layers = i % 10 == 5 ? 0 : fibre.parameters.layers;
            const Angles known = {i % 8 == 7 ? 1.57f : 1.4f * u(random), 3 * u(random)},
                         drawn = {1.4f * u(random), 3 * u(random)};
            // Next to the medulla's rim a chord's length is a root of what rounding leaves: 1e-7 / 0.02 away from it.
            const float inverse_index = detail::inclination(p.eta, std::cos(known.theta)).inverse_index;
            if (std::abs(std::abs(h) * inverse_index - p.kappa) < 0.02f) continue;
            const Light exact = light(FE_TONEAREST, p, fibre.tables, known, drawn, h);
            for (int mode : {FE_DOWNWARD, FE_UPWARD, FE_TOWARDZERO}) {
                const Light other = light(mode, p, fibre.tables, known, drawn, h);
                // Some fifty roundings of up to 1.2e-7 that all go one way, and angles of 1e-6 over deviations of 0.15
                // at up to ten of them: light that far out is 1e-20.
                INFO(animal << " " << i << " mode " << mode << " theta_i " << known.theta << " h " << h);
                CHECK(other.near == Approx(exact.near).epsilon(1e-5).margin(1e-7));
                CHECK(other.pdf == Approx(exact.pdf).epsilon(1e-5).margin(1e-7));
                CHECK(other.far == Approx(exact.far).epsilon(1e-5).margin(1e-6));
                CHECK(other.weight == Approx(exact.weight).epsilon(1e-5));
            }
        }
    }
}
