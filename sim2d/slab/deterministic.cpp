// Slab lobes: closed-form single scattering integrated over each bin, plus the modes' multiply scattered radiance
// interpolated from its nodes.
#include "sim2d/slab/deterministic.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "medulla/phase.hpp"
#include "sim2d/elementary.hpp"
#include "sim2d/slab/angles.hpp"
#include "sim2d/slab/modes.hpp"
#include "sim2d/slab/single.hpp"

namespace medulla::sim2d {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kUsualBins = 360;

/// Below this sigma lobes equal their limit in double precision: the difference is O(sigma log sigma) / bin width.
constexpr double kThin = 1e-30;

/// In thinner slabs too few directions resolve the grazing angles (mu of about the depth) from which light still
/// scatters. There paths are extrapolated to their limit, from which they differ as depth log^2(depth), to 15 % of the
/// difference: 1e-4 of a path (tests/test_slab_paths.cpp).
constexpr double kThinDepth = 3e-4;

/// Directions per quarter circle. The phase function's poles lie d = -log|g| off the real axis, at the normal
/// d / (1.167 pi / 2) in t, so the error of the 2N-point rule is exp(-2.18 d N) = 1e-9 at N = 9.5 / d. At least 64, for
/// thin layers and the logarithms at grazing.
double directions_wanted(double g) {
    return g == 0 ? 64 : std::max(64.0, std::ceil(-9.5 / portable::log(std::abs(g))));
}

/// The g that sets the bins' points for interpolated light: peaks of light scattered twice have poles at least twice as
/// far from the real axis, and no interpolant is sharper than the spacing of the directions.
double smooth_g(double g) { return std::min(g * g, 0.97); }

/// Relative L2 error of a lobe from rounding of the singular values: below 7e-9 for |g| <= 0.97 against
/// slab_doubling, worst at theta_i = 90 degrees, where light scatters at the surface and excites the grazing modes.
constexpr double kRounding = 1e-8;

/// Interpolation from the nodes of one resolution to the points of the bins, even and odd.
struct Rows {
    MatrixXd parity[2];
};

Rows interpolation_rows(const SlabOrdinates& ordinates, const std::vector<double>& theta) {
    const std::size_t n = ordinates.directions().theta.size();
    Rows rows;
    std::vector<double> row(n);
    for (const int parity : {0, 1}) {
        rows.parity[parity].resize(Index(theta.size()), Index(n));
        for (std::size_t r = 0; r < theta.size(); ++r) {
            const double t = ordinates.interpolation() == Interpolation::spectral ? slab_t_of(pi / 2 - theta[r]) : 0;
            slab_interpolation_row(ordinates.directions(), t, theta[r], parity == 0 ? Parity::even : Parity::odd,
                                   ordinates.interpolation(), row.data());
            rows.parity[parity].row(Index(r)) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), Index(n));
        }
    }
    return rows;
}

/// Raw lobes of every incident angle (columns) over the bins, in the frame of light that travels towards +theta_i.
struct RawLobes {
    MatrixXd back, forward;
};

RawLobes single_scattering(const SlabBins& bins, double g, double depth, const std::vector<double>& theta_i) {
    const Index count = Index(theta_i.size());
    RawLobes raw{MatrixXd::Zero(Index(bins.count), count), MatrixXd::Zero(Index(bins.count), count)};
    for (Index i = 0; i < count; ++i) {
        const double theta = theta_i[std::size_t(i)], mu_i = slab_cosine(theta);
        const double si = portable::sin(theta / 2), ci = portable::cos(theta / 2);
        for (const SlabBins::Group& group : bins.groups) {
            for (std::size_t r = group.first; r < group.last; ++r) {
                const double sr = bins.sin_half[r], cr = bins.cos_half[r];
                const double s_minus = sr * ci - cr * si, c_minus = cr * ci + sr * si;
                const double s_plus = sr * ci + cr * si, c_plus = cr * ci - sr * si;
                const double back = bins.weight[r] * slab_back_factor(depth, mu_i, bins.mu[r]);
                const double forward = bins.weight[r] * slab_forward_factor(depth, mu_i, bins.mu[r]);
                raw.forward(Index(group.upper), i) += forward * portable::planar_hg_pdf_of_half(s_minus, c_minus, g);
                raw.forward(Index(group.lower), i) += forward * portable::planar_hg_pdf_of_half(s_plus, c_plus, g);
                raw.back(Index(group.upper), i) += back * portable::planar_hg_pdf_of_half(s_plus, c_plus, -g);
                raw.back(Index(group.lower), i) += back * portable::planar_hg_pdf_of_half(s_minus, c_minus, -g);
            }
        }
    }
    const double per_bin = double(bins.count) / pi;
    raw.back *= per_bin;
    raw.forward *= per_bin;
    return raw;
}

RawLobes multiple_scattering(const SlabBins& bins, const Rows& rows, const SlabOrdinates& ordinates, double depth,
                             const std::vector<double>& theta_i) {
    const Index n = Index(ordinates.directions().theta.size()), count = Index(theta_i.size());
    const SlabOrdinates::Exit exit = ordinates.multiply_scattered(depth, theta_i);
    RawLobes raw{MatrixXd::Zero(Index(bins.count), count), MatrixXd::Zero(Index(bins.count), count)};
    Eigen::VectorXd weight(Index(bins.theta.size()));
    for (std::size_t r = 0; r < bins.theta.size(); ++r) {
        weight(Index(r)) = bins.weight[r] * -portable::expm1(-depth / bins.mu[r]) * double(bins.count) / pi;
    }
    MatrixXd average(Index(bins.groups.size()), n);
    for (const int parity : {0, 1}) {
        for (std::size_t b = 0; b < bins.groups.size(); ++b) {
            const Index first = Index(bins.groups[b].first), points = Index(bins.groups[b].last) - first;
            average.row(Index(b)).noalias() =
                weight.segment(first, points).transpose() * rows.parity[parity].middleRows(first, points);
        }
        const double sign = parity == 0 ? 1 : -1;
        const MatrixXd back = average * exit.back[parity], forward = average * exit.forward[parity];
        for (std::size_t b = 0; b < bins.groups.size(); ++b) {
            const Index upper = Index(bins.groups[b].upper), lower = Index(bins.groups[b].lower);
            raw.back.row(upper) += back.row(Index(b));
            raw.back.row(lower) += sign * back.row(Index(b));
            raw.forward.row(upper) += forward.row(Index(b));
            raw.forward.row(lower) += sign * forward.row(Index(b));
        }
    }
    return raw;
}

/// Path [radii] times energy, over slab_energy, of all scattered light from each theta_i; sigma > 0.
std::vector<SlabSides> paths(const SlabOrdinates& ordinates, double g, double sigma,
                             const std::vector<double>& theta_i) {
    const double depth = 2 * sigma, solved = std::max(depth, kThinDepth);
    const SlabOrdinates::Paths multiple = ordinates.multiply_scattered_paths(solved);
    const MatrixXd rows = interpolation_rows(ordinates, theta_i).parity[0];
    const VectorXd back = rows * multiple.back * (2 / solved), forward = rows * multiple.forward * (2 / solved);
    const double logs = portable::log(depth) / portable::log(kThinDepth);
    const double left = depth < kThinDepth ? depth / kThinDepth * logs * logs : 1;
    std::vector<SlabSides> all;
    for (std::size_t i = 0; i < theta_i.size(); ++i) {
        SlabSides sides = slab_single_paths(sigma, g, theta_i[i]);
        // Light scattered into mu < depth travels a mean free path and scatters to either side. Over all mu that adds
        // 1 radius for each direction along the surface, however thin the slab.
        const double limit =
            portable::planar_hg_pdf(pi / 2 - theta_i[i], g) + portable::planar_hg_pdf(pi / 2 + theta_i[i], g);
        sides.back += limit + left * (back(Index(i)) - limit);
        sides.forward += limit + left * (forward(Index(i)) - limit);
        all.push_back(sides);
    }
    return all;
}

/// sigma -> 0: p over its integral on each side (path factors tend to depth / mu_i on both), light towards -theta_i.
SlabProfile thin_limit(double g, double theta_i, std::size_t bins, double energy, const SlabSides& path) {
    const double w = pi / double(bins);
    SlabProfile limit;
    limit.back.lobe.resize(bins);
    limit.forward.lobe.resize(bins);
    const double back = planar_hg_integral(-pi / 2 - theta_i, pi / 2 - theta_i, -g);
    const double forward = planar_hg_integral(-pi / 2 + theta_i, pi / 2 + theta_i, g);
    for (std::size_t i = 0; i < bins; ++i) {
        const double lo = -pi / 2 + double(i) * w, hi = lo + w;
        limit.back.lobe[i] = planar_hg_integral(lo - theta_i, hi - theta_i, -g) / (w * back);
        limit.forward.lobe[i] = planar_hg_integral(lo + theta_i, hi + theta_i, g) / (w * forward);
    }
    limit.back.energy = energy * back;
    limit.forward.energy = energy * forward;
    limit.raw_total = energy;
    limit.back.mean_length = path.back / back;
    limit.forward.mean_length = path.forward / forward;
    return limit;
}

double relative_difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b) { return (a - b).norm() / a.norm(); }

void check_angles(const std::vector<double>& theta) {
    for (double t : theta) {
        if (!(std::abs(t) <= pi / 2)) throw std::invalid_argument("slab: angle outside [-pi/2, pi/2]");
    }
}

void check_sigma(double sigma) {
    if (!(sigma >= 0) || !std::isfinite(sigma)) throw std::invalid_argument("slab: sigma must be finite and >= 0");
}

}  // namespace

struct SlabSolver::State {
    double g;
    SlabOptions options;
    bool resolved;
    std::vector<SlabOrdinates> resolutions;  ///< the finer first
    SlabBins bins;                           ///< of kUsualBins, for the singly scattered light
    SlabBins smooth_bins;                    ///< of kUsualBins, for the multiply scattered light
    std::vector<Rows> rows;
};

SlabSolver::SlabSolver(double g, const SlabOptions& options) : state_(std::make_unique<State>()) {
    if (!(std::abs(g) < 1)) throw std::invalid_argument("slab: g must lie in (-1, 1)");
    const double wanted = options.directions > 0 ? double(options.directions) : directions_wanted(g);
    const std::size_t n = std::max<std::size_t>(4, std::min(std::size_t(wanted), options.max_directions));
    state_->g = g;
    state_->options = options;
    // With half of the wanted directions the kernel's integrals have errors of 3e-5, and the interpolant is positive.
    state_->resolved = double(n) >= directions_wanted(g) / 2;
    state_->resolutions.emplace_back(g, n, state_->resolved);
    if (options.estimate_error) state_->resolutions.emplace_back(g, n * 4 / 5, state_->resolved);
    state_->bins = slab_bins(kUsualBins, g);
    state_->smooth_bins = slab_bins(kUsualBins, smooth_g(g));
    for (const SlabOrdinates& o : state_->resolutions) {
        state_->rows.push_back(interpolation_rows(o, state_->smooth_bins.theta));
    }
}

SlabSolver::~SlabSolver() = default;
SlabSolver::SlabSolver(SlabSolver&&) noexcept = default;
SlabSolver& SlabSolver::operator=(SlabSolver&&) noexcept = default;

double SlabSolver::g() const noexcept { return state_->g; }
bool SlabSolver::resolved() const noexcept { return state_->resolved; }
std::size_t SlabSolver::directions() const noexcept { return state_->resolutions.front().directions().theta.size(); }

std::vector<SlabProfile> SlabSolver::solve(double sigma, const std::vector<double>& theta_i,
                                           std::size_t bins_per_side) const {
    check_sigma(sigma);
    check_angles(theta_i);
    if (bins_per_side < 1) throw std::invalid_argument("slab: at least one bin per side");
    std::vector<SlabProfile> profiles(theta_i.size());
    std::vector<double> incident;
    for (double theta : theta_i) incident.push_back(std::abs(theta));
    const double infinite = std::numeric_limits<double>::infinity();
    const std::vector<SlabSides> path = sigma > 0
                                            ? paths(state_->resolutions.front(), state_->g, sigma, incident)
                                            : std::vector<SlabSides>(theta_i.size(), SlabSides{infinite, infinite});
    if (sigma < kThin) {
        for (std::size_t i = 0; i < theta_i.size(); ++i) {
            const double energy = slab_energy(sigma, theta_i[i]);
            profiles[i] = thin_limit(state_->g, theta_i[i], bins_per_side, energy, path[i]);
        }
        return profiles;
    }
    const bool usual = bins_per_side == kUsualBins;
    const SlabBins own = usual ? SlabBins{} : slab_bins(bins_per_side, state_->g);
    const SlabBins own_smooth = usual ? SlabBins{} : slab_bins(bins_per_side, smooth_g(state_->g));
    const SlabBins& bins = usual ? state_->bins : own;
    const SlabBins& smooth_bins = usual ? state_->smooth_bins : own_smooth;
    // Unresolved errors are at worst of first order in 1 / N (cell averages): the fine error is 4 times the difference
    // of 0.8 N and N directions. Resolved errors fall exponentially, so that the difference itself is a bound.
    const double order = state_->resolved ? 1 : 4;
    const double depth = 2 * sigma, w = pi / double(bins_per_side);
    const RawLobes single = single_scattering(bins, state_->g, depth, incident);
    std::vector<RawLobes> raw;
    for (std::size_t r = 0; r < state_->resolutions.size(); ++r) {
        const SlabOrdinates& ordinates = state_->resolutions[r];
        raw.push_back(multiple_scattering(smooth_bins,
                                          usual ? state_->rows[r] : interpolation_rows(ordinates, smooth_bins.theta),
                                          ordinates, depth, incident));
        raw.back().back += single.back;
        raw.back().forward += single.forward;
    }
    for (std::size_t i = 0; i < theta_i.size(); ++i) {
        const double total = slab_energy(sigma, theta_i[i]);
        const auto fill = [&](Profile& profile, MatrixXd RawLobes::*side, double path_of_side) {
            const auto lobe = (raw[0].*side).col(Index(i));
            const double raw_energy = lobe.sum() * w;
            const double both = (raw[0].back.col(Index(i)).sum() + raw[0].forward.col(Index(i)).sum()) * w;
            profile.energy = raw_energy * (total / both);
            profile.mean_length = path_of_side / (raw_energy / both);
            profile.lobe.resize(bins_per_side);
            // The solver's light travels towards +theta, that of theta_i > 0 towards -theta_i.
            for (std::size_t b = 0; b < bins_per_side; ++b) {
                const std::size_t from = theta_i[i] >= 0 ? bins_per_side - 1 - b : b;
                profile.lobe[b] = lobe(Index(from)) / raw_energy;
            }
            profiles[i].raw_total = both;
            if (raw.size() < 2) return;
            const auto coarse = (raw[1].*side).col(Index(i));
            profile.standard_error =
                order * relative_difference(lobe / raw_energy, coarse / (coarse.sum() * w)) + kRounding;
            // Rounding moves energy from one side to the other, at most what the smaller one has.
            const double smaller = std::min(raw_energy, std::abs(both - raw_energy));
            profile.energy_error =
                order * std::abs(raw_energy - coarse.sum() * w) + std::abs(both - total) + kRounding * smaller;
        };
        fill(profiles[i].back, &RawLobes::back, path[i].back);
        fill(profiles[i].forward, &RawLobes::forward, path[i].forward);
    }
    return profiles;
}

std::vector<std::vector<SlabSolver::Raw>> SlabSolver::raw(double sigma, const std::vector<double>& theta_i,
                                                          const std::vector<double>& theta_r) const {
    check_sigma(sigma);
    check_angles(theta_i);
    check_angles(theta_r);
    std::vector<std::vector<Raw>> out(theta_i.size(), std::vector<Raw>(theta_r.size(), Raw{0, 0}));
    if (!(sigma > 0)) return out;
    std::vector<double> incident, exits;
    for (double theta : theta_i) incident.push_back(std::abs(theta));
    for (double theta : theta_r) exits.push_back(std::abs(theta));
    const double depth = 2 * sigma;
    const SlabOrdinates& ordinates = state_->resolutions.front();
    const SlabOrdinates::Exit exit = ordinates.multiply_scattered(depth, incident);
    const Rows rows = interpolation_rows(ordinates, exits);
    for (const int parity : {0, 1}) {
        const MatrixXd back = rows.parity[parity] * exit.back[parity];
        const MatrixXd forward = rows.parity[parity] * exit.forward[parity];
        for (std::size_t i = 0; i < theta_i.size(); ++i) {
            for (std::size_t r = 0; r < theta_r.size(); ++r) {
                const double mu = slab_cosine(theta_r[r]);
                const bool mirrored = (theta_i[i] >= 0) == (theta_r[r] >= 0);  // travels towards -theta_i
                const double scale = (mirrored && parity == 1 ? -1 : 1) * -portable::expm1(-depth / mu);
                out[i][r].back += scale * back(Index(r), Index(i));
                out[i][r].forward += scale * forward(Index(r), Index(i));
            }
        }
    }
    for (std::size_t i = 0; i < theta_i.size(); ++i) {
        for (std::size_t r = 0; r < theta_r.size(); ++r) {
            out[i][r].back += slab_single_back(sigma, state_->g, theta_i[i], theta_r[r]);
            out[i][r].forward += slab_single_forward(sigma, state_->g, theta_i[i], theta_r[r]);
        }
    }
    return out;
}

}  // namespace medulla::sim2d
