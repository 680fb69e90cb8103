// How far the components of a pack cancel, from its bytes alone: what `compress` reports, `diff` and `verify` find
// again.
#pragma once

#include <utility>
#include <vector>

#include "medulla/pack.hpp"
#include "tensor/cp.hpp"

namespace medulla::tables {

/// For each table that the pack has, in their order: of all its components, even and odd, as functions on its nodes and
/// over the whole exit axis.
using PackDegeneracy = std::vector<std::pair<TableKind, tensor::Degeneracy>>;
PackDegeneracy degeneracy_of(const PackView& pack);

}  // namespace medulla::tables
