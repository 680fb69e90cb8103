#include "tables/merge.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>

#include "tables/error.hpp"
#include "tables/shards.hpp"
#include "tables/tables_file.hpp"

namespace medulla::tables {
namespace {

namespace fs = std::filesystem;

/// One argument: the axes it knows, and the slices it holds.
struct Part {
    std::string path;
    Tables tables;                        ///< arrays are empty where `folder` is set
    std::unique_ptr<ShardFolder> folder;  ///< refers to `tables`

    std::vector<SliceId> held() const {
        std::vector<SliceId> ids = slices_of(tables);
        if (folder)
            ids.erase(std::remove_if(ids.begin(), ids.end(),
                                     [&](const SliceId& id) { return !fs::exists(folder->file_of(id)); }),
                      ids.end());
        return ids;
    }

    Slice slice(const SliceId& id) const {
        if (!folder) return take_slice(tables, id);
        std::string why;
        std::optional<Slice> found = folder->read(id, why);
        if (!found) throw Error("{}: damaged: {}; solve it again with --resume", folder->file_of(id), why);
        return std::move(*found);
    }
};

std::unique_ptr<Part> open_part(const std::string& path) {
    auto part = std::make_unique<Part>();
    part->path = path;
    std::error_code ignored;
    const std::string beside = ShardFolder::beside(path);
    if (fs::is_directory(path, ignored))
        part->path = path;
    else if (!fs::exists(path, ignored) && fs::is_directory(beside, ignored))
        part->path = beside;
    else {
        part->tables = read_tables(path);
        return part;
    }
    part->tables = read_configuration(part->path);
    part->folder = std::make_unique<ShardFolder>(part->path, part->tables);
    return part;
}

/// Takes what a further part knows of a table into the merged axes.
void extend(std::optional<Table>& merged, const Table& other, const std::string& path) {
    if (!merged) {
        merged.emplace();
        merged->name = other.name, merged->axes = other.axes, merged->method = other.method;
        merged->seed = other.seed, merged->paths = other.paths;
        return;
    }
    const auto differ = [&](const char* what, const std::string& expected, const std::string& found) {
        if (expected != found)
            throw Error("{}: /{}: expected {} {} as in the parts before, found {}", path, other.name, what, expected,
                        found);
    };
    differ("method", merged->method, other.method);
    differ("seed", std::to_string(merged->seed), std::to_string(other.seed));
    differ("paths", std::to_string(merged->paths), std::to_string(other.paths));
    const auto names = [](const Table& table) {
        std::string text;
        for (const Axis& axis : table.axes) text += (text.empty() ? "" : ", ") + axis.name;
        return text;
    };
    differ("axes", names(*merged), names(other));
    for (std::size_t k = 0; k < merged->axes.size(); ++k) {
        std::vector<double>& into = merged->axes[k].values;
        const std::vector<double>& from = other.axes[k].values;
        if (into == from) continue;
        if (merged->axes[k].name != "sigma" && merged->axes[k].name != "g")
            throw Error("{}: /{}/{}: expected the values of the parts before, found others", path, other.name,
                        other.axes[k].name);
        std::vector<double> both;
        std::set_union(into.begin(), into.end(), from.begin(), from.end(), std::back_inserter(both));
        into = std::move(both);
    }
}

std::uint32_t index_of(const Axis& axis, double value) {
    return static_cast<std::uint32_t>(std::lower_bound(axis.values.begin(), axis.values.end(), value) -
                                      axis.values.begin());
}

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

bool same(const Slice& a, const Slice& b) {
    return same_bytes(a.lobe, b.lobe) && same_bytes(a.energy, b.energy) && same_bytes(a.energy_error, b.energy_error) &&
           same_bytes(a.standard_error, b.standard_error) && same_bytes(a.mean_length, b.mean_length);
}

}  // namespace

Tables merge(const std::vector<std::string>& paths) {
    std::vector<std::unique_ptr<Part>> parts;
    for (const std::string& path : paths) parts.push_back(open_part(path));
    Tables merged;
    for (const auto& part : parts) {
        if (merged.program.empty()) merged.program = part->tables.program;
        if (merged.program != part->tables.program)
            throw Error("{}: expected a part by {}, found one by {}", part->path, merged.program, part->tables.program);
        if (part->tables.azimuthal) extend(merged.azimuthal, *part->tables.azimuthal, part->path);
        if (part->tables.longitudinal) extend(merged.longitudinal, *part->tables.longitudinal, part->path);
    }
    for (auto* table : {&merged.azimuthal, &merged.longitudinal})
        if (*table) (*table)->allocate();
    const std::vector<SliceId> all = slices_of(merged);
    const auto key = [](const SliceId& id) { return std::tuple(id.table, id.sigma, id.g); };
    std::map<std::tuple<TableName, std::uint32_t, std::uint32_t>, const Part*> holder;
    for (const auto& part : parts)
        for (const SliceId& id : part->held()) {
            const Table &from = table_of(part->tables, id.table), &to = table_of(merged, id.table);
            const SliceId place = {id.table, index_of(to.axis("sigma"), from.axis("sigma").values[id.sigma]),
                                   index_of(to.axis("g"), from.axis("g").values[id.g])};
            const Slice slice = part->slice(id);
            const auto [entry, fresh] = holder.emplace(key(place), part.get());
            if (!fresh && !same(slice, take_slice(merged, place)))
                throw Error("{} and {} hold different slices of {}", entry->second->path, part->path,
                            describe(merged, place));
            if (fresh) put_slice(merged, place, slice);
        }
    if (holder.size() == all.size()) return merged;
    const auto missing =
        std::find_if(all.begin(), all.end(), [&](const SliceId& id) { return !holder.count(key(id)); });
    throw Error("{}: {} of {} slices are missing, the first is {}", parts.front()->path, all.size() - holder.size(),
                all.size(), describe(merged, *missing));
}

}  // namespace medulla::tables
