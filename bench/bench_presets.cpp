// Parameters with which the corrected form of the scattered lobes follows the published model of each animal, in the
// far field and in four colours: the corrected presets of medulla/fur_parameters.hpp. Table 4 was fitted to
// measurements with the published form, which therefore stands in for them.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "medulla/medulla.hpp"
#include "sim2d/quadrature.hpp"
#include "sim3d/fibre_tracer.hpp"
#include "sim3d/model/five_lobes.hpp"

using namespace medulla;

namespace {

constexpr int channels = 4;  // the printed sigma_ca, then red, green and blue of the coat
using Fur = FurParameters<channels>;

constexpr double inclinations[] = {0, 20, 40, 60};  // of the light [degrees]
constexpr int theta_count = 24, phi_count = 18;     // exits of the scattered lobes, phi over half a turn

/// What is compared. Densities are per radian^2, energies shares of the light that meets the fibre.
struct Light {
    double unscattered[3][channels];                                         ///< energies of R, TT, TRT
    double scattered[channels];                                              ///< of TTs and TRTs
    std::array<double, std::size_t(theta_count* phi_count)> lobe[channels];  ///< density of TTs and TRTs
};

/// The far field of a material for every inclination.
std::vector<Light> far_fields(const Fur& p) {
    const TableRanges ranges = ranges_of(p);
    std::vector<unsigned char> memory(tables_bytes(default_pack(), ranges) + 64);
    void* at = memory.data() + (64 - reinterpret_cast<std::uintptr_t>(memory.data()) % 64) % 64;
    const TablesResult made = make_tables(default_pack(), ranges, at, memory.size() - 64);
    const Fibre<channels> fibre = make_fibre(p, made.tables);
    const sim2d::Quadrature rule = sim2d::unit_gauss_legendre(32);
    std::vector<Light> lights;
    for (const double degrees : inclinations) {
        Light light = {};
        const Angles known = {float(degrees * pi / 180), 0};
        for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
            const double t = pi / 2 * rule.nodes[i], weight = std::cos(t) * pi / 2 * rule.weights[i];
            const NearField<channels> near = near_field(fibre, known, float(std::sin(t)));
            for (int c = 0; c < channels; ++c) {
                for (int k = 0; k < 3; ++k) light.unscattered[k][c] += weight * double(near.A[k][c]);
                light.scattered[c] += weight * double(near.A[3][c] + near.A[4][c]);
            }
        }
        const FarField<channels> field = far_field(fibre, known);
        float side[theta_count][2];
        const auto theta_r = [](int i) { return float(pi * ((i + 0.5) / theta_count - 0.5)); };
        for (int i = 0; i < theta_count; ++i)
            side[i][0] = field.lobes(theta_r(i), 0).M[3], side[i][1] = field.lobes(theta_r(i), float(pi)).M[3];
        for (int j = 0; j < phi_count; ++j) {
            const float forward = (float(j) + 0.5f) / phi_count;
            const LobeValues<channels> lobes = field.lobes(0, forward * float(pi));
            for (int i = 0; i < theta_count; ++i)
                for (int c = 0; c < channels; ++c)
                    light.lobe[c][std::size_t(i * phi_count + j)] =
                        double((side[i][0] + forward * (side[i][1] - side[i][0])) * (lobes.N[3][c] + lobes.N[4][c]));
        }
        lights.push_back(light);
    }
    return lights;
}

/// The same of light in the whole fibre.
std::vector<Light> traced(const Fur& p, std::uint64_t paths) {
    FurParameters<3> three;
    three.eta = p.eta, three.kappa = p.kappa, three.alpha = p.alpha, three.beta_m = p.beta_m, three.beta_n = p.beta_n;
    three.layers = p.layers, three.sigma_ms = p.sigma_ms, three.sigma_ma = p.sigma_ma, three.g = p.g;
    sim3d::Fibre fibre = sim3d::fibre_of(three, 1);
    fibre.sigma_ca.assign(p.sigma_ca, p.sigma_ca + channels);
    sim3d::FibreOptions options;
    options.paths = paths, options.theta_bins = theta_count, options.phi_bins = 2 * phi_count;
    std::vector<Light> lights;
    for (const double degrees : inclinations) {
        sim3d::Light from;
        from.theta_i = degrees * pi / 180;
        const sim3d::FibreProfile profile = sim3d::trace_fibre(fibre, from, options);
        ++options.cell;
        Light light = {};
        for (std::size_t c = 0; c < channels; ++c) {
            for (int k = 0; k < 3; ++k)
                light.unscattered[k][c] = profile.energy(sim3d::only(static_cast<sim3d::Class>(k)), c).value;
            light.scattered[c] = profile.energy(sim3d::scattered, c).value;
            const sim3d::DirectionalDensity lobe = profile.density(sim3d::scattered, c, true);
            for (std::size_t i = 0; i < theta_count; ++i)
                for (std::size_t j = 0; j < phi_count; ++j)
                    light.lobe[c][i * phi_count + j] = lobe.value[i * 2 * phi_count + phi_count + j];
        }
        lights.push_back(light);
    }
    return lights;
}

double norm(const std::vector<double>& x) {
    double sum = 0;
    for (const double v : x) sum += v * v;
    return std::sqrt(sum);
}

/// Relative differences: of each scattered lobe over phi, |difference| / |lobe|, since over theta_r the two forms
/// differ by the cosine whatever the parameters are; of R, TT and TRT, energies over all of the light's.
std::vector<double> residuals(const std::vector<Light>& model, const std::vector<Light>& target) {
    std::vector<double> r;
    const auto over_phi = [](const Light& light, int c) {
        std::vector<double> sum(phi_count, 0.0);
        for (std::size_t i = 0; i < light.lobe[c].size(); ++i) sum[i % phi_count] += light.lobe[c][i];
        return sum;
    };
    for (std::size_t l = 0; l < target.size(); ++l)
        for (int c = 0; c < channels; ++c) {
            const std::vector<double> a = over_phi(model[l], c), b = over_phi(target[l], c);
            for (std::size_t i = 0; i < b.size(); ++i) r.push_back((a[i] - b[i]) / norm(b));
            double all = target[l].scattered[c];
            for (int k = 0; k < 3; ++k) all += target[l].unscattered[k][c];
            for (int k = 0; k < 3; ++k) r.push_back((model[l].unscattered[k][c] - target[l].unscattered[k][c]) / all);
        }
    return r;
}

/// What is fitted: logarithms of sigma_ms, sigma_ma, layers and the sigma_ca, and g.
constexpr std::size_t unknowns = 4 + channels;
using Unknowns = std::array<double, unknowns>;

Unknowns unknowns_of(const Fur& p) {
    const auto log = [](float x) { return std::log(std::max(double(x), 0.005)); };
    Unknowns x = {log(p.sigma_ms), log(p.sigma_ma), log(p.layers), double(p.g)};
    for (std::size_t c = 0; c < channels; ++c) x[4 + c] = log(p.sigma_ca[c]);
    return x;
}
Fur fur_of(Fur p, Unknowns x) {
    const auto within = [](double value, double low, double high) { return float(std::clamp(value, low, high)); };
    p.sigma_ms = within(std::exp(x[0]), 0.05, 8), p.sigma_ma = p.sigma_ma > 0 ? within(std::exp(x[1]), 0.001, 3) : 0;
    p.layers = within(std::exp(x[2]), 0.1, 10), p.g = within(x[3], 0, 0.9);
    for (std::size_t c = 0; c < channels; ++c) p.sigma_ca[c] = within(std::exp(x[4 + c]), 0.001, 10);
    return p;
}

/// The residuals, and a weak pull towards the start: what the lobes do not determine stays where Table 4 has it.
std::vector<double> pulled(const Fur& start, const Unknowns& x, const std::vector<Light>& target) {
    std::vector<double> r = residuals(far_fields(fur_of(start, x)), target);
    const Unknowns from = unknowns_of(start);
    for (std::size_t k = 0; k < unknowns; ++k) r.push_back((k == 3 ? 0.25 : 0.05) * (x[k] - from[k]));
    return r;
}

/// Levenberg and Marquardt's steps, by forward differences: a float far field has errors of 1e-5, a step of 0.01 shows
/// a slope to 1e-3.
Fur fit(const Fur& start, const std::vector<Light>& target) {
    Unknowns x = unknowns_of(start);
    std::vector<double> r = pulled(start, x, target);
    double damping = 1e-2;
    for (int iteration = 0; iteration < 40 && damping < 1e6; ++iteration) {
        std::array<std::vector<double>, unknowns> slope;
        for (std::size_t k = 0; k < unknowns; ++k) {
            Unknowns y = x;
            y[k] += 0.01;
            slope[k] = pulled(start, y, target);
            for (std::size_t i = 0; i < r.size(); ++i) slope[k][i] = (slope[k][i] - r[i]) / 0.01;
        }
        double normal[unknowns][unknowns + 1];
        for (std::size_t a = 0; a < unknowns; ++a) {
            for (std::size_t b = 0; b < unknowns; ++b) {
                normal[a][b] = 0;
                for (std::size_t i = 0; i < r.size(); ++i) normal[a][b] += slope[a][i] * slope[b][i];
            }
            normal[a][unknowns] = 0;
            for (std::size_t i = 0; i < r.size(); ++i) normal[a][unknowns] -= slope[a][i] * r[i];
        }
        const double before = norm(r);
        bool better = false;
        for (; !better && damping < 1e6; damping *= better ? 0.2 : 4) {
            double m[unknowns][unknowns + 1];
            std::copy(&normal[0][0], &normal[0][0] + unknowns * (unknowns + 1), &m[0][0]);
            // An unknown that changes nothing stays.
            for (std::size_t a = 0; a < unknowns; ++a) m[a][a] += damping * (m[a][a] + 1e-3);
            for (std::size_t a = 0; a < unknowns; ++a)  // symmetric and positive definite: no pivots
                for (std::size_t b = a + 1; b < unknowns; ++b) {
                    const double part = m[b][a] / m[a][a];
                    for (std::size_t k = a; k <= unknowns; ++k) m[b][k] -= part * m[a][k];
                }
            Unknowns step = {};
            for (std::size_t a = unknowns; a-- > 0;) {
                step[a] = m[a][unknowns];
                for (std::size_t k = a + 1; k < unknowns; ++k) step[a] -= m[a][k] * step[k];
                step[a] /= m[a][a];
            }
            Unknowns y = x;
            for (std::size_t k = 0; k < unknowns; ++k) y[k] += std::clamp(step[k], -0.5, 0.5);
            y = unknowns_of(fur_of(start, y));  // within the bounds
            std::vector<double> there = pulled(start, y, target);
            if (norm(there) < before) x = y, r = std::move(there), better = true;
        }
        if (norm(r) > before * (1 - 1e-4)) break;
    }
    return fur_of(start, x);
}

/// Of all inclinations and colours: the greatest error of a scattered energy, and the RMS of scattered lobes' relative
/// L2 error and of their shapes'.
struct Closeness {
    double energy = 0, lobe = 0, shape = 0, R = 0;
};
Closeness closeness(const std::vector<Light>& model, const std::vector<Light>& target) {
    Closeness c;
    double count = 0;
    for (std::size_t l = 0; l < target.size(); ++l)
        for (int k = 0; k < channels; ++k) {
            const double scale = target[l].scattered[k] / model[l].scattered[k];
            double lobe = 0, shape = 0, norm = 0;
            for (std::size_t i = 0; i < target[l].lobe[k].size(); ++i) {
                const double a = model[l].lobe[k][i], b = target[l].lobe[k][i];
                lobe += (a - b) * (a - b), shape += (scale * a - b) * (scale * a - b), norm += b * b;
            }
            c.energy = std::max(c.energy, std::abs(1 / scale - 1));
            c.R = std::max(c.R, std::abs(model[l].unscattered[0][k] - target[l].unscattered[0][k]));
            c.lobe += lobe / norm, c.shape += shape / norm, count += 1;
        }
    c.lobe = std::sqrt(c.lobe / count), c.shape = std::sqrt(c.shape / count);
    return c;
}

}  // namespace

int main(int argc, char** argv) {
    std::vector<std::string> animals;
    std::string json;
    std::uint64_t paths = 200000;
    CLI::App app("Parameters of the corrected form that follow the published model of each animal");
    app.add_option("--animal", animals, "these alone");
    app.add_option("--paths", paths, "paths per inclination of light in the whole fibre, for comparison");
    app.add_option("--json", json, "write the numbers to FILE");
    CLI11_PARSE(app, argc, argv);
    nlohmann::json out;
    std::printf(
        "Corrected form against the published model, far field, light from 0 to 60 degrees, grey and three colours: "
        "with Table 4's parameters, then fitted: greatest error of the scattered energy, of R (share of the light); "
        "RMS relative L2 error of the scattered lobe, of its shape; light in the whole fibre with the fitted "
        "parameters\n");
    for (const FurPreset& preset : fur_presets) {
        if (!animals.empty() && std::find(animals.begin(), animals.end(), preset.name) == animals.end()) continue;
        Fur p = parameters_of<channels>(preset);
        for (int c = 0; c < 3; ++c) p.sigma_ca[1 + c] = preset.coat[c];
        const std::vector<Light> target = far_fields(p);
        p.scattering = Scattering::corrected, p.fresnel = Fresnel::exact;
        const Fur fitted = fit(p, target);
        const Closeness before = closeness(far_fields(p), target), after = closeness(far_fields(fitted), target),
                        truth = closeness(traced(fitted, paths), target);
        std::printf("%-9s | %.2f %.3f %.3f %.3f | %.3f %.3f %.3f %.3f | %.3f %.3f %.3f %.3f\n", preset.name,
                    before.energy, before.R, before.lobe, before.shape, after.energy, after.R, after.lobe, after.shape,
                    truth.energy, truth.R, truth.lobe, truth.shape);
        std::printf(
            "    detail::corrected(fur_presets[%d], \"%s_corrected\", %.3gf, %.3gf, %.2gf, %.2gf, %.2gf, %.3gf, %.3gf, "
            "%.3gf),\n",
            int(&preset - fur_presets), preset.name, double(fitted.sigma_ca[0]), double(fitted.sigma_ms),
            double(fitted.sigma_ma), double(fitted.g), double(fitted.layers), double(fitted.sigma_ca[1]),
            double(fitted.sigma_ca[2]), double(fitted.sigma_ca[3]));
        std::fflush(stdout);
        out["animals"].push_back({{"animal", preset.name},
                                  {"before", {before.energy, before.R, before.lobe, before.shape}},
                                  {"after", {after.energy, after.R, after.lobe, after.shape}},
                                  {"truth", {truth.energy, truth.R, truth.lobe, truth.shape}}});
    }
    if (!json.empty()) std::ofstream(json) << out.dump(1) << '\n';
}
