// Coats of baked fibres: energy, two ways to the same picture, and what a scene may not say of them.
#include <catch2/catch.hpp>
#include <fstream>

#include "medulla/default_pack.hpp"

#include "tests/render/scenes.hpp"
#include "tests/support/small_bake.hpp"

using namespace medulla::render;
using tests::error_of_mean;
using tests::mean_luminance;
using tests::options;
using tests::picture;

namespace {

/// A square of the dog's fur, whose medulla does not absorb. The pack is in the build folder, where ctest runs.
std::string baked_patch(const std::string& fields, const std::string& lights, const std::string& layer = "") {
    static const bool written = [] {
        const std::vector<unsigned char>& bytes = medulla::test::baked_preset("dog");
        std::ofstream("test_baked.furpack", std::ios::binary)
            .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        return true;
    }();
    REQUIRE(written);
    return R"({"camera": {"from": [0, 3, 4], "to": [0, 0.1, 0], "fov": 8}, "picture": {"width": 12, "height": 12},
               "materials": [{"name": "dog", "baked": "test_baked.furpack")" +
           fields +
           R"(}], "objects": [{"shape": "patch", "width": 3, "depth": 3, "skin": 1, "coat": [{"material": "dog",
               "density": 400, "length": 0.25, "radius": 0.008, "lean": 20, "bend": 30, "noise": 10)" +
           layer + "}]}], \"lights\": " + lights + "}";
}

}  // namespace

TEST_CASE("white furnace: nor can a coat of baked fibres without absorption", "[render][furnace][bake]") {
    const Scene scene = parse_scene(baked_patch(R"(, "sigma_ca": 0)", tests::white_sky), "test");
    for (const FieldChoice field : {FieldChoice::one_offset, FieldChoice::whole_width, FieldChoice::multiscale}) {
        RenderOptions o = options(16);
        o.path.field = field;
        o.path.sample_lights = false;  // then every sample is near to 1 by itself
        const Film film = picture(scene, o);
        INFO("field " << int(field) << ": mean " << mean_luminance(film) << " +- " << error_of_mean(film));
        CHECK(film.nonfinite == 0);
        CHECK(error_of_mean(film) < 0.02);
        CHECK(std::abs(mean_luminance(film) - 1) < 4 * error_of_mean(film) + 1e-3);
    }
}

TEST_CASE("baked fibres: with and without light samples, near and far the same picture", "[render][bake]") {
    const Scene scene = parse_scene(baked_patch("", R"([{"light": "sky", "radiance": 0.3},
        {"light": "rectangle", "centre": [0, 4, -2], "width": 4, "height": 4, "radiance": 3}])"),
                                    "test");
    RenderOptions o = options(64);
    const Film one = picture(scene, o);
    const auto same = [&](const Film& other) {
        const double a = mean_luminance(one), b = mean_luminance(other),
                     error = std::hypot(error_of_mean(one), error_of_mean(other));
        INFO(a << " and " << b << " +- " << error);
        CHECK(error < 0.03 * a);
        CHECK(std::abs(a - b) < 4 * error + 0.01 * a);  // hits of hidden fibres are not quite even in h
    };
    o.path.sample_lights = false, o.seed = 1;
    same(picture(scene, o));
    o.path.sample_lights = true, o.path.field = FieldChoice::whole_width, o.seed = 2;
    same(picture(scene, o));
}

TEST_CASE("baked fibres: colour is free, all else is refused in one line", "[render][bake]") {
    const Scene own = parse_scene(baked_patch("", tests::white_sky), "test");
    CHECK(own.materials[0].fur.eta == medulla::find_preset("dog")->eta);
    const Scene red = parse_scene(baked_patch(R"(, "sigma_ca": [0.1, 0.5, 1])", tests::white_sky), "test");
    CHECK(red.materials[0].fur.sigma_ca[2] == 1.0f);
    CHECK_THROWS_WITH(parse_scene(baked_patch(R"(, "kappa": 0.5)", tests::white_sky), "test"),
                      Catch::Contains("kappa"));
    const auto replaced = [](std::string text, const std::string& name) {
        return text.replace(text.find("test_baked.furpack"), 18, name);
    };
    const std::string text = baked_patch("", tests::white_sky);
    CHECK_THROWS_WITH(parse_scene(replaced(text, "none.furpack"), "test"), Catch::Contains("none.furpack"));
    std::ofstream("test_other.furpack", std::ios::binary)
        .write(reinterpret_cast<const char*>(medulla::default_pack_words), medulla::default_pack_size);
    CHECK_THROWS_WITH(parse_scene(replaced(text, "test_other.furpack"), "test"),
                      Catch::Contains("/materials/0/baked") && Catch::Contains("FURBAKE"));
    PathOptions options;
    options.lobes = 1;
    CHECK_THROWS_WITH(PathTracer(own, options), Catch::Contains("--lobes"));
}
