// Numbers from every door of the BCSDF, one per line: what each compiler and target must print alike.
#include <cstdio>
#include <initializer_list>
#include <limits>

#include "medulla/medulla.hpp"

using namespace medulla;

static UnfoldedTables tables;

int main() {
    const OpenResult opened = open_pack(default_pack_words, default_pack_size);
    if (opened.status != PackStatus::ok) return 1;
    const auto print = [](float x) { std::printf("%.7e\n", double(x)); };
    for (const FurPreset& preset : fur_presets) {
        FurFibre<2> fibre;
        if (prepare(parameters_of<2>(preset), opened.pack, fibre) != FurStatus::ok) return 1;
        FurFibre<2> unfolded = fibre;
        if (!unfold(unfolded, tables)) return 1;
        for (float theta_i : {-1.2f, 0.3f}) {
            NearField<2> near;
            near_field(fibre, theta_i, 0.4f, near);
            FarField<2> far;
            far_field(fibre, theta_i, OffsetRange{}, far);
            NearSampler<2> near_sampler;
            near_sampler.prepare(near);
            FarSampler<2> far_sampler;
            far_sampler.prepare(far);
            for (float phi : {0.5f, -2.8f}) {
                const Colour<2> n = near.eval(0.1f - theta_i, phi), f = far.eval(0.1f - theta_i, phi);
                for (int c = 0; c < 2; ++c) print(n.value[c]), print(f.value[c]);
                const Colour<2> m = eval(unfolded, theta_i, 0.1f - theta_i, phi, 0.4f),
                                g = eval(unfolded, theta_i, 0.1f - theta_i, phi, OffsetRange{});
                for (int c = 0; c < 2; ++c) print(m.value[c]), print(g.value[c]);
                print(near_sampler.pdf(0.1f - theta_i, phi)), print(far_sampler.pdf(0.1f - theta_i, phi));
            }
            const float nan = std::numeric_limits<float>::quiet_NaN();
            const float theta_is[5] = {theta_i, -theta_i, 1.57f, nan, 1.5f}, hs[5] = {0.4f, -0.7f, 0.99f, 0.0f, -0.2f},
                        theta_rs[5] = {0.1f - theta_i, 0.2f, -1.5f, 1.4f, -1.4f},
                        phis[5] = {0.5f, -2.8f, 3.1f, 1.0f, 0};
            Colour<2> S[5];
            eval(unfolded, 5, theta_is, hs, theta_rs, phis, S);
            for (const Colour<2>& at : S) print(at.value[0]), print(at.value[1]);
            eval(fibre, 5, theta_is, hs, theta_rs, phis, S);
            for (const Colour<2>& at : S) print(at.value[0]), print(at.value[1]);
            const RandomNumbers u = {0.6f, 0.3f, 0.7f, 0.2f, 0.5f};
            const FurSample<2> a = near_sampler.sample(u), b = far_sampler.sample(u);
            print(a.theta_r), print(a.phi), print(a.weight[0]), print(b.theta_r), print(b.phi), print(b.weight[1]);
        }
    }
    return 0;
}
