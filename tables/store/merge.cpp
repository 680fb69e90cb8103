#include "tables/store/merge.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>

#include "tables/error.hpp"
#include "tables/store/slice_files.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {
namespace {

namespace fs = std::filesystem;

/// One argument: its axes and the slices that it has.
struct Input {
    std::string path;
    Tables tables;                        ///< arrays are empty where `folder` is set
    std::unique_ptr<SliceFolder> folder;  ///< refers to `tables`

    std::vector<SliceId> available() const {
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

std::unique_ptr<Input> open_input(const std::string& path) {
    auto input = std::make_unique<Input>();
    input->path = path;
    std::error_code ignored;
    const std::string beside = SliceFolder::beside(path);
    if (fs::is_directory(path, ignored))
        input->path = path;
    else if (!fs::exists(path, ignored) && fs::is_directory(beside, ignored))
        input->path = beside;
    else {
        input->tables = read_tables(path);
        return input;
    }
    input->tables = read_configuration(input->path);
    input->folder = std::make_unique<SliceFolder>(input->path, input->tables);
    return input;
}

/// Adds the axes of a further input to the merged table.
void extend(std::optional<Table>& merged, const Table& other, const std::string& path) {
    if (!merged) {
        merged.emplace();
        merged->id = other.id, merged->axes = other.axes, merged->method = other.method;
        merged->seed = other.seed, merged->paths = other.paths;
        merged->target_error = other.target_error, merged->time_budget = other.time_budget;
        return;
    }
    const auto differ = [&](const char* what, const std::string& expected, const std::string& found) {
        if (expected != found)
            throw Error("{}: /{}: expected {} {} as in the parts before, found {}", path, other.name(), what, expected,
                        found);
    };
    differ("method", merged->method, other.method);
    differ("seed", std::to_string(merged->seed), std::to_string(other.seed));
    differ("paths", std::to_string(merged->paths), std::to_string(other.paths));
    differ("target_error", fmt::format("{:a}", merged->target_error), fmt::format("{:a}", other.target_error));
    differ("time_budget", fmt::format("{:a}", merged->time_budget), fmt::format("{:a}", other.time_budget));
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
        if (k + 1 == merged->axes.size())
            throw Error("{}: /{}/{}: expected the values of the parts before, found others", path, other.name(),
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

/// The cells of `to` that the cells of one slice of `from` are.
std::vector<std::size_t> places(const Table& from, const SliceId& id, const Table& to) {
    const std::size_t cells = slice_cells(from), first = (id.sigma * from.axis("g").size() + id.g) * cells;
    std::vector<std::size_t> list(cells);
    for (std::size_t c = 0; c < cells; ++c) {
        const std::vector<std::size_t> index = from.position(first + c);
        for (std::size_t k = 0; k < index.size(); ++k)
            list[c] = list[c] * to.axes[k].size() + index_of(to.axes[k], from.axes[k].values[index[k]]);
    }
    return list;
}

void put_cell(const Slice& slice, std::size_t c, Table& table, std::size_t cell) {
    std::copy_n(slice.lobe.begin() + c * slice.bins, slice.bins, table.lobe.begin() + cell * slice.bins);
    const auto from = cell_arrays(slice);
    const auto to = cell_arrays(table);
    for (std::size_t a = 0; a < from.size(); ++a) (*to[a])[cell] = (*from[a])[c];
}

/// Whether a cell holds the same bytes.
bool same_cell(const Slice& slice, std::size_t c, const Table& table, std::size_t cell) {
    const auto ours = cell_arrays(slice);
    const auto theirs = cell_arrays(table);
    bool same = std::memcmp(slice.lobe.data() + c * slice.bins, table.lobe_of(cell), slice.bins * sizeof(float)) == 0;
    for (std::size_t a = 0; a < ours.size(); ++a)
        same = same && std::memcmp(&(*ours[a])[c], &(*theirs[a])[cell], sizeof(double)) == 0;
    return same;
}

}  // namespace

Tables merge(const std::vector<std::string>& paths) {
    std::vector<std::unique_ptr<Input>> inputs;
    for (const std::string& path : paths) inputs.push_back(open_input(path));
    Tables merged;
    for (const auto& input : inputs) {
        if (merged.program.empty()) merged.program = input->tables.program;
        if (merged.program != input->tables.program)
            throw Error("{}: expected a part by {}, found one by {}", input->path, merged.program,
                        input->tables.program);
        for (const Table* table : input->tables.present()) extend(merged[table->id], *table, input->path);
    }
    std::map<TableId, std::vector<const Input*>> owners;  // of each cell: the first input that has it
    for (const TableId id : table_ids)
        if (std::optional<Table>& table = merged[id]) {
            table->allocate();
            owners[id].resize(table->cells());
        }
    for (const auto& input : inputs)
        for (const SliceId& id : input->available()) {
            Table& to = merged.at(id.table);
            const std::vector<std::size_t> cells = places(input->tables.at(id.table), id, to);
            const Slice slice = input->slice(id);
            for (std::size_t c = 0; c < cells.size(); ++c) {
                const Input*& owner = owners[id.table][cells[c]];
                if (owner && !same_cell(slice, c, to, cells[c]))
                    throw Error("{} and {} have different values of {} {}", owner->path, input->path, to.name(),
                                to.describe(cells[c]));
                if (owner) continue;
                owner = input.get();
                put_cell(slice, c, to, cells[c]);
            }
        }
    for (const auto& [id, cells] : owners) {
        const auto missing = std::count(cells.begin(), cells.end(), nullptr);
        if (missing == 0) continue;
        const auto first = std::find(cells.begin(), cells.end(), nullptr) - cells.begin();
        const Table& table = merged.at(id);
        throw Error("{}: {} of {} cells of {} are missing, the first is {}", inputs.front()->path, missing,
                    cells.size(), table.name(), table.describe(static_cast<std::size_t>(first)));
    }
    return merged;
}

}  // namespace medulla::tables
