#include "sim3d/fibre_profile.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "medulla/config.hpp"
#include "sim2d/elementary.hpp"

namespace medulla::sim3d {

namespace portable = sim2d::portable;

double DirectionalDensity::bin_area() const {
    return pi / static_cast<double>(theta_bins) * (2 * pi / static_cast<double>(phi_bins));
}

double DirectionalDensity::relative_error() const {
    double errors = 0, values = 0;
    for (std::size_t i = 0; i < value.size(); ++i) errors += error[i] * error[i], values += value[i] * value[i];
    return values > 0 ? std::sqrt(errors / values) : 0;
}

FibreSums::FibreSums(const Fibre& fibre, const FibreOptions& options)
    : bins(class_count * fibre.sigma_ca.size() * options.theta_bins * options.phi_bins, 0.0),
      sigma_ca_(fibre.sigma_ca),
      sigma_ma_(fibre.sigma_ma),
      theta_bins_(options.theta_bins),
      phi_bins_(options.phi_bins) {}

void FibreSums::add(Class c, std::size_t bin, double weight, double length_c, double length_m) {
    const auto k = static_cast<std::size_t>(c), size = theta_bins_ * phi_bins_;
    white[k] += weight, cortex[k] += weight * length_c, medulla[k] += weight * length_m;
    double* sum = bins.data() + k * sigma_ca_.size() * size + bin;
    for (const double sigma_ca : sigma_ca_) {
        const double depth = sigma_ca * length_c + sigma_ma_ * length_m;
        *sum += depth > 0 ? weight * portable::exp(-depth) : weight;
        sum += size;
    }
}

std::size_t FibreSums::bin_of(double x, double y, double z) const {
    const auto place = [](double share, std::size_t count) {
        const auto i = static_cast<std::ptrdiff_t>(share * static_cast<double>(count));
        return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, static_cast<std::ptrdiff_t>(count) - 1));
    };
    const double theta = portable::atan2(x, std::sqrt(y * y + z * z)), phi = portable::atan2(z, y);
    return place(theta / pi + 0.5, theta_bins_) * phi_bins_ + place(phi / (2 * pi) + 0.5, phi_bins_);
}

FibreProfile::FibreProfile(const Fibre& fibre, const FibreOptions& options, std::vector<FibreSums> batches)
    : channels_(fibre.sigma_ca.size()),
      theta_bins_(options.theta_bins),
      phi_bins_(options.phi_bins),
      batches_(std::move(batches)) {}

/// Mean over batches of value(batch) / paths, and the standard error of that mean.
template <class Value>
Estimate FibreProfile::estimate(Value&& value) const {
    const double n = static_cast<double>(batches_.size());
    Estimate e;
    double squares = 0;
    for (const FibreSums& b : batches_) e.value += value(b) / static_cast<double>(b.paths) / n;
    for (const FibreSums& b : batches_) {
        const double d = value(b) / static_cast<double>(b.paths) - e.value;
        squares += d * d;
    }
    e.error = std::sqrt(squares / (n * (n - 1)));
    return e;
}

namespace {
double over(const std::array<double, class_count>& sums, Classes classes) {
    double sum = 0;
    for (std::size_t k = 0; k < class_count; ++k) sum += classes >> k & 1u ? sums[k] : 0;
    return sum;
}
}  // namespace

Estimate FibreProfile::energy(Classes classes, std::size_t channel) const {
    const std::size_t size = theta_bins_ * phi_bins_;
    return estimate([&](const FibreSums& b) {
        double sum = 0;
        for (std::size_t k = 0; k < class_count; ++k)
            if (classes >> k & 1u)
                for (std::size_t i = 0; i < size; ++i) sum += b.bins[(k * channels_ + channel) * size + i];
        return sum;
    });
}
Estimate FibreProfile::white_energy(Classes classes) const {
    return estimate([&](const FibreSums& b) { return over(b.white, classes); });
}
Estimate FibreProfile::lost() const {
    return estimate([](const FibreSums& b) { return b.lost; });
}
Estimate FibreProfile::cortex_length(Classes classes) const {
    return estimate([&](const FibreSums& b) { return over(b.cortex, classes); });
}
Estimate FibreProfile::medulla_length(Classes classes) const {
    return estimate([&](const FibreSums& b) { return over(b.medulla, classes); });
}

DirectionalDensity FibreProfile::density(Classes classes, std::size_t channel, bool folded) const {
    DirectionalDensity d;
    d.theta_bins = theta_bins_, d.phi_bins = phi_bins_;
    const std::size_t size = theta_bins_ * phi_bins_;
    const double scale = 1 / d.bin_area();
    for (std::size_t i = 0; i < size; ++i) {
        const std::size_t mirror = i / phi_bins_ * phi_bins_ + (phi_bins_ - 1 - i % phi_bins_);
        const Estimate e = estimate([&](const FibreSums& b) {
            double sum = 0;
            for (std::size_t k = 0; k < class_count; ++k) {
                if (!(classes >> k & 1u)) continue;
                const double* bins = b.bins.data() + (k * channels_ + channel) * size;
                sum += folded ? 0.5 * (bins[i] + bins[mirror]) : bins[i];
            }
            return sum;
        });
        d.value.push_back(scale * e.value), d.error.push_back(scale * e.error);
    }
    return d;
}

std::uint64_t FibreProfile::paths() const {
    std::uint64_t sum = 0;
    for (const FibreSums& b : batches_) sum += b.paths;
    return sum;
}
std::uint64_t FibreProfile::flights() const {
    std::uint64_t sum = 0;
    for (const FibreSums& b : batches_) sum += b.flights;
    return sum;
}

namespace {
double sum_of(const std::vector<double>& x) {
    double sum = 0;
    for (const double v : x) sum += v;
    return sum;
}
}  // namespace

double total_variation(const DirectionalDensity& a, const DirectionalDensity& b) {
    const double all_a = sum_of(a.value), all_b = sum_of(b.value);
    double sum = 0;
    for (std::size_t i = 0; i < a.value.size(); ++i) sum += std::abs(a.value[i] / all_a - b.value[i] / all_b);
    return 0.5 * sum;
}

double total_variation_noise(const DirectionalDensity& a) {
    return 0.5 * std::sqrt(2 / pi) * sum_of(a.error) / sum_of(a.value);
}

}  // namespace medulla::sim3d
