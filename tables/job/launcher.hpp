// Which worker of how many a process is, from what the launcher of a cluster put into its environment.
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

/// The share that a launcher means for this process: the rank of an MPI launcher (Open MPI, MVAPICH, PALS, MPICH, Intel
/// MPI), of jsrun, of Flux, or of a Slurm step; within the task of a Slurm array where there is one. None where
/// there is no launcher, or one process alone: that makes the whole table.
/// @param variable value of an environment variable, or null
/// @throws Error that names the variable: a rank without a size, a value that is no number, a rank that is not below
/// its size
std::optional<Launched> launched(const std::function<const char*(const char*)>& variable);

}  // namespace medulla::tables
