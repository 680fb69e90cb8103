#include "tables/bake/fibre_file.hpp"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <limits>

#include "tables/error.hpp"
#include "tables/store/file.hpp"
#include "tables/store/hdf5.hpp"
#include "tables/store/json_text.hpp"
#include "tables/streams.hpp"

namespace medulla::tables {
namespace {

constexpr const char* format_name = "medulla fibre";
constexpr std::uint64_t format_version = 1;
constexpr std::size_t most_bins = 256;

/// The parameters as the file has them, in this order, with sigma_ca three times [radians, 1 / fibre radius].
constexpr std::size_t parameters = 12;
constexpr const char* parameter_order = "eta, kappa, alpha, beta_m, beta_n, layers, sigma_ms, sigma_ma, g, sigma_ca";

template <class Fur, class Visit>
void visit_in_order(Fur& p, Visit&& visit) {
    visit(p.eta), visit(p.kappa), visit(p.alpha), visit(p.beta_m), visit(p.beta_n), visit(p.layers);
    visit(p.sigma_ms), visit(p.sigma_ma), visit(p.g);
    for (auto& sigma : p.sigma_ca) visit(sigma);
}

/// Arrays of a list of cells, end to end.
struct Arrays {
    std::vector<double> theta_i, h, energy;  ///< energy: R; TT, TRT and higher; scattered
    std::vector<float> light, error;
};
Arrays arrays_of(const std::vector<LightCell>& cells) {
    Arrays a;
    for (const LightCell& cell : cells) {
        a.theta_i.push_back(cell.theta_i), a.h.push_back(cell.h);
        for (const double e : {cell.R, cell.entered, cell.scattered}) a.energy.push_back(e);
        a.light.insert(a.light.end(), cell.density.begin(), cell.density.end());
        a.error.insert(a.error.end(), cell.error.begin(), cell.error.end());
    }
    return a;
}

Digest contents_hash(const FibreLight& light) {
    Sha256 hash;
    const std::string text = configuration_text(light.request) + light.program;
    hash.add(text.data(), text.size());
    for (const auto* cells : {&light.cells, &light.checks}) {
        const Arrays a = arrays_of(*cells);
        for (const auto* numbers : {&a.theta_i, &a.h, &a.energy}) hash.add(numbers->data(), 8 * numbers->size());
        for (const auto* numbers : {&a.light, &a.error}) hash.add(numbers->data(), 4 * numbers->size());
    }
    return hash.finish();
}

const NumberType real64 = {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE}, real32 = {H5T_IEEE_F32LE, H5T_NATIVE_FLOAT};

void write_cells(hid_t file, const char* name, const std::vector<LightCell>& cells, const std::vector<double>& sigma_ca,
                 const FibreRequest& r, Compression compression, const std::string& path) {
    const std::string where = fmt::format("{}: /{}", path, name);
    const Handle properties = untracked(H5P_GROUP_CREATE, where);
    const Handle group(H5Gcreate2(file, name, H5P_DEFAULT, properties, H5P_DEFAULT), H5Gclose,
                       where + ": cannot be written");
    const Arrays a = arrays_of(cells);
    const hsize_t n = cells.size(), sigmas = sigma_ca.size(), rows = r.rows, columns = r.columns;
    write_array(group, "sigma_ca", {sigmas}, real64, sigma_ca.data(), compression, {sigmas}, where);
    write_array(group, "theta_i", {n}, real64, a.theta_i.data(), compression, {n}, where);
    write_array(group, "h", {n}, real64, a.h.data(), compression, {n}, where);
    write_array(group, "energy", {n, 3}, real64, a.energy.data(), compression, {n, 3}, where);
    const std::vector<hsize_t> shape = {n, sigmas, rows, columns}, chunk = {1, sigmas, rows, columns};
    write_array(group, "light", shape, real32, a.light.data(), compression, chunk, where);
    write_array(group, "standard_error", shape, real32, a.error.data(), compression, chunk, where);
}

void read_cells(hid_t file, const char* name, std::vector<LightCell>& cells, std::vector<double>& sigma_ca,
                const FibreRequest& r, const std::string& path) {
    const std::string where = fmt::format("{}: /{}", path, name);
    const Handle group(H5Gopen2(file, name, H5P_DEFAULT), H5Gclose, where + ": cannot be read");
    const hsize_t n = cells.size(), sigmas = sigma_ca.size();
    const auto same = [&](const char* array, const std::vector<double>& expected) {
        const auto found = read_array<double>(group, array, H5T_NATIVE_DOUBLE, {expected.size()}, where);
        for (std::size_t i = 0; i < found.size(); ++i)
            if (!(std::abs(found[i] - expected[i]) <= 1e-12))
                throw Error("{}/{}: expected {} as number {}, found {}", where, array, expected[i], i, found[i]);
    };
    const Arrays planned = arrays_of(cells);
    same("sigma_ca", sigma_ca), same("theta_i", planned.theta_i), same("h", planned.h);
    const auto energy = read_array<double>(group, "energy", H5T_NATIVE_DOUBLE, {n, 3}, where);
    const std::vector<hsize_t> shape = {n, sigmas, r.rows, r.columns};
    const auto light = read_array<float>(group, "light", H5T_NATIVE_FLOAT, shape, where);
    const auto error = read_array<float>(group, "standard_error", H5T_NATIVE_FLOAT, shape, where);
    for (const auto* numbers : {&light, &error})
        for (const float x : *numbers)
            if (!(x >= 0)) throw Error("{}: expected light of 0 or more, found {}", where, x);
    for (const double e : energy)
        if (!(e >= 0 && e <= 2)) throw Error("{}/energy: expected shares in [0, 2], found {}", where, e);
    const auto size = static_cast<std::ptrdiff_t>(sigmas * r.rows * r.columns);
    for (std::size_t i = 0; i < cells.size(); ++i) {
        LightCell& cell = cells[i];
        cell.R = energy[3 * i], cell.entered = energy[3 * i + 1], cell.scattered = energy[3 * i + 2];
        const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(i) * size;
        cell.density.assign(light.begin() + first, light.begin() + first + size);
        cell.error.assign(error.begin() + first, error.begin() + first + size);
    }
}

}  // namespace

std::string configuration_text(const FibreRequest& r) {
    nlohmann::ordered_json json = {{"program", "medulla " MEDULLA_VERSION " (" MEDULLA_COMPILER ")"}};
    FurParameters<3> fur = r.material.fur;
    std::vector<std::string> numbers;
    visit_in_order(fur, [&](float x) { numbers.push_back(fmt::format("{:a}", x)); });
    json["material"] = numbers;
    json["paths"] = r.paths, json["target_error"] = fmt::format("{:a}", r.target_error), json["seed"] = r.seed;
    json["nodes"] = {r.inclinations, r.offsets_inside, r.offsets_beyond};
    json["bins"] = {r.rows, r.columns};
    json["checks"] = {r.checks, r.check_paths};
    return json_line(json);
}

std::string configuration_difference(const std::string& expected, const std::string& found) {
    const auto parsed = [](const std::string& text) {
        return parse_json<nlohmann::ordered_json>(text.data(), text.data() + text.size(), "configuration");
    };
    const nlohmann::ordered_json a = parsed(expected), b = parsed(found);
    std::string text;
    for (const auto& [name, value] : a.items())
        if (!b.is_object() || !b.contains(name) || b[name] != value)
            text += fmt::format("{}{}: expected {}, found {}", text.empty() ? "" : "; ", name, value.dump(),
                                b.is_object() && b.contains(name) ? b[name].dump() : "none");
    return text;
}

void write_fibre(const Output& output, const FibreLight& light, Compression compression) {
    const std::string& path = output.path();
    const FibreRequest& r = light.request;
    write_hdf5(output, [&](hid_t file) {
        write_attribute(file, "format", format_name, path);
        write_attribute(file, "format_version", format_version, path);
        write_attribute(file, "program", light.program, path);
        write_attribute(file, "sha256", hex(contents_hash(light)), path);
        write_attribute(file, "name", json_name(r.material.name), path);
        write_attribute(file, "parameter_order", parameter_order, path);
        std::vector<double> values;
        FurParameters<3> fur = r.material.fur;
        visit_in_order(fur, [&](float x) { values.push_back(static_cast<double>(x)); });
        write_array(file, "parameters", {parameters}, real64, values.data(), compression, {parameters}, path);
        for (const auto& [name, value] :
             std::initializer_list<std::pair<const char*, std::uint64_t>>{{"grey", r.material.grey},
                                                                          {"seed", r.seed},
                                                                          {"paths", r.paths},
                                                                          {"check_paths", r.check_paths},
                                                                          {"inclinations", r.inclinations},
                                                                          {"offsets_inside", r.offsets_inside},
                                                                          {"offsets_beyond", r.offsets_beyond},
                                                                          {"rows", r.rows},
                                                                          {"columns", r.columns},
                                                                          {"checks", r.checks}})
            write_attribute(file, name, value, path);
        if (r.target_error > 0) write_attribute(file, "target_error", r.target_error, path);
        write_cells(file, "nodes", light.cells, light.sigma_ca, r, compression, path);
        write_cells(file, "checks", light.checks, light.check_sigma_ca, r, compression, path);
    });
}

FibreLight read_fibre(const std::string& path) {
    const Handle file = open_hdf5(path, "the light of a fibre");
    const std::string format = read_text(file, "format", path);
    if (format != format_name) throw Error("{}: expected format '{}', found '{}'", path, format_name, format);
    const std::uint64_t version = read_whole(file, "format_version", path);
    if (version != format_version)
        throw Error("{}: expected format version {}, found {}", path, format_version, version);
    FibreRequest r;
    r.material.name = read_text(file, "name", path);
    const auto values = read_array<double>(file, "parameters", H5T_NATIVE_DOUBLE, {parameters}, path);
    std::size_t next = 0;
    visit_in_order(r.material.fur, [&](float& x) { x = static_cast<float>(values[next++]); });
    r.material.fur.fresnel = Fresnel::exact;
    if (const std::uint32_t bad = out_of_range(r.material.fur); bad != 0)
        for (int i = 0; i < parameter_count; ++i)
            if (bad >> i & 1u)
                throw Error("{}: /parameters: expected {} in {}, found another number", path, parameter_names[i],
                            parameter_ranges[i]);
    const auto count = [&](const char* name, std::uint64_t low, std::uint64_t high) {
        const std::uint64_t n = read_whole(file, name, path);
        if (n < low || n > high) throw Error("{}: attribute {}: expected {} to {}, found {}", path, name, low, high, n);
        return static_cast<std::size_t>(n);
    };
    constexpr std::uint64_t any = std::numeric_limits<std::uint64_t>::max();
    r.material.grey = count("grey", 0, 1) == 1;
    r.seed = count("seed", 0, any), r.paths = count("paths", 1, any), r.check_paths = count("check_paths", 1, any);
    r.inclinations = count("inclinations", 2, 256), r.offsets_inside = count("offsets_inside", 2, 256);
    r.offsets_beyond = count("offsets_beyond", 0, 256);
    r.rows = count("rows", 4, most_bins), r.columns = count("columns", 4, most_bins),
    r.checks = count("checks", 0, 4096);
    r.target_error = read_optional(file, "target_error", path);
    check_fibre_request(r, path);
    if (light_bytes(r) > 1e10)
        throw Error("{}: expected at most 1e10 bytes of light, found {:g}", path, light_bytes(r));
    FibreLight light = plan_of(r);
    if (light.request.offsets_beyond != r.offsets_beyond)
        throw Error("{}: attribute offsets_beyond: expected {}, found {}", path, light.request.offsets_beyond,
                    r.offsets_beyond);
    light.program = read_text(file, "program", path);
    read_cells(file, "nodes", light.cells, light.sigma_ca, r, path);
    read_cells(file, "checks", light.checks, light.check_sigma_ca, r, path);
    const std::string expected = read_text(file, "sha256", path), found = hex(contents_hash(light));
    if (expected != found) throw Error("{}: expected contents of SHA-256 {}, found {}", path, expected, found);
    return light;
}

bool is_fibre_file(const std::string& path) {
    if (!is_hdf5(path)) return false;
    try {
        return read_text(open_hdf5(path, "an HDF5 file"), "format", path) == format_name;
    } catch (const Error&) {
        return false;  // whoever reads it says what is wrong
    }
}

// --- partial results ---------------------------------------------------------------------------------------------

namespace {

constexpr char partial_magic[8] = {'F', 'U', 'R', 'P', 'A', 'R', 'T', '\n'};

void append(std::vector<unsigned char>& bytes, const void* data, std::size_t size) {
    const auto* first = static_cast<const unsigned char*>(data);
    bytes.insert(bytes.end(), first, first + size);
}

}  // namespace

PartialFibre::PartialFibre(const std::string& output, const FibreLight& plan)
    : path_(output + ".partial"),
      configuration_(configuration_text(plan.request)),
      nodes_(plan.cells.size()),
      node_size_(plan.sigma_ca.size() * plan.bins()),
      check_size_(plan.check_sigma_ca.size() * plan.bins()) {}

bool PartialFibre::exists() const { return std::filesystem::exists(path_); }

void PartialFibre::write(const std::vector<std::optional<LightCell>>& cells) const {
    std::vector<unsigned char> bytes;
    append(bytes, partial_magic, sizeof partial_magic);
    const std::uint64_t length = configuration_.size();
    append(bytes, &length, sizeof length);
    append(bytes, configuration_.data(), configuration_.size());
    for (std::uint64_t i = 0; i < cells.size(); ++i) {
        if (!cells[i]) continue;
        const LightCell& cell = *cells[i];
        const double numbers[5] = {cell.theta_i, cell.h, cell.R, cell.entered, cell.scattered};
        append(bytes, &i, sizeof i);
        append(bytes, numbers, sizeof numbers);
        append(bytes, cell.density.data(), 4 * cell.density.size());
        append(bytes, cell.error.data(), 4 * cell.error.size());
    }
    const Digest digest = sha256({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    append(bytes, digest.data(), digest.size());
    write_file(path_, bytes.data(), bytes.size());
}

void PartialFibre::read(std::vector<std::optional<LightCell>>& cells) const {
    const std::vector<unsigned char> bytes = read_file(path_, std::uint64_t{1} << 34);
    const auto damaged = [&] { note("{}: damaged: all cells are simulated again\n", path_); };
    std::size_t at = sizeof partial_magic + 8;
    const std::size_t end = bytes.size() - std::min(bytes.size(), sizeof(Digest));
    if (end < at || std::memcmp(bytes.data(), partial_magic, sizeof partial_magic) != 0) return damaged();
    const Digest digest = sha256({reinterpret_cast<const char*>(bytes.data()), end});
    if (std::memcmp(digest.data(), bytes.data() + end, sizeof(Digest)) != 0) return damaged();
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data() + sizeof partial_magic, 8);
    if (length > end - at) return damaged();
    const std::string found(reinterpret_cast<const char*>(bytes.data()) + at, length);
    if (found != configuration_)
        throw Error("{}: it belongs to another job: {}", path_, configuration_difference(configuration_, found));
    at += length;
    while (at < end) {
        std::uint64_t i = 0;
        LightCell cell;
        double numbers[5];
        if (end - at < 8 + sizeof numbers) return damaged();
        std::memcpy(&i, bytes.data() + at, 8), std::memcpy(numbers, bytes.data() + at + 8, sizeof numbers);
        at += 8 + sizeof numbers;
        if (i >= cells.size()) return damaged();
        const std::size_t size = i < nodes_ ? node_size_ : check_size_;
        if (end - at < 8 * size) return damaged();
        cell.theta_i = numbers[0], cell.h = numbers[1], cell.R = numbers[2], cell.entered = numbers[3];
        cell.scattered = numbers[4], cell.density.resize(size), cell.error.resize(size);
        std::memcpy(cell.density.data(), bytes.data() + at, 4 * size);
        std::memcpy(cell.error.data(), bytes.data() + at + 4 * size, 4 * size);
        at += 8 * size;
        cells[i] = std::move(cell);
    }
}

void PartialFibre::remove() const {
    std::error_code error;
    std::filesystem::remove(path_, error);
    if (error) note("{}: cannot be removed: {}\n", path_, error.message());
}

}  // namespace medulla::tables
