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
    Eigen::VectorXd weights;               ///< rank of them, >= 0, descending
    std::vector<Eigen::MatrixXd> factors;  ///< factors[k] is shape[k] x rank, columns of unit length

    int rank() const { return static_cast<int>(weights.size()); }
    std::vector<std::size_t> shape() const;
};

/// The full tensor of a model.
Tensor expand(const CpModel& model);

/// |tensor - model| / |tensor| by explicit subtraction, cell by cell, in fixed order; 0 where both are zero, and
/// infinity where only the tensor is. Shapes must agree.
double relative_error(const Tensor& tensor, const CpModel& model);

/// Unit columns, weights >= 0 and descending. Signs: in every factor but the last the entry of largest magnitude (the
/// first among equals) is positive; the last factor takes the sign that is left, so that weights stay positive.
/// A component of weight 0 gets the first unit vector in every factor.
void canonicalise(CpModel& model);

/// Norm of the full tensor of a canonical model, from the cosines of its components: rounding is that of terms up to
/// (sum of weights)^2.
double norm(const CpModel& model);

/// How far a model is from a sum of components that do not cancel.
struct Degeneracy {
    double least_cosine = 1;  ///< of any pair of components: -1 where two cancel, 1 for a single component
    double norm_ratio = 1;    ///< sum of component norms over the tensor's norm; large where components cancel
};
/// `tensor_norm` is what norm_ratio divides by.
Degeneracy degeneracy(const CpModel& model, double tensor_norm);

/// Components that are enough for any tensor of this shape: one for each fibre along its longest axis (Kruskal 1989).
/// At most the greatest int.
int most_components(const std::vector<std::size_t>& shape);

/// Why a solver stopped.
enum class Stop {
    converged,    ///< error fell by less than `tolerance` of itself over the last half of all sweeps
    sweeps,       ///< max_sweeps done and the error still falls
    exact,        ///< nothing left but rounding
    stalled,      ///< no step, however short, lowers the objective: a stationary point to rounding
    zero_tensor,  ///< the input is zero everywhere, and so is the model
};
std::string to_string(Stop stop);

/// What a solver did.
struct CpReport {
    std::string solver;             ///< "als", "compressed als", "lm", ...
    int iterations = 0;             ///< sweeps or steps of the solve that was kept
    double relative_error = 0;      ///< |tensor - model| / |tensor|, of the model returned
    Stop stop = Stop::sweeps;       ///< of the solve that was kept
    Degeneracy degeneracy;          ///< of the model returned
    double ridge = 0;               ///< the one in force, see CpOptions
    double truncation_error = 0;    ///< relative error of the HOSVD beneath, 0 where there is none
    std::vector<std::size_t> core;  ///< shape that was solved on; the tensor's own for "als"
    double seconds = 0;             ///< wall clock, all starts
    std::vector<double> trace;      ///< relative error after each sweep of the solve that was kept
    std::vector<double> starts;     ///< final relative error of each start, in order
    int spare = 0;                  ///< components that were asked for and left out: see most_components

    /// Components cancel: their norms add up to more than 10 times the tensor's.
    bool degenerate() const { return degeneracy.norm_ratio > 10; }
};
/// One line for people: solver, sweeps, error, why it stopped, and whether components cancel.
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
    /// Complete solves from different Gaussian starts, >= 1; the least error is kept. Unset: ALS 1, LM 2 up to rank 32
    /// and 1 beyond.
    std::optional<int> restarts;
    /// Penalty ridge * sum |factor|^2 on balanced factors of the unit-norm tensor (half of it beside half the squared
    /// error): what keeps components from cancelling.
    /// Unset: ALS 0; LM starts from 1e-5 below rank 32 and 1e-6 on, raises it where components cancel, and lowers it
    /// where the fit is so good that a finer core was needed. CpReport::ridge says where it ended.
    std::optional<double> ridge;
    /// Relative error of the HOSVD beneath the compressed solvers. Unset: each solver's own.
    std::optional<double> truncation;
};

/// Alternating least squares on the full tensor: the plain twin of the fast solvers. No Khatri-Rao product is formed;
/// all OpenMP threads; sums in fixed order. Throws std::invalid_argument for bad options and non-finite cells.
CpResult cp_als(const Tensor& tensor, const CpOptions& options);

/// The same sweeps on the core of a truncated HOSVD, then expanded.
CpResult cp_als_compressed(const Tensor& tensor, const CpOptions& options);

/// Levenberg-Marquardt on the core of a truncated HOSVD, then expanded; see lm.hpp.
CpResult cp_lm(const Tensor& tensor, const CpOptions& options);

/// As cp_als, with every factor >= 0.
CpResult cp_nonnegative(const Tensor& tensor, const CpOptions& options);

/// The fibres of the tensor along its longest axis as components, no solve: options.rank is not read. Orthogonal and
/// exact on the core of a HOSVD at finest_truncation; with factors >= 0 the fibres of the tensor itself, each number
/// below 0 as 0, which no such factors fit better.
CpResult cp_fibres(const Tensor& tensor, bool nonnegative);

enum class Solver { als, lm, nonnegative };
/// The fast path of each: cp_als_compressed, cp_lm, cp_nonnegative; cp_fibres from most_components on, whose model then
/// has no more than that, however many options.rank says.
CpResult cp(const Tensor& tensor, Solver solver, const CpOptions& options);

}  // namespace medulla::tensor
