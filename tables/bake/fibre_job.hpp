// A job from a material to a file with its light. What is simulated so far is kept beside the output, so that a kill,
// a full disk or a crash loses at most the last few seconds.
#pragma once

#include <string>
#include <vector>

#include "tables/bake/fibre_file.hpp"
#include "tables/job/progress.hpp"

namespace medulla::tables {

struct FibreJob {
    FibreRequest request;
    std::string where;  ///< file or preset of the material, for messages
    std::string output;
    std::vector<std::string> inputs;
    bool resume = false;
    int threads = 0;  ///< 0: all
    ProgressMode progress = ProgressMode::automatic;
    Compression compression = Compression::zstd;
};

struct FibreJobReport {
    std::size_t cells = 0, kept = 0;  ///< kept: from an earlier run
    bool was_complete = false;        ///< the output of the same job already existed
    double noise = 0;                 ///< median relative L2 standard error of a lobe
};

/// Throws Interrupted on SIGINT or SIGTERM, Error where it could not be done; both say what is kept.
FibreJobReport run_fibre_job(const FibreJob& job);

}  // namespace medulla::tables
