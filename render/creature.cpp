#include "render/creature.hpp"

#include <unordered_map>

namespace medulla::render {
namespace {

constexpr double most_cells = 1 << 20;
constexpr float cells_per_radius = 6;  // of the smallest ball

struct Grid {
    Vec3 low;
    float cell;
    std::uint32_t count[3];  ///< of nodes

    std::uint64_t node(std::uint32_t i, std::uint32_t j, std::uint32_t k) const {
        return (std::uint64_t(k) * count[1] + j) * count[0] + i;
    }
    Vec3 position(std::uint64_t node) const {
        const auto i = node % count[0], j = node / count[0] % count[1], k = node / count[0] / count[1];
        return low + cell * Vec3{float(i), float(j), float(k)};
    }
};

Grid grid_about(const std::vector<Ball>& balls, float blend) {
    Vec3 low = balls[0].centre, high = low;
    float smallest = balls[0].radius;
    const float swelling = blend * std::log(float(balls.size()));  // bound of how far the union exceeds a ball
    for (const Ball& b : balls) {
        const float r = b.radius + swelling;
        low = {std::min(low.x, b.centre.x - r), std::min(low.y, b.centre.y - r), std::min(low.z, b.centre.z - r)};
        high = {std::max(high.x, b.centre.x + r), std::max(high.y, b.centre.y + r), std::max(high.z, b.centre.z + r)};
        smallest = std::min(smallest, b.radius);
    }
    const Vec3 size = high - low;
    const float coarsest = std::cbrt(float(double(size.x) * double(size.y) * double(size.z) / most_cells));
    Grid grid{};
    grid.cell = std::max(smallest / cells_per_radius, std::max(coarsest, greatest(size) / 1000));
    // Nodes on a ball's surface would make triangles without area. Balls often have round coordinates: shift by a
    // third.
    grid.low = low - 1.35f * grid.cell * Vec3{1, 1, 1};
    const float extent[3] = {size.x, size.y, size.z};
    for (int a = 0; a < 3; ++a) grid.count[a] = std::uint32_t(std::ceil(extent[a] / grid.cell)) + 4;
    return grid;
}

/// f at every node; far from the surface, another value of the same sign.
std::vector<float> values(const Blend& field, const Grid& grid) {
    std::vector<float> f(std::size_t(grid.count[0]) * grid.count[1] * grid.count[2]);
    constexpr std::uint32_t block = 4;
    // f changes by no more than the distance: its gradient is a mean of unit vectors.
    const float reach = 0.5f * std::sqrt(3.0f) * float(block) * grid.cell;
    for (std::uint32_t k0 = 0; k0 < grid.count[2]; k0 += block)
        for (std::uint32_t j0 = 0; j0 < grid.count[1]; j0 += block)
            for (std::uint32_t i0 = 0; i0 < grid.count[0]; i0 += block) {
                const Vec3 middle{float(i0), float(j0), float(k0)};
                const float whole = field.at(grid.low + grid.cell * (middle + 0.5f * float(block) * Vec3{1, 1, 1})).f;
                for (std::uint32_t k = k0; k < std::min(k0 + block, grid.count[2]); ++k)
                    for (std::uint32_t j = j0; j < std::min(j0 + block, grid.count[1]); ++j)
                        for (std::uint32_t i = i0; i < std::min(i0 + block, grid.count[0]); ++i) {
                            const std::uint64_t n = grid.node(i, j, k);
                            f[n] = std::abs(whole) > reach ? whole : field.at(grid.position(n)).f;
                        }
            }
    return f;
}

}  // namespace

Blend::Value Blend::at(Vec3 p) const {
    float least = 1e30f;
    for (const Ball& b : balls) least = std::min(least, length(p - b.centre) - b.radius);
    float sum = 0, fur = 0;
    Vec3 gradient;
    for (const Ball& b : balls) {
        const Vec3 d = p - b.centre;
        const float r = length(d), farther = (r - b.radius - least) / blend;
        if (farther > 20) continue;  // its share would be lost in rounding
        const float weight = std::exp(-farther);
        sum += weight, fur += weight * b.fur;
        if (r > 0) gradient += (weight / r) * d;
    }
    return {least - blend * std::log(sum), (1 / sum) * gradient, fur / sum};
}

Mesh creature(const std::vector<Ball>& balls, float blend, const Placement& placement) {
    const Blend field{balls, blend};
    const Grid grid = grid_about(balls, blend);
    const std::vector<float> f = values(field, grid);

    Mesh mesh;
    std::vector<Vec3> positions;  // in the balls' frame
    std::unordered_map<std::uint64_t, std::uint32_t> vertex_of_edge;
    const auto vertex = [&](std::uint64_t a, std::uint64_t b) {
        if (a > b) std::swap(a, b);
        // b - a is one of seven steps to nodes with a coordinate or more greater by 1.
        const auto [at, added] = vertex_of_edge.emplace(
            a * 8 +
                [&] {
                    const std::uint64_t step = b - a, row = grid.count[0], plane = row * grid.count[1];
                    std::uint64_t key = 0, rest = step;
                    if (rest >= plane) key |= 4, rest -= plane;
                    if (rest >= row) key |= 2, rest -= row;
                    return key | rest;
                }(),
            std::uint32_t(positions.size()));
        if (!added) return at->second;
        // The position on the edge by bisection, clamped away from the nodes, where triangles would lose their area.
        // Newton's method along the normal then moves it back to the surface.
        const Vec3 from = grid.position(a), to = grid.position(b);
        float low = 0, high = 1;
        for (int step = 0; step < 8; ++step) {
            const float middle = 0.5f * (low + high);
            ((field.at(mix(from, to, middle)).f < 0) == (f[a] < 0) ? low : high) = middle;
        }
        Vec3 p = mix(from, to, std::clamp(low, 0.1f, 0.9f));
        for (int step = 0; step < 16; ++step) {
            const Blend::Value v = field.at(p);
            if (std::abs(v.f) < 1e-6f) break;
            const float slope = std::max(0.1f, dot(v.gradient, v.gradient));
            p += std::clamp(-v.f / slope, -0.2f * grid.cell, 0.2f * grid.cell) * v.gradient;
        }
        const Blend::Value v = field.at(p);
        positions.push_back(p);
        mesh.normals.push_back(placement.direction(normalise(v.gradient)));
        mesh.fur.push_back(v.fur);
        return at->second;
    };
    const auto triangle = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, Vec3 outwards) {
        const Vec3 n = cross(positions[b] - positions[a], positions[c] - positions[a]);
        if (dot(n, outwards) < 0) std::swap(b, c);
        mesh.indices.insert(mesh.indices.end(), {a, b, c});
    };

    // Each cell is six tetrahedra about its diagonal (Kuhn 1960), which meet those of the next cell face to face.
    constexpr int orders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    for (std::uint32_t k = 0; k + 1 < grid.count[2]; ++k)
        for (std::uint32_t j = 0; j + 1 < grid.count[1]; ++j)
            for (std::uint32_t i = 0; i + 1 < grid.count[0]; ++i)
                for (const auto& order : orders) {
                    std::uint32_t at[3] = {i, j, k};
                    std::uint64_t inside[4], outside[4];
                    int in = 0, out = 0;
                    for (int corner = 0; corner < 4; ++corner) {
                        const std::uint64_t n = grid.node(at[0], at[1], at[2]);
                        (f[n] < 0 ? inside[in++] : outside[out++]) = n;
                        if (corner < 3) ++at[order[corner]];
                    }
                    if (in == 0 || out == 0) continue;
                    Vec3 from, to;
                    for (int c = 0; c < in; ++c) from += (1 / float(in)) * grid.position(inside[c]);
                    for (int c = 0; c < out; ++c) to += (1 / float(out)) * grid.position(outside[c]);
                    if (in == 2) {
                        const std::uint32_t a = vertex(inside[0], outside[0]), b = vertex(inside[0], outside[1]),
                                            c = vertex(inside[1], outside[1]), d = vertex(inside[1], outside[0]);
                        triangle(a, b, c, to - from), triangle(a, c, d, to - from);
                    } else {
                        const std::uint64_t tip = in == 1 ? inside[0] : outside[0], *base = in == 1 ? outside : inside;
                        triangle(vertex(tip, base[0]), vertex(tip, base[1]), vertex(tip, base[2]), to - from);
                    }
                }
    for (const Vec3& p : positions) mesh.positions.push_back(placement.point(p));
    mesh.measure();
    return mesh;
}

const std::vector<Ball>& fox() {
    static const std::vector<Ball> balls = [] {
        std::vector<Ball> b;
        // Balls between the given ones, near enough to each other that no seams show.
        const auto chain = [&](const std::vector<Ball>& keys) {
            b.push_back(keys[0]);
            for (std::size_t k = 1; k < keys.size(); ++k) {
                const Ball &p = keys[k - 1], &q = keys[k];
                const int pieces = int(std::ceil(length(q.centre - p.centre) / (0.5f * std::min(p.radius, q.radius))));
                for (int i = 1; i <= pieces; ++i) {
                    const float t = float(i) / float(pieces);
                    b.push_back({mix(p.centre, q.centre, t), mix(p.radius, q.radius, t), mix(p.fur, q.fur, t)});
                }
            }
        };
        // Tail, back, neck, head and muzzle.
        chain({{{-1.72f, 0.42f, 0}, 0.04f, 1.0f},
               {{-1.58f, 0.43f, 0}, 0.09f, 1.4f},
               {{-1.30f, 0.50f, 0}, 0.13f, 1.5f},
               {{-1.05f, 0.62f, 0}, 0.12f, 1.4f},
               {{-0.82f, 0.76f, 0}, 0.12f, 1.1f},
               {{-0.55f, 0.79f, 0}, 0.23f},
               {{-0.20f, 0.77f, 0}, 0.22f},
               {{0.32f, 0.78f, 0}, 0.25f},
               {{0.50f, 0.82f, 0}, 0.21f},
               {{0.66f, 0.98f, 0}, 0.17f, 0.9f},
               {{0.74f, 1.10f, 0}, 0.165f, 0.7f},
               {{0.86f, 1.20f, 0}, 0.18f, 0.22f},
               {{1.00f, 1.155f, 0}, 0.105f, 0.18f},
               {{1.10f, 1.125f, 0}, 0.07f, 0.12f},
               {{1.18f, 1.105f, 0}, 0.045f, 0.08f}});
        for (const float side : {-1.0f, 1.0f}) {
            const auto at = [&](float x, float y, float z) { return Vec3{x, y, side * z}; };
            chain({{at(0.84f, 1.13f, 0.11f), 0.09f, 0.7f}, {at(0.94f, 1.12f, 0.06f), 0.09f, 0.3f}});  // cheek
            chain({{at(0.78f, 1.34f, 0.10f), 0.08f, 0.15f},                                           // ear
                   {at(0.76f, 1.44f, 0.125f), 0.055f, 0.1f},
                   {at(0.745f, 1.58f, 0.15f), 0.022f, 0.1f}});
            chain({{at(0.40f, 0.68f, 0.12f), 0.14f, 0.7f},  // foreleg
                   {at(0.43f, 0.45f, 0.13f), 0.08f, 0.35f},
                   {at(0.43f, 0.25f, 0.13f), 0.06f, 0.2f},
                   {at(0.44f, 0.08f, 0.13f), 0.055f, 0.12f},
                   {at(0.51f, 0.055f, 0.13f), 0.05f, 0.1f}});
            chain({{at(-0.54f, 0.70f, 0.12f), 0.19f, 0.9f},  // hind leg
                   {at(-0.58f, 0.55f, 0.14f), 0.15f, 0.6f},
                   {at(-0.70f, 0.33f, 0.15f), 0.07f, 0.3f},
                   {at(-0.69f, 0.10f, 0.15f), 0.055f, 0.15f},
                   {at(-0.60f, 0.055f, 0.15f), 0.05f, 0.1f}});
        }
        return b;
    }();
    return balls;
}

}  // namespace medulla::render
