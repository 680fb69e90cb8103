#include "sim3d/cuticle_surface.hpp"

#include <algorithm>
#include <cmath>

#include "medulla/config.hpp"
#include "sim2d/elementary.hpp"

namespace medulla::sim3d {

namespace portable = sim2d::portable;
using sim2d::RandomStream;

namespace {

/// Facets more than this many deviations away are taken to be out of sight: they are 1e-13 of all.
constexpr double kOutOfSight = 7;

Vec3 unit(Vec3 a) { return a * (1 / std::sqrt(dot(a, a))); }

double normal_density(double x) { return portable::exp(-0.5 * x * x) * 0.3989422804014327; }
/// Probability that a standard normal exceeds x. std::erfc: the last bit may differ between C libraries.
double normal_tail(double x) { return 0.5 * std::erfc(x * 0.7071067811865476); }

double standard_normal(RandomStream& random) {
    const double r = std::sqrt(-2 * portable::log(random.uniform()));
    return r * portable::cos(2 * pi * random.uniform());
}

}  // namespace

double interface_reflectance(double n, double c) {
    const double root2 = (n - 1) * (n + 1) + c * c;  // (n cos t)^2
    if (!(root2 > 0)) return 1;
    const double x = std::sqrt(root2);
    const double rs = (c - x) / (c + x), rp = (n * n * c - x) / (n * n * c + x);
    return 0.5 * (rs * rs + rp * rp);
}

double layered_reflectance(double excess, double c, double layers) {
    if (!(layers > 0)) return 0;
    const double x = std::sqrt(excess + c * c), n2 = 1 + excess;
    const double rs = (c - x) / (c + x), rp = (n2 * c - x) / (n2 * c + x);
    const double Rs = rs * rs, Rp = rp * rp, F1 = Rs / (1 + Rs) + Rp / (1 + Rp);
    return layers * F1 / (1 + (layers - 1) * F1);
}

Vec3 refracted(Vec3 d, Vec3 n, double c, double ratio) {
    const double cos_t = std::sqrt(std::max(0.0, 1 - (1 - c) * (1 + c) / (ratio * ratio)));
    return unit(d * (1 / ratio) + n * (c / ratio - cos_t));
}

double sample_visible(double mu, RandomStream& random) {
    if (mu > 0) {
        // p and -p share 2 mu between |p| < mu, in the ratio of mu + p to mu - p; beyond it p > 0 has all.
        const double tail = mu < kOutOfSight ? normal_density(mu) + mu * normal_tail(mu) : 0;
        const double body = mu < kOutOfSight ? mu * (1 - 2 * normal_tail(mu)) : mu;
        if (random.uniform() * (body + tail) < body)
            for (;;) {
                const double p = standard_normal(random);
                if (std::abs(p) >= mu) continue;
                return random.uniform() * 2 * mu < mu + std::abs(p) ? std::abs(p) : -std::abs(p);
            }
    }
    return sample_visible_tail(mu, random);
}

double sample_visible_tail(double mu, RandomStream& random) {
    if (mu <= -1) {
        // p = x - mu: x exp(mu x - x^2 / 2), from the Gamma density x exp(mu x).
        for (;;) {
            const double x = -portable::log(random.uniform() * random.uniform()) / -mu;
            if (random.uniform() < portable::exp(-0.5 * x * x)) return x - mu;
        }
    }
    // (mu + p) exp(-p^2 / 2) from Rayleigh's p exp(-p^2 / 2).
    for (;;) {
        const double p = std::sqrt(mu * mu - 2 * portable::log(random.uniform()));
        if (random.uniform() * p * (mu > 0 ? 2 : 1) < mu + p) return p;
    }
}

double visible_mass(double mu) {
    if (mu > kOutOfSight) return mu;
    if (mu < -kOutOfSight) return 0;
    return std::max(0.0, mu * normal_tail(-mu) + normal_density(mu));
}

CuticleSurface::CuticleSurface(const Fibre& fibre)
    : eta_(fibre.eta_c),
      excess_((fibre.eta_c - 1) * (fibre.eta_c + 1)),
      layers_(fibre.layers),
      along_(0.5 * fibre.beta_m),
      around_(0.5 * fibre.beta_n),
      reflectance_(fibre.reflectance) {
    const double angle = fibre.tilt == Tilt::theta_r ? 0.5 * fibre.alpha : fibre.alpha;
    tilt_ = portable::sin(angle) / portable::cos(angle);
}

double CuticleSurface::reflectance(Vec3 d, Vec3 n, double c, Side side) const {
    double outside = c;
    if (side == Side::inside) {
        const double cos2 = 1 - eta_ * eta_ * (1 - c) * (1 + c);
        if (!(cos2 > 0)) return 1;
        outside = std::sqrt(cos2);
    }
    if (reflectance_ == Reflectance::exact) return layered_reflectance(excess_, outside, layers_);
    // The inclination to the facet's own axis, the fibre's laid into the facet's plane; refraction conserves
    // index times it.
    const double in_plane = std::sqrt((1 - n.x) * (1 + n.x));
    const double along = in_plane > 0 ? (d.x + c * n.x) / in_plane : 0;
    const double sine = side == Side::inside ? eta_ * along : along, cos2 = (1 - sine) * (1 + sine);
    return layered_reflectance(excess_ / cos2, std::min(1.0, outside / std::sqrt(cos2)), layers_);
}

Vec3 CuticleSurface::facet(Vec3 d, Side side, Vec3 normal, bool tail, RandomStream& random) const {
    const double s = static_cast<double>(static_cast<int>(side));
    const Vec3 tangent{0, -normal.z, normal.y};
    // L = -s d . (N + a x + b t) = seen + K p: its slopes' part along k = -s (along d_x, around d_t) is p.
    const double seen = -s * (dot(d, normal) + tilt_ * d.x);
    const double kx = -s * along_ * d.x, kt = -s * around_ * dot(d, tangent), K = std::sqrt(kx * kx + kt * kt);
    double a = tilt_, b = 0;
    if (along_ > 0 || around_ > 0) {
        double p, q, cx = 1, ct = 0;
        if (K > 1e-12) {
            if (seen < -kOutOfSight * K) return normal * s;  // behind the scales: the cylinder itself
            p = tail ? sample_visible_tail(seen / K, random) : sample_visible(seen / K, random), cx = kx / K,
            ct = kt / K;
        } else {
            p = standard_normal(random);
        }
        q = standard_normal(random);
        a += along_ * (p * cx - q * ct), b += around_ * (p * ct + q * cx);
    } else if (!(seen > 0)) {
        return normal * s;
    }
    return unit(Vec3{a, normal.y + b * tangent.y, normal.z + b * tangent.z}) * s;
}

bool CuticleSurface::leaves(Vec3 d, Side side, Vec3 normal, RandomStream& random) const {
    const double s = static_cast<double>(static_cast<int>(side));
    const double up = s * dot(d, normal);
    if (!(up > 0)) return false;
    const double clear = up + s * tilt_ * d.x;
    if (!(clear > 0)) return false;
    const Vec3 tangent{0, -normal.z, normal.y};
    const double kx = along_ * d.x, kt = around_ * dot(d, tangent), K = std::sqrt(kx * kx + kt * kt);
    if (!(clear < kOutOfSight * K)) return true;
    return random.uniform() * (clear + K * visible_mass(-clear / K)) < clear;
}

Side CuticleSurface::leave(Vec3& d, Side side, Vec3 normal, RandomStream& random, Next next) const {
    constexpr int most = 1000;  // reflections among facets; more than ten are never seen
    for (int i = 0; i < most; ++i) {
        if (next == Next::leave_or_meet && leaves(d, side, normal, random)) return side;
        const Vec3 n = facet(d, side, normal, next == Next::meet_tail, random);
        next = Next::leave_or_meet;
        const double c = -dot(d, n);
        if (!(c > 0)) continue;  // by rounding
        if (random.uniform() < reflectance(d, n, c, side)) {
            d = unit(reflected(d, n, c));
        } else {
            d = refracted(d, n, c, side == Side::outside ? eta_ : 1 / eta_);
            side = side == Side::outside ? Side::inside : Side::outside;
        }
    }
    const double s = static_cast<double>(static_cast<int>(side)), up = s * dot(d, normal);
    if (up <= 0) d = unit(d + normal * (s * (1e-6 - 2 * up)));
    return side;
}

}  // namespace medulla::sim3d
