#include "tables/store/slice_files.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "tables/error.hpp"
#include "tables/store/file.hpp"
#include "tables/store/job_difference.hpp"
#include "tables/store/json_text.hpp"
#include "tables/streams.hpp"

namespace medulla::tables {
namespace {

namespace fs = std::filesystem;

constexpr char magic[8] = {'F', 'U', 'R', 'S', 'H', 'A', 'R', 'D'};
constexpr std::uint64_t greatest_slice_file = std::uint64_t{1} << 30;
constexpr std::uint64_t greatest_configuration = std::uint64_t{1} << 22;
constexpr const char* suffix = ".shard";

bool ends_with(const std::string& text, const std::string& end) {
    return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// A file made by temporary_name() for something of ours, left by a killed run.
bool is_temporary(const std::string& name) {
    const std::size_t at = name.find(".tmp-");
    return at != std::string::npos && (ends_with(name.substr(0, at), suffix) ||
                                       name.rfind("configuration.json", 0) == 0 || name.rfind("tables.h5", 0) == 0);
}

std::vector<std::string> names_in(const std::string& folder) {
    std::vector<std::string> names;
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
        names.push_back(entry->path().filename().string());
    if (error && error != std::errc::no_such_file_or_directory)
        throw Error("{}: cannot be read: {}", folder, error.message());
    std::sort(names.begin(), names.end());
    return names;
}

/// Removes a file of ours; what is no plain file is not.
void remove_plain(const std::string& file) {
    struct stat info = {};
    if (::lstat(file.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return;
    if (::unlink(file.c_str()) != 0 && errno != ENOENT) note("{}: cannot be removed: {}\n", file, std::strerror(errno));
}

struct Inspected {
    std::vector<unsigned char> bytes;
    SliceFileHeader header = {};
    std::string damage;  ///< empty: whole

    Digest configuration() const {
        Digest digest;
        std::memcpy(digest.data(), header.configuration, digest.size());
        return digest;
    }
};

/// Reads a shard of whatever configuration and checks that it is what was written.
Inspected inspect(const std::string& path) {
    Inspected found;
    found.bytes = read_file(path, greatest_slice_file);
    const std::size_t size = found.bytes.size(), digest_size = sizeof(Digest);
    if (size < sizeof(SliceFileHeader) + digest_size) {
        found.damage = fmt::format("only {} bytes", size);
        return found;
    }
    std::memcpy(&found.header, found.bytes.data(), sizeof found.header);
    if (std::memcmp(found.header.magic, magic, sizeof magic) != 0) {
        found.damage = "it does not begin with FURSHARD";
        return found;
    }
    Sha256 hash;
    hash.add(found.bytes.data(), size - digest_size);
    const Digest expected = hash.finish();
    if (std::memcmp(expected.data(), found.bytes.data() + size - digest_size, digest_size) != 0)
        found.damage = "its SHA-256 does not match";
    return found;
}

}  // namespace

SliceFolder::SliceFolder(std::string path, const Tables& plan)
    : path_(std::move(path)),
      plan_(plan),
      configuration_text_(tables::configuration_text(plan)),
      configuration_(configuration_hash(plan)) {}

SliceFolder::~SliceFolder() {
    if (lock_ >= 0) ::close(lock_);
}

std::string SliceFolder::file_of(const SliceId& id) const {
    return fmt::format("{}/{}-s{:04}-g{:04}{}", path_, name_of(id.table), id.sigma, id.g, suffix);
}

std::string SliceFolder::scratch() const { return temporary_name(path_ + "/tables.h5"); }

std::vector<std::string> SliceFolder::files() const {
    std::vector<std::string> list;
    for (const std::string& name : names_in(path_))
        if (ends_with(name, suffix)) list.push_back(path_ + "/" + name);
    return list;
}

void SliceFolder::open(bool alone) {
    struct stat info = {};
    if (::mkdir(path_.c_str(), 0777) == 0)
        sync_folder(folder_of(path_));
    else if (errno != EEXIST)
        throw Error("{}: cannot be made: {}", path_, std::strerror(errno));
    else if (::stat(path_.c_str(), &info) == 0 && !S_ISDIR(info.st_mode))
        throw Error("{}: expected a folder, found a {}", path_, kind_name(info.st_mode));
    lock_ = ::open((path_ + "/lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (lock_ < 0) throw Error("{}/lock: cannot be written: {}", path_, std::strerror(errno));
    if (::flock(lock_, (alone ? LOCK_EX : LOCK_SH) | LOCK_NB) != 0) {
        if (errno == EWOULDBLOCK) throw Error("{}: another medulla-precompute is at work on it", path_);
        // A file system without locks (ENOLCK, ENOSYS, EOPNOTSUPP) is no reason not to work on it.
        note("{}: this file system has no locks ({}): start no second run there\n", path_, std::strerror(errno));
    }
    alone_ = alone;
    if (alone)
        for (const std::string& name : names_in(path_))
            if (is_temporary(name)) remove_plain(path_ + "/" + name);

    const std::string json = path_ + "/configuration.json";
    if (fs::exists(json)) {
        const std::vector<unsigned char> bytes = read_file(json, greatest_configuration);
        const std::string text(bytes.begin(), bytes.end());
        if (text == configuration_text_) return;
        // Its shards say whose the folder is; without any, a whole run takes it over.
        for (const std::string& file : files()) {
            const Inspected found = inspect(file);
            if (found.damage.empty()) refuse_other(file, found.configuration());
        }
        if (!alone) refuse_other(json, sha256(text));
    }
    write_file(json, configuration_text_);
}

void SliceFolder::refuse_other(const std::string& file, const Digest& found) const {
    if (found == configuration_) return;
    std::string difference;
    try {
        const Tables other = read_configuration(path_);
        if (configuration_hash(other) == found) difference = job_difference(plan_, other);
    } catch (const Error&) {  // then nothing is left that names that job's options
    }
    if (difference.empty()) difference = "expected the options of this job, found others";
    throw Error("{}: it belongs to another job: {}", file, difference);
}

std::optional<Slice> SliceFolder::read(const SliceId& id, std::string& why) const {
    const std::string file = file_of(id);
    const Inspected found = inspect(file);
    why = found.damage;
    if (!why.empty()) return std::nullopt;
    const SliceFileHeader& header = found.header;
    refuse_other(file, found.configuration());
    const Table& table = plan_.at(id.table);
    Slice slice(slice_cells(table), table.bins());
    const std::size_t size = sizeof header + slice.cells * (4 * sizeof(double) + slice.bins * sizeof(float)) + 32;
    if (header.version != slice_file_version || header.table != static_cast<std::uint32_t>(id.table) ||
        header.sigma != id.sigma || header.g != id.g || header.cells != slice.cells || header.bins != slice.bins ||
        found.bytes.size() != size) {
        why = "it holds another slice than its name says";
        return std::nullopt;
    }
    const unsigned char* from = found.bytes.data() + sizeof header;
    const auto copy = [&](auto& values) {
        std::memcpy(values.data(), from, values.size() * sizeof values[0]);
        from += values.size() * sizeof values[0];
    };
    copy(slice.energy), copy(slice.energy_error), copy(slice.standard_error), copy(slice.mean_length);
    copy(slice.lobe);
    return slice;
}

std::vector<bool> SliceFolder::kept(const std::vector<SliceId>& ids) const {
    const std::vector<std::string> there = files();
    std::vector<bool> good(ids.size(), false);
    for (std::size_t i = 0; i < ids.size(); ++i) {
        const std::string file = file_of(ids[i]);
        if (!std::binary_search(there.begin(), there.end(), file)) continue;
        std::string why;
        good[i] = read(ids[i], why).has_value();
        if (!good[i]) note("{}: damaged ({}); solving it again\n", file, why);
    }
    return good;
}

void SliceFolder::write(const SliceId& id, const Slice& slice) const {
    SliceFileHeader header = {};
    std::memcpy(header.magic, magic, sizeof magic);
    header.version = slice_file_version;
    header.table = static_cast<std::uint32_t>(id.table);
    std::memcpy(header.configuration, configuration_.data(), configuration_.size());
    header.sigma = id.sigma, header.g = id.g;
    header.cells = slice.cells, header.bins = slice.bins;
    PendingFile file(file_of(id));
    Sha256 hash;
    const auto put = [&](const void* data, std::size_t size) {
        hash.add(data, size);
        file.write(data, size);
    };
    put(&header, sizeof header);
    for (const auto* array : {&slice.energy, &slice.energy_error, &slice.standard_error, &slice.mean_length})
        put(array->data(), array->size() * sizeof(double));
    put(slice.lobe.data(), slice.lobe.size() * sizeof(float));
    const Digest digest = hash.finish();
    file.write(digest.data(), digest.size());
    file.commit();
}

void SliceFolder::remove() {
    for (const std::string& name : names_in(path_))
        if (ends_with(name, suffix) || is_temporary(name) || name == "configuration.json" || name == "lock")
            remove_plain(path_ + "/" + name);
    // NFS keeps a file that is open under another name, until it is closed.
    if (lock_ >= 0) ::close(std::exchange(lock_, -1));
    const bool kept = ::rmdir(path_.c_str()) != 0 && errno != ENOENT && errno != ENOTEMPTY && errno != EEXIST;
    if (kept && errno != ENOTDIR)  // a symbolic link to the folder
        note("{}: cannot be removed: {}\n", path_, std::strerror(errno));
}

void SliceFolder::remove_if_empty() {
    if (alone_ && files().empty()) remove();
}

namespace {

/// A number as configuration_text writes it.
double number_of(const nlohmann::ordered_json& json, const std::string& where) {
    const std::string text = json.get<std::string>();
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (text.empty() || *end != '\0') throw Error("{}: expected a number, found '{}'", where, text);
    return value;
}

Table planned_table(const nlohmann::ordered_json& json, TableId id, const std::string& where) {
    Table table;
    table.id = id;
    table.method = json.at("method").get<std::string>();
    table.seed = json.at("seed").get<std::uint64_t>();
    table.paths = json.at("paths").get<std::uint64_t>();
    if (json.contains("target_error")) table.target_error = number_of(json["target_error"], where + "/target_error");
    if (json.contains("time_budget")) table.time_budget = number_of(json["time_budget"], where + "/time_budget");
    for (const auto& [axis_name, values] : json.at("axes").items()) {
        Axis axis{axis_name, {}};
        for (const auto& value : values) axis.values.push_back(number_of(value, where + "/" + axis_name));
        check_axis(axis, where);
        table.axes.push_back(std::move(axis));
    }
    return table;
}

}  // namespace

Tables read_configuration(const std::string& folder) {
    const std::string path = folder + "/configuration.json";
    const std::vector<unsigned char> bytes = read_file(path, greatest_configuration);
    Tables plan;
    try {
        const auto* text = reinterpret_cast<const char*>(bytes.data());
        const auto json = parse_json<nlohmann::ordered_json>(text, text + bytes.size(), path);
        plan.program = json.at("program").get<std::string>();
        const auto& tables = json.at("tables");
        for (const TableId id : table_ids)
            if (tables.contains(name_of(id)))
                plan[id] = planned_table(tables[name_of(id)], id, fmt::format("{}: /{}", path, name_of(id)));
    } catch (const nlohmann::json::exception& error) {
        throw Error("{}: expected a job's configuration: {}", path, error.what());
    }
    // What was read must be the text that we would write: nothing of it is lost or misread.
    if (configuration_text(plan) != std::string(bytes.begin(), bytes.end()))
        throw Error("{}: expected a job's configuration as medulla-precompute writes it, found other text", path);
    return plan;
}

}  // namespace medulla::tables
