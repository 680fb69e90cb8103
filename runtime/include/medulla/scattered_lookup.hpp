// Scattered lobes read from unfolded tables: eight products abreast, fused, where the processor has AVX2, which is
// asked as they are read; else the four abreast of unfolded.hpp, the slow twin. The two differ by rounding (2e-7).
#pragma once

#include <cstdint>

#include "medulla/config.hpp"
#include "medulla/lanes.hpp"
#include "medulla/unfolded.hpp"

namespace medulla {

/// Densities of TTs and TRTs at an exit, without their energies.
struct ScatteredDensities {
    float M = 0, D[2] = {};  ///< longitudinal and azimuthal [1 / radian]
};

/// M^s of Eq. 19, from its two sides at |phi| / pi, one or several abreast.
template <class T>
MEDULLA_HOT T blend_sides(T back, T forward, T forwardness) noexcept {
    return (T(1.0f) - forwardness) * back + forwardness * forward;
}
MEDULLA_HOT float blend_sides(BackForward side, float forwardness) noexcept {
    return blend_sides(side.back, side.forward, forwardness);
}

/// Four queries, each with its own near field and exit.
struct FourLookups {
    Four sigma;                ///< what tables.sigma_place gave
    Four offset, inclination;  ///< chord_coordinate of h [medulla radii] and of |theta_i| [pi/2]
    Four y[2], theta_r, phi;   ///< as scattered_densities has them
};
/// Densities of TTs and TRTs of each.
struct FourDensities {
    Four M, D[2];
};

namespace detail {

/// @param N lanes to be added up  @param M back and forward, twice, to be added up; both are left transposed
MEDULLA_HOT FourDensities four_densities(Four (&N)[2][4], Four (&M)[4], Four phi) noexcept {
    const Four zero(0.0f), forwardness = Four(2.0f) * magnitude(turns_of(phi));
    FourDensities at;
    for (int p = 0; p < 2; ++p) {
        transpose(N[p][0], N[p][1], N[p][2], N[p][3]);
        at.D[p] = greater(zero, (N[p][0] + N[p][1]) + (N[p][2] + N[p][3]));  // a NaN stays one
    }
    transpose(M[0], M[1], M[2], M[3]);
    at.M = blend_sides(greater(zero, M[0] + M[2]), greater(zero, M[1] + M[3]), forwardness);
    return at;
}

}  // namespace detail

#if defined(MEDULLA_WIDE)
namespace detail {

/// As ExitPlaces; `half` is the number of rows from those of y >= 0 to those of y < 0, or 0.
struct WidePlaces {
    alignas(16) std::uint32_t stretch[4];
    alignas(16) float place[4];
    alignas(16) std::uint32_t half[4];
};
MEDULLA_WIDE inline WidePlaces wide_places(Four y, Four scale, __m128i rows) noexcept {
    const Four turns = turns_of(y), u = magnitude(turns) * scale;
    WidePlaces p;
    store_four(u, p.place);
    _mm_store_si128(reinterpret_cast<__m128i*>(p.stretch), _mm_cvttps_epi32(u.v));
    _mm_store_si128(reinterpret_cast<__m128i*>(p.half),
                    _mm_and_si128(_mm_srai_epi32(_mm_castps_si128(turns.v), 31), rows));
    return p;
}
MEDULLA_WIDE inline __m128 wide_weights(const CubicWeights& w, Same x) noexcept {
    const __m128 t = x.v, a = _mm_fmadd_ps(t, _mm_load_ps(w.power[1]), _mm_load_ps(w.power[0])),
                 b = _mm_fmadd_ps(t, _mm_load_ps(w.power[3]), _mm_load_ps(w.power[2]));
    return _mm_fmadd_ps(_mm_mul_ps(t, t), b, a);
}
/// Lanes of x by number.
MEDULLA_WIDE inline __m256 lanes_of(__m128 x, __m256i which) noexcept {
    return _mm256_permutevar8x32_ps(_mm256_castps128_ps256(x), which);
}
MEDULLA_WIDE inline __m128 sum_of_halves(__m256 x) noexcept {
    return _mm_add_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps(x, 1));
}
/// Weights of four rows, each in eight lanes.
struct WideRows {
    __m256 weight[4];
};
MEDULLA_WIDE inline WideRows wide_rows(__m128 weight) noexcept {
    const __m256 w = _mm256_set_m128(weight, weight);
    return {{_mm256_permute_ps(w, 0x00), _mm256_permute_ps(w, 0x55), _mm256_permute_ps(w, 0xaa),
             _mm256_permute_ps(w, 0xff)}};
}
/// Eight numbers of four rows blended. @param step from row to row [floats]
MEDULLA_WIDE inline __m256 wide_blend(const WideRows& w, const float* row, std::size_t step) noexcept {
    const __m256 a = _mm256_mul_ps(w.weight[0], _mm256_loadu_ps(row));
    const __m256 b = _mm256_fmadd_ps(w.weight[1], _mm256_loadu_ps(row + step), a);
    const __m256 c = _mm256_fmadd_ps(w.weight[2], _mm256_loadu_ps(row + 2 * step), b);
    return _mm256_fmadd_ps(w.weight[3], _mm256_loadu_ps(row + 3 * step), c);
}
/// C^N at exit i; its four lanes are yet to be added up. @param sigma weights of sigma, twice
MEDULLA_WIDE inline __m128 wide_azimuthal(const UnfoldedTables& tables, const float* rows, const WideRows& offset,
                                          __m256 sigma, const WidePlaces& places, int i) noexcept {
    const std::uint32_t exit = tables.azimuth.start[places.stretch[i]];
    const __m128 w =
        wide_weights(tables.azimuth.weights[exit], Same(places.place[i]) - Same(tables.azimuth.middle[exit]));
    const __m256 lower = _mm256_mul_ps(lanes_of(w, _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1)), sigma);
    const __m256 upper = _mm256_mul_ps(lanes_of(w, _mm256_setr_epi32(2, 2, 2, 2, 3, 3, 3, 3)), sigma);
    const float* row = rows + 4 * std::size_t(places.half[i] + exit);
    const std::size_t step = 8 * std::size_t(tables.azimuth_rows);
    return sum_of_halves(
        _mm256_fmadd_ps(lower, wide_blend(offset, row, step), _mm256_mul_ps(upper, wide_blend(offset, row + 8, step))));
}
/// C^M at exit i: back and forward twice, yet to be added up. @param rows of theta_i  @param theta weights of theta_i
MEDULLA_WIDE inline __m128 wide_longitudinal(const UnfoldedTables& tables, const float* rows, __m128 theta,
                                             const WidePlaces& places, int i) noexcept {
    const std::uint32_t exit = tables.longitude.start[places.stretch[i]];
    const __m128 w =
        wide_weights(tables.longitude.weights[exit], Same(places.place[i]) - Same(tables.longitude.middle[exit]));
    const float* row = rows + 2 * std::size_t(places.half[i] + exit);
    const __m256 sides = wide_blend(wide_rows(theta), row, 4 * std::size_t(tables.longitude_rows));
    return sum_of_halves(_mm256_mul_ps(lanes_of(w, _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3)), sides));
}
/// Sums of the lanes of each, in lanes 0 and 1, >= 0; a NaN stays one.
MEDULLA_WIDE inline __m128 held_sums(__m128 a, __m128 b) noexcept {
    const __m128 ab = _mm_add_ps(_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b));
    return _mm_max_ps(_mm_setzero_ps(), _mm_add_ps(ab, _mm_movehl_ps(ab, ab)));
}

/// @param at where h lies among the rows  @param sigma weights of sigma
MEDULLA_WIDE inline TwoDensities wide_lookup(const UnfoldedTables& tables, const AxisPlace& at, __m128 sigma, float y0,
                                             float y1) noexcept {
    const WidePlaces places = wide_places(Four(y0, y1, y0, y1), Four(tables.azimuth_scale),
                                          _mm_set1_epi32(std::int32_t(tables.azimuth_rows)));
    const WideRows offset = wide_rows(wide_weights(tables.offset.weights[at.span], at.along));
    const __m256 twice = _mm256_set_m128(sigma, sigma);
    const float* rows = tables.azimuthal_rows(at.span);  // of a spline
    const __m128 N = held_sums(wide_azimuthal(tables, rows, offset, twice, places, 0),
                               wide_azimuthal(tables, rows, offset, twice, places, 1));
    return {_mm_cvtss_f32(N), _mm_cvtss_f32(_mm_shuffle_ps(N, N, 1))};
}
MEDULLA_WIDE inline TwoDensities wide_lookup(const UnfoldedTables& tables, Four sigma, float h, float y0,
                                             float y1) noexcept {
    return wide_lookup(tables, tables.offset.place(chord_coordinate(Same(h))), sigma.v, y0, y1);
}
MEDULLA_WIDE inline TwoDensities wide_lookup(const UnfoldedTables& tables, float sigma, float h, float y0,
                                             float y1) noexcept {
    const AxisPlace at = tables.offset.place(chord_coordinate(Same(h)));  // first, as it takes longest
    return wide_lookup(tables, at, wide_weights(tables.sigma_weights, tables.sigma_place(Same(sigma))), y0, y1);
}

MEDULLA_WIDE inline ScatteredDensities wide_exit(const UnfoldedTables& tables, const AzimuthalPoint& around,
                                                 const LongitudinalPoint& along, float y0, float y1, float theta_r,
                                                 float phi) noexcept {
    const auto rows = std::int32_t(tables.azimuth_rows);
    const WidePlaces places = wide_places(Four(y0, y1, theta_r, phi),
                                          Four(tables.azimuth_scale, tables.azimuth_scale, tables.longitude_scale, 2),
                                          _mm_setr_epi32(rows, rows, std::int32_t(tables.longitude_rows), 0));
    const WideRows offset = wide_rows(around.offset.v);
    const __m256 sigma = _mm256_set_m128(around.sigma.v, around.sigma.v);
    const __m128 N = held_sums(wide_azimuthal(tables, around.rows, offset, sigma, places, 0),
                               wide_azimuthal(tables, around.rows, offset, sigma, places, 1));
    const __m128 M = wide_longitudinal(tables, along.rows, along.weight.v, places, 2);
    ScatteredDensities at;
    at.M = blend_sides(UnfoldedTables::both_of(Four(M)), places.place[3]);
    at.D[0] = _mm_cvtss_f32(N), at.D[1] = _mm_cvtss_f32(_mm_shuffle_ps(N, N, 1));
    return at;
}

MEDULLA_WIDE inline FourDensities wide_exits(const UnfoldedTables& tables, const FourLookups& q) noexcept {
    const auto around_rows = std::int32_t(tables.azimuth_rows), along_rows = std::int32_t(tables.longitude_rows);
    const WidePlaces around[2] = {wide_places(q.y[0], Four(tables.azimuth_scale), _mm_set1_epi32(around_rows)),
                                  wide_places(q.y[1], Four(tables.azimuth_scale), _mm_set1_epi32(around_rows))};
    const WidePlaces along = wide_places(q.theta_r, Four(tables.longitude_scale), _mm_set1_epi32(along_rows));
    AxisPlace offset[4], inclination[4];
    tables.offset.places(q.offset, offset), tables.inclination.places(q.inclination, inclination);
    alignas(16) float place[4];
    store_four(q.sigma, place);
    Four N[2][4], M[4];
    for (int k = 0; k < 4; ++k) {
        const WideRows h = wide_rows(wide_weights(tables.offset.weights[offset[k].span], offset[k].along));
        const __m128 sigma = wide_weights(tables.sigma_weights, Same(place[k]));
        const __m256 twice = _mm256_set_m128(sigma, sigma);
        const float* rows = tables.azimuthal_rows(offset[k].span);  // of a spline
        for (int p = 0; p < 2; ++p) N[p][k] = Four(wide_azimuthal(tables, rows, h, twice, around[p], k));
        M[k] = Four(wide_longitudinal(
            tables, tables.longitudinal_rows(tables.inclination.first[inclination[k].span]),
            wide_weights(tables.inclination.weights[inclination[k].span], inclination[k].along), along, k));
    }
    return four_densities(N, M, q.phi);
}

}  // namespace detail
#endif

/// C^N of TTs and TRTs at one (sigma, h): density per radian at an exit of either.
/// @param sigma what tables.sigma_at gave  @param h offset [medulla radii], in [0, 1]  @param y0, y1 [radians], |y| <
/// 1e9
MEDULLA_FN TwoDensities azimuthal_densities(const UnfoldedTables& tables, Four sigma, float h, float y0,
                                            float y1) noexcept {
#if defined(MEDULLA_WIDE)
    if (has_wide()) return detail::wide_lookup(tables, sigma, h, y0, y1);
#endif
    return tables.azimuthal_densities(tables.azimuthal_at(sigma, h), y0, y1);
}
/// The same from the optical radius. @param sigma [1], >= 0
MEDULLA_FN TwoDensities azimuthal_densities(const UnfoldedTables& tables, float sigma, float h, float y0,
                                            float y1) noexcept {
#if defined(MEDULLA_WIDE)
    if (has_wide()) return detail::wide_lookup(tables, sigma, h, y0, y1);
#endif
    return tables.azimuthal_densities(tables.azimuthal_at(tables.sigma_at(sigma), h), y0, y1);
}

/// M^s and C^N of TTs and TRTs at an exit of one near field. @param y0, y1, phi azimuths from the lobes' shifts and
/// from 0 [radians], below 1e9  @param theta_r seen from the side of theta_i
MEDULLA_HOT ScatteredDensities scattered_densities(const UnfoldedTables& tables, const AzimuthalPoint& around,
                                                   const LongitudinalPoint& along, float y0, float y1, float theta_r,
                                                   float phi) noexcept {
#if defined(MEDULLA_WIDE)
    if (has_wide()) return detail::wide_exit(tables, around, along, y0, y1, theta_r, phi);
#endif
    // Lane 3, half turns from phi = 0, is how far forward the exit is.
    const ExitPlaces places = exit_places(turns_of(Four(y0, y1, theta_r, phi)),
                                          Four(tables.azimuth_scale, tables.azimuth_scale, tables.longitude_scale, 2));
    ScatteredDensities at;
    for (int p = 0; p < 2; ++p) at.D[p] = tables.azimuthal_density(around, tables.azimuth_exit(places, p));
    at.M = blend_sides(tables.longitudinal_density(along, tables.longitude_exit(places, 2)), places.place[3]);
    return at;
}

/// The same of four queries.
MEDULLA_HOT FourDensities scattered_densities(const UnfoldedTables& tables, const FourLookups& q) noexcept {
#if defined(MEDULLA_WIDE)
    if (has_wide()) return detail::wide_exits(tables, q);
#endif
    const ExitPlaces around[2] = {exit_places(turns_of(q.y[0]), Four(tables.azimuth_scale)),
                                  exit_places(turns_of(q.y[1]), Four(tables.azimuth_scale))};
    const ExitPlaces along = exit_places(turns_of(q.theta_r), Four(tables.longitude_scale));
    AxisPlace offset[4], inclination[4];
    tables.offset.places(q.offset, offset), tables.inclination.places(q.inclination, inclination);
    float place[4];
    store_four(q.sigma, place);
    Four N[2][4], M[4];
    for (int k = 0; k < 4; ++k) {
        const AzimuthalPoint a = {tables.azimuthal_rows(offset[k].span),
                                  tables.offset.weights[offset[k].span].at(offset[k].along),
                                  tables.sigma_weights.at(Same(place[k]))};
        const LongitudinalPoint m = {tables.longitudinal_rows(tables.inclination.first[inclination[k].span]),
                                     tables.inclination.weights[inclination[k].span].at(inclination[k].along)};
        for (int p = 0; p < 2; ++p) N[p][k] = tables.azimuthal_terms(a, tables.azimuth_exit(around[p], k));
        M[k] = tables.longitudinal_terms(m, tables.longitude_exit(along, k));
    }
    return detail::four_densities(N, M, q.phi);
}

}  // namespace medulla
