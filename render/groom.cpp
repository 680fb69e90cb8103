#include "render/groom.hpp"

#include "render/error.hpp"

namespace medulla::render {
namespace {

/// Points in a grid, whose cells are as wide as the greatest distance of a query. A hash table of lists in one array:
/// most cells that a query visits are empty, and cost one read.
class PointGrid {
  public:
    /// @param expected number of points
    PointGrid(float cell, std::size_t expected) : scale_(1 / double(cell)) {
        while (std::size_t(1) << (64 - shift_) < 2 * expected) --shift_;
        first_.assign(std::size_t(1) << (64 - shift_), none);
    }

    /// Points are numbered as they come.
    void add(Vec3 p) {
        const std::uint64_t k = key(cell(p.x), cell(p.y), cell(p.z));
        entries_.push_back({p, first_[list(k)], k});
        first_[list(k)] = std::uint32_t(entries_.size() - 1);
    }

    /// Calls visit(point, number) for every point within a cell's width of p and for some farther ones, those of its
    /// own cell first, until one returns false.
    template <class Visit>
    void around(Vec3 p, Visit&& visit) const {
        const std::int64_t x = cell(p.x), y = cell(p.y), z = cell(p.z);
        for (const int i : {0, -1, 1})
            for (const int j : {0, -1, 1})
                for (const int k : {0, -1, 1}) {
                    const std::uint64_t cell = key(x + i, y + j, z + k);
                    for (std::uint32_t at = first_[list(cell)]; at != none; at = entries_[at].next)
                        if (entries_[at].cell == cell && !visit(entries_[at].point, at)) return;
                }
    }

  private:
    static constexpr std::uint32_t none = 0xffffffffu;
    struct Entry {
        Vec3 point;
        std::uint32_t next;
        std::uint64_t cell;
    };
    std::int64_t cell(float x) const { return std::int64_t(std::floor(double(x) * scale_)); }
    static std::uint64_t key(std::int64_t x, std::int64_t y, std::int64_t z) {
        constexpr std::uint64_t low = (1 << 21) - 1;
        return (std::uint64_t(x) & low) << 42 | (std::uint64_t(y) & low) << 21 | (std::uint64_t(z) & low);
    }
    std::size_t list(std::uint64_t key) const { return std::size_t(key * 0x9e3779b97f4a7c15u >> shift_); }  // Fibonacci

    double scale_;
    int shift_ = 63;
    std::vector<std::uint32_t> first_;  ///< of each list
    std::vector<Entry> entries_;
};

/// Smooth noise in [-1, 1]: random values at integer coordinates, interpolated.
float value_noise(Vec3 p, std::uint32_t seed) {
    const float fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
    const float tx = smoothstep(0, 1, p.x - fx), ty = smoothstep(0, 1, p.y - fy), tz = smoothstep(0, 1, p.z - fz);
    const auto corner = [&](int i, int j, int k) {
        const auto at = [](float f, int d) { return std::uint32_t(std::int32_t(f) + d); };
        return 2 * unit_float(hash(hash(hash(seed, at(fx, i)), at(fy, j)), at(fz, k))) - 1;
    };
    const auto row = [&](int j, int k) { return mix(corner(0, j, k), corner(1, j, k), tx); };
    return mix(mix(row(0, 0), row(1, 0), ty), mix(row(0, 1), row(1, 1), ty), tz);
}

Vec3 rotate(Vec3 v, Vec3 axis, float angle) {
    const float c = std::cos(angle), s = std::sin(angle);
    return c * v + s * cross(axis, v) + (1 - c) * dot(axis, v) * axis;
}

/// The combed strand without curl and clumps: segments + 1 points from the skin outwards.
std::vector<Vec3> combed(const SurfacePoint& root, const Layer& layer, float length, float noise_a, float noise_b) {
    const Vec3 n = root.normal;
    const Vec3 comb = render::length(layer.comb) > 0 ? normalise(layer.comb) : Vec3{};
    Vec3 tangent = comb - dot(comb, n) * n;
    // Where the comb points into the skin, there is no direction to lean in. Hairs stand up there, without a seam.
    const float sure = std::min(1.0f, 2 * render::length(tangent));
    tangent = sure > 1e-4f ? normalise(tangent) : basis_about(n).y;
    if (layer.swirl > 0)
        tangent =
            rotate(tangent, n, layer.swirl * value_noise((1 / layer.swirl_size) * root.position, layer.seed ^ 77));
    const Vec3 side = cross(n, tangent);
    std::vector<Vec3> points{root.position - 0.03f * length * n};  // roots end inside the skin
    const float step = 1.03f * length / float(layer.segments);
    for (int k = 0; k < layer.segments; ++k) {
        const float s = (float(k) + 0.5f) / float(layer.segments);
        const float angle = sure * (layer.lean + layer.bend * s * s) + layer.noise * noise_a * (0.4f + s);
        const Vec3 w =
            std::cos(angle) * n + std::sin(angle) * tangent + std::tan(layer.noise) * noise_b * (0.4f + s) * side;
        points.push_back(points.back() + step * normalise(w));
    }
    return points;
}

}  // namespace

std::vector<SurfacePoint> poisson_disc(const Shape& shape, float distance, std::size_t count, std::uint32_t seed) {
    Sequence random(seed);
    PointGrid grid(distance, count);
    std::vector<SurfacePoint> points;
    std::size_t placed = 0;
    for (std::size_t tries = 0; placed < count && tries < 30 * count; ++tries) {
        const SurfacePoint p = sample_surface(shape, random);
        bool free = true;
        grid.around(p.position, [&](Vec3 q, std::uint32_t) {
            const Vec3 d = q - p.position;
            return free = dot(d, d) >= distance * distance;
        });
        if (!free) continue;
        grid.add(p.position), ++placed;
        if (p.fur > 0) points.push_back(p);  // bald skin still counts towards the density
    }
    return points;
}

Strands grow(const Shape& shape, const Layer& layer) {
    const double wanted = double(layer.density) * double(area_of(shape));
    const double most_strands = double(0xffffffffu) / (layer.segments + 3);  // control points, which Embree counts
    if (!(wanted < most_strands))
        throw Error("coat: expected at most {:.3g} strands, found {:.3g}", most_strands, wanted);
    const std::size_t count = std::max<std::size_t>(1, std::size_t(wanted + 0.5));
    // Saturated dart throwing reaches density x distance^2 = 0.69; at 0.53 few darts are lost.
    const float distance = std::sqrt(0.53f / layer.density);
    const std::vector<SurfacePoint> roots = poisson_disc(shape, distance, count, layer.seed);

    std::vector<std::vector<Vec3>> guides;
    const bool clumps = layer.clump_size > 0 && layer.clump_strength > 0;
    // Clumps of less than a strand each would be of no effect.
    const double most_guides = 1 + double(area_of(shape)) / (double(layer.clump_size) * double(layer.clump_size));
    const std::size_t most = clumps ? std::size_t(std::min(most_guides, double(count))) : 0;
    PointGrid guide_grid(clumps ? 2 * layer.clump_size : 1, most);
    if (clumps) {
        for (const SurfacePoint& centre : poisson_disc(shape, layer.clump_size, most, layer.seed ^ 0x5bd1e995u)) {
            guide_grid.add(centre.position);
            Sequence random(hash(layer.seed ^ 0x7f4a7c15u, std::uint32_t(guides.size())));
            const float a = random.even(), b = random.even();
            guides.push_back(combed(centre, layer, centre.fur * layer.length, a, b));
        }
    }

    Strands strands;
    strands.along = layer.along, strands.textures = layer.textures;
    strands.colour_noise = layer.colour_noise, strands.seed = layer.seed;
    strands.points.reserve(roots.size() * std::size_t(layer.segments + 3));
    std::vector<float> radius(std::size_t(layer.segments) + 1);
    for (std::size_t k = 0; k < radius.size(); ++k) {
        const float s = float(k) / float(layer.segments);
        radius[k] = layer.radius * mix(1.0f, layer.tip, s > layer.taper ? (s - layer.taper) / (1 - layer.taper) : 0.0f);
    }
    for (std::size_t i = 0; i < roots.size(); ++i) {
        Sequence random(hash(layer.seed, std::uint32_t(i)));
        const float length = roots[i].fur * layer.length * (1 + layer.length_noise * random.even());
        const float a = random.even(), b = random.even(), phase = 2 * pi_f * random();
        std::vector<Vec3> line = combed(roots[i], layer, length, a, b);
        if (!guides.empty()) {
            std::uint32_t nearest = 0;
            float least = 1e30f;
            guide_grid.around(roots[i].position, [&](Vec3 p, std::uint32_t index) {
                const Vec3 d = p - roots[i].position;
                if (dot(d, d) < least) least = dot(d, d), nearest = index;
                return true;
            });
            for (std::size_t k = 1; least < 1e30f && k < line.size(); ++k) {
                const float s = float(k) / float(layer.segments), pull = layer.clump_strength * std::pow(s, 1.5f);
                // Towards the guide strand at the same position; the strand keeps its length along it.
                line[k] = mix(line[k], guides[nearest][k], pull);
            }
        }
        if (layer.curl_radius > 0) {
            std::vector<Vec3> curled = line;
            for (std::size_t k = 1; k < line.size(); ++k) {
                const Vec3 along = normalise(line[k] - line[k - 1]);
                const Basis basis = basis_about(along);
                const float s = float(k) / float(layer.segments), angle = phase + 2 * pi_f * layer.curl_turns * s;
                const float r = layer.curl_radius * std::min(1.0f, 3 * s);
                curled[k] += r * std::cos(angle) * basis.y + r * std::sin(angle) * basis.z;
            }
            line = curled;
        }
        append_along(line, radius, strands);
    }
    return strands;
}

Strands strand_of(const SingleFibre& fibre) {
    Strands strands;
    strands.along = fibre.along;
    std::vector<float> radius;
    for (std::size_t k = 0; k < fibre.points.size(); ++k)
        radius.push_back(fibre.radius * mix(1.0f, fibre.tip, float(k) / float(fibre.points.size() - 1)));
    append_through(fibre.points, radius, strands);
    return strands;
}

}  // namespace medulla::render
