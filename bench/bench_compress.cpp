// Ways to compress the same table, in one process and one thread: processor seconds, bytes, error and nanoseconds of
// packs at ranks 4 to 96 and of the packs that bytes choose, of non-negative ones, of Tucker and of a truncated SVD in
// the same number of bytes, and of full-tensor CP-ALS. Usage: bench_compress TABLES.h5... [--full] [--json FILE]
// [--figure FILE] [--from JSON]; --full adds runs of minutes: packs that bytes choose, rank 16 of the disc's bins as
// they are, by our solver and by full-tensor ALS.
#include <fmt/core.h>
#include <omp.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>

#include "error_figure.hpp"
#include "medulla/lookup.hpp"
#include "tables/pack/compress.hpp"
#include "tables/store/tables_file.hpp"
#include "tensor/hosvd.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
constexpr double bytes_per_number = 1.5;  // of the other methods: 12 bits

double cpu_now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }
double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

struct Row {
    std::string method;
    TableKind kind;
    double bytes, error, worst, energy, seconds, nanoseconds;  ///< NaN: not measured
};

struct Bench {
    std::vector<Row> rows;

    void add(const Row& row) {
        const auto cell = [](double x, const char* format) {
            return std::isnan(x) ? std::string("-") : fmt::format(fmt::runtime(format), x);
        };
        fmt::print("{:<26} {:<22} {:>9.0f} {:>10.3e} {:>10} {:>10} {:>9} {:>9}\n", row.method, name_of(row.kind),
                   row.bytes, row.error, cell(row.worst, "{:.2e}"), cell(row.energy, "{:.1e}"),
                   cell(row.seconds, "{:.2f}"), cell(row.nanoseconds, "{:.0f}"));
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

/// Error and bytes of a model, and the seconds of the solve.
struct Found {
    double error = 1, bytes = 0, seconds = 0;
};

/// Smallest error of a Tucker model within `bytes`: the sequentially truncated HOSVD, which is optimal up to a factor
/// of sqrt(order). Seconds of one HOSVD, without the search for its truncation.
Found tucker(const tensor::Tensor& table, double bytes) {
    Found best;
    double low = std::log(1e-4), high = 0;
    for (int i = 0; i < 12; ++i) {
        const double middle = (low + high) / 2, start = cpu_now();
        const tensor::Hosvd hosvd = tensor::truncated_hosvd(table, std::exp(middle));
        double numbers = static_cast<double>(hosvd.core.size());
        for (const auto& basis : hosvd.bases) numbers += static_cast<double>(basis.size());
        if (numbers * bytes_per_number <= bytes)
            high = middle, best = {hosvd.error, numbers * bytes_per_number, cpu_now() - start};
        else
            low = middle;
    }
    return best;
}

/// Truncated SVDs of the matrix [parameters][bins], exact.
std::vector<Found> svd(const tensor::Tensor& table, const std::vector<double>& budgets) {
    const double start = cpu_now();
    const auto bins = static_cast<Eigen::Index>(table.shape.back());
    const auto cells = static_cast<Eigen::Index>(table.size()) / bins;
    const Eigen::Map<const RowMajor> matrix(table.values.data(), cells, bins);
    const Eigen::MatrixXd gram = matrix.transpose() * matrix;
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram, Eigen::EigenvaluesOnly).eigenvalues();
    const double each = bytes_per_number * static_cast<double>(cells + bins), seconds = cpu_now() - start;
    std::vector<Found> list;
    for (const double bytes : budgets) {
        const auto rank = std::min<Eigen::Index>(bins, static_cast<Eigen::Index>(bytes / each));
        if (rank > 0)
            list.push_back({std::sqrt(std::max(0.0, values.head(bins - rank).sum()) / values.sum()),
                            each * static_cast<double>(rank), seconds});
    }
    return list;
}

/// Nanoseconds of a contraction of all parameter axes and one exit direction, with warm caches.
double lookup_nanoseconds(const std::vector<unsigned char>& pack, TableKind kind) {
    const PackView view = open_pack(pack.data(), pack.size()).pack;
    const TableView& table = view[kind];
    constexpr int count = 500, repeats = 200;  // the best of many short runs, few of which other jobs interrupt
    double best = INFINITY;
    volatile float sink = 0;
    for (int repeat = 0; repeat < repeats; ++repeat) {
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

/// Bytes of one kind in a pack: rows, scales and integrals, without shared knots and text.
double kind_bytes(const TableReport& report, const std::vector<unsigned char>& pack) {
    const OpenResult opened = open_pack(pack.data(), pack.size());
    const TableView& table = opened.pack[report.kind];
    double bytes = 8.0 * table.layout.rank_stride;
    for (std::uint32_t k = 0; k < table.layout.axis_count; ++k)
        bytes += (table.layout.axes[k].spans + 3.0) * static_cast<double>(table.layout.row_bytes);
    return bytes;
}

/// Seconds are those of the whole pack.
void add_pack(Bench& bench, const Tables& tables, const std::string& name, const CompressOptions& options) {
    const CompressResult result = compress(tables, options, "bench");
    for (const TableReport& report : result.tables)
        for (const LobeError& error : result.errors)
            if (error.kind == report.kind)
                bench.add({name, report.kind, kind_bytes(report, result.pack), error.relative, error.worst,
                           error.energy, result.cpu_seconds, lookup_nanoseconds(result.pack, report.kind)});
}

nlohmann::ordered_json to_json(const Bench& bench) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const Row& row : bench.rows) {
        nlohmann::ordered_json one = {
            {"method", row.method}, {"lobes", name_of(row.kind)}, {"bytes", row.bytes}, {"relative_l2", row.error}};
        if (!std::isnan(row.worst)) one["worst_lobe"] = row.worst;
        if (!std::isnan(row.energy)) one["energy_error"] = row.energy;
        if (!std::isnan(row.seconds)) one["cpu_seconds"] = row.seconds;
        if (!std::isnan(row.nanoseconds)) one["lookup_ns"] = row.nanoseconds;
        json.push_back(one);
    }
    return json;
}

/// Error against bytes, seconds and nanoseconds: a row of panels each, a column per kind, a curve per family.
plot::Figure figure_of(const nlohmann::ordered_json& rows) {
    struct Family {
        const char *method, *label, *colour;  ///< what the method's name begins with
    };
    const Family families[] = {{"CP, rank", "CP, by rank", plot::blue},
                               {"CP, within", "CP, by size", plot::sky},
                               {"CP, non-negative", "CP, non-negative", plot::green},
                               {"Tucker", "Tucker", plot::orange},
                               {"truncated SVD", "truncated SVD", plot::purple},
                               {"full ALS", "full-tensor ALS", plot::black}};
    const std::pair<const char*, const char*> costs[] = {{"bytes of this kind of lobe", "bytes"},
                                                         {"processor seconds of a solve", "cpu_seconds"},
                                                         {"nanoseconds of a lookup", "lookup_ns"}};
    plot::Figure figure;
    figure.title = "Ways to compress the same table";
    for (const auto& [cost, key] : costs) {
        std::vector<plot::Panel> panels;
        for (const TableKind kind : lobe_kinds) {
            plot::Panel panel;
            panel.title = name_of(kind);
            for (const auto& [method, label, colour] : families) {
                plot::Curve curve;
                curve.label = label, curve.colour = colour, curve.marks = true, curve.width = 2;
                for (const auto& row : rows)
                    if (row.at("lobes") == name_of(kind) && row.value(key, 0.0) > 0 &&
                        row.at("method").get<std::string>().rfind(method, 0) == 0)
                        curve.x.push_back(row.at(key)), curve.y.push_back(row.at("relative_l2"));
                if (!curve.x.empty()) panel.curves.push_back(curve);
                curve.x.clear(), curve.y.clear();
                if (figure.legend.size() < std::size(families)) figure.legend.push_back(curve);
            }
            if (!panel.curves.empty()) panels.push_back(std::move(panel));
        }
        bench::add_panels(figure, 3, cost, 1e-6, std::move(panels));
    }
    return figure;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Ways to compress the same table");
    std::vector<std::string> files;
    std::string json_file, figure_file, numbers_file;
    bool full = false;
    app.add_option("FILE", files)->expected(1, 2);
    app.add_flag("--full", full);
    app.add_option("--json", json_file);
    app.add_option("--figure", figure_file, "draw the numbers into FILE: .svg, .png or .html");
    app.add_option("--from", numbers_file, "measure nothing: draw the numbers that --json wrote into FILE");
    CLI11_PARSE(app, argc, argv);
    if (!numbers_file.empty()) {
        bench::save(figure_of(nlohmann::ordered_json::parse(std::ifstream(numbers_file))), figure_file);
        return 0;
    }
    if (files.empty()) {
        fmt::print(stderr, "bench_compress: expected a tables file\n");
        return 2;
    }
    omp_set_num_threads(1);
    Tables tables = read_tables(files[0]);
    if (files.size() > 1) {
        Tables more = read_tables(files[1]);
        (more.azimuthal ? tables.azimuthal : tables.longitudinal) = more.azimuthal ? more.azimuthal : more.longitudinal;
    }
    fmt::print("{:<26} {:<22} {:>9} {:>10} {:>10} {:>10} {:>9} {:>9}\n", "method", "lobes", "bytes", "rel. L2",
               "worst lobe", "energy", "cpu s", "ns");
    Bench bench;
    // One table at a time, so that seconds belong to its solves.
    std::vector<Tables> single;
    if (tables.azimuthal) single.push_back({tables.azimuthal, {}, tables.program});
    if (tables.longitudinal) single.push_back({{}, tables.longitudinal, tables.program});
    CompressOptions options;
    for (const int rank : {4, 8, 16, 32, 48, 64, 96}) {
        options.rank = rank;
        for (const Tables& one : single) add_pack(bench, one, fmt::format("CP, rank {}", rank), options);
    }
    const std::vector<Row> packs = bench.rows;
    options.solver = tensor::Solver::nonnegative;
    for (const int rank : {8, 16, 32, 64}) {
        options.rank = rank;
        for (const Tables& one : single) add_pack(bench, one, fmt::format("CP, non-negative {}", rank), options);
    }
    options = {};
    for (const std::size_t bytes : {32768, 49152, 65536, 102400, 153600, 204800}) {
        if (!full) break;
        options.max_bytes = bytes;
        add_pack(bench, tables, fmt::format("CP, within {}", bytes), options);
    }
    for (const TableKind kind : lobe_kinds) {
        const auto& table = kind == TableKind::azimuthal ? tables.azimuthal : tables.longitudinal;
        if (!table) continue;
        const tensor::Tensor values = tensor_of(*table, kind);
        for (const Row& pack : packs) {
            if (pack.kind != kind) continue;
            const Found found = tucker(values, pack.bytes);
            bench.add({"Tucker", kind, found.bytes, found.error, NAN, NAN, found.seconds, NAN});
        }
        for (const Found& found : svd(values, {50e3, 100e3, 200e3, 400e3, 800e3}))
            bench.add({"truncated SVD", kind, found.bytes, found.error, NAN, NAN, found.seconds, NAN});
        if (!full || kind != TableKind::azimuthal) continue;
        const auto whole = [&](const std::string& name, auto&& solver, tensor::CpOptions settings) {
            settings.rank = 16;
            const double start = cpu_now();
            const tensor::CpReport report = solver(values, settings).report;
            double numbers = 16;
            for (const std::size_t n : values.shape) numbers += 16.0 * static_cast<double>(n);
            bench.add(
                {name, kind, numbers * bytes_per_number, report.relative_error, NAN, NAN, cpu_now() - start, NAN});
        };
        whole("CP of the bins, rank 16", tensor::cp_lm, {});
        for (std::uint64_t seed = 1; seed <= 3; ++seed) {
            tensor::CpOptions als;
            als.seed = seed, als.tolerance = 0, als.max_sweeps = 500;
            whole(fmt::format("full ALS 16, seed {}", seed), tensor::cp_als, als);
        }
    }
    const nlohmann::ordered_json numbers = to_json(bench);
    if (!json_file.empty()) std::ofstream(json_file) << numbers.dump(1) << '\n';
    if (!figure_file.empty()) bench::save(figure_of(numbers), figure_file);
}
