#include "sim3d/fibre_walk.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "medulla/config.hpp"
#include "medulla/phase.hpp"
#include "sim2d/elementary.hpp"

namespace medulla::sim3d {

namespace portable = sim2d::portable;
using sim2d::RandomStream;

namespace {

/// Henyey-Greenstein in space by its inverse, about d.
Vec3 scatter_hg3d(Vec3 d, double g, RandomStream& random) {
    // 1 - cos t = 2 (1 - u) (1 - g)^2 (1 + g u) / (1 - g + 2 g u)^2 keeps the peak's digits; u = 1 is straight ahead.
    // g < 0 is the mirror image of -g.
    const double a = std::abs(g), u = random.uniform(), v = 1 - u, den = 1 - a + 2 * a * u;
    const double turn = 2 * v * (1 - a) * (1 - a) * (1 + a * u) / (den * den);
    const double sine = std::sqrt(std::max(0.0, turn * (2 - turn))), cosine = g < 0 ? turn - 1 : 1 - turn;
    const auto w = random.direction();
    // Two directions across d, from the axis that d is farthest from.
    const Vec3 axis = std::abs(d.x) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    Vec3 e{d.y * axis.z - d.z * axis.y, d.z * axis.x - d.x * axis.z, d.x * axis.y - d.y * axis.x};
    e = e * (1 / std::sqrt(dot(e, e)));
    const Vec3 f{d.y * e.z - d.z * e.y, d.z * e.x - d.x * e.z, d.x * e.y - d.y * e.x};
    const Vec3 o = d * cosine + e * (sine * w.x) + f * (sine * w.y);
    return o * (1 / std::sqrt(dot(o, o)));
}

}  // namespace

FibreWalker::FibreWalker(const Fibre& fibre, const Light& light)
    : fibre_(fibre), surface_(fibre), ratio_(fibre.eta_m.value_or(fibre.eta_c) / fibre.eta_c) {
    stretch_ = 1 / fibre.axis_ratio;
    sin_azimuth_ = portable::sin(light.azimuth), cos_azimuth_ = portable::cos(light.azimuth);
    const double cos_i = portable::cos(light.theta_i);
    travel_ = {-portable::sin(light.theta_i), -cos_i * cos_azimuth_, -cos_i * sin_azimuth_};
    // Positions are kept in the plane in which the ellipse is the unit circle; parallel light stays parallel there.
    const double y = -cos_azimuth_ * stretch_, z = -sin_azimuth_, n = 1 / std::sqrt(y * y + z * z);
    entry_y_ = -y * n, entry_z_ = -z * n;
    across_y_ = -z * n, across_z_ = y * n;  // left of the direction of travel
}

/// Outward normal of the ellipse, or of the medulla's, at a point of the stretched plane.
Vec3 FibreWalker::normal(double y, double z) const {
    const double ny = y * stretch_, n = 1 / std::sqrt(ny * ny + z * z);
    return {0, ny * n, z * n};
}

void FibreWalker::collide(Vec3& d, RandomStream& random) const {
    if (fibre_.phase == Phase::hg3d) {
        d = scatter_hg3d(d, fibre_.g, random);
    } else {
        const auto e = rotate(Direction<double>{d.y, d.z}, sample_planar_hg(random.direction(), fibre_.g));
        d = {d.x, e.x, e.y};
        d = d * (1 / std::sqrt(dot(d, d)));
    }
}

/// At the medulla's smooth surface: refracts or reflects. @param n unit normal on the side of d
bool FibreWalker::crosses(Vec3& d, Vec3 n, double ratio, RandomStream& random) const {
    if (ratio == 1) return true;
    const double c = std::max(0.0, -dot(d, n));
    if (random.uniform() < interface_reflectance(ratio, c)) {
        d = reflected(d, n, c);
        return false;
    }
    d = refracted(d, n, c, ratio);
    return true;
}

PathExit FibreWalker::follow(double h, RandomStream& random) const {
    PathExit exit;
    Vec3 d = travel_;
    const double half = std::sqrt((1 - h) * (1 + h)), kappa = fibre_.kappa, ring = (1 - kappa) * (1 + kappa);
    double y = half * entry_y_ + h * across_y_, z = half * entry_z_ + h * across_z_;
    enum class Place { rim, cortex, medulla } place = Place::rim;  // cortex: on the medulla's surface, outside
    std::uint32_t before = 0, after = 0;
    const auto leave = [&] {
        exit.left = true;
        exit.direction = {d.x, d.y * cos_azimuth_ + d.z * sin_azimuth_, d.z * cos_azimuth_ - d.y * sin_azimuth_};
    };
    if (surface_.leave(d, Side::outside, normal(y, z), random) == Side::outside) {
        leave();
        return exit;
    }
    while (++exit.flights < most_flights) {
        const double dy = d.y * stretch_, q = dy * dy + d.z * d.z, b = y * dy + z * d.z;
        if (!(q > 1e-24)) break;  // along the axis: never meets anything again
        if (place == Place::medulla) {
            const double c = std::max(0.0, kappa * kappa - y * y - z * z), root = std::sqrt(b * b + q * c);
            const double wall = b > 0 ? c / (b + root) : (root - b) / q;
            const double flight = -portable::log(random.uniform()) / fibre_.sigma_ms;
            const double t = std::min(flight, wall);
            exit.medulla += t, y += t * dy, z += t * d.z;
            if (flight < wall) {
                ++exit.collisions;
                collide(d, random);
                continue;
            }
            const double n = kappa / std::sqrt(y * y + z * z);
            y *= n, z *= n;
            if (crosses(d, normal(y, z) * -1, 1 / ratio_, random)) place = Place::cortex;
            continue;
        }
        double t = 0;
        bool enters = false;
        if (place == Place::rim) {
            const double root2 = b * b - q * ring;
            enters = kappa > 0 && b < 0 && root2 > 0;
            t = enters ? ring / (std::sqrt(root2) - b) : std::max(0.0, -2 * b / q);
        } else {
            t = ring / (std::max(b, 0.0) + std::sqrt(b * b + q * ring) + 1e-300);
        }
        exit.cortex += t, y += t * dy, z += t * d.z;
        const double n = (enters ? kappa : 1) / std::sqrt(y * y + z * z);
        y *= n, z *= n;
        if (enters) {
            place = crosses(d, normal(y, z), ratio_, random) ? Place::medulla : Place::cortex;
            continue;
        }
        place = Place::rim;
        if (surface_.leave(d, Side::inside, normal(y, z), random) == Side::outside) {
            exit.kind = class_of(exit.collisions > 0, before, after);
            leave();
            return exit;
        }
        ++(exit.collisions > 0 ? after : before);
    }
    return exit;
}

FibreProfile walk_fibre(const Fibre& fibre, const Light& light, const FibreOptions& options) {
    validate(fibre, light, options);
    if (options.target_error > 0) throw std::invalid_argument("target_error: expected 0, the fast tracer has it");
    const FibreWalker walker(fibre, light);
    const std::uint64_t each = (options.paths + options.batches - 1) / options.batches;
    std::vector<FibreSums> batches(options.batches, FibreSums(fibre, options));
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t b = 0; b < options.batches; ++b) {
        FibreSums& sums = batches[b];
        sums.paths = each;
        for (std::uint64_t k = 0; k < each; ++k) {
            RandomStream random(options.seed, options.cell, b * each + k);
            const double u = (static_cast<double>(k) + random.uniform()) / static_cast<double>(each);
            const double h = light.h_low == light.h_high ? light.h_low : light.h_low + (light.h_high - light.h_low) * u;
            const PathExit exit = walker.follow(std::clamp(h, -1.0, 1.0), random);
            sums.flights += exit.flights;
            if (exit.left)
                sums.add(exit.kind, sums.bin_of(exit.direction.x, exit.direction.y, exit.direction.z), 1, exit.cortex,
                         exit.medulla);
            else
                sums.lost += 1;
        }
    }
    return {fibre, options, std::move(batches)};
}

}  // namespace medulla::sim3d
