// Directions, offsets and coverage: what lies between a renderer's vectors and the model's angles.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "medulla/medulla.hpp"

using namespace medulla;

TEST_CASE("directions, offsets and coverage", "[bcsdf]") {
    for (float theta : {-1.5f, -0.3f, 0.0f, 1.2f})
        for (float phi : {-3.0f, 0.0f, 1.0f}) {
            const Vector w = direction_of(Angles{theta, phi});
            const Angles a = angles_of(w), scaled = angles_of(Vector{7 * w.x, 7 * w.y, 7 * w.z});
            CHECK(a.theta == Approx(theta).margin(2e-6));
            CHECK(a.phi == Approx(phi).margin(2e-6));
            CHECK(scaled.theta == Approx(theta).margin(2e-6));
        }
    CHECK(direction_of(Angles{0.3f, 0}).x < 0);  // theta > 0 is towards the root, x towards the tip
    // Light from +y travels towards -y; its left normal (counter-clockwise by 90 degrees) is -z.
    CHECK(offset_of(Vector{0, 1, 0}, Vector{0, 5, -0.3f}) == Approx(0.3));
    const Offsets c = pixel_coverage(0.8f, 2.0f, 4.0f, 0.9f);
    CHECK(c.low == Approx(0.8 - 0.225));
    CHECK(c.high == 1.0f);
    CHECK(pixel_coverage(0.1f, 1e9f, 1e-3f, 1.0f).low == -1.0f);
    // R of a ray at h > 0 leaves at phi = -2 gamma_i: on the side it came in on (left of the light when seen along it).
    const Fibre<3> fibre = make_fibre(parameters_of<3>(*find_preset("human")), nullptr);
    const NearField<3> near = near_field(fibre, Angles{0, 0}, 0.5f);
    CHECK(near.lobes(0.0f, -2 * std::asin(0.5f)).N[0][0] > 1e3f * near.lobes(0.0f, 2 * std::asin(0.5f)).N[0][0]);
}

TEST_CASE("a hit in vectors is the hit in angles", "[bcsdf]") {
    const Fibre<3> fibre = make_fibre(parameters_of<3>(*find_preset("bobcat")), nullptr);
    std::mt19937 random(8);
    std::uniform_real_distribution<float> u(-1, 1);
    for (int i = 0; i < 500; ++i) {
        const Angles known = {1.5f * u(random), 3 * u(random)}, drawn = {1.5f * u(random), 3 * u(random)};
        const float h = u(random);
        const Evaluation<3> a = near_field(fibre, known, h).evaluate(drawn),
                            v = near_field(fibre, direction_of(known), h).evaluate(direction_of(drawn));
        // 1e-6 of angle over the narrowest lobe, 0.1, at up to five deviations.
        CHECK(v.value[1] == Approx(a.value[1]).epsilon(2e-4).margin(1e-9));
        CHECK(v.pdf == Approx(a.pdf).epsilon(2e-4).margin(1e-9));
    }
}

TEST_CASE("light and camera turned about the fibre together see the same", "[bcsdf]") {
    const Fibre<3> fibre = make_fibre(parameters_of<3>(*find_preset("bobcat")), nullptr);
    const Angles known = {0.4f, 0.3f}, drawn = {-0.3f, 2.8f};
    const float value = near_field(fibre, known, 0.3f).value(drawn)[1];
    for (float turn : {0.5f, 2.0f, -3.0f, 6.2831853f}) {
        const Angles k = {known.theta, known.phi + turn}, d = {drawn.theta, drawn.phi + turn};
        CHECK(near_field(fibre, k, 0.3f).value(d)[1] == Approx(value).epsilon(2e-4));  // as above
        CHECK(near_field(fibre, direction_of(k), 0.3f).value(direction_of(d))[1] == Approx(value).epsilon(2e-4));
    }
    // Seen from the other side, the fibre is its mirror image.
    CHECK(near_field(fibre, Angles{known.theta, -known.phi}, -0.3f).value(Angles{drawn.theta, -drawn.phi})[1] ==
          Approx(value).epsilon(2e-4));
}
