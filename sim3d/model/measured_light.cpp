#include "sim3d/model/measured_light.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "medulla/config.hpp"
#include "sim3d/model/five_lobes.hpp"

namespace medulla::sim3d {

double ChannelLight::scattered_energy() const { return energy[4] + energy[5] + energy[6]; }
double LightMeans::white_scattered() const { return white[4] + white[5] + white[6]; }

void LightMeans::add(const LightMeans& other, double weight) {
    for (std::size_t c = 0; c < channels.size(); ++c) {
        ChannelLight& mine = channels[c];
        const ChannelLight& more = other.channels[c];
        for (std::size_t k = 0; k < class_count; ++k) mine.energy[k] += weight * more.energy[k];
        for (std::size_t i = 0; i < mine.scattered.size(); ++i) mine.scattered[i] += weight * more.scattered[i];
        for (std::size_t p = 0; p < 3; ++p)
            for (std::size_t m = 0; m < 3; ++m) mine.moments[p][m] += weight * more.moments[p][m];
    }
    for (std::size_t k = 0; k < class_count; ++k) white[k] += weight * other.white[k];
    cortex_length += weight * other.cortex_length, medulla_length += weight * other.medulla_length;
}

namespace {
LightMeans nothing(const LightMeans& like) {
    LightMeans zero;
    zero.channels.resize(like.channels.size());
    for (std::size_t c = 0; c < zero.channels.size(); ++c)
        zero.channels[c].scattered.assign(like.channels[c].scattered.size(), 0.0);
    return zero;
}
}  // namespace

void MeasuredLight::add(const MeasuredLight& other, double weight) {
    if (without.empty()) {
        theta_bins = other.theta_bins, phi_bins = other.phi_bins, all = nothing(other.all);
        without.assign(other.without.size(), all);
    }
    all.add(other.all, weight);
    for (std::size_t k = 0; k < without.size(); ++k) without[k].add(other.without[k], weight);
}

void MeasuredLight::fold() {
    const auto fold_all = [&](LightMeans& light) {
        for (ChannelLight& channel : light.channels) sim3d::fold(channel.scattered, phi_bins);
    };
    fold_all(all);
    for (LightMeans& light : without) fold_all(light);
}

namespace {
/// Sums of one batch, per path.
LightMeans means_of(const FibreSums& sums, std::size_t channels, const FibreOptions& options, std::size_t theta_bins) {
    LightMeans means;
    const double per_path = 1 / static_cast<double>(sums.paths);
    const std::size_t size = options.theta_bins * options.phi_bins, merged = options.theta_bins / theta_bins;
    const double per_area = static_cast<double>(theta_bins * options.phi_bins) / (2 * pi * pi);
    for (std::size_t c = 0; c < channels; ++c) {
        ChannelLight light;
        light.scattered.assign(theta_bins * options.phi_bins, 0.0);
        for (std::size_t k = 0; k < class_count; ++k)
            for (std::size_t t = 0; t < options.theta_bins; ++t) {
                const double* row = sums.bins.data() + (k * channels + c) * size + t * options.phi_bins;
                double sum = 0;
                for (std::size_t b = 0; b < options.phi_bins; ++b) sum += row[b];
                light.energy[k] += sum * per_path;
                if (k < 3) {
                    const double theta = ((double(t) + 0.5) / double(options.theta_bins) - 0.5) * pi;
                    light.moments[k][0] += sum * per_path, light.moments[k][1] += sum * theta * per_path;
                    light.moments[k][2] += sum * theta * theta * per_path;
                }
                if (scattered >> k & 1u)
                    for (std::size_t b = 0; b < options.phi_bins; ++b)
                        light.scattered[t / merged * options.phi_bins + b] += row[b] * per_path * per_area;
            }
        means.channels.push_back(std::move(light));
    }
    for (std::size_t k = 0; k < class_count; ++k) {
        means.white[k] = sums.white[k] * per_path;
        if (scattered >> k & 1u)
            means.cortex_length += sums.cortex[k] * per_path, means.medulla_length += sums.medulla[k] * per_path;
    }
    return means;
}
}  // namespace

MeasuredLight measured(const FibreProfile& profile, const Fibre& fibre, const FibreOptions& options,
                       std::size_t theta_bins) {
    const std::size_t channels = fibre.sigma_ca.size();
    std::vector<LightMeans> each;
    for (const FibreSums& sums : profile.batches()) each.push_back(means_of(sums, channels, options, theta_bins));
    MeasuredLight light;
    light.theta_bins = theta_bins, light.phi_bins = options.phi_bins;
    const double n = static_cast<double>(each.size());
    LightMeans sum = nothing(each[0]);
    for (const LightMeans& batch : each) sum.add(batch, 1);
    light.all = nothing(sum);
    light.all.add(sum, 1 / n);
    for (const LightMeans& batch : each) {
        LightMeans rest = nothing(sum);
        rest.add(sum, 1 / (n - 1));
        rest.add(batch, -1 / (n - 1));
        light.without.push_back(std::move(rest));
    }
    return light;
}

Estimate jackknife(std::size_t batches, const std::function<double(std::size_t)>& f) {
    const double n = static_cast<double>(batches), whole = f(batches);
    std::vector<double> rest;
    double mean = 0, squares = 0;
    for (std::size_t k = 0; k < batches; ++k) rest.push_back(f(k)), mean += rest.back() / n;
    for (const double x : rest) squares += (x - mean) * (x - mean);
    return {n * whole - (n - 1) * mean, std::sqrt((n - 1) / n * squares)};
}

Estimate jackknife(const MeasuredLight& light, const std::function<double(const LightMeans&)>& f) {
    const std::size_t n = light.without.size();
    return jackknife(n, [&](std::size_t k) { return f(k < n ? light.without[k] : light.all); });
}

double Distance::value() const { return std::sqrt(std::max(0.0, square.value)); }
double Distance::error() const { return std::sqrt(std::max(0.0, square.value) + square.error) - value(); }
bool Distance::resolved() const { return square.value > 2 * square.error; }
double Distance::bound() const { return std::sqrt(std::max(0.0, square.value) + 2 * square.error); }

void Squares::add(const Squares& other, double weight) {
    difference += weight * other.difference, norm += weight * other.norm;
}

Squares squares(const std::vector<double>& a, double scale_a, const std::vector<double>& b, double scale_b) {
    Squares s;
    for (std::size_t i = 0; i < b.size(); ++i) {
        const double y = b[i] * scale_b, d = a[i] * scale_a - y;
        s.difference += d * d, s.norm += y * y;
    }
    return s;
}

Distance distance(std::size_t batches, const std::function<Squares(std::size_t)>& f) {
    std::vector<Squares> each;
    for (std::size_t k = 0; k <= batches; ++k) each.push_back(f(k));
    const Estimate norm = jackknife(batches, [&](std::size_t k) { return each[k].norm; });
    Distance d;
    if (!(norm.value > 2 * norm.error)) return d;
    const Estimate difference = jackknife(batches, [&](std::size_t k) { return each[k].difference; });
    const Estimate ratio =
        jackknife(batches, [&](std::size_t k) { return each[k].norm > 0 ? each[k].difference / each[k].norm : 0.0; });
    d.defined = true;
    d.square = {difference.value / norm.value, ratio.error};
    return d;
}

}  // namespace medulla::sim3d
