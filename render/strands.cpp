#include "render/strands.hpp"

#include "render/error.hpp"

namespace medulla::render {
namespace {

void put(Vec3 p, float radius, Strands& strands) { strands.points.push_back({p.x, p.y, p.z, radius}); }

/// Segments over the control points from `first` on.
void close_segments(std::size_t first, Strands& strands) {
    // Embree counts in 32 bits.
    if (strands.points.size() >= 0xffffffffu) throw Error("strands: expected fewer than 2^32 control points");
    for (std::size_t k = first; k + 3 < strands.points.size(); ++k) {
        strands.first_point.push_back(std::uint32_t(k));
        strands.strand_of.push_back(std::uint32_t(strands.count()));
    }
}

}  // namespace

void end_strand(Strands& strands) { strands.first_segment.push_back(std::uint32_t(strands.first_point.size())); }

void append_along(const std::vector<Vec3>& line, const std::vector<float>& radius, Strands& strands) {
    const std::size_t first = strands.points.size(), last = line.size() - 1;
    put(2 * line[0] - line[1], 2 * radius[0] - radius[1], strands);
    for (std::size_t k = 0; k <= last; ++k) put(line[k], radius[k], strands);
    put(2 * line[last] - line[last - 1], std::max(0.0f, 2 * radius[last] - radius[last - 1]), strands);
    close_segments(first, strands);
    end_strand(strands);
}

void append_through(const std::vector<Vec3>& line, const std::vector<float>& radius, Strands& strands) {
    // (c[k-1] + 4 c[k] + c[k+1]) / 6 = line[k]; no curvature at the ends, where then c[0] = line[0]. Thomas' algorithm:
    // the matrix is diagonally dominant, with pivots above 3.7.
    const std::size_t last = line.size() - 1, begin = strands.points.size();
    std::vector<Vec3> c = line;
    std::vector<float> upper(line.size(), 0.0f);
    for (std::size_t k = 1; k < last; ++k) {
        const float pivot = 4 - upper[k - 1];
        upper[k] = 1 / pivot;
        c[k] = (1 / pivot) * (6.0f * line[k] - c[k - 1]);
    }
    for (std::size_t k = last; k-- > 1;) c[k] = c[k] - upper[k] * c[k + 1];
    const auto end_radius = [](float end, float next) { return std::max(0.0f, 2 * end - next); };
    put(2 * c[0] - c[1], end_radius(radius[0], radius[1]), strands);
    for (std::size_t k = 0; k <= last; ++k) put(c[k], radius[k], strands);
    put(2 * c[last] - c[last - 1], end_radius(radius[last], radius[last - 1]), strands);
    close_segments(begin, strands);
    end_strand(strands);
}

void add_bezier(const Vec3 (&p)[4], float radius_0, float radius_1, Strands& strands) {
    const std::size_t first = strands.points.size();
    const float step = radius_1 - radius_0;
    put(6.0f * p[0] - 7.0f * p[1] + 2.0f * p[2], radius_0 - step, strands);
    put(2.0f * p[1] - p[2], radius_0, strands);
    put(2.0f * p[2] - p[1], radius_1, strands);
    put(6.0f * p[3] - 7.0f * p[2] + 2.0f * p[1], radius_1 + step, strands);
    close_segments(first, strands);
}

void add_bspline(const std::vector<Vec3>& p, float radius_0, float radius_1, Strands& strands) {
    const std::size_t first = strands.points.size();
    const float step = (radius_1 - radius_0) / float(p.size() - 3);
    for (std::size_t k = 0; k < p.size(); ++k) put(p[k], radius_0 + (float(k) - 1) * step, strands);
    close_segments(first, strands);
}

void thin(Strands& strands, double share) {
    if (share >= 1) return;
    Strands kept;
    kept.along = strands.along, kept.textures = strands.textures;
    kept.colour_noise = strands.colour_noise, kept.seed = strands.seed;
    for (std::size_t i = 0; i < strands.count(); ++i) {
        if (i > 0 && double(unit_float(hash(0x7a3d0b1fu, std::uint32_t(i)))) >= share) continue;
        for (std::size_t k = strands.first_segment[i]; k < strands.first_segment[i + 1]; ++k) {
            const CurvePoint* p = strands.points.data() + strands.first_point[k];
            const bool goes_on =
                k > strands.first_segment[i] && strands.first_point[k] == strands.first_point[k - 1] + 1;
            kept.points.insert(kept.points.end(), goes_on ? p + 3 : p, p + 4);
            kept.first_point.push_back(std::uint32_t(kept.points.size() - 4));
            kept.strand_of.push_back(std::uint32_t(kept.count()));
        }
        end_strand(kept);
    }
    strands = std::move(kept);
}

}  // namespace medulla::render
