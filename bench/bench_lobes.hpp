// Shared by the benchmarks of the simulator: one call per solver for a cell or slice of either table.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sim2d/disc/deterministic.hpp"
#include "sim2d/reference/analog.hpp"
#include "sim2d/slab/deterministic.hpp"
#include "sim2d/tracer/tracer.hpp"

namespace medulla::bench {

constexpr std::size_t kBins = 720;

struct TableCell {
    bool disc;
    double sigma, g, along;  ///< h or theta_i
};

inline std::string title(const TableCell& c) {
    char text[96];
    std::snprintf(text, sizeof text, "%s, sigma %g, g %g, %s %g", c.disc ? "disc" : "slab", c.sigma, c.g,
                  c.disc ? "h" : "theta_i", c.along);
    return text;
}

/// The lobes of a cell: one of the disc, back and forward of the slab.
using Profiles = std::vector<sim2d::Profile>;
using Slice = std::vector<Profiles>;
using Lobes = std::vector<std::vector<double>>;

inline Lobes lobes(const Profiles& profiles) {
    Lobes out;
    for (const sim2d::Profile& p : profiles) out.push_back(p.lobe);
    return out;
}

inline double relative_l2(const std::vector<double>& a, const std::vector<double>& b) {
    double d = 0, n = 0;
    for (std::size_t i = 0; i < a.size(); ++i) d += (a[i] - b[i]) * (a[i] - b[i]), n += b[i] * b[i];
    return std::sqrt(d / n);
}

/// Relative L2 distance, of the worse lobe.
inline double distance(const Lobes& a, const Lobes& b) {
    double worst = 0;
    for (std::size_t k = 0; k < a.size(); ++k) worst = std::max(worst, relative_l2(a[k], b[k]));
    return worst;
}

/// Resolution of a deterministic solution: the disc's target error, and the slab's directions relative to its default.
struct Resolution {
    double disc_target, slab_scale;
};
constexpr Resolution kResolutions[] = {{3e-2, 0.3}, {1e-2, 0.4}, {3e-3, 0.6}, {1e-3, 0.8}, {3e-4, 1.0}};
constexpr Resolution kFinest = {5e-5, 1.5};

inline sim2d::SlabOptions slab_options(double g, double scale, bool estimate) {
    sim2d::SlabOptions o;
    const double wanted = g == 0 ? 64 : std::max(64.0, std::ceil(-9.5 / std::log(std::abs(g))));
    o.directions = static_cast<std::size_t>(std::max(8.0, scale * wanted));
    o.estimate_error = estimate;
    return o;
}

/// The deterministic solver of one g; threads may share it. The slab chooses its own resolution, independent of the
/// target.
class SliceSolver {
  public:
    SliceSolver(bool disc, double g, double target, bool estimate) {
        if (disc) {
            sim2d::DiscOptions o;
            o.target_error = target, o.estimate_error = estimate;
            disc_.emplace(g, o);
        } else {
            sim2d::SlabOptions o;
            o.estimate_error = estimate;
            slab_.emplace(g, o);
        }
    }
    Slice solve(double sigma, const std::vector<double>& along) const {
        Slice out;
        if (disc_)
            for (auto& p : disc_->solve(sigma, along, kBins)) out.push_back({std::move(p)});
        else
            for (auto& p : slab_->solve(sigma, along, kBins / 2))
                out.push_back({std::move(p.back), std::move(p.forward)});
        return out;
    }

  private:
    std::optional<sim2d::DiscSolver> disc_;
    std::optional<sim2d::SlabSolver> slab_;
};

inline Lobes solve_deterministic(const TableCell& c, const Resolution& r) {
    if (c.disc) return lobes(SliceSolver(true, c.g, r.disc_target, false).solve(c.sigma, {c.along})[0]);
    const sim2d::SlabSolver solver(c.g, slab_options(c.g, r.slab_scale, false));
    const sim2d::SlabProfile p = solver.solve(c.sigma, {c.along}, kBins / 2)[0];
    return {p.back.lobe, p.forward.lobe};
}

struct Found {
    Lobes lobes;
    double error;  ///< stated, of the worse lobe
};

inline Found found(const Profiles& profiles) {
    double error = 0;
    for (const sim2d::Profile& p : profiles) error = std::max(error, p.standard_error);
    return {lobes(profiles), error};
}

inline Found trace_analog(const TableCell& c, std::uint64_t paths) {
    sim2d::TraceOptions o;
    o.paths = paths;
    if (c.disc) return found({sim2d::trace_disc(c.sigma, c.g, c.along, kBins, o)});
    const sim2d::SlabProfile p = sim2d::trace_slab(c.sigma, c.g, c.along, kBins / 2, o);
    return found({p.back, p.forward});
}

inline Profiles random_profiles(const TableCell& c, const sim2d::TracerOptions& o) {
    if (c.disc) return {sim2d::trace_expected_disc(c.sigma, c.g, c.along, kBins, o).profile};
    const sim2d::SlabProfile p = sim2d::trace_expected_slab(c.sigma, c.g, c.along, kBins / 2, o).profile;
    return {p.back, p.forward};
}

inline Profiles random_profiles(const TableCell& c, std::uint64_t paths, std::uint64_t seed, std::uint64_t cell) {
    sim2d::TracerOptions o;
    o.paths = paths, o.seed = seed, o.cell = cell;
    return random_profiles(c, o);
}

inline Found trace_random(const TableCell& c, std::uint64_t paths, double target) {
    sim2d::TracerOptions o;
    o.paths = paths, o.target_error = target;
    return found(random_profiles(c, o));
}

}  // namespace medulla::bench
