#include "sim2d/reference/analog.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "sim2d/elementary.hpp"

namespace medulla::sim2d {
namespace {

void require(bool condition, const char* what) {
    if (!condition) throw std::invalid_argument(what);
}

void check(double sigma, double g, std::size_t bins, const TraceOptions& options) {
    require(std::isfinite(sigma) && sigma >= 0, "sigma: expected a finite value >= 0");
    require(g > -1 && g < 1, "g: expected a value in (-1, 1)");
    require(bins > 0, "bins: expected at least one");
    require(options.paths > 0 && options.paths <= std::uint64_t{1} << 40, "paths: expected 1 to 2^40");
}

/// Free flight with collision density sigma exp(-sigma t); infinite for sigma = 0.
/// sigma + 0 turns -0 into 0: the flight is then infinite, and not backwards.
double free_flight(double sigma, RandomStream& random) { return -portable::log(random.uniform()) / (sigma + 0.0); }

/// First flight, conditioned on a collision within `length`: t = -log(1 - u (1 - exp(-sigma L))) / sigma -> u L.
double forced_flight(double sigma, double length, RandomStream& random) {
    const double u = random.uniform(), tau = sigma * length;
    if (!(tau > 0)) return u * std::min(length, std::numeric_limits<double>::max());
    if (std::isinf(tau)) return -portable::log(u) / sigma;
    return std::min(-portable::log1p(u * portable::expm1(-tau)) / sigma, length);
}

/// Distance from a point of the disc to the circle along a unit direction, >= 0.
double distance_to_circle(const Ray& ray) {
    const double along = ray.x * ray.direction.x + ray.y * ray.direction.y;
    const double across = ray.x * ray.direction.y - ray.y * ray.direction.x;
    const double half = std::sqrt(std::max(0.0, (1 - across) * (1 + across)));
    // Half-chord minus the coordinate along it, without cancellation where they are close: (1 - r^2) / (half + along).
    if (along <= 0) return half - along;
    const double r2 = ray.x * ray.x + ray.y * ray.y;
    return std::max(0.0, 1 - r2) / (half + along);
}

void advance(Ray& ray, double t) { ray.x += t * ray.direction.x, ray.y += t * ray.direction.y; }

void scatter(Ray& ray, double g, RandomStream& random) {
    ray.direction = rotate(ray.direction, sample_planar_hg(random.direction(), g));
    // One Newton step keeps the length of the direction at 1 however long the path.
    const double n = 1.5 - 0.5 * (ray.direction.x * ray.direction.x + ray.direction.y * ray.direction.y);
    ray.direction = {ray.direction.x * n, ray.direction.y * n};
}

/// Bin of an angle among `bins` over [low, high]; the ends belong to the first and last bin.
std::size_t bin_of(double angle, double low, double high, std::size_t bins) {
    const auto b = static_cast<std::ptrdiff_t>((angle - low) / (high - low) * static_cast<double>(bins));
    return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(b, 0, static_cast<std::ptrdiff_t>(bins) - 1));
}

/// Standard error of a fraction of n trials. Jeffreys' prior adds half a count on either side, since 0 or n hits do not
/// mean certainty.
double share_error(double hits, double n) {
    const double q = (hits + 0.5) / (n + 1);
    return std::sqrt(q * (1 - q) / n);
}

/// Smallest weight. Its square does not underflow, so that every absorption has a lobe; it has no visible effect.
constexpr double kLeastWeight = 1e-150;

/// Sums over paths of weight w <= 1: of w and w^2 per exit bin and in total, and of w times the length.
struct Weights {
    explicit Weights(std::size_t bins) : sum(bins, 0), square(bins, 0) {}
    std::vector<double> sum, square;
    double total = 0, squares = 0, length = 0, paths = 0;

    void add(std::size_t b, double path_length, double w = 1) {
        sum[b] += w, square[b] += w * w;
        total += w, squares += w * w, length += w * path_length, ++paths;
    }

    /// Density, error and mean length; the caller sets the energy.
    Profile profile(double width) const {
        Profile p;
        p.standard_error = 1;
        if (!(total > 0)) return p;
        double variance = 0, norm = 0;
        for (std::size_t b = 0; b < sum.size(); ++b) {
            p.lobe.push_back(sum[b] / (total * width));
            if (sum[b] > 0) variance += sum[b] * (square[b] / sum[b] - sum[b] / paths);
            norm += sum[b] * sum[b];
        }
        p.standard_error = std::sqrt(std::max(0.0, variance) / norm);
        p.mean_length = length / total;
        return p;
    }
};

}  // namespace

Exit follow_path(Ray ray, double sigma, double g, RandomStream& random) {
    Exit exit{ray, 0, 0};
    for (;;) {
        const double t = free_flight(sigma, random), d = distance_to_circle(exit.ray);
        if (!(t < d)) {
            advance(exit.ray, d);
            exit.length += d;
            return exit;
        }
        advance(exit.ray, t);
        exit.length += t;
        scatter(exit.ray, g, random);
        ++exit.scatterings;
    }
}

Profile trace_disc(double sigma, double g, double h, std::size_t bins, const TraceOptions& options) {
    return trace_disc(sigma, g, h, {0.0}, bins, options)[0];
}

std::vector<Profile> trace_disc(double sigma, double g, double h, const std::vector<double>& absorption,
                                std::size_t bins, const TraceOptions& options) {
    check(sigma, g, bins, options);
    require(h >= -1 && h <= 1, "h: expected a value in [-1, 1]");
    for (const double a : absorption) require(std::isfinite(a) && a >= 0, "absorption: expected finite values >= 0");
    const double half = std::sqrt((1 - h) * (1 + h)), chord = 2 * half;
    const bool forced = options.first == FirstCollision::forced;
    std::vector<Weights> weights(absorption.size(), Weights(bins));
    for (std::uint64_t path = 0; path < options.paths; ++path) {
        RandomStream random(options.seed, options.cell, path);
        const double t = forced ? forced_flight(sigma, chord, random) : free_flight(sigma, random);
        if (!forced && !(t < chord)) continue;  // unscattered: not in the table
        Ray ray{-half, h, {1, 0}};
        advance(ray, t);
        scatter(ray, g, random);
        const Exit exit = follow_path(ray, sigma, g, random);
        const double phi = portable::atan2(exit.ray.direction.y, exit.ray.direction.x), length = t + exit.length;
        const std::size_t bin = bin_of(phi, -pi, pi, bins);
        for (std::size_t j = 0; j < weights.size(); ++j)
            weights[j].add(bin, length,
                           absorption[j] > 0 ? std::max(portable::exp(-absorption[j] * length), kLeastWeight) : 1);
    }
    const double width = 2 * pi / static_cast<double>(bins), n = static_cast<double>(options.paths);
    const double scattered = -portable::expm1(-sigma * chord);  // the fraction that forced paths represent
    std::vector<Profile> profiles;
    for (std::size_t j = 0; j < weights.size(); ++j) {
        const Weights& w = weights[j];
        Profile& p = profiles.emplace_back(w.profile(width));
        const double mean = w.total / n, scale = forced ? scattered : 1;
        p.energy = scale * mean;
        p.energy_error = scale * std::sqrt(std::max(0.0, w.squares / n - mean * mean) / n);
        if (absorption[j] == 0) p.energy_error = forced ? 0 : share_error(w.total, n);
    }
    return profiles;
}

SlabProfile trace_slab(double sigma, double g, double theta_i, std::size_t bins_per_side, const TraceOptions& options) {
    check(sigma, g, bins_per_side, options);
    require(theta_i >= -pi / 2 && theta_i <= pi / 2, "theta_i: expected a value in [-pi/2, pi/2]");
    // x is the depth below the lit face; the light travels along (cos theta_i, -sin theta_i), so that it comes from
    // inclination theta_i. It leaves at theta_r = asin(direction.y); straight through is theta_r = -theta_i.
    const double mu = theta_i == pi / 2 || theta_i == -pi / 2 ? 0.0 : portable::cos(theta_i);
    const double chord = mu > 0 ? 2 / mu : std::numeric_limits<double>::infinity();
    Weights back(bins_per_side), forward(bins_per_side);
    for (std::uint64_t path = 0; path < options.paths; ++path) {
        RandomStream random(options.seed, options.cell, path);
        const bool forced = options.first == FirstCollision::forced;
        double t = forced ? forced_flight(sigma, chord, random) : free_flight(sigma, random);
        if (!forced && !(t < chord)) continue;
        double x = std::min(t * mu, 2.0), length = t;
        Ray ray{x, 0, {mu, -portable::sin(theta_i)}};
        for (;;) {
            scatter(ray, g, random);
            t = free_flight(sigma, random);
            const double c = ray.direction.x;
            const double to_face = c > 0 ? (2 - x) / c : (c < 0 ? -x / c : std::numeric_limits<double>::infinity());
            if (!(t < to_face)) {
                // c = 0 and sigma = 0: the ray never leaves. It has probability 0; its exit angle is +-90 degrees.
                length += std::min(to_face, std::numeric_limits<double>::max());
                const double theta_r = portable::atan2(ray.direction.y, std::abs(c));
                (c < 0 ? back : forward).add(bin_of(theta_r, -pi / 2, pi / 2, bins_per_side), length);
                break;
            }
            x = std::clamp(x + t * c, 0.0, 2.0);
            length += t;
        }
    }
    const double width = pi / static_cast<double>(bins_per_side);
    SlabProfile profile{back.profile(width), forward.profile(width), 0};
    const double scattered = back.total + forward.total, n = static_cast<double>(options.paths);
    const bool forced = options.first == FirstCollision::forced;
    const double total = forced ? -portable::expm1(-sigma * chord) : scattered / n;
    const auto share = [&](Profile& p, double count) {
        if (!(sigma > 0) || !(scattered > 0)) return;
        p.energy = count / scattered * total;
        p.energy_error = forced ? total * share_error(count, n) : share_error(count, n);
    };
    // In an empty slab directions along the surface never leave: the mean of 1 / cos diverges.
    if (!(sigma > 0)) profile.back.mean_length = profile.forward.mean_length = std::numeric_limits<double>::infinity();
    share(profile.back, back.total);
    share(profile.forward, forward.total);
    profile.raw_total = profile.back.energy + profile.forward.energy;
    return profile;
}

}  // namespace medulla::sim2d
