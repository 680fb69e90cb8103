// Restricts a request to a scene: the nodes of the axes that its materials can look up.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tables/job/material.hpp"
#include "tables/job/request.hpp"

namespace medulla::tables {

/// Ranges that one material can look up, over all theta_i and h.
struct Needs {
    double sigma_low, sigma_high;            ///< sigma_ms kappa / cos theta_t: theta_t from 0 to asin(1 / eta)
    double absorption_low, absorption_high;  ///< sigma_ma kappa / cos theta_t likewise
    double g;
    double h_high;  ///< min(1, 1 / (eta kappa)): eta' >= eta
};

/// None for a material without a scattering medulla, which uses no table.
std::optional<Needs> needs_of(const FurParameters<3>& fur);

/// The request's nodes that the materials need: those around each range and one more on either side for the cubic
/// interpolation. theta_i stays complete. Nodes keep their values, so cells are the same as in the complete tables,
/// except with a target error, where one choice of grids serves all offsets of a slice.
/// @param notes one line for each range that extends beyond its axis   @throws Error that names material and axis if
/// the axis covers nothing of a range, or if no material needs a table
Request restrict_to(const Request& request, const std::vector<Material>& materials, std::vector<std::string>& notes);

}  // namespace medulla::tables
