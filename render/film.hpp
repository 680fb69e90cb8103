// Sums of the samples of each pixel; stored in a file, so that a killed run can be continued.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "render/vector.hpp"

namespace medulla::render {

struct Pixel {
    double sum[3] = {};
    double squares = 0;  ///< of the luminance

    void add(Rgb c) {
        sum[0] += double(c.x), sum[1] += double(c.y), sum[2] += double(c.z);
        const double y = double(luminance(c));
        squares += y * y;
    }
    double luminance_sum() const { return 0.2126 * sum[0] + 0.7152 * sum[1] + 0.0722 * sum[2]; }
};

/// The layers of one sample, or of the sum of a pixel's samples.
struct Layers {
    static constexpr int other = 6;  ///< paths whose first surface is not a fibre, and lights that the camera sees
    Rgb lobe[7];                     ///< radiance by the lobe of the first surface, a fibre: R, TT, .. residual; other
    Rgb direct;                      ///< radiance by one scattering or none
    Rgb albedo;                      ///< of the first surface
    Vec3 normal, tangent;            ///< of the first surface, in the world; the tangent of a skin is 0
    float depth = 0;                 ///< of the first surface, along the view
    float hit = 0;                   ///< 1 where there is one

    Layers& operator+=(const Layers& o) {
        for (int k = 0; k < 7; ++k) lobe[k] += o.lobe[k];
        direct += o.direct, albedo += o.albedo, normal += o.normal, tangent += o.tangent;
        depth += o.depth, hit += o.hit;
        return *this;
    }
};
static_assert(sizeof(Layers) == 35 * sizeof(float));

struct Film {
    int width = 0, height = 0;
    std::uint32_t samples = 0;    ///< per pixel, the same in all of them
    std::uint64_t nonfinite = 0;  ///< samples that were dropped (and count as black)
    std::vector<Pixel> pixels;    ///< row by row from the top
    std::vector<Layers> layers;   ///< of each pixel, if kept

    Film(int w, int h, bool keep_layers = false)
        : width(w), height(h), pixels(std::size_t(w) * std::size_t(h)), layers(keep_layers ? pixels.size() : 0) {}
    Rgb colour(std::size_t i) const {
        const double s = 1.0 / double(samples);
        return {float(pixels[i].sum[0] * s), float(pixels[i].sum[1] * s), float(pixels[i].sum[2] * s)};
    }
    /// Standard error of a pixel's luminance, as if samples were independent.
    double standard_error(std::size_t i) const;
    /// Root mean square of the pixels' standard errors over the mean luminance; infinite below two samples.
    double error() const;
    void mean(double (&rgb)[3]) const;
};

/// Writes beside `path` and renames: at any moment the file is complete or absent. `key` identifies the picture.
void save(const Film& film, const std::string& key, const std::string& path);
/// False where there is no such file; throws Error where it belongs to another picture or is damaged.
bool load(Film& film, const std::string& key, const std::string& path);

}  // namespace medulla::render
