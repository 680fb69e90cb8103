// Everything that the renderer uses of medulla: dense tables for each coat, the fibre at a hit, and its field, which
// the path tracer samples and evaluates towards lights.
#pragma once

#include <cmath>
#include <cstdlib>
#include <memory>
#include <type_traits>
#include <vector>

#include "medulla/baked_field.hpp"
#include "medulla/medulla.hpp"
#include "render/error.hpp"
#include "render/groom.hpp"
#include "render/models.hpp"
#include "render/path.hpp"
#include "render/scene.hpp"
#include "render/texture.hpp"

namespace medulla::render {

/// A ray's hit on a strand. Unit vectors in world space.
struct FibreHit {
    std::size_t layer;  ///< that the strand belongs to
    Vec3 tangent;       ///< from root to tip
    Vec3 known;         ///< back along the ray
    Vec3 point;         ///< from the axis to the hit [fibre radii]
    float footprint;    ///< diameter of the path's cone [fibre radii]
    float along;        ///< [0, 1] from root to tip
    float colour;       ///< factor of sigma_ca
    Vec3 root;          ///< where the strand begins, in world space
    float column = 0;   ///< [0, 1) by strand, for textures
};

/// A fibre's field with its frame in the world.
template <class Field>
struct FieldInWorld {
    Basis basis;
    Field field;

    Evaluation<3> evaluate(Vec3 drawn) const { return field.evaluate(local(basis, drawn)); }
    Sample<3> sample(RandomNumbers u) const { return field.sample(u); }
    /// Whether the lobes are those of Lobe, one by one.
    static constexpr bool has_lobes = std::is_same_v<Field, NearField<3>> || std::is_same_v<Field, FarField<3>>;
    /// The value of one lobe alone; black where it has none.
    Vec3 lobe(Lobe k, Vec3 drawn) const {
        if constexpr (has_lobes) {
            const Colour<3> c = field.keep(lobe_bit(k)).value(local(basis, drawn));
            return {c[0], c[1], c[2]};
        }
        return {};
    }
    Vec3 world(Vector w) const { return basis.to_world({w.x, w.y, w.z}); }
    static Vector local(const Basis& basis, Vec3 w) {
        const Vec3 v = basis.to_local(w);
        return {v.x, v.y, v.z};
    }
};

inline Rgb rgb(const Colour<3>& c) { return {c[0], c[1], c[2]}; }

class Shading {
  public:
    Shading(const Scene& scene, const std::vector<Strands>& layers, LobeMask lobes, FibreModel model)
        : lobes_(model == FibreModel::eq12 ? lobes & ~lobe_bit(Lobe::residual) : lobes), model_(model) {
        const PackView pack = default_pack();
        for (const Strands& layer : layers) coats_.push_back(make_coat(scene.materials, layer, pack, model));
    }

    /// Share of the light that leaves the fibre again, for a ray at the hit's offset: of fur.
    Rgb albedo(const FibreHit& hit) const {
        const Basis basis = basis_about(hit.tangent);
        const Vector known = FieldInWorld<int>::local(basis, hit.known);
        const float h = offset_of(known, FieldInWorld<int>::local(basis, hit.point));
        if (const BakedMaterial* baked = coats_[hit.layer].baked)
            return rgb(near_field(make_fibre(*baked, fibre(hit).parameters.sigma_ca), known, h).albedo());
        const NearField<3> field = near_field(fibre(hit), known, h);
        return rgb(lobes_ == all_lobes ? field.albedo() : field.keep(lobes_).albedo());
    }

    /// Calls use(field in world) for the fibre at a hit; returns whether its parameters were clamped to their ranges.
    template <class Use>
    bool at(const FibreHit& hit, FieldChoice choice, Use&& use) const {
        const Basis basis = basis_about(hit.tangent);
        const Vector known = FieldInWorld<int>::local(basis, hit.known);
        const float h = offset_of(known, FieldInWorld<int>::local(basis, hit.point));
        const Fibre<3> fibre = this->fibre(hit);
        if (!is_fur(model_)) {
            with_model(model_, fibre, known, h, choice == FieldChoice::whole_width, [&](const auto& field) {
                use(FieldInWorld<std::decay_t<decltype(field)>>{basis, field});
            });
            return fibre.status == FibreStatus::clamped_parameters;
        }
        const bool one_offset = choice == FieldChoice::one_offset ||
                                (choice == FieldChoice::multiscale && hit.footprint < narrow_footprint);
        const Offsets offsets = choice == FieldChoice::multiscale ? pixel_coverage(h, hit.footprint, 1, 1) : Offsets{};
        if (const BakedMaterial* material = coats_[hit.layer].baked) {
            const BakedFibre<3> baked = make_fibre(*material, fibre.parameters.sigma_ca);
            if (one_offset)
                use(FieldInWorld<BakedNear<3>>{basis, near_field(baked, known, h)});
            else
                use(FieldInWorld<BakedFar<3>>{basis, far_field(baked, known, offsets)});
        } else if (one_offset) {
            with_lobes(basis, near_field(fibre, known, h), use);
        } else {
            with_lobes(basis, far_field(fibre, known, offsets), use);
        }
        return fibre.status == FibreStatus::clamped_parameters;
    }

  private:
    /// For a cone narrower than this share of the radius, a single offset is used.
    static constexpr float narrow_footprint = 0.05f;

    struct Free {
        void operator()(void* memory) const { std::free(memory); }
    };
    struct ParametersAt {
        float at;
        FurParameters<3> fur;
    };
    struct Coat {
        std::vector<ParametersAt> stops;
        std::vector<std::shared_ptr<const Texture>> textures;
        std::unique_ptr<void, Free> memory;
        const DenseTables* tables = nullptr;
        Fibre<3> first;
        const BakedMaterial* baked = nullptr;  ///< null: the five-lobe model
    };

    template <class Field, class Use>
    void with_lobes(const Basis& basis, const Field& field, Use&& use) const {
        use(FieldInWorld<Field>{basis, lobes_ == all_lobes ? field : field.keep(lobes_)});
    }

    /// Tables for the ranges of all parameters that interpolation between the stops and textures can give.
    Coat make_coat(const std::vector<Material>& materials, const Strands& layer, const PackView& pack,
                   FibreModel model) const {
        const std::vector<Stop>& along = layer.along;
        Coat coat;
        coat.textures = layer.textures;
        for (const Stop& stop : along) coat.stops.push_back({stop.at, materials[std::size_t(stop.material)].fur});
        FurParameters<3> low = coat.stops[0].fur, high = low;
        for (const ParametersAt& stop : coat.stops) {
            const FurParameters<3>& p = stop.fur;
            low.sigma_ms = std::min(low.sigma_ms, p.sigma_ms), high.sigma_ms = std::max(high.sigma_ms, p.sigma_ms);
            low.kappa = std::min(low.kappa, p.kappa), high.kappa = std::max(high.kappa, p.kappa);
            low.g = std::min(low.g, p.g), high.g = std::max(high.g, p.g);
            low.eta = std::max(low.eta, p.eta),
            high.eta = std::min(high.eta, p.eta);  // the longest way is of the least
        }
        coat.baked = baked_of(materials, layer, model);
        for (const auto& texture : coat.textures) {
            float least, most;
            range_of(*texture, least, most);
            if (texture->sets == Sets::kappa)
                low.kappa = std::min(low.kappa, std::max(0.0f, least)),
                high.kappa = std::max(high.kappa, std::min(1.0f, most));
            if (texture->sets == Sets::sigma_ms_factor)
                low.sigma_ms *= std::clamp(least, 0.0f, 1.0f), high.sigma_ms *= std::max(1.0f, most);
        }
        TableRanges ranges = join(ranges_of(low), ranges_of(high));
        if (model == FibreModel::yan2015) ranges.eta = 0;  // it reads C^M at another optical radius
        const std::size_t bytes = (tables_bytes(pack, ranges) + 63) / 64 * 64;
        coat.memory.reset(std::aligned_alloc(64, std::max<std::size_t>(64, bytes)));
        const TablesResult made = make_tables(pack, ranges, coat.memory.get(), bytes);
        if (made.status != TablesStatus::ok)
            throw Error("material {}: {}", materials[std::size_t(along[0].material)].name, describe(made.status));
        coat.tables = made.tables;
        for (const Stop& stop : along) {
            const Material& material = materials[std::size_t(stop.material)];
            const Fibre<3> fibre = make_fibre(material.fur, coat.tables);
            if (fibre.status != FibreStatus::ok) throw Error("material {}: {}", material.name, describe(fibre.status));
        }
        coat.first = make_fibre(coat.stops[0].fur, coat.tables);
        return coat;
    }

    /// The bake of a coat whose materials have one; null where none has.
    const BakedMaterial* baked_of(const std::vector<Material>& materials, const Strands& layer,
                                  FibreModel model) const {
        const Material& first = materials[std::size_t(layer.along[0].material)];
        for (const Stop& stop : layer.along) {
            const Material& material = materials[std::size_t(stop.material)];
            if (material.baked != first.baked)
                throw Error("materials {} and {}: expected one baked pack along a strand", first.name, material.name);
        }
        if (first.baked == nullptr || !is_fur(model)) return nullptr;
        if (lobes_ != all_lobes || model != FibreModel::fur)
            throw Error("material {}: a baked pack has no single lobes: expected neither --lobes nor --model eq12",
                        first.name);
        for (const auto& texture : layer.textures)
            if (texture->sets == Sets::kappa || texture->sets == Sets::sigma_ms_factor)
                throw Error("material {}: a texture may set nothing but the colour of a baked pack", first.name);
        return &first.baked->material;
    }

    Fibre<3> fibre(const FibreHit& hit) const {
        const Coat& coat = coats_[hit.layer];
        const bool even = coat.stops.size() == 1 && hit.colour == 1 && coat.textures.empty();
        return even ? coat.first : fibre_at(coat, hit);
    }

    /// All parameters interpolated between the two stops next to the hit.
    static Fibre<3> fibre_at(const Coat& coat, const FibreHit& hit) {
        std::size_t next = 0;
        while (next < coat.stops.size() && coat.stops[next].at <= hit.along) ++next;
        FurParameters<3> p = coat.stops[next == 0 ? 0 : next - 1].fur;
        if (next > 0 && next < coat.stops.size()) {
            const FurParameters<3>& q = coat.stops[next].fur;
            const float from = coat.stops[next - 1].at, t = (hit.along - from) / (coat.stops[next].at - from);
            for (float FurParameters<3>::*x :
                 {&FurParameters<3>::eta, &FurParameters<3>::kappa, &FurParameters<3>::alpha, &FurParameters<3>::beta_m,
                  &FurParameters<3>::beta_n, &FurParameters<3>::layers, &FurParameters<3>::sigma_ms,
                  &FurParameters<3>::sigma_ma, &FurParameters<3>::g})
                p.*x = mix(p.*x, q.*x, t);
            for (int c = 0; c < 3; ++c) p.sigma_ca[c] = mix(p.sigma_ca[c], q.sigma_ca[c], t);
        }
        for (const auto& texture : coat.textures) set(p, texture->sets, texture->at(hit.root, hit.along, hit.column));
        for (float& sigma : p.sigma_ca) sigma *= hit.colour;
        return make_fibre(p, coat.tables, OutOfRange::clamp);
    }

    static void set(FurParameters<3>& p, Sets what, Rgb value) {
        const float channel[3] = {value.x, value.y, value.z};
        // A colour is the transmittance of a ray through the axis, over two radii. These comparisons let NaN through.
        const auto absorption = [](float c) { return -0.5f * std::log(c < 1e-3f ? 1e-3f : c > 1 ? 1 : c); };
        for (int c = 0; c < 3; ++c) {
            if (what == Sets::sigma_ca) p.sigma_ca[c] = channel[c];
            if (what == Sets::sigma_ca_factor) p.sigma_ca[c] *= channel[c];
            if (what == Sets::colour) p.sigma_ca[c] = absorption(channel[c]);
        }
        if (what == Sets::kappa) p.kappa = value.x;
        if (what == Sets::sigma_ms_factor) p.sigma_ms *= value.x;
    }

    LobeMask lobes_;
    FibreModel model_;
    std::vector<Coat> coats_;
};

}  // namespace medulla::render
