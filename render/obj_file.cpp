// Wavefront OBJ: v, vn and f. Statements that do not describe the surface are skipped, free-form geometry is refused.
#include <set>

#include "render/error.hpp"
#include "render/mesh.hpp"

namespace medulla::render {
namespace {

const std::set<std::string_view> skipped{"vt",        "g",     "o",      "s",        "usemtl",  "mtllib",
                                         "l",         "p",     "usemap", "maplib",   "lod",     "shadow_obj",
                                         "trace_obj", "bevel", "mg",     "c_interp", "d_interp"};

}  // namespace

Polygons read_obj(const std::string& path, const std::string& bytes) {
    Polygons mesh;
    std::string_view rest = bytes;
    std::size_t line = 0;
    const auto fail = [&](const std::string& expected, std::string_view found) {
        throw Error("{}:{}: expected {}, found {}", path, line, expected, printable(found));
    };
    std::vector<std::string_view> words;
    std::string joined;
    while (!rest.empty()) {
        const auto take_line = [&] {
            const std::size_t size = std::min(rest.size(), rest.find('\n'));
            std::string_view text = rest.substr(0, size);
            rest.remove_prefix(std::min(rest.size(), size + 1));
            ++line;
            if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
            return text;
        };
        std::string_view text = take_line();
        if (!text.empty() && text.back() == '\\') {  // goes on in the next line
            joined.clear();
            while (!text.empty() && text.back() == '\\' && !rest.empty()) {
                joined.append(text.substr(0, text.size() - 1)).push_back(' ');
                text = take_line();
            }
            text = joined.append(text);
        }
        split(text.substr(0, text.find('#')), words);
        if (words.empty() || skipped.count(words[0]) != 0) continue;
        if (words[0] == "v" || words[0] == "vn") {
            float v[3];
            if (words.size() < 4) fail("three numbers", text);
            for (std::size_t k = 0; k < 3; ++k) {
                double x;
                if (!read_number(words[k + 1], x) || !(std::abs(x) <= 1e9)) fail("a number up to 1e9", words[k + 1]);
                v[k] = float(x);
            }
            (words[0] == "v" ? mesh.positions : mesh.normals).push_back({v[0], v[1], v[2]});
        } else if (words[0] == "f") {
            if (words.size() < 4 || words.size() > most_corners + 1)
                fail(fmt::format("3 to {} corners", most_corners), fmt::format("{}", words.size() - 1));
            for (std::size_t k = 1; k < words.size(); ++k) {
                const auto index = [&](std::string_view number, std::size_t count) {
                    std::int64_t i;  // from 1, or from the end below 0
                    if (!read_whole(number, i) || i == 0 || i > std::int64_t(count) || i < -std::int64_t(count))
                        fail(fmt::format("a number of the {} so far", count), words[k]);
                    return std::uint32_t(i > 0 ? i - 1 : std::int64_t(count) + i);
                };
                const std::string_view word = words[k];
                const std::size_t first = word.find('/'),
                                  second = first == word.npos ? first : word.find('/', first + 1);
                Polygons::Corner corner{index(word.substr(0, first), mesh.positions.size())};
                if (second != word.npos) corner.normal = index(word.substr(second + 1), mesh.normals.size());
                mesh.corners.push_back(corner);
            }
            mesh.ends.push_back(mesh.corners.size());
        } else {
            fail("v, vn, f or a line that may be skipped (docs/render.md)", words[0]);
        }
        if (mesh.positions.size() >= Polygons::none || mesh.corners.size() >= Polygons::none)
            fail("fewer than 2^32 vertices and corners", "more");
    }
    return mesh;
}

}  // namespace medulla::render
