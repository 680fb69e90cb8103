// A lobe of the medulla with nothing but the runtime header: prints C^N around the fibre as a bar chart.
#include <cstdio>

#include "medulla/medulla.hpp"

int main() {
    const medulla::OpenResult opened = medulla::open_pack(medulla::default_pack_words, medulla::default_pack_size);
    if (opened.status != medulla::PackStatus::ok) {
        std::fprintf(stderr, "default pack: %s\n", medulla::describe(opened.status));
        return 1;
    }
    const float sigma = 2.0f;  // optical radius of scattering: sigma_ms * kappa / cos(theta_t)
    const float g = 0.4f;      // anisotropy
    const float h = 0.5f;      // where the light enters, in medulla radii

    std::printf("C^N(phi; sigma = %g, g = %g, h = %g), energy %.4f\n", sigma, g, h,
                medulla::azimuthal_energy(sigma, h));
    // The parameters are contracted once, then any number of directions is read.
    const medulla::TableView& table = opened.pack[medulla::TableKind::azimuthal];
    medulla::LobeQuery query;
    query.sigma = sigma, query.g = g, query.h = h;
    const medulla::Contraction contraction = medulla::contract(table, query);
    for (int degrees = -180; degrees <= 180; degrees += 20) {
        const float phi = static_cast<float>(degrees * medulla::pi / 180);
        const float density = medulla::azimuthal_energy(sigma, h) * medulla::lobe(table, contraction, phi);
        std::printf("%5d deg  %.4f  ", degrees, static_cast<double>(density));
        for (int i = 0; i < static_cast<int>(100 * density); ++i) std::putchar('#');
        std::putchar('\n');
    }
    return 0;
}
