// The comparison of the five-lobe model with light in the fibre: the model is the runtime's, a model that is the truth
// has no error beyond the noise, and energies add up. Errors come from 16 batches: five of them are exceeded once in
// 6000 times (Student's t).
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "sim3d/fibre_tracer.hpp"
#include "sim3d/model/error_map.hpp"
#include "tests/support/fibre_of.hpp"

using namespace medulla;
using namespace medulla::sim3d;

namespace {

constexpr std::size_t theta_bins = 30, phi_bins = 48;

sim3d::Fibre preset(const char* name) { return fibre_of(parameters_of<3>(*find_preset(name)), 1); }

MeasuredLight trace(const sim3d::Fibre& fibre, double theta_i, double low, double high, std::uint64_t paths,
                    std::uint64_t cell) {
    FibreOptions o;
    o.paths = paths, o.cell = cell, o.theta_bins = 180, o.phi_bins = phi_bins;
    Light light;
    light.theta_i = theta_i, light.h_low = low, light.h_high = high;
    return measured(trace_fibre(fibre, light, o), fibre, o, theta_bins);
}

/// Measured light as if it were a model.
FiveLobes as_model(const MeasuredLight& light) {
    FiveLobes m;
    m.energy.resize(1), m.scattered.resize(1);
    const ChannelLight& c = light.all.channels[0];
    for (std::size_t k = 0; k < 3; ++k) m.energy[0][k] = c.energy[k];
    m.energy[0][3] = c.scattered_energy();
    for (DirectionalDensity& d : m.scattered[0])
        d.theta_bins = theta_bins, d.phi_bins = phi_bins, d.value = c.scattered;
    return m;
}

bool agree(const Estimate& a, const Estimate& b) {
    return std::abs(a.value - b.value) <= 5 * std::hypot(a.error, b.error);
}

}  // namespace

TEST_CASE("Error map: the model's energies are the runtime's, with either Fresnel term and form", "[error_map]") {
    // The runtime is in float: 1e-5 of energies of at most 1. In the corrected form, four directions stand for all:
    // 0.02 of the scattered energy (bench_escape).
    for (const FurPreset& row : fur_presets)
        for (const ModelForm form :
             {ModelForm{}, ModelForm{Reflectance::exact}, ModelForm{Reflectance::exact, Scattering::corrected}}) {
            FurParameters<3> p = parameters_of<3>(row);
            p.fresnel = form.reflectance == Reflectance::exact ? Fresnel::exact : Fresnel::bravais;
            p.scattering = form.scattering, p.sigma_ca[1] *= 2;
            const test::FibreOf<3> fibre(p, default_pack());
            for (const double theta_i : {-1.1, 0.0, 0.5}) {
                const double h[] = {0.0, 0.3, 0.95};
                const auto models =
                    five_lobes(fibre_of(p, 3), form, theta_i, {{h[0], h[0]}, {h[1], h[1]}, {h[2], h[2]}}, 1, 1);
                for (std::size_t i = 0; i < 3; ++i) {
                    const NearField<3> near = near_field(fibre, Angles{float(theta_i), 0}, float(h[i]));
                    for (std::size_t c = 0; c < 3; ++c) {
                        double sum = 0;
                        for (const double A : models[i].energy[c]) sum += A;
                        const double scattered = models[i].energy[c][3] + models[i].energy[c][4];
                        CHECK(std::abs(sum - double(near.albedo()[int(c)])) <
                              1e-5 + (form.scattering == Scattering::corrected ? 0.02 * scattered : 0));
                    }
                }
            }
        }
}

TEST_CASE("Error map: the model's scattered lobe is the runtime's", "[error_map]") {
    // Relative L2: 3e-3 is the pack's error of a lobe (docs/accuracy.md), twice of which two tables may reach; bins are
    // averaged by a midpoint rule of 3 x 3 points.
    const FurParameters<3> p = parameters_of<3>(*find_preset("rabbit"));
    const test::FibreOf<3> fibre(p, default_pack());
    const LobeMask scattered_lobes = lobe_bit(Lobe::TTs) | lobe_bit(Lobe::TRTs);
    for (const double theta_i : {-0.7, 0.2})
        for (const double h : {0.1, 0.6}) {
            const NearField<3> near = near_field(fibre, Angles{float(theta_i), 0}, float(h));
            const FiveLobes model = five_lobes(fibre_of(p, 1), {}, theta_i, {{h, h}}, theta_bins, phi_bins)[0];
            std::vector<double> runtime;
            for (std::size_t t = 0; t < theta_bins; ++t)
                for (std::size_t b = 0; b < phi_bins; ++b) {
                    double sum = 0;
                    for (int i = 0; i < 9; ++i) {
                        const double theta = ((double(t) + (i / 3 + 0.5) / 3) / double(theta_bins) - 0.5) * pi;
                        const double phi = ((double(b) + (i % 3 + 0.5) / 3) / double(phi_bins) - 0.5) * 2 * pi;
                        sum += double(angular_density(near.lobes(float(theta), float(phi)), scattered_lobes)[0]) / 9;
                    }
                    runtime.push_back(sum);
                }
            const Squares s = squares(runtime, 1, model.scattered[0][0].value, 1);
            CHECK(std::sqrt(s.difference / s.norm) < 6e-3);
        }
}

TEST_CASE("Error map: the lengths that the model absorbs over are the derivatives of its energies", "[error_map]") {
    const ModelForm form{Reflectance::bravais, GENERATE(Scattering::published, Scattering::corrected)};
    sim3d::Fibre f = preset("mouse"), less = f;
    const double step = 1e-6;  // the second derivative is below 10: 1e-5 of lengths of about 1
    f.sigma_ca = {0}, f.sigma_ma = 0, less = f, less.sigma_ca = {step};
    const std::vector<OffsetRange> all = {{0, 1}};
    const auto scattered_energy = [](const FiveLobes& m) { return m.energy[0][3] + m.energy[0][4]; };
    const FiveLobes white = five_lobes(f, form, 0.6, all, 1, 1)[0];
    CHECK(scattered_energy(white) == white.white[3] + white.white[4]);
    const double cortex =
        five_lobes(less, form, 0.6, all, 1, 1)[0].energy[0][3] + five_lobes(less, form, 0.6, all, 1, 1)[0].energy[0][4];
    CHECK(std::abs((scattered_energy(white) - cortex) / step - white.cortex_length) < 1e-5);
    less = f, less.sigma_ma = step;
    const double medulla = scattered_energy(five_lobes(less, form, 0.6, all, 1, 1)[0]);
    CHECK(std::abs((scattered_energy(white) - medulla) / step - white.medulla_length) < 1e-5);
}

TEST_CASE("Error map: a model that is the truth has no error beyond the noise", "[error_map]") {
    for (const char* name : {"raccoon", "red_fox"}) {
        const sim3d::Fibre fibre = preset(name);
        const MeasuredLight truth = trace(fibre, 0.5, 0.25, 0.5, 40000, 1);
        const MeasuredLight exact = trace(fibre, 0.5, 0.25, 0.5, 2000000, 2);
        const LightError right = light_error(truth, as_model(exact), 0.5, {0.25, 0.5});
        const ChannelError& e = right.channels[0];
        for (std::size_t k = 0; k < 3; ++k)
            CHECK(agree(e.truth[k], jackknife(exact, [&](const LightMeans& m) { return m.channels[0].energy[k]; })));
        // What the model's own noise adds: a fiftieth of the squared noise of the truth, which is what its square
        // would be without the subtraction.
        const Distance noise = distance(16, [&](std::size_t k) {
            const LightMeans& m = k < 16 ? truth.without[k] : truth.all;
            return squares(exact.all.channels[0].scattered, 1, m.channels[0].scattered, 1);
        });
        const Squares raw = squares(exact.all.channels[0].scattered, 1, truth.all.channels[0].scattered, 1);
        const double biased = raw.difference / raw.norm;
        CHECK(noise.square.value == e.lobe.square.value);
        for (const Distance& d : {e.lobe, e.shape, e.cosine}) {
            REQUIRE(d.defined);
            CHECK(std::abs(d.square.value) <= 5 * d.square.error + biased / 50);
            CHECK(d.bound() < 0.5 * std::sqrt(biased));
        }
        CHECK(biased > 10 * e.lobe.square.error);

        // A tenth too bright: the lobe's error is a tenth, and its shape has none.
        FiveLobes bright = as_model(exact);
        bright.energy[0][3] *= 1.1;
        for (DirectionalDensity& d : bright.scattered[0])
            for (double& x : d.value) x *= 1.1;
        const LightError wrong = light_error(truth, bright, 0.5, {0.25, 0.5});
        CHECK(std::abs(wrong.channels[0].lobe.square.value - 0.01) <=
              5 * wrong.channels[0].lobe.square.error + 1.21 * biased / 50);
        CHECK(wrong.channels[0].shape.square.value == Approx(e.shape.square.value).epsilon(1e-9));

        // sigma of C^M: where one lobe is the truth and the other is turned over, the difference of squares is the
        // distance of the two.
        FiveLobes either = as_model(exact);
        std::vector<double>& other = either.scattered[0][std::size_t(Longitudinal::authors_cosine)].value;
        std::reverse(other.begin(), other.end());
        const Squares apart = squares(other, 1, exact.all.channels[0].scattered, 1);
        const Estimate sigma = light_error(truth, either, 0.5, {0.25, 0.5}).channels[0].sigma;
        CHECK(std::abs(sigma.value - apart.difference / apart.norm) <= 5 * sigma.error + 0.02 * sigma.value);
        CHECK(sigma.value > 10 * sigma.error);
    }
}

TEST_CASE("Error map: energies add up, and both sides of the fibre are alike", "[error_map]") {
    ErrorMapOptions o;
    o.paths = 4000, o.inclinations = 3, o.offsets = 2;
    std::size_t calls = 0;
    o.progress = [&] {
#pragma omp atomic
        ++calls;
    };
    FurParameters<3> p = parameters_of<3>(*find_preset("mouse"));
    p.alpha = 0, p.sigma_ca[1] = 0.5f;
    const sim3d::Fibre fibre = fibre_of(p, 3);
    const ErrorMap map = error_map(fibre, {}, o);
    CHECK(calls == map_cells(o));
    REQUIRE(map.cells.size() == 6);
    REQUIRE(map.far.size() == 3);
    const auto same = [](double a, double b) { return std::abs(a - b) < 1e-12; };  // sums of numbers below 1
    for (std::size_t c = 0; c < 3; ++c) {
        double truth = 0, model = 0;
        for (std::size_t t = 0; t < 3; ++t) {
            const ChannelError& far = map.far[t].channels[c];
            const double weight = t == 1 ? 0.5 : 0.25;  // cos^2 of 0 and 45 degrees
            truth += weight * far.scattered.value, model += weight * far.model_scattered();
            double sum = 0, scattered_energy = 0;
            for (std::size_t k = 0; k < class_count; ++k) {
                sum += far.truth[k].value, scattered_energy += k > 3 ? far.truth[k].value : 0;
                const auto& cells = map.cells;
                CHECK(same(far.truth[k].value, 0.5 * (cells[2 * t].channels[c].truth[k].value +
                                                      cells[2 * t + 1].channels[c].truth[k].value)));
            }
            CHECK(sum < 1);
            CHECK(same(scattered_energy, far.scattered.value));
            CHECK(far.lobe.defined);
            // One range of all offsets has other nodes; the medulla's edge and the rim are resolved to 1e-5.
            const FiveLobes whole = five_lobes(fibre, {}, map.theta_i[t], {{0, 1}}, 1, 1)[0];
            for (std::size_t k = 0; k < all_lobe_count; ++k) CHECK(std::abs(whole.energy[c][k] - far.model[k]) < 1e-5);
        }
        const ChannelError& all = map.all.channels[c];
        CHECK(same(truth, all.scattered.value));
        CHECK(same(model, all.model_scattered()));
        const Causes& causes = map.causes[c];
        CHECK(same(causes.entering.value + causes.absorbing.value, all.model_scattered() - all.scattered.value));
        CHECK(causes.absorbing.value > 0);
        // Scales without tilt do not know theta_i from -theta_i.
        for (std::size_t k = 0; k < class_count; ++k)
            CHECK(agree(map.far[0].channels[c].truth[k], map.far[2].channels[c].truth[k]));
    }
}

TEST_CASE("Error map: light at -h is the mirror image of light at h", "[error_map]") {
    const sim3d::Fibre fibre = preset("red_fox");
    const MeasuredLight left = trace(fibre, 0.4, 0.5, 0.75, 40000, 3),
                        right = trace(fibre, 0.4, -0.75, -0.5, 2000000, 4);
    FiveLobes other = as_model(right);
    const ChannelError crossed = light_error(left, other, 0.4, {0.5, 0.75}).channels[0];
    for (std::vector<double>* x : {&other.scattered[0][0].value})
        for (std::size_t row = 0; row < x->size(); row += phi_bins)
            std::reverse(x->begin() + std::ptrdiff_t(row), x->begin() + std::ptrdiff_t(row + phi_bins));
    const ChannelError mirrored = light_error(left, other, 0.4, {0.5, 0.75}).channels[0];
    for (std::size_t k = 0; k < class_count; ++k)
        CHECK(agree(mirrored.truth[k], jackknife(right, [&](const LightMeans& m) { return m.channels[0].energy[k]; })));
    // The noise of the other side, a fiftieth of this one's, is not subtracted: 2e-4 of a square.
    CHECK(std::abs(mirrored.lobe.square.value) <= 5 * mirrored.lobe.square.error + 4e-4);
    CHECK(crossed.lobe.square.value > 20 * mirrored.lobe.square.error);
}

TEST_CASE("Error map: white hair has no scattered lobe", "[error_map]") {
    ErrorMapOptions o;
    o.paths = 1000, o.inclinations = 3, o.offsets = 1;
    sim3d::Fibre hair;
    hair.beta_m = hair.beta_n = 0.1;
    const ErrorMap map = error_map(hair, {Reflectance::exact}, o);
    const ChannelError& all = map.all.channels[0];
    CHECK(!all.lobe.defined);
    CHECK(!all.shape.defined);
    CHECK(!map.causes[0].cuticle.defined);
    CHECK(all.scattered.value == 0);
    CHECK(map.causes[0].entering.value == 0);
    CHECK(map.causes[0].absorbing.value == 0);
    CHECK(all.truth[0].value > 0.05);
}
