// Canonical polyadic (CP) models: a tensor as a sum of `rank` outer products, and the solvers that find one.
// Rests on dense.hpp and Eigen. Kolda & Bader 2009, "Tensor Decompositions and Applications", for the notation.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tensor/dense.hpp"

namespace medulla::tensor {

/// value[i0, i1, ...] = sum_r weights[r] factors[0](i0, r) factors[1](i1, r) ...
/// Solvers return it in canonical form, see canonicalise().
struct CpModel {
    Eigen::VectorXd weights;               ///< `rank` values >= 0, descending
    std::vector<Eigen::MatrixXd> factors;  ///< factors[k] is shape[k] x rank, columns of unit length

    int rank() const { return static_cast<int>(weights.size()); }
    std::vector<std::size_t> shape() const;
};

/// The full tensor of a model.
Tensor expand(const CpModel& model);

/// |tensor - model| / |tensor| by explicit subtraction, cell by cell, in fixed order; 0 if both are zero, infinity if
/// only the tensor is. Shapes must agree.
double relative_error(const Tensor& tensor, const CpModel& model);

/// Unit columns, weights >= 0 and descending. Signs: in every factor but the last the entry of largest magnitude (the
/// first among equals) is positive; the last factor takes the remaining sign, so that weights are positive.
/// A component of weight 0 gets the first unit vector in every factor.
void canonicalise(CpModel& model);

/// Norm of the full tensor of a canonical model, from the cosines between its components, with the rounding of terms up
/// to (sum of weights)^2.
double norm(const CpModel& model);

/// How strongly the components of a model cancel.
struct Degeneracy {
    double least_cosine = 1;  ///< of any pair of components: -1 where two cancel, 1 for a single component
    double norm_ratio = 1;    ///< sum of component norms / norm of the tensor; large where components cancel
};
/// @param tensor_norm denominator of norm_ratio
Degeneracy degeneracy(const CpModel& model, double tensor_norm);

/// Why a solver stopped.
enum class Stop {
    converged,    ///< error fell by less than `tolerance` of itself over the last half of all sweeps
    sweeps,       ///< max_sweeps done while the error was still falling
    exact,        ///< the error is rounding
    stalled,      ///< no step, however short, lowers the objective: a stationary point within rounding
    zero_tensor,  ///< input and model are zero everywhere
};
std::string to_string(Stop stop);

/// Report of a solve.
struct CpReport {
    std::string solver;             ///< "als", "compressed als", "lm", ...
    int iterations = 0;             ///< sweeps or steps of the solve that was returned
    double relative_error = 0;      ///< |tensor - model| / |tensor|, of the model returned
    Stop stop = Stop::sweeps;       ///< of the solve that was returned
    Degeneracy degeneracy;          ///< of the model returned
    double ridge = 0;               ///< the penalty that was used, see CpOptions
    double truncation_error = 0;    ///< relative error of the HOSVD, 0 where none was used
    std::vector<std::size_t> core;  ///< shape of the core that was solved; the tensor's own for "als"
    double seconds = 0;             ///< wall clock, all starts
    std::vector<double> trace;      ///< relative error after each sweep of the solve that was returned
    std::vector<double> starts;     ///< final relative error of each start, in order

    /// Components cancel: the sum of their norms exceeds 10 times the tensor's.
    bool degenerate() const { return degeneracy.norm_ratio > 10; }
};
/// One line of text: solver, sweeps, error, why it stopped, and whether components cancel.
std::string summary(const CpReport& report);

struct CpResult {
    CpModel model;
    CpReport report;
};

struct CpOptions {
    int rank = 16;                    ///< number of components, >= 1; may exceed every dimension
    std::optional<int> max_sweeps;    ///< ALS sweeps or LM steps per start, >= 1; unset: ALS 500, LM 100
    std::optional<double> tolerance;  ///< see Stop::converged; 0 never fires; unset: ALS 1e-6, LM 1e-3
    std::uint64_t seed = 1;           ///< same seed, same bytes, for any number of threads
    /// Number of complete solves from different Gaussian starts, >= 1; the one with the smallest error is returned.
    /// Unset: ALS 1, LM 2 up to rank 32 and 1 beyond.
    std::optional<int> restarts;
    /// Penalty ridge / 2 * sum |factor|^2 on balanced factors of the unit-norm tensor, added to half the squared error.
    /// It keeps components from cancelling. Unset: ALS 0. LM starts from 1e-5 below rank 32 and 1e-6 from there on,
    /// raises it where components cancel and lowers it where the fit is so good that a finer core is needed;
    /// CpReport::ridge has the last value.
    std::optional<double> ridge;
    /// Relative error of the HOSVD that the compressed solvers start from. Unset: chosen by rank.
    std::optional<double> truncation;
};

/// Alternating least squares on the full tensor: the reference implementation of the fast solvers. No Khatri-Rao
/// product is formed; uses all OpenMP threads; sums have a fixed order. Throws std::invalid_argument for bad options
/// and non-finite cells.
CpResult cp_als(const Tensor& tensor, const CpOptions& options);

/// The same sweeps on the core of a truncated HOSVD, then expanded.
CpResult cp_als_compressed(const Tensor& tensor, const CpOptions& options);

/// Levenberg-Marquardt on the core of a truncated HOSVD, then expanded; see lm.hpp.
CpResult cp_lm(const Tensor& tensor, const CpOptions& options);

/// As cp_als, with every factor >= 0.
CpResult cp_nonnegative(const Tensor& tensor, const CpOptions& options);

enum class Solver { als, lm, nonnegative };
/// Calls the fast implementation: cp_als_compressed, cp_lm or cp_nonnegative.
CpResult cp(const Tensor& tensor, Solver solver, const CpOptions& options);

}  // namespace medulla::tensor
