// PLY: ASCII and binary of either byte order. Elements vertex (x, y, z, and nx, ny, nz) and face (vertex_indices or
// vertex_index); other elements and properties are skipped.
#include <array>

#include "render/error.hpp"
#include "render/mesh.hpp"

namespace medulla::render {
namespace {

struct Type {
    const char *name, *other_name;
    std::size_t bytes;
    double (*load)(const char*, bool big_endian);
};
template <class T>
double load_as(const char* bytes, bool big_endian) {
    return double(load<T>(bytes, big_endian));
}
const Type types[] = {
    {"char", "int8", 1, load_as<std::int8_t>},    {"uchar", "uint8", 1, load_as<std::uint8_t>},
    {"short", "int16", 2, load_as<std::int16_t>}, {"ushort", "uint16", 2, load_as<std::uint16_t>},
    {"int", "int32", 4, load_as<std::int32_t>},   {"uint", "uint32", 4, load_as<std::uint32_t>},
    {"float", "float32", 4, load_as<float>},      {"double", "float64", 8, load_as<double>},
};

struct Property {
    std::string name;
    const Type* type = nullptr;
    const Type* count = nullptr;  ///< of a list
};
struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<Property> properties;
};

class PlyReader {
  public:
    PlyReader(const std::string& path, const std::string& bytes) : path_(path), rest_(bytes) {}

    Polygons read() {
        header();
        Polygons mesh;
        for (const Element& element : elements_)
            for (std::uint64_t i = 0; i < element.count; ++i) record(element, i, mesh);
        if (ascii_) skip_space();
        if (!rest_.empty())
            throw Error("{}: expected the end after the last element, found {} bytes", path_, rest_.size());
        for (const Polygons::Corner& c : mesh.corners)
            if (c.position >= mesh.positions.size())
                throw Error("{}: face: expected the number of one of {} vertices, found {}", path_,
                            mesh.positions.size(), c.position);
        return mesh;
    }

  private:
    void header() {
        std::vector<std::string_view> words;
        std::size_t number = 0;
        for (bool format = false;;) {
            const std::size_t size = rest_.find('\n');
            if (size == rest_.npos) throw Error("{}:{}: expected end_header, found the end", path_, number);
            std::string_view line = rest_.substr(0, size);
            rest_.remove_prefix(size + 1);
            ++number;
            const auto fail = [&](const char* expected) {
                throw Error("{}:{}: expected {}, found {}", path_, number, expected, printable(line));
            };
            const auto type = [&](std::string_view name) -> const Type* {
                for (const Type& t : types)
                    if (name == t.name || name == t.other_name) return &t;
                fail("a type of PLY");
                return nullptr;
            };
            split(line, words);
            if (number == 1) {
                if (words.size() != 1 || words[0] != "ply") fail("ply");
            } else if (words.empty() || words[0] == "comment" || words[0] == "obj_info") {
            } else if (words[0] == "format") {
                if (words.size() != 3 || words[2] != "1.0") fail("format NAME 1.0");
                ascii_ = words[1] == "ascii", big_endian_ = words[1] == "binary_big_endian";
                if (!ascii_ && !big_endian_ && words[1] != "binary_little_endian")
                    fail("ascii, binary_little_endian or binary_big_endian");
                format = true;
            } else if (words[0] == "element") {
                std::int64_t count = 0;
                if (words.size() != 3 || !read_whole(words[2], count) || count < 0) fail("element NAME COUNT");
                for (const Element& e : elements_)
                    if (e.name == words[1]) fail("each element once");
                elements_.push_back({std::string(words[1]), std::uint64_t(count), {}});
            } else if (words[0] == "property") {
                if (elements_.empty()) fail("an element before its properties");
                if (words.size() == 3)
                    elements_.back().properties.push_back({std::string(words[2]), type(words[1]), nullptr});
                else if (words.size() == 5 && words[1] == "list")
                    elements_.back().properties.push_back({std::string(words[4]), type(words[3]), type(words[2])});
                else
                    fail("property TYPE NAME or property list TYPE TYPE NAME");
            } else if (words[0] == "end_header") {
                if (!format) fail("format before end_header");
                break;
            } else {
                fail("a line of a PLY header");
            }
        }
        for (const Element& e : elements_) {
            // A record is at least a byte long, so an impossible count is detected before the first record is read.
            if (e.count > rest_.size() || (e.properties.empty() && e.count > 0))
                throw Error("{}: element {}: expected a count that fits {} bytes, found {}", path_, printable(e.name),
                            rest_.size(), e.count);
        }
    }

    void skip_space() {
        const std::size_t at = rest_.find_first_not_of(" \t\r\n");
        rest_.remove_prefix(std::min(rest_.size(), at));
    }

    double value(const Type& type, const Element& element, std::uint64_t i, const Property& property) {
        double x = 0;
        if (ascii_) {
            skip_space();
            const std::string_view word = rest_.substr(0, std::min(rest_.size(), rest_.find_first_of(" \t\r\n")));
            if (!read_number(word, x))
                throw Error("{}: {} {}: {}: expected a number, found {}", path_, printable(element.name), i,
                            printable(property.name), word.empty() ? "the end" : printable(word));
            rest_.remove_prefix(word.size());
        } else {
            if (rest_.size() < type.bytes)
                throw Error("{}: {} {}: {}: expected {} bytes, found the end", path_, printable(element.name), i,
                            printable(property.name), type.bytes);
            x = type.load(rest_.data(), big_endian_);
            rest_.remove_prefix(type.bytes);
        }
        return x;
    }

    void record(const Element& element, std::uint64_t i, Polygons& mesh) {
        static constexpr const char* names[6] = {"x", "y", "z", "nx", "ny", "nz"};
        const bool vertex = element.name == "vertex", face = element.name == "face";
        std::array<float, 6> v{};
        unsigned found = 0;
        for (const Property& p : element.properties) {
            const auto fail = [&](const std::string& expected, double x) {
                throw Error("{}: {} {}: {}: expected {}, found {:g}", path_, printable(element.name), i,
                            printable(p.name), expected, x);
            };
            if (p.count == nullptr) {
                const double x = value(*p.type, element, i, p);
                for (unsigned k = 0; vertex && k < 6; ++k) {
                    if (p.name != names[k]) continue;
                    if (!(std::abs(x) <= 1e9)) fail("a number up to 1e9", x);
                    v[k] = float(x), found |= 1u << k;
                }
                continue;
            }
            const double size = value(*p.count, element, i, p);
            const bool outline = face && (p.name == "vertex_indices" || p.name == "vertex_index");
            if (!(size >= 0 && size <= double(rest_.size())) || size != std::floor(size))
                fail("a length that fits", size);
            if (outline && (size < 3 || size > double(most_corners)))
                fail(fmt::format("3 to {} corners", most_corners), size);
            for (std::uint64_t k = 0; k < std::uint64_t(size); ++k) {
                const double x = value(*p.type, element, i, p);
                if (!outline) continue;
                if (!(x >= 0 && x < double(Polygons::none)) || x != std::floor(x)) fail("the number of a vertex", x);
                const auto index = std::uint32_t(x);
                mesh.corners.push_back({index, (normals_ ? index : Polygons::none)});
            }
            if (outline) mesh.ends.push_back(mesh.corners.size());
        }
        if (!vertex) return;
        if ((found & 7) != 7) throw Error("{}: vertex: expected properties x, y and z", path_);
        mesh.positions.push_back({v[0], v[1], v[2]});
        if ((found & 56) == 56) mesh.normals.push_back({v[3], v[4], v[5]}), normals_ = true;
    }

    const std::string& path_;
    std::string_view rest_;
    std::vector<Element> elements_;
    bool ascii_ = false, big_endian_ = false, normals_ = false;
};

}  // namespace

Polygons read_ply(const std::string& path, const std::string& bytes) { return PlyReader(path, bytes).read(); }

}  // namespace medulla::render
