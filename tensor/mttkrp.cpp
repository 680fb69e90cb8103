// Blocked MTTKRP: each block of the tensor is multiplied with a block of Khatri-Rao rows that is formed on the fly.
// Phan, Tichavsky, Cichocki 2013, "Fast alternating LS algorithms ...", for the split into two sides.
#include "tensor/mttkrp.hpp"

#include <algorithm>
#include <cmath>

namespace medulla::tensor {

namespace {

// A tensor block of 64 x 256 doubles fills 128 KB of L2. Constants, since they decide the order of sums.
constexpr Eigen::Index outputs_per_chunk = 64;
constexpr Eigen::Index terms_per_block = 256;

// Starting a team of threads takes about 10 us, and far more on shared cores: only for a few milliseconds of work.
bool worth_threads(Eigen::Index cells, Eigen::Index rank) { return cells * rank > (Eigen::Index{1} << 23); }

}  // namespace

void khatri_rao_rows(const Factors& factors, std::size_t first, std::size_t last, Eigen::Index begin,
                     Eigen::Index count, RowMatrix& rows) {
    const Eigen::Index rank = factors[0].cols();
    rows.resize(count, rank);
    if (first == last) {
        rows.setOnes();
        return;
    }
    const RowMatrix& fastest = factors[last - 1];
    Eigen::Array<double, 1, Eigen::Dynamic> prefix(rank);
    for (Eigen::Index row = 0; row < count;) {
        Eigen::Index rest = (begin + row) / fastest.rows();
        const Eigen::Index from = (begin + row) % fastest.rows();
        const Eigen::Index length = std::min(fastest.rows() - from, count - row);
        if (last - first == 1) {
            rows.middleRows(row, length) = fastest.middleRows(from, length);
        } else {
            prefix.setOnes();
            for (std::size_t k = last - 1; k-- > first; rest /= factors[k].rows())
                prefix *= factors[k].row(rest % factors[k].rows()).array();
            for (Eigen::Index i = 0; i < length; ++i)
                rows.row(row + i).array() = fastest.row(from + i).array() * prefix;
        }
        row += length;
    }
}

SplitTensor::SplitTensor(const double* values, std::vector<std::size_t> shape)
    : values_(values), shape_(std::move(shape)), split_(1) {
    // The split with sides of the most similar size leaves the least work after the two large products.
    double best = INFINITY, size = 0, before = 0;
    for (std::size_t n : shape_) size += std::log(static_cast<double>(n));
    for (std::size_t k = 1; k < shape_.size(); ++k) {
        before += std::log(static_cast<double>(shape_[k - 1]));
        if (std::abs(2 * before - size) < best) {
            best = std::abs(2 * before - size);
            split_ = k;
        }
    }
    for (std::size_t k = 0; k < shape_.size(); ++k)
        (k < split_ ? rows_ : columns_) *= static_cast<Eigen::Index>(shape_[k]);
}

RowMatrix SplitTensor::down(const Factors& factors, double scale) const {
    const Eigen::Map<const RowMatrix> tensor(values_, rows_, columns_);
    RowMatrix result = RowMatrix::Zero(rows_, factors[0].cols());
    const Eigen::Index chunks = (rows_ + outputs_per_chunk - 1) / outputs_per_chunk;
#pragma omp parallel for schedule(dynamic) if (worth_threads(rows_ * columns_, result.cols()))
    for (Eigen::Index chunk = 0; chunk < chunks; ++chunk) {
        const Eigen::Index row = chunk * outputs_per_chunk, count = std::min(outputs_per_chunk, rows_ - row);
        RowMatrix terms;
        for (Eigen::Index from = 0; from < columns_; from += terms_per_block) {
            const Eigen::Index length = std::min(terms_per_block, columns_ - from);
            khatri_rao_rows(factors, split_, shape_.size(), from, length, terms);
            add_product(tensor.block(row, from, count, length), terms, result.middleRows(row, count));
        }
        result.middleRows(row, count) *= scale;
    }
    return result;
}

RowMatrix SplitTensor::across(const Factors& factors, double scale) const {
    const Eigen::Map<const RowMatrix> tensor(values_, rows_, columns_);
    RowMatrix result = RowMatrix::Zero(columns_, factors[0].cols());
    const Eigen::Index per_chunk = 4 * outputs_per_chunk;  // read along the tensor's rows: longer runs
    const Eigen::Index chunks = (columns_ + per_chunk - 1) / per_chunk;
#pragma omp parallel for schedule(dynamic) if (worth_threads(rows_ * columns_, result.cols()))
    for (Eigen::Index chunk = 0; chunk < chunks; ++chunk) {
        const Eigen::Index column = chunk * per_chunk, count = std::min(per_chunk, columns_ - column);
        RowMatrix terms;
        for (Eigen::Index from = 0; from < rows_; from += terms_per_block) {
            const Eigen::Index length = std::min(terms_per_block, rows_ - from);
            khatri_rao_rows(factors, 0, split_, from, length, terms);
            add_product(tensor.block(from, column, length, count).transpose(), terms, result.middleRows(column, count));
        }
        result.middleRows(column, count) *= scale;
    }
    return result;
}

RowMatrix SplitTensor::mode(const RowMatrix& side, const Factors& factors, std::size_t mode) const {
    const std::size_t first = mode < split_ ? 0 : split_, last = mode < split_ ? split_ : shape_.size();
    if (last - first == 1) return side;
    const Eigen::Index rank = side.cols(), nodes = static_cast<Eigen::Index>(shape_[mode]);
    Eigen::Index outer = 1, inner = 1;
    for (std::size_t k = first; k < mode; ++k) outer *= static_cast<Eigen::Index>(shape_[k]);
    for (std::size_t k = mode + 1; k < last; ++k) inner *= static_cast<Eigen::Index>(shape_[k]);
    RowMatrix before, after, result = RowMatrix::Zero(nodes, rank);
    khatri_rao_rows(factors, first, mode, 0, outer, before);
    khatri_rao_rows(factors, mode + 1, last, 0, inner, after);
    Eigen::Array<double, 1, Eigen::Dynamic> sum(rank);
    for (Eigen::Index o = 0; o < outer; ++o)
        for (Eigen::Index i = 0; i < nodes; ++i) {
            const Eigen::Index row = (o * nodes + i) * inner;
            sum = (side.middleRows(row, inner).array() * after.array()).colwise().sum();
            result.row(i).array() += sum * before.row(o).array();
        }
    return result;
}

double SplitTensor::residual_squared(const Factors& factors, const Eigen::VectorXd& weights, double scale) const {
    const Eigen::Map<const RowMatrix> tensor(values_, rows_, columns_);
    const Eigen::Index chunks = (rows_ + outputs_per_chunk - 1) / outputs_per_chunk;
    std::vector<double> sums(static_cast<std::size_t>(chunks), 0.0);
#pragma omp parallel for schedule(dynamic) if (worth_threads(rows_ * columns_, weights.size()))
    for (Eigen::Index chunk = 0; chunk < chunks; ++chunk) {
        const Eigen::Index row = chunk * outputs_per_chunk, count = std::min(outputs_per_chunk, rows_ - row);
        RowMatrix left, right, model;
        khatri_rao_rows(factors, 0, split_, row, count, left);
        left.array().rowwise() *= weights.transpose().array();
        double sum = 0;
        for (Eigen::Index from = 0; from < columns_; from += terms_per_block) {
            const Eigen::Index length = std::min(terms_per_block, columns_ - from);
            khatri_rao_rows(factors, split_, shape_.size(), from, length, right);
            multiply(left, right.transpose(), model);
            sum += (scale * tensor.block(row, from, count, length) - model).squaredNorm();
        }
        sums[static_cast<std::size_t>(chunk)] = sum;
    }
    double total = 0;
    for (double s : sums) total += s;
    return total;
}

}  // namespace medulla::tensor
