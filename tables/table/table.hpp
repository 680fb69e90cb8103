// A simulated table in memory: axes, normalised lobes, energies, errors, and where it all comes from.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tables/table/axis.hpp"

namespace medulla::tables {

/// C^N or C^M on its nodes. The last axis is the exit direction; the others index a lobe ("cell"), row-major.
/// Azimuthal: sigma, g, [absorption,] h, phi. Longitudinal: sigma, g, theta_i, side, theta_r.
struct Table {
    std::string name;                          ///< "azimuthal" or "longitudinal"
    std::vector<Axis> axes;                    ///< in the order of the array
    std::vector<float> lobe;                   ///< [cells][bins] density per radian, bin averages, integral 1
    std::vector<double> energy;                ///< [cells] scattered energy per unit incident energy
    std::vector<double> energy_error;          ///< [cells] its standard error (0: closed form)
    std::vector<double> standard_error;        ///< [cells] relative L2 error of the lobe
    std::vector<double> mean_length;           ///< [cells] mean path of the scattered light inside the medium [radii]
    std::string method;                        ///< how it was solved
    std::uint64_t seed = 0, paths = 0;         ///< of the random methods; 0 otherwise
    double target_error = 0, time_budget = 0;  ///< of the request (tables/job/request.hpp); 0: not set

    const Axis& axis(const std::string& name) const;
    bool has_axis(const std::string& name) const;
    const Axis& exit() const { return axes.back(); }
    std::size_t bins() const { return exit().size(); }
    std::size_t cells() const;
    const float* lobe_of(std::size_t cell) const { return lobe.data() + cell * bins(); }
    /// Index of a cell along every axis but the exit, for messages and verification.
    std::vector<std::size_t> position(std::size_t cell) const;
    /// "sigma 0.5, g 0.2, h 1" of a cell.
    std::string describe(std::size_t cell) const;
    /// Value of a parameter axis at a cell; throws Error if the table has no such axis.
    double parameter(std::size_t cell, const std::string& axis_name) const;
    void allocate();  ///< sizes the arrays after the axes
};

/// What a tables file holds.
struct Tables {
    std::optional<Table> azimuthal, longitudinal;
    std::string program;  ///< name and version of the program that wrote it

    std::vector<const Table*> present() const;
};

/// Scattered energy of a cell in closed form (both sides together for the slab); no value where light is absorbed.
std::optional<double> closed_form_energy(const Table& table, std::size_t cell);

/// Throws Error that begins with `where` unless every lobe is a density (>= 0, integral 1), every energy what is
/// scattered in closed form (within five standard errors; where light is absorbed, at most what is left of the first
/// collisions and no more than at less absorption), every error and length >= 0.
void check_cells(const Table& table, const std::string& where);
/// Where a table has an axis of absorption a: for each cell the length l by which exp(-a l) of the light that is
/// scattered without absorption is left, -log(energy / E) / a, E in closed form; at a = 0 the mean length, its limit.
/// Where E = 0 (sigma = 0, h = 1) it is the integral of the mean length over the absorption, -d log(energy) / da, which
/// is known there too. Throws Error where a cell has no energy. Without such an axis: empty.
std::vector<double> survival_lengths(const Table& azimuthal);

/// The polynomial through (x, y) at another place.
double extrapolate(const std::vector<double>& x, const std::vector<double>& y, double to);

/// Lobe of one side of a longitudinal table, or the azimuthal table, as an array [cells of that side][bins].
std::vector<double> side_lobes(const Table& table, std::size_t side);

}  // namespace medulla::tables
