#include "sim2d/analog.hpp"

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

/// Free flight with collision density sigma exp(-sigma t). sigma = 0 flies for ever.
double free_flight(double sigma, RandomStream& random) { return -portable::log(random.uniform()) / sigma; }

/// First flight conditioned to collide within `length`: t = -log(1 - u (1 - exp(-sigma L))) / sigma -> u L.
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
    // One Newton step keeps the length of the direction at 1 however long the walk.
    const double n = 1.5 - 0.5 * (ray.direction.x * ray.direction.x + ray.direction.y * ray.direction.y);
    ray.direction = {ray.direction.x * n, ray.direction.y * n};
}

/// Bin of an angle among `bins` over [low, high]; the ends belong to the first and last bin.
std::size_t bin_of(double angle, double low, double high, std::size_t bins) {
    const auto b = static_cast<std::ptrdiff_t>((angle - low) / (high - low) * static_cast<double>(bins));
    return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(b, 0, static_cast<std::ptrdiff_t>(bins) - 1));
}

/// Standard error of a share of n trials. Half a count more on either side (Jeffreys' prior): 0 or n hits of n are not
/// certainty.
double share_error(double hits, double n) {
    const double q = (hits + 0.5) / (n + 1);
    return std::sqrt(q * (1 - q) / n);
}

/// The same for paths of weight w <= 1 in a medium that absorbs: sums of w, w^2 and w times the length.
struct Weights {
    explicit Weights(std::size_t bins) : sum(bins, 0), square(bins, 0) {}
    std::vector<double> sum, square;
    double total = 0, squares = 0, length = 0, paths = 0;

    void add(std::size_t b, double path_length, double w) {
        sum[b] += w, square[b] += w * w;
        total += w, squares += w * w, length += w * path_length, ++paths;
    }

    Profile profile(double width) const {
        Profile p;
        p.standard_error = 1;
        if (!(total > 0)) return p;
        double variance = 0, norm = 0;
        for (std::size_t b = 0; b < sum.size(); ++b) {
            p.lobe.push_back(sum[b] / (total * width));
            variance += square[b] - sum[b] * sum[b] / paths;
            norm += sum[b] * sum[b];
        }
        p.standard_error = std::sqrt(variance / norm);
        p.mean_length = length / total;
        return p;
    }
};

struct Counts {
    explicit Counts(std::size_t bins) : bin(bins, 0) {}
    std::vector<std::uint64_t> bin;
    std::uint64_t total = 0;
    double length = 0;

    void add(std::size_t b, double path_length) { ++bin[b], ++total, length += path_length; }

    /// Density, error and mean length; the energy is the caller's.
    Profile profile(double width) const {
        Profile p;
        p.standard_error = 1;
        if (total == 0) return p;
        const auto n = static_cast<double>(total);
        double variance = 0, squares = 0;
        for (const std::uint64_t count : bin) {
            const auto c = static_cast<double>(count);
            p.lobe.push_back(c / (n * width));
            variance += c * (1 - c / n);
            squares += c * c;
        }
        p.standard_error = std::sqrt(variance / squares);
        p.mean_length = length / n;
        return p;
    }
};

}  // namespace

Exit walk_disc(Ray ray, double sigma, double g, RandomStream& random) {
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
    check(sigma, g, bins, options);
    require(h >= -1 && h <= 1, "h: expected a value in [-1, 1]");
    const double half = std::sqrt((1 - h) * (1 + h)), chord = 2 * half;
    require(std::isfinite(options.absorption) && options.absorption >= 0, "absorption: expected a finite value >= 0");
    Counts counts(bins);
    Weights weights(bins);
    const bool absorbs = options.absorption > 0, forced = options.first == FirstCollision::forced;
    for (std::uint64_t path = 0; path < options.paths; ++path) {
        RandomStream random(options.seed, options.cell, path);
        const double t = forced ? forced_flight(sigma, chord, random) : free_flight(sigma, random);
        if (!forced && !(t < chord)) continue;  // unscattered: not in the table
        Ray ray{-half, h, {1, 0}};
        advance(ray, t);
        scatter(ray, g, random);
        const Exit exit = walk_disc(ray, sigma, g, random);
        const double phi = portable::atan2(exit.ray.direction.y, exit.ray.direction.x);
        const std::size_t bin = bin_of(phi, -pi, pi, bins);
        const double length = t + exit.length;
        if (absorbs)
            weights.add(bin, length, portable::exp(-options.absorption * length));
        else
            counts.add(bin, length);
    }
    const double width = 2 * pi / static_cast<double>(bins);
    if (absorbs) {
        Profile profile = weights.profile(width);
        const auto n = static_cast<double>(options.paths);
        const double mean = weights.total / n, scale = forced ? -portable::expm1(-sigma * chord) : 1;
        profile.energy = scale * mean;
        profile.energy_error = scale * std::sqrt(std::max(0.0, weights.squares / n - mean * mean) / n);
        return profile;
    }
    Profile profile = counts.profile(width);
    profile.energy = -portable::expm1(-sigma * chord);
    if (!forced) {
        const auto n = static_cast<double>(options.paths);
        profile.energy = static_cast<double>(counts.total) / n;
        profile.energy_error = share_error(static_cast<double>(counts.total), n);
    }
    return profile;
}

SlabProfile trace_slab(double sigma, double g, double theta_i, std::size_t bins_per_side, const TraceOptions& options) {
    check(sigma, g, bins_per_side, options);
    require(theta_i >= -pi / 2 && theta_i <= pi / 2, "theta_i: expected a value in [-pi/2, pi/2]");
    // x is the depth below the lit face; the light travels along (cos theta_i, -sin theta_i), so that it comes from
    // inclination theta_i. It leaves at theta_r = asin(direction.y): the straight continuation is theta_r = -theta_i.
    const double mu = theta_i == pi / 2 || theta_i == -pi / 2 ? 0.0 : portable::cos(theta_i);
    const double chord = mu > 0 ? 2 / mu : std::numeric_limits<double>::infinity();
    Counts back(bins_per_side), forward(bins_per_side);
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
                // c = 0 and sigma = 0: the ray never leaves; it has probability 0, and an exit angle of +-90 degrees.
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
    const auto scattered = static_cast<double>(back.total + forward.total), n = static_cast<double>(options.paths);
    const bool forced = options.first == FirstCollision::forced;
    const double total = forced ? -portable::expm1(-sigma * chord) : scattered / n;
    const auto share = [&](Profile& p, std::uint64_t count) {
        if (!(sigma > 0) || !(scattered > 0)) return;
        p.energy = static_cast<double>(count) / scattered * total;
        p.energy_error =
            forced ? total * share_error(static_cast<double>(count), n) : share_error(static_cast<double>(count), n);
    };
    // In an empty slab directions along it have no end: the mean of 1 / cos diverges.
    if (!(sigma > 0)) profile.back.mean_length = profile.forward.mean_length = std::numeric_limits<double>::infinity();
    share(profile.back, back.total);
    share(profile.forward, forward.total);
    profile.raw_total = profile.back.energy + profile.forward.energy;
    return profile;
}

}  // namespace medulla::sim2d
