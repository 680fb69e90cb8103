#include "render/path.hpp"

#include <chrono>

#include "render/shading.hpp"

namespace medulla::render {
namespace {

constexpr int most_vertices = 10000;  // only a path that can never end gets there
constexpr int first_roulette_vertex = 8;
constexpr float spread_of_fibre =
    0.2f;  // of a cone that a fibre has scattered [radians]: about beta_n of Table 4's animals

/// Adds its lifetime to a counter.
template <bool Timed>
class Stopwatch {
  public:
    explicit Stopwatch(std::uint64_t& total) : total_(total) {
        if constexpr (Timed) start_ = std::chrono::steady_clock::now();
    }
    ~Stopwatch() {
        if constexpr (Timed)
            total_ += std::uint64_t(std::chrono::nanoseconds(std::chrono::steady_clock::now() - start_).count());
    }

  private:
    std::uint64_t& total_;
    std::chrono::steady_clock::time_point start_;
};

/// Power heuristic of two strategies (Veach 1997).
float share_of(float pdf, float other) {
    const float r = other / pdf;  // a ratio: the square of either may overflow
    return 1 / (1 + r * r);
}

/// Uniform over the unit disc (Shirley and Chiu 1997).
Pair on_disc(Pair u) {
    const float a = 2 * u.x - 1, b = 2 * u.y - 1;
    if (a == 0 && b == 0) return {0, 0};
    const bool wide = std::abs(a) > std::abs(b);
    const float r = wide ? a : b, angle = wide ? 0.25f * pi_f * (b / a) : 0.5f * pi_f - 0.25f * pi_f * (a / b);
    return {r * std::cos(angle), r * std::sin(angle)};
}

/// A surface's value for light from one direction; and a direction that it samples.
struct Towards {
    Rgb value;      ///< times the light's radiance it is radiance along the path, per steradian
    float pdf = 0;  ///< of drawing that direction, per steradian
};
struct Next {
    Vec3 direction;
    Rgb weight;
    float pdf = 0;  ///< 0: the path ends
};

/// Parts of 1, by lobe; all of it is `other` until a path's first fibre.
struct Shares {
    Rgb of[7];
    Shares() { of[Layers::other] = {1, 1, 1}; }
};

template <class Field>
Shares shares_of(const FieldInWorld<Field>& field, Vec3 direction) {
    Shares shares;
    Rgb value[all_lobe_count], sum;
    for (int k = 0; k < all_lobe_count; ++k) sum += value[k] = field.lobe(static_cast<Lobe>(k), direction);
    const auto part = [](float x, float of) { return of > 0 ? x / of : 0; };
    for (int k = 0; k < all_lobe_count; ++k)
        shares.of[k] = {part(value[k].x, sum.x), part(value[k].y, sum.y), part(value[k].z, sum.z)};
    shares.of[Layers::other] = {sum.x > 0 ? 0.0f : 1.0f, sum.y > 0 ? 0.0f : 1.0f, sum.z > 0 ? 0.0f : 1.0f};
    return shares;
}

/// Whether a sample of a fibre begins with an offset.
bool draws_offset(const PathOptions& options) {
    return options.field != FieldChoice::one_offset || options.model == FibreModel::deon;
}

float tent(float u) { return u < 0.5f ? std::sqrt(2 * u) - 1 : 1 - std::sqrt(2 - 2 * u); }

}  // namespace

PathTracer::PathTracer(const Scene& scene, const PathOptions& options)
    : scene_(scene),
      options_(options),
      geometry_(scene),
      lights_(scene.lights),
      shading_(new Shading(scene, geometry_.layers(), options.lobes, options.model)) {
    const Camera& c = scene.camera;
    const float half = std::tan(0.5f * c.fov);
    forward_ = normalise(c.to - c.from);
    right_ = half * normalise(cross(forward_, c.up));
    up_ = half * normalise(cross(right_, forward_));
    pixel_angle_ = 2 * half / float(scene.picture.height);
}

PathTracer::~PathTracer() = default;

Ray PathTracer::camera_ray(int x, int y, Random& random) const {
    const Camera& c = scene_.camera;
    // The pixel filter, a tent, is sampled: every sample has weight 1 and belongs to one pixel.
    const Pair jitter = random.pair();
    const float height = float(scene_.picture.height);
    const float sx = (2 * (float(x) + 0.5f + tent(jitter.x)) - float(scene_.picture.width)) / height;
    const float sy = (height - 2 * (float(y) + 0.5f + tent(jitter.y))) / height;
    const Vec3 direction = forward_ + sx * right_ + sy * up_;
    if (c.lens_radius == 0) return {c.from, normalise(direction), {}};
    const Pair lens = on_disc(random.pair());
    const Vec3 shift = c.lens_radius * (lens.x * normalise(right_) + lens.y * normalise(up_));
    return {c.from + shift, normalise(c.focus * direction - shift), {}};
}

Rgb PathTracer::sample(int x, int y, std::uint32_t sample, std::uint32_t seed, bool timed, Counts& counts,
                       Layers* layers) const {
    Random random(seed, std::uint32_t(y) * std::uint32_t(scene_.picture.width) + std::uint32_t(x), sample);
    const Ray ray = camera_ray(x, y, random);
    Rgb radiance;
    if (timed) {
        const Stopwatch<true> watch(counts.all);
        radiance = trace<true>(ray, random, counts, layers);
    } else {
        radiance = trace<false>(ray, random, counts, layers);
    }
    if (finite(radiance)) return radiance;
    ++counts.nonfinite;
    if (layers != nullptr) *layers = {};
    return {};
}

template <bool Timed>
Rgb PathTracer::trace(Ray ray, Random& random, Counts& counts, Layers* layers) const {
    // The share of each lobe of the first vertex in the light of later vertices, and in the first one's light sample.
    Shares onwards, to_light;
    Rgb sum, throughput{1, 1, 1};
    float pdf = 0;  // of the sampled direction; 0: camera ray, for which there is no light sample
    float width = 0, spread = pixel_angle_;
    const auto add = [&](Rgb light, bool direct, const Shares& shares) {
        const float y = luminance(light);
        if (!direct && options_.clamp > 0 && y > options_.clamp) light = (options_.clamp / y) * light;
        sum += light;
        if (layers == nullptr) return;
        if (direct) layers->direct += light;
        for (int k = 0; k < 7; ++k) layers->lobe[k] += shares.of[k] * light;
    };
    for (int vertex = 0; vertex < most_vertices; ++vertex) {
        Hit hit;
        {
            const Stopwatch<Timed> watch(counts.traversal);
            hit = geometry_.nearest(ray);
        }
        ++counts.rays;
        const float reach = hit ? hit.distance : std::numeric_limits<float>::infinity();
        lights_.met(ray.origin, ray.direction, reach, [&](Rgb radiance, float light_pdf) {
            const bool alone = pdf == 0 || !options_.sample_lights;
            add((alone ? 1.0f : share_of(pdf, light_pdf)) * (throughput * radiance), vertex <= 1, onwards);
        });
        if (!hit) break;
        ++counts.vertices;

        Vec3 position = ray.origin + hit.distance * ray.direction;
        const Pair pick = random.pair(), place = random.pair();
        LightSample light;
        if (options_.sample_lights) light = lights_.sample(position, pick.x, place);
        Start start;
        Towards towards;
        Next next;
        if (geometry_.is_strand(hit)) {
            const Stopwatch<Timed> watch(counts.shading);
            const StrandHit strand = geometry_.strand_hit(hit);
            const Strands& layer = geometry_.strands(hit);
            start = strand.start;
            width += hit.distance * spread;
            FibreHit fibre;
            fibre.layer = hit.geometry, fibre.tangent = strand.tangent, fibre.known = -ray.direction;
            fibre.point = (1 / strand.radius) * (position - strand.axis);
            fibre.footprint = width / strand.radius;
            fibre.along = strand.along;
            fibre.colour = layer.colour_of(strand.strand);
            if (!layer.textures.empty())
                fibre.root = layer.root(strand.strand),
                fibre.column = unit_float(hash(layer.seed ^ 0x3c6ef372u, strand.strand));
            const Pair a = random.pair(), b = random.pair();
            const float c = draws_offset(options_) ? random.number() : 0;
            const FieldChoice field_choice =
                options_.field == FieldChoice::multiscale && vertex >= options_.averaged_vertices
                    ? FieldChoice::one_offset
                    : options_.field;
            counts.clamped += shading_->at(fibre, field_choice, [&](const auto& field) {
                if (light.pdf > 0) {
                    const Evaluation<3> e = field.evaluate(light.direction);
                    towards = {rgb(e.value), e.pdf};
                }
                const Sample<3> drawn = field.sample({a.x, a.y, b.x, b.y, c});
                if (drawn.valid) next = {field.world(drawn.direction), rgb(drawn.weight), drawn.pdf};
                if (layers == nullptr || vertex > 0) return;
                if (light.pdf > 0) to_light = shares_of(field, light.direction);
                if (drawn.valid) onwards = shares_of(field, next.direction);
            });
            if (layers != nullptr && vertex == 0) {
                const Vec3 out = fibre.point - dot(fibre.point, strand.tangent) * strand.tangent;
                layers->normal = normalise(out), layers->tangent = strand.tangent;
                // Of the other models the weight of a sample, whose mean it is.
                layers->albedo = is_fur(options_.model) ? shading_->albedo(fibre) : next.weight;
            }
            spread = std::max(spread, spread_of_fibre);
        } else {
            const SkinHit skin = geometry_.skin_hit(hit);
            start = skin.start, position = skin.position;
            const auto cosine = [&](Vec3 w) {
                return dot(w, skin.facet_normal) > 0 ? std::max(0.0f, dot(w, skin.normal)) : 0;
            };
            if (light.pdf > 0) {
                towards.pdf = cosine(light.direction) / pi_f;
                towards.value = towards.pdf * skin.albedo;
            }
            const Pair d = on_disc(random.pair());
            const Basis basis = basis_about(skin.normal);
            next.direction = normalise(std::sqrt(std::max(0.0f, 1 - d.x * d.x - d.y * d.y)) * basis.x + d.x * basis.y +
                                       d.y * basis.z);
            next.pdf = cosine(next.direction) / pi_f;
            next.weight = skin.albedo;
            width += hit.distance * spread, spread = 1;
            if (layers != nullptr && vertex == 0) layers->normal = skin.normal, layers->albedo = skin.albedo;
        }
        if (layers != nullptr && vertex == 0)
            layers->depth = hit.distance * dot(ray.direction, forward_), layers->hit = 1;

        if (light.pdf > 0 && greatest(towards.value) > 0) {
            bool blocked;
            {
                const Stopwatch<Timed> watch(counts.traversal);
                blocked = geometry_.blocked({position, light.direction, start}, light.distance);
            }
            ++counts.rays;
            if (!blocked)
                add((share_of(light.pdf, towards.pdf) / light.pdf) * (throughput * towards.value * light.radiance),
                    vertex == 0, vertex == 0 ? to_light : onwards);
        }
        if (!(next.pdf > 0)) break;
        throughput *= next.weight;
        pdf = next.pdf;
        if (vertex >= first_roulette_vertex) {
            const float survival = std::min(1.0f, greatest(throughput));
            if (!(pick.y < survival)) break;
            throughput = (1 / survival) * throughput;
        }
        ray = {position, next.direction, start};
    }
    return sum;
}

}  // namespace medulla::render
