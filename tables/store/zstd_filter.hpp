// HDF5 filter 32015 (zstd), registered in this process without a plugin on disk; python's hdf5plugin reads it.
#pragma once

namespace medulla::tables {

inline constexpr int zstd_filter_id = 32015;

/// Registers the filter once; throws Error if HDF5 refuses it. A chunk is a zstd frame with a content checksum.
void register_zstd_filter();

}  // namespace medulla::tables
