// Small scenes for the tests of the renderer, and a picture of one.
#pragma once

#include <string>

#include "render/render.hpp"

namespace medulla::render::tests {

/// A fibre that absorbs nothing, and one of a fox.
inline const std::string materials =
    R"("materials": [{"name": "white", "eta": 1.55, "kappa": 0.7, "sigma_ms": 2.5, "g": 0.4, "beta_m": 8, "beta_n": 12},
                     {"name": "fox", "preset": "red_fox", "sigma_ca": [0.2, 0.5, 1.2]}])";

/// A square of fur seen at an angle that fills the picture.
inline std::string patch(const std::string& material, const std::string& lights, int density = 400) {
    return R"({"camera": {"from": [0, 3, 4], "to": [0, 0.1, 0], "fov": 8}, "picture": {"width": 12, "height": 12}, )" +
           materials + R"(, "objects": [{"shape": "patch", "width": 3, "depth": 3, "skin": 1,
           "coat": [{"material": ")" +
           material + R"(", "density": )" + std::to_string(density) +
           R"(, "length": 0.25, "radius": 0.008, "lean": 20, "bend": 30, "noise": 10}]}], "lights": )" + lights + "}";
}

inline const std::string white_sky = R"([{"light": "sky", "radiance": 1}])";

inline RenderOptions options(std::uint32_t samples) {
    RenderOptions o;
    o.samples = samples, o.threads = 1;
    return o;
}

inline Film picture(const Scene& scene, const RenderOptions& options, Counts* counts = nullptr) {
    Film film(scene.picture.width, scene.picture.height);
    const PathTracer tracer(scene, options.path);
    const Report report = render(tracer, options, film, [](double) {});
    if (counts != nullptr) *counts = report.counts;
    return film;
}

inline double mean_luminance(const Film& film) {
    double rgb[3];
    film.mean(rgb);
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

/// Standard error of the picture's mean luminance.
inline double error_of_mean(const Film& film) {
    double variance = 0;
    for (std::size_t i = 0; i < film.pixels.size(); ++i) variance += film.standard_error(i) * film.standard_error(i);
    return std::sqrt(variance) / double(film.pixels.size());
}

}  // namespace medulla::render::tests
