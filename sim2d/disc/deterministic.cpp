#include "sim2d/disc/deterministic.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <stdexcept>
#include <utility>

#include "sim2d/disc/grid.hpp"
#include "sim2d/disc/single.hpp"
#include "sim2d/disc/solve.hpp"
#include "sim2d/elementary.hpp"

namespace medulla::sim2d {
namespace {

using Complex = std::complex<double>;

void require(bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
}

/// Polynomial in asin h through the eight nearest chords, those of -h included: chord t of -count .. count - 1 is
/// mirrored for t < 0. Near |h| = 1 the stencil ends at the tangent chord.
struct Stencil {
    std::ptrdiff_t start;
    std::vector<double> weight;

    static std::size_t chord(std::ptrdiff_t t) { return static_cast<std::size_t>(t < 0 ? -1 - t : t); }
};

Stencil stencil_at(const std::vector<double>& offset, double h) {
    const std::size_t count = offset.size(), taps = std::min<std::size_t>(8, 2 * count);
    const auto beta = [&](std::ptrdiff_t t) {
        return t < 0 ? -portable::asin(offset[Stencil::chord(t)]) : portable::asin(offset[Stencil::chord(t)]);
    };
    const double x = portable::asin(std::abs(h));
    const auto above = std::upper_bound(offset.begin(), offset.end(), std::abs(h)) - offset.begin();
    Stencil s;
    s.start = std::min<std::ptrdiff_t>(above - static_cast<std::ptrdiff_t>(taps / 2),
                                       static_cast<std::ptrdiff_t>(count - taps));
    for (std::size_t a = 0; a < taps; ++a) {
        const std::ptrdiff_t t = s.start + static_cast<std::ptrdiff_t>(a);
        double weight = 1;
        for (std::size_t o = 0; o < taps; ++o)
            if (const std::ptrdiff_t u = s.start + static_cast<std::ptrdiff_t>(o); u != t)
                weight *= (x - beta(u)) / (beta(t) - beta(u));
        s.weight.push_back(weight);
    }
    return s;
}

/// Exit radiance at the offset h, relative to the energy of the first collisions: I(-b, -phi) = I(b, phi).
struct Light {
    std::vector<Complex> c;
    double rest = 0, length = 0;  ///< see DiscExit
};

Light at_offset(const DiscExit& exit, double h) {
    const Stencil stencil = stencil_at(exit.offset, h);
    Light light;
    light.c.resize(exit.modes);
    for (std::size_t a = 0; a < stencil.weight.size(); ++a) {
        const std::ptrdiff_t t = stencil.start + static_cast<std::ptrdiff_t>(a);
        const std::size_t chord = Stencil::chord(t);
        light.rest += stencil.weight[a] * exit.rest[chord];
        light.length += stencil.weight[a] * exit.length[chord];
        for (std::size_t k = 0; k < exit.modes; ++k) {
            const Complex value = exit.lobes[chord * exit.modes + k];
            light.c[k] += stencil.weight[a] * (t < 0 ? std::conj(value) : value);
        }
    }
    if (h < 0)
        for (Complex& value : light.c) value = std::conj(value);
    return light;
}

/// Adds the bin averages of c_0 + 2 Re sum c_k exp(i k phi) to a lobe: mode k is damped by sinc(k w / 2).
void add_modes(const std::vector<Complex>& c, std::vector<double>& lobe) {
    const std::size_t bins = lobe.size(), turn = 2 * bins;
    std::vector<double> cosine(turn), sine(turn);
    for (std::size_t a = 0; a <= bins; ++a) {
        const double angle = pi * static_cast<double>(a) / static_cast<double>(bins);
        cosine[a] = cosine[(turn - a) % turn] = portable::cos(angle);
        sine[(turn - a) % turn] = -portable::sin(angle);
        sine[a] = portable::sin(angle);
    }
    for (std::size_t k = 0; k < c.size(); ++k) {
        const double half = pi * static_cast<double>(k) / static_cast<double>(bins);
        const Complex value = k == 0 ? c[0] : c[k] * (2 * sine[k % turn] / half * (k % 2 ? -1 : 1));
        // phi = -pi + (2 b + 1) pi / bins; exp(-i k pi) is in the factor above.
        std::size_t angle = k % turn;
        for (double& x : lobe) {
            x += value.real() * cosine[angle] - value.imag() * sine[angle];
            angle = (angle + 2 * k) % turn;
        }
    }
}

/// Constants fitted to the errors of bench/bench_disc over sigma <= 16 and |g| <= 0.95 (docs/accuracy.md). Errors fall
/// with the third power of all steps. Below the rim the source behaves like z log z over a depth z = rim^2 / 2; modes
/// of light scattered twice fall as g^(2 k). Narrow phase functions need modes rather than circles: light that turns
/// slowly changes slowly on its way inwards.
DiscGridSize automatic(double sigma, double sigma_a, double g, const DiscOptions& options) {
    const double scale = portable::exp(portable::log(options.target_error / 1e-3) / 3),
                 depth = std::min(sigma + sigma_a, 40.0);
    const double narrow = std::abs(g), turning = 1.35 - 2 * std::max(0.0, narrow - 0.65);
    DiscGridSize size;
    size.circles =
        options.circles > 0
            ? options.circles
            : static_cast<int>(std::ceil((10 + 1.1 * turning * depth) * portable::exp(-0.8 * portable::log(scale))));
    size.gap = options.gap > 0 ? options.gap : std::min(0.3 * scale, 0.4);
    const double thin = 0.003 * std::sqrt(16 / std::clamp(depth, 1.0, 16.0)) / (1 + 5 * std::max(0.0, narrow - 0.85));
    size.rim = options.rim > 0 ? options.rim : scale * thin;
    size.growth = 1 + scale * (0.17 + 0.13 * portable::exp(-depth / 4));
    const double visible = 0.6 * options.target_error / std::min(sigma, 1.0);
    const double tail = g == 0 || visible >= 1 ? 0 : portable::log(visible) / (2 * portable::log(narrow));
    // Near the tangent the lobe has a kink at phi = 0, smoothed by g only: modes fall algebraically.
    const double root = std::min(std::sqrt(depth), 8.0);
    const double sharp = 3 * std::max(0.0, narrow - 0.5) + 12 * std::max(0.0, narrow - 0.9);
    const double kink = (19 + 5 * root + (31 + 2 * root) * sharp) / std::max(scale, 0.5);
    const double modes = std::min(std::max(kink, tail), 200.0);
    size.modes = options.modes > 0 ? options.modes : static_cast<int>(modes / 8) * 8 + 6;
    return size;
}

const double coarsening = 1.4;

DiscGridSize coarser(const DiscGridSize& size) {
    const auto rounded = [](double x, int least) { return std::max(least, static_cast<int>(x)); };
    return {rounded(size.circles / coarsening + 0.5, 4), rounded(size.modes * 0.75, 8),
            std::min(size.gap * coarsening, 0.5), size.rim * coarsening, 1 + (size.growth - 1) * coarsening};
}

/// Third order: the coarse grid's error is coarsening^3 times the fine one's. Ratio of the fine grid's error to the
/// difference of the two.
const double share = 1 / (coarsening * coarsening * coarsening - 1);

/// Integral of bin averages over the circle.
double integral(const std::vector<double>& lobe) {
    double sum = 0;
    for (const double x : lobe) sum += x * (2 * pi / static_cast<double>(lobe.size()));
    return sum;
}

/// Mean of t over the first collisions exp(-extinction t) on a chord: length (1 / tau - 1 / (exp(tau) - 1)).
double mean_first_flight(double extinction, double length) {
    const double tau = extinction * length;
    if (tau < 0.3) return length * (0.5 - tau / 12 * (1 - tau * tau / 60 * (1 - tau * tau / 42)));
    return length * (1 / tau - 1 / portable::expm1(tau));
}

}  // namespace

DiscSolver::DiscSolver(double g, const DiscOptions& options) : g_(g), options_(options) {
    require(g > -1 && g < 1, "g: expected a value in (-1, 1)");
    require(options.circles == 0 || options.circles >= 6, "circles: expected at least 6, or 0");
    require(options.modes == 0 || options.modes >= 8, "modes: expected at least 8, or 0");
    require(options.target_error >= 1e-6 && options.target_error <= 0.1, "target_error: expected 1e-6 to 0.1");
    require(options.rim == 0 || options.rim >= 1e-9, "rim: expected an angle of 1e-9 or more, or 0");
    require(options.gap == 0 || options.gap >= 1e-4, "gap: expected an angle of 1e-4 or more, or 0");
    require(options.most_steps >= 1, "most_steps: expected at least 1");
}

std::vector<Profile> DiscSolver::solve(double sigma, const std::vector<double>& h, std::size_t bins) const {
    return solve(sigma, 0, h, bins);
}

std::vector<Profile> DiscSolver::solve(double sigma, double sigma_a, const std::vector<double>& h,
                                       std::size_t bins) const {
    require(std::isfinite(sigma) && sigma >= 0, "sigma: expected a finite value >= 0");
    require(std::isfinite(sigma_a) && sigma_a >= 0, "sigma_a: expected a finite value >= 0");
    require(bins > 0, "bins: expected at least one");
    for (const double offset : h) require(offset >= -1 && offset <= 1, "h: expected a value in [-1, 1]");
    const double extinction = sigma + sigma_a;
    const DiscGridSize size = automatic(sigma, sigma_a, g_, options_);
    // Everything is relative to the energy of the first collisions, so the limit sigma -> 0 is a solve at a sigma whose
    // multiple scattering is below double precision.
    const double visible = std::max(sigma, 1e-30), tolerance = 0.02 * std::min(options_.target_error, 1e-3);
    const bool two_grids = options_.estimate_error;
    DiscExit coarse;
    const DiscExit fine = solve_disc_transport(DiscGrid(g_, size), visible, sigma_a, tolerance, options_.most_steps);
    if (two_grids)
        coarse = solve_disc_transport(DiscGrid(g_, coarser(size)), visible, sigma_a, tolerance, options_.most_steps);
    std::vector<Profile> profiles;
    for (const double offset : h) {
        Profile profile;
        const double chord = 2 * std::sqrt((1 - offset) * (1 + offset));
        const double collided = sigma > 0 ? disc_energy(extinction, offset) * (sigma / extinction) : 0;
        profile.lobe = disc_single_lobe(extinction, g_, offset, bins);
        // With few bins their midpoints are too coarse a quadrature; without absorption only energy_error depends on
        // it.
        const std::size_t points = sigma_a > 0 ? std::max<std::size_t>(bins, 180) : bins;
        const double single =
            points == bins ? integral(profile.lobe) : integral(disc_single_lobe(extinction, g_, offset, points));
        const Light light = at_offset(fine, offset);
        // The fraction of collided light that leaves, computed twice: as the integral of the lobe and as the light that
        // is not absorbed on the way. Each is used where it is accurate.
        const auto leaves = [&](const Light& l) {
            const double lobe = single + 2 * pi * l.c[0].real(), path = 1 - sigma_a * l.rest;
            return std::pair{lobe, path * path + (1 - path) * lobe};
        };
        const auto [whole, fraction] = leaves(light);
        profile.energy = collided * fraction;
        profile.energy_error = std::abs(whole - (1 - sigma_a * light.rest)) * collided;
        profile.mean_length = (mean_first_flight(extinction, chord) + light.length) / fraction;
        add_modes(light.c, profile.lobe);
        if (two_grids) {
            Light difference = at_offset(coarse, offset);
            if (sigma_a > 0) profile.energy_error = share * std::abs(fraction - leaves(difference).second) * collided;
            difference.c.resize(light.c.size());
            for (std::size_t k = 0; k < light.c.size(); ++k) difference.c[k] -= light.c[k];
            std::vector<double> lobe(bins);
            add_modes(difference.c, lobe);
            double square = 0, error = 0;
            for (std::size_t b = 0; b < bins; ++b) {
                square += profile.lobe[b] * profile.lobe[b];
                error += lobe[b] * lobe[b];
            }
            profile.standard_error = share * std::sqrt(error / square) + (sigma > 0 ? fine.residual : 0);
        }
        profile.standard_error += fine.unconverged, profile.energy_error += fine.unconverged * collided;
        // Truncated modes ring. The true lobe is not negative, so clamping at 0 reduces the error.
        for (double& x : profile.lobe) x = std::max(x, 0.0);
        const double sum = integral(profile.lobe);
        for (double& x : profile.lobe) x /= sum;
        profiles.push_back(std::move(profile));
    }
    return profiles;
}

}  // namespace medulla::sim2d
