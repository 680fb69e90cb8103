// Three floats: points, directions and RGB; an orthonormal basis about a direction.
#pragma once

#include <algorithm>
#include <cmath>

namespace medulla::render {

inline constexpr float pi_f = 3.14159265f;

struct Vec3 {
    float x = 0, y = 0, z = 0;
};
using Rgb = Vec3;

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Vec3 operator*(float s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vec3& operator+=(Vec3& a, Vec3 b) { return a = a + b; }
inline Vec3& operator*=(Vec3& a, Vec3 b) { return a = a * b; }

inline float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline float length(Vec3 a) { return std::sqrt(dot(a, a)); }
inline Vec3 normalise(Vec3 a) { return (1 / length(a)) * a; }
inline float greatest(Vec3 a) { return std::max(a.x, std::max(a.y, a.z)); }
inline float greatest_size(Vec3 a) { return std::max(std::abs(a.x), std::max(std::abs(a.y), std::abs(a.z))); }
inline float luminance(Rgb c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }  // Rec. 709
inline bool finite(Vec3 a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }
inline Vec3 mix(Vec3 a, Vec3 b, float t) { return (1 - t) * a + t * b; }
inline float mix(float a, float b, float t) { return (1 - t) * a + t * b; }
inline float smoothstep(float low, float high, float x) {
    const float t = std::clamp((x - low) / (high - low), 0.0f, 1.0f);
    return t * t * (3 - 2 * t);
}

/// Right-handed, orthonormal.
struct Basis {
    Vec3 x, y, z;
    Vec3 to_local(Vec3 w) const { return {dot(w, x), dot(w, y), dot(w, z)}; }
    Vec3 to_world(Vec3 w) const { return w.x * x + w.y * y + w.z * z; }
};

/// A basis whose x is the unit vector n. Duff et al. 2017, 'Building an orthonormal basis, revisited'.
inline Basis basis_about(Vec3 n) {
    const float sign = std::copysign(1.0f, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
    return {n, {1 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}};
}

}  // namespace medulla::render
