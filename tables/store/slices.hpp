// A job cut into slices: one (sigma, g) of one table, which is solved, kept and checked on its own. Also the two
// hashes: of a job's configuration (all that decides its bytes) and of a table's contents.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tables/store/sha256.hpp"
#include "tables/table/table.hpp"

namespace medulla::tables {

/// Most numbers in the lobes of one slice, which is one chunk of the tables file.
inline constexpr std::size_t most_slice_values = 4096 * 4096;

/// Place of a slice: indices into the table's sigma and g axes.
struct SliceId {
    TableId table = TableId::azimuthal;
    std::uint32_t sigma = 0, g = 0;

    bool operator==(const SliceId& other) const { return table == other.table && sigma == other.sigma && g == other.g; }
};

/// What is solved for one slice; arrays as in Table, for the cells of the slice.
struct Slice {
    std::size_t cells = 0, bins = 0;
    std::vector<float> lobe;                                                ///< [cells][bins]
    std::vector<double> energy, energy_error, standard_error, mean_length;  ///< [cells]

    Slice() = default;
    Slice(std::size_t cell_count, std::size_t bin_count);  ///< zeros
};

/// The arrays of a table or slice in the order of shards, hashes and copies.
template <class T>
auto cell_arrays(T& of) {
    return std::array{&of.energy, &of.energy_error, &of.standard_error, &of.mean_length};
}

/// Cells of one slice of a table: everything behind sigma and g but the exit direction.
std::size_t slice_cells(const Table& table);

/// All slices of the tables present, azimuthal first, g fastest. `plan` needs its axes only.
std::vector<SliceId> slices_of(const Tables& plan);

/// Copies a slice into its place in an allocated table, or out of it.
void put_slice(Tables& tables, const SliceId& id, const Slice& slice);
Slice take_slice(const Tables& tables, const SliceId& id);

/// "azimuthal sigma 2, g 0.4"
std::string describe(const Tables& plan, const SliceId& id);

/// Canonical JSON of everything that decides a job's bytes: program and its version, methods, seeds, paths, and every
/// axis value as a hexadecimal float. Equal text means equal results.
std::string configuration_text(const Tables& plan);
Digest configuration_hash(const Tables& plan);

/// SHA-256 of the decoded datasets: for each table present (azimuthal, longitudinal) its name, then for each axis in
/// order and for lobe, energy, energy_error, standard_error, mean_length: name, number of values (u64), values; names
/// end with a zero byte, numbers are little-endian (axes and cells float64, lobe float32).
Digest contents_hash(const Tables& tables);

}  // namespace medulla::tables
