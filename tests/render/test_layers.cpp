// Layers of a picture: that they add up to it, that each is what it is called, and that none changes it.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstring>
#include <map>

#include "medulla/fur_parameters.hpp"
#include "render/image_file.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla::render;

namespace {

Film with_layers(const Scene& scene, const RenderOptions& o) {
    Film film(scene.picture.width, scene.picture.height, true);
    const PathTracer tracer(scene, o.path);
    render(tracer, o, film, [](double) {});
    return film;
}

/// One straight fibre up y that fills the picture's middle: nothing that it scatters meets it again.
Scene lone_fibre(const std::string& lights) {
    return parse_scene(R"({"camera": {"from": [0, 1, 8], "to": [0, 0, 0], "fov": 2},
        "picture": {"width": 12, "height": 6}, )" +
                           tests::materials + R"(,
        "fibres": [{"material": "fox", "radius": 0.1, "points": [[0, -3, 0], [0, 3, 0]]}], "lights": )" +
                           lights + "}",
                       "test");
}

double mean_of(const Film& film, int lobe) {
    double sum = 0;
    for (const Layers& l : film.layers) sum += double(luminance(l.lobe[lobe]));
    return sum / film.samples / double(film.layers.size());
}

std::map<std::string, std::vector<float>> channels_of(const std::string& path) {
    Imf::InputFile file(path.c_str());
    const Imath::Box2i window = file.header().dataWindow();
    const auto width = std::size_t(window.max.x + 1), height = std::size_t(window.max.y + 1);
    std::map<std::string, std::vector<float>> channels;
    Imf::FrameBuffer buffer;
    for (auto c = file.header().channels().begin(); c != file.header().channels().end(); ++c) {
        std::vector<float>& plane = channels[c.name()];
        plane.resize(width * height);
        buffer.insert(c.name(), Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(plane.data()), sizeof(float),
                                           width * sizeof(float)));
    }
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    return channels;
}

}  // namespace

TEST_CASE("layers add up to the picture, which is the same bytes without them", "[render][layers]") {
    const Scene scene = parse_scene(tests::patch("fox", R"([{"light": "rectangle", "centre": [2, 3, 1], "width": 3,
        "height": 3, "radiance": 5}, {"light": "sky", "radiance": 0.3}])"),
                                    "test");
    for (const FieldChoice field : {FieldChoice::one_offset, FieldChoice::whole_width, FieldChoice::multiscale}) {
        RenderOptions o = tests::options(24);
        o.path.field = field;
        const Film plain = tests::picture(scene, o), film = with_layers(scene, o);
        CHECK(std::memcmp(plain.pixels.data(), film.pixels.data(), film.pixels.size() * sizeof(Pixel)) == 0);
        double indirect = 0;
        for (std::size_t i = 0; i < film.pixels.size(); ++i) {
            const Layers& l = film.layers[i];
            Rgb sum;
            for (const Rgb& lobe : l.lobe) sum += lobe;
            const double* all = film.pixels[i].sum;
            // 7 sums of 24 samples' vertices in floats: some 200 roundings of 6e-8 that partly cancel.
            CHECK(double(sum.x) == Approx(all[0]).epsilon(5e-6));
            CHECK(double(sum.y) == Approx(all[1]).epsilon(5e-6));
            CHECK(double(sum.z) == Approx(all[2]).epsilon(5e-6));
            CHECK(double(l.direct.y) <= all[1] * (1 + 5e-6));
            indirect += all[1] - double(l.direct.y);
            CHECK(l.hit == 24);
        }
        CHECK(indirect > 0.05 * tests::mean_luminance(film) * double(film.pixels.size()) * 24);
        o.threads = 2;
        const Film two = with_layers(scene, o);
        CHECK(std::memcmp(two.layers.data(), film.layers.data(), film.layers.size() * sizeof(Layers)) == 0);
    }
}

TEST_CASE("each lobe's layer is the picture of that lobe alone", "[render][layers]") {
    const Scene scene = lone_fibre(R"([{"light": "sun", "direction": [1, 0.3, 1.5], "diameter": 10, "irradiance": 2},
        {"light": "sun", "direction": [0.2, -0.2, -1], "diameter": 10, "irradiance": 1}])");
    RenderOptions o = tests::options(1024);
    const Film film = with_layers(scene, o);
    CHECK(mean_of(film, Layers::other) == 0);
    for (const Layers& l : film.layers) {
        Rgb sum;
        for (const Rgb& lobe : l.lobe) sum += lobe;
        CHECK(length(sum - l.direct) <= 1e-5f * length(sum));  // all of it is direct
    }
    for (int k = 0; k < 6; ++k) {
        RenderOptions alone = o;
        alone.path.lobes = 1u << k, alone.seed = 3;
        const Film one = tests::picture(scene, alone);
        const double error = tests::error_of_mean(one);
        INFO(medulla::lobe_names[k] << ": " << mean_of(film, k) << " and " << tests::mean_luminance(one) << " +- "
                                    << error);
        CHECK(tests::mean_luminance(one) > 0);
        CHECK(error < 0.05 * tests::mean_luminance(one));
        // The lobe's share of the sum has no more than the sum's error: sqrt(2) standard errors of either, 4 times.
        const double both = std::hypot(error, tests::error_of_mean(film));
        CHECK(std::abs(mean_of(film, k) - tests::mean_luminance(one)) < 4 * both);
    }
}

TEST_CASE("normals, tangents, depth, albedo and coverage are those of the fibre", "[render][layers]") {
    const Scene scene = lone_fibre(tests::white_sky);
    const Film film = with_layers(scene, tests::options(64));
    std::size_t covered = 0;
    for (std::size_t i = 0; i < film.layers.size(); ++i) {
        const Layers& l = film.layers[i];
        if (l.hit == 0) {
            CHECK(length(l.normal) + length(l.tangent) + length(l.albedo) + l.depth == 0);
            CHECK(luminance(l.lobe[Layers::other]) == Approx(64).epsilon(1e-6));  // the sky
            continue;
        }
        ++covered;
        const float n = 1 / l.hit;
        CHECK(n * l.tangent.y == Approx(1).epsilon(1e-5));
        CHECK(std::abs(l.normal.y) < 1e-3f * l.hit);
        CHECK(l.normal.z > 0);
        // The camera is at (0, 1, 8), the axis at distance 8 or so, its near side up to 0.1 before it.
        const float slant = std::sqrt(65.0f);
        CHECK(n * l.depth > slant - 0.25f);
        CHECK(n * l.depth < slant + 0.15f);
        CHECK(greatest(n * l.albedo) < 1);
        CHECK(l.albedo.x > l.albedo.z);  // sigma_ca rises from red to blue
        // Before a white sky a fibre is as bright as its albedo, up to noise.
        if (l.hit == 64) CHECK(float(film.pixels[i].sum[1]) == Approx(l.albedo.y).epsilon(0.1));
    }
    CHECK(covered > 20);
}

TEST_CASE("an EXR has the layers under their names, and a kill loses none", "[render][layers]") {
    const Scene scene = parse_scene(tests::patch("fox", tests::white_sky), "test");
    RenderOptions o = tests::options(16);
    const Film film = with_layers(scene, o);
    const std::string path = "test_layers.exr", unfinished = "test_layers.unfinished";  // in the build folder
    write_exr(film, path);
    const auto channels = channels_of(path);
    std::remove(path.c_str());
    CHECK(channels.size() == 3 + 1 + 3 * 7 + 6 + 9 + 2);
    for (std::size_t i = 0; i < film.pixels.size(); ++i) {
        float sum = 0;
        for (const char* lobe : {"lobe_R", "lobe_TT", "lobe_TRT", "lobe_TTs", "lobe_TRTs", "lobe_residual", "other"})
            sum += channels.at(lobe + std::string(".G"))[i];
        CHECK(sum == Approx(channels.at("G")[i]).epsilon(1e-5));
        CHECK(channels.at("direct.B")[i] + channels.at("indirect.B")[i] == Approx(channels.at("B")[i]).epsilon(1e-5));
        CHECK(channels.at("A")[i] == 1);
        CHECK(channels.at("depth.Z")[i] == Approx(5).margin(0.6));
        CHECK(channels.at("standard_error.Y")[i] > 0);
        CHECK(channels.at("albedo.R")[i] > channels.at("albedo.B")[i]);
        CHECK(std::abs(channels.at("normal.X")[i]) + std::abs(channels.at("tangent.Z")[i]) < 2);
    }

    o.samples = 8, o.key = "layers";
    save(with_layers(scene, o), o.key, unfinished);
    o.samples = 16, o.resume = true, o.unfinished = unfinished;
    const Film resumed = with_layers(scene, o);
    std::remove(unfinished.c_str());
    CHECK(std::memcmp(resumed.layers.data(), film.layers.data(), film.layers.size() * sizeof(Layers)) == 0);
}
