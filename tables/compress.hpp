// Tables -> low-rank factors -> pack. The exit axis becomes a spline fitted to bin averages, every other axis one
// through its nodes; the decomposition runs on the exit spline's orthonormal coordinates, where L2 errors are the same.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tables/source.hpp"
#include "tensor/cp.hpp"

namespace medulla::tables {

struct CompressOptions {
    int rank = 16;
    std::size_t phi_spans = 128, theta_spans = 96;  ///< exit spline of the azimuthal and longitudinal lobes
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

/// Compresses every lobe kind of `tables`. `input` is named in the pack's provenance.
CompressResult compress(const Tables& tables, const CompressOptions& options, const std::string& input);

/// Breakpoints of an exit spline on bin edges: dense where lobes are sharp (phi: at 0 and, less, at +-pi).
std::vector<double> exit_breakpoints(const std::string& exit, std::size_t bins, std::size_t spans);

}  // namespace medulla::tables
