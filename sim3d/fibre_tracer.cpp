// The fast tracer's lanes, compiled once per instruction set, and the loop over batches.
#include "sim3d/fibre_tracer.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "medulla/config.hpp"
#include "sim2d/random.hpp"
#include "sim3d/fibre_lanes.hpp"
#include "sim3d/fibre_walk.hpp"

#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)  // vectors without a size
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sim3d/fibre_tracer.cpp"
#include "hwy/foreach_target.h"
// After foreach_target.
#include "hwy/highway.h"
#include "sim3d/fibre_lanes-inl.hpp"

#if HWY_ONCE
namespace medulla::sim3d {

HWY_EXPORT(TraceLanes);
HWY_EXPORT(FibreTarget);

namespace {
constexpr std::size_t kBatch = 4096;    // paths followed together; their arrays fit the second cache
constexpr std::uint64_t kFirst = 1024;  // paths of a batch before the error is looked at
}  // namespace

LaneFibre::LaneFibre(const Fibre& fibre, const Light& light, const FibreOptions& options)
    : surface(fibre), seed(options.seed), cell(options.cell) {
    const auto number = [](double x) { return static_cast<float>(x); };
    ring = number((1 - fibre.kappa) * (1 + fibre.kappa));
    sigma_ms = number(fibre.sigma_ms), g = number(fibre.g), layers = number(fibre.layers);
    eta = number(fibre.eta_c), excess = number((fibre.eta_c - 1) * (fibre.eta_c + 1));
    tilt = number(surface.tilt()), along = number(surface.slope_along()), around = number(surface.slope_around());
    stretch = number(1 / fibre.axis_ratio);
    sin_azimuth = number(std::sin(light.azimuth)), cos_azimuth = number(std::cos(light.azimuth));
    travel_x = number(-std::sin(light.theta_i));
    travel_y = number(-std::cos(light.theta_i) * std::cos(light.azimuth));
    travel_z = number(-std::cos(light.theta_i) * std::sin(light.azimuth));
    const double y = -std::cos(light.azimuth) / fibre.axis_ratio, z = -std::sin(light.azimuth), n = std::hypot(y, z);
    entry_y = number(-y / n), entry_z = number(-z / n), across_y = number(-z / n), across_z = number(y / n);
    h_low = number(light.h_low), h_span = number(light.h_high - light.h_low);
    rough = along > 0 || around > 0 || tilt != 0;
    bravais = fibre.reflectance == Reflectance::bravais, planar = fibre.phase == Phase::planar;
    constexpr double per_log2 = 1.4426950408889634;
    for (const double sigma_ca : fibre.sigma_ca) rate.push_back(number(-sigma_ca * per_log2));
    medulla_rate = number(-fibre.sigma_ma * per_log2), faintest = *std::max_element(rate.begin(), rate.end());
    theta_bins = static_cast<std::uint32_t>(options.theta_bins),
    phi_bins = static_cast<std::uint32_t>(options.phi_bins);
    // Another key than RandomStream's, so that the reference implementation of the same seed and cell is independent.
    key[0] = static_cast<std::uint32_t>(seed), key[1] = static_cast<std::uint32_t>(seed >> 32) ^ 0x33D1A7C5u;
    rays.reserve(kBatch);
}

Side settle(const LaneFibre& fibre, LaneMeeting& meeting, std::uint32_t order) {
    sim2d::RandomStream random(fibre.seed ^ 0x9E3779B97F4A7C15ull * (order + 1), fibre.cell,
                               std::uint64_t{fibre.batch} << 32 | meeting.index);
    return fibre.surface.leave(meeting.d, meeting.side, meeting.normal, random, meeting.next);
}

FibreProfile trace_fibre(const Fibre& fibre, const Light& light, const FibreOptions& options) {
    validate(fibre, light, options);
    if (fibre.eta_m && *fibre.eta_m != fibre.eta_c)
        throw std::invalid_argument("eta_m: expected eta_c (the reference implementation has two indices)");
    const std::uint64_t each = (options.paths + options.batches - 1) / options.batches;
    if (options.batches > 256 || each > 0xFFFFFFFFu)
        throw std::invalid_argument("batches: expected 2 to 256 of at most 2^32 paths");
    std::vector<FibreSums> batches(options.batches, FibreSums(fibre, options));
    const LaneFibre lanes(fibre, light, options);
    const auto follow = [&](std::uint64_t done, std::uint64_t count) {
#pragma omp parallel for schedule(dynamic, 1)
        for (std::size_t b = 0; b < options.batches; ++b) {
            LaneFibre mine = lanes;
            mine.sums = &batches[b], mine.batch = static_cast<std::uint32_t>(b);
            mine.stratum = static_cast<float>(1 / static_cast<double>(count));
            for (std::uint64_t i = 0; i < count; i += kBatch) {
                mine.first = done + i;
                mine.first_stratum = static_cast<float>(static_cast<double>(i) / static_cast<double>(count));
                const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(kBatch, count - i));
                HWY_DYNAMIC_DISPATCH(TraceLanes)(mine, n, FibreWalker::most_flights);
            }
            batches[b].paths += count;
        }
    };
    if (!(options.target_error > 0)) {
        follow(0, each);
        return {fibre, options, std::move(batches)};
    }
    // Rounds that double the paths, each with strata of its own.
    for (std::uint64_t done = 0;;) {
        const std::uint64_t next = std::min(each, done == 0 ? kFirst : 2 * done);
        follow(done, next - done);
        done = next;
        FibreProfile profile(fibre, options, batches);
        if (done == each || profile.density(scattered).relative_error() <= options.target_error) return profile;
    }
}

const char* fibre_tracer_target() { return HWY_DYNAMIC_DISPATCH(FibreTarget)(); }

}  // namespace medulla::sim3d
#endif
