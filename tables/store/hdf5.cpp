#include "tables/store/hdf5.hpp"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>

#include "tables/store/file.hpp"
#include "tables/store/zstd_filter.hpp"

namespace medulla::tables {
namespace {

constexpr std::size_t image_step = std::size_t{1} << 24;  // growth of a file in memory [bytes]
constexpr unsigned zstd_level = 9;
constexpr std::size_t longest_text = 65536;
constexpr std::size_t most_expansion = 1 << 15;  // of zstd: 128 KiB of equal bytes become a block of 4 bytes

/// Captures a file in memory when HDF5 closes it. (H5Fget_file_image returns one that is marked as open for writing.)
struct Image {
    unsigned char* bytes = nullptr;
    std::size_t size = 0;

    Image() = default;
    ~Image() { std::free(bytes); }
    Image(const Image&) = delete;
    Image& operator=(const Image&) = delete;

    void capture(hid_t access, const std::string& path) {
        H5FD_file_image_callbacks_t callbacks = {};
        callbacks.image_malloc = [](std::size_t n, H5FD_file_image_op_t, void*) { return std::malloc(n); };
        callbacks.image_memcpy = [](void* to, const void* from, std::size_t n, H5FD_file_image_op_t, void*) {
            return std::memcpy(to, from, n);
        };
        callbacks.image_realloc = [](void* old, std::size_t n, H5FD_file_image_op_t, void*) {
            return std::realloc(old, n);
        };
        callbacks.image_free = [](void* buffer, H5FD_file_image_op_t operation, void* self) -> herr_t {
            if (operation == H5FD_FILE_IMAGE_OP_FILE_CLOSE)
                static_cast<Image*>(self)->bytes = static_cast<unsigned char*>(buffer);
            else
                std::free(buffer);
            return 0;
        };
        callbacks.udata_copy = [](void* self) { return self; };
        callbacks.udata_free = [](void*) -> herr_t { return 0; };
        callbacks.udata = this;
        check(H5Pset_file_image_callbacks(access, &callbacks), path + ": HDF5 has no files in memory");
    }
};

/// Disables HDF5's own error messages.
void quiet() {
    static std::once_flag once;
    std::call_once(once, [] { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); });
}

}  // namespace

void check(herr_t status, const std::string& what) {
    if (status < 0) throw Error("{}", what);
}

Handle untracked(hid_t kind, const std::string& where) {
    const hid_t id = H5Pcreate(kind);
    if (id >= 0) H5Pset_obj_track_times(id, 0);
    return Handle(id, H5Pclose, where + ": HDF5 gives no property list");
}

void write_attribute(hid_t object, const char* name, const std::string& text, const std::string& where) {
    const std::string failed = fmt::format("{}: attribute {} cannot be written", where, name);
    const Handle type(H5Tcopy(H5T_C_S1), H5Tclose, failed);
    check(H5Tset_size(type, text.size() + 1), failed);
    check(H5Tset_cset(type, H5T_CSET_UTF8), failed);
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose, failed);
    const Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, failed);
    check(H5Awrite(attribute, type, text.c_str()), failed);
}

static void write_number(hid_t object, const char* name, const NumberType& type, const void* value,
                         const std::string& where) {
    const std::string failed = fmt::format("{}: attribute {} cannot be written", where, name);
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose, failed);
    const Handle attribute(H5Acreate2(object, name, type.file, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, failed);
    check(H5Awrite(attribute, type.memory, value), failed);
}

void write_attribute(hid_t object, const char* name, std::uint64_t value, const std::string& where) {
    write_number(object, name, {H5T_STD_U64LE, H5T_NATIVE_UINT64}, &value, where);
}

void write_attribute(hid_t object, const char* name, double value, const std::string& where) {
    write_number(object, name, {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE}, &value, where);
}

void write_array(hid_t group, const std::string& name, const std::vector<hsize_t>& shape, const NumberType& type,
                 const void* data, Compression compression, const std::vector<hsize_t>& chunk,
                 const std::string& where) {
    const std::string failed = fmt::format("{}/{}: cannot be written", where, name);
    const Handle properties = untracked(H5P_DATASET_CREATE, where);
    check(H5Pset_chunk(properties, static_cast<int>(chunk.size()), chunk.data()), failed);
    if (compression != Compression::none) check(H5Pset_shuffle(properties), failed);
    if (compression == Compression::gzip) check(H5Pset_deflate(properties, 6), failed);
    const unsigned level = zstd_level;
    if (compression == Compression::zstd)
        check(H5Pset_filter(properties, zstd_filter_id, H5Z_FLAG_MANDATORY, 1, &level), failed);
    check(H5Pset_fletcher32(properties), failed);
    const Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose, failed);
    const Handle set(H5Dcreate2(group, name.c_str(), type.file, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose,
                     failed);
    check(H5Dwrite(set, type.memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, data), failed);
}

void write_hdf5(const Output& output, const std::function<void(hid_t)>& fill, const std::string& temporary) {
    const std::string& path = output.path();
    quiet();
    register_zstd_filter();
    Image image;
    {
        const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, path + ": HDF5 gives no property list");
        check(H5Pset_libver_bounds(access, H5F_LIBVER_V110, H5F_LIBVER_V110), path + ": HDF5 1.10 or later is needed");
        check(H5Pset_fapl_core(access, image_step, false), path + ": HDF5 has no files in memory");
        image.capture(access, path);
        const Handle create = untracked(H5P_FILE_CREATE, path);
        const Handle file(H5Fcreate(temporary_name(path).c_str(), H5F_ACC_TRUNC, create, access), H5Fclose,
                          path + ": cannot be written");
        fill(file);
        check(H5Fflush(file, H5F_SCOPE_LOCAL), path + ": cannot be written");
        const ssize_t size = H5Fget_file_image(file, nullptr, 0);
        image.size = size > 0 ? static_cast<std::size_t>(size) : 0;
    }
    if (!image.bytes || image.size == 0) throw Error("{}: HDF5 gives no file", path);
    output.write(image.bytes, image.size, temporary);
}

Handle open_hdf5(const std::string& path, const char* what) {
    quiet();
    register_zstd_filter();
    if (!is_hdf5(path)) {
        require_readable(path);
        throw Error("{}: expected {} (HDF5), found something else", path, what);
    }
    const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, path + ": HDF5 gives no property list");
#if H5_VERSION_GE(1, 10, 7)
    check(H5Pset_file_locking(access, false, true), path + ": HDF5 gives no property list");
#endif
    return Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose, path + ": damaged HDF5 file");
}

std::string read_text(hid_t object, const char* name, const std::string& where) {
    const std::string failed = fmt::format("{}: expected text in attribute {}, found none", where, name);
    const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, failed);
    const Handle type(H5Aget_type(attribute), H5Tclose, failed);
    const Handle space(H5Aget_space(attribute), H5Sclose, failed);
    if (H5Tget_class(type) != H5T_STRING || H5Sget_simple_extent_npoints(space) != 1) throw Error("{}", failed);
    std::string text;
    if (H5Tis_variable_str(type) > 0) {
        const Handle memory(H5Tcopy(type), H5Tclose, failed);
        char* value = nullptr;
        check(H5Aread(attribute, memory, &value), failed);
        const std::unique_ptr<char, herr_t (*)(void*)> owned(value, H5free_memory);
        if (value) text.assign(value, ::strnlen(value, longest_text + 1));
    } else {
        const std::size_t size = H5Tget_size(type);
        if (size == 0 || size > longest_text) throw Error("{}", failed);
        text.resize(size);
        check(H5Aread(attribute, type, text.data()), failed);
        text.resize(::strnlen(text.data(), size));
        if (H5Tget_strpad(type) == H5T_STR_SPACEPAD) text.erase(text.find_last_not_of(' ') + 1);
    }
    if (text.size() > longest_text)
        throw Error("{}: expected at most {} bytes of text in attribute {}", where, longest_text, name);
    return text;
}

std::uint64_t read_whole(hid_t object, const char* name, const std::string& where) {
    const std::string failed = fmt::format("{}: expected a whole number in attribute {}, found none", where, name);
    const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, failed);
    const Handle type(H5Aget_type(attribute), H5Tclose, failed);
    const Handle space(H5Aget_space(attribute), H5Sclose, failed);
    if (H5Tget_class(type) != H5T_INTEGER || H5Sget_simple_extent_npoints(space) != 1) throw Error("{}", failed);
    if (H5Tget_sign(type) == H5T_SGN_2) {
        std::int64_t number = 0;  // HDF5 would convert negative numbers to 0
        check(H5Aread(attribute, H5T_NATIVE_INT64, &number), failed);
        if (number < 0) throw Error("{}: expected 0 or more in attribute {}, found {}", where, name, number);
    }
    std::uint64_t value = 0;
    check(H5Aread(attribute, H5T_NATIVE_UINT64, &value), failed);
    return value;
}

double read_optional(hid_t object, const char* name, const std::string& where) {
    const htri_t exists = H5Aexists(object, name);
    if (exists == 0) return 0;
    const std::string failed = fmt::format("{}: expected a number above 0 in attribute {}", where, name);
    check(exists, failed);
    const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, failed);
    const Handle type(H5Aget_type(attribute), H5Tclose, failed);
    const Handle space(H5Aget_space(attribute), H5Sclose, failed);
    const H5T_class_t number = H5Tget_class(type);
    if ((number != H5T_FLOAT && number != H5T_INTEGER) || H5Sget_simple_extent_npoints(space) != 1)
        throw Error("{}", failed);
    double value = 0;
    check(H5Aread(attribute, H5T_NATIVE_DOUBLE, &value), failed);
    if (!(std::isfinite(value) && value > 0)) throw Error("{}, found {:g}", failed, value);
    return value;
}

std::string shape_text(const std::vector<hsize_t>& shape) {
    std::string text;
    for (const hsize_t n : shape) text += (text.empty() ? "" : " x ") + std::to_string(n);
    return text;
}

/// Throws Error unless a dataset is stored as by write_array: chunks within the array, numbers of at most 8 bytes, only
/// the filters used there. HDF5 allocates memory by these properties before it reads.
static void check_storage(hid_t set, hid_t type, const std::vector<hsize_t>& shape, const std::string& where) {
    const Handle properties(H5Dget_create_plist(set), H5Pclose, where + ": cannot be read");
    std::vector<hsize_t> chunk(shape.size());
    if (H5Tget_size(type) > 8 || H5Pget_layout(properties) != H5D_CHUNKED ||
        H5Pget_chunk(properties, static_cast<int>(chunk.size()), chunk.data()) != static_cast<int>(chunk.size()))
        throw Error("{}: expected an array in chunks", where);
    for (std::size_t k = 0; k < chunk.size(); ++k)
        if (chunk[k] < 1 || chunk[k] > shape[k])
            throw Error("{}: expected chunks within shape {}, found {}", where, shape_text(shape), shape_text(chunk));
    const int filters = H5Pget_nfilters(properties);
    int compressors = 0;
    for (int i = 0; i < filters; ++i) {
        unsigned flags = 0, config = 0;
        std::size_t count = 0;
        const H5Z_filter_t id =
            H5Pget_filter2(properties, static_cast<unsigned>(i), &flags, &count, nullptr, 0, nullptr, &config);
        if (id != H5Z_FILTER_SHUFFLE && id != H5Z_FILTER_DEFLATE && id != H5Z_FILTER_FLETCHER32 && id != zstd_filter_id)
            throw Error("{}: expected shuffle, gzip, zstd and Fletcher-32 filters, found filter {}", where, id);
        // Only one compression: in sequence their expansion factors multiply (gzip alone 1032, zstd up to a chunk).
        compressors += id == H5Z_FILTER_DEFLATE || id == zstd_filter_id;
        if (compressors > 1) throw Error("{}: expected one compression, found several", where);
    }
}

template <class T>
std::vector<T> read_array(hid_t group, const std::string& name, hid_t memory, const std::vector<hsize_t>& expected,
                          const std::string& where, bool may_be_infinite) {
    const std::string failed = fmt::format("{}/{}: cannot be read", where, name);
    const Handle set(H5Dopen2(group, name.c_str(), H5P_DEFAULT), H5Dclose,
                     fmt::format("{}/{}: expected a dataset, found none", where, name));
    const Handle space(H5Dget_space(set), H5Sclose, failed);
    const Handle type(H5Dget_type(set), H5Tclose, failed);
    const int rank = H5Sget_simple_extent_ndims(space);
    std::vector<hsize_t> shape(rank > 0 ? static_cast<std::size_t>(rank) : 0);
    if (rank <= 0 || rank > 8 || H5Sget_simple_extent_dims(space, shape.data(), nullptr) < 0)
        throw Error("{}/{}: expected an array, found none", where, name);
    if (H5Tget_class(type) != H5T_FLOAT) throw Error("{}/{}: expected floating-point numbers", where, name);
    if (!expected.empty() && shape != expected)
        throw Error("{}/{}: expected shape {}, found {}", where, name, shape_text(expected), shape_text(shape));
    if (expected.empty() && (rank != 1 || shape[0] < 1 || shape[0] > 4096))
        throw Error("{}/{}: expected 1 to 4096 values, found shape {}", where, name, shape_text(shape));
    check_storage(set, type, shape, fmt::format("{}/{}", where, name));
    std::size_t count = 1;
    for (const hsize_t n : shape) count *= n;
    // Limits memory for damaged files: at most what the stored bytes can expand to.
    const hsize_t stored = H5Dget_storage_size(set);
    if (count * sizeof(T) > most_expansion * stored + 4096)
        throw Error("{}/{}: expected data, found {} bytes for shape {}", where, name, stored, shape_text(shape));
    std::vector<T> values(count);
    check(H5Dread(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()),
          failed + ": its bytes are damaged or its filter is missing");
    for (std::size_t i = 0; i < count; ++i)
        if (may_be_infinite ? std::isnan(values[i]) : !std::isfinite(values[i]))
            throw Error("{}/{}: expected finite values, found {} as number {}", where, name, values[i], i);
    return values;
}

template std::vector<float> read_array(hid_t, const std::string&, hid_t, const std::vector<hsize_t>&,
                                       const std::string&, bool);
template std::vector<double> read_array(hid_t, const std::string&, hid_t, const std::vector<hsize_t>&,
                                        const std::string&, bool);

}  // namespace medulla::tables
