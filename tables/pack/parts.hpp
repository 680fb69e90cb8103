// A table's lobes as tensors for the decomposition. Lobes are mirror-symmetric: f(-x, -y) = f(x, y) in the last
// parameter x (h or theta_i) and the exit direction y. So f is the sum of a part even in both and a part odd in both,
// and each is stored for x, y >= 0 only. Bin averages over the exit axis are fitted by a spline; a part's tensor has
// its orthonormal coordinates, in which L2 errors equal those of the bins. Non-negative factors do not split lobes:
// there the tensor is the whole lobe in B-spline coefficients along every axis, so that factors >= 0 give densities
// everywhere, not only at the nodes.
#pragma once

#include <algorithm>
#include <vector>

#include "tables/pack/source.hpp"
#include "tables/pack/writer.hpp"
#include "tables/table/table.hpp"
#include "tensor/cp.hpp"

namespace medulla::tables {

/// One tensor to decompose: the even or odd part of a kind of lobe, or its energies.
struct Part {
    TableKind kind;
    Mirror mirror;          ///< even or odd; none for the energies
    tensor::Tensor values;  ///< [parameters ..][exit coordinates]; no exit axis for the energies
    double share = 1;       ///< |values| / |lobes of the kind|: factor from the part's relative error to the kind's
    double exit_error = 0;  ///< relative L2 error of the kind from the exit spline of this part
    std::vector<PackedAxis> axes;       ///< the spaces, coefficients unset
    std::vector<Eigen::MatrixXd> maps;  ///< per parameter axis: factor of the tensor -> spline coefficients
    /// The same for the exit axis, even before odd: one for a part, both for whole lobes, none for the energies.
    std::vector<Eigen::MatrixXd> exit_maps;

    bool lobes() const { return is_lobe(kind); }
    /// Components of the pack per component of the model.
    int copies() const { return static_cast<int>(std::max<std::size_t>(1, exit_maps.size())); }
    /// Bytes of one component of the model in a pack at `bits` per number: its rows, a scale, an integral.
    double component_bytes(double bits) const;
};

/// Breakpoints of the exit splines on [0, pi] (azimuthal, `bins` on the full circle) or [0, pi/2], denser where lobes
/// are narrow (docs/formats.md).
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

/// The parts of one kind of lobe: even before odd. An odd part that is only float rounding is left out.
std::vector<Part> lobe_parts_of(const Tables& tables, TableKind kind, std::size_t spans);

/// The parts of every kind of lobe, of the slab's energies and of the disc's survival lengths; kinds in the order of a
/// pack.
std::vector<Part> parts_of(const Tables& tables, const ExitSpans& spans);

/// The same for factors >= 0: whole lobes. Errors of a model in these coordinates differ from those of the table by the
/// condition of the B-spline bases, up to about a factor of two.
std::vector<Part> whole_lobes_of(const Tables& tables, const ExitSpans& spans);

/// Joins the models of one kind's parts (even first) into a table of the pack. Components of a part are sorted by their
/// sensitivity to rounding, so that those of a block need about the same number of bits.
PackedTable join(const std::vector<const Part*>& parts, const std::vector<const tensor::CpModel*>& models,
                 std::pair<float, float> range);

}  // namespace medulla::tables
