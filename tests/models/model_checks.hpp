// What every model must do, through its front door alone: energies, a pdf of integral 1, samples that follow it, no
// NaN.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

#include "medulla/detail/gauss_legendre.hpp"
#include "medulla/models/hit.hpp"
#include "tests/support/statistics.hpp"

namespace medulla::test {

/// Integral of f(theta, phi) cos theta over the sphere, phi in [-pi, pi]: 8 Gauss nodes in each of `rows` pieces of
/// theta, `columns` midpoints in phi, which are exact for what is smooth on the circle.
template <class F>
double sphere_integral(F&& f, int rows = 24, int columns = 256) {
    const detail::GaussRule rule = detail::gauss_rule(0);
    double sum = 0;
    for (int i = 0; i < rows; ++i)
        for (int a = 0; a < 2 * rule.half; ++a) {
            const double x = a & 1 ? double(rule.x[a / 2]) : -double(rule.x[a / 2]);
            const double theta = pi * ((i + 0.5 + 0.5 * x) / rows - 0.5);
            double row = 0;
            for (int j = 0; j < columns; ++j)
                row += double(f(Angles{float(theta), float(pi * (2 * (j + 0.5) / columns - 1))}));
            sum += double(rule.w[a / 2]) * std::cos(theta) * row;
        }
    return sum * pi / (2 * rows) * 2 * pi / columns;
}
/// What leaves, of a unit along the known direction.
template <class Field>
double energy_of(const Field& field, int rows = 24, int columns = 256, int channel = 0) {
    return sphere_integral([&](Angles w) { return field.value(w)[channel]; }, rows, columns);
}
template <class Field>
double pdf_integral(const Field& field, int rows = 24, int columns = 256) {
    return sphere_integral([&](Angles w) { return field.pdf(w); }, rows, columns);
}

struct Numbers {
    std::mt19937 engine;
    float uniform() { return float(engine() >> 8) * 0x1p-24f; }
    RandomNumbers draw() {
        RandomNumbers u;
        u.lobe = uniform(), u.azimuth = uniform(), u.longitude = uniform(), u.rows = uniform(), u.offset = uniform();
        return u;
    }
};

struct SampleChecks {
    double p = 0;         ///< p-value of counts in bins of (theta, phi) against the integrals of the pdf
    double p_broken = 0;  ///< the same with a pdf that is a tenth too wide along theta
    double energy = 0;    ///< mean weight of channel 0
    double error = 0;     ///< its standard error
    float most = 0;       ///< greatest weight
};

/// Draws `samples` directions for a hit of known azimuth 0. @param split quadrature pieces a bin and side
/// @param rounding most by which a pdf changes where its direction is rounded, relative: the slope of narrow lobes
template <class Field>
SampleChecks check_samples(const Field& field, unsigned seed, int samples, int split = 3, double rounding = 2e-3) {
    constexpr int rows = 18, columns = 24, n = rows * columns;
    std::vector<double> counts(n, 0.0), share(n, 0.0), broken(n, 0.0);
    const detail::GaussRule rule = detail::gauss_rule(0);
    for (int i = 0; i < rows * split; ++i)
        for (int j = 0; j < columns * split; ++j)
            for (int a = 0; a < 2 * rule.half; ++a)
                for (int b = 0; b < 2 * rule.half; ++b) {
                    const double x = a & 1 ? double(rule.x[a / 2]) : -double(rule.x[a / 2]),
                                 y = b & 1 ? double(rule.x[b / 2]) : -double(rule.x[b / 2]);
                    const double theta = pi * ((i + 0.5 + 0.5 * x) / (rows * split) - 0.5),
                                 phi = pi * (2 * (j + 0.5 + 0.5 * y) / (columns * split) - 1);
                    const double w = double(rule.w[a / 2]) * double(rule.w[b / 2]) / 4 * pi / (rows * split) * 2 * pi /
                                     (columns * split);
                    const auto bin = std::size_t(i / split * columns + j / split);
                    share[bin] += w * std::cos(theta) * double(field.pdf(Angles{float(theta), float(phi)}));
                    const double narrow = theta / 1.1;
                    broken[bin] += w / 1.1 * std::cos(narrow) * double(field.pdf(Angles{float(narrow), float(phi)}));
                }
    Numbers numbers{std::mt19937(seed)};
    SampleChecks result;
    double sum = 0, squares = 0;
    for (int s = 0; s < samples; ++s) {
        const Sample<3> drawn = field.sample(numbers.draw());
        const auto weight = double(drawn.weight[0]);
        sum += weight, squares += weight * weight;
        for (const float w : drawn.weight.value) result.most = std::max(result.most, w);
        if (!drawn.valid) continue;
        // What is drawn is what is evaluated, but for two roundings of the direction.
        const Evaluation<3> e = field.evaluate(drawn.angles);
        CHECK(e.pdf == Approx(drawn.pdf).epsilon(rounding));
        const int i = std::clamp(int((double(drawn.angles.theta) / pi + 0.5) * rows), 0, rows - 1),
                  j = std::clamp(int((double(drawn.angles.phi) / pi + 1) / 2 * columns), 0, columns - 1);
        counts[std::size_t(i * columns + j)] += 1;
    }
    result.p = chi_squared_p(counts, share, samples);
    result.p_broken = chi_squared_p(counts, broken, samples);
    result.energy = sum / samples;
    result.error = std::sqrt(std::max(0.0, squares / samples - result.energy * result.energy) / samples);
    return result;
}

/// Values, densities and samples are finite and not negative, for grazing and for random directions and for the ends of
/// every random number.
template <class MakeField>
void check_finite(MakeField&& make) {
    Numbers numbers{std::mt19937(3)};
    const auto check = [](const Evaluation<3>& e) {
        const bool fine = std::isfinite(e.pdf) && e.pdf >= 0 && std::isfinite(e.value[0]) && e.value[0] >= 0 &&
                          std::isfinite(e.value[2]) && e.value[2] >= 0;
        if (!fine) {
            INFO("pdf " << e.pdf << " value " << e.value[0] << " " << e.value[2]);
            CHECK(fine);
        }
        return fine;
    };
    const float grazing[] = {0, 1.5f, -1.57f, 1.57079625f};
    for (int i = 0; i < 200; ++i) {
        const Angles known = {i < 8 ? grazing[i % 4] : 3.1f * (numbers.uniform() - 0.5f), 6 * numbers.uniform() - 3};
        const float h = i % 5 == 0 ? (i % 2 ? 1.0f : -1.0f) : i % 5 == 1 ? 0.0f : 2 * numbers.uniform() - 1;
        const auto field = make(known, h);
        INFO("theta " << known.theta << " h " << h);
        for (int k = 0; k < 20; ++k) {
            const Angles drawn = {k < 8 ? grazing[k % 4] : 3.1f * (numbers.uniform() - 0.5f),
                                  k == 8   ? known.phi
                                  : k == 9 ? known.phi + float(pi)
                                           : 6 * numbers.uniform() - 3};
            INFO("drawn " << drawn.theta << " " << drawn.phi - known.phi);
            if (!check(field.evaluate(drawn))) return;
            RandomNumbers u = numbers.draw();
            if (k % 2) {
                const auto end = [&] { return numbers.uniform() < 0.5f ? 0.0f : 1.0f; };
                u = {end(), end(), end(), end(), end()};
            }
            const Sample<3> s = field.sample(u);
            const bool fine = std::isfinite(s.pdf) && std::isfinite(s.weight[0]) && s.weight[0] >= 0 &&
                              std::isfinite(s.direction.x + s.direction.y + s.direction.z);
            if (!fine) {
                INFO("sample " << u.lobe << " " << u.azimuth << " " << u.longitude << " " << u.rows << " " << u.offset);
                CHECK(fine);
                return;
            }
        }
    }
    // No direction, or none across: black.
    CHECK(make(Angles{float(pi / 2) + 1, 0}, 0.0f).value(Angles{0, 0})[0] == 0);
}

}  // namespace medulla::test
