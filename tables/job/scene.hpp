// A scene's needs: the part of the tables' axes that its materials can ask for, on the tables' own nodes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tables/job/material.hpp"
#include "tables/job/request.hpp"

namespace medulla::tables {

/// What one material can ask the tables for, over all theta_i and h.
struct Needs {
    double sigma_low, sigma_high;            ///< sigma_ms kappa / cos theta_t: theta_t from 0 to asin(1 / eta)
    double absorption_low, absorption_high;  ///< sigma_ma kappa / cos theta_t likewise
    double g;
    double h_high;  ///< min(1, 1 / (eta kappa)): eta' >= eta
};

/// None where the material has no scattering medulla: it never reads a table.
std::optional<Needs> needs_of(const FurParameters<3>& fur);

/// The request's nodes that the materials need: those around each interval and one more on either side, which a cubic
/// takes. theta_i stays whole. Nodes keep their values, so that cells are the same as in the whole tables (but with a
/// target error, where one choice of grids serves all offsets of a slice).
/// @param notes where an axis ends before a material's needs do, one line each   @throws Error that names material
/// and axis where the axis holds nothing of what a material needs, or where no material needs a table
Request restrict_to(const Request& request, const std::vector<Material>& materials, std::vector<std::string>& notes);

}  // namespace medulla::tables
