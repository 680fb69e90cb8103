// Environment maps: files in both formats, the distribution drawn from against the density, and a constant map as sky.
#include <catch2/catch.hpp>

#include <ImfRgbaFile.h>

#include <cstdio>
#include <fstream>
#include <sstream>

#include "render/environment.hpp"
#include "render/error.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla::render;

namespace {

std::string refusal(const std::string& name, const std::string& bytes) {
    try {
        Environment(read_image(name, bytes), 0, {1, 1, 1}, name);
    } catch (const Error& error) {
        return error.what();
    }
    return "accepted";
}

std::string hdr(const std::string& pixels, const std::string& size = "-Y 1 +X 2", const std::string& header = "") {
    return "#?RADIANCE\n" + header + "FORMAT=32-bit_rle_rgbe\n\n" + size + "\n" + pixels;
}

/// A map with a small sun, a black half and a smooth rest.
Image uneven() {
    Image image;
    image.width = 24, image.height = 12;
    for (int y = 0; y < 12; ++y)
        for (int x = 0; x < 24; ++x)
            image.pixels.push_back(x == 17 && y == 3 ? Rgb{90, 80, 60}
                                   : y >= 10         ? Rgb{}
                                                     : (0.1f * float(x + y)) * Rgb{0.3f, 0.5f, 1});
    return image;
}

/// EXR bytes of an image whose corner is not at 0.
std::string exr(const Image& image) {
    const std::string path = "test_environment.exr";  // in the build folder, where ctest runs
    {
        const Imath::Box2i window({5, -3}, {5 + image.width - 1, -3 + image.height - 1});
        Imf::RgbaOutputFile file(path.c_str(), window, window, Imf::WRITE_RGB);
        std::vector<Imf::Rgba> pixels;
        for (const Rgb& p : image.pixels) pixels.push_back({p.x, p.y, p.z});
        file.setFrameBuffer(pixels.data() - 5 + 3 * image.width, 1, std::size_t(image.width));
        file.writePixels(image.height);
    }
    std::ostringstream bytes;
    bytes << std::ifstream(path, std::ios::binary).rdbuf();
    std::remove(path.c_str());
    return bytes.str();
}

}  // namespace

TEST_CASE("directions of an environment map are drawn by its density, which is its luminance",
          "[render][environment]") {
    const Environment map(uneven(), 0.7f, {2, 2, 2}, "map");
    // Expected shares by the density itself, over bins that cut across pixels: a midpoint rule much finer than pixels.
    constexpr int bands = 15, turns = 20, fine = 96;
    std::vector<double> expected(bands * turns);
    double whole = 0;
    for (int j = 0; j < bands * fine; ++j)
        for (int i = 0; i < turns * fine; ++i) {
            const float y = 1 - 2 * (float(j) + 0.5f) / (bands * fine),
                        a = 2 * pi_f * (float(i) + 0.5f) / (turns * fine);
            const float r = std::sqrt(1 - y * y);
            const Vec3 w{r * std::cos(a), y, r * std::sin(a)};
            const double p = double(map.pdf(w)) * 4 * double(pi_f) / (bands * fine * turns * fine);
            expected[std::size_t(j / fine * turns + i / fine)] += p, whole += p;
            if (j % 97 == 0 && i % 89 == 0)
                CHECK(map.pdf(w) ==
                      Approx(luminance(map.radiance(w)) * map.pdf({0, 1, 0}) / luminance(map.radiance({0, 1, 0}))));
        }
    CHECK(whole == Approx(1).margin(2e-3));  // the midpoint rule at the edges of the sun's pixel

    constexpr int n = 200000;
    std::vector<int> found(bands * turns);
    Sequence random(9);
    for (int k = 0; k < n; ++k) {
        const float u = random(), v = random();
        const Vec3 w = map.sample({u, v});
        REQUIRE(length(w) == Approx(1).epsilon(1e-6));
        CHECK(map.pdf(w) > 0);
        const int j = std::min(bands - 1, int((1 - w.y) / 2 * bands));
        const float a = std::atan2(w.z, w.x) / (2 * pi_f);
        ++found[std::size_t(j * turns + std::min(turns - 1, int((a - std::floor(a)) * turns)))];
    }
    double chi = 0;
    int bins = 0;
    for (std::size_t b = 0; b < found.size(); ++b) {
        if (expected[b] * n < 5) {
            CHECK(found[b] < 30);
            continue;
        }
        const double d = found[b] - expected[b] * n;
        chi += d * d / (expected[b] * n), ++bins;
    }
    // Mean bins - 1, standard deviation sqrt(2 bins); 2 for the midpoint rule.
    INFO("chi squared " << chi << " of " << bins);
    CHECK(bins > 200);
    CHECK(chi < bins + 5 * std::sqrt(2.0 * bins));
}

TEST_CASE("the middle of a map is towards -z, and it turns counter-clockwise from above", "[render][environment]") {
    Image image;
    image.width = 8, image.height = 4;
    for (int i = 0; i < 32; ++i) image.pixels.push_back({float(i), 1, 1});
    const Environment map(image, 0, {1, 1, 1}, "map");
    const auto column = [&](const Environment& m, Vec3 w) { return int(m.radiance(normalise(w)).x) % 8; };
    CHECK(column(map, {0.1f, 0, -1}) == 4);
    CHECK(column(map, {-0.1f, 0, -1}) == 3);
    CHECK(column(map, {1, 0, -0.1f}) == 5);
    CHECK(int(map.radiance({0.1f, 0.99f, 0}).x) / 8 == 0);
    CHECK(int(map.radiance({0.1f, -0.99f, 0}).x) / 8 == 3);
    const Environment turned(image, 0.5f * pi_f, {1, 1, 1}, "map");
    CHECK(column(turned, {-1, 0, -0.1f}) == 4);  // what was ahead is at the left
}

TEST_CASE("a constant map is the sky, and an uneven one is found with and without light sampling",
          "[render][environment]") {
    Image constant;
    constant.width = 7, constant.height = 5, constant.pixels.assign(35, {1, 1, 1});
    Scene scene = parse_scene(tests::patch("fox", tests::white_sky), "test");
    RenderOptions o = tests::options(64);
    const auto compare = [&](const Film& a, const Film& b) {
        const double error = std::hypot(tests::error_of_mean(a), tests::error_of_mean(b));
        INFO(tests::mean_luminance(a) << " and " << tests::mean_luminance(b) << ", standard error " << error);
        CHECK(error < 0.02 * tests::mean_luminance(a));
        CHECK(std::abs(tests::mean_luminance(a) - tests::mean_luminance(b)) < 4 * error);
    };
    const Film sky = tests::picture(scene, o);
    scene.lights[0].form = LightForm::environment;
    scene.lights[0].environment = std::make_shared<const Environment>(constant, 1.0f, Rgb{1, 1, 1}, "map");
    o.seed = 1;
    compare(sky, tests::picture(scene, o));

    Image smooth = uneven();
    smooth.pixels[3 * 24 + 17] = {3, 3, 3};  // or the picture without light sampling is all noise
    scene.lights[0].environment = std::make_shared<const Environment>(smooth, 1.0f, Rgb{1, 1, 1}, "map");
    o.samples = 256;
    const Film with = tests::picture(scene, o);
    o.path.sample_lights = false, o.seed = 2;
    compare(with, tests::picture(scene, o));

    // The furnace: a constant map about what absorbs nothing.
    Scene white = parse_scene(tests::patch("white", tests::white_sky), "test");
    white.lights[0] = scene.lights[0];
    white.lights[0].environment = std::make_shared<const Environment>(constant, 0, Rgb{1, 1, 1}, "map");
    RenderOptions p = tests::options(32);
    p.path.sample_lights = false;
    CHECK(tests::mean_luminance(tests::picture(white, p)) == Approx(1).margin(1e-3));
}

TEST_CASE("maps are read from EXR and HDR", "[render][environment]") {
    const Image image = uneven();
    const Image read = read_image("a.exr", exr(image));
    REQUIRE(read.width == 24);
    REQUIRE(read.height == 12);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        CHECK(read.pixels[i].x == Approx(image.pixels[i].x).epsilon(1e-3));  // half floats
        CHECK(read.pixels[i].z == Approx(image.pixels[i].z).epsilon(1e-3));
    }
    const std::string p("\x80\x40\x20\x81\x10\x20\x40\x82", 8);  // times 2^-7 and 2^-6, and half a step
    const Image two = read_image("a.hdr", hdr(p));
    CHECK(two.pixels[0].x == Approx(128.5 / 128));
    CHECK(two.pixels[1].z == Approx(64.5 / 64));
    CHECK(read_image("a.hdr", hdr(p, "-Y 1 +X 2", "EXPOSURE=2\n")).pixels[0].x == Approx(128.5 / 256));
    // A run of the old kind, and rows of the new one: 8 pixels by a run of 3 and 5 single values in each component.
    const Image old = read_image("a.hdr", hdr(p.substr(0, 4) + "\1\1\1\3", "-Y 1 +X 4"));
    CHECK(old.pixels[3].y == old.pixels[0].y);
    std::string row("\2\2\0\x08", 4);
    for (const char c : {'\x80', '\x40', '\x20', '\x81'}) row += std::string("\x83") + c + '\5' + std::string(5, c);
    const Image rows = read_image("a.hdr", hdr(row + row, "-Y 2 +X 8"));
    REQUIRE(rows.pixels.size() == 16);
    for (const Rgb& q : rows.pixels) CHECK(length(q - two.pixels[0]) == 0);

    const std::string good = hdr(row + row, "-Y 2 +X 8");
    for (std::size_t size = 0; size < good.size(); ++size)
        CHECK(refusal("a.hdr", good.substr(0, size)).substr(0, 7) == "a.hdr: ");
}

TEST_CASE("a bad map is refused in one line", "[render][environment]") {
    const std::string p("\x80\x40\x20\x81", 4), good_exr = exr(uneven());
    Image nan = uneven(), black = uneven();
    nan.pixels[30].y = std::numeric_limits<float>::quiet_NaN();
    black.pixels.assign(black.pixels.size(), {0, -1, 0});
    const struct {
        std::string name, bytes;
        std::vector<std::string> says;
    } cases[] = {
        {"a.jpg", "", {".exr, .hdr or .png"}},
        {"a.hdr", "#?RGB\n\n", {"#?RADIANCE"}},
        {"a.hdr", "#?RGBE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n" + p, {"FORMAT=32-bit_rle_rgbe", "xyze"}},
        {"a.hdr", hdr(p, "+Y 1 +X 1"), {"-Y HEIGHT", "+Y 1"}},
        {"a.hdr", hdr(p, "-Y 1000000000 +X 1000000000"), {"-Y HEIGHT"}},
        {"a.hdr", hdr(p, "-Y 10000 +X 10000"), {"row 0", "4 bytes", "the end"}},
        {"a.hdr", hdr(p, "-Y 0 +X 1"), {"-Y HEIGHT"}},
        {"a.hdr", hdr("\1\1\1\1" + p, "-Y 1 +X 2"), {"row 0", "a run"}},
        {"a.hdr", hdr(p + "\1\1\1\7", "-Y 1 +X 4"), {"row 0", "a run", "7 after 1"}},
        {"a.hdr", hdr(std::string("\2\2\0\x09", 4), "-Y 1 +X 8"), {"row 0", "8 pixels", "9"}},
        {"a.hdr", hdr(std::string("\2\2\0\x08\x89\0", 6), "-Y 1 +X 8"), {"row 0", "a run", "9 after 0"}},
        {"a.hdr", hdr(std::string("\2\2\0\x08\0", 5), "-Y 1 +X 8"), {"row 0", "a run", "0 after 0"}},
        {"a.hdr", hdr(p, "-Y 1 +X 1", "EXPOSURE=0\n"), {"EXPOSURE > 0"}},
        {"a.hdr", hdr(std::string(8, '\0')), {"some light"}},
        {"a.exr", "", {"OpenEXR"}},
        {"a.exr", "not an exr at all", {"OpenEXR"}},
        {"a.exr", good_exr.substr(0, good_exr.size() / 2), {"OpenEXR"}},
        {"a.exr", exr(nan), {"pixel 6, 1", "finite", "nan"}},
        {"a.exr", exr(black), {"some light"}},
    };
    for (const auto& c : cases) {
        const std::string line = refusal(c.name, c.bytes);
        INFO(c.name << ": " << line);
        CHECK(line.substr(0, 6) == c.name + ":");
        CHECK(line.find('\n') == std::string::npos);
        for (const std::string& part : c.says) CHECK(line.find(part) != std::string::npos);
    }
}
