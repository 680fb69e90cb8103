#include "sim3d/model/five_lobes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "medulla/config.hpp"
#include "sim2d/disc/deterministic.hpp"
#include "sim2d/quadrature.hpp"
#include "sim2d/slab/deterministic.hpp"
#include "sim3d/model/escape.hpp"

namespace medulla::sim3d {
namespace {

constexpr std::size_t fine = 1440;  // bins of N over phi, before the average over the requested bins
constexpr std::size_t per_bin = 8;  // of M over theta_r, likewise

/// Absorption coefficients of one channel.
struct Channel {
    double cortex, medulla;
    double escapes = 1;  ///< corrected form: share that leaves the fibre of what left the medulla
};

/// What depends on theta_i alone.
struct Section {
    Section(const Fibre& f, const ModelForm& form, double theta_i)
        : fibre(f), corrected(form.scattering == Scattering::corrected) {
        const double ci = std::cos(theta_i), eta = f.eta_c;
        prime = std::sqrt(eta * eta - std::pow(std::sin(theta_i), 2)) / ci;
        cos_t = std::sqrt(1 - std::pow(std::sin(theta_i) / eta, 2));
        const bool exact = form.reflectance == Reflectance::exact;
        tilt = exact ? ci : 1, index = exact ? eta : prime;
        if (!corrected) return;
        const auto with = [&](double sigma_ma) {
            Fibre g = f;
            g.sigma_ma = sigma_ma;
            return g;
        };
        kept = left_by_medulla(f);
        for (const double sigma_ca : f.sigma_ca) escapes.push_back(escape(f, sigma_ca));
        // Minus the derivatives of the energy by sigma_ca and by sigma_ma, where both are 0.
        const double step = 1e-6;
        cortex_return = (1 - escape(with(0), step)) / step;
        medulla_return = (1 - escape(with(step), 0) * left_by_medulla(with(step))) / step;
    }

    /// Eq. 13 at the offset h: index eta' in the cross-section, or eta at the cosine cos theta_i cos gamma_i.
    double F(double h) const {
        const double c = tilt * std::sqrt(1 - h * h), ct = std::sqrt(index * index - 1 + c * c);
        const double s = (c - ct) / (c + ct), p = (index * index * c - ct) / (index * index * c + ct);
        const double F1 = s * s / (1 + s * s) + p * p / (1 + p * p);
        return fibre.layers * F1 / (1 + (fibre.layers - 1) * F1);
    }

    bool meets_medulla(double h) const { return std::abs(h) < fibre.kappa * prime; }

    /// Adds `weight` times the energies and lengths at the offset h; returns those of TTs and TRTs per channel.
    std::vector<std::array<double, 2>> add(FiveLobes& lobes, double h, double weight) const {
        const double f = F(h), inside = h / prime;
        const double s_m = std::sqrt(std::max(0.0, fibre.kappa * fibre.kappa - inside * inside));
        const double s_c = std::sqrt(1 - inside * inside) - s_m, kappa = fibre.kappa;
        const auto energies = [&](const Channel& a, double* A) {
            const double left = std::exp(-2 * (s_c * a.cortex + s_m * (a.medulla + fibre.sigma_ms)) / cos_t);
            const double T_b = std::exp(-(kappa * a.medulla + (1 - kappa) * a.cortex) / cos_t);
            const double E = corrected ? -std::expm1(-2 * s_m * (fibre.sigma_ms + a.medulla) / cos_t)
                                       : -std::expm1(-2 * s_m * fibre.sigma_ms / cos_t);
            const double s = std::exp(-s_c * a.cortex / cos_t) * E * (corrected ? a.escapes : T_b);
            A[0] = f, A[1] = (1 - f) * (1 - f) * left, A[2] = A[1] * f * left;
            A[3] = meets_medulla(h) ? (1 - f) * s : 0, A[4] = A[3] * f * left;
            const double scatters = meets_medulla(h) ? s : 0;
            A[5] = f < 1 ? (1 - f) * f * f * left * left * (scatters + (1 - f) * left) / (1 - f * left) : 0;
        };
        std::vector<std::array<double, 2>> scattered;
        for (std::size_t c = 0; c < fibre.sigma_ca.size(); ++c) {
            double A[all_lobe_count];
            energies({fibre.sigma_ca[c], fibre.sigma_ma, corrected ? kept * escapes[c] : 1}, A);
            for (std::size_t k = 0; k < all_lobe_count; ++k) lobes.energy[c][k] += weight * A[k];
            scattered.push_back({weight * A[3], weight * A[4]});
        }
        double A[all_lobe_count];
        energies({0, 0}, A);
        for (std::size_t k = 0; k < all_lobe_count; ++k) lobes.white[k] += weight * A[k];
        const double both = A[3] + A[4];
        const double crossed = std::exp(-2 * s_m * fibre.sigma_ms / cos_t);  // E falls by its slope along the chord
        const double before = crossed < 1 ? -2 * s_m / cos_t * crossed / (1 - crossed) : 0;
        const double cortex = corrected ? cortex_return : (1 - kappa) / cos_t,
                     medulla = corrected ? medulla_return + before : kappa / cos_t;
        lobes.cortex_length += weight * (both * (s_c / cos_t + cortex) + A[4] * 2 * s_c / cos_t);
        lobes.medulla_length += weight * (both * medulla + A[4] * 2 * s_m / cos_t);
        return scattered;
    }

    const Fibre& fibre;
    double prime, cos_t;

  private:
    bool corrected;
    double tilt, index;
    double kept = 1, cortex_return = 0, medulla_return = 0;
    std::vector<double> escapes;  ///< [channel]
};

struct Offset {
    std::size_t range;
    double h, weight;
};

/// Nodes of every range. h = sin t takes the roots at the rim away; the medulla's edge splits a range, and the nodes
/// lie denser below it.
std::vector<Offset> offsets_of(const std::vector<OffsetRange>& ranges, double edge) {
    std::vector<Offset> offsets;
    for (std::size_t k = 0; k < ranges.size(); ++k) {
        const OffsetRange r = ranges[k];
        if (r.low == r.high) {
            offsets.push_back({k, r.low, 1});
            continue;
        }
        const double split = std::clamp(edge, r.low, r.high);
        const int count = std::clamp(static_cast<int>(std::ceil(48 * (r.high - r.low))), 8, 48);
        const sim2d::Quadrature rule = sim2d::unit_gauss_legendre(count);
        for (const auto& [low, high] : {std::pair{r.low, split}, std::pair{split, r.high}}) {
            const double a = std::asin(low), b = std::asin(high);
            const bool dense = high == edge && high < 1;
            for (std::size_t i = 0; i < rule.nodes.size() && high > low; ++i) {
                const double u = rule.nodes[i], t = a + (b - a) * (dense ? 1 - (1 - u) * (1 - u) : u);
                const double slope = dense ? 2 * (1 - u) : 1;
                const double weight = std::cos(t) * (b - a) * slope * rule.weights[i] / (r.high - r.low);
                offsets.push_back({k, std::sin(t), weight});
            }
        }
    }
    return offsets;
}

/// M^s over theta_r: [Longitudinal][back, forward][bin], each of integral 1.
using Sides = std::array<std::array<std::vector<double>, 2>, longitudinal_count>;
Sides longitudinal(const Fibre& f, double cos_t, double theta_i, std::size_t theta_bins) {
    Sides M;
    const sim2d::SlabSolver solver(f.g);
    for (const std::size_t authors : {0u, 1u}) {
        const double depth = f.sigma_ms * f.kappa / (authors ? 1 : cos_t);
        const auto slab = solver.solve(depth, {theta_i}, theta_bins * per_bin)[0];
        for (const std::size_t side : {0u, 1u}) {
            const std::vector<double>& lobe = (side == 0 ? slab.back : slab.forward).lobe;
            std::vector<double> plain(theta_bins, 0.0), cosine(theta_bins, 0.0);
            double sum = 0, cosine_sum = 0;
            for (std::size_t i = 0; i < lobe.size(); ++i) {
                const double c = std::cos(((double(i) + 0.5) / double(lobe.size()) - 0.5) * pi);
                plain[i / per_bin] += lobe[i], cosine[i / per_bin] += lobe[i] * c;
                sum += lobe[i], cosine_sum += lobe[i] * c;
            }
            for (double& x : plain) x /= sum * pi / double(theta_bins);
            for (double& x : cosine) x /= cosine_sum * pi / double(theta_bins);
            M[authors][side] = std::move(plain), M[2 + authors][side] = std::move(cosine);
        }
    }
    return M;
}

/// Adds a lobe turned by `centre` [radians] to N.
void add_turned(std::vector<double>& N, const std::vector<double>& lobe, double centre, double energy) {
    const double shift = centre / (2 * pi) * double(fine), whole = std::floor(shift), part = shift - whole;
    const auto n = static_cast<long>(fine), first = (static_cast<long>(whole) % n + n) % n;
    for (long b = 0; b < n; ++b) {
        const double value = energy * lobe[static_cast<std::size_t>(b)];
        N[static_cast<std::size_t>((b + first) % n)] += value * (1 - part);
        N[static_cast<std::size_t>((b + first + 1) % n)] += value * part;
    }
}

}  // namespace

Fibre fibre_of(const FurParameters<3>& p, std::size_t channels) {
    Fibre f;
    f.eta_c = double(p.eta), f.kappa = double(p.kappa), f.layers = double(p.layers), f.g = double(p.g);
    f.alpha = double(p.alpha), f.beta_m = double(p.beta_m), f.beta_n = double(p.beta_n);
    f.sigma_ma = double(p.sigma_ma), f.sigma_ms = double(p.sigma_ms);
    f.sigma_ca.clear();
    for (std::size_t c = 0; c < channels; ++c) f.sigma_ca.push_back(double(p.sigma_ca[c]));
    return f;
}

ModelForm form_of(const FurParameters<3>& p) {
    return {p.fresnel == Fresnel::exact ? Reflectance::exact : Reflectance::bravais, p.scattering};
}

std::vector<FiveLobes> five_lobes(const Fibre& f, const ModelForm& form, double theta_i,
                                  const std::vector<OffsetRange>& ranges, std::size_t theta_bins,
                                  std::size_t phi_bins) {
    const Section section(f, form, theta_i);
    const std::size_t channels = f.sigma_ca.size();
    FiveLobes empty;
    empty.form = form.scattering;
    empty.energy.assign(channels, {}), empty.scattered.assign(channels, {});
    for (auto& channel : empty.scattered)
        for (DirectionalDensity& d : channel) {
            d.theta_bins = theta_bins, d.phi_bins = phi_bins;
            d.value.assign(theta_bins * phi_bins, 0.0);
        }
    std::vector<FiveLobes> all(ranges.size(), empty);

    const std::vector<Offset> offsets = offsets_of(ranges, std::min(1.0, f.kappa * section.prime));
    const double sigma = f.sigma_ms * f.kappa / section.cos_t;
    std::vector<double> scattering;  // offsets of C^N
    for (const Offset& o : offsets)
        if (section.meets_medulla(o.h)) scattering.push_back(o.h / section.prime / f.kappa);
    std::vector<sim2d::Profile> lobes;
    if (sigma > 0 && !scattering.empty()) lobes = sim2d::DiscSolver(f.g).solve(sigma, scattering, fine);

    std::vector<std::vector<double>> N(ranges.size() * channels, std::vector<double>(fine, 0.0));
    std::size_t next = 0;
    for (const Offset& o : offsets) {
        const auto energy = section.add(all[o.range], o.h, o.weight);
        if (lobes.empty() || !section.meets_medulla(o.h)) continue;
        const sim2d::Profile& lobe = lobes[next++];
        const double gamma_i = std::asin(o.h), gamma_t = std::asin(o.h / section.prime);
        for (std::size_t p : {0u, 1u})
            for (std::size_t c = 0; c < channels; ++c)
                add_turned(N[o.range * channels + c], lobe.lobe,
                           gamma_t - gamma_i + double(p) * (pi + 2 * gamma_t) + pi, energy[c][p]);
    }
    if (lobes.empty()) return all;

    const Sides M = longitudinal(f, section.cos_t, theta_i, theta_bins);
    for (std::size_t r = 0; r < ranges.size(); ++r)
        for (std::size_t c = 0; c < channels; ++c) {
            // Shares of each bin of phi that go with M back and M forward (Eq. 19).
            std::vector<std::array<double, 2>> shares(phi_bins, {0, 0});
            for (std::size_t b = 0; b < fine; ++b) {
                const double forward = std::abs(((double(b) + 0.5) / double(fine) - 0.5) * 2);
                const double share = N[r * channels + c][b] * double(phi_bins) / double(fine);
                std::array<double, 2>& bin = shares[b * phi_bins / fine];
                bin[0] += share * (1 - forward), bin[1] += share * forward;
            }
            for (std::size_t k = 0; k < longitudinal_count; ++k)
                for (std::size_t t = 0; t < theta_bins; ++t)
                    for (std::size_t b = 0; b < phi_bins; ++b)
                        all[r].scattered[c][k].value[t * phi_bins + b] =
                            shares[b][0] * M[k][0][t] + shares[b][1] * M[k][1][t];
        }
    return all;
}

void fold(std::vector<double>& rows, std::size_t phi_bins) {
    for (std::size_t row = 0; row < rows.size(); row += phi_bins)
        for (std::size_t b = 0; b < phi_bins / 2; ++b) {
            double &one = rows[row + b], &other = rows[row + phi_bins - 1 - b];
            one = other = 0.5 * (one + other);
        }
}

DirectionalDensity folded(DirectionalDensity d) {
    fold(d.value, d.phi_bins);
    d.error.clear();  // only errors of independent values could be combined
    return d;
}

DirectionalDensity marginal(const DirectionalDensity& d, bool over_phi) {
    DirectionalDensity m;
    m.theta_bins = over_phi ? 1 : d.theta_bins, m.phi_bins = over_phi ? d.phi_bins : 1;
    m.value.assign(m.theta_bins * m.phi_bins, 0.0);
    const double bins = double(d.value.size()) / double(m.value.size());
    for (std::size_t i = 0; i < d.value.size(); ++i)
        m.value[over_phi ? i % d.phi_bins : i / d.phi_bins] += d.value[i] / bins;
    return m;
}

DirectionalDensity product_of_marginals(const DirectionalDensity& d) {
    const DirectionalDensity phi = marginal(d, true), theta = marginal(d, false);
    double mean = 0;
    for (const double x : theta.value) mean += x / double(theta.value.size());
    DirectionalDensity p = d;
    for (std::size_t i = 0; i < p.value.size() && mean > 0; ++i)
        p.value[i] = theta.value[i / d.phi_bins] * phi.value[i % d.phi_bins] / mean;
    return p;
}

}  // namespace medulla::sim3d
