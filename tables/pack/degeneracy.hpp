// How strongly the components of a pack cancel, from its bytes alone, so that `diff` and `verify` print what `compress`
// printed.
#pragma once

#include <utility>
#include <vector>

#include "medulla/pack.hpp"
#include "tensor/cp.hpp"

namespace medulla::tables {

/// For each table of the pack, in order: of all its components, even and odd, as functions on the nodes and over the
/// whole exit axis.
using PackDegeneracy = std::vector<std::pair<TableKind, tensor::Degeneracy>>;
PackDegeneracy degeneracy_of(const PackView& pack);

}  // namespace medulla::tables
