// The slices of one worker among many, as given by `--shard I/N`.
#pragma once

#include <optional>
#include <string>

#include "tables/job/cost.hpp"

namespace medulla::tables {

/// Worker `index` (1 .. count) of `count`.
struct WorkerShare {
    std::uint32_t index = 1, count = 1;
};

/// The slices of one worker: each slice, costliest first, goes to the worker with the least work so far (ties: the
/// lowest index). The shares of all workers are disjoint and together everything.
std::vector<SliceId> share_of(const Request& request, const std::vector<SliceId>& slices, WorkerShare share);

inline constexpr std::uint32_t most_workers = 1000000;

/// "I/N", 1 <= I <= N <= most_workers. Throws Error that names --shard.
WorkerShare parse_worker_share(const std::string& text);

}  // namespace medulla::tables
