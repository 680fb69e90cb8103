#include "tables/store/zstd_filter.hpp"

#include <hdf5.h>
#include <zstd.h>

#include <cstdlib>
#include <memory>

#include "tables/error.hpp"
#include "tables/store/slices.hpp"

namespace medulla::tables {
namespace {

// A chunk is one (sigma, g) slice of floats.
constexpr unsigned long long greatest_chunk = most_slice_values * sizeof(float);

struct ContextDeleter {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};

/// Replaces *buffer by `fresh`; HDF5 frees and allocates chunk buffers with the C library's functions.
std::size_t replace(void** buffer, std::size_t* buffer_size, void* fresh, std::size_t capacity, std::size_t used) {
    if (ZSTD_isError(used)) {
        std::free(fresh);
        return 0;
    }
    std::free(*buffer);
    *buffer = fresh;
    *buffer_size = capacity;
    return used;
}

std::size_t filter(unsigned flags, std::size_t count, const unsigned values[], std::size_t size,
                   std::size_t* buffer_size, void** buffer) {
    if (flags & H5Z_FLAG_REVERSE) {
        const unsigned long long content = ZSTD_getFrameContentSize(*buffer, size);
        if (content == ZSTD_CONTENTSIZE_UNKNOWN || content == ZSTD_CONTENTSIZE_ERROR || content > greatest_chunk)
            return 0;
        void* fresh = std::malloc(content > 0 ? content : 1);
        if (!fresh) return 0;
        return replace(buffer, buffer_size, fresh, content, ZSTD_decompress(fresh, content, *buffer, size));
    }
    const std::unique_ptr<ZSTD_CCtx, ContextDeleter> context(ZSTD_createCCtx());
    const std::size_t capacity = ZSTD_compressBound(size);
    void* fresh = context ? std::malloc(capacity) : nullptr;
    if (!fresh) return 0;
    ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, count > 0 ? static_cast<int>(values[0]) : 3);
    ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
    return replace(buffer, buffer_size, fresh, capacity, ZSTD_compress2(context.get(), fresh, capacity, *buffer, size));
}

}  // namespace

void register_zstd_filter() {
    static const bool registered = [] {
        const H5Z_class2_t description = {H5Z_CLASS_T_VERS, zstd_filter_id, 1, 1, "zstd", nullptr, nullptr, filter};
        return H5Zregister(&description) >= 0;
    }();
    if (!registered) throw Error("HDF5 refuses filter {} (zstd)", zstd_filter_id);
}

}  // namespace medulla::tables
