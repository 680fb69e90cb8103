#include "tables/pack/degeneracy.hpp"

#include <algorithm>
#include <cmath>

namespace medulla::tables {
namespace {

/// Values of every component's factor along axis k at x (spline coordinate).
Eigen::RowVectorXd factors_at(const TableView& table, std::uint32_t k, float x) {
    const std::uint32_t rank = table.layout.rank_stride;
    const Cell<float> cell = locate(table.axis(k), x);
    const SplineWeights<float> weights = spline_weights(table.axis(k), cell);
    Eigen::RowVectorXd values = Eigen::RowVectorXd::Zero(rank);
    for (std::uint32_t j = 0; j < 4; ++j)
        for (std::uint32_t r = 0; r < rank; ++r)
            values[r] += static_cast<double>(weights.w[j]) * table.number(k, cell.span + j, r);
    return values;
}

/// Factors at the nodes, which are the breakpoints.
Eigen::MatrixXd parameter_factors(const TableView& table, std::uint32_t k) {
    const std::uint32_t nodes = std::min(table.layout.axes[k].nodes, table.layout.axes[k].spans + 1);
    Eigen::MatrixXd values(nodes, table.layout.rank_stride);
    for (std::uint32_t i = 0; i < nodes; ++i)
        values.row(i) = factors_at(table, k, table.axis(k).breakpoint(static_cast<std::int32_t>(i)));
    return values;
}

/// Factors at four weighted Gauss points of every span, on both halves: inner products are exact integrals of cubics.
Eigen::MatrixXd exit_factors(const TableView& table, std::uint32_t k) {
    const AxisView<float> axis = table.axis(k);
    const double inner = std::sqrt(3.0 / 7 - 2.0 / 7 * std::sqrt(1.2)),
                 outer = std::sqrt(3.0 / 7 + 2.0 / 7 * std::sqrt(1.2)), inner_weight = (18 + std::sqrt(30.0)) / 36,
                 outer_weight = (18 - std::sqrt(30.0)) / 36;
    const std::pair<double, double> rule[] = {
        {-outer, outer_weight}, {-inner, inner_weight}, {inner, inner_weight}, {outer, outer_weight}};
    const Eigen::Index half = 4 * static_cast<Eigen::Index>(axis.spans), even = table.even_stride();
    Eigen::MatrixXd values(2 * half, table.layout.rank_stride);
    for (Eigen::Index i = 0; i < half; ++i) {
        const auto a = static_cast<double>(axis.breakpoint(static_cast<std::int32_t>(i / 4))),
                   b = static_cast<double>(axis.breakpoint(static_cast<std::int32_t>(i / 4 + 1)));
        const auto [x, weight] = rule[i % 4];
        values.row(i) =
            std::sqrt((b - a) / 2 * weight) * factors_at(table, k, static_cast<float>((a + b) / 2 + (b - a) / 2 * x));
        values.row(half + i) = values.row(i);
        values.row(half + i).tail(values.cols() - even) *= -1;
    }
    return values;
}

tensor::Degeneracy of_table(const TableView& table) {
    tensor::CpModel model;
    model.weights.resize(table.layout.rank_stride);
    for (std::uint32_t r = 0; r < table.layout.rank_stride; ++r)
        model.weights[r] =
            static_cast<double>(detail::load<float>(table.bytes + table.layout.scales_offset + 4 * std::size_t(r)));
    for (std::uint32_t k = 0; k < table.layout.axis_count; ++k)
        model.factors.push_back(k < table.parameter_axes() ? parameter_factors(table, k) : exit_factors(table, k));
    tensor::canonicalise(model);
    return tensor::degeneracy(model, tensor::norm(model));
}

}  // namespace

PackDegeneracy degeneracy_of(const PackView& pack) {
    PackDegeneracy result;
    for (const TableView& table : pack.tables)
        if (table) result.emplace_back(static_cast<TableKind>(table.layout.kind), of_table(table));
    return result;
}

}  // namespace medulla::tables
