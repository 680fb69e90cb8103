// Random, extreme and bit-pattern inputs through every door of the BCSDF: finite and >= 0, whatever comes in.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"

using namespace medulla;

namespace {

class Inputs {
  public:
    explicit Inputs(unsigned seed) : engine_(seed) {}
    float uniform() { return float(engine_() >> 40) * 0x1p-24f; }
    /// A number in or about [low, high], one of the extremes, or any 32 bits.
    float any(float low, float high) {
        const float extremes[] = {0.0f,        -0.0f,       1e-45f,   1.17549435e-38f, 1e-20f,      0.99999994f,
                                  1.0f,        1.00000012f, -1.0f,    1.57079625f,     1.57079637f, -1.57079637f,
                                  3.14159274f, 3.4e38f,     -3.4e38f, INFINITY,        -INFINITY,   NAN};
        switch (engine_() % 8) {
            case 0:
                return extremes[engine_() % (sizeof extremes / sizeof extremes[0])];
            case 1: {
                const auto bits = std::uint32_t(engine_());
                float x;
                std::memcpy(&x, &bits, sizeof x);
                return x;
            }
            case 2:
                return engine_() % 2 ? low : high;
            case 3:
                return std::nextafter(engine_() % 2 ? low : high, engine_() % 2 ? -1e9f : 1e9f);
            default:
                return low + (high - low) * uniform();
        }
    }
    /// As `any`, but mostly inside, so that a whole fibre of eleven numbers is often usable.
    float mostly(float low, float high) {
        return engine_() % 16 ? low + (high - low) * (engine_() % 4 ? uniform() : float(engine_() % 2))
                              : any(low, high);
    }

  private:
    std::mt19937_64 engine_;
};

/// Finite and not negative, asked of the bits so that -ffast-math cannot wave it through.
bool good(float x) {
    std::uint32_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    return bits < 0x7f800000u || bits == 0x80000000u;
}

}  // namespace

TEST_CASE("far field of a dense medulla that reaches the rim, next to grazing light", "[bcsdf]") {
    // Found by fuzzing: nodes within 1e-3 of the rim, where a sine that rounds above 1 had no cosine.
    const analytic::AnalyticPack pack;
    FurParameters<3> p;
    p.eta = 1.0001f, p.kappa = 1, p.beta_m = p.beta_n = 0.3f, p.layers = 2, p.sigma_ms = 9.87f, p.g = 0.95f;
    FurFibre<3> fibre;
    REQUIRE(prepare(p, pack.view, fibre) == FurStatus::ok);
    for (int i = 0; i < 2000; ++i) {
        FarField<3> far;
        far_field(fibre, 1.5692f + 1e-6f * float(i), OffsetRange{}, far);
        const Colour<3> value = far.eval(0.4f, 3.0f);
        REQUIRE(good(value.value[0]));
    }
}

TEST_CASE("fuzz: finite and non-negative for any input", "[bcsdf]") {
    const analytic::AnalyticPack pack;
    const char* wanted = std::getenv("MEDULLA_FUZZ");  // fibres; each is asked 93 times, near, far, by samples
    const long fibres = wanted ? std::atol(wanted) : 2500;
    Inputs in(7);
    const auto tables = std::make_unique<UnfoldedTables>();
    long unfolded = 0, usable_fibres = 0, evaluated = 0, bright = 0, bad = 0;
    for (long i = 0; i < fibres; ++i) {
        FurParameters<3> p;
        p.eta = in.mostly(1.0001f, 2.5f), p.kappa = in.mostly(0, 1), p.alpha = in.mostly(-0.3f, 0.3f);
        p.beta_m = in.mostly(0.00174533f, 1.05f), p.beta_n = in.mostly(0.00174533f, 1.05f), p.layers = in.mostly(0, 5);
        p.sigma_ms = in.mostly(0, 10), p.sigma_ma = in.mostly(0, 3), p.g = in.mostly(-0.95f, 0.95f);
        for (float& s : p.sigma_ca) s = in.mostly(0, 5);
        p.fresnel = in.uniform() < 0.5f ? Fresnel::bravais : Fresnel::exact;
        FurFibre<3> fibre;
        usable_fibres += usable(prepare(p, pack.view, fibre));
        if (i % 8 == 1) unfolded += unfold(fibre, *tables);
        const auto check = [&](float x, const char* what) {
            ++evaluated, bright += x > 0;
            if (good(x)) return;
            if (++bad < 10)
                UNSCOPED_INFO(what << " " << x << ": eta " << p.eta << " kappa " << p.kappa << " beta " << p.beta_m
                                   << " " << p.beta_n << " layers " << p.layers << " sigma " << p.sigma_ms << " g "
                                   << p.g << " alpha " << p.alpha);
        };
        for (int k = 0; k < 8; ++k) {
            const float theta_i = in.any(-1.5707f, 1.5707f), h = in.any(-1, 1);
            NearField<3> near;
            near_field(fibre, theta_i, h, near);
            float theta_r[8], phi[8];
            for (int j = 0; j < 8; ++j) {
                theta_r[j] = in.any(-1.5707f, 1.5707f), phi[j] = in.any(-7, 7);
                for (float x : near.eval(theta_r[j], phi[j]).value) check(x, "near");
            }
            Colour<3> S[8];
            eval(near, 8, theta_r, phi, S);
            for (const Colour<3>& at : S)
                for (float x : at.value) check(x, "batch");
            if (k < 1) {
                NearSampler<3> sampler;
                sampler.prepare(near);
                for (int j = 0; j < 8; ++j) {
                    const auto s =
                        sampler.sample({in.uniform(), in.uniform(), in.uniform(), in.uniform(), in.uniform()});
                    check(s.pdf, "pdf");
                    for (float w : s.weight) check(w, "weight");
                }
                check(sampler.pdf(in.any(-1.5f, 1.5f), in.any(-3, 3)), "pdf");
                FarField<3> far;
                far_field(fibre, theta_i, {in.any(-1, 0), in.any(0, 1)}, far);
                for (float x : far.eval(in.any(-1.5707f, 1.5707f), in.any(-7, 7)).value) check(x, "far");
                FarSampler<3> far_sampler;
                far_sampler.prepare(far);
                const auto s =
                    far_sampler.sample({in.uniform(), in.uniform(), in.uniform(), in.uniform(), in.uniform()});
                check(s.pdf, "far pdf");
                for (float w : s.weight) check(w, "far weight");
                check(far_sampler.pdf(in.any(-1.5f, 1.5f), in.any(-3, 3)), "far pdf");
            }
        }
        float query[4][8];
        for (float(&of)[8] : query)
            for (float& x : of) x = in.any(-1.5707f, 1.5707f);
        Colour<3> each[8];
        eval(fibre, 8, query[0], query[1], query[2], query[3], each);
        for (const Colour<3>& at : each)
            for (float x : at.value) check(x, "queries");
        const Vector<float> a = {in.any(-1, 1), in.any(-1, 1), in.any(-1, 1)},
                            b = {in.any(-1, 1), in.any(-1, 1), in.any(-1, 1)};
        for (float x : eval(fibre, a, b, in.any(-1, 1)).value) check(x, "directions");
    }
    if (wanted) std::printf("%ld inputs, %ld values, %ld of them > 0, %ld bad\n", 93 * fibres, evaluated, bright, bad);
    CHECK(bad == 0);
    CHECK(usable_fibres > fibres / 4);
    CHECK(unfolded > fibres / 64);
    CHECK(bright > evaluated / 20);
}
