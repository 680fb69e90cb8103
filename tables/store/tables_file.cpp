#include "tables/store/tables_file.hpp"

#include <hdf5.h>
#include <hdf5_hl.h>
#include <sys/stat.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <mutex>

#include "tables/error.hpp"
#include "tables/store/file.hpp"
#include "tables/store/slices.hpp"
#include "tables/store/zstd_filter.hpp"

namespace medulla::tables {
namespace {

constexpr const char* format_name = "medulla tables";
constexpr std::uint64_t format_version = 2, first_with_hash = 2;
constexpr std::size_t image_step = std::size_t{1} << 24;  // bytes by which a file in memory grows
constexpr unsigned zstd_level = 9;
constexpr std::size_t longest_text = 65536;
constexpr std::size_t most_expansion = 1 << 15;  // zstd: 128 KiB of equal bytes are a block of 4 bytes

/// An HDF5 id that closes itself.
class Handle {
  public:
    Handle(hid_t id, herr_t (*close)(hid_t), const std::string& what) : id_(id), close_(close) {
        if (id_ < 0) throw Error("{}", what);
    }
    ~Handle() { close_(id_); }
    Handle(const Handle&) = delete;
    Handle& operator=(const Handle&) = delete;
    operator hid_t() const { return id_; }

  private:
    hid_t id_;
    herr_t (*close_)(hid_t);
};

void check(herr_t status, const std::string& what) {
    if (status < 0) throw Error("{}", what);
}

/// A file in memory as HDF5 leaves it when it closes it. (H5Fget_file_image gives one that is marked as being written.)
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

/// HDF5's own error printing is replaced by our one line.
void quiet() {
    static std::once_flag once;
    std::call_once(once, [] { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); });
}

// --- writing ---------------------------------------------------------------------------------------------------

Handle untracked(hid_t kind, const std::string& where) {
    // Times would make two equal runs differ.
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

struct NumberType {
    hid_t file, memory;
};

void write_number(hid_t object, const char* name, const NumberType& type, const void* value, const std::string& where) {
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

/// Writes one array in chunks, each with a checksum, whatever the compression: no flipped bit is read silently.
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

void attach_scales(hid_t group, const std::string& name, const std::vector<Axis>& axes, const std::string& where) {
    const std::string failed = fmt::format("{}/{}: dimension scales cannot be attached", where, name);
    const Handle set(H5Dopen2(group, name.c_str(), H5P_DEFAULT), H5Dclose, failed);
    for (std::size_t k = 0; k < axes.size(); ++k) {
        const Handle scale(H5Dopen2(group, axes[k].name.c_str(), H5P_DEFAULT), H5Dclose, failed);
        check(H5DSattach_scale(set, scale, static_cast<unsigned>(k)), failed);
        check(H5DSset_label(set, static_cast<unsigned>(k), axes[k].name.c_str()), failed);
    }
}

void describe_array(hid_t group, const std::string& name, const char* unit, const char* meaning,
                    const std::string& where) {
    const Handle set(H5Dopen2(group, name.c_str(), H5P_DEFAULT), H5Dclose, where);
    write_attribute(set, "unit", unit, where);
    write_attribute(set, "meaning", meaning, where);
}

void write_table(hid_t file, const Table& table, Compression compression, const std::string& path) {
    const std::string where = fmt::format("{}: /{}", path, table.name());
    const Handle properties = untracked(H5P_GROUP_CREATE, where);
    const Handle group(H5Gcreate2(file, table.name(), H5P_DEFAULT, properties, H5P_DEFAULT), H5Gclose,
                       where + ": cannot be written");
    write_attribute(group, "method", table.method, where);
    write_attribute(group, "seed", table.seed, where);
    write_attribute(group, "paths", table.paths, where);
    if (table.target_error > 0) write_attribute(group, "target_error", table.target_error, where);
    if (table.time_budget > 0) write_attribute(group, "time_budget", table.time_budget, where);

    const NumberType real64 = {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE}, real32 = {H5T_IEEE_F32LE, H5T_NATIVE_FLOAT};
    std::vector<hsize_t> shape;
    for (const Axis& axis : table.axes) {
        shape.push_back(axis.size());
        write_array(group, axis.name, {axis.size()}, real64, axis.values.data(), compression, {axis.size()}, where);
        const AxisRule& rule = axis_rule(axis.name);
        describe_array(group, axis.name, rule.unit, rule.meaning, where);
        const Handle scale(H5Dopen2(group, axis.name.c_str(), H5P_DEFAULT), H5Dclose, where);
        check(H5DSset_scale(scale, axis.name.c_str()), where + ": dimension scale refused");
    }
    // One chunk is one (sigma, g) slice.
    const auto slice = [](std::vector<hsize_t> dims) {
        dims[0] = dims[1] = 1;
        return dims;
    };
    write_array(group, "lobe", shape, real32, table.lobe.data(), compression, slice(shape), where);
    describe_array(group, "lobe", "1/radian", "scattered light over exit direction, bin averages, integral 1", where);
    attach_scales(group, "lobe", table.axes, where);
    const std::vector<Axis> parameters(table.axes.begin(), table.axes.end() - 1);
    const std::vector<hsize_t> cells(shape.begin(), shape.end() - 1);
    const struct {
        const char *name, *unit, *meaning;
        const std::vector<double>& values;
    } arrays[] = {
        {"energy", "1", "scattered energy per unit of incident energy", table.energy},
        {"energy_error", "1", "standard error of energy; 0: closed form", table.energy_error},
        {"standard_error", "1", "relative L2 standard error of the lobe", table.standard_error},
        {"mean_length", "medulla radius", "mean path length of the scattered light inside the medium",
         table.mean_length},
    };
    for (const auto& array : arrays) {
        write_array(group, array.name, cells, real64, array.values.data(), compression, slice(cells), where);
        describe_array(group, array.name, array.unit, array.meaning, where);
        attach_scales(group, array.name, parameters, where);
    }
}

// --- reading ---------------------------------------------------------------------------------------------------

/// One value of an attribute: whatever HDF5 calls a string, of fixed or variable length, padded in any way.
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
        std::int64_t number = 0;  // HDF5 would make 0 of what is below it
        check(H5Aread(attribute, H5T_NATIVE_INT64, &number), failed);
        if (number < 0) throw Error("{}: expected 0 or more in attribute {}, found {}", where, name, number);
    }
    std::uint64_t value = 0;
    check(H5Aread(attribute, H5T_NATIVE_UINT64, &value), failed);
    return value;
}

/// A positive number, 0 where there is none.
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

/// Throws Error unless a dataset is stored as write_array stores it: chunks within the array, numbers of at most 8
/// bytes, our filters alone. HDF5 allocates what these say before it reads.
void check_storage(hid_t set, hid_t type, const std::vector<hsize_t>& shape, const std::string& where) {
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
        // One after another they would multiply how far few bytes expand: gzip alone 1032 times, zstd to one chunk.
        compressors += id == H5Z_FILTER_DEFLATE || id == zstd_filter_id;
        if (compressors > 1) throw Error("{}: expected one compression, found several", where);
    }
}

template <class T>
std::vector<T> read_array(hid_t group, const std::string& name, hid_t memory, const std::vector<hsize_t>& expected,
                          const std::string& where, bool may_be_infinite = false) {
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
    // What a file declares it must also hold: a damaged one cannot make us allocate more than its bytes can expand to.
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

Table read_table(hid_t file, TableId id, const std::string& path) {
    const std::string where = fmt::format("{}: /{}", path, name_of(id));
    const Handle group(H5Gopen2(file, name_of(id), H5P_DEFAULT), H5Gclose, where + ": cannot be read");
    Table table;
    table.id = id;
    table.method = read_text(group, "method", where);
    table.seed = read_whole(group, "seed", where);
    table.paths = read_whole(group, "paths", where);
    table.target_error = read_optional(group, "target_error", where);
    table.time_budget = read_optional(group, "time_budget", where);
    std::vector<const char*> names = {"sigma", "g"};
    if (id == TableId::azimuthal) {
        if (H5Lexists(group, "absorption", H5P_DEFAULT) > 0) names.push_back("absorption");
        names.insert(names.end(), {"h", "phi"});
    } else {
        names.insert(names.end(), {"theta_i", "side", "theta_r"});
    }
    std::vector<hsize_t> shape;
    double cells_and_bins = 1;
    for (const char* axis_name : names) {
        table.axes.push_back({axis_name, read_array<double>(group, axis_name, H5T_NATIVE_DOUBLE, {}, where)});
        check_axis(table.axes.back(), where);
        shape.push_back(table.axes.back().size());
        cells_and_bins *= static_cast<double>(shape.back());
    }
    if (id == TableId::longitudinal && table.axes[3].values != std::vector<double>{0, 1})
        throw Error("{}/side: expected the values 0 and 1", where);
    if (cells_and_bins > 4e9) throw Error("{}/lobe: expected at most 4e9 values, found {:g}", where, cells_and_bins);
    const std::vector<hsize_t> cells(shape.begin(), shape.end() - 1);
    table.lobe = read_array<float>(group, "lobe", H5T_NATIVE_FLOAT, shape, where);
    table.energy = read_array<double>(group, "energy", H5T_NATIVE_DOUBLE, cells, where);
    table.energy_error = read_array<double>(group, "energy_error", H5T_NATIVE_DOUBLE, cells, where);
    table.standard_error = read_array<double>(group, "standard_error", H5T_NATIVE_DOUBLE, cells, where);
    table.mean_length = read_array<double>(group, "mean_length", H5T_NATIVE_DOUBLE, cells, where, true);
    check_cells(table, where);
    return table;
}

}  // namespace

void write_tables(const std::string& path, const Tables& tables, Compression compression) {
    write_tables(Output(path), tables, compression);
}

void write_tables(const Output& output, const Tables& tables, Compression compression, const std::string& temporary) {
    const std::string& path = output.path();
    quiet();
    register_zstd_filter();
    // Nothing is written that would be refused when it is read.
    for (const Table* table : tables.present()) check_cells(*table, fmt::format("{}: /{}", path, table->name()));
    // The file is made in memory and written by us: HDF5 closes a file on a full disk without a word.
    Image image;
    {
        const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, path + ": HDF5 gives no property list");
        check(H5Pset_libver_bounds(access, H5F_LIBVER_V110, H5F_LIBVER_V110), path + ": HDF5 1.10 or later is needed");
        check(H5Pset_fapl_core(access, image_step, false), path + ": HDF5 has no files in memory");
        image.capture(access, path);
        const Handle create = untracked(H5P_FILE_CREATE, path);
        const Handle file(H5Fcreate(temporary_name(path).c_str(), H5F_ACC_TRUNC, create, access), H5Fclose,
                          path + ": cannot be written");
        write_attribute(file, "format", format_name, path);
        write_attribute(file, "format_version", format_version, path);
        write_attribute(file, "program", tables.program, path);
        write_attribute(file, "configuration", hex(configuration_hash(tables)), path);
        write_attribute(file, "sha256", hex(contents_hash(tables)), path);
        for (const Table* table : tables.present()) write_table(file, *table, compression, path);
        check(H5Fflush(file, H5F_SCOPE_LOCAL), path + ": cannot be written");
        const ssize_t size = H5Fget_file_image(file, nullptr, 0);
        image.size = size > 0 ? static_cast<std::size_t>(size) : 0;
    }
    if (!image.bytes || image.size == 0) throw Error("{}: HDF5 gives no file", path);
    output.write(image.bytes, image.size, temporary);
}

bool is_hdf5(const std::string& path) {
    struct stat info = {};
    if (::stat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return false;
    std::ifstream file(path, std::ios::binary);
    char signature[8] = {};
    file.read(signature, sizeof signature);
    return file.gcount() == 8 && std::memcmp(signature, "\211HDF\r\n\032\n", 8) == 0;
}

Tables read_tables(const std::string& path) {
    quiet();
    register_zstd_filter();
    if (!is_hdf5(path)) {
        require_readable(path);
        throw Error("{}: expected a tables file (HDF5), found something else", path);
    }
    const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, path + ": HDF5 gives no property list");
#if H5_VERSION_GE(1, 10, 7)
    // Without a lock, which some file systems have not (ENOLCK, ENOSYS): our files appear whole under their names, and
    // SHA-256 tells if somebody writes into one.
    check(H5Pset_file_locking(access, false, true), path + ": HDF5 gives no property list");
#endif
    const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose, path + ": damaged HDF5 file");
    if (read_text(file, "format", path) != format_name)
        throw Error("{}: expected format '{}', found '{}'", path, format_name, read_text(file, "format", path));
    const std::uint64_t version = read_whole(file, "format_version", path);
    if (version < 1 || version > format_version)
        throw Error("{}: expected format version 1 to {}, found {}", path, format_version, version);
    Tables tables;
    tables.program = read_text(file, "program", path);
    for (const TableId id : table_ids)
        if (H5Lexists(file, name_of(id), H5P_DEFAULT) > 0) tables[id] = read_table(file, id, path);
    if (tables.present().empty()) throw Error("{}: expected /azimuthal or /longitudinal, found neither", path);
    if (version >= first_with_hash) {
        const std::string expected = read_text(file, "sha256", path), found = hex(contents_hash(tables));
        if (expected != found) throw Error("{}: expected contents of SHA-256 {}, found {}", path, expected, found);
    }
    return tables;
}

}  // namespace medulla::tables
