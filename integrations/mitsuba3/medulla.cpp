// A fur fibre as a BSDF plugin of Mitsuba 3. docs/integrations.md has the conventions and how to build it.
//
// Frame: on a `bsplinecurve`, the local y axis runs along the curve (assumed to be root to tip), and z along the
// outward normal. The fibre's axes are (y, z, x), which is right-handed. h: sine of the angle from the normal to wi in
// the cross-section. Measure: eval includes the cosine, so it returns the fibre's value unchanged. Transport: wi is the
// known direction in every ctx.mode; the model is not reciprocal. Random numbers: three; sample1 is split into two of
// 12 bits. Variants: scalar ones only. The runtime computes in plain floats, so Dr.Jit's arrays are refused.
#include <memory>

#include <mitsuba/core/properties.h>
#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/texture.h>

#include "medulla/medulla.hpp"
#include "medulla/random.hpp"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum>
class Medulla final : public BSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(BSDF, m_flags, m_components)
    MI_IMPORT_TYPES(Texture)

    static constexpr int Channels = int(dr::size_v<UnpolarizedSpectrum>);

    explicit Medulla(const Properties& props) : Base(props) {
        if constexpr (dr::is_jit_v<Float>) Throw("medulla: scalar variants only");
        const std::string preset = props.get<std::string_view>("preset", "").data();
        if (const medulla::FurPreset* found = medulla::find_preset(preset.c_str()))
            m_parameters = medulla::parameters_of<Channels>(*found);
        else if (!preset.empty())
            Throw("medulla: no preset \"%s\"", preset);
        const auto number = [&](const char* name, float& value, float unit = 1) {
            value = unit * float(props.get<ScalarFloat>(name, ScalarFloat(value / unit)));
        };
        const float degree = float(medulla::pi / 180);
        number("eta", m_parameters.eta);
        number("kappa", m_parameters.kappa);
        number("layers", m_parameters.layers);
        number("alpha", m_parameters.alpha, degree);
        number("beta_m", m_parameters.beta_m, degree);
        number("beta_n", m_parameters.beta_n, degree);
        number("sigma_ms", m_parameters.sigma_ms);
        number("sigma_ma", m_parameters.sigma_ma);
        number("g", m_parameters.g);
        if (props.has_property("sigma_ca")) m_sigma_ca = props.get_unbounded_texture<Texture>("sigma_ca");
        const medulla::PackView pack = medulla::default_pack();
        const medulla::TableRanges ranges = medulla::ranges_of(m_parameters);
        std::size_t bytes = medulla::tables_bytes(pack, ranges), room = bytes + 64;
        m_memory.reset(new unsigned char[room]);
        void* aligned = m_memory.get();
        std::align(64, bytes, aligned, room);
        m_tables = medulla::make_tables(pack, ranges, aligned, bytes).tables;
        const auto fibre = medulla::make_fibre(m_parameters, m_tables);
        if (fibre.status != medulla::FibreStatus::ok) Throw("medulla: %s", medulla::describe(fibre.status));
        m_components.push_back(BSDFFlags::Glossy | BSDFFlags::Anisotropic | BSDFFlags::NonSymmetric |
                               BSDFFlags::FrontSide);
        m_components.push_back(BSDFFlags::Null | BSDFFlags::BackSide);
        m_flags = m_components[0] | m_components[1];
    }

    std::pair<BSDFSample3f, Spectrum> sample(const BSDFContext& ctx, const SurfaceInteraction3f& si, Float sample1,
                                             const Point2f& sample2, Mask active) const override {
        BSDFSample3f bs = dr::zeros<BSDFSample3f>();
        if constexpr (!dr::is_jit_v<Float>) {
            if (!active || !ctx.is_enabled(BSDFFlags::Glossy)) return {bs, 0.f};
            const medulla::Stretched<2> two = medulla::stretch<2>(float(sample1));
            const auto s = hit(si, active).sample({two.u[0], two.u[1], float(sample2.x()), float(sample2.y())});
            if (!(s.pdf > 0)) return {bs, 0.f};
            bs.wo = Vector3f(s.direction.z, s.direction.x, s.direction.y);
            bs.pdf = s.pdf;
            bs.eta = 1.f;
            bs.sampled_type = +BSDFFlags::Glossy;
            bs.sampled_component = 0;
            return {bs, depolarizer<Spectrum>(spectrum(s.weight))};
        }
        return {bs, 0.f};
    }

    Spectrum eval(const BSDFContext& ctx, const SurfaceInteraction3f& si, const Vector3f& wo,
                  Mask active) const override {
        return eval_pdf(ctx, si, wo, active).first;
    }

    Float pdf(const BSDFContext& ctx, const SurfaceInteraction3f& si, const Vector3f& wo, Mask active) const override {
        return eval_pdf(ctx, si, wo, active).second;
    }

    std::pair<Spectrum, Float> eval_pdf(const BSDFContext& ctx, const SurfaceInteraction3f& si, const Vector3f& wo,
                                        Mask active) const override {
        if constexpr (!dr::is_jit_v<Float>) {
            if (!active || !ctx.is_enabled(BSDFFlags::Glossy)) return {0.f, 0.f};
            const auto e = hit(si, active).evaluate(fibre_frame(wo));
            return {depolarizer<Spectrum>(spectrum(e.value)), Float(e.pdf)};
        }
        return {0.f, 0.f};
    }

    std::string to_string() const override { return "Medulla[]"; }

    MI_DECLARE_CLASS(Medulla)

  private:
    static medulla::Vector fibre_frame(const Vector3f& w) { return {float(w.y()), float(w.z()), float(w.x())}; }

    medulla::NearField<Channels> hit(const SurfaceInteraction3f& si, Mask active) const {
        medulla::FurParameters<Channels> parameters = m_parameters;
        if (m_sigma_ca) {
            const UnpolarizedSpectrum sigma = m_sigma_ca->eval(si, active);
            for (int c = 0; c < Channels; ++c) parameters.sigma_ca[c] = float(sigma[c]);
        }
        const medulla::Vector known = fibre_frame(si.wi);
        return medulla::near_field(medulla::make_fibre(parameters, m_tables), known,
                                   medulla::offset_of(known, {0, 1, 0}));
    }

    static UnpolarizedSpectrum spectrum(const medulla::Colour<Channels>& colour) {
        UnpolarizedSpectrum s(0.f);
        for (int c = 0; c < Channels; ++c) s[c] = colour.value[c];
        return s;
    }

    medulla::FurParameters<Channels> m_parameters;
    ref<Texture> m_sigma_ca;                    // [1 / fibre radius]
    std::unique_ptr<unsigned char[]> m_memory;  // of the tables
    const medulla::DenseTables* m_tables = nullptr;
};

MI_EXPORT_PLUGIN(Medulla)
NAMESPACE_END(mitsuba)
