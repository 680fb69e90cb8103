// HDF5 filter 32015 (zstd), registered in this process: what python's hdf5plugin reads, without a plugin on disk.
#pragma once

namespace medulla::tables {

inline constexpr int zstd_filter_id = 32015;

/// Registers the filter once; throws Error if HDF5 refuses it. A chunk is one zstd frame with its content checksum.
void register_zstd_filter();

}  // namespace medulla::tables
