// Numbers from every door of the runtime, one per line: what each compiler and target must print alike.
#include <cstdio>
#include <initializer_list>
#include <limits>

#include "medulla/baked_field.hpp"
#include "medulla/medulla.hpp"
#include "medulla/models/from_fur.hpp"

using namespace medulla;

alignas(64) static unsigned char memory[4 << 20];

static void print(float x) { std::printf("%.7e\n", double(x)); }
template <int Channels>
static void print(const Evaluation<Channels>& e) {
    for (int c = 0; c < Channels; ++c) print(e.value[c]);
    print(e.pdf);
}
template <int Channels>
static void print(const Sample<Channels>& s) {
    for (const float x : {s.direction.x, s.direction.y, s.direction.z, s.pdf, s.weight[0]}) print(x);
}

/// The models that are not in medulla.hpp.
template <class Field>
static void print_model(const Field& hit) {
    for (const float phi : {0.6f, -2.9f}) print(hit.evaluate(Angles{-0.2f, phi}));
    for (const float lobe : {0.01f, 0.4f, 0.8f}) print(hit.sample({lobe, 0.3f, 0.7f, 0.2f, 0.4f}));
}
static void print_models(const FurParameters<2>& p, const DenseTables* tables) {
    using namespace models;
    const Angles known = {0.3f, 0.1f};
    print_model(far_field(kajiya_kay_of(p, false), known));
    print_model(far_field(kim_of(p), known));
    print_model(far_field(marschner_of(p), known));
    print_model(near_field(zinke_of(p), known, 0.4f));
    print_model(far_field(deon_of(p), known));
    print_model(near_field(chiang_of(p), known, 0.4f));
    print_model(near_field(yan2015_of(p), tables, known, 0.4f));
    print_model(near_field(BakedFibre<2>(), known, 0.4f));  // without a bake it is black: that it compiles is the test
    print_model(far_field(BakedFibre<2>(), known));
}

int main() {
    const PackView pack = default_pack();
    print(azimuthal(pack, 2.0f, 0.4f, 0.5f, 0.52f));
    print(longitudinal(pack, Side::back, 2.0f, 0.4f, 0.5f, -0.3f));
    for (const FurPreset& preset : fur_presets) {
        const FurParameters<2> parameters = parameters_of<2>(preset);
        const TablesResult made = make_tables(pack, ranges_of(parameters), memory, sizeof memory);
        if (made.status != TablesStatus::ok) return 1;
        const Fibre<2> fibre = make_fibre(parameters, made.tables);
        if (fibre.status != FibreStatus::ok) return 1;
        for (const float theta : {-1.2f, 0.3f}) {
            const Vector known = direction_of(Angles{theta, 0.7f});
            const NearField<2> hit = near_field(fibre, known, 0.4f);
            const FarField<2> whole = far_field(fibre, known);
            for (const float phi : {0.5f, -2.8f}) {
                const Vector drawn = direction_of(Angles{0.1f - theta, 0.7f + phi});
                print(hit.evaluate(drawn));
                print(whole.evaluate(drawn));
                print(hit.eq12(0.1f - theta, phi)[0]);
                print(whole.eq12(0.1f - theta, phi)[1]);
            }
            const float nan = std::numeric_limits<float>::quiet_NaN();
            const Angles from[5] = {{theta, 0}, {-theta, 1}, {1.57f, 2}, {nan, 3}, {1.5f, -1}},
                         to[5] = {{0.1f - theta, 0.5f}, {0.2f, -2.8f}, {-1.5f, 3.1f}, {1.4f, 1}, {-1.4f, 0}};
            const float h[5] = {0.4f, -0.7f, 0.99f, 0.0f, -0.2f};
            Evaluation<2> many[5];
            evaluate_batch(fibre, 5, from, h, to, many);
            for (const Evaluation<2>& e : many) print(e);
            for (const float lobe : {0.01f, 0.3f, 0.6f, 0.97f}) {
                const RandomNumbers u = {lobe, 0.3f, 0.7f, 0.2f, 0.4f};  // 0.5 is h = 0, where the side changes
                print(hit.sample(u));
                print(whole.sample(u));
            }
            print(hit.keep(lobe_bit(Lobe::TTs)).value(direction_of(Angles{0.1f, 2.0f}))[0]);
        }
    }
    FurParameters<2> parameters = parameters_of<2>(*find_preset("deer"));
    parameters.beta_m = parameters.beta_n = 0.2f;  // fast math moves narrower lobes by more than is compared
    TableRanges ranges = ranges_of(parameters);
    ranges.eta = 0;
    const TablesResult made = make_tables(pack, ranges, memory, sizeof memory);
    if (made.status != TablesStatus::ok) return 1;
    print_models(parameters, made.tables);
    return 0;
}
