// An environment map: its width goes once around, its height from straight up to straight down. Radiance is constant
// over a pixel's solid angle, and directions are sampled by luminance: pdf = luminance / integral of luminance.
#pragma once

#include <vector>

#include "render/image.hpp"
#include "render/random.hpp"

namespace medulla::render {

class Environment {
  public:
    /// @param turn about y, counter-clockwise seen from above [radians]; at 0 the picture's middle is towards -z
    /// Throws Error where a pixel is not finite or none gives light. Negative values count as 0.
    Environment(Image image, float turn, Rgb scale, const std::string& path);

    Rgb radiance(Vec3 direction) const { return image_.pixels[pixel(direction)]; }
    float pdf(Vec3 direction) const { return luminance(radiance(direction)) * one_over_integral_; }
    Vec3 sample(Pair u) const;

  private:
    std::size_t pixel(Vec3 direction) const;

    Image image_;
    float turn_;
    float one_over_integral_ = 0;
    std::vector<double> rows_;   ///< light of the rows up to and including this one, over that of all
    std::vector<float> in_row_;  ///< the same for the pixels of each row
};

}  // namespace medulla::render
