// A picture that sets a parameter of a coat's fibres, over the skin or along the strand.
#pragma once

#include "render/image.hpp"

namespace medulla::render {

/// sigma_ca and kappa replace the material's, a colour replaces sigma_ca; the others are factors.
enum class Sets { sigma_ca, colour, kappa, sigma_ms_factor, sigma_ca_factor };
enum class Mapping { planar, around, strand };

struct Texture {
    Sets sets = Sets::sigma_ca;
    Mapping mapping = Mapping::planar;
    Image image;
    float scale = 1;
    Vec3 origin;                  ///< planar: the picture's lower left corner; around: the centre
    Vec3 u{1, 0, 0}, v{0, 1, 0};  ///< planar: its lower and left edge

    /// @param root where the strand leaves the skin
    /// @param along [0, 1] from root to tip
    /// @param column [0, 1) by strand
    /// Bilinear; not finite where one of the four pixels is not.
    Rgb at(Vec3 root, float along, float column) const;
};

/// The least and the greatest finite value of the first channel, scaled; 0 and 0 where there is none.
void range_of(const Texture& texture, float& low, float& high);

}  // namespace medulla::render
