// Strands from files: where their splines pass, and one line for every file that is not what it says.
#include <catch2/catch.hpp>

#include <cstdio>
#include <cstring>
#include <fstream>

#include "render/error.hpp"
#include "render/strand_file.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla::render;

namespace {

template <class T>
void put(std::string& bytes, T value) {  // the tests run on little-endian machines
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

struct Hair {
    std::uint32_t strands = 2, points = 7, arrays = 1 | 2 | 4 | 16, even = 0;
    float thickness = 0.5f;
    std::vector<std::uint16_t> segments{2, 3};
    std::vector<float> positions{0, 0, 0, 0, 1, 0.2f, 0.1f, 2, 0, 1, 0, 0, 1.2f, 0.4f, 0.3f, 1, 1.5f, 0, 1, 1.9f, 0.4f};
    std::vector<float> wide{0.1f, 0.08f, 0.06f, 0.1f, 0.1f, 0.1f, 0.06f}, colours = std::vector<float>(21, 0.5f);

    std::string bytes() const {
        std::string b = "HAIR";
        put(b, strands), put(b, points), put(b, arrays), put(b, even), put(b, thickness), put(b, 0.0f);
        for (int k = 0; k < 3; ++k) put(b, 1.0f);
        b.resize(128, ' ');
        if ((arrays & 1) != 0)
            for (const std::uint16_t s : segments) put(b, s);
        for (const float x : positions) put(b, x);
        if ((arrays & 4) != 0)
            for (const float x : wide) put(b, x);
        if ((arrays & 16) != 0)
            for (const float x : colours) put(b, x);
        return b;
    }
};

CurvePoint at(const Strands& s, std::uint32_t segment, float u) {
    const CurvePoint* p = s.points.data() + s.first_point[segment];
    const float v = 1 - u, b[4] = {v * v * v / 6, (4 - 6 * u * u + 3 * u * u * u) / 6,
                                   (4 - 6 * v * v + 3 * v * v * v) / 6, u * u * u / 6};
    CurvePoint r{0, 0, 0, 0};
    for (int k = 0; k < 4; ++k)
        r.x += b[k] * p[k].x, r.y += b[k] * p[k].y, r.z += b[k] * p[k].z, r.radius += b[k] * p[k].radius;
    return r;
}

float distance(CurvePoint p, Vec3 q) { return length(Vec3{p.x, p.y, p.z} - q); }

template <class Read>
std::string refusal(Read&& read) {
    try {
        read();
    } catch (const Error& error) {
        return error.what();
    }
    return "accepted";
}

std::string refusal(const std::string& name, const std::string& bytes, const StrandFile& how = {}) {
    return refusal([&] { read_strands(name, bytes, how); });
}

}  // namespace

TEST_CASE("the spline of a .hair strand passes through all of its points", "[render][strands]") {
    const Hair hair;
    StrandFile how;
    how.placement.scale = 2, how.placement.up = 2, how.placement.translate = {0, 5, 0};
    const Strands strands = read_strands("a.hair", hair.bytes(), how);
    REQUIRE(strands.count() == 2);
    REQUIRE(strands.segments(0) == 2);
    REQUIRE(strands.segments(1) == 3);
    std::size_t point = 0;
    for (std::uint32_t i = 0; i < 2; ++i)
        for (std::uint32_t k = 0; k <= strands.segments(i); ++k, ++point) {
            const float* p = hair.positions.data() + 3 * point;
            const Vec3 expected{2 * p[0], 2 * p[2] + 5, -2 * p[1]};
            const std::uint32_t first = strands.first_segment[i];
            const CurvePoint found =
                k < strands.segments(i) ? at(strands, first + k, 0) : at(strands, first + k - 1, 1);
            CHECK(distance(found, expected) < 4e-6f);  // a few roundings of numbers up to 8
            const bool end = k == 0 || k == strands.segments(i);
            if (end) CHECK(found.radius == Approx(hair.wide[point]).epsilon(1e-5));  // 2 x half the thickness
        }
    how.radius = 0.25f;
    CHECK(at(read_strands("a.hair", hair.bytes(), how), 0, 0.3f).radius == Approx(0.25f));

    Hair even = hair;  // without a segments array or thickness: the header's defaults
    even.arrays = 2, even.even = 6, even.strands = 1;
    const Strands one = read_strands("a.hair", even.bytes(), {});
    CHECK(one.count() == 1);
    CHECK(one.segments(0) == 6);
    CHECK(at(one, 2, 0.5f).radius == Approx(0.25f));
}

TEST_CASE("a .hair file that is not what its header says is refused in one line", "[render][strands]") {
    const std::string good = Hair().bytes();
    REQUIRE(refusal("a.hair", good) == "accepted");
    const auto with = [](auto&& change) {
        Hair h;
        change(h);
        return h.bytes();
    };
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const struct {
        std::string bytes;
        std::vector<std::string> says;
    } cases[] = {
        {"", {"128 bytes", "found 0"}},
        {"BALD" + good.substr(4), {"begins with HAIR"}},
        {good + " ", {"found"}},
        {with([](Hair& h) { h.strands = 0; }), {"strands", "found 0"}},
        {with([](Hair& h) { h.strands = 0xffffffffu; }), {"4294967295 strands"}},
        {with([](Hair& h) { h.points = 0xffffffffu; }), {"4294967295 points"}},
        {with([](Hair& h) { h.arrays = 1 | 4 | 16; }), {"arrays", "points"}},
        {with([](Hair& h) { h.arrays |= 64; }), {"arrays", "0x57"}},
        {with([](Hair& h) {
             h.segments = {2, 2};
         }),
         {"7 points", "found 6"}},
        {with([](Hair& h) {
             h.segments = {2, 65535};
         }),
         {"7 points", "found more"}},
        {with([](Hair& h) {
             h.segments = {5, 0};
         }),
         {"strand 1", "at least one segment"}},
        {with([&](Hair& h) { h.positions[10] = nan; }), {"strand 1, point 0", "nan"}},
        {with([](Hair& h) { h.positions[3] = 1e30f; }), {"strand 0, point 1", "1e+30"}},
        {with([](Hair& h) { h.wide[3] = 0; }), {"strand 1, point 0", "thickness", "> 0"}},
        {with([](Hair& h) { h.wide[4] = -1; }), {"strand 1, point 1", "thickness", "-1"}},
        {with([](Hair& h) { h.positions.assign(21, 1.0f); }), {"strand 0", "length > 0"}},
    };
    for (const auto& c : cases) {
        const std::string line = refusal("a.hair", c.bytes);
        INFO(line);
        CHECK(line.substr(0, 8) == "a.hair: ");
        CHECK(line.find('\n') == std::string::npos);
        for (const std::string& part : c.says) CHECK(line.find(part) != std::string::npos);
    }
    for (std::size_t size = 0; size < good.size(); ++size) CHECK(refusal("a.hair", good.substr(0, size)) != "accepted");
    CHECK(refusal("a.obj", good) == "a.obj: expected a name that ends in .hair or .pbrt");
}

TEST_CASE("a pbrt curve is the curve of pbrt: Bezier by de Casteljau, transforms, widths", "[render][strands]") {
    const std::string text = R"(# hair
Film "rgb" "integer xresolution" [ 100 ] "bool savefp16" true
WorldBegin
Material "hair" "float eumelanin" .3
AttributeBegin
  Translate 1 0 0
  Rotate 90 0 0 1
  Scale 2 2 2
  Shape "curve" "string type" [ "cylinder" ] "point P" [ 0 0 0  1 0 0  2 1 0  3 1 1 ] "float width0" 0.2 "float width1" [0.1]
  Shape "curve" "point3 P" [ 3 1 1  4 1 2  4 2 2  5 2 2   5 3 3  6 3 3  7 4 4 ] "float width" 0.1
AttributeEnd
Shape "sphere" "float radius" 1
Shape "curve" "point3 P" [ 9 9 9  9 8 9  9 7 9  9 6 9 ]
ConcatTransform [ 1 0 0 0  0 1 0 0  0 0 1 0  0 0 10 1 ]
Shape "curve" "string basis" "bspline" "integer degree" 3 "point3 P" [ 0 0 0  0 1 0  1 2 0  1 3 0  2 4 0 ]
)";
    const Strands s = read_strands("a.pbrt", text, {});
    REQUIRE(s.count() == 3);
    REQUIRE(s.segments(0) == 3);  // two shapes that meet are one strand
    REQUIRE(s.segments(1) == 1);
    REQUIRE(s.segments(2) == 2);
    // A quarter turn about z and twice the size: x' = 1 - 2 y, y' = 2 x.
    const Vec3 p[4] = {{1, 0, 0}, {1, 2, 0}, {-1, 4, 0}, {-1, 6, 2}};
    for (const float u : {0.0f, 0.2f, 0.5f, 0.9f, 1.0f}) {
        Vec3 q[4] = {p[0], p[1], p[2], p[3]};
        for (int level = 3; level > 0; --level)
            for (int k = 0; k < level; ++k) q[k] = mix(q[k], q[k + 1], u);
        CHECK(distance(at(s, 0, u), q[0]) < 1e-5f);  // control points of up to 50, rounded
        CHECK(at(s, 0, u).radius == Approx(0.2f - 0.1f * u).epsilon(1e-5));
        CHECK(at(s, 1, u).radius == Approx(0.1f).epsilon(1e-5));
        CHECK(distance(at(s, 3, u), {9, 9 - 3 * u, 9}) < 1e-5f);
    }
    CHECK(distance(at(s, 4, 0), {1 / 6.0f, 1, 10}) < 1e-5f);  // (0 + 4 x 0 + 1) / 6
    CHECK(distance(at(s, 5, 0), {5 / 6.0f, 2, 10}) < 1e-5f);
    CHECK(at(s, 5, 0.5f).radius == Approx(0.5f));
}

TEST_CASE("a bad pbrt file is refused with its line", "[render][strands]") {
    const std::string curve = "Shape \"curve\" \"point3 P\" [ 0 0 0 0 1 0 0 2 0 0 3 0 ]\n";
    const struct {
        std::string text;
        std::vector<std::string> says;
    } cases[] = {
        {"", {"a.pbrt: expected at least one Shape"}},
        {"\n\n17\n", {"a.pbrt:3:", "a statement", "17"}},
        {"Shape \"curve\" \"point3 P\" [ 0 0 0\n0 x1 0 ]", {"a.pbrt:2:", "values of point3 P", "x1"}},
        {"Shape \"curve\" \"point3 P\" [ 0 0 0\n0 1..2 0 ]", {"a.pbrt:2:", "a number", "1..2"}},
        {"Shape \"curve\" \"point3 P\" [ 0 0 0 nan 1 0 0 2 0 0 3 0 ]", {"a.pbrt:1:"}},
        {"Shape \"curve\" \"point3 P\" [ 0 0 0 1e999 1 0 0 2 0 0 3 0 ]", {"a.pbrt:1:", "a number", "1e999"}},
        {"Shape \"curve\" \"point3 P\" [ 0 0 0 1e30 1 0 0 2 0 0 3 0 ]", {"a.pbrt:1:", "points up to 1e9"}},
        {"Shape \"curve\" \"point3 P\" [ 0 0 0 0 1 0 0 2 0 ]", {"a.pbrt:1:", "3 k + 1", "9 numbers"}},
        {"Shape \"curve\" \"point3 P\" [ 0 0 0 0 0 0 0 0 0 0 0 0 ]", {"a.pbrt:1:", "length > 0"}},
        {"Shape \"curve\" \"point3 P\" [ 0 0 0 0 1 0", {"values of point3 P", "the end"}},
        {curve + "Shape \"curve\" \"integer degree\" 2", {"a.pbrt:2:", "degree 3", "2"}},
        {"Shape \"curve\" \"float width\" 0 " + curve.substr(14), {"widths > 0", "`radius`"}},
        {"Shape \"curve\" \"string basis\" \"catmull\" " + curve.substr(14), {"bspline", "catmull"}},
        {curve + "ObjectInstance \"fur\"\n", {"a.pbrt:2:", "ObjectInstance"}},
        {curve + "Include \"more.pbrt\"\n", {"a.pbrt:2:", "Include"}},
        {curve + "AttributeBegin\n", {"a.pbrt:3:", "AttributeEnd", "the end"}},
        {"TransformEnd\n" + curve, {"a.pbrt:1:", "as many begins"}},
        {"Scale 1 1\n" + curve, {"a.pbrt:2:", "a number", "Shape"}},
        {"Rotate 90 0 0 0\n" + curve, {"a.pbrt:1:", "an axis"}},
        {"Transform [ 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1 ]\n" + curve, {"a.pbrt:1:", "affine"}},
        {"Material \"hair\n" + curve, {"a.pbrt:1:", "closing quote"}},
    };
    REQUIRE(refusal("a.pbrt", curve) == "accepted");
    for (const auto& c : cases) {
        const std::string line = refusal("a.pbrt", c.text);
        INFO(c.text << "\n" << line);
        CHECK(line.substr(0, 6) == "a.pbrt");
        CHECK(line.find('\n') == std::string::npos);
        for (const std::string& part : c.says) CHECK(line.find(part) != std::string::npos);
    }
}

TEST_CASE("strands from a file make the picture of the same fibres in the scene", "[render][strands]") {
    Hair hair;
    hair.strands = 1, hair.segments = {6};
    const std::string path = "test_strands.hair";  // in the build folder, where ctest runs
    std::ofstream(path, std::ios::binary) << hair.bytes();
    std::string points;
    for (std::size_t k = 0; k < 7; ++k) {
        const float* p = hair.positions.data() + 3 * k;
        points += fmt::format("{}[{}, {}, {}]", k == 0 ? "" : ", ", p[0], p[1], p[2]);
    }
    const auto scene = [&](const std::string& what) {
        return parse_scene(R"({"camera": {"from": [0, 1, 9], "to": [0.5, 1, 0], "fov": 20},
            "picture": {"width": 16, "height": 16}, )" +
                               tests::materials + "," + what + R"(, "lights": [{"light": "sky"}]})",
                           "s.json");
    };
    const Scene named = scene(R"("objects": [{"strands": ")" + path + R"(", "material": "fox", "radius": 0.05}])");
    const Film a = tests::picture(named, tests::options(16));
    const Film b = tests::picture(
        scene(R"("fibres": [{"points": [)" + points + R"(], "material": "fox", "radius": 0.05}])"), tests::options(16));
    CHECK(a.error() > 0);
    CHECK(std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Pixel)) == 0);

    // What decides whether a picture goes on is the file's contents, too.
    hair.positions[0] = 0.01f;
    std::ofstream(path, std::ios::binary) << hair.bytes();
    CHECK(scene(R"("objects": [{"strands": ")" + path + R"(", "material": "fox", "radius": 0.05}])").text !=
          named.text);
    std::remove(path.c_str());
    CHECK(refusal([&] { scene(R"("objects": [{"strands": "none.hair", "material": "fox"}])"); }) ==
          "s.json: /objects/0/strands: none.hair: cannot be read: No such file or directory");
    CHECK(refusal([&] {
              scene(R"("objects": [{"strands": "none.hair", "material": "fox", "density": 3}])");
          }).find("/objects/0/density: no such field") != std::string::npos);
}

TEST_CASE("thinned strands are some of the strands", "[render][strands]") {
    std::string text;
    for (int i = 0; i < 1000; ++i)
        text += fmt::format(
            "Shape \"curve\" \"point3 P\" [ {0} 0 0 {0} 1 0 {0} 2 0 {0} 3 0 {0} 4 1 {0} 5 2 {0} 6 3 ]\n", i);
    Strands strands = read_strands("a.pbrt", text, {});
    const Strands all = strands;
    thin(strands, 0.25);
    CHECK(std::abs(int(strands.count()) - 250) < 4 * 14);  // 4 standard deviations of the binomial
    for (std::uint32_t i = 0; i < strands.count(); ++i) {
        REQUIRE(strands.segments(i) == 2);
        const std::uint32_t k = strands.first_segment[i];
        const auto from = std::uint32_t(std::lround(at(strands, k, 0).x));
        CHECK(distance(at(strands, k + 1, 0.5f), Vec3{at(all, 2 * from + 1, 0.5f).x, at(all, 2 * from + 1, 0.5f).y,
                                                      at(all, 2 * from + 1, 0.5f).z}) == 0);
        CHECK(strands.strand_of[k + 1] == i);
    }
}
