// Strands as uniform cubic B-splines, each with its own number of segments, and the functions that make them.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "render/random.hpp"
#include "render/vector.hpp"

namespace medulla::render {

/// The material at a position along the strand; between two stops, every parameter is interpolated.
struct Stop {
    float at;  ///< 0 root, 1 tip
    int material;
};

struct Texture;

struct CurvePoint {
    float x, y, z, radius;
};

struct Strands {
    std::vector<Stop> along;
    std::vector<std::shared_ptr<const Texture>> textures;
    float colour_noise = 0;
    std::uint32_t seed = 0;
    std::vector<CurvePoint> points;               ///< control points
    std::vector<std::uint32_t> first_point;       ///< of each segment, the first of its four
    std::vector<std::uint32_t> strand_of;         ///< of each segment
    std::vector<std::uint32_t> first_segment{0};  ///< of each strand, and one past the last

    std::size_t count() const { return first_segment.size() - 1; }
    std::uint32_t segments(std::uint32_t strand) const { return first_segment[strand + 1] - first_segment[strand]; }
    /// Where a strand's spline begins.
    Vec3 root(std::uint32_t strand) const {
        const CurvePoint* p = points.data() + first_point[first_segment[strand]];
        return {(p[0].x + 4 * p[1].x + p[2].x) / 6, (p[0].y + 4 * p[1].y + p[2].y) / 6,
                (p[0].z + 4 * p[1].z + p[2].z) / 6};
    }
    /// Factor of sigma_ca.
    float colour_of(std::uint32_t strand) const {
        return colour_noise == 0 ? 1 : std::exp(colour_noise * (2 * unit_float(hash(seed ^ 0x2545f491u, strand)) - 1));
    }
};

/// Appends a strand whose spline follows `line`, begins and ends there, and passes inside the corners between.
void append_along(const std::vector<Vec3>& line, const std::vector<float>& radius, Strands& strands);
/// Appends the natural spline through all points of `line`, to rounding. The radius at a point is a mean of its own
/// (4/6) and its neighbours', so that it is never negative.
void append_through(const std::vector<Vec3>& line, const std::vector<float>& radius, Strands& strands);
/// Adds one cubic Bezier segment, exactly, to the strand that `end_strand` closes.
void add_bezier(const Vec3 (&p)[4], float radius_0, float radius_1, Strands& strands);
/// Adds the segments of a uniform B-spline by its control points (four or more); radii are linear from the first to the
/// last.
void add_bspline(const std::vector<Vec3>& p, float radius_0, float radius_1, Strands& strands);
void end_strand(Strands& strands);

/// Keeps this share of the strands, at least one. The choice depends on their number alone.
void thin(Strands& strands, double share);

}  // namespace medulla::render
