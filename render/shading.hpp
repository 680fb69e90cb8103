// All that the renderer takes from medulla: the fibre at a hit, its value and pdf towards a light, a direction drawn.
#pragma once

#include <memory>
#include <vector>

#include "medulla/medulla.hpp"
#include "render/error.hpp"
#include "render/path.hpp"
#include "render/random.hpp"
#include "render/scene.hpp"

namespace medulla::render {

/// What a ray found. Unit vectors in world space.
struct FibreHit {
    Vec3 tangent;     ///< from root to tip
    Vec3 known;       ///< back along the ray
    Vec3 point;       ///< from the axis to the hit [fibre radii]
    float footprint;  ///< diameter of the ray's cone [fibre radii]
    float along;      ///< [0, 1] from root to tip
    float colour;     ///< factor of sigma_ca
};

struct FibreEvaluation {
    Rgb value;      ///< energy per steradian
    float pdf = 0;  ///< per steradian
};
struct FibreSample {
    Vec3 direction;
    Rgb weight;     ///< value / pdf
    float pdf = 0;  ///< 0: nothing drawn
};

class Shading {
  public:
    explicit Shading(const Scene& scene) {
        const OpenResult opened = open_pack(default_pack_words, default_pack_size);
        for (const Material& material : scene.materials) {
            fibres_.push_back(std::make_unique<Prepared>());
            const FurStatus status = prepare(material.fur, opened.pack, fibres_.back()->fibre);
            if (status != FurStatus::ok) throw Error("material {}: {}", material.name, describe(status));
            unfold(fibres_.back()->fibre, fibres_.back()->tables);
        }
    }

    /// Calls use(field), which has evaluate(direction) and sample(pairs), for the fibre at a hit.
    template <class Use>
    auto at(const std::vector<Stop>& along, const FibreHit& hit, FieldChoice choice, Use&& use) const {
        const FurFibre<3>& fibre = fibres_[std::size_t(nearest(along, hit.along).material)]->fibre;
        const Vec3 x = -hit.tangent;
        const Basis basis = basis_about(x);
        const auto local = [&](Vec3 w) {
            const Vec3 v = basis.to_local(w);
            return Vector<float>{v.x, v.y, v.z};
        };
        const Vector<float> known = local(hit.known);
        const float offset = offset_of(known, local(hit.point)), h = std::min(1.0f, std::max(-1.0f, offset));
        const Angles<float> angles = angles_of(known);
        OffsetRange range{};
        if (choice == FieldChoice::multiscale) range = pixel_coverage(h, hit.footprint, 1, 1);
        const bool narrow = choice == FieldChoice::one_offset ||
                            (choice == FieldChoice::multiscale && hit.footprint < narrow_footprint);
        if (narrow) {
            Field<NearField<3>, NearSampler<3>> field(basis, angles);
            near_field(fibre, angles.theta, h, field.field);
            field.sampler.prepare(field.field);
            return use(field);
        }
        Field<FarField<3>, FarSampler<3>> field(basis, angles);
        far_field(fibre, angles.theta, range, field.field);
        field.sampler.prepare(field.field);
        return use(field);
    }

  private:
    /// A pixel narrower than this share of the radius sees one offset.
    static constexpr float narrow_footprint = 0.05f;

    struct Prepared {
        FurFibre<3> fibre;
        UnfoldedTables tables;
    };

    template <class F, class Sampler>
    struct Field {
        Basis basis;
        Angles<float> known;
        F field;
        Sampler sampler;

        Field(const Basis& b, Angles<float> k) : basis(b), known(k) {}
        FibreEvaluation evaluate(Vec3 w) const {
            const Vec3 v = basis.to_local(w);
            const Angles<float> drawn = angles_of(Vector<float>{v.x, v.y, v.z});
            const Colour<3> c = density(field, drawn.theta, drawn.phi - known.phi);
            return {{c.value[0], c.value[1], c.value[2]}, sampler.pdf(drawn.theta, drawn.phi - known.phi)};
        }
        FibreSample sample(Pair a, Pair b, float c) const {
            const FurSample<3> s = sampler.sample({a.x, a.y, b.x, b.y, c});
            if (!s.valid) return {};
            const Vector<float> v = direction_of(Angles<float>{s.theta_r, s.phi + known.phi});
            return {basis.to_world({v.x, v.y, v.z}), {s.weight[0], s.weight[1], s.weight[2]}, s.pdf};
        }
    };

    static Stop nearest(const std::vector<Stop>& along, float at) {
        Stop best = along.front();
        for (const Stop& stop : along)
            if (std::abs(stop.at - at) < std::abs(best.at - at)) best = stop;
        return best;
    }

    std::vector<std::unique_ptr<Prepared>> fibres_;
};

}  // namespace medulla::render
