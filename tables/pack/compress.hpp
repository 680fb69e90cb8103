// Tables -> low-rank factors -> pack. Each kind of lobe is split into its mirror-even and mirror-odd part (parts.hpp);
// pilot solves decide how many components each part gets.
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
    int rank = 16;                    ///< components of each part, at most max_rank / 2
    std::optional<double> max_error;  ///< instead: the smallest pack with at most this relative L2 error of every kind
    std::optional<std::size_t> max_bytes;  ///< instead: the smallest error within this many bytes
    ExitSpans spans;                       ///< with max_bytes: an upper bound; fewer where other errors dominate
    tensor::Solver solver = tensor::Solver::lm;
    std::uint64_t seed = 1;
    std::optional<int> max_sweeps;  ///< limit of each solve except pilots; unset: the solver's default
};

struct PartReport {
    Mirror mirror;  ///< none for the slab's energies, which have no exit direction, and for whole non-negative lobes
    tensor::CpReport solve;
    int rank = 0;
    double share = 1;  ///< norm of the part / norm of its kind's lobes
};

struct TableReport {
    TableKind kind;
    std::vector<PartReport> parts;
    /// Relative L2 against the table: of the factors before rounding and normalisation. Of non-negative factors, which
    /// normalisation improves much: in a pack of 16 bits.
    double fit_error = 0;
    double rounding = 0;    ///< relative L2 of rounding to the pack's bits, added in quadrature
    double exit_error = 0;  ///< part of fit_error from the exit spline
    double noise = 0;       ///< relative L2 standard error of the table itself
};

struct CompressResult {
    std::vector<unsigned char> pack;
    std::vector<TableReport> tables;
    std::vector<LobeError> errors;  ///< of the finished pack against the tables
    PackDegeneracy degeneracy;      ///< of the finished pack's components
    double solve_seconds = 0;       ///< from tables in memory to the pack
    double cpu_seconds = 0;         ///< processor time of that, all threads of the program
    double seconds = 0;             ///< solve_seconds plus the evaluation of `errors`; without reading or writing files
};

/// Compresses every lobe kind of `tables`. The provenance names `input`. Throws Error where max_error or
/// max_bytes cannot be met.
CompressResult compress(const Tables& tables, const CompressOptions& options, const std::string& input);

}  // namespace medulla::tables
