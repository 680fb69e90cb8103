// A job from request to tables file: slices are kept in `<output>.shards/` as they are solved, so that a kill, a full
// disk or a crash at any moment loses at most the slices in work. docs/formats.md, docs/cluster.md.
#pragma once

#include <optional>
#include <string>

#include "tables/job/simulate.hpp"
#include "tables/job/worker_share.hpp"
#include "tables/store/slice_files.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {

struct Job {
    Request request;
    std::string output;
    std::vector<std::string> inputs;  ///< files that the request was read from: the output is none of them
    bool resume = false;
    std::optional<WorkerShare> share;  ///< a worker: solves its share and writes slice files only
    ProgressMode progress = ProgressMode::automatic;
    Compression compression = Compression::zstd;
};

struct JobReport {
    Tables tables;              ///< of the whole job; of a worker its axes only
    bool was_complete = false;  ///< the output was there already, of the same configuration
    std::string folder;         ///< of the slice files
    std::size_t slices = 0;     ///< of the job, or of the worker's share
    std::size_t kept = 0;       ///< of these, found kept
};

/// Runs a job. Throws Interrupted on SIGINT or SIGTERM, Error where it could not be done; both say what is kept.
JobReport run_job(const Job& job);

/// Tables from the slices kept in a folder; throws Error if one is missing or damaged.
Tables assemble(const SliceFolder& folder, const Tables& plan);

}  // namespace medulla::tables
