// Streaming along chords and scattering on circles for every mode at once: the two operators of the disc solver.
// docs/physics.md, section 4.1.
#pragma once

#include <complex>
#include <cstddef>
#include <vector>

#include "sim2d/disc/grid.hpp"

namespace medulla::sim2d {

/// Columns at all nodes: circle by circle, the four parts one after the other, each chords(i) x stride, row-major.
using DiscField = std::vector<DiscReal>;

const int disc_taps = 6;  ///< points of a chord from which a source is interpolated

class DiscTransport {
  public:
    /// @param extinction scattering plus absorption [1 / disc radius], > 0
    DiscTransport(const DiscGrid& grid, double extinction);

    std::size_t size() const { return grid_.nodes() * disc_parts * grid_.stride; }

    /// Radiance from a source, columns [0, active); `exit`, if not null, receives the exit radiance of each chord:
    /// a real and an imaginary row per chord.
    void stream(const DiscField& source, DiscField& radiance, std::size_t active, DiscReal* exit = nullptr);
    /// The convolution of the radiance with the phase function times `factor`, at every node.
    void scatter(const DiscField& radiance, DiscField& source, std::size_t active, double factor);
    /// p(omega) exp(-extinction d): source of a plane wave of unit radiance, relative to the scattering coefficient.
    void first_collision(DiscField& source);
    /// Column 0 of a radiance becomes (1 - exp(-extinction d)) / extinction, that of a uniform unit source.
    void uniform_radiance(DiscField& radiance) const;
    /// A column of a source at the rim, psi = pi / 2.
    std::complex<double> grazing(const DiscField& source, std::size_t column) const;

  private:
    /// Transport through one cell of a chord: I(p + 1) = transmission I(p) + sum of weight[a] J(start + a).
    struct Cell {
        DiscReal transmission, weight[disc_taps];
        std::size_t start, taps;
    };
    std::vector<Cell> chord_cells(const std::vector<double>& s) const;
    /// Row of a field: circle i, part, chord m.
    std::size_t row(std::size_t i, int part, std::size_t m) const {
        return disc_parts * grid_.first[i] + static_cast<std::size_t>(part) * grid_.chords(i) + m;
    }
    void chord(std::size_t m, const DiscField& source, DiscField& radiance, std::size_t active, DiscReal* exit);

    const DiscGrid& grid_;
    double extinction_;
    std::vector<std::vector<Cell>> cells_;
    DiscField along_, flux_, coefficients_[2];
};

}  // namespace medulla::sim2d
