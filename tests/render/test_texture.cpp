// Textures: where their pixels come to lie, that they set what they name, and what is not a number.
#include <png.h>

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "render/error.hpp"
#include "render/texture.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla::render;

namespace {

Texture of(int width, int height, const std::vector<float>& values, Mapping mapping) {
    Texture t;
    t.mapping = mapping;
    t.image.width = width, t.image.height = height;
    for (const float x : values) t.image.pixels.push_back({x, 2 * x, 3 * x});
    return t;
}

/// A square of fur with these textures.
Scene patch(const std::vector<Texture>& textures, const std::string& material = "fox") {
    Scene scene = parse_scene(tests::patch(material, tests::white_sky), "test");
    for (const Texture& t : textures) scene.objects[0].coat[0].textures.push_back(std::make_shared<const Texture>(t));
    return scene;
}

bool same(const Film& a, const Film& b) {
    return std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Pixel)) == 0;
}

std::string png(int width, int height, const std::vector<std::uint8_t>& rgb) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION, image.format = PNG_FORMAT_RGB;
    image.width = png_uint_32(width), image.height = png_uint_32(height);
    png_alloc_size_t size = 0;
    png_image_write_to_memory(&image, nullptr, &size, 0, rgb.data(), 0, nullptr);
    std::string bytes(size, '\0');
    png_image_write_to_memory(&image, bytes.data(), &size, 0, rgb.data(), 0, nullptr);
    return bytes;
}

}  // namespace

TEST_CASE("a texture's pixels lie where its map puts them", "[render][texture]") {
    Texture flat = of(2, 2, {1, 2, 3, 4}, Mapping::planar);  // 3 is at the lower left
    flat.origin = {10, 0, 5}, flat.u = {4, 0, 0}, flat.v = {0, 0, -2}, flat.scale = 10;
    CHECK(flat.at({11, 9, 4.5f}, 0, 0).x == 30);
    CHECK(flat.at({13, 9, 4.5f}, 0, 0).y == 80);
    CHECK(flat.at({11, 9, 3.5f}, 0, 0).z == 30);
    CHECK(flat.at({12, 9, 4}, 0, 0).x == Approx(25));  // the middle: all four
    CHECK(flat.at({-100, 0, 100}, 0, 0).x == 30);      // the edge goes on
    CHECK(flat.at({1e9f, 0, -1e9f}, 0, 0).x == 20);
    Texture strand = of(4, 2, {0, 1, 2, 3, 10, 11, 12, 13}, Mapping::strand);
    CHECK(strand.at({}, 0, 0.125f).x == 10);  // the root is at the bottom
    CHECK(strand.at({}, 1, 0.875f).x == 3);
    CHECK(strand.at({}, 0.5f, 0.375f).x == Approx(6));
    Texture round = of(4, 3, {0, 1, 2, 3, 10, 11, 12, 13, 20, 21, 22, 23}, Mapping::around);
    round.origin = {0, 7, 0};
    const float d = std::sqrt(0.5f);
    CHECK(round.at({-d, 7, -d}, 0, 0).x == Approx(10).margin(1e-5));  // the middle of the picture is towards +z
    CHECK(round.at({-d, 7, d}, 0, 0).x == Approx(11).margin(1e-5));
    CHECK(round.at({d, 7, -d}, 0, 0).x == Approx(13).margin(1e-5));
    CHECK(round.at({0, 7, -1}, 0, 0).x == Approx(11.5).margin(1e-3));  // the seam: half 10, half 13
    CHECK(round.at({0.01f, 9, 0.01f}, 0, 0).x == Approx(2).margin(0.01));
    CHECK(round.at({0.01f, 5, 0.01f}, 0, 0).x == Approx(22).margin(0.01));
}

TEST_CASE("a constant texture is the material with that parameter", "[render][texture]") {
    const RenderOptions o = tests::options(8);
    const auto constant = [](Sets sets, float value) {
        Texture t = of(1, 1, {1}, Mapping::planar);
        t.sets = sets, t.image.pixels[0] = {value, value, value};
        return t;
    };
    const Film plain = tests::picture(patch({}), o);
    const auto with = [&](auto&& change) {
        Scene scene = patch({});
        change(scene.materials[1].fur);
        return tests::picture(scene, o);
    };
    const struct {
        Texture texture;
        Film expected;
    } cases[] = {
        {constant(Sets::sigma_ca, 0.8f), with([](auto& p) { p.sigma_ca[0] = p.sigma_ca[1] = p.sigma_ca[2] = 0.8f; })},
        {constant(Sets::colour, std::exp(-1.6f)),
         with([](auto& p) { p.sigma_ca[0] = p.sigma_ca[1] = p.sigma_ca[2] = -0.5f * std::log(std::exp(-1.6f)); })},
        {constant(Sets::sigma_ca_factor, 3), with([](auto& p) {
             for (float& s : p.sigma_ca) s *= 3;
         })},
        {constant(Sets::kappa, 0.3f), with([](auto& p) { p.kappa = 0.3f; })},
        {constant(Sets::sigma_ms_factor, 0.1f), with([](auto& p) { p.sigma_ms *= 0.1f; })},
    };
    for (const auto& c : cases) {
        const Film found = tests::picture(patch({c.texture}), o);
        const double mean = tests::mean_luminance(c.expected),
                     change = std::abs(tests::mean_luminance(plain) / mean - 1);
        INFO("sets " << int(c.texture.sets) << ", " << change << " from the plain picture, "
                     << tests::mean_luminance(found) / mean - 1 << " from the expected one");
        CHECK(!same(found, plain));
        if (c.texture.sets != Sets::kappa && c.texture.sets != Sets::sigma_ms_factor) {
            CHECK(same(found, c.expected));
        } else {  // the coat's tables span the material's own value, too: other nodes to interpolate between
            CHECK(std::abs(tests::mean_luminance(found) / mean - 1) < 0.1 * change);
        }
    }
}

TEST_CASE("what is no number in a texture is clamped by the runtime, and counted", "[render][texture]") {
    Texture t = of(2, 1, {1, 1}, Mapping::planar);
    t.sets = Sets::kappa;
    t.origin = {-1.5f, 0, 0}, t.u = {3, 0, 0};
    t.image.pixels = {{0.6f, 0, 0}, {0.7f, 0, 0}};
    const RenderOptions o = tests::options(8);
    Counts counts;
    tests::picture(patch({t}), o, &counts);
    CHECK(counts.clamped == 0);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const Sets sets : {Sets::sigma_ca, Sets::colour, Sets::kappa, Sets::sigma_ms_factor, Sets::sigma_ca_factor}) {
        t.sets = sets, t.image.pixels[1] = {nan, nan, nan};
        const Film film = tests::picture(patch({t}), o, &counts);
        CHECK(counts.nonfinite == 0);
        CHECK(counts.clamped > 100);
        CHECK(counts.clamped < counts.vertices);
        CHECK(std::isfinite(tests::mean_luminance(film)));
        CHECK(tests::mean_luminance(film) > 0.01);
    }
    t.sets = Sets::kappa, t.image.pixels[1] = {7, 0, 0};
    tests::picture(patch({t}), o, &counts);
    CHECK(counts.clamped > 100);
}

TEST_CASE("a texture along the strand is a coat of materials along it", "[render][texture]") {
    Texture t = of(1, 2, {0.1f, 1.3f}, Mapping::strand);
    Scene stops = patch({});
    stops.materials.push_back(stops.materials[1]);
    for (std::size_t c = 0; c < 3; ++c) {
        stops.materials[1].fur.sigma_ca[c] = 1.3f * float(c + 1),
        stops.materials[2].fur.sigma_ca[c] = 0.1f * float(c + 1);
    }
    stops.objects[0].coat[0].along = {{0.25f, 1}, {0.75f, 2}};  // the pixels' centres
    const RenderOptions o = tests::options(16);
    const Film a = tests::picture(patch({t}), o), b = tests::picture(stops, o);
    // The same random numbers: only roundings differ, and where one of them turns a choice a path goes elsewhere.
    std::size_t elsewhere = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i)
        elsewhere += a.pixels[i].luminance_sum() != Approx(b.pixels[i].luminance_sum()).epsilon(1e-4);
    CHECK(elsewhere < a.pixels.size() / 10);
    CHECK(tests::mean_luminance(a) == Approx(tests::mean_luminance(b)).epsilon(0.01));
}

TEST_CASE("textures of a scene are read, and refused in one line", "[render][texture]") {
    const std::string path = "test_texture.png";  // in the build folder, where ctest runs
    std::ofstream(path, std::ios::binary) << png(2, 1, {255, 128, 0, 51, 51, 51});
    const auto scene = [](const std::string& texture) {
        return parse_scene("{" + tests::materials + R"(, "objects": [{"shape": "patch", "coat": [{"material": "fox",
            "density": 10, "textures": [)" +
                               texture + R"(]}]}], "lights": [{"light": "sky"}]})",
                           "s.json");
    };
    const std::string file = R"("file": ")" + path + "\"";
    const Scene data =
        scene("{" + file + R"(, "sets": "kappa"}, {)" + file + R"(, "sets": "colour", "map": "strand"})");
    const auto& textures = data.objects[0].coat[0].textures;
    REQUIRE(textures.size() == 2);
    CHECK(textures[0]->image.pixels[0].y == Approx(128 / 255.0f));           // as it is
    CHECK(textures[1]->image.pixels[0].y == Approx(0.21586).epsilon(1e-3));  // sRGB's 128
    CHECK(textures[1]->image.pixels[1].z == Approx(0.03310).epsilon(1e-3));
    const struct {
        std::string texture;
        std::vector<std::string> says;
    } cases[] = {
        {"{}", {"/textures/0/file", "name of a file", "found none"}},
        {R"({"file": "none.png"})", {"/textures/0/file", "none.png", "No such file"}},
        {R"({"file": "a.jpg"})", {"a.jpg"}},
        {"{" + file + R"(, "sets": "beta_m"})",
         {"/textures/0/sets", "sigma_ca, colour, kappa, sigma_ms_factor, sigma_ca_factor", "beta_m"}},
        {"{" + file + R"(, "map": "uv"})", {"/textures/0/map", "planar, around, strand", "uv"}},
        {"{" + file + R"(, "u": [0, 0, 0]})", {"/textures/0/u", "length 0"}},
        {"{" + file + R"(, "map": "strand", "u": [1, 0, 0]})", {"/textures/0/u", "no such field"}},
    };
    for (const auto& c : cases) {
        std::string line = "accepted";
        try {
            scene(c.texture);
        } catch (const Error& error) {
            line = error.what();
        }
        INFO(c.texture << ": " << line);
        CHECK(line.substr(0, 8) == "s.json: ");
        CHECK(line.find('\n') == std::string::npos);
        for (const std::string& part : c.says) CHECK(line.find(part) != std::string::npos);
    }
    std::ofstream(path, std::ios::binary) << png(2, 1, {255, 128, 0, 51, 51, 51}).substr(0, 50);
    CHECK_THROWS_WITH(scene("{" + file + "}"), Catch::Contains(path) && Catch::Contains("PNG"));
    std::remove(path.c_str());
}
