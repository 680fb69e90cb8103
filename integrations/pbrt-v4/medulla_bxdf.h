// A fur fibre as a BxDF of pbrt-v4. docs/integrations.md has the conventions and the lines to add to pbrt.
//
// Frame: pbrt's BSDF frame is right-handed with x along dp/du of the curve (assumed to be root to tip), so its axes are
// the fibre's. h: a curve's v increases along travel x tangent, the fibre's h along tangent x travel, hence
// h = 1 - 2 v. (pbrt's own HairBxDF uses h = 2 v - 1, which mirrors its azimuths, and with alpha > 0 tilts R towards
// the tip.)
// Measure: pbrt multiplies f by |cos| of the shading normal, so f is the fibre's value divided by it.
// Transport: wo is the known direction in both modes; the model is not reciprocal.
// Random numbers: pbrt supplies three; uc is split into two of 12 bits.
#pragma once

#include <pbrt/bxdfs.h>

#include "medulla/medulla.hpp"
#include "medulla/random.hpp"

namespace pbrt {

class MedullaBxDF {
  public:
    MedullaBxDF() = default;

    /// @param parameters sigma_ca: one value for each wavelength of the path  @param v the curve's second parameter
    PBRT_CPU_GPU MedullaBxDF(const medulla::FurParameters<NSpectrumSamples>& parameters, const medulla::DenseTables* tables,
                             Float v)
        : fibre(medulla::make_fibre(parameters, tables)), h(1 - 2 * v) {}

    PBRT_CPU_GPU SampledSpectrum f(Vector3f wo, Vector3f wi, TransportMode) const {
        return over_cosine(hit(wo).value(vector(wi)), wi);
    }

    PBRT_CPU_GPU Float PDF(Vector3f wo, Vector3f wi, TransportMode, BxDFReflTransFlags sampleFlags) const {
        return sampleFlags & BxDFReflTransFlags::Reflection ? hit(wo).pdf(vector(wi)) : 0;
    }

    PBRT_CPU_GPU pstd::optional<BSDFSample> Sample_f(Vector3f wo, Float uc, Point2f u, TransportMode,
                                                     BxDFReflTransFlags sampleFlags) const {
        if (!(sampleFlags & BxDFReflTransFlags::Reflection)) return {};
        const medulla::Stretched<2> two = medulla::stretch<2>(uc);
        const auto s = hit(wo).sample({two.u[0], two.u[1], u[0], u[1]});
        if (!(s.pdf > 0)) return {};
        const Vector3f wi(s.direction.x, s.direction.y, s.direction.z);
        return BSDFSample(over_cosine(s.value, wi), wi, s.pdf, Flags());
    }

    /// As pbrt's hair: all directions are one glossy reflection.
    PBRT_CPU_GPU BxDFFlags Flags() const { return BxDFFlags::GlossyReflection; }
    PBRT_CPU_GPU void Regularize() {}

    PBRT_CPU_GPU static constexpr const char* Name() { return "MedullaBxDF"; }
    std::string ToString() const { return "[ MedullaBxDF ]"; }

    /// Whether parameters and tables are valid, or what is wrong with them.
    PBRT_CPU_GPU medulla::FibreStatus Status() const { return fibre.status; }

  private:
    PBRT_CPU_GPU static medulla::Vector vector(Vector3f w) { return {w.x, w.y, w.z}; }

    PBRT_CPU_GPU medulla::NearField<NSpectrumSamples> hit(Vector3f wo) const {
        return medulla::near_field(fibre, vector(wo), h);
    }

    PBRT_CPU_GPU static SampledSpectrum over_cosine(const medulla::Colour<NSpectrumSamples>& value, Vector3f wi) {
        SampledSpectrum f(0.f);
        if (wi.z == 0) return f;
        for (int i = 0; i < NSpectrumSamples; ++i) f[i] = value.value[i] / AbsCosTheta(wi);
        return f;
    }

    medulla::Fibre<NSpectrumSamples> fibre;
    Float h = 0;
};

}  // namespace pbrt
