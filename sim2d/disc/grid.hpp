// Conjugate points of the disc solver: circles, the chords between them, and the harmonics of scattering per circle.
// docs/physics.md, section 2; the symmetries that make the matrices small are stated below.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace medulla::sim2d {

/// Size of a grid. Circles r_i = cos x_i: x grows from the rim in steps that start at `rim` and each grow by the factor
/// `growth`, up to pi / (2 circles). The chords of the ring between two circles are uniform in angle on its outer
/// circle, at least 2 and no further apart than `gap`; the last is tangent to the outer circle.
struct DiscGridSize {
    int circles = 0, modes = 0;
    double gap = 0, rim = 0;  ///< [radians]
    double growth = 1.2;
};

/// A field I(r, alpha, omega) = sum over k of exp(i k omega) I_k(r, psi), psi = alpha - omega: at a fixed direction it
/// is as smooth in position as the radiance, however narrow the phase function. Light along x makes the problem even in
/// y: Re I_k is even in psi, Im I_k odd, and I_k = sum over m of a_m exp(i m psi) with real a_m, which scattering
/// multiplies by g^|m - k|. Halves that are even (sum) and odd (difference) about psi = pi / 2 have even or odd m only,
/// so psi in (0, pi / 2) is enough: chord b meets circle r at psi = asin(b / r) and pi - psi.
enum DiscPart { real_sum, real_difference, imaginary_sum, imaginary_difference, disc_parts };

/// Number type of fields and matrices: rounding of 1e-7 is far below the error of the grids (1e-4), at half the memory
/// traffic. Sums over many terms are accumulated in double.
using DiscReal = float;

class DiscGrid {
  public:
    /// @param g mean cosine, in (-1, 1)
    DiscGrid(double g, const DiscGridSize& size);

    double mean_cosine;
    DiscGridSize size;
    std::vector<double> radius;      ///< of circle i, increasing, the last is 1
    std::vector<double> offset;      ///< b of chord m, increasing; chords [0, chords(i)) meet circle i
    std::vector<std::size_t> ring;   ///< first circle that chord m meets
    std::vector<std::size_t> first;  ///< first[i] + m: node of circle i on chord m; first[circles] = node count
    std::vector<double> psi;         ///< per node, in (0, pi / 2]
    std::size_t stride;              ///< columns: path length, then modes 0, 1, ..; a multiple of 8
    int reach;                       ///< highest m: |g|^|m - k| < 1e-7 beyond, for every k

    /// Column 0 is the path length of uniform light (k = 0), the others are modes of the plane wave.
    static std::size_t mode_of(std::size_t column) { return column == 0 ? 0 : column - 1; }
    std::size_t circles() const { return radius.size(); }
    std::size_t nodes() const { return psi.size(); }
    bool tangent(std::size_t m) const { return offset[m] == radius[ring[m]]; }
    /// Number of chords that meet circle i; circle i has as many nodes with psi <= pi / 2.
    std::size_t chords(std::size_t i) const { return first[i + 1] - first[i]; }
    /// Harmonics m = 2 j + parity(part), j < harmonics(i), represent a field on circle i: as many as it has nodes.
    std::size_t harmonics(std::size_t i) const { return std::min(chords(i), all_harmonics()); }
    std::size_t all_harmonics() const { return static_cast<std::size_t>(reach) / 2 + 1; }
    static int parity(int part) { return part == real_difference || part == imaginary_sum ? 1 : 0; }
    static bool is_cosine(int part) { return part == real_sum || part == real_difference; }
    /// Row-major chords(i) x all_harmonics(): cos(m psi) or sin(m psi) at the nodes.
    const std::vector<DiscReal>& waves(std::size_t i, int part) const {
        return waves_[i * disc_parts + static_cast<std::size_t>(part)];
    }
    /// Row-major harmonics(i) x chords(i): values at the nodes -> cosine or sine coefficients.
    const std::vector<DiscReal>& analysis(std::size_t i, int part) const {
        return analysis_[i * disc_parts + static_cast<std::size_t>(part)];
    }
    /// (g^|m - k| + g^|m + k|) / 2 and (g^|m - k| - g^|m + k|) / 2, `stride` columns per m: scattering maps cosine
    /// and sine coefficients (c, s) to (even c + odd s, odd c + even s).
    const DiscReal* even(int m) const { return &even_[static_cast<std::size_t>(m) * stride]; }
    const DiscReal* odd(int m) const { return &odd_[static_cast<std::size_t>(m) * stride]; }

  private:
    std::vector<std::vector<DiscReal>> waves_, analysis_;
    std::vector<DiscReal> even_, odd_;
};

}  // namespace medulla::sim2d
