// Tables -> low-rank factors -> pack. Each kind of lobe is decomposed in its mirror-even and mirror-odd part
// (parts.hpp); how many components each part gets follows from a pilot solve.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tables/pack/degeneracy.hpp"
#include "tables/pack/parts.hpp"
#include "tables/pack/source.hpp"
#include "tables/pack/spline.hpp"
#include "tensor/cp.hpp"

namespace medulla::tables {

struct CompressOptions {
    int rank = 16;                         ///< components of each part, at most max_rank / 2
    std::optional<double> max_error;       ///< instead: the smallest pack whose every kind keeps this relative L2
    std::optional<std::size_t> max_bytes;  ///< instead: the least error within this many bytes
    ExitSpans spans;                       ///< with max_bytes: the most; fewer where they are not what errors are of
    tensor::Solver solver = tensor::Solver::lm;
    std::uint64_t seed = 1;
    std::optional<int> max_sweeps;  ///< most steps of each solve but the pilots; unset: the solver's own
};

struct PartReport {
    Mirror mirror;  ///< none: the slab's energies, which have no exit direction, and whole non-negative lobes
    tensor::CpReport solve;
    int rank = 0;
    double share = 1;  ///< norm of the part over that of its kind's lobes
};

struct TableReport {
    TableKind kind;
    std::vector<PartReport> parts;
    /// Relative L2 against the table: of the factors before rounding and normalisation; of non-negative ones, which
    /// normalisation brings much nearer, in a pack of 16 bits.
    double fit_error = 0;
    double rounding = 0;    ///< relative L2 that rounding to the pack's bits adds, in squares
    double exit_error = 0;  ///< part of it that the exit spline leaves
    double noise = 0;       ///< relative L2 standard error of the table itself
};

struct CompressResult {
    std::vector<unsigned char> pack;
    std::vector<TableReport> tables;
    std::vector<LobeError> errors;  ///< of the finished pack against the tables
    PackDegeneracy degeneracy;      ///< of the finished pack's components
    double solve_seconds = 0;       ///< tables in memory to pack
    double cpu_seconds = 0;         ///< processor time of those, all threads of the program
    double seconds = 0;             ///< solve_seconds and the errors; without reading or writing files
};

/// Compresses every lobe kind of `tables`. `input` is named in the pack's provenance. Throws Error where max_error or
/// max_bytes cannot be met.
CompressResult compress(const Tables& tables, const CompressOptions& options, const std::string& input);

}  // namespace medulla::tables
