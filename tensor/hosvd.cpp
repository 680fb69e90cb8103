// Truncation mode by mode: Gram matrix and eigenvectors, or for long modes a random range finder that grows until the
// missed part is small. Uses Eigen and OpenMP.
#include "tensor/hosvd.hpp"

#include <algorithm>
#include <cmath>

#include "tensor/solving.hpp"

namespace medulla::tensor {

namespace {

using Eigen::Index;

/// A tensor seen from one mode: [outer][nodes][inner].
struct ModeView {
    Index outer = 1, nodes = 1, inner = 1;
    ModeView(const std::vector<std::size_t>& shape, std::size_t mode) : nodes(static_cast<Index>(shape[mode])) {
        for (std::size_t k = 0; k < mode; ++k) outer *= static_cast<Index>(shape[k]);
        for (std::size_t k = mode + 1; k < shape.size(); ++k) inner *= static_cast<Index>(shape[k]);
    }
};

constexpr Index block_length = 2048;  // 16 nodes of it fill 256 KB. A constant, since it decides the order of sums

/// Lower triangle of the Gram matrix, which is all that the eigenvectors need.
Eigen::MatrixXd gram(const Tensor& tensor, std::size_t mode) {
    const ModeView view(tensor.shape, mode);
    // Partial sums over fixed parts of the work, added in order.
    const Index blocks = view.inner == 1 ? (view.outer + block_length - 1) / block_length
                                         : view.outer * ((view.inner + block_length - 1) / block_length);
    const Index shares = std::min<Index>(16, blocks);
    std::vector<Eigen::MatrixXd> sums(static_cast<std::size_t>(shares), Eigen::MatrixXd::Zero(view.nodes, view.nodes));
#pragma omp parallel for schedule(dynamic) if (shares > 1 && tensor.size() > (1u << 18))
    for (Index share = 0; share < shares; ++share) {
        Eigen::MatrixXd& sum = sums[static_cast<std::size_t>(share)];
        for (Index block = share * blocks / shares; block < (share + 1) * blocks / shares; ++block) {
            if (view.inner == 1) {
                const Index from = block * block_length, count = std::min(block_length, view.outer - from);
                const Eigen::Map<const RowMatrix> rows(tensor.values.data() + from * view.nodes, count, view.nodes);
                sum.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
            } else {
                const Index per_outer = (view.inner + block_length - 1) / block_length;
                const Index o = block / per_outer, from = block % per_outer * block_length;
                const Eigen::Map<const RowMatrix> slab(tensor.values.data() + o * view.nodes * view.inner, view.nodes,
                                                       view.inner);
                const auto columns = slab.middleCols(from, std::min(block_length, view.inner - from));
                sum.selfadjointView<Eigen::Lower>().rankUpdate(columns);
            }
        }
    }
    for (std::size_t s = 1; s < sums.size(); ++s) sums[0] += sums[s];
    return sums[0];
}

/// Eigenvectors of the leading eigenvalues, as few as leave at most `budget` of the trace, and the part they leave.
struct Leading {
    Eigen::MatrixXd vectors;
    double left = 0;
};
Leading leading(const Eigen::MatrixXd& symmetric, double budget) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(symmetric);
    const Index n = symmetric.rows();
    Index drop = 0;
    double left = 0;
    for (; drop + 1 < n; ++drop) {
        const double next = left + std::max(0.0, eigen.eigenvalues()[drop]);
        if (next > budget) break;
        left = next;
    }
    return {eigen.eigenvectors().rightCols(n - drop).rowwise().reverse(), left};
}

/// The matricised tensor, nodes x (all other modes), copied.
Eigen::MatrixXd matricise(const Tensor& tensor, std::size_t mode) {
    const ModeView view(tensor.shape, mode);
    Eigen::MatrixXd result(view.nodes, view.outer * view.inner);
    for (Index o = 0; o < view.outer; ++o)
        result.middleCols(o * view.inner, view.inner) =
            Eigen::Map<const RowMatrix>(tensor.values.data() + o * view.nodes * view.inner, view.nodes, view.inner);
    return result;
}

/// A basis of a long mode: random blocks until the missed part is a tenth of the budget, then truncation.
Leading leading_of_long_mode(const Tensor& tensor, std::size_t mode, double squared_norm, double budget) {
    const Eigen::MatrixXd a = matricise(tensor, mode);
    const Index most = std::min(a.rows(), a.cols()), block = 32;
    Eigen::MatrixXd basis(a.rows(), 0), coefficients(0, a.cols());
    double missed = squared_norm;
    for (int round = 0; basis.cols() < most && missed > 0.1 * budget; ++round) {
        const Index width = std::min(block, most - basis.cols());
        const RowMatrix probes =
            gaussian_factors({static_cast<std::size_t>(a.cols())}, static_cast<int>(width), 0x5eed, round)[0];
        Eigen::MatrixXd sample = a * probes;
        for (int twice = 0; twice < 2; ++twice) {  // Kahan's "twice is enough" for orthogonality
            sample -= basis * (basis.transpose() * sample).eval();
            sample = (Eigen::HouseholderQR<Eigen::MatrixXd>(sample).householderQ() *
                      Eigen::MatrixXd::Identity(a.rows(), width))
                         .eval();
        }
        const Index before = basis.cols();
        basis.conservativeResize(Eigen::NoChange, before + width);
        basis.rightCols(width) = sample;
        coefficients.conservativeResize(before + width, Eigen::NoChange);
        coefficients.bottomRows(width).noalias() = sample.transpose() * a;
        missed = std::max(0.0, missed - coefficients.bottomRows(width).squaredNorm());
    }
    if (basis.cols() == most) missed = 0;
    Leading inner = leading(coefficients * coefficients.transpose(), budget - missed);
    return {basis * inner.vectors, inner.left + missed};
}

}  // namespace

Tensor multiply(const Tensor& tensor, const Eigen::MatrixXd& matrix, std::size_t mode) {
    const ModeView view(tensor.shape, mode);
    std::vector<std::size_t> shape = tensor.shape;
    shape[mode] = static_cast<std::size_t>(matrix.rows());
    Tensor result(shape);
    if (view.inner == 1) {
        const Index chunks = (view.outer + block_length - 1) / block_length;
#pragma omp parallel for schedule(static) if (tensor.size() > (1u << 18))
        for (Index chunk = 0; chunk < chunks; ++chunk) {
            const Index from = chunk * block_length, count = std::min(block_length, view.outer - from);
            const Eigen::Map<const RowMatrix> rows(tensor.values.data() + from * view.nodes, count, view.nodes);
            Eigen::Map<RowMatrix>(result.values.data() + from * matrix.rows(), count, matrix.rows()).noalias() =
                rows * matrix.transpose();
        }
        return result;
    }
    const Index per_outer = (view.inner + block_length - 1) / block_length;
#pragma omp parallel for schedule(static) if (tensor.size() > (1u << 18))
    for (Index block = 0; block < view.outer * per_outer; ++block) {
        const Index o = block / per_outer, from = block % per_outer * block_length;
        const Index count = std::min(block_length, view.inner - from);
        const Eigen::Map<const RowMatrix> slab(tensor.values.data() + o * view.nodes * view.inner, view.nodes,
                                               view.inner);
        Eigen::Map<RowMatrix> target(result.values.data() + o * matrix.rows() * view.inner, matrix.rows(), view.inner);
        target.middleCols(from, count).noalias() = matrix * slab.middleCols(from, count);
    }
    return result;
}

Hosvd truncated_hosvd(const Tensor& tensor, double relative_error) {
    const double length = norm(tensor), bound = std::max(relative_error, finest_truncation);
    const std::size_t order = tensor.order();
    std::vector<std::size_t> modes(order);
    for (std::size_t k = 0; k < order; ++k) modes[k] = k;
    const auto longest = std::max_element(tensor.shape.begin(), tensor.shape.end()) - tensor.shape.begin();
    std::rotate(modes.begin() + longest, modes.begin() + longest + 1, modes.end());
    Hosvd result;
    result.bases.resize(order);
    double allowed = bound * bound * length * length, left = 0;
    for (std::size_t step = 0; step < order; ++step) {
        const std::size_t k = modes[step];
        const Tensor& current = step == 0 ? tensor : result.core;
        // The unused part of a mode's budget passes to the next.
        const double budget = (allowed - left) / static_cast<double>(order - step);
        const Leading found = current.shape[k] > 64
                                  ? leading_of_long_mode(current, k, std::pow(norm(current), 2), budget)
                                  : leading(gram(current, k), budget);
        left += found.left;
        result.core = multiply(current, found.vectors.transpose(), k);
        result.bases[k] = found.vectors;
    }
    result.error = std::sqrt(left) / length;
    return result;
}

}  // namespace medulla::tensor
