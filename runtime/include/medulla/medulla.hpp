// medulla: light in a fur fibre, for any renderer. The only header to include: C++17, the standard library alone, no
// allocation, no exceptions, no globals with constructors; every function is pure and safe to call from any thread.
//
//   const PackView pack = default_pack();                    // once per program; open_pack(bytes, count) for others
//   const TableRanges ranges = ranges_of(parameters);        // once per coat; join(a, b) covers two materials
//   const std::size_t bytes = tables_bytes(pack, ranges);    // memory of yours, aligned to 64 bytes
//   const DenseTables* tables = make_tables(pack, ranges, memory, bytes).tables;
//
//   const Fibre<3> fibre = make_fibre(parameters, tables);   // at a hit, or once: 13 numbers, textured or not
//   const NearField<3> hit = near_field(fibre, known, h);    // a ray that meets the fibre at offset h
//   const FarField<3> hit = far_field(fibre, known);         // the mean over its width, or over Offsets{a, b}
//
//   hit.value(drawn)              // energy per steradian: multiplies the light of `drawn` as it is, without a cosine
//   hit.pdf(drawn)                // density of sample(), per steradian
//   hit.evaluate(drawn)           // both, at the price of one
//   hit.sample(numbers)           // a direction with its value, pdf and weight = value / pdf
//   hit.keep(lobe_bit(Lobe::R))   // the same hit with some of the lobes
//
// Frame. `known` is the direction that the renderer has (the camera ray's in a path tracer), `drawn` the other one.
// Both point away from the fibre, in its own frame: x along the fibre from ROOT to TIP, (y, z) across it. h =
// offset_of(known, point) in [-1, 1] is the ray's distance from the axis in fibre radii, to the left of its direction
// of travel.
//
// Angles are the papers', whose axis runs from tip to root: theta = -asin x. Every function above takes Angles{theta,
// phi} in place of a Vector too; hit.lobes(theta_r, phi) has M and N of each lobe, and hit.eq12(theta_r, phi) is S of
// Eq. 12 of Yan, Jensen and Ramamoorthi 2017, for comparison with the paper.
//
// Lengths are in fibre radii, coefficients per fibre radius, angles in radians. docs/bcsdf.md has the formulas and
// docs/integrations.md what to watch for in a renderer.
#pragma once

#include "medulla/config.hpp"

#include "medulla/default_pack.hpp"
#include "medulla/pack.hpp"

#include "medulla/fur_parameters.hpp"
#include "medulla/lookup.hpp"
#include "medulla/tables.hpp"

#include "medulla/batch.hpp"
#include "medulla/far_field.hpp"
#include "medulla/fibre.hpp"
#include "medulla/near_field.hpp"
#include "medulla/vector.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// The pack that is built in, opened. Checking it takes some 0.2 ms.
inline PackView default_pack() noexcept { return open_pack(default_pack_words, default_pack_size).pack; }

}  // namespace MEDULLA_TARGET
}  // namespace medulla
