#include "tables/job/schedule.hpp"

#include <algorithm>
#include <charconv>
#include <cstring>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

constexpr std::uint32_t most_shards = 1000000;

std::optional<std::uint32_t> whole(const std::string& text) {
    std::uint32_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

}  // namespace

std::uint64_t expected_cost(const Request& request, const SliceId& id) {
    const double sigma = request.sigma.values.at(id.sigma), g = request.g.values.at(id.g);
    const bool disc = id.table == TableName::azimuthal;
    const auto cells = static_cast<double>(disc ? request.h.size() : request.theta_i.size());
    const auto absorptions = disc && request.absorption.size() > 0 ? static_cast<double>(request.absorption.size()) : 1;
    double cost = 0;
    if (request.method == Method::automatic || request.method == Method::deterministic) {
        // Fitted to scripts/measure-slices, sigma <= 16, g <= 0.95: within a factor 2 of each slice.
        const double peak = 1 / (1 - (g < 0 ? -g : g));
        cost += disc ? 2e4 + 60 * peak * peak + (550 + 85 * peak) * sigma * sigma : 1e4 + 150 * peak * peak;
        cost *= absorptions;  // each is a solve; paths answer for all of them at once
    }
    if (request.method == Method::analog || request.method == Method::mc)
        cost += cells * static_cast<double>(request.paths) * (0.2 + (disc ? 0.15 : 0.26) * sigma);
    return static_cast<std::uint64_t>(cost) + 1;
}

std::vector<SliceId> by_cost(const Request& request, std::vector<SliceId> slices) {
    std::vector<std::pair<std::uint64_t, SliceId>> costly;
    for (const SliceId& id : slices) costly.emplace_back(expected_cost(request, id), id);
    std::stable_sort(costly.begin(), costly.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    for (std::size_t i = 0; i < slices.size(); ++i) slices[i] = costly[i].second;
    return slices;
}

std::vector<SliceId> share_of(const Request& request, const std::vector<SliceId>& slices, Shard shard) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> loads;  // a heap, the least load on top
    for (std::uint32_t i = 1; i <= shard.count; ++i) loads.emplace_back(0, i);
    std::vector<SliceId> mine;
    for (const SliceId& id : by_cost(request, slices)) {
        std::pop_heap(loads.begin(), loads.end(), std::greater<>());
        auto& [load, index] = loads.back();
        load += expected_cost(request, id);
        if (index == shard.index) mine.push_back(id);
        std::push_heap(loads.begin(), loads.end(), std::greater<>());
    }
    return mine;
}

Shard parse_shard(const std::string& text) {
    const std::size_t slash = text.find('/');
    if (slash != std::string::npos) {
        const auto index = whole(text.substr(0, slash)), count = whole(text.substr(slash + 1));
        if (index && count && *index >= 1 && *index <= *count && *count <= most_shards) return {*index, *count};
    }
    throw Error("--shard: expected I/N with 1 <= I <= N (at most {}), found '{}'", most_shards, text);
}

std::optional<Shard> launcher_shard(const std::function<const char*(const char*)>& variable) {
    const auto number = [&](const char* name, std::optional<std::uint32_t> absent = std::nullopt) {
        const char* text = variable(name);
        if (!text && absent) return *absent;
        const auto value = text ? whole(text) : std::nullopt;
        if (!value) throw Error("{}: expected a whole number, found '{}'", name, text ? text : "");
        return *value;
    };
    std::optional<Shard> shard;
    if (variable("SLURM_ARRAY_TASK_ID")) {
        const std::uint32_t id = number("SLURM_ARRAY_TASK_ID"), count = number("SLURM_ARRAY_TASK_COUNT"),
                            least = number("SLURM_ARRAY_TASK_MIN", 0), step = number("SLURM_ARRAY_TASK_STEP", 1);
        const std::uint32_t index = step > 0 && id >= least ? (id - least) / step : count;
        if (count < 1 || count > most_shards || index >= count || (id - least) % step != 0)
            throw Error(
                "SLURM_ARRAY_TASK_ID: expected a task of an even array (--array=1-N), found task {} of {} from {}", id,
                count, least);
        shard = Shard{index + 1, count};
    }
    if (variable("OMPI_COMM_WORLD_RANK")) {
        const std::uint32_t rank = number("OMPI_COMM_WORLD_RANK"), size = number("OMPI_COMM_WORLD_SIZE");
        if (rank >= size || size > most_shards)
            throw Error("OMPI_COMM_WORLD_RANK: expected a rank below {}, found {}", size, rank);
        const Shard outer = shard.value_or(Shard{});
        if (std::uint64_t{outer.count} * size > most_shards)
            throw Error("OMPI_COMM_WORLD_SIZE: expected at most {} workers in all, found {} x {}", most_shards,
                        outer.count, size);
        shard = Shard{(outer.index - 1) * size + rank + 1, outer.count * size};
    }
    return shard;
}

}  // namespace medulla::tables
