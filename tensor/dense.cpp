#include "tensor/dense.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace medulla::tensor {

double checked_scale(const Tensor& tensor) {
    std::size_t expected = 1;
    for (const std::size_t n : tensor.shape) expected *= n;
    if (tensor.shape.empty() || expected == 0 || expected != tensor.size())
        throw std::invalid_argument("tensor: its shape asks for " + std::to_string(expected) + " values, it has " +
                                    std::to_string(tensor.size()));
    double greatest = 0;
    for (std::size_t i = 0; i < tensor.size(); ++i) {
        if (!std::isfinite(tensor.values[i])) {
            std::string index;
            std::size_t rest = i;
            for (std::size_t k = tensor.order(); k-- > 0; rest /= tensor.shape[k])
                index = std::to_string(rest % tensor.shape[k]) + (index.empty() ? "" : ", ") + index;
            throw std::invalid_argument("tensor: value [" + index + "] is not finite");
        }
        greatest = std::fmax(greatest, std::abs(tensor.values[i]));
    }
    return greatest;
}

}  // namespace medulla::tensor
