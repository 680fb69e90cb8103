#include "sim2d/disc_deterministic.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <mutex>
#include <stdexcept>
#include <tuple>

#include "sim2d/disc_grid.hpp"
#include "sim2d/disc_single.hpp"
#include "sim2d/disc_solve.hpp"

namespace medulla::sim2d {
namespace {

const double pi = 3.14159265358979323846;
using Complex = std::complex<double>;

void require(bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
}

/// Coefficients c_k / E at the offset h, by a polynomial in asin h through the eight nearest chords, those of -h
/// included: I(-b, -phi) = I(b, phi). Near |h| = 1 the stencil ends at the tangent chord.
std::vector<Complex> at_offset(const DiscExit& exit, double h) {
    const std::size_t count = exit.offset.size(), taps = std::min<std::size_t>(8, 2 * count);
    // Chord t of -count .. count - 1: mirrored for t < 0.
    const auto beta = [&](std::ptrdiff_t t) {
        return t < 0 ? -std::asin(exit.offset[static_cast<std::size_t>(-1 - t)])
                     : std::asin(exit.offset[static_cast<std::size_t>(t)]);
    };
    const double x = std::asin(std::abs(h));
    const auto above = std::upper_bound(exit.offset.begin(), exit.offset.end(), std::abs(h)) - exit.offset.begin();
    const auto start = std::min<std::ptrdiff_t>(above - static_cast<std::ptrdiff_t>(taps / 2),
                                                static_cast<std::ptrdiff_t>(count - taps));
    std::vector<Complex> c(exit.modes);
    for (std::size_t a = 0; a < taps; ++a) {
        const std::ptrdiff_t t = start + static_cast<std::ptrdiff_t>(a);
        double weight = 1;
        for (std::size_t o = 0; o < taps; ++o)
            if (const std::ptrdiff_t u = start + static_cast<std::ptrdiff_t>(o); u != t)
                weight *= (x - beta(u)) / (beta(t) - beta(u));
        const std::size_t chord = static_cast<std::size_t>(t < 0 ? -1 - t : t);
        for (std::size_t k = 0; k < exit.modes; ++k) {
            const Complex value = exit.lobes[chord * exit.modes + k];
            c[k] += weight * (t < 0 ? std::conj(value) : value);
        }
    }
    if (h < 0)
        for (Complex& value : c) value = std::conj(value);
    return c;
}

/// Adds the bin averages of c_0 + 2 Re sum c_k exp(i k phi) to a lobe: mode k is damped by sinc(k w / 2).
void add_modes(const std::vector<Complex>& c, std::vector<double>& lobe) {
    const std::size_t bins = lobe.size(), turn = 2 * bins;
    std::vector<double> cosine(turn), sine(turn);
    for (std::size_t a = 0; a < turn; ++a) {
        cosine[a] = std::cos(pi * static_cast<double>(a) / static_cast<double>(bins));
        sine[a] = std::sin(pi * static_cast<double>(a) / static_cast<double>(bins));
    }
    for (std::size_t k = 0; k < c.size(); ++k) {
        const double half = pi * static_cast<double>(k) / static_cast<double>(bins);
        const Complex value = k == 0 ? c[0] : c[k] * (2 * std::sin(half) / half * (k % 2 ? -1 : 1));
        // phi = -pi + (2 b + 1) pi / bins; exp(-i k pi) is in the factor above.
        std::size_t angle = k % turn;
        for (double& x : lobe) {
            x += value.real() * cosine[angle] - value.imag() * sine[angle];
            angle = (angle + 2 * k) % turn;
        }
    }
}

/// Measured (docs/accuracy.md), for sigma <= 16 and |g| <= 0.95. Errors fall like the third power of all steps. Scattering
/// makes the source under the rim behave like z log z over a depth z = rim^2 / 2; light that is scattered twice carries
/// modes of g^(2 k).
DiscGridSize automatic(double sigma, double g, const DiscOptions& options) {
    const double scale = std::cbrt(options.target_error / 1e-3), depth = std::min(sigma, 40.0);
    DiscGridSize size;
    size.circles = options.circles > 0 ? options.circles : static_cast<int>(std::ceil((8 + 0.75 * depth) / scale));
    size.gap = options.gap > 0 ? options.gap : std::min(0.3 * scale, 0.4);
    size.rim = options.rim > 0 ? options.rim : 0.003 * scale * std::sqrt(16 / std::clamp(depth, 1.0, 16.0));
    size.growth = 1 + scale * (0.2 + 0.1 * std::exp(-sigma / 4));
    const double visible = 1.3 * options.target_error / std::min(sigma, 1.0);
    const double tail = g == 0 || visible >= 1 ? 0 : std::log(visible) / (2 * std::log(std::abs(g)));
    const double modes = std::max(19 + 3 * std::min(std::sqrt(sigma), 8.0), std::min(tail, 200.0));
    size.modes = options.modes > 0 ? options.modes : static_cast<int>(modes / 8) * 8 + 6;
    return size;
}

const double coarsening = 1.4;

DiscGridSize coarser(const DiscGridSize& size) {
    const auto rounded = [](double x, int least) { return std::max(least, static_cast<int>(x)); };
    return {rounded(size.circles / coarsening, 4), rounded(size.modes * 0.75, 8), std::min(size.gap * coarsening, 0.5),
            size.rim * coarsening, 1 + (size.growth - 1) * coarsening};
}

/// What the coarse grid misses is coarsening^3 times what the fine one does: fine + (fine - coarse) times this cancels
/// most of it.
double extrapolation(double, double) { return getenv("AHEAD") ? atof(getenv("AHEAD")) : 0; }

}  // namespace

struct DiscSolver::Shared {
    double g;
    DiscOptions options;
    std::mutex mutex;
    std::map<std::tuple<int, int, double, double>, std::shared_ptr<const DiscGrid>> grids;

    std::shared_ptr<const DiscGrid> grid(const DiscGridSize& size) {
        const std::lock_guard<std::mutex> lock(mutex);
        auto& entry = grids[{size.circles, size.modes, size.gap, size.rim}];
        if (!entry) entry = std::make_shared<const DiscGrid>(g, size);
        return entry;
    }
};

DiscSolver::DiscSolver(double g, const DiscOptions& options) : shared_(std::make_unique<Shared>()) {
    require(g > -1 && g < 1, "g: expected a value in (-1, 1)");
    require(options.circles == 0 || options.circles >= 6, "circles: expected at least 6, or 0");
    require(options.modes == 0 || options.modes >= 8, "modes: expected at least 8, or 0");
    require(options.gap >= 0, "gap: expected an angle > 0, or 0");
    shared_->g = g;
    shared_->options = options;
}

DiscSolver::~DiscSolver() = default;
DiscSolver::DiscSolver(DiscSolver&&) noexcept = default;
DiscSolver& DiscSolver::operator=(DiscSolver&&) noexcept = default;

std::vector<Profile> DiscSolver::solve(double sigma, const std::vector<double>& h, std::size_t bins) const {
    require(std::isfinite(sigma) && sigma >= 0, "sigma: expected a finite value >= 0");
    require(bins > 0, "bins: expected at least one");
    for (const double offset : h) require(offset >= -1 && offset <= 1, "h: expected a value in [-1, 1]");
    const DiscGridSize size = automatic(sigma, shared_->g, shared_->options);
    const double width = 2 * pi / static_cast<double>(bins);
    DiscExit fine, coarse;
    const bool two_grids = shared_->options.estimate_error && sigma > 0;
    if (sigma > 0) fine = solve_disc_transport(*shared_->grid(size), sigma, 0, 2e-5);
    if (two_grids) coarse = solve_disc_transport(*shared_->grid(coarser(size)), sigma, 0, 2e-5);
    const double ahead = extrapolation(sigma, shared_->g);
    std::vector<Profile> profiles;
    for (const double offset : h) {
        Profile profile;
        profile.energy = disc_energy(sigma, offset);
        profile.lobe = disc_single_lobe(sigma, shared_->g, offset, bins);
        std::vector<double> difference(bins);
        if (sigma > 0) {
            std::vector<Complex> c = at_offset(fine, offset);
            if (two_grids) {
                std::vector<Complex> d = at_offset(coarse, offset);
                d.resize(c.size());
                for (std::size_t k = 0; k < c.size(); ++k) {
                    d[k] = c[k] - d[k];
                    c[k] += ahead * d[k];
                }
                add_modes(d, difference);
            }
            add_modes(c, profile.lobe);
        }
        double sum = 0, square = 0, error = 0;
        for (std::size_t b = 0; b < bins; ++b) {
            sum += profile.lobe[b];
            square += profile.lobe[b] * profile.lobe[b];
            error += difference[b] * difference[b];
        }
        profile.energy_error = std::abs(sum * width - 1) * profile.energy;
        profile.standard_error = two_grids ? std::sqrt(error / square) + fine.residual : 0;
        for (double& x : profile.lobe) x /= sum * width;
        profiles.push_back(std::move(profile));
    }
    return profiles;
}

}  // namespace medulla::sim2d
