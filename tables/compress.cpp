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

PackedTable compress_lobes(const Table& table, TableKind kind, int rank, const CompressOptions& options,
                           TableReport& report) {
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
    solve.rank = rank;
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

PackedTable compress_fractions(const Table& table, int rank, const CompressOptions& options, TableReport& report) {
    const tensor::Tensor fraction = back_fractions(table);
    tensor::CpOptions solve;
    solve.rank = std::min(rank, 16);  // three small axes: more rank is only rounding
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

namespace {

constexpr int greatest_rank = static_cast<int>(max_rank);
constexpr int rank_step = static_cast<int>(rank_multiple);
/// Room kept for the provenance text when a pack must fit into a number of bytes.
constexpr std::size_t text_room = 2048;

PackedTable compress_table(const Table& table, TableKind kind, int rank, const CompressOptions& options,
                           TableReport& report) {
    return kind == TableKind::back_fraction ? compress_fractions(table, rank, options, report)
                                            : compress_lobes(table, kind, rank, options, report);
}

std::vector<std::pair<TableKind, const Table*>> kinds_of(const Tables& tables) {
    std::vector<std::pair<TableKind, const Table*>> kinds;
    if (tables.azimuthal) kinds.emplace_back(TableKind::azimuthal, &*tables.azimuthal);
    if (tables.longitudinal)
        for (const TableKind kind :
             {TableKind::longitudinal_back, TableKind::longitudinal_forward, TableKind::back_fraction})
            kinds.emplace_back(kind, &*tables.longitudinal);
    return kinds;
}

/// Bytes of a pack with one rank for all tables: laid out with factors of zeros.
std::size_t pack_bytes(const Tables& tables, int rank, const CompressOptions& options) {
    std::vector<PackedTable> empty;
    for (const auto& [kind, table] : kinds_of(tables)) {
        const int own = kind == TableKind::back_fraction ? std::min(rank, 16) : rank;
        tensor::CpModel model;
        model.weights = Eigen::VectorXd::Zero(own);
        for (const std::size_t n : parameter_shape(*table))
            model.factors.push_back(Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(n), own));
        PackedTable packed{kind, parameter_splines(*table, model), model.weights, 0, 0};
        if (kind != TableKind::back_fraction) {
            const bool periodic = kind == TableKind::azimuthal;
            const Spline exit(
                exit_breakpoints(exit_name(kind), table->bins(), periodic ? options.phi_spans : options.theta_spans),
                periodic);
            packed.axes.push_back({quantity_of(exit_name(kind)), static_cast<std::uint32_t>(table->bins()), exit,
                                   Eigen::MatrixXd::Zero(exit.size(), own)});
        }
        empty.push_back(std::move(packed));
    }
    return write_pack(empty, std::string(text_room, ' ')).size();
}

int rank_within(const Tables& tables, std::size_t bytes, const CompressOptions& options) {
    int rank = greatest_rank;
    while (rank > rank_step && pack_bytes(tables, rank, options) > bytes) rank -= rank_step;
    if (const std::size_t least = pack_bytes(tables, rank, options); least > bytes)
        throw Error("--max-bytes: expected at least {} for these tables, found {}", least, bytes);
    return rank;
}

/// Least rank on the steps of the format whose factors keep the error; bisection, since the error falls with the rank.
PackedTable compress_to(const Table& table, TableKind kind, double error, const CompressOptions& options,
                        TableReport& report) {
    PackedTable best = compress_table(table, kind, greatest_rank, options, report);
    if (report.fit_error > error)
        throw Error("--max-error: rank {} of the {} leaves {:.2e}, expected {:.2e}", greatest_rank, name_of(kind),
                    report.fit_error, error);
    int low = 0, high = greatest_rank / rank_step;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        TableReport tried;
        PackedTable packed = compress_table(table, kind, middle * rank_step, options, tried);
        if (tried.fit_error > error)
            low = middle;
        else
            high = middle, best = std::move(packed), report = tried;
    }
    return best;
}

}  // namespace

CompressResult compress(const Tables& tables, const CompressOptions& options, const std::string& input) {
    const auto start = std::chrono::steady_clock::now();
    CompressResult result;
    std::vector<PackedTable> packed;
    const int rank = options.max_bytes ? rank_within(tables, *options.max_bytes, options) : options.rank;
    for (const auto& [kind, table] : kinds_of(tables)) {
        TableReport report;
        const bool searched = options.max_error && kind != TableKind::back_fraction;
        packed.push_back(searched ? compress_to(*table, kind, *options.max_error, options, report)
                                  : compress_table(*table, kind, options.max_error ? 16 : rank, options, report));
        result.tables.push_back(report);
    }
    result.pack = write_pack(packed, provenance(tables, options, input, result.tables));
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    result.errors = compare(*table_source(tables), *pack_source(result.pack, "the new pack"));
    return result;
}

}  // namespace medulla::tables
