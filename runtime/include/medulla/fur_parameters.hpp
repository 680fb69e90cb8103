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
inline constexpr int fur_preset_count = int(sizeof fur_presets / sizeof fur_presets[0]);

/// The parameters of a preset, the same absorption in every channel.
template <int Channels = 3>
MEDULLA_FN constexpr FurParameters<Channels> parameters_of(const FurPreset& preset) noexcept {
    constexpr float radians = float(pi / 180);
    FurParameters<Channels> p;
    p.eta = preset.eta, p.kappa = preset.kappa, p.alpha = preset.alpha * radians;
    p.beta_m = preset.beta_m * radians, p.beta_n = preset.beta_n * radians, p.layers = preset.layers;
    p.sigma_ms = preset.sigma_ms, p.sigma_ma = preset.sigma_ma, p.g = preset.g;
    for (int c = 0; c < Channels; ++c) p.sigma_ca[c] = preset.sigma_ca;
    return p;
}

/// The same in colour: `coat` in place of the printed grey sigma_ca.
MEDULLA_FN constexpr FurParameters<3> coloured_parameters_of(const FurPreset& preset) noexcept {
    FurParameters<3> p = parameters_of<3>(preset);
    for (int c = 0; c < 3; ++c) p.sigma_ca[c] = preset.coat[c];
    return p;
}

/// The preset of this name, or null.
constexpr const FurPreset* find_preset(const char* name) noexcept {
    for (const FurPreset& preset : fur_presets) {
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
