// The other models in the renderer: energy, and two ways to the same picture.
#include <catch2/catch.hpp>
#include <iterator>

#include "tests/render/scenes.hpp"

using namespace medulla::render;
using tests::error_of_mean;
using tests::mean_luminance;
using tests::options;
using tests::picture;

TEST_CASE("models that keep energy vanish before a white sky", "[render][models]") {
    const Scene scene = parse_scene(tests::patch("white", tests::white_sky), "test");
    for (std::size_t i = 0; i < std::size(model_names); ++i) {
        RenderOptions o = options(8);
        o.path.model = static_cast<FibreModel>(i);
        o.path.sample_lights = false;  // then a sample of a model without loss is near to 1 by itself
        const Film film = picture(scene, o);
        const double mean = mean_luminance(film), error = error_of_mean(film);
        INFO(model_names[i] << ": mean " << mean << " +- " << error);
        CHECK(film.nonfinite == 0);
        switch (o.path.model) {
            case FibreModel::fur:
            case FibreModel::kajiya_kay_normalised:
            case FibreModel::kim:
            case FibreModel::deon:
            case FibreModel::chiang:
                CHECK(std::abs(mean - 1) < 4 * error + 1e-3);
                break;
            case FibreModel::kajiya_kay:
            case FibreModel::marschner:
            case FibreModel::zinke:  // each loses some, at every fibre
                CHECK(mean < 1 - 4 * error);
                CHECK(mean > 0.3);
                break;
            case FibreModel::yan2015:
            case FibreModel::eq12:  // all that they lose is what this material's residual lobe carries
                CHECK(mean < 1 + 4 * error);
                CHECK(mean > 0.95);
                break;
        }
    }
}

TEST_CASE("models: with and without light samples the same picture", "[render][models]") {
    const Scene scene = parse_scene(tests::patch("fox", R"([{"light": "sky", "radiance": [1, 0.6, 0.3]},
                                {"light": "rectangle", "centre": [0, 4, -2], "width": 4, "height": 4, "radiance": 3}])"),
                                    "test");
    for (std::size_t i = 2; i < std::size(model_names); ++i) {
        RenderOptions o = options(48);
        o.path.model = static_cast<FibreModel>(i);
        const Film with = picture(scene, o);
        o.path.sample_lights = false, o.seed = 1;
        const Film without = picture(scene, o);
        const double a = mean_luminance(with), b = mean_luminance(without);
        const double error = std::hypot(error_of_mean(with), error_of_mean(without));
        INFO(model_names[i] << ": " << a << " and " << b << " +- " << error);
        CHECK(std::abs(a - b) < 4 * error);  // nine models: fails once in 2000 seeds
        CHECK(error < 0.05 * a);
    }
}
