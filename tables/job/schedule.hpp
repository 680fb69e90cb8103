// Which slices first, and which for whom: expected cost of a slice, and the shares of `--shard I/N`.
// The same on every machine: costs are whole numbers made with + - * / alone.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "tables/job/request.hpp"
#include "tables/store/slices.hpp"

namespace medulla::tables {

/// Expected cost of a slice in microseconds of one core of the machine of docs/cluster.md. Only ratios matter.
std::uint64_t expected_cost(const Request& request, const SliceId& id);

/// The costliest first, equal ones in their order: what ends a parallel run is then short.
std::vector<SliceId> by_cost(const Request& request, std::vector<SliceId> slices);

/// Worker `index` (1 .. count) of `count`.
struct Shard {
    std::uint32_t index = 1, count = 1;
};

/// The slices of one worker: each slice, costliest first, goes to the worker with the least work so far (ties: the
/// lowest index). The shares of all workers are disjoint and together everything.
std::vector<SliceId> share_of(const Request& request, const std::vector<SliceId>& slices, Shard shard);

/// "I/N", 1 <= I <= N. Throws Error that names --shard.
Shard parse_shard(const std::string& text);

/// The shard that a cluster's launcher means for this process: a Slurm array task (SLURM_ARRAY_TASK_ID, _COUNT, _MIN,
/// _STEP), else an Open MPI rank (OMPI_COMM_WORLD_RANK, _SIZE), else none. Both at once: rank within task.
/// @param variable value of an environment variable, or null   @throws Error that names the variable
std::optional<Shard> launcher_shard(const std::function<const char*(const char*)>& variable);

}  // namespace medulla::tables
