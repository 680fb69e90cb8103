#include "tables/job/worker_share.hpp"

#include <algorithm>
#include <charconv>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

constexpr std::uint32_t most_workers = 1000000;

std::optional<std::uint32_t> whole(const std::string& text) {
    std::uint32_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

}  // namespace

std::vector<SliceId> share_of(const Request& request, const std::vector<SliceId>& slices, WorkerShare share) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> loads;  // a heap, the least load on top
    for (std::uint32_t i = 1; i <= share.count; ++i) loads.emplace_back(0, i);
    std::vector<SliceId> mine;
    for (const SliceId& id : by_cost(request, slices)) {
        std::pop_heap(loads.begin(), loads.end(), std::greater<>());
        auto& [load, index] = loads.back();
        load += expected_cost(request, id);
        if (index == share.index) mine.push_back(id);
        std::push_heap(loads.begin(), loads.end(), std::greater<>());
    }
    return mine;
}

WorkerShare parse_worker_share(const std::string& text) {
    const std::size_t slash = text.find('/');
    if (slash != std::string::npos) {
        const auto index = whole(text.substr(0, slash)), count = whole(text.substr(slash + 1));
        if (index && count && *index >= 1 && *index <= *count && *count <= most_workers) return {*index, *count};
    }
    throw Error("--shard: expected I/N with 1 <= I <= N (at most {}), found '{}'", most_workers, text);
}

std::optional<WorkerShare> launcher_share(const std::function<const char*(const char*)>& variable) {
    const auto number = [&](const char* name, std::optional<std::uint32_t> absent = std::nullopt) {
        const char* text = variable(name);
        if (!text && absent) return *absent;
        const auto value = text ? whole(text) : std::nullopt;
        if (!value) throw Error("{}: expected a whole number, found '{}'", name, text ? text : "");
        return *value;
    };
    std::optional<WorkerShare> share;
    if (variable("SLURM_ARRAY_TASK_ID")) {
        const std::uint32_t id = number("SLURM_ARRAY_TASK_ID"), count = number("SLURM_ARRAY_TASK_COUNT"),
                            least = number("SLURM_ARRAY_TASK_MIN", 0), step = number("SLURM_ARRAY_TASK_STEP", 1);
        const std::uint32_t index = step > 0 && id >= least ? (id - least) / step : count;
        if (count < 1 || count > most_workers || index >= count || (id - least) % step != 0)
            throw Error(
                "SLURM_ARRAY_TASK_ID: expected a task of an even array (--array=1-N), found task {} of {} from {}", id,
                count, least);
        share = WorkerShare{index + 1, count};
    }
    if (variable("OMPI_COMM_WORLD_RANK")) {
        const std::uint32_t rank = number("OMPI_COMM_WORLD_RANK"), size = number("OMPI_COMM_WORLD_SIZE");
        if (rank >= size || size > most_workers)
            throw Error("OMPI_COMM_WORLD_RANK: expected a rank below {}, found {}", size, rank);
        const WorkerShare outer = share.value_or(WorkerShare{});
        if (std::uint64_t{outer.count} * size > most_workers)
            throw Error("OMPI_COMM_WORLD_SIZE: expected at most {} workers in all, found {} x {}", most_workers,
                        outer.count, size);
        share = WorkerShare{(outer.index - 1) * size + rank + 1, outer.count * size};
    }
    return share;
}

}  // namespace medulla::tables
