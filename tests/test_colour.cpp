// Colours to absorption and back; pigments and units; one random number as several.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <set>

#include "medulla/colour.hpp"
#include "medulla/random.hpp"

using namespace medulla;

namespace {

/// A strand's albedo by following light crossing by crossing, in double, midpoints in theta and gamma_i.
double strand_by_crossings(const FurParameters<1>& f, double sigma_ca) {
    constexpr int inclinations = 60, offsets = 200;
    const double kappa = double(f.kappa), ms = double(f.sigma_ms), ma = double(f.sigma_ma);
    double energy = 0, width = 0;
    for (int i = 0; i < inclinations; ++i)
        for (int k = 0; k < offsets; ++k) {
            const double theta = pi / 2 * (i + 0.5) / inclinations, gamma = pi / 2 * (k + 0.5) / offsets;
            const double weight = std::cos(theta) * std::cos(theta) * std::cos(gamma);
            const auto at = detail::inclination(double(f.eta), std::cos(theta), f.fresnel);
            const auto path = detail::trace(at, kappa, double(f.layers), std::sin(gamma), std::cos(gamma));
            const double F = path.cuticle.F, straight = 2 * path.s_m * at.inverse_cos_t;
            const double cortex = std::exp(-2 * path.s_c * at.inverse_cos_t * sigma_ca);
            const double unscattered = std::exp(-straight * (ms + ma)) * cortex;
            const double scattered = (1 - std::exp(-straight * ms)) * std::sqrt(cortex) *
                                     std::exp(-(kappa * ma + (1 - kappa) * sigma_ca) * at.inverse_cos_t);  // Eq. 20
            double out = F, inside = 1 - F;
            for (int crossing = 0; crossing < 400; ++crossing) {
                out += inside * ((1 - F) * unscattered + scattered);
                inside *= F * unscattered;
            }
            energy += weight * out, width += weight;
        }
    return energy / width;
}

}  // namespace

TEST_CASE("A strand's albedo is the energy of its lobes") {
    for (const FurPreset& preset : fur_presets)
        for (const float sigma_ca : {0.0f, 0.1f, 1.0f, 5.0f}) {
            const FibreAlbedo fibre(parameters_of<1>(preset));
            INFO(preset.name << " " << sigma_ca);
            // 3e-3: 16 offsets across the kink at the medulla's rim.
            CHECK(double(fibre.strand(sigma_ca)) ==
                  Approx(strand_by_crossings(parameters_of<1>(preset), double(sigma_ca))).epsilon(3e-3));
            CHECK(fibre.fur(sigma_ca) < fibre.strand(sigma_ca));
            CHECK(fibre.fur(sigma_ca + 0.1f) < fibre.fur(sigma_ca));
        }
}

TEST_CASE("White fibres return everything, alone and in a coat") {
    for (const FurPreset& preset : fur_presets) {
        FurParameters<1> p = parameters_of<1>(preset);
        p.sigma_ma = 0;
        const FibreAlbedo fibre(p);
        CHECK(fibre.strand(0) == Approx(1).margin(2e-6));
        CHECK(fibre.fur(0) > 0.996f);  // 2.3 times the square root of what a strand is short of 1
    }
}

TEST_CASE("The half-space's albedo is Chandrasekhar's for isotropic scattering") {
    for (const double albedo : {0.3, 0.6, 0.9, 0.99}) {
        // H by iteration of 1/H(mu) = sqrt(1 - albedo) + albedo/2 int mu' H(mu') / (mu + mu') dmu'; R = 1 - 2 sqrt(1 -
        // albedo) int mu H dmu.
        constexpr int n = 200;
        double H[n], next[n];
        std::fill(H, H + n, 1.0);
        const double root = std::sqrt(1 - albedo);
        for (int iteration = 0; iteration < 200; ++iteration) {
            for (int i = 0; i < n; ++i) {
                double sum = 0;
                for (int k = 0; k < n; ++k) sum += (k + 0.5) * H[k] / (i + k + 1.0) / n;
                next[i] = 1 / (root + albedo / 2 * sum);
            }
            std::copy(next, next + n, H);
        }
        double moment = 0;
        for (int k = 0; k < n; ++k) moment += (k + 0.5) / n * H[k] / n;
        // Between its two exact ends the form is at most 0.4 % off.
        CHECK(double(detail::half_space_albedo(float(albedo), 0)) == Approx(1 - 2 * root * moment).epsilon(0.005));
    }
}

TEST_CASE("A colour's sigma_ca gives that colour, or says why not") {
    for (const FurPreset& preset : fur_presets) {
        const FurParameters<3> p = parameters_of<3>(preset);
        const FibreAlbedo fibre(p);
        for (const float level : {0.05f, 0.1f, 0.2f, 0.4f, 0.6f, 0.8f, 0.9f}) {
            const float colour[3] = {level, 0.5f * level, 0.25f * level};
            const SigmaOfColour<3> fur = sigma_ca_of_fur_colour(p, colour);
            const SigmaOfColour<3> strand = sigma_ca_of_strand_colour(p, colour);
            for (int c = 0; c < 3; ++c) {
                INFO(preset.name << " " << colour[c]);
                if (fur.status[c] == ColourStatus::ok) {
                    CHECK(fibre.fur(fur.sigma_ca[c]) == Approx(colour[c]).epsilon(1e-4));
                } else if (fur.status[c] == ColourStatus::too_bright) {
                    CHECK(fibre.fur(0) < colour[c]);
                    CHECK(fur.sigma_ca[c] == 0);
                } else {
                    REQUIRE(fur.status[c] == ColourStatus::too_dark);
                    CHECK(fibre.fur(largest_sigma_ca) > colour[c]);
                }
                if (strand.status[c] == ColourStatus::ok)
                    CHECK(fibre.strand(strand.sigma_ca[c]) == Approx(colour[c]).epsilon(1e-4));
            }
        }
    }
    FurParameters<3> p = parameters_of<3>(fur_presets[0]);
    const float odd[3] = {0, std::numeric_limits<float>::quiet_NaN(), 1.5f};
    const SigmaOfColour<3> answer = sigma_ca_of_fur_colour(p, odd);
    CHECK(answer.status[0] == ColourStatus::too_dark);
    CHECK(answer.sigma_ca[0] == largest_sigma_ca);
    CHECK(answer.status[1] == ColourStatus::bad_colour);
    CHECK(answer.status[2] == ColourStatus::bad_colour);
    p.kappa = 1.2f;
    const float grey[3] = {0.2f, 0.2f, 0.2f};
    CHECK(sigma_ca_of_fur_colour(p, grey).status[0] == ColourStatus::bad_parameters);
    p = parameters_of<3>(fur_presets[0]);
    p.sigma_ca[1] = -1;  // not read
    CHECK(sigma_ca_of_fur_colour(p, grey).status[1] == ColourStatus::ok);
}

TEST_CASE("Pigments and units") {
    FurParameters<3> p;
    set_melanin(p, 1.3f, 0.2f);
    CHECK(p.sigma_ca[0] == Approx(0.5821));
    CHECK(p.sigma_ca[2] == Approx(1.991));
    CHECK(per_radius(10, 80) == Approx(0.4));  // 10 / mm over 40 micrometres
    CHECK(in_radii(30, 80) == Approx(0.75));
}

TEST_CASE("One random number as several: even, well spread, never 0 or 1") {
    std::set<std::pair<int, int>> cells;
    for (int i = 0; i < 1024; ++i) {
        const Stretched<2> s = stretch<2>((float(i) + 0.5f) / 1024);
        cells.insert({int(s.u[0] * 32), int(s.u[1] * 32)});
    }
    CHECK(cells.size() == 1024);  // one point in each cell of 32 x 32
    for (const float u : {0.0f, 0.99999994f, 1.0f, std::numeric_limits<float>::quiet_NaN(), -1.0f, 2.0f})
        for (const float v : stretch<3>(u).u) CHECK((v > 0 && v < 1));
    std::set<float> values;
    for (int i = 0; i < 1 << 16; ++i) values.insert(stretch<2>(float(i) / float(1 << 16)).u[0]);
    CHECK(values.size() == 256);  // half of 16 bits
    CHECK(stretch<2>(std::uint32_t(0xffffffffu)).u[1] == 65535.5f / 65536);
    CHECK(stretch<1>(std::uint32_t(0xffffffffu)).u[0] < 1);
    CHECK(reuse(0.3f, 0.2f, 0.6f) == Approx(0.25));
    CHECK(reuse(0.6000001f, 0.2f, 0.6f) == 1);
}
