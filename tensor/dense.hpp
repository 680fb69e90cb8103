// A dense tensor of any order, row-major: the last axis is the fastest.
#pragma once

#include <cstddef>
#include <vector>

namespace medulla::tensor {

struct Tensor {
    std::vector<std::size_t> shape;
    std::vector<double> values;

    std::size_t order() const { return shape.size(); }
    std::size_t size() const { return values.size(); }
};

/// Greatest magnitude of the values; throws std::invalid_argument that names the first value that is not finite, or
/// says that the shape does not fit the values.
double checked_scale(const Tensor& tensor);

}  // namespace medulla::tensor
