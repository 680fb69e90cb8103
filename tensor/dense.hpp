// A dense tensor of any order: a shape and its values, last axis fastest.
// Uses the standard library only; everything else in this folder takes and returns it.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <string>
#include <vector>

namespace medulla::tensor {

/// Dense array of doubles, row-major: values[((i0 * n1 + i1) * n2 + i2) ...]. Order 1 and above, no axis of length 0.
struct Tensor {
    std::vector<std::size_t> shape;  ///< length of each axis, slowest first
    std::vector<double> values;      ///< product(shape) values

    Tensor() = default;
    /// All zeros. Throws std::invalid_argument where an axis is empty or the product overflows.
    explicit Tensor(std::vector<std::size_t> shape);

    std::size_t order() const { return shape.size(); }
    std::size_t size() const { return values.size(); }
    /// Position of one cell in `values`; unchecked.
    std::size_t offset(std::initializer_list<std::size_t> index) const;
    double& operator()(std::initializer_list<std::size_t> index) { return values[offset(index)]; }
    double operator()(std::initializer_list<std::size_t> index) const { return values[offset(index)]; }
};

/// "[3, 0, 2]": the index of values[position].
std::string index_text(const std::vector<std::size_t>& shape, std::size_t position);

/// Throws std::invalid_argument where the shape is empty, disagrees with values.size(), or a value is not finite;
/// the message names the first such cell by its index.
void require_valid(const Tensor& tensor);

/// Largest |x|; 0 for the zero tensor. Expects finite values.
double max_abs(const Tensor& tensor);

/// Square root of the sum of squares; scaled by max |x|, so that it overflows only where the norm itself does.
double norm(const Tensor& tensor);

/// Every value times 2^exponent: exact unless a value leaves the range of doubles.
Tensor scaled(const Tensor& tensor, int exponent);

}  // namespace medulla::tensor
