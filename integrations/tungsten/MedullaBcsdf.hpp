// A fur fibre as a Bsdf of Tungsten. docs/integrations.md has the conventions and the lines to add to Tungsten.
//
// Frame: a curve's local frame has y along its derivative (assumed to be root to tip), and z along the normal. The
// fibre's axes are (y, z, x), which is right-handed. h: sine of the angle from the normal to wi in the cross-section.
// That requires curves with "mode": "half_cylinder", whose normals are a cylinder's. "bcsdf_cylinder" and "ribbon" do
// not distinguish the sides of h: use "field": "far" there.
// Measure: eval includes the cosine, so it returns the fibre's value unchanged.
// Transport: wi is the known direction, wo the drawn one; both point away from the fibre. The model is not reciprocal.
// Random numbers: four by next2D, a fifth for the far field.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>

#include "bsdfs/Bsdf.hpp"
#include "io/JsonObject.hpp"
#include "math/Angle.hpp"
#include "medulla/medulla.hpp"
#include "sampling/PathSampleGenerator.hpp"

namespace Tungsten {

class MedullaBcsdf : public Bsdf {
    static medulla::Vector fibre_frame(const Vec3f& w) { return {w.y(), w.z(), w.x()}; }
    static Vec3f vec(const medulla::Colour<3>& c) { return Vec3f(c.value[0], c.value[1], c.value[2]); }

    template <class F>
    auto at(const SurfaceScatterEvent& event, F&& f) const {
        const medulla::Vector known = fibre_frame(event.wi);
        if (_whole_width) return f(medulla::far_field(_fibre, known));
        return f(medulla::near_field(_fibre, known, medulla::offset_of(known, {0, 1, 0})));
    }

  public:
    MedullaBcsdf() { _lobes = BsdfLobes(BsdfLobes::GlossyLobe | BsdfLobes::AnisotropicLobe); }

    /// Reads "preset" first, then the fields that override it; angles in degrees.
    void fromJson(JsonPtr value, const Scene& scene) override {
        Bsdf::fromJson(value, scene);
        std::string preset, field;
        if (value.getField("preset", preset)) {
            const medulla::FurPreset* found = medulla::find_preset(preset.c_str());
            if (found == nullptr) value.parseError("medulla: no preset \"" + preset + "\"");
            _parameters = medulla::parameters_of<3>(*found);
        }
        value.getField("eta", _parameters.eta);
        value.getField("kappa", _parameters.kappa);
        value.getField("layers", _parameters.layers);
        value.getField("sigma_ms", _parameters.sigma_ms);
        value.getField("sigma_ma", _parameters.sigma_ma);
        value.getField("g", _parameters.g);
        for (auto angle : {std::make_pair("alpha", &_parameters.alpha), std::make_pair("beta_m", &_parameters.beta_m),
                           std::make_pair("beta_n", &_parameters.beta_n)}) {
            float degrees;
            if (value.getField(angle.first, degrees)) *angle.second = Angle::degToRad(degrees);
        }
        Vec3f sigma_ca;
        if (value.getField("sigma_ca", sigma_ca))
            for (int c = 0; c < 3; ++c) _parameters.sigma_ca[c] = sigma_ca[c];
        if (value.getField("field", field)) {
            if (field != "near" && field != "far") value.parseError("medulla: no field \"" + field + "\"");
            _whole_width = field == "far";
        }
    }

    void prepareForRender() override { prepare(_parameters, _whole_width); }

    /// Sets the material without a scene file.
    void prepare(const medulla::FurParameters<3>& parameters, bool whole_width) {
        _parameters = parameters, _whole_width = whole_width;
        const medulla::PackView pack = medulla::default_pack();
        const medulla::TableRanges ranges = medulla::ranges_of(_parameters);
        std::size_t bytes = medulla::tables_bytes(pack, ranges), room = bytes + 64;
        _memory.reset(new unsigned char[room]);
        void* aligned = _memory.get();
        std::align(64, bytes, aligned, room);
        _fibre = medulla::make_fibre(_parameters, medulla::make_tables(pack, ranges, aligned, bytes).tables);
        if (_fibre.status != medulla::FibreStatus::ok)
            throw std::runtime_error(std::string("medulla: ") + medulla::describe(_fibre.status));
    }

    Vec3f eval(const SurfaceScatterEvent& event) const override {
        if (!event.requestedLobe.test(BsdfLobes::GlossyLobe)) return Vec3f(0.0f);
        return at(event, [&](const auto& hit) { return vec(hit.value(fibre_frame(event.wo))); });
    }

    float pdf(const SurfaceScatterEvent& event) const override {
        if (!event.requestedLobe.test(BsdfLobes::GlossyLobe)) return 0.0f;
        return at(event, [&](const auto& hit) { return hit.pdf(fibre_frame(event.wo)); });
    }

    bool sample(SurfaceScatterEvent& event) const override {
        if (!event.requestedLobe.test(BsdfLobes::GlossyLobe)) return false;
        const Vec2f xi1 = event.sampler->next2D(), xi2 = event.sampler->next2D();
        const float offset = _whole_width ? event.sampler->next1D() : 0.0f;
        const medulla::Sample<3> s = at(event, [&](const auto& hit) {
            return hit.sample({xi1.x(), xi1.y(), xi2.x(), xi2.y(), offset});
        });
        if (!(s.pdf > 0)) return false;
        event.wo = Vec3f(s.direction.z, s.direction.x, s.direction.y);
        event.pdf = s.pdf;
        event.weight = vec(s.weight);
        event.sampledLobe = BsdfLobes::GlossyLobe;
        return true;
    }

  private:
    medulla::FurParameters<3> _parameters;
    bool _whole_width = false;
    std::unique_ptr<unsigned char[]> _memory;  // of the tables
    medulla::Fibre<3> _fibre;
};

}  // namespace Tungsten
