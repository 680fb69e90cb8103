// Factors -> bytes of a pack, the counterpart of medulla/pack.hpp.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "medulla/pack.hpp"
#include "tables/pack/spline.hpp"

namespace medulla::tables {

/// One axis of a low-rank table: the spline space and its coefficients, [spline.size() x rank].
struct PackedAxis {
    Quantity quantity;
    std::uint32_t nodes;  ///< of the simulated table
    Spline spline;
    Eigen::MatrixXd coefficients;
};

/// value = sum over r of weights[r] * product over axes of (spline of column r). The exit axis is the half y >= 0: the
/// first `even_rank` components are their own mirror image, the others change sign. Components of each are stored in
/// blocks of eight, the last one padded with zeros.
struct PackedTable {
    TableKind kind;
    std::vector<PackedAxis> axes;  ///< the last one of a lobe is the exit direction
    Eigen::VectorXd weights;
    int even_rank;
    float low, high;                       ///< smallest and largest value of the simulated table
    std::vector<std::uint32_t> bits = {};  ///< of each block: 4, 8, 12 or 16; empty: 16 all
    bool paired = false;  ///< even and odd components come in pairs with equal factors of the parameter axes
    /// Per component: squared relative error of the table from rounding to units of its largest coefficients.
    Eigen::VectorXd rounding = {};

    bool has_exit() const { return is_lobe(kind); }
    std::uint32_t even_stride() const { return padded_rank(static_cast<std::uint32_t>(even_rank)); }
    std::uint32_t stride() const {
        return even_stride() + padded_rank(static_cast<std::uint32_t>(weights.size() - even_rank));
    }
    /// Where component r is stored: even ones from 0 on, odd ones from the next multiple of eight on.
    std::uint32_t place(Eigen::Index r) const {
        return static_cast<std::uint32_t>(r < even_rank ? r : r - even_rank + even_stride());
    }
    /// Rows of all axes together.
    std::size_t rows() const;
};

/// Largest stored integer: the scale of a column maps its largest coefficient to it.
inline int greatest_of(std::uint32_t bits) { return (1 << (bits - 1)) - 1; }

/// Writes the tables as a pack.
std::vector<unsigned char> write_pack(const std::vector<PackedTable>& tables, const std::string& provenance);

}  // namespace medulla::tables
