// Ways to compress the same table, in one process: seconds, bytes and error of full-tensor CP-ALS, of packs at ranks 4
// to 96 and of the packs that bytes choose, of Tucker and of a truncated SVD in the same number of bytes. Usage:
// bench_compress TABLES.h5 [--full] [--json FILE] [--svg FILE]; --full adds full-tensor ALS, minutes each.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "medulla/lookup.hpp"
#include "tables/compress.hpp"
#include "tables/plot.hpp"
#include "tables/tables_file.hpp"
#include "tensor/hosvd.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
constexpr double bytes_per_number = 2;  // 16-bit numbers for every method

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

struct Row {
    std::string method;
    TableKind kind;
    double bytes, error, worst, seconds, nanoseconds;  ///< NaN: not measured
};

struct Bench {
    std::vector<Row> rows;

    void add(const Row& row) {
        const auto cell = [](double x, const char* format) {
            return std::isnan(x) ? std::string("-") : fmt::format(fmt::runtime(format), x);
        };
        fmt::print("{:<26} {:<22} {:>9.0f} {:>10.3e} {:>10} {:>9} {:>9}\n", row.method, name_of(row.kind), row.bytes,
                   row.error, cell(row.worst, "{:.2e}"), cell(row.seconds, "{:.2f}"), cell(row.nanoseconds, "{:.0f}"));
        std::fflush(stdout);
        rows.push_back(row);
    }
};

/// One table as a tensor [parameters ..][bins].
tensor::Tensor tensor_of(const Table& table, TableKind kind) {
    tensor::Tensor tensor;
    for (const Axis& axis : table.axes)
        if (axis.name != "side") tensor.shape.push_back(axis.size());
    tensor.values = side_lobes(table, kind == TableKind::longitudinal_forward ? 1 : 0);
    return tensor;
}

/// Least error of a Tucker model of 16-bit numbers within `bytes`: the sequentially truncated HOSVD, whose bases are
/// the best of their sizes but for a factor sqrt(order). Returns {error, bytes}.
std::pair<double, double> tucker(const tensor::Tensor& table, double bytes) {
    std::pair<double, double> best = {1, 0};
    double low = std::log(1e-4), high = 0;
    for (int i = 0; i < 12; ++i) {
        const double middle = (low + high) / 2;
        const tensor::Hosvd hosvd = tensor::truncated_hosvd(table, std::exp(middle));
        double numbers = static_cast<double>(hosvd.core.size());
        for (const auto& basis : hosvd.bases) numbers += static_cast<double>(basis.size());
        if (numbers * bytes_per_number <= bytes)
            high = middle, best = {hosvd.error, numbers * bytes_per_number};
        else
            low = middle;
    }
    return best;
}

/// The same for a truncated SVD of the matrix [parameters][bins], exact.
std::pair<double, double> svd(const tensor::Tensor& table, double bytes) {
    const auto bins = static_cast<Eigen::Index>(table.shape.back());
    const auto cells = static_cast<Eigen::Index>(table.size()) / bins;
    const Eigen::Map<const RowMajor> matrix(table.values.data(), cells, bins);
    const Eigen::MatrixXd gram = matrix.transpose() * matrix;
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram, Eigen::EigenvaluesOnly).eigenvalues();
    const double each = bytes_per_number * static_cast<double>(cells + bins);
    const auto rank = std::min<Eigen::Index>(bins, static_cast<Eigen::Index>(bytes / each));
    return {std::sqrt(std::max(0.0, values.head(bins - rank).sum()) / values.sum()), each * static_cast<double>(rank)};
}

/// A contraction of all parameter axes and one exit direction, cold in everything but the caches.
double lookup_nanoseconds(const std::vector<unsigned char>& pack, TableKind kind) {
    const PackView view = open_pack(pack.data(), pack.size()).pack;
    const TableView& table = view[kind];
    constexpr int count = 20000;
    double best = INFINITY;
    volatile float sink = 0;
    for (int repeat = 0; repeat < 5; ++repeat) {
        const double start = now();
        for (int i = 0; i < count; ++i) {
            const float u = static_cast<float>(i) / count;
            LobeQuery query;
            query.sigma = 10 * u, query.g = 0.9f * (1 - u), query.h = u, query.theta_i = 1.5f * u;
            sink = lobe(table, contract(table, query), 3 * u - 1.5f);
        }
        best = std::min(best, (now() - start) / count * 1e9);
    }
    (void)sink;
    return best;
}

/// Bytes of one kind in a pack: its rows, scales and integrals; knots and text belong to none.
double kind_bytes(const TableReport& report, const std::vector<unsigned char>& pack) {
    const OpenResult opened = open_pack(pack.data(), pack.size());
    const TableView& table = opened.pack[report.kind];
    double bytes = 8.0 * table.layout.rank_stride;
    for (std::uint32_t k = 0; k < table.layout.axis_count; ++k)
        bytes += (table.layout.axes[k].spans + 3.0) * static_cast<double>(row_bytes(table.layout.rank_stride));
    return bytes;
}

void add_pack(Bench& bench, const Tables& tables, const std::string& name, const CompressOptions& options) {
    const CompressResult result = compress(tables, options, "bench");
    for (const TableReport& report : result.tables)
        for (const LobeError& error : result.errors) {
            if (error.kind != report.kind) continue;
            double seconds = 0;
            for (const PartReport& part : report.parts) seconds += part.solve.seconds;
            bench.add({name, report.kind, kind_bytes(report, result.pack), error.relative, error.worst, seconds,
                       lookup_nanoseconds(result.pack, report.kind)});
        }
}

void write_json(const std::string& file, const Bench& bench) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const Row& row : bench.rows) {
        nlohmann::ordered_json one = {
            {"method", row.method}, {"lobes", name_of(row.kind)}, {"bytes", row.bytes}, {"relative_l2", row.error}};
        if (!std::isnan(row.worst)) one["worst_lobe"] = row.worst;
        if (!std::isnan(row.seconds)) one["seconds"] = row.seconds;
        if (!std::isnan(row.nanoseconds)) one["lookup_ns"] = row.nanoseconds;
        json.push_back(one);
    }
    std::ofstream(file) << json.dump(1) << '\n';
}

/// Error against bytes, one panel per kind, one curve per family of methods.
void write_svg(const std::string& file, const Bench& bench) {
    const std::pair<const char*, const char*> families[] = {{"CP, even and odd parts", "#0072b2"},
                                                            {"CP, non-negative", "#009e73"},
                                                            {"Tucker", "#d55e00"},
                                                            {"truncated SVD", "#cc79a7"},
                                                            {"full ALS", "#000000"}};
    std::vector<Panel> panels;
    for (const TableKind kind : lobe_kinds) {
        Panel panel;
        panel.title = name_of(kind);
        panel.x_label = "bytes";
        panel.y_label = "relative L2 error";
        panel.log_x = true;
        for (const auto& [family, colour] : families) {
            Curve curve;
            curve.label = family, curve.colour = colour, curve.marks = true;
            for (const Row& row : bench.rows)
                if (row.kind == kind && row.method.rfind(family, 0) == 0)
                    curve.x.push_back(row.bytes), curve.y.push_back(row.error);
            if (!curve.x.empty()) panel.curves.push_back(curve);
        }
        if (!panel.curves.empty()) panels.push_back(panel);
    }
    std::ofstream(file) << svg("Error against bytes", panels, 3);
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Ways to compress the same table");
    std::vector<std::string> files;
    std::string json_file, svg_file;
    bool full = false;
    app.add_option("FILE", files)->required()->expected(1, 2);
    app.add_flag("--full", full);
    app.add_option("--json", json_file);
    app.add_option("--svg", svg_file);
    CLI11_PARSE(app, argc, argv);
    Tables tables = read_tables(files[0]);
    if (files.size() > 1) {
        Tables more = read_tables(files[1]);
        (more.azimuthal ? tables.azimuthal : tables.longitudinal) = more.azimuthal ? more.azimuthal : more.longitudinal;
    }
    fmt::print("{:<26} {:<22} {:>9} {:>10} {:>10} {:>9} {:>9}\n", "method", "lobes", "bytes", "rel. L2", "worst lobe",
               "seconds", "ns");
    Bench bench;
    CompressOptions options;
    for (const int rank : {4, 8, 16, 32, 48, 64, 96}) {
        options.rank = rank;
        add_pack(bench, tables, fmt::format("CP, even and odd parts {}", rank), options);
    }
    options.solver = tensor::Solver::nonnegative;
    for (const int rank : {8, 16, 32, 64}) {
        options.rank = rank;
        add_pack(bench, tables, fmt::format("CP, non-negative {}", rank), options);
    }
    const std::vector<Row> packs = bench.rows;
    for (const TableKind kind : lobe_kinds) {
        const auto& table = kind == TableKind::azimuthal ? tables.azimuthal : tables.longitudinal;
        if (!table) continue;
        const tensor::Tensor values = tensor_of(*table, kind);
        for (const Row& pack : packs) {
            if (pack.kind != kind || pack.method.rfind("CP, even", 0) != 0) continue;
            const double start = now();
            const auto [error, bytes] = tucker(values, pack.bytes);
            bench.add({"Tucker", kind, bytes, error, NAN, now() - start, NAN});
        }
        for (const double budget : {20e3, 50e3, 100e3, 200e3, 400e3, 800e3}) {
            const auto [error, bytes] = svd(values, budget);
            if (bytes > 0) bench.add({"truncated SVD", kind, bytes, error, NAN, NAN, NAN});
        }
        if (!full) continue;
        for (std::uint64_t seed = 1; seed <= 3; ++seed) {
            tensor::CpOptions als;
            als.rank = 16, als.seed = seed, als.tolerance = 0, als.max_sweeps = 500;
            const tensor::CpReport report = tensor::cp_als(values, als).report;
            double numbers = 16;
            for (const std::size_t n : values.shape) numbers += 16.0 * static_cast<double>(n);
            bench.add({fmt::format("full ALS 16, seed {}", seed), kind, numbers * bytes_per_number,
                       report.relative_error, NAN, report.seconds, NAN});
        }
    }
    if (!json_file.empty()) write_json(json_file, bench);
    if (!svg_file.empty()) write_svg(svg_file, bench);
}
