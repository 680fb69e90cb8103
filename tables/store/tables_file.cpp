#include "tables/store/tables_file.hpp"

#include <hdf5.h>
#include <hdf5_hl.h>
#include <sys/stat.h>

#include <cmath>
#include <cstring>
#include <fstream>

#include "tables/error.hpp"
#include "tables/store/hdf5.hpp"
#include "tables/store/slices.hpp"

namespace medulla::tables {
namespace {

constexpr const char* format_name = "medulla tables";
constexpr std::uint64_t format_version = 2, first_with_hash = 2;

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
    // Nothing is written that reading would refuse.
    for (const Table* table : tables.present()) check_cells(*table, fmt::format("{}: /{}", path, table->name()));
    write_hdf5(
        output,
        [&](hid_t file) {
            write_attribute(file, "format", format_name, path);
            write_attribute(file, "format_version", format_version, path);
            write_attribute(file, "program", tables.program, path);
            write_attribute(file, "configuration", hex(configuration_hash(tables)), path);
            write_attribute(file, "sha256", hex(contents_hash(tables)), path);
            for (const Table* table : tables.present()) write_table(file, *table, compression, path);
        },
        temporary);
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
    // The SHA-256 detects a concurrent writer.
    const Handle file = open_hdf5(path, "a tables file");
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
