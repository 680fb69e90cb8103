// The runtime in a renderer's first ten minutes: a red fox's fibre, a ray that meets it, where light goes on, and the
// lobe around the fibre as bars.
#include <cstdio>
#include <cstdlib>

#include "medulla/medulla.hpp"

int main() {
    using namespace medulla;
    const FurParameters<3> fox = parameters_of<3>(*find_preset("red_fox"));

    // Once per coat: dense tables in memory of ours.
    const PackView pack = default_pack();
    const TableRanges ranges = ranges_of(fox);
    const std::size_t bytes = (tables_bytes(pack, ranges) + 63) / 64 * 64;
    void* const memory = std::aligned_alloc(64, bytes);
    const TablesResult made = make_tables(pack, ranges, memory, bytes);
    if (made.status != TablesStatus::ok) {
        std::fprintf(stderr, "tables: %s\n", describe(made.status));
        return 1;
    }

    // At a hit: the direction towards the camera in the fibre's frame (x from root to tip), and the ray's offset.
    const Fibre<3> fibre = make_fibre(fox, made.tables);
    const Vector camera = {0.2f, 0.95f, 0.24f};
    const NearField<3> hit = near_field(fibre, camera, 0.4f);
    const Sample<3> next = hit.sample({0.7f, 0.3f, 0.6f, 0.5f});
    std::printf("drawn (%.3f, %.3f, %.3f): pdf %.3f per steradian, weight %.3f; of all light %.3f leaves\n\n",
                double(next.direction.x), double(next.direction.y), double(next.direction.z), double(next.pdf),
                double(next.weight[0]), double(hit.albedo()[0]));

    std::printf(
        "energy per steradian at the camera's inclination, by azimuth from the camera (180: straight through)\n");
    const FarField<3> whole = far_field(fibre, camera);
    for (int degrees = -180; degrees <= 180; degrees += 20) {
        const Angles seen = angles_of(camera);
        const Angles drawn = {-seen.theta, seen.phi + static_cast<float>(degrees * pi / 180)};
        const float value = whole.value(drawn)[0];
        std::printf("%5d deg  %.4f  ", degrees, double(value));
        for (int i = 0; i < static_cast<int>(300 * value); ++i) std::putchar('#');
        std::putchar('\n');
    }
    std::free(memory);
    return 0;
}
