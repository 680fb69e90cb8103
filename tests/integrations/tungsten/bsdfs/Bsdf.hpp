// A stand-in for what the adapter uses of Tungsten: names and conventions of its Bsdf, nothing else.
#pragma once

#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace Tungsten {

struct Vec2f {
    float v[2];
    float x() const { return v[0]; }
    float y() const { return v[1]; }
};
struct Vec3f {
    Vec3f() : v{} {}
    explicit Vec3f(float c) : v{c, c, c} {}
    Vec3f(float a, float b, float c) : v{a, b, c} {}
    float v[3];
    float x() const { return v[0]; }
    float y() const { return v[1]; }
    float z() const { return v[2]; }
    float operator[](int i) const { return v[i]; }
};

struct BsdfLobes {
    enum { GlossyLobe = 1, AnisotropicLobe = 2 };
    BsdfLobes(int l = 0) : lobes(l) {}
    bool test(int l) const { return (lobes & l) != 0; }
    int lobes;
};

struct PathSampleGenerator {
    const float* numbers;
    float next1D() { return *numbers++; }
    Vec2f next2D() {
        const float a = next1D();
        return {{a, next1D()}};
    }
};

struct SurfaceScatterEvent {
    PathSampleGenerator* sampler = nullptr;
    Vec3f wi, wo, weight;
    float pdf = 0;
    BsdfLobes requestedLobe = BsdfLobes::GlossyLobe, sampledLobe;
};

class Scene {};
struct JsonPtr {
    std::map<std::string, std::string> texts;
    template <class T>
    bool getField(const char*, T&) const {
        return false;
    }
    bool getField(const char* name, std::string& value) const {
        const auto at = texts.find(name);
        if (at != texts.end()) value = at->second;
        return at != texts.end();
    }
    [[noreturn]] void parseError(std::string description) const { throw std::runtime_error(description); }
};

class Bsdf {
  public:
    virtual ~Bsdf() = default;
    virtual void fromJson(JsonPtr, const Scene&) {}
    virtual Vec3f eval(const SurfaceScatterEvent& event) const = 0;
    virtual bool sample(SurfaceScatterEvent& event) const = 0;
    virtual float pdf(const SurfaceScatterEvent& event) const = 0;
    virtual void prepareForRender() {}

  protected:
    BsdfLobes _lobes;
};

namespace Angle {
inline float degToRad(float degrees) { return degrees * 0.0174532925f; }
}  // namespace Angle

}  // namespace Tungsten
