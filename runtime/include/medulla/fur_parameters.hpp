// What a fur fibre is made of: ten numbers, the animals of Table 4, and what a renderer is told about bad ones.
// Rests on Yan et al. 2017, Tables 1 and 4; lengths are in fibre radii, angles in radians.
#pragma once

#include <cstddef>

#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/detail/lanes.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// Which reflectance R an interface has (docs/bcsdf.md, 'Fresnel').
enum class Fresnel : int {
    bravais,  ///< both polarisations of eta' at gamma_i, as Eq. 13 prints it; Table 4 was fitted with it
    exact,    ///< a plane of index eta met at cos theta_i cos gamma_i (Marschner et al. 2003's eta', eta'')
};

/// How scattered light leaves the fibre (docs/bcsdf.md, 'Two forms of the scattered lobes').
enum class Scattering : int {
    published,  ///< Eqs. 19 and 20 as printed; Table 4 was fitted with it
    corrected,  ///< C^M times cos theta_r; light that the cuticle reflects back inside returns, and may be absorbed
};

/// One kind of fur. `sigma_ca` holds one value per colour channel; everything else is common to all of them.
/// T is float; cross_section.hpp's formulas and unscattered_lobes take any other scalar too.
template <int Channels = 3, class T = float>
struct FurParameters {
    static_assert(Channels >= 1, "a colour has at least one channel");
    T eta = T(1.55f);                        ///< refractive index of cortex and medulla [1], in (1, 10]
    T kappa = T(0);                          ///< medullary index: medulla's radius [fibre radii], in [0, 1]; 0 = hair
    T alpha = T(0);                          ///< tilt of the cuticle's scales [radians], in [-pi/2, pi/2]
    T beta_m = T(0.1f);                      ///< longitudinal roughness, standard deviation [radians], in [1e-4, 4]
    T beta_n = T(0.1f);                      ///< azimuthal roughness, standard deviation [radians], in [1e-4, 4]
    T layers = T(1);                         ///< layers of the cuticle [1], in [0, 1000], need not be whole
    T sigma_ms = T(0);                       ///< scattering coefficient of the medulla [1 / fibre radius], in [0, 1e9]
    T sigma_ma = T(0);                       ///< absorption coefficient of the medulla [1 / fibre radius], in [0, 1e9]
    T sigma_ca[std::size_t(Channels)] = {};  ///< absorption coefficient of the cortex [1 / fibre radius], in [0, 1e9]
    T g = T(0);                              ///< mean cosine of the medulla's phase function [1], in (-1, 1)
    Fresnel fresnel = Fresnel::bravais;
    Scattering scattering = Scattering::published;
};

/// The five lobes of the paper, in the order in which every array of lobes holds them, and behind them the residual
/// one: what paths after TRT carry (docs/bcsdf.md, 'Residual lobe').
enum class Lobe : int { R = 0, TT = 1, TRT = 2, TTs = 3, TRTs = 4, residual = 5 };
inline constexpr int lobe_count = 5;      ///< of the paper
inline constexpr int all_lobe_count = 6;  ///< with the residual one
inline constexpr const char* lobe_names[all_lobe_count] = {"R", "TT", "TRT", "TTs", "TRTs", "residual"};

/// A set of lobes: bits of lobe_bit.
using LobeMask = std::uint32_t;
MEDULLA_FN constexpr LobeMask lobe_bit(Lobe lobe) noexcept { return LobeMask(1) << static_cast<int>(lobe); }
inline constexpr LobeMask all_lobes = 63;

/// A parameter that is out of its range: bits of Fibre::out_of_range.
enum class Parameter : std::uint32_t { eta, kappa, alpha, beta_m, beta_n, layers, sigma_ms, sigma_ma, sigma_ca, g };
inline constexpr int parameter_count = 10;
inline constexpr const char* parameter_names[parameter_count] = {"eta",    "kappa",    "alpha",    "beta_m",   "beta_n",
                                                                 "layers", "sigma_ms", "sigma_ma", "sigma_ca", "g"};
/// The range of each [same unit], as text for messages.
inline constexpr const char* parameter_ranges[parameter_count] = {
    "(1, 10]",   "[0, 1]",   "[-pi/2, pi/2]", "[1e-4, 4] radians", "[1e-4, 4] radians",
    "[0, 1000]", "[0, 1e9]", "[0, 1e9]",      "[0, 1e9]",          "(-1, 1)"};

/// A row of Table 4 as printed: degrees, one grey sigma_ca; and a colour chosen by eye, which the table has not.
struct FurPreset {
    const char* name;
    float kappa, eta;                    ///< [1]
    float alpha, beta_m, beta_n;         ///< [degrees]
    float sigma_ca, sigma_ms, sigma_ma;  ///< [1 / fibre radius]; Table 4 prints 'diameter^-1', see docs/bcsdf.md
    float g, layers;                     ///< [1]
    float coat[3];  ///< sigma_ca of red, green and blue, chosen by eye about the printed one [1 / fibre radius]
    Scattering scattering = Scattering::published;  ///< the form that the numbers were fitted with
};

inline constexpr FurPreset fur_presets[] = {
    {"bobcat", 0.88f, 1.69f, 5.48f, 11.64f, 7.49f, 0.64f, 1.69f, 0.17f, 0.44f, 0.47f, {0.35f, 0.6f, 1.05f}},
    {"cat", 0.87f, 1.36f, 3.65f, 5.66f, 1.34f, 0.06f, 2.47f, 0.12f, 0.60f, 0.44f, {0.05f, 0.06f, 0.08f}},
    {"deer", 0.91f, 1.60f, 3.52f, 7.00f, 4.53f, 1.39f, 2.51f, 0.09f, 0.46f, 0.45f, {0.75f, 1.45f, 2.6f}},
    {"dog", 0.68f, 1.58f, 2.94f, 5.77f, 18.94f, 0.01f, 2.44f, 0.00f, 0.26f, 0.60f, {0.01f, 0.015f, 0.03f}},
    {"mouse", 0.66f, 1.35f, 0.55f, 8.39f, 2.80f, 0.04f, 1.34f, 0.06f, 0.36f, 2.36f, {0.04f, 0.045f, 0.05f}},
    {"rabbit", 0.79f, 1.47f, 3.14f, 11.91f, 10.52f, 0.24f, 0.78f, 0.10f, 0.12f, 1.03f, {0.16f, 0.25f, 0.4f}},
    {"raccoon", 0.65f, 1.19f, 1.81f, 7.44f, 6.88f, 0.25f, 2.30f, 0.14f, 0.08f, 2.00f, {0.22f, 0.25f, 0.3f}},
    {"red_fox", 0.86f, 1.49f, 2.64f, 9.45f, 17.63f, 0.39f, 3.15f, 0.21f, 0.79f, 0.68f, {0.12f, 0.55f, 1.6f}},
    {"springbok", 0.82f, 1.48f, 4.61f, 8.02f, 11.46f, 0.32f, 2.45f, 0.31f, 0.19f, 0.46f, {0.15f, 0.33f, 0.75f}},
    {"human", 0.36f, 1.20f, 0.70f, 2.05f, 3.75f, 0.41f, 3.49f, 0.00f, 0.28f, 1.79f, {0.22f, 0.45f, 0.9f}},
};

namespace detail {

constexpr FurPreset corrected(const FurPreset& p, const char* name, float sigma_ca, float sigma_ms, float sigma_ma,
                              float g, float layers, float red, float green, float blue) noexcept {
    FurPreset row = p;
    row.name = name;
    row.scattering = Scattering::corrected;
    row.sigma_ca = sigma_ca;
    row.sigma_ms = sigma_ms;
    row.sigma_ma = sigma_ma;
    row.g = g;
    row.layers = layers;
    row.coat[0] = red;
    row.coat[1] = green;
    row.coat[2] = blue;
    return row;
}

}  // namespace detail

/// Parameters with which the corrected form, with the exact Fresnel term, follows the published model of each animal
/// (`bench_presets` fits them; docs/truth.md says how closely): sigma_ca, sigma_ms, sigma_ma, g, layers, coat.
inline constexpr FurPreset corrected_presets[] = {
    detail::corrected(fur_presets[0], "bobcat_corrected", 0.249f, 2.03f, 0.025f, 0.51f, 0.63f, 0.159f, 0.236f, 0.386f),
    detail::corrected(fur_presets[1], "cat_corrected", 0.054f, 2.7f, 0.034f, 0.63f, 0.49f, 0.048f, 0.054f, 0.065f),
    detail::corrected(fur_presets[2], "deer_corrected", 0.447f, 2.94f, 0.02f, 0.53f, 0.58f, 0.231f, 0.469f, 0.931f),
    detail::corrected(fur_presets[3], "dog_corrected", 0.009f, 2.57f, 0.0f, 0.29f, 0.75f, 0.009f, 0.012f, 0.019f),
    detail::corrected(fur_presets[4], "mouse_corrected", 0.031f, 1.42f, 0.023f, 0.38f, 2.87f, 0.031f, 0.033f, 0.036f),
    detail::corrected(fur_presets[5], "rabbit_corrected", 0.13f, 0.9f, 0.027f, 0.14f, 1.28f, 0.098f, 0.134f, 0.197f),
    detail::corrected(fur_presets[6], "raccoon_corrected", 0.2f, 2.56f, 0.068f, 0.13f, 2.24f, 0.176f, 0.2f, 0.24f),
    detail::corrected(fur_presets[7], "red_fox_corrected", 0.214f, 4.14f, 0.041f, 0.84f, 0.87f, 0.103f, 0.282f, 0.797f),
    detail::corrected(fur_presets[8], "springbok_corrected", 0.219f, 2.75f, 0.069f, 0.26f, 0.58f, 0.137f, 0.223f,
                      0.44f),
    detail::corrected(fur_presets[9], "human_corrected", 0.392f, 5.04f, 0.0f, 0.41f, 1.94f, 0.219f, 0.429f, 0.868f),
};
inline constexpr int fur_preset_count = int(sizeof fur_presets / sizeof fur_presets[0]);

/// The parameters of a preset in its form, the same absorption in every channel.
template <int Channels = 3>
MEDULLA_FN constexpr FurParameters<Channels> parameters_of(const FurPreset& preset) noexcept {
    constexpr float radians = float(pi / 180);
    FurParameters<Channels> p;
    p.eta = preset.eta, p.kappa = preset.kappa, p.alpha = preset.alpha * radians;
    p.beta_m = preset.beta_m * radians, p.beta_n = preset.beta_n * radians, p.layers = preset.layers;
    p.sigma_ms = preset.sigma_ms, p.sigma_ma = preset.sigma_ma, p.g = preset.g;
    p.scattering = preset.scattering;
    p.fresnel = preset.scattering == Scattering::corrected ? Fresnel::exact : Fresnel::bravais;
    for (int c = 0; c < Channels; ++c) p.sigma_ca[c] = preset.sigma_ca;
    return p;
}

/// The same in colour: `coat` in place of the printed grey sigma_ca.
MEDULLA_FN constexpr FurParameters<3> coloured_parameters_of(const FurPreset& preset) noexcept {
    FurParameters<3> p = parameters_of<3>(preset);
    for (int c = 0; c < 3; ++c) p.sigma_ca[c] = preset.coat[c];
    return p;
}

/// The preset of this name, of either form, or null.
constexpr const FurPreset* find_preset(const char* name) noexcept {
    for (int i = 0; i < 2 * fur_preset_count; ++i) {
        const FurPreset& preset = i < fur_preset_count ? fur_presets[i] : corrected_presets[i - fur_preset_count];
        const char *a = name, *b = preset.name;
        while (*a != 0 && *a == *b) {
            ++a;
            ++b;
        }
        if (*a == *b) return &preset;
    }
    return nullptr;
}

namespace detail {

/// x within [low, high], 0 <= low: compared as bits, so that a NaN is out of range under -ffast-math too.
MEDULLA_HOT bool within(float x, float low, float high) noexcept {
    return bits_of(x) - bits_of(low) <= bits_of(high) - bits_of(low) ||
           (bits_of(low) == 0 && bits_of(x) == 0x80000000u);
}
inline constexpr float greatest_below_1 = 0.99999994f, least_above_1 = 1.0000001f;

/// Calls visit(parameter, value, low, high) for each number.
template <class Parameters, class Visit>
MEDULLA_HOT void visit_parameters(Parameters& p, Visit&& visit) noexcept {
    constexpr float quarter = float(pi / 2);
    visit(Parameter::eta, p.eta, least_above_1, 10.0f);
    visit(Parameter::kappa, p.kappa, 0.0f, 1.0f);
    visit(Parameter::alpha, p.alpha, -quarter, quarter);
    visit(Parameter::beta_m, p.beta_m, 1e-4f, 4.0f);
    visit(Parameter::beta_n, p.beta_n, 1e-4f, 4.0f);
    visit(Parameter::layers, p.layers, 0.0f, 1000.0f);
    visit(Parameter::sigma_ms, p.sigma_ms, 0.0f, 1e9f);
    visit(Parameter::sigma_ma, p.sigma_ma, 0.0f, 1e9f);
    for (auto& sigma : p.sigma_ca) visit(Parameter::sigma_ca, sigma, 0.0f, 1e9f);
    visit(Parameter::g, p.g, -greatest_below_1, greatest_below_1);
}

}  // namespace detail

/// The parameters that are out of their ranges: bit i for Parameter i.
template <int Channels>
MEDULLA_FN std::uint32_t out_of_range(const FurParameters<Channels>& p) noexcept {
    std::uint32_t bits = 0;
    detail::visit_parameters(p, [&](Parameter which, float value, float low, float high) {
        const bool inside = low < 0 ? detail::within(value, high) : detail::within(value, low, high);
        bits |= inside ? 0u : 1u << static_cast<std::uint32_t>(which);
    });
    return bits;
}

/// Every parameter brought into its range; a NaN becomes the range's lower end, or 0 where the range goes below it.
template <int Channels>
MEDULLA_FN FurParameters<Channels> clamped(FurParameters<Channels> p) noexcept {
    detail::visit_parameters(p, [](Parameter, float& value, float low, float high) {
        const bool number = detail::within(value, 3.4028235e38f) || detail::bits_of(value) << 1 == 0xff000000u;
        if (!number)
            value = low < 0 ? 0.0f : low;
        else
            value = value < low ? low : (value > high ? high : value);
    });
    return p;
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
