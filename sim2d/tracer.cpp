#include "sim2d/tracer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "sim2d/disc_single.hpp"
#include "sim2d/slab_single.hpp"
#include "sim2d/tracer_kernel.hpp"
#include "sim2d/tracer_single.hpp"

namespace medulla::sim2d {
namespace {

const double pi = 3.14159265358979323846;

/// Independent randomisations of the lattice: what the standard error is measured from.
constexpr std::uint32_t kRandomisations = 16;

/// Walks of each before the error is first looked at.
constexpr std::uint64_t kFirst = 32;

/// Thinner media are traced as this one: their multiply scattered share is below a double's rounding of the single.
constexpr double kThin = 1e-30;

/// What floats and the bins' quadrature cost, relative to a lobe.
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

/// A range of bins that is one lobe.
struct Side {
    std::size_t first, last;
};

/// Estimates of a cell from what the randomisations paid; shares are of the energy that was scattered at least once.
class Estimate {
  public:
    /// @param single density of singly scattered light per bin   @param sides lobes to be normalised each
    Estimate(std::vector<double> single, std::vector<Side> sides, bool mirror)
        : single_(std::move(single)), sides_(std::move(sides)), mirror_(mirror) {
        width_ = 2 * pi / static_cast<double>(single_.size());
        for (const double s : single_) single_share_ += s * width_;
    }

    struct Lobe {
        std::vector<double> density;
        double share = 0, share_error = 0, standard_error = 0;
    };

    /// @param sums one per randomisation, the same number of walks each
    std::vector<Lobe> lobes(const std::vector<TracerSums>& sums) const {
        const std::size_t bins = single_.size(), count = sums.size();
        std::vector<std::vector<double>> part(count);
        std::vector<double> mean(bins, 0.0), total(count, 0.0);
        double all = 0;
        for (std::size_t r = 0; r < count; ++r) {
            part[r] = sums[r].bins;
            if (mirror_) symmetrise(part[r]);
            for (std::size_t b = 0; b < bins; ++b) {
                part[r][b] /= static_cast<double>(sums[r].walks);
                mean[b] += part[r][b] / static_cast<double>(count);
                total[r] += part[r][b] * width_;
            }
            all += total[r] / static_cast<double>(count);
        }
        // The multiply scattered share is known: 1 - single. Where that difference holds no digits, the sum is scaled.
        const double known = 1 - single_share_;
        const bool exact = known > kKnown && all > 0;
        const double scale = exact ? known / all : 1 / (single_share_ + all);
        const double own = exact ? 1 : scale;  // of the singly scattered light
        std::vector<Lobe> out(sides_.size());
        for (std::size_t s = 0; s < sides_.size(); ++s) {
            const Side side = sides_[s];
            Lobe& lobe = out[s];
            for (std::size_t b = side.first; b < side.last; ++b) {
                lobe.density.push_back(own * single_[b] + scale * mean[b]);
                lobe.share += lobe.density.back() * width_;
            }
            double squares = 0, variance = 0, share_variance = 0;
            for (double& d : lobe.density) d /= lobe.share, squares += d * d;
            // First-order deviations of the quotients above, per randomisation.
            std::vector<double> deviation(lobe.density.size());
            for (std::size_t r = 0; r < count; ++r) {
                double drift = 0;
                for (std::size_t i = 0; i < deviation.size(); ++i) {
                    const std::size_t b = side.first + i;
                    const double shape = exact ? mean[b] / all : lobe.density[i] * lobe.share;
                    deviation[i] = scale * (part[r][b] - mean[b] - shape * (total[r] - all));
                    drift += deviation[i] * width_;
                }
                share_variance += drift * drift;
                for (std::size_t i = 0; i < deviation.size(); ++i) {
                    const double e = (deviation[i] - lobe.density[i] * drift) / lobe.share;
                    variance += e * e;
                }
            }
            const double n = static_cast<double>(count), pairs = n * (n - 1);
            lobe.share_error = sides_.size() > 1 ? std::sqrt(share_variance / pairs) : 0.0;
            lobe.standard_error = std::sqrt(variance / pairs / squares + kRounding * kRounding);
        }
        // Rounding must not leave a side with more than all of the energy.
        double shares = 0;
        for (const Lobe& lobe : out) shares += lobe.share;
        for (Lobe& lobe : out) lobe.share /= shares;
        return out;
    }

  private:
    static constexpr double kKnown = 1e-3;

    void symmetrise(std::vector<double>& bins) const {
        for (const Side side : sides_)
            for (std::size_t a = side.first, b = side.last - 1; a < b; ++a, --b)
                bins[a] = bins[b] = 0.5 * (bins[a] + bins[b]);
    }

    std::vector<double> single_;
    std::vector<Side> sides_;
    bool mirror_;
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
    WalkTracer tracer(cell);
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
    for (const TracerSums& s : out.sums) out.paths += s.walks, out.scatterings += s.scatterings;
    return out;
}

double mean_of(const std::vector<TracerSums>& sums, int which) {
    double length = 0, walks = 0;
    for (const TracerSums& s : sums) length += s.length[which], walks += static_cast<double>(s.walks);
    return length / walks;
}

}  // namespace

Traced<Profile> trace_expected_disc(double sigma, double g, double h, std::size_t bins, const TracerOptions& options) {
    check(sigma, g, bins, options);
    require(h >= -1 && h <= 1, "h: expected a value in [-1, 1]");
    TracerCell cell;
    cell.medium = Medium::disc;
    cell.sigma = std::max(sigma, kThin), cell.g = g, cell.h = h;
    cell.bins = static_cast<std::uint32_t>(bins), cell.seed = options.seed, cell.cell = options.cell;
    cell.plan = plan_of(cell);
    const Estimate estimate(disc_single_lobe(cell.sigma, g, h, bins), {{0, bins}}, h == 0);
    Run result = run(cell, estimate, options);
    Traced<Profile> out;
    out.paths = result.paths, out.scatterings = result.scatterings, out.reached = result.reached;
    out.profile.lobe = std::move(result.lobes[0].density);
    out.profile.standard_error = result.lobes[0].standard_error;
    out.profile.energy = disc_energy(sigma, h);
    out.profile.mean_length = mean_of(result.sums, 0);
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
