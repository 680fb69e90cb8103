// One of two files that are compiled with different flags and linked together: each prints what its own code gives.
// NAME is what main calls it.
#include <cstdio>

#include "medulla/medulla.hpp"

alignas(64) static unsigned char memory[1 << 20];

extern "C" int NAME() {
    using namespace medulla;
    const FurParameters<3> parameters = parameters_of<3>(*find_preset("bobcat"));
    const TablesResult made = make_tables(default_pack(), ranges_of(parameters), memory, sizeof memory);
    if (made.status != TablesStatus::ok) return 1;
    const NearField<3> hit = near_field(make_fibre(parameters, made.tables), Vector{0.2f, 0.9f, 0.3f}, 0.4f);
    const Sample<3> s = hit.sample({0.6f, 0.3f, 0.7f, 0.2f, 0});
    const float value =
        hit.value(Vector{-0.3f, -0.8f, 0.1f})[0] +
        far_field(make_fibre(parameters, made.tables), Vector{0.2f, 0.9f, 0.3f}).value(Vector{0.1f, 0.5f, 0.5f})[1];
    std::printf("%.5f %.5f\n", double(value), double(s.pdf));
    return value >= 0 && s.valid ? 0 : 1;
}
