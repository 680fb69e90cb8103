// Factors -> pack bytes: the writing half of medulla/pack.hpp.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "medulla/pack.hpp"
#include "tables/spline.hpp"

namespace medulla::tables {

/// One axis of a low-rank table: the spline space and its coefficients, [spline.size() x rank].
struct PackedAxis {
    Quantity quantity;
    std::uint32_t nodes;  ///< of the table it was made from
    Spline spline;
    Eigen::MatrixXd coefficients;
};

/// value = sum over r of weights[r] * product over axes of (spline of column r). The exit axis is the half y >= 0: the
/// first `even_rank` components are their own mirror image, the others change sign.
struct PackedTable {
    TableKind kind;
    std::vector<PackedAxis> axes;  ///< the last one of a lobe is the exit direction
    Eigen::VectorXd weights;
    int even_rank;
    float low, high;  ///< least and greatest value of the table it was made from

    bool has_exit() const { return is_lobe(kind); }
};

/// Lays the tables out as a pack. Columns are stored as 12-bit numbers with one scale per component (relative
/// rounding of a column's greatest coefficient: 2^-12).
std::vector<unsigned char> write_pack(const std::vector<PackedTable>& tables, const std::string& provenance);

}  // namespace medulla::tables
