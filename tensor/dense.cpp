// Shapes, validity and norms of dense tensors.
// Rests on dense.hpp, and on Eigen for loops over blocks.
#include "tensor/dense.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace medulla::tensor {

namespace {

std::size_t cell_count(const std::vector<std::size_t>& shape) {
    if (shape.empty()) throw std::invalid_argument("tensor: a shape needs at least one axis");
    std::size_t count = 1;
    for (std::size_t k = 0; k < shape.size(); ++k) {
        if (shape[k] == 0) throw std::invalid_argument("tensor: axis " + std::to_string(k) + " has no node");
        if (count > std::numeric_limits<std::size_t>::max() / sizeof(double) / shape[k])
            throw std::invalid_argument("tensor: more cells than memory can address");
        count *= shape[k];
    }
    return count;
}

constexpr std::size_t block = 4096;  // stays in the first-level cache; fixed, since it fixes the order of sums

Eigen::Map<const Eigen::ArrayXd> view(const Tensor& tensor, std::size_t from, std::size_t most = block) {
    return {tensor.values.data() + from, static_cast<Eigen::Index>(std::min(most, tensor.size() - from))};
}

}  // namespace

Tensor::Tensor(std::vector<std::size_t> s) : shape(std::move(s)), values(cell_count(shape), 0.0) {}

std::size_t Tensor::offset(std::initializer_list<std::size_t> index) const {
    std::size_t position = 0, k = 0;
    for (std::size_t i : index) position = position * shape[k++] + i;
    return position;
}

std::string index_text(const std::vector<std::size_t>& shape, std::size_t position) {
    std::string text = "]";
    for (std::size_t k = shape.size(); k-- > 0; position /= shape[k])
        text = (k > 0 ? ", " : "[") + std::to_string(position % shape[k]) + text;
    return text;
}

void require_valid(const Tensor& tensor) {
    const std::size_t cells = cell_count(tensor.shape);
    if (cells != tensor.size())
        throw std::invalid_argument("tensor: the shape has " + std::to_string(cells) + " cells, but there are " +
                                    std::to_string(tensor.size()) + " values");
    for (std::size_t from = 0; from < cells; from += block) {
        // 0 x is 0 for finite x, and NaN otherwise.
        if ((view(tensor, from) * 0).sum() == 0) continue;
        for (std::size_t p = from;; ++p) {
            const double x = tensor.values[p];
            if (!std::isfinite(x))
                throw std::invalid_argument("tensor: cell " + index_text(tensor.shape, p) + " is " +
                                            (std::isnan(x) ? "not a number" : "infinite"));
        }
    }
}

double max_abs(const Tensor& tensor) {
    return tensor.values.empty() ? 0 : view(tensor, 0, tensor.size()).abs().maxCoeff();
}

double norm(const Tensor& tensor) {
    const double largest = max_abs(tensor);
    if (largest == 0) return 0;
    const int exponent = std::ilogb(largest);
    double sum = 0;
    if (std::abs(exponent) <= 400) {
        // Squares are within 2^+-800, and 2^60 of them below 2^1024; values that underflow are below 2^-100 of the
        // largest.
        for (std::size_t from = 0; from < tensor.size(); from += block) sum += view(tensor, from).square().sum();
        return std::sqrt(sum);
    }
    for (double x : tensor.values) {
        const double y = std::ldexp(x, -exponent);
        sum += y * y;
    }
    return std::ldexp(std::sqrt(sum), exponent);
}

Tensor scaled(const Tensor& tensor, int exponent) {
    Tensor result = tensor;
    for (double& x : result.values) x = std::ldexp(x, exponent);
    return result;
}

}  // namespace medulla::tensor
