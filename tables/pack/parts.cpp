#include "tables/pack/parts.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "medulla/phase.hpp"
#include "tables/pack/source.hpp"
#include "tensor/hosvd.hpp"

namespace medulla::tables {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::vector<const Axis*> parameters_of(const Table& table) {
    std::vector<const Axis*> axes;
    for (const Axis& axis : table.axes)
        if (axis.name != "side" && !axis_rule(axis.name).bins) axes.push_back(&axis);
    return axes;
}

void add_parameters(const Table& table, Part& part) {
    for (const Axis* axis : parameters_of(table)) {
        const Quantity quantity = quantity_of(axis->name);
        const bool mirrors = quantity == Quantity::h || quantity == Quantity::theta_i;
        const Spline spline = Spline::through(quantity, axis->values, mirrors ? part.mirror : Mirror::none);
        part.values.shape.push_back(axis->size());
        part.axes.push_back({quantity, static_cast<std::uint32_t>(axis->size()), spline, {}});
        part.maps.push_back(spline.from_nodes());
    }
}

/// Even or odd halves of lobes [cells][bins] at y > 0. Their sum of squares is half the part's; a middle bin, where
/// the number of bins is odd, is its own mirror image and counts as half a bin.
RowMajor halves(const std::vector<double>& lobes, std::size_t bins, Mirror mirror) {
    const auto n = static_cast<Eigen::Index>(bins), cells = static_cast<Eigen::Index>(lobes.size() / bins);
    const Eigen::Map<const RowMajor> all(lobes.data(), cells, n);
    const Eigen::Index half = (n + 1) / 2;
    RowMajor folded(cells, half);
    const double sign = mirror == Mirror::even ? 0.5 : -0.5;
    for (Eigen::Index j = 0; j < half; ++j) {
        const Eigen::Index right = n / 2 + j, left = n - 1 - right;
        folded.col(j) = 0.5 * all.col(right) + sign * all.col(left);
    }
    return folded;
}

Part lobe_part(const Table& table, TableKind kind, Mirror mirror, const std::vector<double>& lobes, double whole,
               std::size_t spans) {
    Part part;
    part.kind = kind, part.mirror = mirror;
    add_parameters(table, part);
    const std::size_t bins = table.bins();
    const Spline exit(exit_breakpoints(kind, bins, spans));
    const double width = exit.view().upper() / (static_cast<double>(bins) / 2);
    std::vector<double> edges = {0};
    for (std::size_t j = 0; j < (bins + 1) / 2; ++j)
        edges.push_back(width * (static_cast<double>(j + 1) - (bins % 2 ? 0.5 : 0.0)));
    const Eigen::MatrixXd free = exit.mirrored(mirror, kind == TableKind::azimuthal);
    Eigen::MatrixXd averages = exit.averages(edges) * free;
    RowMajor folded = halves(lobes, bins, mirror);
    if (bins % 2) {  // the odd part has no average over a bin that is its own mirror image
        const double weight = mirror == Mirror::even ? std::sqrt(0.5) : 0.0;
        averages.row(0) *= weight, folded.col(0) *= weight;
    }
    const Eigen::Index k = free.cols();
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(averages);
    const Eigen::MatrixXd q = qr.householderQ() * Eigen::MatrixXd::Identity(averages.rows(), k);
    part.values.shape.push_back(static_cast<std::size_t>(k));
    part.values.values.resize(static_cast<std::size_t>(folded.rows() * k));
    Eigen::Map<RowMajor> reduced(part.values.values.data(), folded.rows(), k);
    reduced.noalias() = folded * q;
    const double outside = std::max(0.0, folded.squaredNorm() - reduced.squaredNorm());
    part.share = std::sqrt(2.0) * reduced.norm() / whole;
    part.exit_error = std::sqrt(2 * outside) / whole;
    part.axes.push_back({quantity_of(exit_name(kind)), static_cast<std::uint32_t>(bins), exit, {}});
    part.exit_maps = {free *
                      qr.matrixQR().topRows(k).triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(k, k))};
    return part;
}

Part whole_part(const Table& table, TableKind kind, const std::vector<double>& lobes, double whole, std::size_t spans) {
    Part part;
    part.kind = kind, part.mirror = Mirror::none;
    add_parameters(table, part);
    const std::size_t bins = table.bins();
    const std::vector<double> right = exit_breakpoints(kind, bins, spans);
    std::vector<double> breakpoints, edges;
    for (std::size_t i = right.size(); i-- > 1;) breakpoints.push_back(-right[i]);
    breakpoints.insert(breakpoints.end(), right.begin(), right.end());
    for (std::size_t b = 0; b <= bins; ++b)
        edges.push_back(right.back() * (2 * static_cast<double>(b) / static_cast<double>(bins) - 1));
    const Spline half(right), full(breakpoints);
    // Free coefficients: the last three of a periodic axis equal the first three (breakpoints are symmetric, so
    // mirrored ghost knots are the periodic ones).
    const Eigen::Index turn = kind == TableKind::azimuthal ? full.spans() : full.size();
    Eigen::MatrixXd free = Eigen::MatrixXd::Zero(full.size(), turn);
    for (Eigen::Index i = 0; i < full.size(); ++i) free(i, i % turn) = 1;
    const Eigen::VectorXd weight = (free.transpose() * full.integrals()).cwiseSqrt();
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(full.averages(edges) * free);
    const auto cells = static_cast<Eigen::Index>(lobes.size() / bins);
    const RowMajor q = qr.householderQ() * Eigen::MatrixXd::Identity(static_cast<Eigen::Index>(bins), turn);
    const RowMajor inside = Eigen::Map<const RowMajor>(lobes.data(), cells, static_cast<Eigen::Index>(bins)) * q;
    part.exit_error = std::sqrt(std::max(0.0, whole * whole - inside.squaredNorm())) / whole;
    const Eigen::MatrixXd solve =
        qr.matrixQR().topRows(turn).triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(turn, turn));
    part.values.shape.push_back(static_cast<std::size_t>(turn));
    part.values.values.resize(static_cast<std::size_t>(cells * turn));
    Eigen::Map<RowMajor>(part.values.values.data(), cells, turn).noalias() =
        inside * (weight.asDiagonal() * solve).transpose();
    for (std::size_t k = 0; k < part.maps.size(); ++k) {
        part.values = tensor::multiply(part.values, part.maps[k], k);
        part.maps[k] = Eigen::MatrixXd::Identity(part.maps[k].rows(), part.maps[k].rows());
    }
    const Eigen::MatrixXd unweighted = free * weight.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd above = unweighted.bottomRows(half.size()),
                          below = unweighted.topRows(half.size()).colwise().reverse();
    part.exit_maps = {(above + below) / 2, (above - below) / 2};
    part.axes.push_back({quantity_of(exit_name(kind)), static_cast<std::uint32_t>(bins), half, {}});
    return part;
}

/// Share of the slab's energy that leaves backward. At sigma = 0, where the energy is 0, it is extrapolated by the
/// parabola through the next three nodes, for smoothness.
Part energy_part(const Table& table) {
    Part part;
    part.kind = TableKind::back_fraction, part.mirror = Mirror::none;
    add_parameters(table, part);
    std::vector<double>& values = part.values.values;
    const std::vector<double>& sigma = table.axes[0].values;
    const std::size_t row = table.cells() / 2 / sigma.size();
    values.resize(row * sigma.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double back = table.energy[2 * i], total = back + table.energy[2 * i + 1];
        values[i] = total > 0 ? back / total : 0.5;
    }
    if (sigma[0] == 0 && sigma.size() >= 4)
        for (std::size_t j = 0; j < row; ++j)
            values[j] = extrapolate({sigma[1], sigma[2], sigma[3]},
                                    {values[row + j], values[2 * row + j], values[3 * row + j]}, 0);
    return part;
}

/// Survival of the disc's energy under absorption a, as lengths: exp(-a length) is 1 at a = 0 and smaller elsewhere.
Part survival_part(const Table& table) {
    Part part;
    part.kind = TableKind::survival, part.mirror = Mirror::even;
    add_parameters(table, part);
    part.values.values = survival_lengths(table);
    return part;
}

void add_energies(const Tables& tables, std::vector<Part>& parts) {
    if (tables.longitudinal) parts.push_back(energy_part(*tables.longitudinal));
    if (tables.azimuthal && tables.azimuthal->has_axis("absorption")) parts.push_back(survival_part(*tables.azimuthal));
}

}  // namespace

double Part::component_bytes(double bits) const {
    double rows = 0;
    for (const PackedAxis& axis : axes) rows += static_cast<double>(axis.spline.size());
    return (4 + 4 + rows * bits / 8) * copies();
}

std::vector<double> exit_breakpoints(TableKind kind, std::size_t bins, std::size_t spans) {
    const bool azimuth = kind == TableKind::azimuthal;
    const double high = azimuth ? pi : pi / 2, width = 2 * high / static_cast<double>(bins);
    const auto density = [&](double x) {
        return azimuth ? 0.4 / (2 * pi) + 0.4 * planar_hg_pdf(x, 0.85) + 0.2 * planar_hg_pdf(pi - x, 0.8) : 1 / pi;
    };
    // Two or more bins per span keep the fit well conditioned. Breakpoints are quantiles of the density, rounded to
    // distinct bin edges.
    const std::size_t half = bins / 2, n = std::clamp<std::size_t>(spans / 2, 3, std::max<std::size_t>(3, half / 2));
    const double start = bins % 2 ? 0.5 : 0.0;  // the first edge beyond 0, in bins
    std::vector<double> cumulative(half + 1, 0.0);
    for (std::size_t b = 0; b < half; ++b)
        cumulative[b + 1] = cumulative[b] + density((static_cast<double>(b) + start + 0.5) * width);
    std::vector<double> points = {0};
    std::size_t last = 0;
    for (std::size_t i = 1; i < n; ++i) {
        const double target = cumulative[half] * static_cast<double>(i) / static_cast<double>(n);
        std::size_t edge = last + 1;
        while (edge < half && cumulative[edge] < target) ++edge;
        edge = std::min(edge, half - (n - i));
        if (edge <= last) continue;
        points.push_back((static_cast<double>(edge) + start) * width);
        last = edge;
    }
    points.push_back(high);
    return points;
}

namespace {

/// Lobes of one kind and their norm.
struct KindLobes {
    const Table& table;
    std::vector<double> lobes;
    double whole;
};
KindLobes lobes_of(const Tables& tables, TableKind kind) {
    const Table& table = tables.at(table_of(kind));
    std::vector<double> lobes = side_lobes(table, side_of(kind));
    const double norm = Eigen::Map<const Eigen::VectorXd>(lobes.data(), static_cast<Eigen::Index>(lobes.size())).norm();
    return {table, std::move(lobes), norm};
}

}  // namespace

std::vector<Part> lobe_parts_of(const Tables& tables, TableKind kind, std::size_t spans) {
    const KindLobes all = lobes_of(tables, kind);
    std::vector<Part> parts;
    for (const Mirror mirror : {Mirror::even, Mirror::odd}) {
        Part part = lobe_part(all.table, kind, mirror, all.lobes, all.whole, spans);
        if (mirror == Mirror::even || part.share > 1e-6) parts.push_back(std::move(part));
    }
    return parts;
}

std::vector<Part> parts_of(const Tables& tables, const ExitSpans& spans) {
    std::vector<Part> parts;
    for (const TableKind kind : lobe_kinds) {
        if (!tables[table_of(kind)]) continue;
        for (Part& part : lobe_parts_of(tables, kind, spans[kind])) parts.push_back(std::move(part));
    }
    add_energies(tables, parts);
    return parts;
}

std::vector<Part> whole_lobes_of(const Tables& tables, const ExitSpans& spans) {
    std::vector<Part> parts;
    for (const TableKind kind : lobe_kinds) {
        if (!tables[table_of(kind)]) continue;
        const KindLobes all = lobes_of(tables, kind);
        parts.push_back(whole_part(all.table, kind, all.lobes, all.whole, spans[kind]));
    }
    add_energies(tables, parts);
    return parts;
}

namespace {

/// Expected squared length of a factor's error for independent errors of unit variance in its spline coefficients.
double gain_of(const Eigen::MatrixXd& map) {
    return map.completeOrthogonalDecomposition().pseudoInverse().squaredNorm();
}

}  // namespace

PackedTable join(const std::vector<const Part*>& parts, const std::vector<const tensor::CpModel*>& models,
                 std::pair<float, float> range) {
    PackedTable table{parts[0]->kind, parts[0]->axes, {}, models[0]->rank(), range.first, range.second};
    int rank = 0;
    for (std::size_t p = 0; p < parts.size(); ++p) rank += models[p]->rank() * parts[p]->copies();
    table.weights.resize(rank), table.rounding.resize(rank);
    table.paired = parts[0]->copies() == 2;
    for (PackedAxis& axis : table.axes) axis.coefficients.resize(axis.spline.size(), rank);
    int column = 0;
    for (std::size_t p = 0; p < parts.size(); ++p)
        for (int copy = 0; copy < parts[p]->copies(); ++copy) {
            const Part& part = *parts[p];
            const tensor::CpModel& model = *models[p];
            const double unit = part.share / tensor::norm(part.values);
            std::vector<Eigen::MatrixXd> coefficients;
            Eigen::VectorXd rounding = Eigen::VectorXd::Zero(model.rank());
            for (std::size_t k = 0; k < table.axes.size(); ++k) {
                const Eigen::MatrixXd& map =
                    k < part.maps.size() ? part.maps[k] : part.exit_maps[static_cast<std::size_t>(copy)];
                coefficients.push_back(map * model.factors[k]);
                // Rounding errors are uniform in +-1/2 unit: variance 1 / 12.
                rounding.array() += gain_of(map) / 12 *
                                    coefficients[k].colwise().lpNorm<Eigen::Infinity>().transpose().array().square();
            }
            rounding.array() *= (unit * model.weights).array().square();
            std::vector<int> order(static_cast<std::size_t>(model.rank()));
            std::iota(order.begin(), order.end(), 0);
            if (!table.paired)
                std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return rounding[a] > rounding[b]; });
            for (const int r : order) {
                for (std::size_t k = 0; k < table.axes.size(); ++k)
                    table.axes[k].coefficients.col(column) = coefficients[k].col(r);
                table.weights[column] = model.weights[r], table.rounding[column++] = rounding[r];
            }
        }
    return table;
}

}  // namespace medulla::tables
