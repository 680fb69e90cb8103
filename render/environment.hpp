// Light from everywhere by a picture: width once around, height from straight up to straight down. A pixel has one
// radiance over its solid angle, and directions are drawn in proportion to luminance: pdf = luminance / its integral.
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
    std::vector<double> rows_;   ///< light of all rows up to and with this one, of 1
    std::vector<float> in_row_;  ///< the same of the pixels of each row
};

}  // namespace medulla::render
