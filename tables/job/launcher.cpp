#include "tables/job/launcher.hpp"

#include <array>
#include <charconv>
#include <cstdint>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

using Variables = std::function<const char*(const char*)>;

/// Where a launcher says the rank of a process, and of how many: the first of the sizes that is there.
struct Launcher {
    const char* rank;
    std::array<const char*, 2> sizes;
};

/// MPI's own come before Slurm's: an mpirun within a Slurm job starts one of its helpers on each node by srun, whose
/// SLURM_PROCID its ranks inherit.
constexpr Launcher launchers[] = {
    {"OMPI_COMM_WORLD_RANK", {"OMPI_COMM_WORLD_SIZE", nullptr}},  // Open MPI, Spectrum MPI
    {"MV2_COMM_WORLD_RANK", {"MV2_COMM_WORLD_SIZE", nullptr}},    // MVAPICH2
    {"MVP_COMM_WORLD_RANK", {"MVP_COMM_WORLD_SIZE", nullptr}},    // MVAPICH 3
    {"PALS_RANKID", {"PALS_SIZE", "PMI_SIZE"}},                   // HPE Cray PALS
    {"PMI_RANK", {"PMI_SIZE", nullptr}},                          // MPICH and Intel MPI (Hydra), srun --mpi=pmi2
    {"JSM_NAMESPACE_RANK", {"JSM_NAMESPACE_SIZE", nullptr}},      // IBM jsrun
    {"FLUX_TASK_RANK", {"FLUX_JOB_SIZE", nullptr}},
    {"SLURM_PROCID", {"SLURM_STEP_NUM_TASKS", "SLURM_NTASKS"}},
    {"PMIX_RANK", {"PMIX_SIZE", nullptr}},        // PRRTE's prun: the standard names no variable for the size
    {"ALPS_APP_PE", {"ALPS_APP_SIZE", nullptr}},  // Cray aprun, which names none either
};

std::uint32_t number(const Variables& variable, const char* name, std::optional<std::uint32_t> absent = std::nullopt) {
    const char* text = variable(name);
    if (!text && absent) return *absent;
    const std::string whole = text ? text : "";
    std::uint32_t value = 0;
    const auto [end, error] = std::from_chars(whole.data(), whole.data() + whole.size(), value);
    if (whole.empty() || error != std::errc() || end != whole.data() + whole.size())
        throw Error("{}: expected a whole number, found '{}'", name, whole);
    return value;
}

/// A job's batch script has SLURM_PROCID 0 and the job's SLURM_NTASKS, though it is one process: only srun makes a
/// step.
bool is_rank(const Launcher& launcher, const Variables& variable) {
    if (!variable(launcher.rank)) return false;
    const bool slurm = launcher.rank == std::string("SLURM_PROCID");
    return !slurm || variable("SLURM_STEP_ID") || variable("SLURM_STEPID") || !variable("SLURM_JOB_ID");
}

std::optional<Launched> array_task(const Variables& variable) {
    if (!variable("SLURM_ARRAY_TASK_ID")) return std::nullopt;
    const std::uint32_t id = number(variable, "SLURM_ARRAY_TASK_ID"),
                        count = number(variable, "SLURM_ARRAY_TASK_COUNT"),
                        least = number(variable, "SLURM_ARRAY_TASK_MIN", 0),
                        step = number(variable, "SLURM_ARRAY_TASK_STEP", 1);
    const std::uint32_t index = step > 0 && id >= least ? (id - least) / step : count;
    if (count < 1 || count > most_workers || index >= count || (id - least) % step != 0)
        throw Error("SLURM_ARRAY_TASK_ID: expected a task of an even array (--array=1-N), found task {} of {} from {}",
                    id, count, least);
    return Launched{{index + 1, count}, "SLURM_ARRAY_TASK_ID and SLURM_ARRAY_TASK_COUNT"};
}

std::optional<Launched> rank(const Variables& variable) {
    for (const Launcher& launcher : launchers) {
        if (!is_rank(launcher, variable)) continue;
        const char* size_name = nullptr;
        for (const char* name : launcher.sizes)
            if (name && !size_name && variable(name)) size_name = name;
        if (!size_name)
            throw Error("{}: expected the number of ranks beside it in {}, found none; say --shard I/N or --shard none",
                        launcher.rank, launcher.sizes[0]);
        const std::uint32_t index = number(variable, launcher.rank), size = number(variable, size_name);
        if (index >= size || size > most_workers)
            throw Error("{}: expected a rank below {} ({}, at most {}), found {}", launcher.rank, size, size_name,
                        most_workers, index);
        return Launched{{index + 1, size}, fmt::format("{} and {}", launcher.rank, size_name)};
    }
    return std::nullopt;
}

}  // namespace

std::optional<Launched> launched(const Variables& variable) {
    std::optional<Launched> task = array_task(variable), inner = rank(variable);
    if (!task || !inner) {
        std::optional<Launched>& one = task ? task : inner;
        if (one && one->share.count == 1) one.reset();
        return one;
    }
    const std::uint32_t tasks = task->share.count, ranks = inner->share.count;
    if (std::uint64_t{tasks} * ranks > most_workers)
        throw Error("{}: expected at most {} workers in all, found {} x {}", inner->from, most_workers, tasks, ranks);
    if (tasks * ranks == 1) return std::nullopt;
    return Launched{{(task->share.index - 1) * ranks + inner->share.index, tasks * ranks},
                    task->from + ", " + inner->from};
}

}  // namespace medulla::tables
