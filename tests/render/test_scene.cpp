// Scene files: what is taken, and one line for everything that is not.
#include <catch2/catch.hpp>

#include "render/error.hpp"
#include "render/groom.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla;
using namespace medulla::render;

namespace {

std::string refusal(const std::string& text) {
    try {
        parse_scene(text, "s.json");
    } catch (const Error& error) {
        return error.what();
    }
    return "accepted";
}

/// A whole scene with `object` for its one sphere.
std::string with(const std::string& object, const std::string& rest = "") {
    return "{" + tests::materials + R"(, "objects": [)" + object + R"(], "lights": [{"light": "sky"}])" + rest + "}";
}

}  // namespace

TEST_CASE("a bad scene is refused in one line that names file, field, expected and found", "[render][scene]") {
    const std::string coat = R"({"coat": [{"material": "fox", "density": 10}]})";
    REQUIRE(refusal(with(coat)) == "accepted");
    const struct {
        std::string scene;
        std::vector<std::string> says;
    } cases[] = {
        {"", {"expected JSON"}},
        {"[]", {"/", "expected an object", "found []"}},
        {std::string(20, '[') + std::string(20, ']'), {"levels of JSON"}},
        {R"({"lights": [{"light": "sky"}]})", {"/objects", "found none"}},
        {with(coat, R"(, "camera": {"fov": 0})"), {"/camera/fov", "[0.01, 170]", "found 0"}},
        {with(coat, R"(, "camera": {"from": [0, 0], "to": [0, 0, 0]})"), {"/camera/from", "three numbers", "[0,0]"}},
        {with(coat, R"(, "camera": {"from": [1, 1, 1], "to": [1, 1, 1]})"), {"/camera/to"}},
        {with(coat, R"(, "camera": {"from": [0, 4, 0], "to": [0, 0, 0]})"), {"/camera/up", "across the view"}},
        {with(coat, R"(, "picture": {"width": 1.5})"), {"/picture/width", "whole number", "1.5"}},
        {with(coat, R"(, "picture": {"width": 20000})"), {"/picture/width", "[1, 16384]", "20000"}},
        {with(coat, R"(, "picture": {"tone": "nice"})"), {"/picture/tone", "filmic, srgb", "nice"}},
        {with(coat, R"(, "extra": 1)"), {"/extra", "no such field", "camera", "lights"}},
        {with(R"({"shape": "cube"})"), {"/objects/0/shape", "patch, sphere, torus", "cube"}},
        {with(R"({"radius": -1})"), {"/objects/0/radius", "> 0", "found -1"}},
        {with(R"({"radius": 1e-99})"), {"/objects/0/radius", "> 0", "found 1e-99"}},
        {with(R"({"radius": "one"})"), {"/objects/0/radius", "\"one\""}},
        {with(R"({"shape": "torus", "radius": 1, "tube": 2})"), {"/objects/0/tube", "(0, 1]", "found 2"}},
        {with(R"({"skin": [0, 0.5, 1.5]})"), {"/objects/0/skin/2", "[0, 1]", "found 1.5"}},
        {with(R"({"coat": [{"material": "cat"}]})"), {"/objects/0/coat/0/material", "white, fox", "cat"}},
        {with(R"({"coat": [{"density": 1}]})"), {"/objects/0/coat/0/material", "along"}},
        {with(R"({"coat": "thick"})"), {"/objects/0/coat", "/coats", "thick"}},
        {with(R"({"coat": "thick"})", R"(, "coats": {"thick": [{"density": 1}]})"), {"/coats/thick/0/material"}},
        {with(R"({"coat": "thick"})", R"(, "coats": {"thick": 7})"), {"/coats/thick", "expected a list", "7"}},
        {with(R"({"coat": [{"along": [[0, "fox"], [0, "white"]]}]})"), {"/coat/0/along/1/0", "> 0", "found 0"}},
        {with(R"({"coat": [{"along": [[0, "fox", 3]]}]})"), {"/coat/0/along/0", "place along the strand"}},
        {with(R"({"coat": [{"material": "fox", "length": 0}]})"), {"/coat/0/length", "> 0", "found 0"}},
        {with(R"({"coat": [{"material": "fox", "lenght": 1}]})"), {"/coat/0/lenght", "no such field", "length"}},
        {with(R"({"coat": [{"material": "fox", "segments": 0}]})"), {"/coat/0/segments", "[1, 256]"}},
        {R"({"materials": [{"name": "a", "preset": "wolf"}]})", {"/materials/0/preset", "bobcat", "wolf"}},
        {R"({"materials": [{"name": "a", "eta": 1}]})", {"/materials/0/eta", "(1, 10]", "found 1"}},
        {R"({"materials": [{"name": "a", "scattering": "mended"}]})",
         {"/materials/0/scattering", "corrected", "mended"}},
        {R"({"materials": [{"name": "a"}, {"name": "b", "scattering": "corrected"}],
             "objects": [{"coat": [{"along": [[0, "a"], [1, "b"]]}]}]})",
         {"/along/1/1", "scattering", "b"}},
        {R"({"materials": [{"eta": 1.5}]})", {"/materials/0/name", "found none"}},
        {R"({"fibres": [{"material": "x", "points": []}]})", {"/fibres/0/material", "no materials"}},
        {with(coat, R"(, "fibres": [{"material": "fox", "points": [[0, 0, 0]]}])"), {"/fibres/0/points", "two points"}},
        {with(coat, R"(, "fibres": [{"material": "fox", "points": [[0, 0, 0], [0, 0, 0]]}])"), {"/fibres/0/points/1"}},
        {"{" + tests::materials + R"(, "objects": [{}], "lights": []})", {"/lights", "at least one light"}},
        {"{" + tests::materials + R"(, "objects": [{}], "lights": [{"light": "sun", "direction": [0, 0, 0]}]})",
         {"/lights/0/direction", "length 0"}},
    };
    for (const auto& c : cases) {
        const std::string line = refusal(c.scene);
        INFO(c.scene << "\n" << line);
        CHECK(line.substr(0, 8) == "s.json: ");
        CHECK(line.find('\n') == std::string::npos);
        for (const std::string& part : c.says) CHECK(line.find(part) != std::string::npos);
    }
    CHECK_THROWS_WITH(read_scene("/nowhere/s.json"),
                      Catch::Contains("/nowhere/s.json") && Catch::Contains("No such file"));
}

TEST_CASE("a coat of more strands than Embree counts is refused before any grows", "[render][groom]") {
    Shape shape;
    Layer layer;
    layer.density = 1e9f;
    CHECK_THROWS_WITH(grow(shape, layer), Catch::Contains("at most 4.77e+08 strands, found 1.26e+10"));
    shape.radius = 1e9f;
    CHECK_THROWS_WITH(grow(shape, layer), Catch::Contains("found 1.26e+28"));
    // Clumps smaller than any strand: as many as there are strands, each with its own.
    shape.radius = 1, layer.density = 20, layer.clump_size = 1e-30f;
    CHECK(grow(shape, layer).count() == 251);
}

TEST_CASE("roots keep their distance and number", "[render][groom]") {
    for (const Form form : {Form::patch, Form::sphere, Form::torus}) {
        Shape shape;
        shape.form = form;
        const float density = 300 / area_of(shape), distance = std::sqrt(0.53f / density);
        const auto roots = poisson_disc(shape, distance, 300, 7);
        float least = 1e9f;
        for (std::size_t i = 0; i < roots.size(); ++i)
            for (std::size_t j = 0; j < i; ++j) least = std::min(least, length(roots[i].position - roots[j].position));
        CHECK(least >= distance);
        CHECK(roots.size() == 300);  // 0.53 is below the 0.69 at which random darts saturate
        for (const SurfacePoint& root : roots) CHECK(length(root.normal) == Approx(1).epsilon(1e-6));
    }
}
