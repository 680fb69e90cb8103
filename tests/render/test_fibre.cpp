// One fibre in the sun against the runtime's own far field: camera, hit, offset, frame and light together.
#include <catch2/catch.hpp>

#include <cstdlib>
#include <memory>

#include "medulla/medulla.hpp"
#include "render/error.hpp"
#include "tests/render/scenes.hpp"

using namespace medulla;
using namespace medulla::render;

namespace {

std::string text(Vec3 v) { return fmt::format("[{}, {}, {}]", v.x, v.y, v.z); }

/// World to the frame of a fibre that grows up y: x root to tip, right-handed.
Vector local(Vec3 w) { return {w.y, w.z, w.x}; }

}  // namespace

TEST_CASE("a fibre in the sun returns its far field's value times the irradiance", "[render][fibre]") {
    // Tilt and inclination differ from 0, so that a frame upside down would show; wide lobes, so that the sun is small.
    const std::string material = R"({"name": "tilted", "preset": "red_fox", "alpha": 12, "sigma_ca": [0.1, 0.3, 0.9]})";
    const Vec3 lights[] = {{1, 0.5f, 1}, {-1, -0.6f, 0.2f}, {0.3f, 0.8f, -1}, {0.05f, -0.4f, -1}};
    for (const float height : {-40.0f, 30.0f})
        for (const Vec3 light : lights) {
            const Vec3 camera{0, height, 80};
            const Scene scene =
                parse_scene(R"({"camera": {"from": )" + text(camera) + R"(, "to": [0, 0, 0], "fov": 0.25},
                "picture": {"width": 16, "height": 8}, "materials": [)" +
                                material + R"(],
                "fibres": [{"material": "tilted", "radius": 0.1, "points": [[0, -4, 0], [0, -1, 0], [0, 1, 0], [0, 4, 0]]}],
                "lights": [{"light": "sun", "direction": )" +
                                text(light) + R"(, "irradiance": 2}]})",
                            "test");
            RenderOptions options = tests::options(256);
            const Film film = tests::picture(scene, options);

            const FurParameters<3>& p = scene.materials[0].fur;
            const PackView pack = default_pack();
            const std::size_t bytes = (tables_bytes(pack, ranges_of(p)) + 63) / 64 * 64;
            const std::unique_ptr<void, void (*)(void*)> memory(std::aligned_alloc(64, bytes), std::free);
            const Fibre<3> fibre = make_fibre(p, make_tables(pack, ranges_of(p), memory.get(), bytes).tables);
            const Colour<3> value = far_field(fibre, local(normalise(camera))).value(local(normalise(light)));
            // The share of the picture that the fibre covers: its width over the picture's at the axis.
            const double wide = 2 * std::tan(0.125 * 3.14159265 / 180) * double(length(camera)) * 16 / 8;
            double mean[3];
            film.mean(mean);
            const double error = tests::error_of_mean(film) / tests::mean_luminance(film);
            INFO("height " << height << ", light " << text(light) << ", relative standard error " << error);
            CHECK(error < 0.01);
            for (int c = 0; c < 3; ++c) {
                // 1 %: the sun's and the picture's angles, 0.5 and 0.5 degrees, in lobes of 9 and more.
                CHECK(mean[c] / (0.2 / wide * 2 * double(value[c])) == Approx(1).margin(4 * error + 0.01));
            }
        }
}
