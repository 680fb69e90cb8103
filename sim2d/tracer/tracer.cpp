#include "sim2d/tracer/tracer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "medulla/config.hpp"
#include "sim2d/disc/single.hpp"
#include "sim2d/slab/single.hpp"
#include "sim2d/tracer/kernel.hpp"
#include "sim2d/tracer/single.hpp"

namespace medulla::sim2d {
namespace {

/// Independent randomisations of the lattice; the standard error is estimated from their spread.
constexpr std::uint32_t kRandomisations = 16;

/// Paths of each before the error is first evaluated.
constexpr std::uint64_t kFirst = 32;

/// Thinner media are traced at this sigma: their multiply scattered share is below the rounding of the single one.
constexpr double kThin = 1e-30;

/// Relative L2 error of a lobe from float arithmetic and from the quadrature over bins.
constexpr double kRounding = 3e-6;

void require(bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
}

void check(double sigma, double g, std::size_t bins, const TracerOptions& options) {
    require(std::isfinite(sigma) && sigma >= 0, "sigma: expected a finite value >= 0");
    require(g > -1 && g < 1, "g: expected a value in (-1, 1)");
    require(bins > 0 && bins <= 1u << 20, "bins: expected 1 to 2^20");
    require(options.paths > 0 && options.paths <= std::uint64_t{1} << 35, "paths: expected 1 to 2^35");
    require(options.target_error >= 0, "target_error: expected a value >= 0");
}

/// Range of bins of one lobe.
struct Side {
    std::size_t first, last;
};

/// Singly scattered light, relative to all the energy scattered without absorption: density per bin, and its integral
/// times the path length.
struct Single {
    std::vector<double> density;
    double length = 0;
};

/// Estimates of a cell from the deposits of the randomisations; shares are of the energy scattered at least once.
class Estimate {
  public:
    /// @param sides lobes, each to be normalised   @param absorbed single scattering of the disc in absorbing media
    Estimate(std::vector<double> single, std::vector<Side> sides, bool mirror, std::vector<Single> absorbed = {})
        : single_(std::move(single)), sides_(std::move(sides)), mirror_(mirror), absorbed_(std::move(absorbed)) {
        width_ = 2 * pi / static_cast<double>(single_.size());
        for (const double s : single_) single_share_ += s * width_;
    }

    struct Lobe {
        std::vector<double> density;
        double share = 0, share_error = 0, standard_error = 0;
        double length = 0;  ///< of an absorbed lobe: mean path
    };

    /// The sides' lobes, then those with absorption.
    /// @param sums one per randomisation, each of the same number of paths
    std::vector<Lobe> lobes(const std::vector<TracerSums>& sums) const {
        const std::size_t count = sums.size();
        const Deposited multiple = deposited_by(sums, [](const TracerSums& s) { return s.bins; });
        const Scale scale = scale_of(multiple.all);
        std::vector<Lobe> out;
        for (const Side side : sides_) out.push_back(lobe_of(side, single_, multiple, multiple, scale));
        if (sides_.size() == 1) out[0].share_error = 0;
        // Rounding must not give a side more than all of the energy.
        double shares = 0;
        for (const Lobe& lobe : out) shares += lobe.share;
        for (Lobe& lobe : out) lobe.share /= shares;
        for (std::size_t j = 0; j < absorbed_.size(); ++j) {
            const auto bins = static_cast<std::ptrdiff_t>(single_.size()),
                       first = static_cast<std::ptrdiff_t>(j) * bins;
            const Deposited left = deposited_by(sums, [&](const TracerSums& s) {
                return std::vector<double>(s.absorbed.begin() + first, s.absorbed.begin() + first + bins);
            });
            out.push_back(lobe_of(sides_[0], absorbed_[j].density, left, multiple, scale));
            double length = 0;
            for (const TracerSums& s : sums)
                length += s.absorbed_length[j] / static_cast<double>(s.paths) / static_cast<double>(count);
            out.back().length = (scale.single * absorbed_[j].length + scale.multiple * length) / out.back().share;
        }
        return out;
    }

  private:
    static constexpr double kKnown = 1e-3;

    /// Deposits: per randomisation and bin, their mean; their integrals per randomisation, and the mean of those.
    struct Deposited {
        std::vector<std::vector<double>> part;
        std::vector<double> mean, total;
        double all = 0;
    };
    /// Factors of multiply and of singly scattered light.
    struct Scale {
        double multiple, single;
    };
    /// The multiply scattered share is known: 1 - single. Where that difference has no digits left, the sum is scaled.
    Scale scale_of(double all) const {
        const double known = 1 - single_share_;
        if (known > kKnown && all > 0) return {known / all, 1};
        return {1 / (single_share_ + all), 1 / (single_share_ + all)};
    }

    template <class Bins>
    Deposited deposited_by(const std::vector<TracerSums>& sums, Bins&& bins_of) const {
        const std::size_t bins = single_.size(), count = sums.size();
        Deposited out{std::vector<std::vector<double>>(count), std::vector<double>(bins, 0.0),
                      std::vector<double>(count, 0.0)};
        for (std::size_t r = 0; r < count; ++r) {
            out.part[r] = bins_of(sums[r]);
            if (mirror_) symmetrise(out.part[r]);
            for (std::size_t b = 0; b < bins; ++b) {
                out.part[r][b] /= static_cast<double>(sums[r].paths);
                out.mean[b] += out.part[r][b] / static_cast<double>(count);
                out.total[r] += out.part[r][b] * width_;
            }
            out.all += out.total[r] / static_cast<double>(count);
        }
        return out;
    }

    /// @param base deposits of the same paths without absorption, from which `scale` was computed
    Lobe lobe_of(const Side side, const std::vector<double>& single, const Deposited& multiple, const Deposited& base,
                 const Scale& scale) const {
        const std::size_t count = multiple.part.size();
        Lobe lobe;
        for (std::size_t b = side.first; b < side.last; ++b) {
            lobe.density.push_back(scale.single * single[b] + scale.multiple * multiple.mean[b]);
            lobe.share += lobe.density.back() * width_;
        }
        double squares = 0;
        for (double& d : lobe.density) d /= lobe.share, squares += d * d;
        // The jackknife: the same ratios without each randomisation in turn. First-order error propagation would
        // understate the error of few paths, whose deposits are skewed; on average the jackknife does not
        // (Efron & Stein 1981).
        const double n = static_cast<double>(count);
        const auto without = [n](double mean, double part) { return mean + (mean - part) / (n - 1); };
        double variance = 0, share_variance = 0;
        std::vector<double> other(lobe.density.size());
        for (std::size_t r = 0; r < count; ++r) {
            const Scale scale_r = scale_of(without(base.all, base.total[r]));
            double share = 0;
            for (std::size_t i = 0; i < other.size(); ++i) {
                const std::size_t b = side.first + i;
                other[i] =
                    scale_r.single * single[b] + scale_r.multiple * without(multiple.mean[b], multiple.part[r][b]);
                share += other[i] * width_;
            }
            share_variance += (share - lobe.share) * (share - lobe.share);
            for (std::size_t i = 0; i < other.size(); ++i) {
                // A lobe with deposits of one randomisation only is empty without it: its error is all of it.
                const double e = (share > 0 ? other[i] / share : 0) - lobe.density[i];
                variance += e * e;
            }
        }
        lobe.share_error = std::sqrt(share_variance * (n - 1) / n);
        lobe.standard_error = std::sqrt(variance * (n - 1) / n / squares + kRounding * kRounding);
        return lobe;
    }

    void symmetrise(std::vector<double>& bins) const {
        for (const Side side : sides_)
            for (std::size_t a = side.first, b = side.last - 1; a < b; ++a, --b)
                bins[a] = bins[b] = 0.5 * (bins[a] + bins[b]);
    }

    std::vector<double> single_;
    std::vector<Side> sides_;
    bool mirror_;
    std::vector<Single> absorbed_;
    double width_, single_share_ = 0;
};

struct Run {
    std::vector<Estimate::Lobe> lobes;
    std::vector<TracerSums> sums;
    std::uint64_t paths = 0, scatterings = 0;
    bool reached = false;
};

Run run(const TracerCell& cell, const Estimate& estimate, const TracerOptions& options) {
    Run out;
    out.sums.resize(kRandomisations);
    PathTracer tracer(cell);
    const std::uint64_t most = (options.paths + kRandomisations - 1) / kRandomisations;
    const double target = std::max(options.target_error, 0.0);
    for (std::uint64_t done = 0; done < most && !out.reached;) {
        const std::uint64_t next = target > 0 ? std::min(most, done == 0 ? kFirst : 2 * done) : most;
        for (std::uint32_t r = 0; r < kRandomisations; ++r) tracer.trace(r, done, next - done, out.sums[r]);
        done = next;
        out.lobes = estimate.lobes(out.sums);
        out.reached = true;
        for (const Estimate::Lobe& lobe : out.lobes) out.reached = out.reached && lobe.standard_error <= target;
    }
    for (const TracerSums& s : out.sums) out.paths += s.paths, out.scatterings += s.scatterings;
    return out;
}

double mean_of(const std::vector<TracerSums>& sums, int which) {
    double length = 0, paths = 0;
    for (const TracerSums& s : sums) length += s.length[which], paths += static_cast<double>(s.paths);
    return length / paths;
}

/// (1 - exp(-x)) / x.
double mean_transmission(double x) { return x > 0 ? -std::expm1(-x) / x : 1; }

/// Single scattering with absorption a: first collisions fall as exp(-(sigma + a) t) and leave as exp(-(sigma + a) d).
/// That is the closed form at extinction sigma + a, rescaled from its own first collisions' energy to that without
/// absorption.
Single absorbed_single(double sigma, double a, double g, double h, std::size_t bins) {
    const double extinction = sigma + a, chord = 2 * std::sqrt((1 - h) * (1 + h));
    const double ratio = mean_transmission(extinction * chord) / mean_transmission(sigma * chord);
    Single single{disc_single_lobe(extinction, g, h, bins), ratio * disc_single_length(extinction, g, h)};
    for (double& d : single.density) d *= ratio;
    return single;
}

}  // namespace

Traced<Profile> trace_expected_disc(double sigma, double g, double h, std::size_t bins, const TracerOptions& options) {
    Traced<std::vector<Profile>> all = trace_expected_disc(sigma, g, h, {0.0}, bins, options);
    return {std::move(all.profile[0]), all.paths, all.scatterings, all.reached};
}

Traced<std::vector<Profile>> trace_expected_disc(double sigma, double g, double h,
                                                 const std::vector<double>& absorption, std::size_t bins,
                                                 const TracerOptions& options) {
    check(sigma, g, bins, options);
    require(h >= -1 && h <= 1, "h: expected a value in [-1, 1]");
    for (const double a : absorption) require(std::isfinite(a) && a >= 0, "absorption: expected finite values >= 0");
    TracerCell cell;
    cell.medium = Medium::disc;
    cell.sigma = std::max(sigma, kThin), cell.g = g, cell.h = h;
    cell.bins = static_cast<std::uint32_t>(bins), cell.seed = options.seed, cell.cell = options.cell;
    cell.plan = plan_of(cell);
    std::vector<Single> singles;
    for (const double a : absorption)
        if (a > 0) {
            cell.absorption.push_back(a);
            singles.push_back(absorbed_single(cell.sigma, a, g, h, bins));
        }
    const Estimate estimate(disc_single_lobe(cell.sigma, g, h, bins), {{0, bins}}, h == 0, std::move(singles));
    Run result = run(cell, estimate, options);
    Traced<std::vector<Profile>> out;
    out.paths = result.paths, out.scatterings = result.scatterings, out.reached = result.reached;
    const double energy = disc_energy(sigma, h);
    std::size_t next = 1;
    for (const double a : absorption) {
        const Estimate::Lobe& lobe = result.lobes[a > 0 ? next++ : 0];
        Profile& p = out.profile.emplace_back();
        p.lobe = lobe.density;
        p.standard_error = lobe.standard_error;
        p.energy = a > 0 ? lobe.share * energy : energy;
        p.energy_error = lobe.share_error * energy;
        p.mean_length = a > 0 ? lobe.length : mean_of(result.sums, 0);
    }
    return out;
}

Traced<SlabProfile> trace_expected_slab(double sigma, double g, double theta_i, std::size_t bins_per_side,
                                        const TracerOptions& options) {
    check(sigma, g, bins_per_side, options);
    require(theta_i >= -pi / 2 && theta_i <= pi / 2, "theta_i: expected a value in [-pi/2, pi/2]");
    TracerCell cell;
    cell.medium = Medium::slab;
    cell.sigma = std::max(sigma, kThin), cell.g = g, cell.theta_i = theta_i;
    cell.bins = static_cast<std::uint32_t>(2 * bins_per_side), cell.seed = options.seed, cell.cell = options.cell;
    cell.plan = plan_of(cell);
    const std::size_t n = bins_per_side;
    const SlabSingle single = slab_single_lobes(cell.sigma, g, theta_i, n);
    std::vector<double> circle = single.forward;
    circle.insert(circle.end(), single.back.rbegin(), single.back.rend());
    const Estimate estimate(std::move(circle), {{n, 2 * n}, {0, n}}, theta_i == 0);
    Run result = run(cell, estimate, options);
    Traced<SlabProfile> out;
    out.paths = result.paths, out.scatterings = result.scatterings, out.reached = result.reached;
    const double energy = slab_energy(sigma, theta_i), single_length[2] = {single.back_length, single.forward_length};
    for (const int side : {0, 1}) {
        Profile& p = side == 0 ? out.profile.back : out.profile.forward;
        Estimate::Lobe& lobe = result.lobes[static_cast<std::size_t>(side)];
        p.lobe = std::move(lobe.density);
        if (side == 0) std::reverse(p.lobe.begin(), p.lobe.end());
        p.standard_error = lobe.standard_error;
        p.energy = lobe.share * energy, p.energy_error = lobe.share_error * energy;
        p.mean_length = sigma > 0 ? (single_length[side] + mean_of(result.sums, side)) / lobe.share
                                  : std::numeric_limits<double>::infinity();
    }
    out.profile.raw_total = out.profile.back.energy + out.profile.forward.energy;
    return out;
}

}  // namespace medulla::sim2d
