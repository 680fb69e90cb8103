#include "tables/store/slices.hpp"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "tables/error.hpp"
#include "tables/store/json_text.hpp"

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "shards and hashes are little-endian, copied as they lie");

namespace medulla::tables {
namespace {

std::size_t place(const Table& table, const SliceId& id) {
    const std::size_t sigmas = table.axis("sigma").size(), gs = table.axis("g").size();
    if (id.sigma >= sigmas || id.g >= gs)
        throw Error("{}: no slice {}, {}: the table has {} x {}", table.name(), id.sigma, id.g, sigmas, gs);
    return id.sigma * gs + id.g;
}

}  // namespace

Slice::Slice(std::size_t cell_count, std::size_t bin_count)
    : cells(cell_count), bins(bin_count), lobe(cells * bins, 0.0f) {
    for (auto* array : cell_arrays(*this)) array->assign(cells, 0.0);
}

std::size_t slice_cells(const Table& table) {
    return table.cells() / (table.axis("sigma").size() * table.axis("g").size());
}

std::vector<SliceId> slices_of(const Tables& plan) {
    std::vector<SliceId> list;
    for (const Table* table : plan.present())
        for (std::uint32_t s = 0; s < table->axis("sigma").size(); ++s)
            for (std::uint32_t g = 0; g < table->axis("g").size(); ++g) list.push_back({table->id, s, g});
    return list;
}

void put_slice(Tables& tables, const SliceId& id, const Slice& slice) {
    Table& table = tables.at(id.table);
    if (slice.cells != slice_cells(table) || slice.bins != table.bins())
        throw Error("{}: expected a slice of {} x {}, found {} x {}", table.name(), slice_cells(table), table.bins(),
                    slice.cells, slice.bins);
    const std::size_t first = place(table, id) * slice.cells;
    std::copy(slice.lobe.begin(), slice.lobe.end(), table.lobe.begin() + first * slice.bins);
    const auto from = cell_arrays(slice);
    const auto to = cell_arrays(table);
    for (std::size_t a = 0; a < from.size(); ++a) std::copy(from[a]->begin(), from[a]->end(), to[a]->begin() + first);
}

Slice take_slice(const Tables& tables, const SliceId& id) {
    const Table& table = tables.at(id.table);
    Slice slice(slice_cells(table), table.bins());
    const std::size_t first = place(table, id) * slice.cells;
    std::copy_n(table.lobe.begin() + first * slice.bins, slice.lobe.size(), slice.lobe.begin());
    const auto from = cell_arrays(table);
    const auto to = cell_arrays(slice);
    for (std::size_t a = 0; a < from.size(); ++a) std::copy_n(from[a]->begin() + first, slice.cells, to[a]->begin());
    return slice;
}

std::string describe(const Tables& plan, const SliceId& id) {
    const Table& table = plan.at(id.table);
    return fmt::format("{} sigma {:g}, g {:g}", table.name(), table.axis("sigma").values.at(id.sigma),
                       table.axis("g").values.at(id.g));
}

std::string configuration_text(const Tables& plan) {
    nlohmann::ordered_json json = {{"program", json_name(plan.program)}};
    for (const Table* table : plan.present()) {
        nlohmann::ordered_json& out = json["tables"][table->name()];
        out["method"] = json_name(table->method);
        out["seed"] = table->seed;
        out["paths"] = table->paths;
        // Only where they are set: a job without them keeps its text.
        if (table->target_error > 0) out["target_error"] = fmt::format("{:a}", table->target_error);
        if (table->time_budget > 0) out["time_budget"] = fmt::format("{:a}", table->time_budget);
        for (const Axis& axis : table->axes) {
            nlohmann::ordered_json values = nlohmann::ordered_json::array();
            for (const double x : axis.values) values.push_back(fmt::format("{:a}", x));
            out["axes"][axis.name] = std::move(values);
        }
    }
    return json.dump() + "\n";
}

Digest configuration_hash(const Tables& plan) { return sha256(configuration_text(plan)); }

Digest contents_hash(const Tables& tables) {
    Sha256 hash;
    const auto name = [&](const std::string& text) { hash.add(text.c_str(), text.size() + 1); };
    const auto array = [&](const std::string& text, const auto& values) {
        name(text);
        const std::uint64_t count = values.size();
        hash.add(&count, sizeof count);
        hash.add(values.data(), values.size() * sizeof values[0]);
    };
    for (const Table* table : tables.present()) {
        name(table->name());
        for (const Axis& axis : table->axes) array(axis.name, axis.values);
        array("lobe", table->lobe);
        array("energy", table->energy);
        array("energy_error", table->energy_error);
        array("standard_error", table->standard_error);
        array("mean_length", table->mean_length);
    }
    return hash.finish();
}

}  // namespace medulla::tables
