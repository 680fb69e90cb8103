// Errors of the portable elementary functions against those of long double, over their ranges and at the ends.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "medulla/axis.hpp"
#include "medulla/phase.hpp"
#include "sim2d/elementary.hpp"

using namespace medulla;
namespace portable = medulla::sim2d::portable;

namespace {

/// Error in units of the last place of the true value.
double ulps(double value, long double truth) {
    const auto near = static_cast<double>(truth);
    const double unit = std::nextafter(std::abs(near), std::numeric_limits<double>::infinity()) - std::abs(near);
    return static_cast<double>(std::abs(static_cast<long double>(value) - truth)) / unit;
}

struct Worst {
    double ulp = 0;
    void see(double error) { ulp = std::max(ulp, error); }
};

template <class F, class G, class Draw>
double worst(F ours, G theirs, Draw draw) {
    std::mt19937_64 random(1);
    Worst found;
    for (int i = 0; i < 400000; ++i) {
        const double x = draw(random);
        found.see(ulps(ours(x), theirs(static_cast<long double>(x))));
    }
    return found.ulp;
}

auto between(double low, double high) {
    return [=](std::mt19937_64& random) { return std::uniform_real_distribution<double>(low, high)(random); };
}

auto powers(double low, double high, double sign = 1) {
    return [=](std::mt19937_64& random) {
        return sign * std::exp2(std::uniform_real_distribution<double>(low, high)(random));
    };
}

}  // namespace

// Bounds of fdlibm: below 1 ulp each; Kahan's log1p and expm1 are products of three values of 1/2 to 1 ulp.
TEST_CASE("Portable elementary functions are accurate to an ulp", "[elementary]") {
    const auto log = [](double x) { return portable::log(x); };
    CHECK(worst(log, logl, between(0, 1)) < 1);
    CHECK(worst(log, logl, between(0.9, 1.1)) < 1);
    CHECK(worst(log, logl, powers(-1074, 1023)) < 1);
    const auto exp = [](double x) { return portable::exp(x); };
    CHECK(worst(exp, expl, between(-700, 709)) < 1);
    CHECK(worst(exp, expl, between(-1, 1)) < 1);
    const auto sin = [](double x) { return portable::sin(x); };
    const auto cos = [](double x) { return portable::cos(x); };
    CHECK(worst(sin, sinl, between(-pi, pi)) < 1);
    CHECK(worst(cos, cosl, between(-pi, pi)) < 1);
    CHECK(worst(sin, sinl, between(pi - 1e-6, pi)) < 1);
    CHECK(worst(cos, cosl, between(pi / 2 - 1e-6, pi / 2)) < 1);
    const auto log1p = [](double x) { return portable::log1p(x); };
    const auto expm1 = [](double x) { return portable::expm1(x); };
    CHECK(worst(log1p, log1pl, between(-1, 1)) < 3);
    CHECK(worst(log1p, log1pl, powers(-1000, 100)) < 3);
    CHECK(worst(log1p, log1pl, powers(-1000, -0.01, -1)) < 3);
    CHECK(worst(expm1, expm1l, between(-50, 5)) < 3);
    CHECK(worst(expm1, expm1l, powers(-1000, 1, -1)) < 3);
    std::mt19937_64 random(2);
    std::normal_distribution<double> normal;
    Worst angle;
    for (int i = 0; i < 400000; ++i) {
        const double x = normal(random), y = normal(random) * (i % 2 ? 1 : 1e-9);
        angle.see(ulps(portable::atan2(y, x), atan2l(y, x)));
    }
    CHECK(angle.ulp < 2);  // atan of fdlibm is below 1, the quotient adds 1/2
    // The argument has an error of 3/2 ulp (two differences, a product, a root), and so has the angle at most.
    const auto asin = [](double x) { return portable::asin(x); };
    const auto acos = [](double x) { return portable::acos(x); };
    CHECK(worst(asin, asinl, between(-1, 1)) < 4);
    CHECK(worst(asin, asinl, powers(-1000, 0)) < 4);
    CHECK(worst(acos, acosl, between(-1, 1)) < 4);
    CHECK(worst(acos, acosl, between(1 - 1e-9, 1)) < 4);
}

TEST_CASE("Portable elementary functions at the ends of their ranges", "[elementary]") {
    const double infinity = std::numeric_limits<double>::infinity();
    CHECK(portable::log(1) == 0);
    CHECK(portable::log(0) == -infinity);
    CHECK(portable::log(infinity) == infinity);
    CHECK(std::isnan(portable::log(-1)));
    CHECK(std::isnan(portable::log(std::nan(""))));
    CHECK(portable::exp(0) == 1);
    CHECK(portable::exp(-infinity) == 0);
    CHECK(portable::exp(infinity) == infinity);
    CHECK(std::isnan(portable::exp(std::nan(""))));
    CHECK(portable::expm1(0) == 0);
    CHECK(portable::expm1(-infinity) == -1);
    CHECK(std::isnan(portable::expm1(std::nan(""))));
    CHECK(portable::log1p(0) == 0);
    CHECK(portable::log1p(-1) == -infinity);
    CHECK(portable::sin(0) == 0);
    CHECK(portable::cos(0) == 1);
    CHECK(portable::sin(pi / 2) == 1);
    CHECK(portable::asin(0) == 0);
    CHECK(portable::acos(1) == 0);
    CHECK(portable::asin(1) == std::asin(1.0));
    CHECK(portable::acos(-1) == std::acos(-1.0));
    const double nan = std::nan("");
    for (const auto f : {portable::log, portable::log1p, portable::exp, portable::expm1, portable::sin, portable::cos,
                         portable::asin, portable::acos})
        CHECK(std::isnan(f(nan)));
    for (const double x : {0.0, -0.0, 1.0, -1.0, nan}) {
        CHECK(std::isnan(portable::atan2(nan, x)));
        CHECK(std::isnan(portable::atan2(x, nan)));
    }
    CHECK(std::isnan(portable::planar_hg_pdf(nan, 0.5)));
    CHECK(std::isnan(portable::planar_hg_pdf(0.5, nan)));
    for (const double y : {0.0, -0.0, 1.0, -1.0})
        for (const double x : {0.0, -0.0, 1.0, -1.0}) {
            CAPTURE(y, x);
            CHECK(portable::atan2(y, x) == std::atan2(y, x));
            CHECK(std::signbit(portable::atan2(y, x)) == std::signbit(std::atan2(y, x)));
        }
}

TEST_CASE("The portable phase function agrees with the runtime's", "[elementary]") {
    std::mt19937_64 random(3);
    for (int i = 0; i < 10000; ++i) {
        const double t = between(-2 * pi, 2 * pi)(random), g = between(-0.999, 0.999)(random);
        // Both have at most the rounding of the angle, pi 2^-53, relative to a width of (1 - |g|) at the peak.
        CHECK(portable::planar_hg_pdf(t, g) == Approx(planar_hg_pdf(t, g)).epsilon(1e-12).margin(0));
    }
}
