// Parameters of the other models made of a fur material's.
#include "medulla/medulla.hpp"
#include "medulla/models/from_fur.hpp"
#include "tests/models/model_checks.hpp"

using namespace medulla;
using namespace medulla::models;

TEST_CASE("from fur: every animal, and every end of a range, is in the models' ranges") {
    std::vector<FurParameters<3>> furs;
    for (const FurPreset& preset : fur_presets) furs.push_back(coloured_parameters_of(preset));
    for (const float eta : {1.0000002f, 10.0f})
        for (const float beta : {1e-4f, 4.0f})
            for (const float alpha : {-float(pi / 2), float(pi / 2)})
                for (const float kappa : {0.0f, 1.0f}) {
                    FurParameters<3> p;
                    p.eta = eta, p.beta_m = p.beta_n = beta, p.alpha = alpha, p.kappa = kappa;
                    p.sigma_ma = p.sigma_ms = p.sigma_ca[1] = 1e9f, p.layers = 1000;
                    furs.push_back(p);
                }
    for (const FurParameters<3>& p : furs) {
        REQUIRE(out_of_range(p) == 0);
        INFO("eta " << p.eta << " beta " << p.beta_m << " " << p.beta_n << " kappa " << p.kappa);
        const char* const wrong[] = {wrong_parameter(kajiya_kay_of(p, false)).name,
                                     wrong_parameter(kajiya_kay_of(p, true)).name,
                                     wrong_parameter(kim_of(p)).name,
                                     wrong_parameter(marschner_of(p)).name,
                                     wrong_parameter(zinke_of(p)).name,
                                     wrong_parameter(deon_of(p)).name,
                                     wrong_parameter(chiang_of(p)).name,
                                     wrong_parameter(yan2015_of(p)).name};
        for (const char* name : wrong) CHECK(name == nullptr);
    }
}

TEST_CASE("from fur: widths and energies are the fur's") {
    for (const FurPreset& preset : fur_presets) {
        const FurParameters<3> p = parameters_of<3>(preset);
        INFO(preset.name);
        // Newton's steps end at float's resolution.
        const Chiang<3> c = chiang_of(p);
        CHECK(Chiang<3>::deviation_of(c.beta_m) == Approx(p.beta_m).epsilon(2e-6));
        CHECK(Chiang<3>::scale_of(c.beta_n) * pi / std::sqrt(3.0) == Approx(p.beta_n).epsilon(2e-6));
        // Light across the fibre: what leaves is what leaves the fur, by 16 midpoints in h against 2000; the medulla's
        // rim lies in one of the 16.
        double albedo = 0;
        for (int i = 0; i < 2000; ++i) {
            const float h = float((i + 0.5) / 2000);
            const auto at = detail::inclination(p.eta, 1.0f, p.fresnel);
            const auto path = detail::trace(at, p.kappa, p.layers, h, std::sqrt((1 - h) * (1 + h)));
            const auto e = detail::energies(path, detail::absorption(p, at.inverse_cos_t), path.s_m > 0);
            for (const auto& A : e.A) albedo += double(A[0]) / 2000;
        }
        const Angles across = {0, 0};
        CHECK(test::energy_of(far_field(kajiya_kay_of(p, true), across), 24, 8) == Approx(albedo).epsilon(0.01));
        CHECK(test::energy_of(far_field(kajiya_kay_of(p, false), across), 24, 8) == Approx(albedo).epsilon(0.01));
        CHECK(test::energy_of(far_field(kim_of(p), across), 24, 512) == Approx(albedo).epsilon(0.01));
    }
    // R of every model leaves where the fur's does: at theta_r = alpha - theta_i.
    FurParameters<3> p;
    p.alpha = 0.15f, p.beta_m = 0.03f, p.beta_n = 0.2f, p.kappa = 0;
    for (float& s : p.sigma_ca) s = 1e3f;  // R alone
    const auto peak = [](const auto& hit) {
        int best = 0;
        float most = 0;
        for (int i = -400; i < 0; ++i) {
            const float v = hit.value(Angles{float(i) * 1e-3f, 0})[0] * std::cos(float(i) * 1e-3f);
            if (v > most) most = v, best = i;
        }
        return best * 1e-3;
    };
    const Angles known = {0.3f, 0};
    CHECK(peak(far_field(marschner_of(p), known)) == Approx(-0.15).margin(2e-3));
    CHECK(peak(near_field(zinke_of(p), known, 0)) == Approx(-0.15).margin(2e-3));
    CHECK(peak(far_field(deon_of(p), known)) == Approx(-0.15).margin(2e-3));
    CHECK(peak(near_field(chiang_of(p), known, 0)) == Approx(-0.15).margin(2e-3));
    CHECK(peak(near_field(yan2015_of(p), nullptr, known, 0)) == Approx(-0.15).margin(2e-3));
}
