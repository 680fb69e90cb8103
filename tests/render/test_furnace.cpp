// The white furnace: what absorbs nothing cannot be told from the white sky behind it.
#include <catch2/catch.hpp>

#include "tests/render/scenes.hpp"

using namespace medulla::render;
using tests::error_of_mean;
using tests::mean_luminance;
using tests::options;
using tests::picture;

TEST_CASE("white furnace: a fibre that absorbs nothing cannot be seen before a white sky", "[render][furnace]") {
    const std::string text = R"({"camera": {"from": [0.3, 0.2, 3], "to": [0, 0, 0], "fov": 12},
        "picture": {"width": 16, "height": 16}, )" +
                             tests::materials + R"(,
        "fibres": [{"material": "white", "radius": 0.2, "points": [[-0.2, -2, 0], [0, -0.6, 0], [0, 0.6, 0], [-0.2, 2, 0]]}],
        "lights": )" + tests::white_sky +
                             "}";
    const Scene scene = parse_scene(text, "test");
    for (const FieldChoice field : {FieldChoice::one_offset, FieldChoice::whole_width, FieldChoice::multiscale}) {
        RenderOptions o = options(64);
        o.path.field = field;
        Counts counts;
        const Film film = picture(scene, o, &counts);
        INFO("field " << int(field) << ": mean " << mean_luminance(film) << " +- " << error_of_mean(film));
        CHECK(counts.vertices > 16 * 16 * 64 / 3);
        CHECK(counts.nonfinite == 0);
        CHECK(std::abs(mean_luminance(film) - 1) < 4 * error_of_mean(film) + 2e-5);  // far: its quadrature
    }
}

TEST_CASE("white furnace: nor where the index alone changes along the strand", "[render][furnace]") {
    for (const float root : {1.4f, 1.6f}) {
        Scene scene = parse_scene(tests::patch("white", tests::white_sky, 100), "test");
        scene.materials[1].fur = scene.materials[0].fur;
        scene.materials[0].fur.eta = root, scene.materials[1].fur.eta = 3 - root;
        scene.objects[0].coat[0].along = {{0, 0}, {1, 1}};
        RenderOptions o = options(16);
        o.path.sample_lights = false;
        Counts counts;
        CHECK(mean_luminance(picture(scene, o, &counts)) == Approx(1).margin(1e-3));
        CHECK(counts.clamped == 0);
    }
}

TEST_CASE("white furnace: nor can a coat of them on a white skin", "[render][furnace]") {
    const Scene scene = parse_scene(tests::patch("white", tests::white_sky), "test");
    RenderOptions o = options(32);
    const Film film = picture(scene, o);
    INFO("mean " << mean_luminance(film) << " +- " << error_of_mean(film));
    CHECK(error_of_mean(film) < 0.01);
    CHECK(std::abs(mean_luminance(film) - 1) < 4 * error_of_mean(film));
    o.path.sample_lights = false;  // then every sample is 1 by itself, to the rounding of its weights
    CHECK(mean_luminance(picture(scene, o)) == Approx(1).margin(1e-3));
}
