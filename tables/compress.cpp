#include "tables/compress.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include "medulla/phase.hpp"
#include "tables/error.hpp"
#include "tables/pack_writer.hpp"

namespace medulla::tables {
namespace {

/// Relative L2 standard error of all lobes of one side together.
double table_noise(const Table& table, std::size_t side) {
    const std::size_t sides = table.name == "longitudinal" ? 2 : 1;
    double noise = 0, total = 0;
    for (std::size_t cell = side; cell < table.cells(); cell += sides) {
        double norm = 0;
        for (std::size_t b = 0; b < table.bins(); ++b)
            norm += static_cast<double>(table.lobe_of(cell)[b]) * static_cast<double>(table.lobe_of(cell)[b]);
        noise += norm * table.standard_error[cell] * table.standard_error[cell];
        total += norm;
    }
    return std::sqrt(noise / total);
}

std::vector<PackedAxis> parameter_splines(const Table& table, const tensor::CpModel& model) {
    std::vector<PackedAxis> axes;
    for (const Axis& axis : table.axes) {
        if (axis.name == "side" || axis_rule(axis.name).bins) continue;
        const Quantity quantity = quantity_of(axis.name);
        const Spline spline = Spline::through(quantity, axis.values);
        const Eigen::MatrixXd& factor = model.factors[axes.size()];
        axes.push_back({quantity, static_cast<std::uint32_t>(axis.size()), spline, spline.from_nodes() * factor});
    }
    return axes;
}

std::vector<std::size_t> parameter_shape(const Table& table) {
    std::vector<std::size_t> shape;
    for (const Axis& axis : table.axes)
        if (axis.name != "side" && !axis_rule(axis.name).bins) shape.push_back(axis.size());
    return shape;
}

PackedTable compress_lobes(const Table& table, TableKind kind, const CompressOptions& options, TableReport& report) {
    const std::size_t side = kind == TableKind::longitudinal_forward ? 1 : 0, bins = table.bins();
    const std::vector<double> lobes = side_lobes(table, side);
    const bool periodic = kind == TableKind::azimuthal;
    const Spline exit(exit_breakpoints(exit_name(kind), bins, periodic ? options.phi_spans : options.theta_spans),
                      periodic);

    // Orthonormal coordinates of the exit spline in the space of bin averages.
    const Eigen::MatrixXd averages = exit.bin_averages(bins);
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(averages);
    const Eigen::Index k = exit.size(), cells = static_cast<Eigen::Index>(lobes.size() / bins);
    const Eigen::MatrixXd q = qr.householderQ() * Eigen::MatrixXd::Identity(averages.rows(), k);
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const Eigen::Map<const RowMajor> values(lobes.data(), cells, static_cast<Eigen::Index>(bins));
    tensor::Tensor reduced;
    reduced.shape = parameter_shape(table);
    reduced.shape.push_back(static_cast<std::size_t>(k));
    reduced.values.resize(static_cast<std::size_t>(cells * k));
    Eigen::Map<RowMajor>(reduced.values.data(), cells, k) = values * q;

    tensor::CpOptions solve;
    solve.rank = options.rank;
    solve.seed = options.seed;
    const tensor::CpResult result = tensor::cp(reduced, options.solver, solve);
    const double whole = values.norm(), inside = Eigen::Map<const RowMajor>(reduced.values.data(), cells, k).norm();
    report.kind = kind;
    report.rank = static_cast<int>(result.model.weights.size());
    report.exit_error = std::sqrt(std::max(0.0, (whole - inside) * (whole + inside))) / whole;
    report.fit_error = std::hypot(report.exit_error, result.report.relative_error * inside / whole);
    report.noise = table_noise(table, side);
    report.solve = result.report;

    PackedTable packed;
    packed.kind = kind;
    packed.axes = parameter_splines(table, result.model);
    const Eigen::MatrixXd coefficients =
        qr.matrixQR().topRows(k).triangularView<Eigen::Upper>().solve(result.model.factors.back());
    packed.axes.push_back({quantity_of(exit_name(kind)), static_cast<std::uint32_t>(bins), exit, coefficients});
    packed.weights = result.model.weights;
    const auto [low, high] = std::minmax_element(lobes.begin(), lobes.end());
    packed.low = static_cast<float>(*low), packed.high = static_cast<float>(*high);
    return packed;
}

/// Share of the slab's energy that leaves backward. At sigma = 0 nothing leaves: its share there is the limit, taken
/// from the parabola through the next three nodes (it multiplies an energy of 0, so only its smoothness matters).
tensor::Tensor back_fractions(const Table& table) {
    tensor::Tensor fraction;
    fraction.shape = parameter_shape(table);
    const std::vector<double>& sigma = table.axes[0].values;
    const std::size_t row = table.cells() / 2 / sigma.size();
    fraction.values.resize(row * sigma.size());
    for (std::size_t i = 0; i < fraction.values.size(); ++i) {
        const double back = table.energy[2 * i], total = back + table.energy[2 * i + 1];
        fraction.values[i] = total > 0 ? back / total : 0.5;
    }
    if (sigma[0] == 0 && sigma.size() >= 4)
        for (std::size_t j = 0; j < row; ++j) {
            double value = 0;
            for (std::size_t a = 1; a <= 3; ++a) {
                double lagrange = 1;
                for (std::size_t b = 1; b <= 3; ++b)
                    if (b != a) lagrange *= -sigma[b] / (sigma[a] - sigma[b]);
                value += lagrange * fraction.values[a * row + j];
            }
            fraction.values[j] = value;
        }
    return fraction;
}

PackedTable compress_fractions(const Table& table, const CompressOptions& options, TableReport& report) {
    const tensor::Tensor fraction = back_fractions(table);
    tensor::CpOptions solve;
    solve.rank = std::min(options.rank, 16);
    solve.seed = options.seed;
    const tensor::CpResult result = tensor::cp(fraction, options.solver, solve);
    report.kind = TableKind::back_fraction;
    report.rank = static_cast<int>(result.model.weights.size());
    report.fit_error = result.report.relative_error;
    report.solve = result.report;
    PackedTable packed;
    packed.kind = TableKind::back_fraction;
    packed.axes = parameter_splines(table, result.model);
    packed.weights = result.model.weights;
    const auto [low, high] = std::minmax_element(fraction.values.begin(), fraction.values.end());
    packed.low = static_cast<float>(*low), packed.high = static_cast<float>(*high);
    return packed;
}

std::string provenance(const Tables& tables, const CompressOptions& options, const std::string& input,
                       const std::vector<TableReport>& reports) {
    nlohmann::ordered_json json;
    json["program"] = tables.program;
    json["input"] = input;
    json["seed"] = options.seed;
    for (const Table* table : tables.present())
        json["tables"][table->name] = {{"method", table->method}, {"seed", table->seed}, {"paths", table->paths}};
    for (const TableReport& report : reports)
        json["fit"][name_of(report.kind)] = {{"rank", report.rank},
                                             {"solver", report.solve.solver},
                                             {"relative_l2", report.fit_error},
                                             {"input_noise", report.noise}};
    return json.dump();
}

}  // namespace

std::vector<double> exit_breakpoints(const std::string& exit, std::size_t bins, std::size_t spans) {
    const double low = axis_rule(exit).low, high = axis_rule(exit).high;
    // At least two bins to a span keeps the fit well conditioned.
    const std::size_t n = std::clamp<std::size_t>(spans, 3, std::max<std::size_t>(3, bins / 2));
    const auto density = [&](double x) {
        if (exit == "phi") return 0.4 / (2 * pi) + 0.4 * planar_hg_pdf(x, 0.85) + 0.2 * planar_hg_pdf(pi - x, 0.8);
        return 1 / pi;
    };
    // Cumulative density over bins, then breakpoints at its quantiles, snapped to distinct bin edges.
    std::vector<double> cumulative(bins + 1, 0.0);
    const double width = (high - low) / static_cast<double>(bins);
    for (std::size_t b = 0; b < bins; ++b)
        cumulative[b + 1] = cumulative[b] + density(low + (static_cast<double>(b) + 0.5) * width);
    std::vector<double> points = {low};
    std::size_t last = 0;
    for (std::size_t i = 1; i < n; ++i) {
        const double target = cumulative[bins] * static_cast<double>(i) / static_cast<double>(n);
        std::size_t edge = last + 1;
        while (edge < bins && cumulative[edge] < target) ++edge;
        edge = std::min(edge, bins - (n - i));
        if (edge <= last) continue;
        points.push_back(low + static_cast<double>(edge) * width);
        last = edge;
    }
    points.push_back(high);
    return points;
}

CompressResult compress(const Tables& tables, const CompressOptions& options, const std::string& input) {
    const auto start = std::chrono::steady_clock::now();
    CompressResult result;
    std::vector<PackedTable> packed;
    const auto add = [&](TableKind kind, const Table& table) {
        TableReport report;
        packed.push_back(kind == TableKind::back_fraction ? compress_fractions(table, options, report)
                                                          : compress_lobes(table, kind, options, report));
        result.tables.push_back(report);
    };
    if (tables.azimuthal) add(TableKind::azimuthal, *tables.azimuthal);
    if (tables.longitudinal)
        for (const TableKind kind :
             {TableKind::longitudinal_back, TableKind::longitudinal_forward, TableKind::back_fraction})
            add(kind, *tables.longitudinal);
    result.pack = write_pack(packed, provenance(tables, options, input, result.tables));
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    result.errors = compare(*table_source(tables), *pack_source(result.pack, "the new pack"));
    return result;
}

}  // namespace medulla::tables
