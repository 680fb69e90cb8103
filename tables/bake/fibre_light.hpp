// Scattered light of one fibre over theta_i and |h|, simulated in three dimensions: what furtable compress bakes, and
// independent light to check it with.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tables/job/material.hpp"

namespace medulla::tables {

/// What is simulated of a material. Equal requests give equal light, for any number of threads.
struct FibreRequest {
    Material material;
    std::uint64_t paths = 400000;  ///< of each node of (theta_i, |h|)
    double target_error = 0;       ///< instead, if above 0: until a lobe has this relative L2 standard error
    std::uint64_t seed = 1;
    std::size_t inclinations = 13, offsets_inside = 13, offsets_beyond = 4;  ///< nodes; see BakedHeader
    std::size_t rows = 30, columns = 48;                                     ///< bins of theta_r and phi
    std::size_t checks = 12;             ///< independent lights at random (theta_i, h)
    std::uint64_t check_paths = 600000;  ///< of each
};

/// Light at one (theta_i, h): energy per radian^2 of (theta_r, phi), averaged over bins, for each absorption.
struct LightCell {
    double theta_i = 0, h = 0;   ///< [radians], [fibre radii]
    double R = 0, entered = 0;   ///< energies without absorption: of R; of TT, TRT and higher orders
    double scattered = 0;        ///< and of what scatters
    std::vector<float> density;  ///< [absorption][theta_r][phi]
    std::vector<float> error;    ///< its standard error
};

struct FibreLight {
    FibreRequest request;
    std::string program;
    std::vector<double> sigma_ca, check_sigma_ca;  ///< [1 / fibre radius]
    std::vector<LightCell> cells;                  ///< [theta_i][|h|]
    std::vector<LightCell> checks;

    std::size_t bins() const { return request.rows * request.columns; }
};

/// Throws Error that names the field unless the fibre can be simulated and has a medulla that scatters.
void check_fibre_request(const FibreRequest& request, const std::string& where);

/// Nodes without light: what will be simulated.
FibreLight plan_of(const FibreRequest& request);

/// Simulates one of plan.cells, or of plan.checks after them. From any thread.
LightCell simulate_cell(const FibreLight& plan, std::size_t i);

/// BakedHeader::sigma_middle [1 / fibre radius].
inline constexpr float middle_of_absorption = 3.295f;

/// The greatest theta_i of a node [radians].
inline constexpr double greatest_inclination = 85 * pi / 180;

/// Relative L2 standard error of a lobe at the nodes, without absorption: the median.
double median_noise(const FibreLight& light);

/// Bytes of memory that the light of a request takes.
double light_bytes(const FibreRequest& request);

}  // namespace medulla::tables
