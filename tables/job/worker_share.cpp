#include "tables/job/worker_share.hpp"

#include <algorithm>
#include <charconv>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

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

}  // namespace medulla::tables
