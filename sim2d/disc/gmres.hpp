// GMRES (Saad and Schultz 1986) on the columns of a field; each column is an independent linear system.
#pragma once

#include <functional>

#include "sim2d/disc/transport.hpp"

namespace medulla::sim2d {

struct DiscIteration {
    DiscField solution;
    int iterations = 0;
    double residual = 0;    ///< of the worst column; column 0 against itself, the others against the largest of them
    bool converged = true;  ///< false: stopped by the limit of steps
    double left = 0;  ///< then: norm of the residual / norm of the solution, the larger of column 0 and the others
};

/// out = A in for columns [0, active), active a multiple of 8.
using DiscOperator = std::function<void(const DiscField& in, DiscField& out, std::size_t active)>;

/// Solves (1 - A) x = right_side until every column's residual is below `tolerance`, in `most` steps at most; converged
/// high columns drop out.
DiscIteration gmres(const DiscOperator& apply, DiscField right_side, std::size_t stride, double tolerance,
                    std::size_t most);

}  // namespace medulla::sim2d
