// A stand-in for what the adapter uses of pbrt-v4: names and conventions of its BxDF interface, nothing else.
#pragma once

#include <cmath>
#include <optional>
#include <string>

#define PBRT_CPU_GPU

namespace pstd {
using std::optional;
}

namespace pbrt {

using Float = float;
constexpr int NSpectrumSamples = 4;

struct Vector3f {
    Vector3f(Float x_, Float y_, Float z_) : x(x_), y(y_), z(z_) {}
    Float x, y, z;
};
struct Point2f {
    Float x, y;
    Float operator[](int i) const { return i == 0 ? x : y; }
};
inline Float AbsCosTheta(Vector3f w) { return std::abs(w.z); }

class SampledSpectrum {
  public:
    explicit SampledSpectrum(Float c) : values{c, c, c, c} {}
    Float& operator[](int i) { return values[i]; }

  private:
    Float values[NSpectrumSamples];
};

enum class TransportMode { Radiance, Importance };
enum class BxDFReflTransFlags { Unset = 0, Reflection = 1, Transmission = 2, All = 3 };
inline int operator&(BxDFReflTransFlags a, BxDFReflTransFlags b) { return int(a) & int(b); }
enum BxDFFlags { GlossyReflection = 5 };

struct BSDFSample {
    BSDFSample(SampledSpectrum f_, Vector3f wi_, Float pdf_, BxDFFlags) : f(f_), wi(wi_), pdf(pdf_) {}
    SampledSpectrum f;
    Vector3f wi;
    Float pdf;
};

}  // namespace pbrt
