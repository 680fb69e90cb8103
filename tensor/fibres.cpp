// CP without a solve: as many components as any tensor of the shape can need. Uses hosvd.hpp.
#include <algorithm>

#include "tensor/als.hpp"
#include "tensor/hosvd.hpp"

namespace medulla::tensor {

namespace {

/// The tensor as its own core.
Hosvd whole(const Tensor& tensor) {
    Hosvd result;
    result.core = tensor;
    for (const std::size_t n : tensor.shape)
        result.bases.push_back(Eigen::MatrixXd::Identity(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n)));
    return result;
}

/// Component r is the core's fibre r along `longest` times a unit vector of every other mode.
Factors fibres(const Tensor& core, std::size_t longest) {
    const auto length = static_cast<Eigen::Index>(core.shape[longest]),
               rank = static_cast<Eigen::Index>(core.size()) / length;
    Factors factors;
    for (const std::size_t n : core.shape) factors.push_back(RowMatrix::Zero(static_cast<Eigen::Index>(n), rank));
    std::vector<std::size_t> index(core.order(), 0);
    for (Eigen::Index r = 0; r < rank; ++r) {
        std::size_t start = 0, stride = 1;
        for (std::size_t k = core.order(); k-- > 0; stride *= core.shape[k]) start += index[k] * stride;
        std::size_t step = 1;
        for (std::size_t k = longest + 1; k < core.order(); ++k) step *= core.shape[k];
        for (Eigen::Index i = 0; i < length; ++i)
            factors[longest](i, r) = core.values[start + static_cast<std::size_t>(i) * step];
        for (std::size_t k = 0; k < core.order(); ++k)
            if (k != longest) factors[k](static_cast<Eigen::Index>(index[k]), r) = 1;
        for (std::size_t k = core.order(); k-- > 0;) {  // the next index, without `longest`
            if (k == longest) continue;
            if (++index[k] < core.shape[k]) break;
            index[k] = 0;
        }
    }
    return factors;
}

}  // namespace

CpResult cp_fibres(const Tensor& tensor, bool nonnegative) {
    CpOptions options;
    options.rank = 1;  // for the zero tensor
    return solved(tensor, options, "fibres", [&](const Normalised& input, CpResult& result) {
        const Hosvd hosvd = nonnegative ? whole(input.tensor()) : truncated_hosvd(input.tensor(), finest_truncation);
        const std::vector<std::size_t>& shape = hosvd.core.shape;
        const auto longest = static_cast<std::size_t>(std::max_element(shape.begin(), shape.end()) - shape.begin());
        Fit fit;
        fit.factors = fibres(hosvd.core, longest);
        if (nonnegative) fit.factors[longest] = fit.factors[longest].cwiseMax(0);
        fit.weights = Eigen::VectorXd::Constant(fit.factors[0].cols(), 1 / input.norm());
        for (std::size_t k = 0; k < fit.factors.size(); ++k) fit.factors[k] = (hosvd.bases[k] * fit.factors[k]).eval();
        fit.stop = Stop::exact;
        store(fit, input, shape, result);
        result.report.truncation_error = hosvd.error;
        result.report.relative_error = relative_error(tensor, result.model);
    });
}

}  // namespace medulla::tensor
