// Random, extreme and bit-pattern inputs through every door of the BCSDF: finite and >= 0, whatever comes in.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fibre_of.hpp"

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
    const test::FibreOf fibre(p, pack.view);
    for (int i = 0; i < 2000; ++i) {
        const FarField<3> far = far_field(fibre, Angles{1.5692f + 1e-6f * float(i), 0});
        REQUIRE(good(far.value(Angles{0.4f, 3.0f})[0]));
    }
}

TEST_CASE("fuzz: finite and non-negative for any input", "[bcsdf]") {
    const analytic::AnalyticPack pack;
    const char* wanted =
        std::getenv("MEDULLA_FUZZ");  // fibres; each is evaluated and sampled some hundred times, near and far
    const long fibres = wanted ? std::atol(wanted) : 2500;
    Inputs in(7);
    const test::OwnedTables wide(pack.view, {-0.95f, 0.95f, 0, 16, 0}),
        corrected(pack.view, {-0.95f, 0.95f, 0, 16, 0, 0, form_bit(Scattering::corrected)});
    long usable_fibres = 0, evaluated = 0, bright = 0, bad = 0, made = 0, drawn = 0;
    for (long i = 0; i < fibres; ++i) {
        FurParameters<3> p;
        p.eta = in.mostly(1.0001f, 2.5f), p.kappa = in.mostly(0, 1), p.alpha = in.mostly(-0.3f, 0.3f);
        p.beta_m = in.mostly(0.00174533f, 1.05f), p.beta_n = in.mostly(0.00174533f, 1.05f), p.layers = in.mostly(0, 5);
        p.sigma_ms = in.mostly(0, 10), p.sigma_ma = in.mostly(0, 3), p.g = in.mostly(-0.95f, 0.95f);
        for (float& s : p.sigma_ca) s = in.mostly(0, 5);
        p.fresnel = in.uniform() < 0.5f ? Fresnel::bravais : Fresnel::exact;
        p.scattering = i % 5 == 0 ? Scattering::corrected : Scattering::published;
        // Tables of any ranges, which may be refused; those of everything; none.
        const test::OwnedTables own(pack.view, i % 8 == 1
                                                   ? TableRanges{in.any(-1, 0), in.any(0, 1), in.any(0, 4),
                                                                 in.any(4, 16), in.any(0, 1), 0, std::uint32_t(i % 4)}
                                                   : TableRanges{0, 0, 1, 1, 0});
        made += i % 8 == 1 && own.get() != nullptr;
        const DenseTables* tables =
            i % 8 == 1 ? own.get() : (i % 8 == 2 ? nullptr : (i % 5 == 0 ? corrected : wide).get());
        const Fibre<3> fibre = make_fibre(p, tables, i % 3 == 0 ? OutOfRange::clamp : OutOfRange::black);
        usable_fibres += fibre.status != FibreStatus::bad_parameters;
        const auto check = [&](float x, const char* what) {
            ++evaluated, bright += x > 0;
            if (good(x)) return;
            if (++bad < 10)
                UNSCOPED_INFO(what << " " << x << ": eta " << p.eta << " kappa " << p.kappa << " beta " << p.beta_m
                                   << " " << p.beta_n << " layers " << p.layers << " sigma " << p.sigma_ms << " g "
                                   << p.g << " alpha " << p.alpha);
        };
        const auto check_all = [&](const Evaluation<3>& e, const char* what) {
            for (float x : e.value.value) check(x, what);
            check(e.pdf, what);
        };
        const auto angles = [&] { return Angles{in.any(-1.5707f, 1.5707f), in.any(-7, 7)}; };
        const auto vector = [&] { return Vector{in.any(-1, 1), in.any(-1, 1), in.any(-1, 1)}; };
        const auto numbers = [&] {
            const auto u = [&] { return in.uniform() < 0.9f ? in.uniform() : (in.uniform() < 0.5f ? 0.0f : 1.0f); };
            return RandomNumbers{u(), u(), u(), u(), u()};
        };
        const auto check_sample = [&](const Sample<3>& s, const char* what) {
            check(s.pdf, what);
            for (float w : s.weight.value) check(w, what);
            if (!s.valid) return;
            ++drawn;
            const Vector w = s.direction;
            const float off = std::abs(w.x * w.x + w.y * w.y + w.z * w.z - 1);
            check(off < 1e-5f ? 0.0f : -1.0f, "length of a drawn direction");
        };
        for (int k = 0; k < 8; ++k) {
            const NearField<3> near =
                k % 2 ? near_field(fibre, angles(), in.any(-1, 1)) : near_field(fibre, vector(), in.any(-1, 1));
            for (int j = 0; j < 8; ++j) {
                check_all(near.evaluate(angles()), "near");
                for (float x : near.eq12(in.any(-1.5707f, 1.5707f), in.any(-7, 7)).value) check(x, "Eq. 12");
                check_sample(near.sample(numbers()), "sample");
            }
            check_all(near.evaluate(vector()), "near");
            check_all(near.keep(LobeMask(i)).evaluate(angles()), "kept");
            if (k > 0) continue;
            const FarField<3> far =
                far_field(fibre, angles(), {in.any(-1, 0), in.any(0, 1)}, static_cast<FarQuality>(int(i % 3) - 1));
            check_all(far.evaluate(angles()), "far");
            check_all(far.evaluate(vector()), "far");
            check_all(far.keep(LobeMask(i)).evaluate(angles()), "far, kept");
            check_sample(far.sample(numbers()), "far sample");
        }
        constexpr int count = 4;
        Angles known[count], exits[count];
        float h[count];
        Evaluation<3> each[count];
        for (int k = 0; k < count; ++k) known[k] = angles(), exits[k] = angles(), h[k] = in.any(-1, 1);
        evaluate_batch(fibre, count, known, h, exits, each);
        for (const Evaluation<3>& e : each) check_all(e, "batch");
    }
    if (wanted) std::printf("%ld fibres, %ld values, %ld of them > 0, %ld bad\n", fibres, evaluated, bright, bad);
    CHECK(bad == 0);
    CHECK(usable_fibres > fibres / 4);
    CHECK(made > fibres / 64);
    CHECK(bright > evaluated / 20);
    CHECK(drawn > 4 * fibres);
}
