#include "sim3d/model/error_map.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "medulla/config.hpp"
#include "sim3d/fibre_tracer.hpp"

namespace medulla::sim3d {
namespace {

/// theta_r bins of the tracer: a deviation of theta_r is wrong by a twelfth of their squared width, which is
/// subtracted.
constexpr std::size_t fine_theta = 180;

/// The parts of one scattered lobe that are compared.
enum Measure : std::size_t {
    shape,
    over_phi = longitudinal_count,
    over_theta,
    over_theta_authors,
    product,
    whole,
    measure_count
};
constexpr std::size_t house_cosine = shape + std::size_t(Longitudinal::house_cosine);
constexpr std::size_t authors_cosine = shape + std::size_t(Longitudinal::authors_cosine);
using Measures = std::array<Squares, measure_count>;

/// The same for all batches and for all but one: [batch left out, none].
struct Resampled {
    std::vector<Measures> of;

    void add(const Resampled& other, double weight) {
        of.resize(other.of.size());
        for (std::size_t k = 0; k < of.size(); ++k)
            for (std::size_t m = 0; m < measure_count; ++m) of[k][m].add(other.of[k][m], weight);
    }
    Distance get(std::size_t measure) const {
        return distance(of.size() - 1, [&](std::size_t k) { return of[k][measure]; });
    }
    /// Square of one relative distance minus that of another.
    Estimate between(std::size_t one, std::size_t other) const {
        return jackknife(of.size() - 1, [&](std::size_t k) {
            const double norm = of[k][one].norm;
            return norm > 0 ? (of[k][one].difference - of[k][other].difference) / norm : 0;
        });
    }
};

const LightMeans& replicate(const MeasuredLight& light, std::size_t k) {
    return k < light.without.size() ? light.without[k] : light.all;
}

DirectionalDensity density_of(const MeasuredLight& light, const std::vector<double>& values) {
    DirectionalDensity d;
    d.theta_bins = light.theta_bins, d.phi_bins = light.phi_bins, d.value = values;
    return d;
}

/// The truth's scattered lobe against the model's. Except for `whole`, the model is first scaled to the truth's energy.
Resampled compared(const MeasuredLight& truth, const FiveLobes& model, std::size_t channel) {
    Resampled r;
    const double energy = model.energy[channel][3] + model.energy[channel][4];
    const auto& variants = model.scattered[channel];
    const DirectionalDensity& cosine = variants[std::size_t(Longitudinal::house_cosine)];
    const DirectionalDensity cosine_phi = marginal(cosine, true), cosine_theta = marginal(cosine, false);
    const DirectionalDensity authors_theta = marginal(variants[std::size_t(Longitudinal::authors_cosine)], false);
    for (std::size_t k = 0; k <= truth.without.size(); ++k) {
        const ChannelLight& light = replicate(truth, k).channels[channel];
        const DirectionalDensity lobe = density_of(truth, light.scattered);
        Measures m;
        m[whole] = squares(variants[model.own()].value, 1, lobe.value, 1);
        if (energy > 0) {
            const double scale = light.scattered_energy() / energy;
            for (std::size_t v = 0; v < longitudinal_count; ++v)
                m[shape + v] = squares(variants[v].value, scale, lobe.value, 1);
            m[over_phi] = squares(cosine_phi.value, scale, marginal(lobe, true).value, 1);
            m[over_theta] = squares(cosine_theta.value, scale, marginal(lobe, false).value, 1);
            m[over_theta_authors] = squares(authors_theta.value, scale, marginal(lobe, false).value, 1);
            m[product] = squares(product_of_marginals(lobe).value, 1, lobe.value, 1);
        }
        r.of.push_back(m);
    }
    return r;
}

Estimate energy_of(const MeasuredLight& light, std::size_t channel, std::size_t kind) {
    return jackknife(light, [&](const LightMeans& m) { return m.channels[channel].energy[kind]; });
}
Estimate scattered_of(const MeasuredLight& light, std::size_t channel) {
    return jackknife(light, [&](const LightMeans& m) { return m.channels[channel].scattered_energy(); });
}

void add(FiveLobes& sum, const FiveLobes& other, double weight) {
    if (sum.energy.empty()) {
        sum = other;
        add(sum, other, -1);
    }
    for (std::size_t c = 0; c < other.energy.size(); ++c) {
        for (std::size_t k = 0; k < all_lobe_count; ++k) sum.energy[c][k] += weight * other.energy[c][k];
        for (std::size_t v = 0; v < longitudinal_count; ++v)
            for (std::size_t i = 0; i < other.scattered[c][v].value.size(); ++i)
                sum.scattered[c][v].value[i] += weight * other.scattered[c][v].value[i];
    }
    for (std::size_t k = 0; k < all_lobe_count; ++k) sum.white[k] += weight * other.white[k];
    sum.cortex_length += weight * other.cortex_length, sum.medulla_length += weight * other.medulla_length;
}

/// Energies and distances of the scattered lobe of one light.
LightError error_of(const MeasuredLight& truth, const FiveLobes& model, const std::vector<Resampled>& resampled,
                    double theta_i, const OffsetRange& offsets) {
    LightError error;
    error.theta_i = theta_i, error.offsets = offsets;
    for (std::size_t c = 0; c < model.energy.size(); ++c) {
        ChannelError e;
        for (std::size_t k = 0; k < class_count; ++k) e.truth[k] = energy_of(truth, c, k);
        e.scattered = scattered_of(truth, c), e.model = model.energy[c];
        e.lobe = resampled[c].get(whole), e.shape = resampled[c].get(shape + model.own());
        e.cosine = resampled[c].get(house_cosine), e.sigma = resampled[c].between(authors_cosine, house_cosine);
        error.channels.push_back(e);
    }
    return error;
}

/// Where R, TT and TRT leave in the far field of one inclination.
void add_directions(LightError& error, const MeasuredLight& truth) {
    for (std::size_t c = 0; c < error.channels.size(); ++c) {
        ChannelError& e = error.channels[c];
        for (std::size_t p = 0; p < 3; ++p) {
            if (!(e.truth[p].value > 10 * e.truth[p].error)) continue;
            const auto moment = [&](const LightMeans& m, std::size_t order) {
                const auto& sums = m.channels[c].moments[p];
                return sums[order] / sums[0];
            };
            e.shift[p] = jackknife(truth, [&](const LightMeans& m) { return moment(m, 1) + error.theta_i; });
            e.deviation[p] = jackknife(truth, [&](const LightMeans& m) {
                const double mean = moment(m, 1), width = pi / double(fine_theta);
                return std::sqrt(std::max(0.0, moment(m, 2) - mean * mean - width * width / 12));
            });
        }
    }
}

LobePicture picture_of(const MeasuredLight& truth, const FiveLobes& model, std::size_t channel, double theta_i,
                       const OffsetRange& offsets) {
    LobePicture p;
    p.theta_i = theta_i, p.offsets = offsets;
    p.model = model.scattered[channel][model.own()];
    p.cosine = model.scattered[channel][std::size_t(Longitudinal::house_cosine)];
    p.truth = density_of(truth, truth.all.channels[channel].scattered);
    for (std::size_t i = 0; i < p.truth.value.size(); ++i)
        p.truth.error.push_back(
            jackknife(truth, [&](const LightMeans& m) { return m.channels[channel].scattered[i]; }).error);
    return p;
}

/// The model for every inclination, one thread each.
std::vector<std::vector<FiveLobes>> models(const Fibre& fibre, const ModelForm& form, const ErrorMapOptions& options,
                                           const ErrorMap& map) {
    std::vector<std::vector<FiveLobes>> all(map.theta_i.size());
    std::exception_ptr error;
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t t = 0; t < map.theta_i.size(); ++t) try {
            all[t] = five_lobes(fibre, form, map.theta_i[t], map.offsets, options.theta_bins, options.phi_bins);
            if (options.progress) options.progress();
        } catch (...) {
#pragma omp critical
            error = std::current_exception();
        }
    if (error) std::rethrow_exception(error);
    return all;
}

}  // namespace

LightError light_error(const MeasuredLight& truth, const FiveLobes& model, double theta_i, const OffsetRange& offsets) {
    std::vector<Resampled> resampled;
    for (std::size_t c = 0; c < model.energy.size(); ++c) resampled.push_back(compared(truth, model, c));
    return error_of(truth, model, resampled, theta_i, offsets);
}

std::size_t map_cells(const ErrorMapOptions& options) { return options.inclinations * (options.offsets + 2); }

ErrorMap error_map(const Fibre& fibre, const ModelForm& form, const ErrorMapOptions& options) {
    FibreOptions work;
    work.paths = options.paths, work.seed = options.seed, work.batches = options.batches;
    work.theta_bins = fine_theta, work.phi_bins = options.phi_bins;
    validate(fibre, {}, work);
    ErrorMap map;
    const std::size_t channels = fibre.sigma_ca.size(), shown = channels / 2;
    const double step = pi / double(options.inclinations + 1), width = 1 / double(options.offsets);
    for (std::size_t t = 0; t < options.inclinations; ++t) map.theta_i.push_back(double(t + 1) * step - pi / 2);
    for (std::size_t i = 0; i < options.offsets; ++i) map.offsets.push_back({double(i) * width, double(i + 1) * width});
    const auto model = models(fibre, form, options, map);
    Fibre smooth = fibre;
    smooth.alpha = smooth.beta_m = smooth.beta_n = 0;
    Fibre clear = smooth;  // the same R
    clear.sigma_ms = 0;

    const auto trace = [&](const Fibre& f, double theta_i, const OffsetRange& h, std::uint64_t paths) {
        Light light;
        light.theta_i = theta_i, light.h_low = h.low, light.h_high = h.high;
        work.paths = paths;
        const FibreProfile profile = trace_fibre(f, light, work);
        ++work.cell;
        map.paths += profile.paths();
        const Estimate lost = profile.lost();
        if (lost.value > map.lost.value) map.lost = lost;
        if (options.progress) options.progress();
        return measured(profile, f, work, options.theta_bins);
    };
    // Sums over light from all directions.
    MeasuredLight all_truth;
    FiveLobes all_model;
    std::vector<Resampled> all_far(channels), all_rays(channels);
    std::vector<std::vector<Squares>> cuticle(channels, std::vector<Squares>(options.batches + 1));
    map.causes.resize(channels);
    for (std::size_t t = 0; t < map.theta_i.size(); ++t) {
        // The midpoint rule of cos^2 is exact: the weights add up to 1.
        const double theta_i = map.theta_i[t], weight = 2 / pi * std::pow(std::cos(theta_i), 2) * step;
        MeasuredLight far;
        FiveLobes far_model;
        for (std::size_t i = 0; i < map.offsets.size(); ++i) {
            const MeasuredLight cell = trace(fibre, theta_i, map.offsets[i], options.paths);
            const FiveLobes& lobes = model[t][i];
            std::vector<Resampled> resampled;
            for (std::size_t c = 0; c < channels; ++c) {
                resampled.push_back(compared(cell, lobes, c));
                all_rays[c].add(resampled[c], weight * width);
            }
            map.cells.push_back(error_of(cell, lobes, resampled, theta_i, map.offsets[i]));
            far.add(cell, width), add(far_model, lobes, width);
            const bool central = t == options.inclinations / 2, oblique = t == options.inclinations / 5;
            if ((central && i == options.offsets / 4) || (oblique && i == options.offsets / 2))
                map.pictures.push_back(picture_of(cell, lobes, shown, theta_i, map.offsets[i]));
        }
        far.fold();
        for (auto& channel : far_model.scattered)
            for (DirectionalDensity& d : channel) d = folded(d);
        const MeasuredLight bare = [&] {
            MeasuredLight light = trace(smooth, theta_i, {0, 1}, options.paths * options.offsets);
            light.fold();
            return light;
        }();
        std::vector<Resampled> resampled;
        for (std::size_t c = 0; c < channels; ++c) {
            resampled.push_back(compared(far, far_model, c));
            all_far[c].add(resampled[c], weight);
            for (std::size_t k = 0; k <= options.batches; ++k) {
                const ChannelLight &rough = replicate(far, k).channels[c], &flat = replicate(bare, k).channels[c];
                const double energy = flat.scattered_energy();
                if (!(energy > 0)) continue;
                cuticle[c][k].add(squares(flat.scattered, rough.scattered_energy() / energy, rough.scattered, 1),
                                  weight);
            }
            map.causes[c].R_smooth +=
                weight * five_lobes(clear, {Reflectance::exact}, theta_i, {{0, 1}}, 1, 1)[0].energy[c][0];
        }
        map.far.push_back(error_of(far, far_model, resampled, theta_i, {0, 1}));
        add_directions(map.far.back(), far);
        if (t == options.inclinations / 2 || t == options.inclinations / 5 || t == 0)
            map.pictures.push_back(picture_of(far, far_model, shown, theta_i, {0, 1}));
        all_truth.add(far, weight), add(all_model, far_model, weight);
    }
    map.all = error_of(all_truth, all_model, all_far, 0, {0, 1});
    for (std::size_t c = 0; c < channels; ++c) {
        Causes& causes = map.causes[c];
        for (std::size_t near : {0u, 1u}) {
            const Resampled& r = near ? all_rays[c] : all_far[c];
            for (std::size_t v = 0; v < longitudinal_count; ++v) causes.shape[near][v] = r.get(shape + v);
            causes.over_phi[near] = r.get(over_phi), causes.over_theta[near] = r.get(over_theta);
            causes.product[near] = r.get(product);
            causes.sigma[near] = r.between(authors_cosine, house_cosine);
            causes.sigma_over_theta[near] = r.between(over_theta_authors, over_theta);
        }
        causes.cuticle = distance(options.batches, [&](std::size_t k) { return cuticle[c][k]; });
        // E = W S: the share W that is scattered, and the share S of it that is not absorbed.
        const double E = all_model.energy[c][3] + all_model.energy[c][4], W = all_model.white[3] + all_model.white[4];
        const auto survives = [&](const LightMeans& m) {
            return m.white_scattered() > 0 ? m.channels[c].scattered_energy() / m.white_scattered() : 1;
        };
        causes.entering =
            jackknife(all_truth, [&](const LightMeans& m) { return (W - m.white_scattered()) * survives(m); });
        causes.absorbing = jackknife(all_truth, [&](const LightMeans& m) { return E - W * survives(m); });
        causes.cortex_length = jackknife(all_truth, [&](const LightMeans& m) {
            return m.white_scattered() > 0 ? m.cortex_length / m.white_scattered() : 0;
        });
        causes.medulla_length = jackknife(all_truth, [&](const LightMeans& m) {
            return m.white_scattered() > 0 ? m.medulla_length / m.white_scattered() : 0;
        });
        if (W > 0)
            causes.model_cortex_length = all_model.cortex_length / W,
            causes.model_medulla_length = all_model.medulla_length / W;
    }
    return map;
}

}  // namespace medulla::sim3d
