// Pictures by statistics: light sampling against none, near against multi-scale, and the same bytes
// for any number of threads and after a kill. Bounds are standard errors of the pictures compared; fixed seeds.
#include <catch2/catch.hpp>

#include <cstdio>
#include <cstring>

#include "render/image_file.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla::render;
using tests::error_of_mean;
using tests::mean_luminance;
using tests::options;
using tests::picture;

namespace {

bool same_bytes(const Film& a, const Film& b) {
    return a.samples == b.samples && a.pixels.size() == b.pixels.size() &&
           std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Pixel)) == 0;
}

/// Two pictures of one scene have the same mean, to 4 standard errors of their difference (1 in 16000).
void same_mean(const Film& a, const Film& b, double allowed = 0) {
    const double error = std::hypot(error_of_mean(a), error_of_mean(b)), mean = mean_luminance(a);
    INFO("means " << mean << " and " << mean_luminance(b) << ", standard error " << error);
    CHECK(error < 0.02 * mean);  // or the comparison says nothing
    CHECK(std::abs(mean - mean_luminance(b)) < 4 * error + allowed * mean);
}

}  // namespace

TEST_CASE("lights that are sampled and lights that are met by chance make the same picture", "[render][lights]") {
    for (const char* lights : {R"([{"light": "rectangle", "centre": [2, 3, 1], "width": 3, "height": 3, "radiance": 5},
                                   {"light": "sky", "radiance": 0.3}])",
                               R"([{"light": "sun", "direction": [1, 2, 1], "diameter": 60, "irradiance": 3}])"}) {
        const Scene scene = parse_scene(tests::patch("fox", lights), "test");
        RenderOptions o = options(256);
        const Film with = picture(scene, o);
        o.path.sample_lights = false, o.seed = 1;
        same_mean(with, picture(scene, o));
    }
}

TEST_CASE("near, far and multi-scale fields of fur that is small in the pixel agree", "[render][field]") {
    const Scene scene = parse_scene(tests::patch("fox", R"([{"light": "rectangle", "centre": [2, 3, 1], "width": 3,
        "height": 3, "radiance": 5}, {"light": "sky", "radiance": 0.3}])"),
                                    "test");
    RenderOptions o = options(96);
    const Film one = picture(scene, o);
    for (const FieldChoice field : {FieldChoice::whole_width, FieldChoice::multiscale}) {
        o.path.field = field, o.seed = 2;
        same_mean(one, picture(scene, o), 0.01);  // hits of hidden fibres are not quite even in h: docs/render.md
    }
    o.path.averaged_vertices = 1000, o.seed = 3;  // every vertex of the path, not the first alone
    same_mean(one, picture(scene, o), 0.01);
}

TEST_CASE("the same bytes for any number of threads, and after a kill", "[render][bytes]") {
    const Scene scene = parse_scene(tests::patch("fox", tests::white_sky), "test");
    RenderOptions o = options(16);
    const Film one = picture(scene, o);
    o.threads = 2;
    CHECK(same_bytes(one, picture(scene, o)));
    o.seed = 5;
    CHECK(!same_bytes(one, picture(scene, o)));
    o.seed = 0;

    // What a killed run leaves is the film after a pass.
    const std::string path = "test_picture.unfinished";  // in the build folder, where ctest runs
    o.samples = 8, o.key = "this picture";
    save(picture(scene, o), o.key, path);
    o.samples = 16, o.resume = true, o.unfinished = path;
    CHECK(same_bytes(one, picture(scene, o)));
    o.key = "another";
    CHECK_THROWS_WITH(picture(scene, o), Catch::Contains(path) && Catch::Contains("same scene and options"));
    o.key = "this picture";
    if (std::FILE* file = std::fopen(path.c_str(), "r+b")) {
        std::fseek(file, 100, SEEK_SET), std::fputc(77, file), std::fclose(file);
    }
    CHECK_THROWS_WITH(picture(scene, o), Catch::Contains("damaged"));
    std::remove(path.c_str());
    CHECK(same_bytes(one, picture(scene, o)));  // no such file: from the start
}

TEST_CASE("the tone curve rises to 1 and stays there", "[render][tone]") {
    float before = 0;
    for (float x = 0; x < 9; x += 0.01f) {
        CHECK(filmic(x) >= before);
        before = filmic(x);
    }
    CHECK(filmic(0) == 0);
    CHECK(filmic(1) == Approx(0.8).epsilon(0.01));  // image_file.cpp
    for (const float x : {8.0f, 1e20f, std::numeric_limits<float>::infinity()}) CHECK(filmic(x) == 1);
}

TEST_CASE("an error that is asked for is reached, and no samples beyond it are spent", "[render][error]") {
    const Scene scene = parse_scene(tests::patch("fox", tests::white_sky), "test");
    RenderOptions o = options(4096);
    o.error = 0.1;
    const Film film = picture(scene, o);
    CHECK(film.error() <= 0.1);
    CHECK(film.samples < 4096);
    o.error = 0, o.samples = film.samples - samples_per_pass;
    CHECK(picture(scene, o).error() > 0.1);
}
