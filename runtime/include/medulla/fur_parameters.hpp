// What a fur fibre is made of: ten numbers, the animals of Table 4, and what a renderer is told about bad ones.
// Rests on Yan et al. 2017, Tables 1 and 4; lengths are in fibre radii, angles in radians.
#pragma once

#include "medulla/config.hpp"
#include "medulla/lanes.hpp"

namespace medulla {

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
    T eta = T(1.55f);           ///< refractive index of cortex and medulla [1], in (1, 10]
    T kappa = T(0);             ///< medullary index: medulla's radius [fibre radii], in [0, 1]; 0 = hair
    T alpha = T(0);             ///< tilt of the cuticle's scales [radians], in [-pi/2, pi/2]
    T beta_m = T(0.1f);         ///< longitudinal roughness, standard deviation [radians], in [1e-4, 4]
    T beta_n = T(0.1f);         ///< azimuthal roughness, standard deviation [radians], in [1e-4, 4]
    T layers = T(1);            ///< layers of the cuticle [1], in [0, 1000], need not be whole
    T sigma_ms = T(0);          ///< scattering coefficient of the medulla [1 / fibre radius], in [0, 1e9]
    T sigma_ma = T(0);          ///< absorption coefficient of the medulla [1 / fibre radius], in [0, 1e9]
    T sigma_ca[Channels] = {};  ///< absorption coefficient of the cortex [1 / fibre radius], in [0, 1e9]
    T g = T(0);                 ///< mean cosine of the medulla's phase function [1], in (-1, 1)
    Fresnel fresnel = Fresnel::bravais;
};

/// The five lobes, in the order in which every array of lobes holds them.
enum class Lobe : int { R = 0, TT = 1, TRT = 2, TTs = 3, TRTs = 4 };
inline constexpr int lobe_count = 5;
inline constexpr const char* lobe_names[lobe_count] = {"R", "TT", "TRT", "TTs", "TRTs"};

enum class FurStatus {
    ok,
    no_azimuthal_table,     ///< usable: kappa > 0 and sigma_ms > 0, but the scattered lobes are absent
    no_longitudinal_table,  ///< usable: the same, for want of a longitudinal table
    bad_eta,                ///< this and all below: a parameter is outside its range, every lobe is 0
    bad_kappa,
    bad_alpha,
    bad_roughness,
    bad_layers,
    bad_sigma,
    bad_g,
};

inline const char* describe(FurStatus status) noexcept {
    switch (status) {
        case FurStatus::ok:
            return "ok";
        case FurStatus::no_azimuthal_table:
            return "the pack has no azimuthal table: scattered lobes are absent";
        case FurStatus::no_longitudinal_table:
            return "the pack lacks a longitudinal table: scattered lobes are absent";
        case FurStatus::bad_eta:
            return "eta is not in (1, 10]";
        case FurStatus::bad_kappa:
            return "kappa is not in [0, 1]";
        case FurStatus::bad_alpha:
            return "alpha is not in [-pi/2, pi/2]";
        case FurStatus::bad_roughness:
            return "beta_m or beta_n is not in [1e-4, 4] radians";
        case FurStatus::bad_layers:
            return "layers is not in [0, 1000]";
        case FurStatus::bad_sigma:
            return "sigma_ms, sigma_ma or sigma_ca is not in [0, 1e9]";
        case FurStatus::bad_g:
            return "g is not in (-1, 1)";
    }
    return "unknown status";
}

/// Whether a fibre of this status may be evaluated with at least its unscattered lobes.
MEDULLA_FN constexpr bool usable(FurStatus status) noexcept { return status < FurStatus::bad_eta; }

/// A row of Table 4 as printed: degrees, one grey sigma_ca.
struct FurPreset {
    const char* name;
    float kappa, eta;                    ///< [1]
    float alpha, beta_m, beta_n;         ///< [degrees]
    float sigma_ca, sigma_ms, sigma_ma;  ///< [1 / fibre radius]; Table 4 prints 'diameter^-1', see docs/bcsdf.md
    float g, layers;                     ///< [1]
};

inline constexpr FurPreset fur_presets[] = {
    {"bobcat", 0.88f, 1.69f, 5.48f, 11.64f, 7.49f, 0.64f, 1.69f, 0.17f, 0.44f, 0.47f},
    {"cat", 0.87f, 1.36f, 3.65f, 5.66f, 1.34f, 0.06f, 2.47f, 0.12f, 0.60f, 0.44f},
    {"deer", 0.91f, 1.60f, 3.52f, 7.00f, 4.53f, 1.39f, 2.51f, 0.09f, 0.46f, 0.45f},
    {"dog", 0.68f, 1.58f, 2.94f, 5.77f, 18.94f, 0.01f, 2.44f, 0.00f, 0.26f, 0.60f},
    {"mouse", 0.66f, 1.35f, 0.55f, 8.39f, 2.80f, 0.04f, 1.34f, 0.06f, 0.36f, 2.36f},
    {"rabbit", 0.79f, 1.47f, 3.14f, 11.91f, 10.52f, 0.24f, 0.78f, 0.10f, 0.12f, 1.03f},
    {"raccoon", 0.65f, 1.19f, 1.81f, 7.44f, 6.88f, 0.25f, 2.30f, 0.14f, 0.08f, 2.00f},
    {"red_fox", 0.86f, 1.49f, 2.64f, 9.45f, 17.63f, 0.39f, 3.15f, 0.21f, 0.79f, 0.68f},
    {"springbok", 0.82f, 1.48f, 4.61f, 8.02f, 11.46f, 0.32f, 2.45f, 0.31f, 0.19f, 0.46f},
    {"human", 0.36f, 1.20f, 0.70f, 2.05f, 3.75f, 0.41f, 3.49f, 0.00f, 0.28f, 1.79f},
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

/// The preset of this name, or null.
constexpr const FurPreset* find_preset(const char* name) noexcept {
    for (const FurPreset& preset : fur_presets) {
        const char *a = name, *b = preset.name;
        while (*a != 0 && *a == *b) ++a, ++b;
        if (*a == *b) return &preset;
    }
    return nullptr;
}

/// Checks every parameter against its range.
template <int Channels>
MEDULLA_FN FurStatus check(const FurParameters<Channels>& p) noexcept {
    using detail::within;
    if (!within(p.eta, 10) || !(p.eta > 1)) return FurStatus::bad_eta;
    if (!within(p.kappa, 1) || !(p.kappa >= 0)) return FurStatus::bad_kappa;
    if (!within(p.alpha, float(pi / 2))) return FurStatus::bad_alpha;
    const bool rough = within(p.beta_m, 4) && within(p.beta_n, 4) && p.beta_m >= 1e-4f && p.beta_n >= 1e-4f;
    if (!rough) return FurStatus::bad_roughness;
    if (!within(p.layers, 1000) || !(p.layers >= 0)) return FurStatus::bad_layers;
    bool sigmas = within(p.sigma_ms, 1e9f) && p.sigma_ms >= 0 && within(p.sigma_ma, 1e9f) && p.sigma_ma >= 0;
    for (int c = 0; c < Channels; ++c) sigmas = sigmas && within(p.sigma_ca[c], 1e9f) && p.sigma_ca[c] >= 0;
    if (!sigmas) return FurStatus::bad_sigma;
    if (!within(p.g, 1) || !(p.g > -1 && p.g < 1)) return FurStatus::bad_g;
    return FurStatus::ok;
}

}  // namespace medulla
