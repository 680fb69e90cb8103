#include "render/mesh.hpp"

#include <unordered_map>

#include "render/error.hpp"

namespace medulla::render {
namespace {

Vec3 area_vector(const Mesh& m, std::size_t triangle) {
    const std::uint32_t* i = m.indices.data() + 3 * triangle;
    const Vec3 a = m.positions[i[0]];
    return 0.5f * cross(m.positions[i[1]] - a, m.positions[i[2]] - a);
}

Mesh mesh_of(const Polygons& polygons, const MeshFile& how) {
    // One vertex for each pair of position and normal. Where the file has no normal, it is the area-weighted mean of
    // the faces around the position.
    std::vector<Vec3> positions, faces(polygons.positions.size());
    for (const Vec3& p : polygons.positions) positions.push_back(how.placement.point(p));
    struct Triangle {
        Polygons::Corner corner[3];
    };
    std::vector<Triangle> triangles;
    std::vector<Vec3> outline;
    std::size_t begin = 0;
    for (const std::size_t end : polygons.ends) {
        outline.clear();
        for (std::size_t k = begin; k < end; ++k) outline.push_back(positions[polygons.corners[k].position]);
        const std::vector<std::uint32_t> cut = triangulate(outline);
        for (std::size_t k = 0; k + 2 < cut.size(); k += 3) {
            Triangle t;
            for (std::size_t j = 0; j < 3; ++j)
                t.corner[how.clockwise ? 2 - j : j] = polygons.corners[begin + cut[k + j]];
            const Vec3 a = positions[t.corner[0].position];
            const Vec3 n = cross(positions[t.corner[1].position] - a, positions[t.corner[2].position] - a);
            for (const Polygons::Corner& c : t.corner) faces[c.position] += n;
            triangles.push_back(t);
        }
        begin = end;
    }
    Mesh mesh;
    std::unordered_map<std::uint64_t, std::uint32_t> vertices;
    for (const Triangle& t : triangles)
        for (const Polygons::Corner& c : t.corner) {
            const std::uint64_t key = std::uint64_t(c.position) << 32 | c.normal;
            const auto [at, added] = vertices.emplace(key, std::uint32_t(mesh.positions.size()));
            mesh.indices.push_back(at->second);
            if (!added) continue;
            mesh.positions.push_back(positions[c.position]);
            Vec3 n =
                c.normal == Polygons::none ? faces[c.position] : how.placement.direction(polygons.normals[c.normal]);
            if (!(length(n) > 0)) n = faces[c.position];
            mesh.normals.push_back(length(n) > 0 ? normalise(n) : Vec3{0, 1, 0});
        }
    return mesh;
}

}  // namespace

SurfacePoint Mesh::at(std::size_t triangle, float u, float v) const {
    const std::uint32_t *i = indices.data() + 3 * triangle, a = i[0], b = i[1], c = i[2];
    const float w = 1 - u - v;
    SurfacePoint p{w * positions[a] + u * positions[b] + v * positions[c],
                   normalise(w * normals[a] + u * normals[b] + v * normals[c])};
    if (!finite(p.normal)) p.normal = normalise(area_vector(*this, triangle));  // opposite normals at the corners
    if (!fur.empty()) p.fur = w * fur[a] + u * fur[b] + v * fur[c];
    return p;
}

void Mesh::measure() {
    std::vector<std::uint32_t> kept;
    area.clear();
    double sum = 0;
    for (std::size_t t = 0; t < indices.size() / 3; ++t) {
        const float a = length(area_vector(*this, t));
        if (!(a > 0)) continue;
        kept.insert(kept.end(), indices.begin() + std::ptrdiff_t(3 * t), indices.begin() + std::ptrdiff_t(3 * t + 3));
        area.push_back(sum += double(a));
    }
    indices = std::move(kept);
}

SurfacePoint sample_surface(const Mesh& mesh, Sequence& random) {
    const float pick = random(), s = std::sqrt(random()), v = random();
    const auto at = std::upper_bound(mesh.area.begin(), mesh.area.end(), double(pick) * mesh.area.back());
    const std::size_t triangle = std::min(std::size_t(at - mesh.area.begin()), mesh.area.size() - 1);
    return mesh.at(triangle, s * (1 - v), s * v);
}

std::vector<std::uint32_t> triangulate(const std::vector<Vec3>& corner) {
    std::vector<std::uint32_t> left, cut;
    Vec3 normal;  // Newell's
    for (std::size_t k = 0; k < corner.size(); ++k) {
        left.push_back(std::uint32_t(k));
        normal += cross(corner[k] - corner[0], corner[(k + 1) % corner.size()] - corner[0]);
    }
    const auto turn = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        return dot(cross(corner[b] - corner[a], corner[c] - corner[a]), normal);
    };
    while (left.size() > 3) {
        std::size_t ear = left.size();
        for (std::size_t k = 0; k < left.size() && ear == left.size(); ++k) {
            const std::uint32_t a = left[(k + left.size() - 1) % left.size()], b = left[k],
                                c = left[(k + 1) % left.size()];
            bool clear = turn(a, b, c) > 0;
            for (const std::uint32_t p : left)
                if (clear && p != a && p != b && p != c)
                    clear = !(turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0);
            if (clear) ear = k;
        }
        if (ear == left.size()) ear = 1;  // self-intersecting or flat: any triangle will do
        const std::size_t n = left.size();
        cut.insert(cut.end(), {left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]});
        left.erase(left.begin() + std::ptrdiff_t(ear));
    }
    cut.insert(cut.end(), left.begin(), left.end());
    return cut;
}

Mesh read_mesh(const std::string& path, const std::string& bytes, const MeshFile& how) {
    if (!ends_with(path, ".obj") && !ends_with(path, ".ply"))
        throw Error("{}: expected a name that ends in .obj or .ply", path);
    Mesh mesh = mesh_of(ends_with(path, ".obj") ? read_obj(path, bytes) : read_ply(path, bytes), how);
    mesh.measure();
    if (mesh.area.empty() || !std::isfinite(mesh.area.back()))
        throw Error("{}: expected faces of area > 0, found none", path);
    return mesh;
}

}  // namespace medulla::render
