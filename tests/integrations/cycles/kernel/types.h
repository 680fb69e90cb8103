// A stand-in for what the adapter uses of Cycles: names and conventions of its closures, nothing else.
#pragma once

#include <cmath>
#include <cstddef>
#include <new>

#define CCL_NAMESPACE_BEGIN namespace ccl {
#define CCL_NAMESPACE_END }
#define ccl_device inline
#define ccl_device_inline inline
#define ccl_private

namespace ccl {

struct float2 {
    float x, y;
};
struct float3 {
    float x, y, z;
};
using Spectrum = float3;
inline float2 make_float2(float x, float y) { return {x, y}; }
inline float3 make_float3(float x, float y, float z) { return {x, y, z}; }
inline float3 operator*(float s, float3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline float3 operator+(float3 a, float3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline float dot(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline float3 cross(float3 a, float3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline float3 safe_normalize(float3 a) { return 1 / std::sqrt(dot(a, a)) * a; }
inline float3 to_local(float3 p, float3 X, float3 Y, float3 Z) { return {dot(p, X), dot(p, Y), dot(p, Z)}; }
inline float3 to_global(float3 p, float3 X, float3 Y, float3 Z) { return p.x * X + p.y * Y + p.z * Z; }

enum ClosureType { CLOSURE_BSDF_MEDULLA_ID };
enum { LABEL_NONE = 0, LABEL_TRANSMIT = 1, LABEL_REFLECT = 2, LABEL_GLOSSY = 8 };
enum { PRIMITIVE_CURVE_THICK = 2, PRIMITIVE_CURVE_RIBBON = 4, PRIMITIVE_CURVE = 6 };

#define SHADER_CLOSURE_BASE \
    Spectrum weight;        \
    ClosureType type;       \
    float sample_weight;    \
    float3 N
struct ShaderClosure {
    SHADER_CLOSURE_BASE;
    char pad[40];
};
struct ShaderData {
    float3 wi, Ng, dPdu;
    float v;
    int type;
    alignas(64) char extra[512];
    bool full;
};

}  // namespace ccl
