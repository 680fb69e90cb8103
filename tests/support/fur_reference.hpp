// The reference implementation of the BCSDF: double precision, standard library, straight from docs/bcsdf.md's
// formulas. The medulla's lobes come from a pack's factors (contract + lobe), or from dense tables as tables.hpp
// describes them, read with Cox and de Boor's recurrence in double.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "medulla/fur_parameters.hpp"
#include "medulla/lookup.hpp"
#include "medulla/tables.hpp"

namespace reference {

using namespace medulla;

/// Where the medulla's lobes are read.
struct Medulla {
    virtual ~Medulla() = default;
    virtual bool absorbs() const = 0;  ///< whether survival() is known
    /// Share of the scattered light that is left.
    virtual double survival(double sigma, double g, double h, double absorption) const = 0;
    /// C^N / E at y from its shift, as seen from h >= 0 [1 / radian].
    virtual double azimuthal(double sigma, double g, double h, double absorption, double y) const = 0;
    /// C^M of one side, as seen from theta_i >= 0 [1 / radian].
    virtual double longitudinal(Side side, double sigma, double g, double theta_i, double theta_r) const = 0;
};

class Factors : public Medulla {
  public:
    explicit Factors(const PackView& pack, Scattering form = Scattering::published) : pack_(pack), form_(form) {}
    bool absorbs() const override { return medulla::absorbs(pack_); }
    double survival(double sigma, double g, double h, double absorption) const override {
        return double(medulla::survival(pack_, float(sigma), float(g), float(h), float(absorption)));
    }
    double azimuthal(double sigma, double g, double h, double absorption, double y) const override {
        LobeQuery q;
        q.sigma = float(sigma), q.g = float(g), q.h = float(h), q.absorption = float(absorption);
        const TableView& table = pack_[TableKind::azimuthal];
        return double(lobe(table, contract(table, q), float(y)));
    }
    double longitudinal(Side side, double sigma, double g, double theta_i, double theta_r) const override {
        const auto density = [&](double theta) {
            return double(medulla::longitudinal(pack_, side, float(sigma), float(g), float(theta_i), float(theta)));
        };
        if (form_ == Scattering::published) return density(theta_r);
        const std::array<double, 4> row = {double(side), sigma, g, theta_i};
        if (row != row_[std::size_t(side)]) {
            constexpr int n = 2000;
            double sum = 0;
            for (int i = 0; i < n; ++i) {
                const double theta = pi * ((i + 0.5) / n - 0.5);
                sum += std::max(0.0, density(theta)) * std::cos(theta) * pi / n;
            }
            row_[std::size_t(side)] = row, integral_[std::size_t(side)] = sum;
        }
        return density(theta_r) * std::cos(theta_r) / integral_[std::size_t(side)];
    }

  private:
    PackView pack_;
    Scattering form_;
    mutable std::array<std::array<double, 4>, 2> row_ = {};  ///< whose integral was taken last, of either side
    mutable double integral_[2] = {};
};

/// Reads dense tables in the plainest way: every axis by its breakpoints, every row as a spline of its own.
class DenseReader : public Medulla {
  public:
    /// @param tables made of this pack for these ranges
    DenseReader(const PackView& pack, const TableRanges& ranges, const DenseTables& tables) : t_(tables) {
        detail::plan_tables(pack, ranges, plan_);
    }
    bool absorbs() const override { return t_.absorbs != 0; }
    double survival(double sigma, double g, double h, double absorption) const override {
        const Point of_g = g_at(g), of_sigma = at(0, Quantity::sigma, sigma), of_h = at(2, Quantity::h, h);
        const float* lengths = t_.floats(t_.survival);
        double length = 0;
        for (std::uint32_t i = 0; i < of_g.count; ++i)
            for (std::uint32_t j = 0; j < 4; ++j)
                for (std::uint32_t k = 0; k < 4; ++k)
                    length +=
                        of_g.w[i] * of_h.w[j] * of_sigma.w[k] *
                        double(lengths[(std::size_t(of_g.first + i) * t_.h.rows + of_h.first + j) * t_.sigma.rows +
                                       of_sigma.first + k]);
        return std::exp(-absorption * std::max(0.0, length));
    }
    double azimuthal(double sigma, double g, double h, double, double y) const override {
        const Point of_g = g_at(g), of_sigma = at(0, Quantity::sigma, sigma), of_h = at(2, Quantity::h, h);
        const double x = std::remainder(y, 2 * pi);
        const Point exit = at(4, Quantity::phi, std::abs(x));
        double sum = 0;
        for (std::uint32_t i = 0; i < of_g.count; ++i)
            for (std::uint32_t j = 0; j < 4; ++j)
                for (std::uint32_t k = 0; k < 4; ++k) {
                    const std::size_t plane = std::size_t(of_g.first + i) * t_.h.rows + of_h.first + j;
                    const float* row = t_.floats(t_.azimuthal) +
                                       (plane * 2 + (x < 0 ? 1 : 0)) * t_.phi.rows * t_.sigma.rows + of_sigma.first + k;
                    sum += of_g.w[i] * of_h.w[j] * of_sigma.w[k] * spline(exit, row, t_.sigma.rows);
                }
        return sum;
    }
    double longitudinal(Side side, double sigma, double g, double theta_i, double theta_r) const override {
        const Point of_g = g_at(g), of_sigma = at(0, Quantity::sigma, sigma),
                    of_theta = at(3, Quantity::theta_i, theta_i), exit = at(5, Quantity::theta_r, std::abs(theta_r));
        const std::uint32_t lines = t_.longitudinal_side();
        const float* rows = t_.floats(t_.longitudinal) + (side == Side::forward ? lines : 0);
        double sum = 0;
        for (std::uint32_t j = 0; t_.one_material && j < 4; ++j)
            sum += of_theta.w[j] *
                   spline(exit, rows + (theta_r < 0 ? 1 : 0) * t_.theta_r.rows * 2 * lines + of_theta.first + j,
                          2 * lines);
        if (t_.one_material) return sum;
        for (std::uint32_t i = 0; i < of_g.count; ++i)
            for (std::uint32_t j = 0; j < 4; ++j)
                for (std::uint32_t k = 0; k < 4; ++k) {
                    const std::size_t plane = std::size_t(of_g.first + i) * t_.theta_i.rows + of_theta.first + j;
                    const float* row =
                        rows + (plane * 2 + (theta_r < 0 ? 1 : 0)) * t_.theta_r.rows * 2 * lines + of_sigma.first + k;
                    sum += of_g.w[i] * of_theta.w[j] * of_sigma.w[k] * spline(exit, row, 2 * lines);
                }
        return sum;
    }

  private:
    struct Point {
        std::uint32_t first, count;
        double w[4];
    };
    Point at(int axis, Quantity quantity, double value) const {
        const detail::AxisPlan& plan = plan_.axis[axis];
        const double c = std::min(plan.upper(), std::max(plan.lower(), spline_coordinate(quantity, value)));
        Point p = {0, 4, {}};
        while (p.first + 1 < plan.spans && c >= plan.knot(std::int32_t(p.first) + 1)) ++p.first;
        plan.weights(p.first, c, p.w);
        return p;
    }
    Point g_at(double g) const { return t_.g_rows == 1 ? Point{0, 1, {1, 0, 0, 0}} : at(1, Quantity::g, g); }
    /// The positive part of a row.
    static double spline(const Point& exit, const float* row, std::uint32_t stride) {
        double sum = 0;
        for (std::uint32_t k = 0; k < 4; ++k) sum += exit.w[k] * double(row[std::size_t(exit.first + k) * stride]);
        return std::max(0.0, sum);
    }
    const DenseTables& t_;
    detail::TablesPlan plan_;
};

struct Lobes {
    double M[all_lobe_count] = {}, N[all_lobe_count][3] = {};
};

/// Unpolarised sums as printed: R + (1-R)^2 R / (1-R^2), averaged over both polarisations of an interface of `index`
/// met at the angle gamma_i.
inline double cuticle_reflectance(double index, double gamma_i, double layers) {
    const double ci = std::cos(gamma_i), ct = std::sqrt(1 - std::pow(std::sin(gamma_i) / index, 2));
    double F1 = 0;
    const double r[2] = {(ci - index * ct) / (ci + index * ct), (index * ci - ct) / (index * ci + ct)};
    for (double x : r) {
        const double R = x * x;
        F1 += 0.5 * (R + (1 - R) * R / (1 + R));
    }
    return layers > 0 ? layers * F1 / (1 + (layers - 1) * F1) : 0;
}

inline double gaussian(double x, double s) { return std::exp(-x * x / (2 * s * s)) / (s * std::sqrt(2 * pi)); }

inline double truncated(double theta, double centre, double s) {
    const double r = std::sqrt(0.5) / s;
    const double mass = 0.5 * (std::erf((pi / 2 - centre) * r) - std::erf((-pi / 2 - centre) * r));
    return gaussian(theta - centre, s) / mass;
}

inline double wrapped(double x, double s) {
    double sum = 0;
    const double y = std::remainder(x, 2 * pi);
    for (int k = -20; k <= 20; ++k) sum += gaussian(y + 2 * pi * k, s);
    return sum;
}

/// Energy of the paths after TRT, crossing by crossing: of each, `scattered` leaves from the medulla and `through`
/// reaches the cuticle, where 1 - F of it leaves and F begins the next.
inline double residual_energy(double F, double scattered, double through) {
    double enters = 1 - F, sum = 0;
    for (int crossing = 1; crossing < 100000000; ++crossing) {
        const double leaves = enters * (scattered + (1 - F) * through);
        if (crossing > 2) sum += leaves;
        enters *= F * through;
        if (!(enters > 1e-17 * sum)) break;
    }
    return sum;
}

/// 1 - exp(-x)
inline double gone(double x) { return -std::expm1(-x); }

/// The corrected form: of the light that collides in the medulla and is not absorbed there, the share that leaves it.
inline double left_by_medulla(const FurParameters<3>& p) {
    const double kappa = double(p.kappa), ms = double(p.sigma_ms), ma = double(p.sigma_ma), narrow = 1 - double(p.g);
    const double tau = ms * kappa;
    const double path = kappa * (4 / 3.0 + 1.431 * tau + 2.898 * tau * tau) / (1 + 1.44 * tau + 1.449 * tau * tau);
    return ms / (ms + ma) * std::exp(-std::log1p(path * ma * narrow) / narrow);
}

/// The corrected form: the share of what left the medulla that leaves the fibre in the end, by the four directions of
/// docs/bcsdf.md, 'Escape and return'.
inline double escape(const FurParameters<3>& p, double sigma_ca) {
    const double eta = double(p.eta), kappa = double(p.kappa), ms = double(p.sigma_ms), all = ms + double(p.sigma_ma);
    const double offset[] = {0.57, 0.60, 0.51, 0.89}, place[] = {0.84, 0.12, 0.63, 0.99},
                 weight[] = {0.17, 0.83, 0.71, 0.29}, kept = left_by_medulla(p);
    double out = 0, sum = 0;
    for (int i = 0; i < 4; ++i) {
        const bool escapes = i < 2;
        const double widest = escapes ? std::min(kappa, 1 / eta) : kappa, b = widest * offset[i];
        const double cos_b = std::sqrt(1 - b * b), half = std::sqrt(kappa * kappa - b * b);
        const double critical = std::min(1.0, std::sqrt(1 - 1 / (eta * eta)) / cos_b), angle = std::acos(critical);
        const double zone = 0.5 * (angle + std::sin(angle) * critical);
        const double cos_theta = escapes ? 1 - (1 - critical) * place[i] : critical * place[i];
        const double F = escapes
                             ? cuticle_reflectance(eta, std::asin(eta * std::sqrt(1 - std::pow(cos_theta * cos_b, 2))),
                                                   double(p.layers))
                             : 1;
        const double chord = 2 * half / cos_theta, cortex = (cos_b - half) / cos_theta * sigma_ca;
        const double share = widest * weight[i] * (escapes ? zone : pi / 4 - zone) * gone(ms * chord) /
                             (1 - F * std::exp(-2 * cortex - all * chord));
        out += share * (1 - F) * std::exp(-cortex);
        sum += share * (1 - F + F * (gone(2 * cortex) + std::exp(-2 * cortex) * gone(all * chord) * (1 - kept)));
    }
    return out / sum;
}

/// The cross-section of a ray.
struct Ray {
    double sigma, absorption, h_medulla;  ///< where the medulla's tables are read; h < 0 on the other side
    double gamma_i, gamma_t;
    double scattered_share;       ///< E and what the medulla leaves of it; 0: no scattered lobes
    double A[all_lobe_count][3];  ///< energies
};

inline Ray trace(const FurParameters<3>& p, const Medulla* medulla, double theta_i, double h) {
    Ray ray = {};
    const double eta = double(p.eta), kappa = double(p.kappa), ms = double(p.sigma_ms), ma = double(p.sigma_ma);
    const double index = std::sqrt(eta * eta - std::pow(std::sin(theta_i), 2)) / std::cos(theta_i);
    const double cos_t = std::cos(std::asin(std::sin(theta_i) / eta)), inside = h / index;
    ray.gamma_i = std::asin(h), ray.gamma_t = std::asin(inside);
    const double s_m = std::sqrt(std::max(0.0, kappa * kappa - inside * inside)), s_c = std::cos(ray.gamma_t) - s_m;
    const double F =
        p.fresnel == Fresnel::exact
            ? cuticle_reflectance(eta, std::acos(std::cos(theta_i) * std::cos(ray.gamma_i)), double(p.layers))
            : cuticle_reflectance(index, ray.gamma_i, double(p.layers));
    const bool tabled = medulla != nullptr && medulla->absorbs();  // they know what it absorbs; else T_b has it
    const bool corrected = p.scattering == Scattering::corrected;
    if (medulla != nullptr && std::abs(inside) < kappa && ms > 0) {
        ray.sigma = ms * kappa / cos_t, ray.absorption = tabled ? ma * kappa / cos_t : 0;
        ray.h_medulla = std::min(1.0, std::abs(inside) / kappa);
        const bool first = corrected && !tabled;  // the medulla's absorption up to where light leaves it first
        ray.scattered_share = gone(2 * s_m * (first ? ms + ma : ms) / cos_t) * (first ? left_by_medulla(p) : 1);
        if (tabled) ray.scattered_share *= medulla->survival(ray.sigma, double(p.g), ray.h_medulla, ray.absorption);
    }
    for (int c = 0; c < 3; ++c) {
        const double ca = double(p.sigma_ca[c]),
                     T_b = !(ray.scattered_share > 0) ? 1
                           : corrected                ? escape(p, ca)
                                       : std::exp(-((tabled ? 0 : kappa * ma) + (1 - kappa) * ca) / cos_t);
        const double through = std::exp(-2 * (s_c * ca + s_m * (ma + ms)) / cos_t);
        const double share = std::exp(-s_c * ca / cos_t) * T_b * ray.scattered_share;
        ray.A[0][c] = F;
        for (int k = 1; k < 3; ++k) ray.A[k][c] = std::pow(1 - F, 2) * std::pow(F, k - 1) * std::pow(through, k);
        for (int k = 1; k < 3; ++k) ray.A[2 + k][c] = (1 - F) * std::pow(F * through, k - 1) * share;
        ray.A[5][c] = residual_energy(F, share, through);
    }
    return ray;
}

/// @param medulla null: no scattered lobes
inline Lobes near_lobes(const FurParameters<3>& p, const Medulla* medulla, double theta_i, double theta_r, double phi,
                        double h) {
    Lobes l;
    const Ray ray = trace(p, medulla, theta_i, h);
    const int lobes[4] = {0, 1, 2, 5};
    const double shift[4] = {1, -0.5, -1.5, -2.5}, rough[4] = {1, 0.5, 1.5, 2.5};  // Table 2, carried on
    double density[all_lobe_count] = {0, 0, 0, 0, 0, 0.5 / pi};
    for (int k = 0; k < 4; ++k)
        l.M[lobes[k]] = truncated(theta_r, -theta_i + shift[k] * double(p.alpha), rough[k] * double(p.beta_m));
    for (int k = 0; k < 3; ++k)
        density[k] =
            wrapped(phi - (2 * k * ray.gamma_t - 2 * ray.gamma_i + k * pi), std::sqrt(k + 1.0) * double(p.beta_n));
    if (medulla != nullptr && ray.scattered_share > 0) {
        const double side = h < 0 ? -1 : 1, tilt = theta_i < 0 ? -1 : 1, g = double(p.g);
        for (int k = 1; k <= 2; ++k) {
            const double centre = (ray.gamma_t - ray.gamma_i) + (k - 1) * (pi + 2 * ray.gamma_t);
            density[2 + k] =
                medulla->azimuthal(ray.sigma, g, ray.h_medulla, ray.absorption, side * (phi - centre - pi));
        }
        const double t = std::abs(std::remainder(phi, 2 * pi)) / pi;
        l.M[3] = l.M[4] = (1 - t) * medulla->longitudinal(Side::back, ray.sigma, g, tilt * theta_i, tilt * theta_r) +
                          t * medulla->longitudinal(Side::forward, ray.sigma, g, tilt * theta_i, tilt * theta_r);
    }
    for (int k = 0; k < all_lobe_count; ++k)
        for (int c = 0; c < 3; ++c) l.N[k][c] = ray.A[k][c] * density[k];
    return l;
}

}  // namespace reference
