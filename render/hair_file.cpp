// Cem Yuksel's HAIR files: http://www.cemyuksel.com/research/hairmodels. Little-endian.
#include "render/error.hpp"
#include "render/strand_file.hpp"

namespace medulla::render {
namespace {

constexpr std::size_t header_bytes = 128;
enum Arrays : std::uint32_t { segments = 1, points = 2, thickness = 4, transparency = 8, colours = 16 };

}  // namespace

Strands read_hair(const std::string& path, const std::string& bytes, const StrandFile& how) {
    if (bytes.size() < header_bytes)
        throw Error("{}: expected a header of {} bytes, found {}", path, header_bytes, bytes.size());
    if (bytes.compare(0, 4, "HAIR") != 0) throw Error("{}: expected a file that begins with HAIR", path);
    const auto whole = [&](std::size_t at) { return load<std::uint32_t>(bytes.data() + at); };
    const std::uint64_t strand_count = whole(4), point_count = whole(8), arrays = whole(12), even = whole(16);
    const float even_thickness = load<float>(bytes.data() + 20);
    if (strand_count == 0) throw Error("{}: strands: expected at least one, found 0", path);
    if (arrays >= 32 || (arrays & points) == 0)
        throw Error("{}: arrays: expected points among bits 0 to 4, found {:#x}", path, arrays);

    // All sizes before any array is read; in 64 bits none of the products overflows.
    const std::uint64_t segment_bytes = (arrays & segments) != 0 ? 2 * strand_count : 0;
    const std::uint64_t floats =
        3 + ((arrays & thickness) != 0) + ((arrays & transparency) != 0) + 3 * std::uint64_t((arrays & colours) != 0);
    const std::uint64_t expected = header_bytes + segment_bytes + 4 * floats * point_count;
    if (bytes.size() != expected)
        throw Error("{}: expected {} bytes for {} strands of {} points and arrays {:#x}, found {}", path, expected,
                    strand_count, point_count, arrays, bytes.size());
    const char* segment_array = bytes.data() + header_bytes;
    const char* point_array = segment_array + segment_bytes;
    const char* thickness_array = point_array + 12 * point_count;
    const auto segments_of = [&](std::uint64_t strand) -> std::uint64_t {
        return segment_bytes > 0 ? load<std::uint16_t>(segment_array + 2 * strand) : even;
    };
    std::uint64_t sum = 0;
    for (std::uint64_t i = 0; i < strand_count; ++i) {
        if (segments_of(i) == 0) throw Error("{}: strand {}: expected at least one segment, found 0", path, i);
        sum += segments_of(i) + 1;
        if (sum > point_count) break;
    }
    if (sum != point_count)
        throw Error("{}: expected {} points, as the header has, found {} in the strands' segments", path, point_count,
                    sum > point_count ? "more" : std::to_string(sum));

    Strands strands;
    std::vector<Vec3> line;
    std::vector<float> radius;
    std::uint64_t next = 0;
    for (std::uint64_t i = 0; i < strand_count; ++i) {
        line.clear(), radius.clear();
        for (std::uint64_t k = 0, n = segments_of(i) + 1; k < n; ++k, ++next) {
            const char* at = point_array + 12 * next;
            const Vec3 p{load<float>(at), load<float>(at + 4), load<float>(at + 8)};
            const Vec3 placed = how.placement.point(p);
            if (!finite(placed) || greatest_size(placed) > 1e9f)
                throw Error("{}: strand {}, point {}: expected numbers up to 1e9, found {:g} {:g} {:g}", path, i, k,
                            p.x, p.y, p.z);
            float r = how.radius;
            if (r == 0) {
                const float wide = (arrays & thickness) != 0 ? load<float>(thickness_array + 4 * next) : even_thickness;
                if (!(wide >= 0 && wide <= 1e9f) || (wide == 0 && k == 0))
                    throw Error(
                        "{}: strand {}, point {}: thickness: expected a number > 0 (`radius` sets one), found {:g}",
                        path, i, k, wide);
                r = 0.5f * wide * how.placement.scale;
            }
            if (!line.empty() && !(length(placed - line.back()) > 0)) continue;  // a point twice
            line.push_back(placed), radius.push_back(r * how.radius_scale);
        }
        if (line.size() < 2) throw Error("{}: strand {}: expected a length > 0, found 0", path, i);
        append_through(line, radius, strands);
    }
    return strands;
}

Strands read_strands(const std::string& path, const std::string& bytes, const StrandFile& how) {
    if (ends_with(path, ".hair")) return read_hair(path, bytes, how);
    if (ends_with(path, ".pbrt")) return read_pbrt_curves(path, bytes, how);
    throw Error("{}: expected a name that ends in .hair or .pbrt", path);
}

}  // namespace medulla::render
