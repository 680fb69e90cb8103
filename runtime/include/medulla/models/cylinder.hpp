// Light in a smooth dielectric cylinder that absorbs evenly: what the hair models since Marschner et al. 2003 share.
// Energies A_p of the paths with p crossings, exits Phi_p, and hits made of them: lobes A_p M_p D_p at one offset, or
// their mean over the fibre's width. Rests on cross_section.hpp; one bare interface, where fur has layers.
#pragma once

#include <cstddef>

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/models/hit.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {

/// What an inclination decides for the whole cross-section.
template <int Channels>
struct Cylinder {
    Inclination<float> at;
    float crossing[std::size_t(Channels)];  ///< 2 sigma_a / cos theta_t: times cos gamma_t the length of a crossing
};

/// @param cos_i cosine of the inclination, > 0
template <int Channels>
MEDULLA_FN Cylinder<Channels> cylinder(float eta, const float (&sigma_a)[std::size_t(Channels)], float cos_i) noexcept {
    Cylinder<Channels> c;
    c.at = inclination(eta, cos_i, Fresnel::exact);
    for (int k = 0; k < Channels; ++k) c.crossing[k] = 2 * sigma_a[k] * c.at.inverse_cos_t;
    return c;
}

/// A ray at offset h, or several side by side.
template <class T>
struct Chord {
    T gamma_i, gamma_t, cos_t;  ///< [radians]; cos gamma_t
    Cuticle<T> cuticle;         ///< reflectance and transmittance of the bare interface
};

/// @param cos_h sqrt(1 - h^2)
template <class T>
MEDULLA_FN Chord<T> chord(const Inclination<float>& at, T h, T cos_h) noexcept {
    const T x = square_root(T(at.index_excess) + cos_h * cos_h);
    const T sin_t = h * T(at.inverse_index), cos_t = x * T(at.inverse_index);
    const T scale = T(at.fresnel_scale);
    return {angle(h, cos_h), angle(sin_t, cos_t), cos_t,
            bare_interface(at.fresnel_index_excess, scale * cos_h, scale * x)};
}

/// A_0 = F, A_p = (1 - F)^2 F^(p-1) T^p; with a tail the last one is the sum of A_p from there on, (1 - F) F^(p-1) T^p
/// q, q = (1 - F) / ((1 - F) + F (1 - T)).
template <int Channels, int Lobes, class T>
MEDULLA_FN void order_energies(const Cylinder<Channels>& c, const Chord<T>& ray, bool tail,
                               T (&A)[std::size_t(Lobes)][std::size_t(Channels)]) noexcept {
    const T F = ray.cuticle.F, passed = ray.cuticle.T_;
    T left[std::size_t(Channels)];
    for (int k = 0; k < Channels; ++k) left[k] = -T(c.crossing[k]) * ray.cos_t;
    T depth[std::size_t(Channels)];
    for (int k = 0; k < Channels; ++k) depth[k] = -left[k];
    exponentials(left);
    for (int k = 0; k < Channels; ++k) {
        A[0][k] = F;
        T a = passed * passed * left[k];
        for (int p = 1; p < Lobes; ++p) {
            A[p][k] = a;
            a = a * F * left[k];
        }
        if (!tail) continue;
        // Nothing enters where F = 1.
        const T stays = passed + F * absorbed(depth[k], left[k]);
        const auto some = stays > T(0.0f);
        A[Lobes - 1][k] = choose(some, A[Lobes - 1][k] / choose(some, stays, T(1.0f)), T(0.0f));
    }
}

/// Phi_p of a lobe; of a tail, which is even, 0.
template <class T>
MEDULLA_FN T centre_of(int p, const Chord<T>& ray) noexcept {
    return unscattered_centre(p, ray.gamma_i, ray.gamma_t);
}

/// The shifts and widths of Yan et al. 2017, Table 2, in units of alpha and beta_m, carried on to any p: 1, -1/2, -3/2,
/// -5/2 ..; 1, 1/2, 3/2, 5/2 ..
MEDULLA_FN float shift_of(int p) noexcept { return p == 0 ? 1.0f : 0.5f - float(p); }
MEDULLA_FN float width_of(int p) noexcept { return p == 0 ? 1.0f : float(p) - 0.5f; }

/// A truncated Gaussian along the fibre, with the interface of VonMisesFisher.
struct GaussianAlong {
    TruncatedGaussian<float> gaussian;
    /// Density per unit of sin theta.
    MEDULLA_FN float density(float theta, float cosine) const noexcept { return gaussian.pdf(theta) / cosine; }
    MEDULLA_FN float draw(float u, float) const noexcept { return sample(gaussian, u); }
};

/// Shares of lobes in all energy, averaged over channels. @return their energy
template <int Channels, int Lobes, class T>
MEDULLA_FN void lobe_shares(const T (&A)[std::size_t(Lobes)][std::size_t(Channels)],
                            T (&share)[std::size_t(Lobes)]) noexcept {
    T sum = T(1e-30f);
    for (int p = 0; p < Lobes; ++p) {
        share[p] = A[p][0];
        for (int c = 1; c < Channels; ++c) share[p] = share[p] + A[p][c];
        sum = sum + share[p];
    }
    const T inverse = T(1.0f) / sum;
    for (T& s : share) s = s * inverse;
}

}  // namespace detail

namespace models {

/// sum over lobes of A M D at one offset. Along and Around are the kinds of M and D; a last, even lobe has no D.
template <int Channels, int Lobes, class Along, class Around>
struct CylinderHit : Hit<CylinderHit<Channels, Lobes, Along, Around>, Channels> {
    Along M[std::size_t(Lobes)] = {};
    Around D[std::size_t(Lobes)] = {};
    float A[std::size_t(Lobes)][std::size_t(Channels)] = {}, share[std::size_t(Lobes)] = {};
    float centre[std::size_t(Lobes)] = {};  ///< Phi_p [radians]
    bool tail = false;                      ///< whether the last lobe is even in azimuth

    /// @param m has eta, sigma_a, tail, along(lobe, theta_i) -> M and around(lobe) -> D
    template <class Model>
    MEDULLA_FN CylinderHit(const Model& m, const Known& direction, float h) noexcept : tail(m.tail) {
        using namespace detail;
        h = clamp_offset(h);
        if (!detail::within(h, 1.0f) || !this->begin(m, direction)) return;
        const Cylinder<Channels> c = cylinder<Channels>(m.eta, m.sigma_a, this->known.cosine);
        const Chord<float> ray = chord(c.at, h, detail::math::sqrt((1 - h) * (1 + h)));
        order_energies<Channels, Lobes>(c, ray, tail, A);
        lobe_shares<Channels, Lobes>(A, share);
        for (int p = 0; p < Lobes; ++p) {
            M[p] = m.along(p, this->known_theta);
            if (tail && p == Lobes - 1) continue;
            centre[p] = centre_of(p, ray), D[p] = m.around(p);
        }
    }

    /// Share of the light that leaves, over all directions.
    MEDULLA_FN Colour<Channels> albedo() const noexcept {
        Colour<Channels> sum;
        for (int p = 0; this->known.cosine > 0 && p < Lobes; ++p)
            for (int c = 0; c < Channels; ++c) sum[c] += A[p][c];
        return sum;
    }

    MEDULLA_FN Evaluation<Channels> at(float theta, float cosine, float phi) const noexcept {
        Evaluation<Channels> e;
        for (int p = 0; p < Lobes; ++p) {
            const bool even = tail && p == Lobes - 1;
            const float x = M[p].density(theta, cosine) * (even ? float(0.5 / pi) : D[p].pdf(phi - centre[p]));
            e.pdf += x * share[p];
            for (int c = 0; c < Channels; ++c) e.value[c] += x * A[p][c];
        }
        return e;
    }
    MEDULLA_FN Exit draw(RandomNumbers u) const noexcept {
        const int p = detail::draw_of<Lobes>(share, u.lobe);
        if (p < 0) return {};
        const bool even = tail && p == Lobes - 1;
        const float turn = even ? float(pi) * (2 * u.azimuth - 1) : centre[p] + sample(D[p], u.azimuth);
        return {p < 3 ? p : int(Lobe::residual), M[p].draw(u.longitude, u.rows), turn};
    }
};

/// The mean of such hits over h in [-1, 1], D being wrapped Gaussians. The midpoint rule in s, h = sin((pi / 4)(3 s -
/// s^3)): at the rim, where Phi_p is steep in h, the integrand and two of its derivatives are 0, and elsewhere nodes
/// lie 1.2 deviations of an exit apart or closer, where the rule's error on a Gaussian is 2 exp(-2 (pi / 1.2)^2) =
/// 2e-6.
template <int Channels, int Lobes, class Along>
struct CylinderMean : Hit<CylinderMean<Channels, Lobes, Along>, Channels> {
    Along M[std::size_t(Lobes)] = {};
    detail::WrappedGaussian<float> D[std::size_t(Lobes)] = {};
    detail::Cylinder<Channels> cylinder = {};
    bool tail = false;
    int nodes = 0;  ///< a multiple of 4

    template <class Model>
    MEDULLA_FN CylinderMean(const Model& m, const Known& direction) noexcept : tail(m.tail) {
        if (!this->begin(m, direction)) return;
        cylinder = detail::cylinder<Channels>(m.eta, m.sigma_a, this->known.cosine);
        float most = 20;  // nodes over 3 pi / 4 of gamma_i, that A itself needs
        for (int p = 0; p < Lobes; ++p) {
            M[p] = m.along(p, this->known_theta), D[p] = m.around(p);
            // |d Phi_p / d gamma_i| is 2 at the rim and |2 p / eta' - 2| at the axis.
            if (tail && p == Lobes - 1) continue;
            const float slope = detail::greater(2.0f, 2 * float(p) * cylinder.at.inverse_index - 2);
            most = detail::greater(most, slope / (1.2f * D[p].deviation));
        }
        nodes = 4 * int(detail::math::ceil(0.25f * float(3 * pi / 2) * most));
    }

    MEDULLA_FN Evaluation<Channels> at(float theta, float cosine, float phi) const noexcept {
        using namespace detail;
        Four N[std::size_t(Lobes)][std::size_t(Channels)], probability[std::size_t(Lobes)];
        visit(phi, [&](int p, Four weight, const Four(&A)[std::size_t(Channels)], Four share) {
            for (int c = 0; c < Channels; ++c) N[p][c] = N[p][c] + weight * A[c];
            probability[p] = probability[p] + weight * share;
        });
        Evaluation<Channels> e;
        for (int p = 0; p < Lobes; ++p) {
            const float x = M[p].density(theta, cosine);
            e.pdf += x * sum_of(probability[p]);
            for (int c = 0; c < Channels; ++c) e.value[c] += x * sum_of(N[p][c]);
        }
        return e;
    }
    /// N_p at phi [1 / radian].
    MEDULLA_FN Colour<Channels> azimuthal(int lobe, float phi) const noexcept {
        using namespace detail;
        Four N[std::size_t(Channels)];
        visit(phi, [&](int p, Four weight, const Four(&A)[std::size_t(Channels)], Four) {
            for (int c = 0; p == lobe && c < Channels; ++c) N[c] = N[c] + weight * A[c];
        });
        Colour<Channels> sum;
        for (int c = 0; c < Channels; ++c) sum[c] = sum_of(N[c]);
        return sum;
    }
    MEDULLA_FN Exit draw(RandomNumbers u) const noexcept {
        using namespace detail;
        const float h = clamp_offset(2 * u.offset - 1), cos_h = 2 * math::sqrt(u.offset * (1 - u.offset));
        const Chord<float> ray = chord(cylinder.at, h, cos_h);
        float A[std::size_t(Lobes)][std::size_t(Channels)], share[std::size_t(Lobes)];
        order_energies<Channels, Lobes>(cylinder, ray, tail, A);
        lobe_shares<Channels, Lobes>(A, share);
        const int p = draw_of<Lobes>(share, u.lobe);
        if (p < 0) return {};
        const bool even = tail && p == Lobes - 1;
        const float turn = even ? float(pi) * (2 * u.azimuth - 1) : centre_of(p, ray) + detail::sample(D[p], u.azimuth);
        return {p < 3 ? p : int(Lobe::residual), M[p].draw(u.longitude, u.rows), turn};
    }

  private:
    /// Calls use(lobe, weight times D, A, share) for four offsets at a time.
    template <class Use>
    MEDULLA_FN void visit(float phi, Use&& use) const noexcept {
        using namespace detail;
        const float step = 2.0f / float(nodes);
        for (int i = 0; i < nodes; i += 4) {
            const Four s = Four(-1.0f) + Four(step) * (Four(float(i)) + Four(0.5f, 1.5f, 2.5f, 3.5f));
            const Four gamma = Four(float(pi / 4)) * s * (Four(3.0f) - s * s);
            const auto at = sine_cosine(gamma);
            const Chord<Four> ray = chord(cylinder.at, at.sine, at.cosine);
            Four A[std::size_t(Lobes)][std::size_t(Channels)], share[std::size_t(Lobes)];
            order_energies<Channels, Lobes>(cylinder, ray, tail, A);
            lobe_shares<Channels, Lobes>(A, share);
            // dh / 2
            const Four weight = Four(0.375f * float(pi) * step) * (Four(1.0f) - s * s) * at.cosine;
            for (int p = 0; p < Lobes; ++p) {
                const bool even = tail && p == Lobes - 1;
                use(p, weight * (even ? Four(float(0.5 / pi)) : D[p].pdf_of(Four(phi) - centre_of(p, ray))), A[p],
                    share[p]);
            }
        }
    }
};

}  // namespace models
}  // namespace MEDULLA_TARGET
}  // namespace medulla
