// Triangle meshes: their area, uniform points on them, and the triangulation of polygons from files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "render/file.hpp"
#include "render/random.hpp"
#include "render/vector.hpp"

namespace medulla::render {

struct SurfacePoint {
    Vec3 position, normal;
    float fur = 1;  ///< multiplies the length of hairs that grow here; 0: none grow
};

struct Mesh {
    std::vector<Vec3> positions, normals;
    std::vector<float> fur;              ///< SurfacePoint::fur of each vertex; empty: 1
    std::vector<std::uint32_t> indices;  ///< three a triangle, counter-clockwise seen from outside
    std::vector<double> area;            ///< of the triangles up to and including this one; only where points are drawn
    Rgb albedo;

    SurfacePoint at(std::size_t triangle, float u, float v) const;
    /// Drops triangles without area and fills `area`.
    void measure();
};
SurfacePoint sample_surface(const Mesh& mesh, Sequence& random);

/// A mesh as files have it: polygons whose corners are indices.
struct Polygons {
    static constexpr std::uint32_t none = 0xffffffffu;
    struct Corner {
        std::uint32_t position, normal = none;
    };
    std::vector<Vec3> positions, normals;
    std::vector<Corner> corners;
    std::vector<std::size_t> ends;  ///< of each polygon, in corners
};

struct MeshFile {
    Placement placement;
    bool clockwise = false;  ///< faces seen from outside
};

inline constexpr std::size_t most_corners = 1024;  ///< of one polygon: clipping ears takes the cube of it at worst
inline constexpr std::uint64_t greatest_mesh_file = std::uint64_t(1) << 32;

/// The format is chosen by the end of the file's name. Throws Error: file, place, expected, found.
Mesh read_mesh(const std::string& path, const std::string& bytes, const MeshFile& how);
Polygons read_obj(const std::string& path, const std::string& bytes);
Polygons read_ply(const std::string& path, const std::string& bytes);

/// Cuts polygons into triangles by clipping ears: three indices into `corner` each.
std::vector<std::uint32_t> triangulate(const std::vector<Vec3>& corner);

}  // namespace medulla::render
