#include "render/shape.hpp"

namespace medulla::render {
namespace {

SurfacePoint on_sphere(const Shape& s, float u, float v) {  // u around y, v from the south pole, by area
    const float y = 2 * v - 1, r = std::sqrt(std::max(0.0f, 1 - y * y)), a = 2 * pi_f * u;
    const Vec3 n{r * std::sin(a), y, r * std::cos(a)};
    return {s.centre + s.radius * n, n};
}

SurfacePoint on_torus(const Shape& s, float around, float tube_angle) {
    const Vec3 out{std::sin(around), 0, std::cos(around)};
    const Vec3 n = std::cos(tube_angle) * out + Vec3{0, std::sin(tube_angle), 0};
    return {s.centre + s.radius * out + s.tube * n, n};
}

/// A grid of (columns + 1) x (rows + 1) points whose outside is that of d/du x d/dv.
template <class At>
Mesh grid(std::uint32_t columns, std::uint32_t rows, Rgb albedo, At&& at) {
    Mesh mesh;
    mesh.albedo = albedo;
    for (std::uint32_t j = 0; j <= rows; ++j)
        for (std::uint32_t i = 0; i <= columns; ++i) {
            const SurfacePoint p = at(float(i) / float(columns), float(j) / float(rows));
            mesh.positions.push_back(p.position), mesh.normals.push_back(p.normal);
        }
    for (std::uint32_t j = 0; j < rows; ++j)
        for (std::uint32_t i = 0; i < columns; ++i) {
            const std::uint32_t a = j * (columns + 1) + i, b = a + 1, c = a + columns + 1, d = c + 1;
            mesh.indices.insert(mesh.indices.end(), {a, b, d, a, d, c});
        }
    return mesh;
}

}  // namespace

float area_of(const Shape& s) {
    switch (s.form) {
        case Form::patch:
            return s.width * s.depth;
        case Form::sphere:
            return 4 * pi_f * s.radius * s.radius;
        case Form::torus:
            return 4 * pi_f * pi_f * s.radius * s.tube;
        case Form::mesh:
        case Form::creature:
            return float(s.mesh->area.back());
    }
    return 0;
}

SurfacePoint sample_surface(const Shape& s, Sequence& random) {
    if (s.mesh != nullptr) return sample_surface(*s.mesh, random);
    const float u = random(), v = random();
    if (s.form == Form::patch) return {s.centre + Vec3{(u - 0.5f) * s.width, 0, (v - 0.5f) * s.depth}, {0, 1, 0}};
    if (s.form == Form::sphere) return on_sphere(s, u, v);
    float angle = 2 * pi_f * v;  // the outside of the tube has more area: rejected in proportion
    while (random() * (s.radius + s.tube) > s.radius + s.tube * std::cos(angle)) angle = 2 * pi_f * random();
    return on_torus(s, 2 * pi_f * u, angle);
}

Mesh mesh_of(const Shape& s, Rgb albedo) {
    switch (s.form) {
        case Form::patch:
            return grid(1, 1, albedo, [&](float u, float v) -> SurfacePoint {
                return {s.centre + Vec3{(u - 0.5f) * s.width, 0, (0.5f - v) * s.depth}, {0, 1, 0}};
            });
        case Form::sphere:  // rows even in the polar angle
            return grid(256, 128, albedo, [&](float u, float v) {
                const float half = std::sin(0.5f * pi_f * v);
                return on_sphere(s, u, half * half);
            });
        case Form::mesh:
        case Form::creature: {
            Mesh mesh = *s.mesh;
            mesh.albedo = albedo;
            return mesh;
        }
        case Form::torus:
            break;
    }
    return grid(256, 96, albedo, [&](float u, float v) { return on_torus(s, 2 * pi_f * u, 2 * pi_f * v); });
}

Mesh mesh_of(const Ground& g) {
    if (g.wall == 0)
        return grid(1, 1, g.colour, [&](float u, float v) -> SurfacePoint {
            return {{(2 * u - 1) * g.size, g.height, (1 - 2 * v) * g.size}, {0, 1, 0}};
        });
    // The profile from front to back: floor, a quarter turn of radius wall / 2, the wall.
    constexpr std::uint32_t turn = 64;
    const float r = 0.5f * g.wall;
    return grid(1, turn + 2, g.colour, [&](float u, float v) -> SurfacePoint {
        const float step = v * float(turn + 2) - 1, x = (2 * u - 1) * g.size;
        if (step < -0.5f) return {{x, g.height, g.size}, {0, 1, 0}};
        if (step > float(turn) + 0.5f) return {{x, g.height + r + g.size, -2 * r}, {0, 0, 1}};
        const float a = 0.5f * pi_f * step / float(turn);
        const Vec3 n{0, std::cos(a), std::sin(a)};
        return {Vec3{x, g.height + r, -r} - r * n, n};
    });
}

}  // namespace medulla::render
