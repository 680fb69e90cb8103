// A table's lobes as tensors to decompose. Lobes mirror: f(-x, -y) = f(x, y) in the last parameter x (h or theta_i) and
// the exit direction y. So f is its part even in both plus its part odd in both, and each is stored for x, y >= 0 only.
// The exit axis becomes a spline fitted to bin averages; a part's tensor holds the spline's orthonormal coordinates, in
// which L2 errors are those of the bins. Non-negative factors know no parts: there the tensor is whole, in B-spline
// coefficients along every axis, so that factors >= 0 are densities everywhere and not only at the nodes.
#pragma once

#include <algorithm>
#include <vector>

#include "tables/pack/source.hpp"
#include "tables/pack/writer.hpp"
#include "tables/table/table.hpp"
#include "tensor/cp.hpp"

namespace medulla::tables {

/// What a pack keeps of a table for one kind of lobe, or its energies: a tensor that is to be decomposed.
struct Part {
    TableKind kind;
    Mirror mirror;          ///< even or odd; none for the energies
    tensor::Tensor values;  ///< [parameters ..][exit coordinates]; no exit axis for the energies
    double share = 1;       ///< |values| / |lobes of the kind|: what the part's relative error is multiplied with
    double exit_error = 0;  ///< relative L2 of the kind that the exit spline leaves of this part
    std::vector<PackedAxis> axes;       ///< the spaces, coefficients unset
    std::vector<Eigen::MatrixXd> maps;  ///< per parameter axis: factor of the tensor -> spline coefficients
    /// The same for the exit axis, even before odd: one for a part, both for whole lobes, none for the energies.
    std::vector<Eigen::MatrixXd> exit_maps;

    bool lobes() const { return is_lobe(kind); }
    /// Components of the pack for each component of the model.
    int copies() const { return static_cast<int>(std::max<std::size_t>(1, exit_maps.size())); }
    /// Bytes that one component of the model takes in a pack: rows of so many bits a number, a scale, an integral.
    double component_bytes(double bits) const;
};

/// Breakpoints of the exit splines on [0, pi] or [0, pi/2] over half of the `bins` bins of the full circle or half
/// circle: dense where lobes are narrow (docs/formats.md).
std::vector<double> exit_breakpoints(TableKind kind, std::size_t bins, std::size_t spans);

/// Spans of the exit splines over the full circle and the half circles.
struct ExitSpans {
    std::size_t azimuthal = 96, longitudinal_back = 128, longitudinal_forward = 128;

    std::size_t operator[](TableKind kind) const {
        return kind == TableKind::azimuthal           ? azimuthal
               : kind == TableKind::longitudinal_back ? longitudinal_back
                                                      : longitudinal_forward;
    }
};

/// The parts of one kind of lobe: even before odd. A part that is nothing but float rounding of its lobes is left out.
std::vector<Part> lobe_parts_of(const Tables& tables, TableKind kind, std::size_t spans);

/// The parts of every kind of lobe in the tables, of the slab's energies, and of what absorption leaves of the disc's;
/// kinds in the order of a pack.
std::vector<Part> parts_of(const Tables& tables, const ExitSpans& spans);

/// The same for factors >= 0: whole lobes. Errors of a model against these values are those of the table but for the
/// condition of the B-spline bases (a factor of two or so).
std::vector<Part> whole_lobes_of(const Tables& tables, const ExitSpans& spans);

/// Joins the models of one kind's parts (even first) into a table of the pack. Components of a part come in the order
/// in which rounding harms them, so that those of a block need about as many bits.
PackedTable join(const std::vector<const Part*>& parts, const std::vector<const tensor::CpModel*>& models,
                 std::pair<float, float> range);

}  // namespace medulla::tables
