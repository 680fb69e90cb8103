// The worker share of a process, from the environment variables of a cluster's launcher.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "tables/job/worker_share.hpp"

namespace medulla::tables {

struct Launched {
    WorkerShare share;
    std::string from;  ///< "PMI_RANK and PMI_SIZE"
};

/// The share of this process: the rank of an MPI launcher (Open MPI, MVAPICH, PALS, MPICH, Intel MPI), of jsrun, of
/// Flux, or of a Slurm step; within its task of a Slurm array, if any. None without a launcher or for a single process,
/// which makes the whole table.
/// @param variable value of an environment variable, or null
/// @throws Error that names the variable: a rank without a size, an invalid number, a rank not below its size
std::optional<Launched> launched(const std::function<const char*(const char*)>& variable);

}  // namespace medulla::tables
