// The unscattered lobes in double, in numbers that carry a derivative, and with the exact Fresnel term of an inclined
// cylinder, against textbook formulas and finite differences.
#include <catch2/catch.hpp>
#include <functional>
#include <random>

#include "medulla/medulla.hpp"
#include "medulla/unscattered.hpp"
#include "tests/support/fur_reference.hpp"

// A dual number: a value and its derivative along one direction. The least a scalar of the runtime's needs.
namespace dual {

struct Dual {
    double v = 0, d = 0;
    Dual() = default;
    Dual(double value, double derivative = 0) : v(value), d(derivative) {}
};
inline Dual operator-(Dual a) { return {-a.v, -a.d}; }
inline Dual operator+(Dual a, Dual b) { return {a.v + b.v, a.d + b.d}; }
inline Dual operator-(Dual a, Dual b) { return {a.v - b.v, a.d - b.d}; }
inline Dual operator*(Dual a, Dual b) { return {a.v * b.v, a.d * b.v + a.v * b.d}; }
inline Dual operator/(Dual a, Dual b) { return {a.v / b.v, (a.d - a.v / b.v * b.d) / b.v}; }
inline bool operator<(Dual a, Dual b) { return a.v < b.v; }
inline bool operator>(Dual a, Dual b) { return a.v > b.v; }
inline bool operator<=(Dual a, Dual b) { return a.v <= b.v; }
inline bool operator>=(Dual a, Dual b) { return a.v >= b.v; }
inline Dual sqrt(Dual a) { return {std::sqrt(a.v), a.d / (2 * std::sqrt(a.v))}; }
inline Dual exp(Dual a) { return {std::exp(a.v), a.d * std::exp(a.v)}; }
inline Dual expm1(Dual a) { return {std::expm1(a.v), a.d * std::exp(a.v)}; }
inline Dual sin(Dual a) { return {std::sin(a.v), a.d * std::cos(a.v)}; }
inline Dual cos(Dual a) { return {std::cos(a.v), -a.d * std::sin(a.v)}; }
inline Dual floor(Dual a) { return {std::floor(a.v), 0}; }
inline Dual erf(Dual a) { return {std::erf(a.v), a.d * 1.1283791670955126 * std::exp(-a.v * a.v)}; }
inline Dual erfc(Dual a) { return {std::erfc(a.v), -a.d * 1.1283791670955126 * std::exp(-a.v * a.v)}; }
inline Dual atan2(Dual y, Dual x) { return {std::atan2(y.v, x.v), (y.d * x.v - x.d * y.v) / (x.v * x.v + y.v * y.v)}; }

}  // namespace dual

using namespace medulla;
using namespace medulla::detail;
using dual::Dual;

namespace {

constexpr int inputs = 14;

/// The three lobes' sum of M N as a function of everything it depends on.
template <class T>
T sum_of_lobes(const T (&x)[inputs], Fresnel fresnel) {
    FurParameters<1, T> p;
    p.eta = x[0], p.kappa = x[1], p.alpha = x[2], p.beta_m = x[3], p.beta_n = x[4], p.layers = x[5];
    p.sigma_ms = x[6], p.sigma_ma = x[7], p.sigma_ca[0] = x[8], p.g = x[9], p.fresnel = fresnel;
    const auto lobes = unscattered_lobes(p, x[10], x[11], x[12], x[13]);
    T sum = T(0);
    for (int k = 0; k < 3; ++k) sum = sum + lobes.M[k] * lobes.N[k][0];
    return sum;
}

FurParameters<3> random_fur(std::mt19937& random) {
    std::uniform_real_distribution<float> u(0, 1);
    FurParameters<3> p;
    p.eta = 1.01f + 1.49f * u(random), p.kappa = u(random), p.alpha = 0.2f * (u(random) - 0.5f);
    p.beta_m = 0.05f + u(random), p.beta_n = 0.05f + u(random), p.layers = 5 * u(random);
    p.sigma_ms = 3 * u(random), p.sigma_ma = u(random), p.g = 0.8f * u(random);
    for (float& s : p.sigma_ca) s = u(random);
    p.fresnel = u(random) < 0.5f ? Fresnel::bravais : Fresnel::exact;
    return p;
}

template <int Channels>
FurParameters<Channels, double> in_double(const FurParameters<Channels>& p) {
    FurParameters<Channels, double> q;
    q.eta = double(p.eta), q.kappa = double(p.kappa), q.alpha = double(p.alpha), q.beta_m = double(p.beta_m);
    q.beta_n = double(p.beta_n), q.layers = double(p.layers), q.sigma_ms = double(p.sigma_ms);
    q.sigma_ma = double(p.sigma_ma), q.g = double(p.g), q.fresnel = p.fresnel;
    for (int c = 0; c < Channels; ++c) q.sigma_ca[c] = double(p.sigma_ca[c]);
    return q;
}

}  // namespace

TEST_CASE(
    "unscattered lobes in double equal the reference implementation to double, in float the near field's to float",
    "[bcsdf]") {
    std::mt19937 random(21);
    std::uniform_real_distribution<float> u(0, 1);
    for (int i = 0; i < 2000; ++i) {
        FurParameters<3> p = random_fur(random);
        const float theta_i = 3.0f * (u(random) - 0.5f), theta_r = 3.0f * (u(random) - 0.5f), h = 2 * u(random) - 1;
        const float phi = 6.28f * (u(random) - 0.5f);
        const auto l = unscattered_lobes(in_double(p), double(theta_i), double(theta_r), double(phi), double(h));
        const auto r = reference::near_lobes(p, nullptr, double(theta_i), double(theta_r), double(phi), double(h));
        const auto f = unscattered_lobes(p, theta_i, theta_r, phi, h);
        const auto near = near_field(make_fibre(p, nullptr), Angles{theta_i, 0}, h).lobes(theta_r, phi);
        for (int k = 0; k < 3; ++k) {
            // Both edges 6 deviations away count as infinitely far: 2e-9. The theta series ends at its sixth term:
            // 6e-12.
            CHECK(l.M[k] == Approx(r.M[k]).epsilon(2.1e-9).margin(1e-14));
            for (int c = 0; c < 3; ++c) CHECK(l.N[k][c] == Approx(r.N[k][c]).epsilon(1e-11).margin(7e-12));
            // As 'near field equals the reference implementation in double' has it.
            const double tolerance = 4e-5 + 1.6e-5 / double(std::min(p.beta_m / 2, p.beta_n));
            CHECK(double(f.M[k]) == Approx(double(near.M[k])).epsilon(tolerance).margin(1e-10));
            for (int c = 0; c < 3; ++c)
                CHECK(double(f.N[k][c]) == Approx(double(near.N[k][c])).epsilon(tolerance).margin(1e-7));
        }
    }
}

TEST_CASE("derivatives by dual numbers equal finite differences", "[bcsdf]") {
    std::mt19937 random(22);
    std::uniform_real_distribution<double> u(0, 1);
    const char* names[inputs] = {"eta",      "kappa",    "alpha", "beta_m",  "beta_n",  "layers", "sigma_ms",
                                 "sigma_ma", "sigma_ca", "g",     "theta_i", "theta_r", "phi",    "h"};
    int seen[inputs] = {};
    for (int i = 0; i < 200; ++i) {
        const Fresnel fresnel = i % 2 ? Fresnel::exact : Fresnel::bravais;
        const double theta_i = 2.4 * (u(random) - 0.5), h = 1.8 * (u(random) - 0.5);
        const double x[inputs] = {1.2 + u(random),
                                  0.2 + 0.7 * u(random),
                                  0.2 * (u(random) - 0.5),
                                  0.2 + u(random),
                                  0.2 + u(random),
                                  0.1 + 3 * u(random),
                                  2 * u(random),
                                  u(random),
                                  u(random),
                                  0.3,
                                  theta_i,
                                  std::max(-1.5, std::min(1.5, 0.3 * (u(random) - 0.5) - theta_i)),
                                  6 * (u(random) - 0.5),
                                  h};
        const double index = std::sqrt(x[0] * x[0] - std::pow(std::sin(theta_i), 2)) / std::cos(theta_i);
        if (std::abs(std::abs(h) / index - x[1]) < 0.02) continue;  // s_m has a square root at the medulla's rim
        const double whole = sum_of_lobes(x, fresnel);
        for (int k = 0; k < inputs; ++k) {
            Dual y[inputs];
            for (int j = 0; j < inputs; ++j) y[j] = Dual(x[j], j == k ? 1.0 : 0.0);
            const Dual value = sum_of_lobes(y, fresnel);
            CHECK(value.v == Approx(whole).epsilon(1e-13));
            const auto at = [&](double step) {
                double z[inputs];
                std::copy(x, x + inputs, z);
                z[k] += step;
                return sum_of_lobes(z, fresnel);
            };
            // Fourth order: step^4 times a fifth derivative of up to (1 / 0.02)^5 at the rim, and 1e-15 / step.
            const double s = 1e-4, slope = (8 * (at(s) - at(-s)) - (at(2 * s) - at(-2 * s))) / (12 * s);
            INFO(names[k] << " of case " << i);
            CHECK(value.d == Approx(slope).epsilon(1e-6).margin(1e-9 + 1e-10 * whole));
            seen[k] += std::abs(value.d) > 1e-6;
        }
    }
    for (int k = 0; k < inputs; ++k)
        if (k != 9) CHECK(seen[k] > 50);  // g is the scattered lobes' alone
}

TEST_CASE("the exact Fresnel term is Marschner's pair of indices and the textbook's plane interface", "[bcsdf]") {
    for (double eta : {1.0001, 1.2, 1.55, 2.5})
        for (double theta_i : {0.0, 0.4, 1.2, 1.55})
            for (double h : {0.0, 0.3, 0.9, 0.999}) {
                const double s = std::sin(theta_i), prime = std::sqrt(eta * eta - s * s) / std::cos(theta_i);
                const double second = eta * eta / prime;  // eta'' of Marschner et al. 2003, Appendix B
                const double ci = std::sqrt((1 - h) * (1 + h)), ct = std::sqrt(1 - h * h / (prime * prime));
                const double rs = (ci - prime * ct) / (ci + prime * ct), rp = (second * ci - ct) / (second * ci + ct);
                double F1 = 0;
                for (double r : {rs, rp}) F1 += r * r / (1 + r * r);
                const auto F = [&](double layers) { return layers * F1 / (1 + (layers - 1) * F1); };
                const double incidence = std::acos(std::cos(theta_i) * ci);
                for (double layers : {0.0, 0.5, 1.0, 3.0}) {
                    const auto at = inclination(eta, std::cos(theta_i), Fresnel::exact);
                    const auto c = trace(at, 0.5, layers, h, ci).cuticle;
                    // Pair and textbook subtract numbers that differ by eta - 1 or by what acos loses at 0.
                    CHECK(c.F == Approx(F(layers)).epsilon(1e-9).margin(1e-12));
                    CHECK(c.F ==
                          Approx(reference::cuticle_reflectance(eta, incidence, layers)).epsilon(1e-6).margin(1e-12));
                    CHECK(c.F + c.T_ == Approx(1).epsilon(1e-14));
                    const auto at_float = inclination(float(eta), std::cos(float(theta_i)), Fresnel::exact);
                    const auto f = trace(at_float, 0.5f, float(layers), float(h), float(ci)).cuticle;
                    const auto d =
                        trace(inclination(double(float(eta)), double(std::cos(float(theta_i))), Fresnel::exact), 0.5,
                              double(float(layers)), double(float(h)), double(float(ci)))
                            .cuticle;
                    CHECK(double(f.F) == Approx(d.F).epsilon(3e-6));  // a dozen float operations, none that cancels
                    CHECK(double(f.T_) == Approx(d.T_).epsilon(3e-6));
                }
            }
    // At normal incidence both are one formula; at grazing light they are not.
    const auto difference = [](float theta_i) {
        const auto F = [&](Fresnel kind) {
            return trace(inclination(1.55f, std::cos(theta_i), kind), 0.5f, 1.0f, 0.5f, std::sqrt(0.75f)).cuticle.F;
        };
        return std::abs(F(Fresnel::exact) - F(Fresnel::bravais));
    };
    CHECK(difference(0.0f) == 0);
    CHECK(difference(1.2f) > 0.02f);
}
