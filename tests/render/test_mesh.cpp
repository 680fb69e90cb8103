// Meshes: files in every form against what they say, areas, roots on them, and the creature's surface.
#include <catch2/catch.hpp>

#include <cstdio>
#include <fstream>
#include <map>

#include "render/creature.hpp"
#include "render/error.hpp"
#include "render/shape.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla::render;

namespace {

std::string refusal(const std::string& name, const std::string& bytes) {
    try {
        read_mesh(name, bytes, {});
    } catch (const Error& error) {
        return error.what();
    }
    return "accepted";
}

double volume(const Mesh& m) {
    double sum = 0;
    for (std::size_t i = 0; i < m.indices.size(); i += 3) {
        const Vec3 a = m.positions[m.indices[i]], b = m.positions[m.indices[i + 1]], c = m.positions[m.indices[i + 2]];
        sum += double(dot(a, cross(b, c))) / 6;
    }
    return sum;
}

const std::string cube = R"(# a cube of side 2, its top and bottom polygons by negative numbers
v -1 -1 -1
v 1 -1 -1
v 1 -1 1
v -1 -1 1
v -1 1 -1
v 1 1 -1
v 1 1 1
v -1 1 1
vt 0 0
vn 0 1 0
o cube
s off
f -8 -7 -6 -5
f 5//1 8//1 7//1 \
  6//1
f 1/1 5/1 6/1 2/1
f 2 6 7 3
f 3 7 8 4
f 4 8 5 1
)";

enum class Form3 { ascii, little, big };

template <class T>
void put(std::string& bytes, T value, Form3 form) {
    const char* p = reinterpret_cast<const char*>(&value);  // the tests run on little-endian machines
    std::string b(p, p + sizeof value);
    if (form == Form3::big) std::reverse(b.begin(), b.end());
    bytes += b;
}

/// A tetrahedron with a property and an element that the reader skips.
std::string ply(Form3 form) {
    std::string b = "ply\nformat " +
                    std::string(form == Form3::ascii ? "ascii"
                                : form == Form3::big ? "binary_big_endian"
                                                     : "binary_little_endian") +
                    " 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty double y\nproperty float z\n"
                    "property uchar red\nelement edge 1\nproperty list uchar short ends\nelement face 4\n"
                    "property list uchar int vertex_indices\nend_header\n";
    const float p[4][3] = {{0, 0, 0}, {1.5f, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    if (form == Form3::ascii) {
        for (const auto& v : p) b += fmt::format("{} {} {} 255\n", v[0], v[1], v[2]);
        b += "2 0 1\n";
        for (const auto& f : faces) b += fmt::format("3 {} {} {}\n", f[0], f[1], f[2]);
        return b;
    }
    for (const auto& v : p)
        put(b, v[0], form), put(b, double(v[1]), form), put(b, v[2], form), put(b, std::uint8_t(255), form);
    put(b, std::uint8_t(2), form), put(b, std::int16_t(0), form), put(b, std::int16_t(1), form);
    for (const auto& f : faces) {
        put(b, std::uint8_t(3), form);
        for (const int i : f) put(b, i, form);
    }
    return b;
}

}  // namespace

TEST_CASE("an OBJ cube is a cube", "[render][mesh]") {
    MeshFile how;
    how.placement.scale = 0.5f, how.placement.translate = {0, 3, 0};
    const Mesh m = read_mesh("a.obj", cube, how);
    CHECK(m.indices.size() == 36);
    CHECK(m.area.back() == Approx(6).epsilon(1e-6));
    CHECK(volume(m) == Approx(1).epsilon(1e-5));
    int flat = 0;
    for (std::size_t i = 0; i < m.positions.size(); ++i) {
        CHECK(std::abs(std::abs(m.positions[i].y - 3) - 0.5f) < 1e-6f);
        flat += m.normals[i].y == 1;  // the corners of the face that has normals
        CHECK(length(m.normals[i]) == Approx(1).epsilon(1e-6));
        CHECK(dot(m.normals[i], m.positions[i] - Vec3{0, 3, 0}) > 0.4f);
    }
    CHECK(flat == 4);
    how.clockwise = true;
    CHECK(volume(read_mesh("a.obj", cube, how)) == Approx(-1).epsilon(1e-5));
    how = {};
    how.placement.up = 2;
    const Mesh turned = read_mesh("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", how);
    CHECK(turned.normals[0].y == 1);  // z of the file
}

TEST_CASE("polygons with notches lose and gain nothing", "[render][mesh]") {
    // A comb of three teeth, 5 x 1 with notches of 1 x 0.9, in a tilted plane; and backwards.
    std::vector<Vec3> p;
    for (const float v : {0.0f, 0.0f, 5.0f, 0.0f, 5.0f, 1.0f, 4.0f, 1.0f, 4.0f, 0.1f, 3.0f, 0.1f,
                          3.0f, 1.0f, 2.0f, 1.0f, 2.0f, 0.1f, 1.0f, 0.1f, 1.0f, 1.0f, 0.0f, 1.0f}) {
        if (p.empty() || p.back().z == 1)
            p.push_back({v, 0, 0});
        else
            p.back().y = v, p.back().z = 1;
    }
    for (Vec3& q : p) q = {q.x, 0.6f * q.y, 0.8f * q.y};
    for (int way = 0; way < 2; ++way) {
        double area = 0, net = 0;
        const auto cut = triangulate(p);
        REQUIRE(cut.size() == 3 * (p.size() - 2));
        for (std::size_t k = 0; k < cut.size(); k += 3) {
            const Vec3 n = cross(p[cut[k + 1]] - p[cut[k]], p[cut[k + 2]] - p[cut[k]]);
            area += 0.5 * double(length(n)), net += 0.5 * double(dot(n, {0, -0.8f, 0.6f}));
        }
        CHECK(area == Approx(5 - 2 * 0.9).epsilon(1e-5));
        CHECK(net == Approx((way == 0 ? 1 : -1) * area).epsilon(1e-5));
        std::reverse(p.begin(), p.end());
    }
}

TEST_CASE("PLY in ASCII and both byte orders is the same mesh", "[render][mesh]") {
    const Mesh a = read_mesh("a.ply", ply(Form3::ascii), {});
    CHECK(volume(a) == Approx(0.25).epsilon(1e-6));
    for (const Form3 form : {Form3::little, Form3::big}) {
        const Mesh b = read_mesh("a.ply", ply(form), {});
        CHECK(a.indices == b.indices);
        REQUIRE(a.positions.size() == b.positions.size());
        for (std::size_t i = 0; i < a.positions.size(); ++i) CHECK(length(a.positions[i] - b.positions[i]) == 0);
        const std::string bytes = ply(form);
        for (std::size_t size = 0; size < bytes.size(); ++size)
            CHECK(refusal("a.ply", bytes.substr(0, size)).substr(0, 5) == "a.ply");
        CHECK(refusal("a.ply", bytes + "x").find("1 bytes") != std::string::npos);
    }
}

TEST_CASE("a bad mesh is refused in one line with its place", "[render][mesh]") {
    const auto changed = [](std::string text, const std::string& from, const std::string& to) {
        return text.replace(text.find(from), from.size(), to);
    };
    const std::string good = ply(Form3::ascii);
    const struct {
        std::string name, bytes;
        std::vector<std::string> says;
    } cases[] = {
        {"a.stl", "", {".obj or .ply"}},
        {"a.obj", "", {"faces of area > 0"}},
        {"a.obj", "v 0 0\n", {"a.obj:1:", "three numbers"}},
        {"a.obj", "v 0 0 0\nv 0 nan 0\n", {"a.obj:2:", "nan"}},
        {"a.obj", "v 0 0 1e300\n", {"a.obj:1:", "1e300"}},
        {"a.obj", changed(cube, "-8 -7", "-9 -7"), {"a.obj:14:", "8 so far", "-9"}},
        {"a.obj", changed(cube, "f 2 6", "f 9 6"), {"a.obj:18:", "8 so far", "9"}},
        {"a.obj", changed(cube, "f 2 6", "f 0 6"), {"a.obj:18:", "0"}},
        {"a.obj",
         changed(cube, "f 2 6", "f -9223372036854775808 6"),
         {"a.obj:18:", "8 so far", "-9223372036854775808"}},
        {"a.obj", changed(cube, "8//1", "8//2"), {"a.obj:16:", "1 so far", "8//2"}},
        {"a.obj", "v 0 0 0\nv 1 0 0\nf 1 2\n", {"a.obj:3:", "3 to 1024", "2"}},
        {"a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 1\n", {"area > 0"}},
        {"a.obj", "curv 0 1 1 2\n", {"a.obj:1:", "curv"}},
        {"a.ply", "play\n", {"a.ply:1:", "ply", "play"}},
        {"a.ply", "ply\nend_header\n", {"a.ply:2:", "format"}},
        {"a.ply", changed(good, "1.0", "1.1"), {"a.ply:2:", "1.0"}},
        {"a.ply", changed(good, "float x", "half x"), {"a.ply:5:", "type", "half"}},
        {"a.ply", changed(good, "float x", "float q"), {"x, y and z"}},
        {"a.ply", changed(good, "vertex 4", "vertex 4000000000"), {"element vertex", "4000000000"}},
        {"a.ply", changed(good, "vertex 4", "vertex -4"), {"a.ply:4:", "COUNT"}},
        {"a.ply", changed(good, "vertex 4", "vertex 5"), {"face 0"}},
        {"a.ply", changed(good, "edge", "vertex"), {"a.ply:9:", "each element once", "vertex"}},
        {"a.ply", changed(good, "1.5", "inf"), {"vertex 1", "x", "inf"}},
        {"a.ply", changed(good, "3 1 2 3", "3 1 2 4"), {"4 vertices", "found 4"}},
        {"a.ply", changed(good, "3 1 2 3", "3 1 2 -1"), {"face 3", "-1"}},
        {"a.ply", changed(good, "3 1 2 3", "2 1 2"), {"face 3", "corners", "2"}},
    };
    for (const auto& c : cases) {
        const std::string line = refusal(c.name, c.bytes);
        INFO(c.name << ": " << line);
        CHECK(line.substr(0, 5) == c.name);
        CHECK(line.find('\n') == std::string::npos);
        for (const std::string& part : c.says) CHECK(line.find(part) != std::string::npos);
    }
}

TEST_CASE("points of a mesh are spread by area, and hairs stand on it", "[render][mesh]") {
    const Mesh m = read_mesh("a.obj", cube, {});
    Sequence random(4);
    int face[3] = {};
    for (int i = 0; i < 6000; ++i) {
        const SurfacePoint p = sample_surface(m, random);
        REQUIRE(greatest_size(p.position) == Approx(1).epsilon(1e-5));
        ++face[std::abs(p.position.x) > 0.99999f ? 0 : std::abs(p.position.y) > 0.99999f ? 1 : 2];
    }
    for (const int n : face) CHECK(std::abs(n - 2000) < 4 * 37);  // 4 standard deviations of the binomial

    const std::string path = "test_mesh.obj";  // in the build folder, where ctest runs
    std::ofstream(path) << cube;
    const auto scene = [&](const std::string& object) {
        return parse_scene(R"({"camera": {"from": [0, 3, 9], "to": [0, 0, 0]}, )" + tests::materials +
                               R"(, "objects": [)" + object + R"(], "lights": [{"light": "sky"}]})",
                           "s.json");
    };
    const Geometry geometry(scene(R"({"shape": "mesh", "file": ")" + path +
                                  R"(", "coat": [{"material": "fox", "density": 20, "length": 0.1}]})"));
    std::remove(path.c_str());
    const Strands& strands = geometry.layers()[0];
    CHECK(strands.count() == 480);  // 24 of area
    const Hit hit = geometry.nearest({{0.31f, 0.27f, 5}, {0, 0, -1}, {}});
    REQUIRE(hit);
    CHECK(hit.distance < 4.00001f);
    for (const char* bad : {R"({"shape": "mesh", "file": "none.obj"})", R"({"shape": "mesh"})",
                            R"({"shape": "creature", "balls": [[0, 0, 0]]})", R"({"shape": "creature", "balls": []})",
                            R"({"shape": "creature", "balls": [[0, 0, 0, 0]]})"})
        CHECK_THROWS_WITH(scene(bad), Catch::StartsWith("s.json: /objects/0/"));
}

TEST_CASE("the creature is closed, smooth and on its surface", "[render][mesh][creature]") {
    const std::vector<Ball> one{{{0.1f, 0.2f, 0.3f}, 0.5f, 0.5f}};
    const std::vector<Ball> two{{{0, 0, 0}, 0.5f, 1}, {{0.6f, 0, 0}, 0.3f, 0}, {{3, 0, 0}, 0.4f}};
    for (const auto* balls : {&one, &two, &fox()}) {
        const Mesh m = creature(*balls, 0.03f, {});
        std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
        int tilted = 0;
        for (std::size_t i = 0; i < m.indices.size(); i += 3) {
            for (std::size_t k = 0; k < 3; ++k) ++edges[{m.indices[i + k], m.indices[i + (k + 1) % 3]}];
            const Vec3 a = m.positions[m.indices[i]], b = m.positions[m.indices[i + 1]],
                       c = m.positions[m.indices[i + 2]];
            tilted += !(dot(normalise(cross(b - a, c - a)), m.normals[m.indices[i]]) > 0);
        }
        CHECK(tilted == 0);
        int open = 0;
        for (const auto& [edge, count] : edges) {
            const auto back = edges.find({edge.second, edge.first});
            open += count != 1 || back == edges.end();
        }
        CHECK(open == 0);
        const Blend field{*balls, 0.03f};
        float farthest = 0;
        for (const Vec3& p : m.positions) farthest = std::max(farthest, std::abs(field.at(p).f));
        CHECK(farthest < 1e-5f);
        // Euler: a sphere has 2, so that bodies are counted.
        const auto euler = std::ptrdiff_t(m.positions.size()) - std::ptrdiff_t(edges.size() / 2) +
                           std::ptrdiff_t(m.indices.size() / 3);
        CHECK(euler == (balls == &two ? 4 : 2));
        if (balls != &one) continue;
        CHECK(volume(m) ==
              Approx(4 * 3.14159265 / 3 * 0.125).epsilon(0.01));  // chords of cells of a sixth of the radius
        CHECK(m.fur[0] == 0.5f);
    }
    // Where two balls meet the length of hairs is blended; between 0 and 1 all along.
    const Mesh m = creature(two, 0.03f, {});
    float least = 1, most = 0;
    for (const float x : m.fur) least = std::min(least, x), most = std::max(most, x);
    CHECK(least < 1e-3f);
    CHECK(most == 1);
}
