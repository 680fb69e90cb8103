// A stand-in for what the adapter uses of Mitsuba 3: names and conventions of its BSDF plugins in a scalar RGB variant,
// nothing else.
#pragma once

#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#define NAMESPACE_BEGIN(name) namespace name {
#define NAMESPACE_END(name) }
#define Throw(...) throw std::runtime_error("Mitsuba: error")
#define MI_DECLARE_CLASS(Name)
#define MI_EXPORT_PLUGIN(Name) template class Name<float, Color3f>;
#define MI_IMPORT_BASE(Name, ...)       \
    using Base = Name<Float, Spectrum>; \
    using Base::m_components;           \
    using Base::m_flags;
#define MI_IMPORT_TYPES(...)              \
    using ScalarFloat = float;            \
    using Mask = bool;                    \
    using UnpolarizedSpectrum = Spectrum; \
    using Texture = mitsuba::Texture;

namespace mitsuba {

struct Color3f {
    Color3f(float c) : v{c, c, c} {}
    Color3f(float a, float b, float c) : v{a, b, c} {}
    float& operator[](int i) { return v[i]; }
    float operator[](int i) const { return v[i]; }
    float v[3];
};
template <class Spectrum>
Spectrum depolarizer(Spectrum s) {
    return s;
}

struct Vector3f {
    Vector3f() = default;
    Vector3f(float x_, float y_, float z_) : v{x_, y_, z_} {}
    float x() const { return v[0]; }
    float y() const { return v[1]; }
    float z() const { return v[2]; }
    float v[3] = {};
};
struct Point2f {
    float v[2];
    float x() const { return v[0]; }
    float y() const { return v[1]; }
};

enum class BSDFFlags : unsigned {
    Glossy = 1,
    Anisotropic = 2,
    NonSymmetric = 4,
    FrontSide = 8,
    Null = 16,
    BackSide = 32
};
constexpr unsigned operator|(BSDFFlags a, BSDFFlags b) { return unsigned(a) | unsigned(b); }
constexpr unsigned operator|(unsigned a, BSDFFlags b) { return a | unsigned(b); }
constexpr unsigned operator+(BSDFFlags a) { return unsigned(a); }

struct BSDFContext {
    bool is_enabled(BSDFFlags) const { return true; }
};
struct SurfaceInteraction3f {
    Vector3f wi;
};
struct BSDFSample3f {
    Vector3f wo;
    float pdf = 0, eta = 1;
    unsigned sampled_type = 0, sampled_component = 0;
};

struct Texture {
    Color3f colour;
    Color3f eval(const SurfaceInteraction3f&, bool) const { return colour; }
};
template <class T>
using ref = T*;

class Properties {
  public:
    std::map<std::string, float> numbers;
    std::string preset;
    Texture* texture = nullptr;

    template <class T>
    T get(const char* name, T otherwise) const {
        if constexpr (std::is_same_v<T, std::string_view>) {
            return preset.empty() ? otherwise : T(preset);
        } else {
            const auto found = numbers.find(name);
            return found == numbers.end() ? otherwise : found->second;
        }
    }
    bool has_property(const char*) const { return texture != nullptr; }
    template <class T>
    T* get_unbounded_texture(const char*) const {
        return texture;
    }
};

template <class Float, class Spectrum>
class BSDF {
  public:
    explicit BSDF(const Properties&) {}
    virtual ~BSDF() = default;
    virtual std::pair<BSDFSample3f, Spectrum> sample(const BSDFContext&, const SurfaceInteraction3f&, Float,
                                                     const Point2f&, bool) const = 0;
    virtual Spectrum eval(const BSDFContext&, const SurfaceInteraction3f&, const Vector3f&, bool) const = 0;
    virtual Float pdf(const BSDFContext&, const SurfaceInteraction3f&, const Vector3f&, bool) const = 0;
    virtual std::pair<Spectrum, Float> eval_pdf(const BSDFContext&, const SurfaceInteraction3f&, const Vector3f&,
                                                bool) const = 0;
    virtual std::string to_string() const = 0;

  protected:
    unsigned m_flags = 0;
    std::vector<unsigned> m_components;
};

}  // namespace mitsuba

namespace dr {
template <class T>
constexpr bool is_jit_v = false;
template <class T>
constexpr std::size_t size_v = 3;
template <class T>
T zeros() {
    return {};
}
}  // namespace dr
