// The tracer's SIMD kernel, compiled once per instruction set; the best one of the machine is chosen at run time.
// Positions and directions are floats, which adds less than 1e-5 to a lobe's error; sums of a batch are added to
// doubles.
#include "sim2d/tracer/kernel.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "sim2d/random.hpp"
#include "sim2d/tracer/state.hpp"

// Vectors are members of structs, which those of unknown size cannot be.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sim2d/tracer/kernel.cpp"
#include "hwy/foreach_target.h"
// After foreach_target.
#include "hwy/highway.h"
#include "sim2d/tracer/lanes-inl.hpp"

#if HWY_ONCE
namespace medulla::sim2d {

HWY_EXPORT(TraceBatch);
HWY_EXPORT(Words);
HWY_EXPORT(Target);

namespace {

std::uint32_t reverse_bits(std::uint32_t v) {
    v = (v >> 1 & 0x55555555u) | (v & 0x55555555u) << 1;
    v = (v >> 2 & 0x33333333u) | (v & 0x33333333u) << 2;
    v = (v >> 4 & 0x0F0F0F0Fu) | (v & 0x0F0F0F0Fu) << 4;
    v = (v >> 8 & 0x00FF00FFu) | (v & 0x00FF00FFu) << 8;
    return v >> 16 | v << 16;
}

/// Directions of the lower ends of bins first, first + step, ... of the circle.
void directions(const TracerCell& cell, std::size_t step, std::size_t count, std::vector<float>& x,
                std::vector<float>& y) {
    x.assign(count + kLaneMargin, 0.0f), y.assign(count + kLaneMargin, 0.0f);
    const double start = cell.medium == Medium::disc ? -pi : -pi / 2;
    for (std::size_t i = 0; i < count; ++i) {
        const double a = start + 2 * pi * static_cast<double>(i * step % cell.bins) / cell.bins;
        x[i] = static_cast<float>(std::cos(a)), y[i] = static_cast<float>(std::sin(a));
    }
}

/// Scattering orders fit into 24 bits; the lattice's shifts use the last block, which no path reaches in practice.
constexpr std::uint32_t kShiftBlock = 0xFFFFFFu;

/// Compiled, and supported by this processor; queried once, since selecting one hides the others.
const std::vector<std::int64_t>& targets() {
    static const std::vector<std::int64_t> all = hwy::SupportedAndGeneratedTargets();
    return all;
}

}  // namespace

TracerCounter tracer_counter(const TracerCell& cell, std::uint32_t order, std::uint32_t randomisation,
                             std::uint32_t path) noexcept {
    // RandomStream's layout with path = (randomisation, path). The key differs, so that the analog tracer is
    // independent under the same seed and cell.
    return {{(order & 0xFFFFFFu) | randomisation << 24, path, static_cast<std::uint32_t>(cell.cell),
             static_cast<std::uint32_t>(cell.cell >> 32)},
            {static_cast<std::uint32_t>(cell.seed), static_cast<std::uint32_t>(cell.seed >> 32) ^ 0x7AC3E125u}};
}

PathTracer::PathTracer(const TracerCell& cell) : state_(new State) {
    State& s = *state_;
    s.cell = cell;
    const double a = std::abs(cell.g);
    s.sigma = static_cast<float>(cell.sigma);
    s.g = static_cast<float>(a);
    s.flip = cell.g < 0 ? -1.0f : 1.0f;
    s.p_scale = static_cast<float>((1 - a) * (1 + a) / (2 * pi));
    s.p_floor = static_cast<float>((1 - a) * (1 - a));
    const double half = std::sqrt(std::max(0.0, (1 - cell.h) * (1 + cell.h)));
    s.h = static_cast<float>(cell.h), s.half = static_cast<float>(half);
    const bool disc = cell.medium == Medium::disc;
    const double mu = disc ? 1 : (std::abs(cell.theta_i) < pi / 2 ? std::cos(cell.theta_i) : 0.0);
    s.mu = static_cast<float>(mu);
    s.dir_x = s.mu, s.dir_y = disc ? 0.0f : static_cast<float>(-std::sin(cell.theta_i));
    const double chord = disc ? 2 * half : (mu > 0 ? 2 / mu : HUGE_VAL);
    s.chord = static_cast<float>(std::min(chord, 1e30));
    s.first_share = static_cast<float>(-std::expm1(-cell.sigma * chord));
    const TracerCounter c = tracer_counter(cell, 0, 0, 0);
    s.key[0] = c.key[0], s.key[1] = c.key[1];
    s.comb_count = cell.bins / cell.plan.comb;
    s.comb_stride = s.comb_count + static_cast<std::uint32_t>(kLaneMargin);
    directions(cell, cell.plan.comb, s.comb_count, s.comb_x, s.comb_y);
    s.comb_sum.assign(std::size_t{cell.plan.comb} * s.comb_stride, 0.0f);
    if (cell.plan.window > 0) {
        directions(cell, 1, cell.bins + cell.plan.window, s.window_x, s.window_y);
        s.window_sum.assign(s.window_x.size(), 0.0f);
    }
    for (const double absorption : cell.absorption)
        s.absorbed_rate.push_back(static_cast<float>(-absorption * 1.4426950408889634));  // exp(x) = 2^(x / log 2)
    s.absorbed_comb.assign(cell.absorption.size() * s.comb_sum.size(), 0.0f);
    s.absorbed_window.assign(cell.absorption.size() * s.window_sum.size(), 0.0f);
    s.absorbed_length.assign(cell.absorption.size() * kLaneMargin, 0.0f);
    s.paths.reserve(kBatch + kLaneMargin);
    s.deposits.reserve(kBatch + kLaneMargin);
    s.shift.assign(kLatticeDims, 0);
}

PathTracer::~PathTracer() = default;

void PathTracer::trace(std::uint32_t randomisation, std::uint64_t first, std::uint64_t count, TracerSums& sums) {
    State& s = *state_;
    const TracerCell& cell = s.cell;
    sums.bins.resize(cell.bins, 0.0);
    sums.absorbed.resize(cell.absorption.size() * cell.bins, 0.0);
    sums.absorbed_length.resize(cell.absorption.size(), 0.0);
    const double width = 2 * pi / cell.bins;
    // Floats accumulate one batch only.
    const auto flush = [&](float* comb_sum, float* window_sum, double* bins) {
        const std::uint32_t comb = cell.plan.comb;
        for (std::uint32_t b = 0; b < cell.bins; ++b)
            bins[b] += static_cast<double>(comb_sum[std::size_t{b % comb} * s.comb_stride + b / comb]);
        std::fill_n(comb_sum, s.comb_sum.size(), 0.0f);
        for (std::size_t b = 0; b < s.window_sum.size(); ++b) {
            if (b < cell.bins + cell.plan.window) bins[b % cell.bins] += static_cast<double>(window_sum[b]);
            window_sum[b] = 0;
        }
    };
    for (std::uint32_t d = 0; d < kLatticeDims; ++d) {
        const TracerCounter c = tracer_counter(cell, kShiftBlock, randomisation, d);
        s.shift[d] = philox(c.counter, c.key[0], c.key[1])[0];
    }
    while (count > 0) {
        const std::size_t n = static_cast<std::size_t>(std::min<std::uint64_t>(count, kBatch));
        for (std::size_t i = 0; i < n; ++i) {
            s.paths.index[i] = static_cast<std::uint32_t>(first + i);
            s.paths.reversed[i] = reverse_bits(s.paths.index[i]);
        }
        HWY_DYNAMIC_DISPATCH(TraceBatch)(s, randomisation, n, sums);
        first += n, count -= n, sums.paths += n;
        flush(s.comb_sum.data(), s.window_sum.data(), sums.bins.data());
        for (std::size_t j = 0; j < cell.absorption.size(); ++j) {
            flush(s.absorbed_comb.data() + j * s.comb_sum.size(), s.absorbed_window.data() + j * s.window_sum.size(),
                  sums.absorbed.data() + j * cell.bins);
            for (std::size_t lane = j * kLaneMargin; lane < (j + 1) * kLaneMargin; ++lane)
                sums.absorbed_length[j] += width * static_cast<double>(std::exchange(s.absorbed_length[lane], 0.0f));
        }
    }
}

std::vector<std::array<std::uint32_t, 4>> tracer_words(const TracerCell& cell, std::uint32_t order,
                                                       std::uint32_t randomisation, std::uint32_t first,
                                                       std::size_t count) {
    std::vector<std::uint32_t> index(count + kLaneMargin), words(4 * (count + kLaneMargin));
    for (std::size_t i = 0; i < index.size(); ++i) index[i] = first + static_cast<std::uint32_t>(i);
    const TracerCounter c = tracer_counter(cell, order, randomisation, 0);
    HWY_DYNAMIC_DISPATCH(Words)(c, index.data(), count, words.data());
    std::vector<std::array<std::uint32_t, 4>> out(count);
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t k = 0; k < 4; ++k) out[i][k] = words[k * (count + kLaneMargin) + i];
    return out;
}

const char* tracer_target() { return HWY_DYNAMIC_DISPATCH(Target)(); }

std::vector<std::string> tracer_targets() {
    std::vector<std::string> names;
    for (const std::int64_t target : targets()) names.push_back(hwy::TargetName(target));
    return names;
}

void set_tracer_target(const std::string& name) {
    std::int64_t chosen = 0;  // Highway: whatever the processor supports
    for (const std::int64_t target : targets())
        if (hwy::TargetName(target) == name) chosen = target;
    if (chosen == 0 && !name.empty()) throw std::invalid_argument("instruction set: not one of this processor's");
    hwy::SetSupportedTargetsForTest(chosen);
    hwy::GetChosenTarget().DeInit();  // chosen anew at the next call
}

}  // namespace medulla::sim2d
#endif
