// Conjugate points of the disc solver: circles, the chords between them, and one scattering matrix per circle.
// docs/physics.md, section 2; the symmetries that make the matrices small are stated below.
#pragma once

#include <cstddef>
#include <vector>

namespace medulla::sim2d {

/// Which grid. Circles r_i = sin(pi i / (2 circles)) crowd to the rim. The ring between two circles holds chords that
/// are uniform in angle on its outer circle, 2 at least and no further apart than `gap`: this is what resolves grazing
/// directions, and the turn of a mode near the centre, exp(-i k psi) where the radiance hardly depends on place.
struct DiscGridSize {
    int circles = 0, modes = 0;
    double gap = 0;  ///< [radians]
};

/// The parts of a mode J_k(r, psi) under its two symmetries. Light along x makes the problem even in y, which makes
/// the real part of a mode even in psi and the imaginary part odd; scattering also commutes with psi -> pi - psi
/// (sum and difference). So psi in (0, pi / 2) is enough: chord b meets circle r at psi = asin(b / r) and pi - psi.
enum DiscPart { real_sum, real_difference, imaginary_sum, imaginary_difference, disc_parts };

/// Fields and matrices of the solve: rounding of 1e-7 is far below what the grids leave (1e-4), and half the memory
/// traffic. Sums over many terms are kept in double.
using DiscReal = float;

class DiscGrid {
  public:
    /// @param g mean cosine, in (-1, 1)
    DiscGrid(double g, const DiscGridSize& size);

    DiscGridSize size;
    std::vector<double> radius;          ///< of circle i, increasing, the last is 1
    std::vector<double> offset;          ///< b of chord m, increasing; chords [0, chords(i)) meet circle i
    std::vector<std::size_t> ring;       ///< first circle that chord m meets
    std::vector<std::size_t> first;      ///< first[i] + m: node of circle i on chord m; first[circles] = node count
    std::vector<double> psi;             ///< per node, in (0, pi / 2)
    std::vector<DiscReal> cosine, sine;  ///< cos(k psi), sin(k psi): node-major, `stride` columns
    std::size_t stride;                  ///< modes 0..size.modes, rounded up to a multiple of 8 (all are solved for)
    int harmonics;                       ///< highest n kept in psi: |g|^n < 1e-8 beyond

    std::size_t circles() const { return radius.size(); }
    std::size_t nodes() const { return psi.size(); }
    /// Number of chords that meet circle i; circle i has as many nodes with psi < pi / 2.
    std::size_t chords(std::size_t i) const { return first[i + 1] - first[i]; }
    /// Row-major chords(i) x chords(i): values of a part at the nodes of circle i -> (p * part) at the same nodes.
    /// Empty where few harmonics matter; then it is waves(i, part) times analysis(i, part).
    const std::vector<DiscReal>& scatter(std::size_t i, DiscPart part) const { return scatter_[i * disc_parts + part]; }
    /// Row-major chords(i) x harmonics of the part: g^n cos(n psi) or g^n sin(n psi).
    const std::vector<DiscReal>& waves(std::size_t i, DiscPart part) const { return waves_[i * disc_parts + part]; }
    /// Row-major harmonics of the part x chords(i): values at the nodes -> cosine or sine coefficients.
    const std::vector<DiscReal>& analysis(std::size_t i, DiscPart part) const {
        return analysis_[i * disc_parts + part];
    }
    /// The harmonics n of a part, in steps of two.
    std::vector<int> harmonics_of(DiscPart part) const;

  private:
    std::vector<std::vector<DiscReal>> scatter_, waves_, analysis_;
};

}  // namespace medulla::sim2d
