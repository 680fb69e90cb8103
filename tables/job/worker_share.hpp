// The slices of one worker among many: `--shard I/N`, or what a cluster's launcher says.
#pragma once

#include <functional>
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

/// "I/N", 1 <= I <= N. Throws Error that names --shard.
WorkerShare parse_worker_share(const std::string& text);

/// The share that a cluster's launcher gives this process: a Slurm array task (SLURM_ARRAY_TASK_ID, _COUNT, _MIN,
/// _STEP), else an Open MPI rank (OMPI_COMM_WORLD_RANK, _SIZE), else none. Both at once: rank within task.
/// @param variable value of an environment variable, or null   @throws Error that names the variable
std::optional<WorkerShare> launcher_share(const std::function<const char*(const char*)>& variable);

}  // namespace medulla::tables
