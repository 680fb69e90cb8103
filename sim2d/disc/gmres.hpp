// GMRES (Saad and Schultz 1986) on the columns of a field, each a linear system of its own.
#pragma once

#include <functional>

#include "sim2d/disc/transport.hpp"

namespace medulla::sim2d {

struct DiscIteration {
    DiscField solution;
    int iterations = 0;
    double residual = 0;  ///< of the worst column; column 0 against itself, the others against the largest of them
};

/// out = A in for columns [0, active), active a multiple of 8.
using DiscOperator = std::function<void(const DiscField& in, DiscField& out, std::size_t active)>;

/// Solves (1 - A) x = right_side until every column's residual is below `tolerance` (60 steps at most); converged
/// high columns drop out.
DiscIteration gmres(const DiscOperator& apply, DiscField right_side, std::size_t stride, double tolerance);

}  // namespace medulla::sim2d
