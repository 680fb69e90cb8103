// Rays against strands and skins: places against the exact cylinder, what a ray starts on, and which sides are seen.
#include <catch2/catch.hpp>

#include "medulla/medulla.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla::render;

namespace {

const std::string sky = R"("lights": [{"light": "sky"}])";

std::string fibre(const std::string& points, float radius) {
    return "{" + tests::materials + R"(, "fibres": [{"material": "white", "radius": )" + std::to_string(radius) +
           R"(, "points": )" + points + "}], " + sky + "}";
}

Vec3 on_sphere(Sequence& random) {
    const float z = random.even(), a = 2 * pi_f * random(), r = std::sqrt(1 - z * z);
    return {r * std::cos(a), r * std::sin(a), z};
}

}  // namespace

TEST_CASE("a straight strand is the cylinder: distance and offset", "[render][geometry]") {
    const float radius = 0.01f;
    const Geometry geometry(parse_scene(fibre("[[0, -2, 0], [0, -0.7, 0], [0, 0.7, 0], [0, 2, 0]]", radius), "test"));
    Sequence random(1);
    int met = 0;
    for (int i = 0; i < 2000; ++i) {
        // A ray from a distance of 2 that passes the axis at offset h, at an inclination of up to 60 degrees.
        const float turn = 2 * pi_f * random(), h = 1.1f * random.even(), rise = 1.7f * random.even();
        const Vec3 across{std::cos(turn), 0, std::sin(turn)}, side{-across.z, 0, across.x};
        const Vec3 direction = normalise(Vec3{0, rise, 0} - across);
        const Vec3 through = h * radius * side;
        const float flat = std::sqrt(1 - direction.y * direction.y);
        const Ray ray{through - (2 / flat) * direction + Vec3{0, 0, 0}, direction, {}};
        const Hit hit = geometry.nearest(ray);
        if (std::abs(std::abs(h) - 1) < 1e-3f) continue;
        REQUIRE(bool(hit) == (std::abs(h) < 1));
        CHECK(geometry.blocked(ray, 10) == bool(hit));
        if (!hit) continue;
        ++met;
        const double exact = (2 - double(radius) * std::sqrt(1 - double(h) * double(h))) / double(flat);
        CHECK(hit.distance == Approx(exact).margin(1e-5));  // Embree finds roots of round curves to about 1e-6
        const StrandHit strand = geometry.strand_hit(hit);
        CHECK(std::abs(strand.tangent.y - 1) < 1e-6f);
        CHECK(strand.radius == Approx(radius).epsilon(1e-5));
        const Vec3 point = ray.origin + hit.distance * direction - strand.axis;
        CHECK(length(point) == Approx(radius).epsilon(2e-3));
        // The offset, by the runtime's own rule, is the signed distance of the ray from the axis.
        const float distance = dot(point, normalise(cross(direction, strand.tangent))) / radius;
        CHECK(std::abs(distance) == Approx(std::abs(h)).margin(2e-4));
    }
    CHECK(met > 1500);
}

TEST_CASE("a path that leaves a strand does not meet it where it leaves", "[render][geometry]") {
    const Geometry geometry(
        parse_scene(fibre("[[0, -2, 0], [0.1, -0.7, 0], [0.1, 0.7, 0], [0, 2, 0]]", 0.01f), "test"));
    Sequence random(2);
    int left = 0;
    for (int i = 0; i < 2000; ++i) {
        const Vec3 from = 3.0f * on_sphere(random), to{0.06f + 0.06f * random(), random.even(), 0.02f * random.even()};
        const Ray ray{from, normalise(to - from), {}};
        const Hit hit = geometry.nearest(ray);
        if (!hit) continue;
        const StrandHit strand = geometry.strand_hit(hit);
        const Vec3 position = from + hit.distance * ray.direction;
        for (int k = 0; k < 8; ++k) {
            const Vec3 away = on_sphere(random);
            if (std::abs(dot(away, strand.tangent)) > 0.99f) continue;  // along the curve: it may bend into its own way
            ++left;
            CHECK(!geometry.nearest({position, away, strand.start}));
        }
    }
    CHECK(left > 2000);
}

TEST_CASE("a strand that comes round is met at its other side", "[render][geometry]") {
    std::string points;
    for (int k = 0; k < 24; ++k) {  // most of a circle of radius 1 in the plane y = 0
        const float a = 2 * pi_f * float(k) / 26;
        points += (k == 0 ? "[[" : ", [") + std::to_string(std::cos(a)) + ", 0, " + std::to_string(std::sin(a)) + "]";
    }
    const Geometry geometry(parse_scene(fibre(points + "]", 0.02f), "test"));
    const Ray ray{{0, 0, 3}, {0, 0, -1}, {}};
    const Hit first = geometry.nearest(ray);
    REQUIRE(first);
    CHECK(first.distance == Approx(2 - 0.02).margin(0.02));  // the spline passes within 0.01 of its points
    const Vec3 position = ray.origin + first.distance * ray.direction;
    const Hit second = geometry.nearest({position, ray.direction, geometry.strand_hit(first).start});
    REQUIRE(second);
    CHECK(second.distance == Approx(2).margin(0.04));
}

TEST_CASE("skins are seen from outside, whole, and never by their own rays", "[render][geometry]") {
    for (const char* object :
         {R"({"shape": "sphere", "radius": 1})", R"({"shape": "torus", "radius": 1, "tube": 0.4})"}) {
        const Geometry geometry(parse_scene("{\"objects\": [" + std::string(object) + "], " + sky + "}", "test"));
        Sequence random(3);
        int seen = 0;
        for (int i = 0; i < 2000; ++i) {
            const Vec3 from = 4.0f * on_sphere(random), to = on_sphere(random);
            const Ray ray{from, normalise(Vec3{to.x, 0.2f * to.y, to.z} - from), {}};
            const Hit hit = geometry.nearest(ray);
            if (!hit) continue;
            ++seen;
            const SkinHit skin = geometry.skin_hit(hit);
            CHECK(dot(skin.facet_normal, ray.direction) < 0);
            CHECK(dot(skin.facet_normal, skin.normal) > 0.999f);
            CHECK(length(skin.position - (from + hit.distance * ray.direction)) < 1e-5f);
            const Hit back = geometry.nearest({skin.position, -ray.direction, skin.start});
            CHECK(!(back && back.distance < 1e-3f));
        }
        CHECK(seen > 500);
    }
}
