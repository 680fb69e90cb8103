#include "render/texture.hpp"

namespace medulla::render {

Rgb Texture::at(Vec3 root, float along, float column) const {
    float s = column, t = along;
    if (mapping == Mapping::planar) {
        s = dot(root - origin, u) / dot(u, u), t = dot(root - origin, v) / dot(v, v);
    } else if (mapping == Mapping::around) {
        const Vec3 d = root - origin;
        s = 0.5f + std::atan2(d.x, d.z) / (2 * pi_f);
        t = 1 - std::atan2(std::sqrt(d.x * d.x + d.z * d.z), d.y) / pi_f;
    }
    // Pixel centres are at halves. Beyond them the edge continues, or, around a body, the opposite edge.
    const float width = float(image.width), height = float(image.height);
    const bool closed = mapping == Mapping::around;
    const float x = std::clamp(s * width - 0.5f, closed ? -1.0f : 0.0f, closed ? width : width - 1);
    const float y = std::clamp((1 - t) * height - 0.5f, 0.0f, height - 1);
    const int i = int(std::floor(x)), j = std::min(int(y), image.height - 1);
    const float fx = x - float(i), fy = y - float(j);
    const auto pixel = [&](int column_, int row) {
        const int c = closed ? (column_ + image.width) % image.width : std::min(column_, image.width - 1);
        return image.pixels[std::size_t(std::min(row, image.height - 1)) * std::size_t(image.width) + std::size_t(c)];
    };
    return scale * mix(mix(pixel(i, j), pixel(i + 1, j), fx), mix(pixel(i, j + 1), pixel(i + 1, j + 1), fx), fy);
}

void range_of(const Texture& texture, float& low, float& high) {
    low = high = 0;
    bool any = false;
    for (const Rgb& p : texture.image.pixels) {
        const float x = texture.scale * p.x;
        if (!std::isfinite(x)) continue;
        low = any ? std::min(low, x) : x, high = any ? std::max(high, x) : x;
        any = true;
    }
}

}  // namespace medulla::render
