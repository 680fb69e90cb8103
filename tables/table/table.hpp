// A simulated table in memory: axes, normalised lobes, energies, errors and provenance.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tables/table/axis.hpp"

namespace medulla::tables {

/// Which table. The numbers are part of the slice files' format.
enum class TableId : std::uint32_t { azimuthal = 0, longitudinal = 1 };
inline constexpr TableId table_ids[] = {TableId::azimuthal, TableId::longitudinal};
const char* name_of(TableId table);  ///< "azimuthal" or "longitudinal"

/// C^N or C^M on its nodes. The last axis is the exit direction; the others index a lobe ("cell"), row-major.
/// Azimuthal: sigma, g, [absorption,] h, phi. Longitudinal: sigma, g, theta_i, side, theta_r.
struct Table {
    TableId id = TableId::azimuthal;
    std::vector<Axis> axes;                    ///< in the order of the array
    std::vector<float> lobe;                   ///< [cells][bins] density per radian, bin averages, integral 1
    std::vector<double> energy;                ///< [cells] scattered energy per unit incident energy
    std::vector<double> energy_error;          ///< [cells] its standard error (0: closed form)
    std::vector<double> standard_error;        ///< [cells] relative L2 error of the lobe
    std::vector<double> mean_length;           ///< [cells] mean path of the scattered light inside the medium [radii]
    std::string method;                        ///< of the request: auto, analog, mc or deterministic
    std::uint64_t seed = 0, paths = 0;         ///< of the random methods, else 0
    double target_error = 0, time_budget = 0;  ///< of the request (tables/job/request.hpp), 0 if not set

    const char* name() const { return name_of(id); }
    const Axis& axis(const std::string& name) const;
    bool has_axis(const std::string& name) const;
    const Axis& exit() const { return axes.back(); }
    std::size_t bins() const { return exit().size(); }
    std::size_t cells() const;
    /// Cells of one parameter point: both sides of the slab, or the one of the disc.
    std::size_t sides() const { return id == TableId::longitudinal ? 2 : 1; }
    const float* lobe_of(std::size_t cell) const { return lobe.data() + cell * bins(); }
    /// Index of a cell along every axis but the exit, for messages and verification.
    std::vector<std::size_t> position(std::size_t cell) const;
    /// "sigma 0.5, g 0.2, h 1" of a cell.
    std::string describe(std::size_t cell) const;
    /// Value of a parameter axis at a cell; throws Error if the table has no such axis.
    double parameter(std::size_t cell, const std::string& axis_name) const;
    void allocate();  ///< gives the arrays the size that the axes require, filled with zeros
};

/// Contents of a tables file.
struct Tables {
    std::optional<Table> azimuthal, longitudinal;
    std::string program;  ///< name and version of the program that wrote it

    std::optional<Table>& operator[](TableId id) { return id == TableId::azimuthal ? azimuthal : longitudinal; }
    const std::optional<Table>& operator[](TableId id) const { return const_cast<Tables&>(*this)[id]; }
    const Table& at(TableId id) const;  ///< throws Error if there is none
    Table& at(TableId id);
    std::vector<const Table*> present() const;
};

/// Scattered energy of a cell in closed form (both sides of the slab together); none where light is absorbed.
std::optional<double> closed_form_energy(const Table& table, std::size_t cell);

/// Throws Error that begins with `where` unless every lobe is a density (>= 0, integral 1), every energy the closed
/// form within five standard errors (with absorption: at most the energy of unabsorbed first collisions, and no more
/// than at less absorption), and every error and length >= 0.
void check_cells(const Table& table, const std::string& where);

/// For a table with an axis of absorption a: for each cell the length l = -log(energy / E) / a, so that exp(-a l) of
/// the light scattered without absorption is left. E is the closed form; at a = 0 l is its limit, the mean length.
/// Where E = 0 (sigma = 0, h = 1) it is computed from the integral of the mean length, -d log(energy) / da, over a.
/// Throws Error where a cell has no energy. Empty without such an axis.
std::vector<double> survival_lengths(const Table& azimuthal);

/// Value at `to` of the polynomial through the points (x, y).
double extrapolate(const std::vector<double>& x, const std::vector<double>& y, double to);

/// Lobes of one side of the longitudinal table, or of the azimuthal table: [cells of that side][bins].
std::vector<double> side_lobes(const Table& table, std::size_t side);

}  // namespace medulla::tables
