// From pigments, from physical units and from a wanted colour to the absorption of the cortex.
// Rests on detail/cross_section.hpp: the energies of the lobes say how bright a fibre is, medulla and surface counted;
// docs/integrations.md, 'Colour', derives the albedo of a coat, and bench_coat_colour measures its error.
#pragma once

#include "medulla/config.hpp"
#include "medulla/detail/cross_section.hpp"
#include "medulla/detail/escape.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/fur_parameters.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// Absorption of a concentration 1 of each pigment in linear sRGB [1 / fibre radius]: d'Eon et al. 2011, 'An
/// Energy-Conserving Hair Reflectance Model'. Human hair has concentrations of about 0.3 (blond), 1.3 (brown), 8
/// (black).
inline constexpr float eumelanin_absorption[3] = {0.419f, 0.697f, 1.37f};
inline constexpr float pheomelanin_absorption[3] = {0.187f, 0.4f, 1.05f};

/// Writes sigma_ca [1 / fibre radius]. @param eumelanin, pheomelanin concentrations, >= 0
MEDULLA_FN void set_melanin(FurParameters<3>& parameters, float eumelanin, float pheomelanin) noexcept {
    for (int c = 0; c < 3; ++c)
        parameters.sigma_ca[c] = eumelanin * eumelanin_absorption[c] + pheomelanin * pheomelanin_absorption[c];
}

/// A coefficient [1 / mm] in a fibre of this diameter [micrometres], as [1 / fibre radius].
MEDULLA_FN float per_radius(float per_millimetre, float diameter_micrometres) noexcept {
    return per_millimetre * diameter_micrometres * 0.0005f;
}
/// A length [micrometres] as [fibre radii].
MEDULLA_FN float in_radii(float micrometres, float diameter_micrometres) noexcept {
    return 2 * micrometres / diameter_micrometres;
}

enum class ColourStatus {
    ok,
    too_bright,      ///< a fibre of these parameters does not get there: sigma_ca is 0, which comes nearest
    too_dark,        ///< what the surface reflects alone is brighter: sigma_ca is largest_sigma_ca
    bad_colour,      ///< not in [0, 1]; sigma_ca is 0
    bad_parameters,  ///< out of their ranges; sigma_ca is 0
};

inline const char* describe(ColourStatus status) noexcept {
    switch (status) {
        case ColourStatus::ok:
            return "ok";
        case ColourStatus::too_bright:
            return "brighter than this fibre is without absorption in its cortex";
        case ColourStatus::too_dark:
            return "darker than what the surface of this fibre reflects";
        case ColourStatus::bad_colour:
            return "a colour is in [0, 1]";
        case ColourStatus::bad_parameters:
            return "the fibre's parameters are out of their ranges";
    }
    return "unknown status";
}

namespace detail {

/// Of a white sky, what a half-space of fibres in all directions returns, which is a medium with this albedo and mean
/// cosine for every scattering. The form is van de Hulst's (1980, 'Multiple Light Scattering'), of one similarity
/// parameter s; the constants are those that make both ends exact for isotropic scattering: the slope -4 / sqrt(3) at
/// s = 0, and 2/3 (1 - log 2) of the albedo at s = 1. His own (0.139, 1.17) are 3 % too low there.
MEDULLA_FN float half_space_albedo(float albedo, float mean_cosine) noexcept {
    const float lost = albedo < 1 ? 1 - albedo : 0.0f;
    const float s = detail::math::sqrt(lost / (1 - albedo * mean_cosine));
    return (1 - s) * (1 - 0.0935f * s) / (1 + 1.2159f * s);
}

}  // namespace detail

/// Absorption that leaves a cortex black: the surface alone is left.
inline constexpr float largest_sigma_ca = 64;

/// What fibres of one material return of a white sky, by their sigma_ca: one strand alone, and a coat too thick to see
/// through. The coat's fibres lie in all directions; docs/integrations.md says what parallel ones return.
/// 4 KB, 16 us to make, 2 us an albedo: for a material or a texture's table, not for every hit.
class FibreAlbedo {
  public:
    /// @param p its sigma_ca is not read
    template <int Channels>
    MEDULLA_FN explicit FibreAlbedo(const FurParameters<Channels>& p) noexcept {
        // Even light meets a fibre in proportion to cos theta: weights cos^2 theta, which Chebyshev's second rule has.
        // gamma_i instead of h: Fresnel's rise at the rim is a root in h and smooth in gamma_i.
        for (int i = 0; i < inclinations; ++i)
            for (int k = 0; k < offsets; ++k) set(p, i, k, nodes_[i * offsets + k]);
        // Mean cosine of what a medulla scatters, over all directions of the light, by its optical radius for
        // transport: fitted to near fields of the default pack, 440 random fibres, standard deviation 0.015.
        p_.eta = p.eta, p_.kappa = p.kappa, p_.layers = p.layers, p_.g = p.g, p_.scattering = p.scattering;
        p_.sigma_ms = p.sigma_ms, p_.sigma_ma = p.sigma_ma;
        const float g = p.g, t = 1 / (1 + p.sigma_ms * p.kappa * (1 - g));
        scattered_cosine_ =
            -0.4506f + t * (1.3747f - 1.052f * t) + g * (0.1913f - 0.2052f * g + t * (-0.4544f + 1.5262f * t));
    }

    /// Of one strand.
    MEDULLA_FN float strand(float sigma_ca) const noexcept { return at(sigma_ca).energy; }

    /// Of a coat.
    MEDULLA_FN float fur(float sigma_ca) const noexcept {
        const Light light = at(sigma_ca);
        return detail::half_space_albedo(light.energy, light.forward / light.energy);
    }

  private:
    static constexpr int inclinations = 6, offsets = 16;

    /// One ray. Exponents are per unit of sigma_ca.
    struct Node {
        float weight, F;
        float through, through_length;      ///< what one crossing of the fibre leaves unscattered
        float scattered, scattered_length;  ///< what one crossing scatters out of the fibre
        float cosine[3];                    ///< mean cosine between R, TT, TRT and the light's travel
        float residual_cosine;
    };
    struct Light {
        float energy;   ///< returned, of 1
        float forward;  ///< energy times mean cosine
    };

    template <int Channels>
    MEDULLA_FN static void set(const FurParameters<Channels>& p, int i, int k, Node& node) noexcept {
        const float angle = float(pi) * float(i + 1) / float(2 * inclinations + 1);
        const float sin_i = detail::math::cos(angle), cos_i = detail::math::sin(angle);
        const float step = float(pi / 2) / float(offsets), gamma = step * (float(k) + 0.5f);
        node.weight = float(4 / (2 * inclinations + 1.0)) * cos_i * cos_i *
                      (detail::math::sin(step * float(k + 1)) - detail::math::sin(step * float(k)));
        const detail::Inclination<float> at = detail::inclination(p.eta, cos_i, p.fresnel);
        const detail::Path<float> path =
            detail::trace(at, p.kappa, p.layers, detail::math::sin(gamma), detail::math::cos(gamma));
        const bool corrected = p.scattering == Scattering::corrected;
        const float chord = 2 * path.s_m * at.inverse_cos_t;
        node.F = path.cuticle.F;
        node.through = detail::math::exp(-2 * path.s_m * (p.sigma_ms + p.sigma_ma) * at.inverse_cos_t);
        node.through_length = 2 * path.s_c * at.inverse_cos_t;
        node.scattered = corrected ? -detail::math::expm1(-chord * (p.sigma_ms + p.sigma_ma)) *
                                         detail::left_by_medulla(p.kappa, p.sigma_ms, p.sigma_ma, p.g)
                                   : -detail::math::expm1(-chord * p.sigma_ms) *
                                         detail::math::exp(-p.kappa * p.sigma_ma * at.inverse_cos_t);
        node.scattered_length = (corrected ? path.s_c : path.s_c + 1 - p.kappa) * at.inverse_cos_t;
        const float shift[3] = {1, -0.5f, -1.5f}, rough[3] = {1, 0.5f, 1.5f};
        for (int lobe = 0; lobe < 3; ++lobe) {
            const float m = rough[lobe] * p.beta_m;
            const float along = detail::math::cos(shift[lobe] * p.alpha) * detail::math::exp(-0.5f * m * m);
            const float across = detail::math::exp(-0.5f * float(lobe + 1) * p.beta_n * p.beta_n) *
                                 detail::math::cos(detail::unscattered_centre(lobe, path.gamma_i, path.gamma_t));
            node.cosine[lobe] = along * (sin_i * sin_i - cos_i * cos_i * across);
        }
        const float m = 2.5f * p.beta_m;
        node.residual_cosine = detail::math::cos(2.5f * p.alpha) * detail::math::exp(-0.5f * m * m) * sin_i * sin_i;
    }

    /// Share of the scattered light that leaves, where T_b does not have it.
    MEDULLA_FN float escape(float sigma_ca) const noexcept {
        if (p_.scattering == Scattering::published || !(p_.kappa > 0 && p_.sigma_ms > 0)) return 1;
        const float channel[4] = {sigma_ca};
        detail::ScatteredEnergy<4> energy;
        detail::set_corrected(p_, channel, false, energy);
        return energy.escape[0];
    }

    MEDULLA_FN Light at(float sigma_ca) const noexcept {
        Light sum = {0, 0};
        const float escapes = escape(sigma_ca);
        for (const Node& n : nodes_) {
            const float T = 1 - n.F, through = n.through * detail::math::exp(-n.through_length * sigma_ca);
            const float scattered = escapes * n.scattered * detail::math::exp(-n.scattered_length * sigma_ca);
            const float TT = T * T * through, TRT = TT * n.F * through;
            const float TTs = T * scattered, TRTs = TTs * n.F * through;
            // Energies of detail/cross_section.hpp, whose exponents in sigma_ca are kept apart here.
            const float inside = T * n.F * n.F * through * through;
            const float residual = inside > 0 ? inside * (T * through + scattered) / (1 - n.F * through) : 0.0f;
            sum.energy += n.weight * (n.F + TT + TRT + TTs + TRTs + residual);
            sum.forward += n.weight * (n.F * n.cosine[0] + TT * n.cosine[1] + TRT * n.cosine[2] +
                                       TTs * scattered_cosine_ + residual * n.residual_cosine);
        }
        return sum;
    }

    FurParameters<1> p_;
    Node nodes_[inclinations * offsets];
    float scattered_cosine_;
};

template <int Channels>
struct SigmaOfColour {
    float sigma_ca[Channels] = {};       ///< [1 / fibre radius]
    ColourStatus status[Channels] = {};  ///< of each channel
};

namespace detail {

template <int Channels, class Albedo>
MEDULLA_FN SigmaOfColour<Channels> sigma_of_colour(const FurParameters<Channels>& p, const float (&colour)[Channels],
                                                   Albedo&& albedo) noexcept {
    SigmaOfColour<Channels> result;
    FurParameters<Channels> others = p;
    for (float& s : others.sigma_ca) s = 0;
    const bool usable_parameters = out_of_range(others) == 0;
    const FibreAlbedo fibre(usable_parameters ? others : FurParameters<Channels>());
    for (int c = 0; c < Channels; ++c) {
        const float wanted = colour[c];
        ColourStatus& status = result.status[c];
        if (!usable_parameters)
            status = ColourStatus::bad_parameters;
        else if (!detail::within(wanted, 0.0f, 1.0f))
            status = ColourStatus::bad_colour;
        else if (wanted > albedo(fibre, 0.0f))
            status = ColourStatus::too_bright;
        else if (wanted < albedo(fibre, largest_sigma_ca))
            status = ColourStatus::too_dark, result.sigma_ca[c] = largest_sigma_ca;
        else {
            // Bisection of the cube root, since colours crowd near 0.
            float low = 0, high = 4;
            for (int step = 0; step < 24; ++step) {
                const float x = 0.5f * (low + high);
                (albedo(fibre, x * x * x) > wanted ? low : high) = x;
            }
            result.sigma_ca[c] = low * low * low;
        }
    }
    return result;
}

}  // namespace detail

/// sigma_ca of a strand that returns `colour` of a white sky; p's own sigma_ca is not read.
template <int Channels>
MEDULLA_FN SigmaOfColour<Channels> sigma_ca_of_strand_colour(const FurParameters<Channels>& p,
                                                             const float (&colour)[Channels]) noexcept {
    return detail::sigma_of_colour(p, colour, [](const FibreAlbedo& a, float sigma) { return a.strand(sigma); });
}

/// The same of a thick coat, light that goes from fibre to fibre counted.
template <int Channels>
MEDULLA_FN SigmaOfColour<Channels> sigma_ca_of_fur_colour(const FurParameters<Channels>& p,
                                                          const float (&colour)[Channels]) noexcept {
    return detail::sigma_of_colour(p, colour, [](const FibreAlbedo& a, float sigma) { return a.fur(sigma); });
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
