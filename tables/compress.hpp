// Tables -> low-rank factors -> pack. The exit axis becomes a spline fitted to bin averages, every other axis one
// through its nodes; the decomposition runs on the exit spline's orthonormal coordinates, where L2 errors are the same.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tables/source.hpp"
#include "tensor/cp.hpp"

namespace medulla::tables {

struct CompressOptions {
    int rank = 16;                         ///< components of each table
    std::optional<double> max_error;       ///< instead: the smallest pack whose every table keeps this relative L2
    std::optional<std::size_t> max_bytes;  ///< instead: the least error within this many bytes
    std::size_t phi_spans = 128, theta_spans = 128;  ///< exit spline of the azimuthal and longitudinal lobes
    tensor::Solver solver = tensor::Solver::lm;
    std::uint64_t seed = 1;
};

struct TableReport {
    TableKind kind;
    int rank = 0;
    double fit_error = 0;   ///< relative L2 of the factors against the table, before rounding and normalisation
    double exit_error = 0;  ///< part of it that the exit spline leaves
    double noise = 0;       ///< relative L2 standard error of the table itself
    tensor::CpReport solve;
};

struct CompressResult {
    std::vector<unsigned char> pack;
    std::vector<TableReport> tables;
    std::vector<LobeError> errors;  ///< of the finished pack against the tables
    double seconds = 0;             ///< without reading or writing files
};

/// Compresses every lobe kind of `tables`. `input` is named in the pack's provenance. Throws Error where max_error or
/// max_bytes cannot be met.
CompressResult compress(const Tables& tables, const CompressOptions& options, const std::string& input);

/// Breakpoints of an exit spline on bin edges: dense where lobes are sharp (phi: at 0 and, less, at +-pi).
std::vector<double> exit_breakpoints(const std::string& exit, std::size_t bins, std::size_t spans);

}  // namespace medulla::tables
