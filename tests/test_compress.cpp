// Compression end to end: packs have the errors they report, requested sizes and errors are met, lobes are symmetric.
#include <catch2/catch.hpp>
#include <cmath>

#include "medulla/default_pack.hpp"
#include "medulla/lookup.hpp"
#include "tables/error.hpp"
#include "tables/job/simulate.hpp"
#include "tables/pack/compress.hpp"
#include "tables/table/axis.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

/// Both tables with few nodes on the axes of sigma, h and theta_i.
Tables noise_free(std::size_t nodes, const Range& g, std::size_t bins) {
    Request request = default_request();
    request.method = Method::deterministic;
    request.sigma = graded_axis("sigma", {0, 4, nodes});
    request.g = graded_axis("g", g);
    request.h = graded_axis("h", {0, 1, nodes});
    request.theta_i = graded_axis("theta_i", {0, pi / 2, nodes});
    request.bins = bins;
    return simulate(request, ProgressMode::none);
}

const Tables& small_tables() {
    static const Tables tables = noise_free(6, {0, 0.7, 4}, 180);
    return tables;
}

struct Opened {
    std::vector<unsigned char> bytes;
    PackView view;
    explicit Opened(std::vector<unsigned char> pack) : bytes(std::move(pack)) {
        const OpenResult opened = open_pack(bytes.data(), bytes.size());
        REQUIRE(opened.status == PackStatus::ok);
        view = opened.pack;
    }
};

}  // namespace

TEST_CASE("A pack reproduces its table within the error it reports", "[compress]") {
    CompressOptions options;
    options.rank = 8;
    const CompressResult result = compress(small_tables(), options, "test");
    const std::vector<LobeError> errors = compare(*table_source(small_tables()), *pack_source(result.pack, "test"));
    REQUIRE(errors.size() == 3);
    REQUIRE(result.tables.size() == 4);
    for (std::size_t i = 0; i < 3; ++i) {
        CHECK(errors[i].relative == result.errors[i].relative);
        CHECK(errors[i].relative < 0.1);
        CHECK(errors[i].least >= 0);
        // Normalisation and rounding change the error of the factors only a little.
        CHECK(errors[i].relative < 1.5 * result.tables[i].fit_error + 1e-3);
    }
    const CompressResult again = compress(small_tables(), options, "test");
    CHECK(again.pack == result.pack);
}

TEST_CASE("Requested bytes and errors are met, and more bytes are never much worse", "[compress]") {
    CompressOptions options;
    double before = 1;
    for (const std::size_t bytes : {20000, 32000}) {
        options.max_bytes = bytes;
        const CompressResult result = compress(small_tables(), options, "test");
        CHECK(result.pack.size() <= bytes);
        CHECK(result.pack.size() > bytes * 3 / 5);  // steps of eight components, 2 kB of text room, at most 128 a part
        double sum = 0;
        for (const TableReport& table : result.tables) sum += table.fit_error * table.fit_error;
        CHECK(sum < before);
        before = sum;
    }
    options.max_bytes = 4000;
    CHECK_THROWS_AS(compress(small_tables(), options, "test"), Error);
    options.max_bytes.reset();
    for (const double error : {0.02}) {
        options.max_error = error;
        for (const TableReport& table : compress(small_tables(), options, "test").tables)
            if (table.kind != TableKind::back_fraction) CHECK(table.fit_error <= error);
    }
    options.max_error = 1e-9;  // below the error of the exit splines
    CHECK_THROWS_AS(compress(small_tables(), options, "test"), Error);
}

TEST_CASE("Lobes are continuous where h and theta_i change sign", "[compress]") {
    CompressOptions options;
    const Opened pack(compress(small_tables(), options, "test").pack);
    for (float y = -1.5f; y < 1.6f; y += 0.1f) {
        // Odd factors vanish at 0, up to the float rounding of a few coefficients, 1e-6.
        CHECK(azimuthal(pack.view, 2, 0.5f, 0, y) == Approx(azimuthal(pack.view, 2, 0.5f, 0, -y)).epsilon(1e-5));
        CHECK(azimuthal(pack.view, 2, 0.5f, 1e-30f, y) == azimuthal(pack.view, 2, 0.5f, -1e-30f, -y));
        for (const Side side : {Side::back, Side::forward})
            CHECK(longitudinal(pack.view, side, 2, 0.5f, 0, y) ==
                  Approx(longitudinal(pack.view, side, 2, 0.5f, 0, -y)).epsilon(1e-5));
    }
}

TEST_CASE("Non-negative factors: every component is a density, also between the nodes", "[compress]") {
    CompressOptions options;
    options.solver = tensor::Solver::nonnegative;
    options.rank = 10;
    const CompressResult result = compress(small_tables(), options, "test");
    const Opened pack(result.pack);
    for (const TableKind kind : {TableKind::azimuthal, TableKind::longitudinal_back, TableKind::longitudinal_forward}) {
        const TableView& table = pack.view[kind];
        REQUIRE(table.layout.even_rank == 10);
        REQUIRE(table.layout.odd_rank == 10);
        const std::uint32_t exit = table.parameter_axes(), middle = table.even_stride();
        for (std::uint32_t r = 0; r < 10; ++r) {
            for (std::uint32_t k = 0; k < exit; ++k)
                for (std::uint32_t j = 0; j < table.layout.axes[k].spans + 3; ++j) {
                    const int even = table.number(k, j, r);
                    CHECK(even >= 0);
                    CHECK(even == table.number(k, j, middle + r));
                }
            const auto scale = [&](std::uint32_t i) {
                return static_cast<double>(detail::load<float>(table.bytes + table.layout.scales_offset + 4 * i));
            };
            const auto unit = [&](std::uint32_t i) { return scale(i) * (1 << (16 - table.bits(i))); };
            for (std::uint32_t j = 0; j < table.layout.axes[exit].spans + 3; ++j) {
                const double even = scale(r) * table.number(exit, j, r);
                const double odd = scale(middle + r) * table.number(exit, j, middle + r);
                // Rounding: half a unit of each, plus float.
                CHECK(even - std::abs(odd) >= -0.51 * (unit(r) + unit(middle + r)));
            }
        }
    }
    for (const LobeError& error : result.errors) CHECK(error.relative < 0.4);
}

TEST_CASE("A clamped lobe integrates to 1 to float precision, negative undershoot included", "[compress]") {
    CompressOptions options;
    options.rank = 4;  // coarse: large negative undershoot
    const Opened coarse(compress(small_tables(), options, "test").pack);
    const OpenResult opened = open_pack(default_pack_words, default_pack_size);
    REQUIRE(opened.status == PackStatus::ok);
    double deepest = 0, worst = 0;
    for (const PackView* pack : {&coarse.view, &opened.pack})
        for (const TableKind kind : lobe_kinds)
            for (int i = 0; i < 60; ++i) {
                const TableView& table = (*pack)[kind];
                const float u = static_cast<float>(i) / 60;
                LobeQuery query;
                query.sigma = 4 * u * u, query.g = 0.7f * (1 - std::abs(2 * u - 1)), query.h = u,
                query.theta_i = 1.5f * u;
                const Contraction contraction = contract(table, query);
                // Simpson's rule on 64 parts of every span; its error at a kink, where clamping starts, is slope /
                // 64^2.
                const AxisView<float> axis = table.axis(table.parameter_axes());
                double integral = 0, least = 0;
                for (std::uint32_t span = 0; span < axis.spans; ++span) {
                    const auto a = static_cast<double>(axis.breakpoint(static_cast<std::int32_t>(span))),
                               b = static_cast<double>(axis.breakpoint(static_cast<std::int32_t>(span) + 1));
                    constexpr int parts = 64;
                    for (int p = 0; p <= 2 * parts; ++p)
                        for (const double side : {-1.0, 1.0}) {
                            const auto y = static_cast<float>(side * (a + (b - a) * p / (2 * parts)));
                            const double weight = p % (2 * parts) == 0 ? 1 : (p % 2 ? 4 : 2);
                            integral +=
                                weight * (b - a) / (6 * parts) * static_cast<double>(lobe(table, contraction, y));
                            least = std::min(least, static_cast<double>(signed_lobe(table, contraction, y)));
                        }
                }
                deepest = std::min(deepest, least);
                worst = std::max(worst, std::abs(integral - 1));
            }
    CHECK(deepest < -1e-3);  // there was something to clamp
    CHECK(worst < 5e-6);     // float sums of up to 400 components with cancellation of up to a factor of ten
}

TEST_CASE("Degeneracy from a pack's bytes agrees with the solver's", "[compress]") {
    CompressOptions options;
    options.rank = 8;
    const CompressResult result = compress(small_tables(), options, "test");
    REQUIRE(result.degeneracy.size() == 4);
    for (std::size_t i = 0; i < 3; ++i) {
        // Even and odd components are orthogonal, and the solver's inner product is the same up to bins and the
        // rounding of blocks.
        double sum = 0, least = 1;
        for (std::size_t p = 0; p < result.tables[i].parts.size(); ++p) {
            const PartReport& part = result.tables[i].parts[p];
            least = std::min(least, part.solve.degeneracy.least_cosine);
            sum += part.solve.degeneracy.norm_ratio * part.share;
        }
        CHECK(result.degeneracy[i].first == result.tables[i].kind);
        CHECK(result.degeneracy[i].second.norm_ratio == Approx(sum).epsilon(0.02));
        CHECK(result.degeneracy[i].second.least_cosine == Approx(least).margin(0.02));
    }
}

TEST_CASE("No error is claimed below the noise of the table", "[compress]") {
    Tables noisy = small_tables();
    for (double& error : noisy.azimuthal->standard_error) error = 0.05;
    CompressOptions options;
    options.rank = 8;
    const CompressResult result = compress(noisy, options, "test");
    CHECK(result.errors[0].relative < 0.05);
    CHECK(result.errors[0].noise == Approx(0.05).epsilon(1e-12));
    CHECK(result.errors[0].claim > 0.05);
    CHECK(result.errors[0].worst_claim >= result.errors[0].claim);
    // The pack stores the noise.
    CHECK(pack_source(result.pack, "test")->noise(TableKind::azimuthal, {}) == Approx(0.05).epsilon(1e-6));
}

namespace {

/// 4 x 3 x 4 nodes of 36 bins: a part has 48 fibres along its exit axis, and so at most 48 components.
const Tables& smallest_tables() {
    static const Tables tables = noise_free(4, {0, 0.8, 3}, 36);
    return tables;
}

}  // namespace

TEST_CASE("A pack has no more components than its table can have, or than the error of its exit splines justifies",
          "[compress]") {
    for (const std::size_t bytes : {20000u, 40000u, 153600u, 100000000u}) {
        CAPTURE(bytes);
        CompressOptions options;
        options.max_bytes = bytes;
        const CompressResult result = compress(smallest_tables(), options, "test");
        CHECK(result.pack.size() <= bytes);
        for (const TableReport& report : result.tables) {
            const double components = report.fit_error * report.fit_error - report.exit_error * report.exit_error;
            for (const PartReport& part : report.parts) CHECK(part.rank <= (is_lobe(report.kind) ? 48 : 12));
            // At most_rank only the error of the exit splines is left; below it, components add at most a quarter of
            // that.
            if (is_lobe(report.kind) && bytes >= 40000)
                CHECK(components <= 1.5 * report.exit_error * report.exit_error / 16);
        }
    }
}

TEST_CASE("A rank beyond the most of a table is reduced to it, and exact except for the exit splines", "[compress]") {
    for (const tensor::Solver solver : {tensor::Solver::lm, tensor::Solver::als, tensor::Solver::nonnegative}) {
        CompressOptions options;
        options.rank = 256;
        options.solver = solver;
        const CompressResult result = compress(smallest_tables(), options, "test");
        for (const TableReport& report : result.tables) {
            if (!is_lobe(report.kind)) continue;
            for (const PartReport& part : report.parts) {
                // Non-negative factors have spline coefficients in place of nodes, two more on each axis.
                CHECK(part.rank <= (solver == tensor::Solver::nonnegative ? 6 * 5 * 6 : 4 * 3 * 4));
                CHECK(part.solve.solver == "fibres");
                if (solver != tensor::Solver::nonnegative) CHECK(part.solve.relative_error < 2e-7);
            }
        }
    }
}

TEST_CASE("The option --max-error is reached with at most most_rank components, or refused", "[compress]") {
    CompressOptions options;
    options.max_error = 0.08;  // the exit splines of the forward lobes leave 0.056
    const CompressResult result = compress(smallest_tables(), options, "test");
    for (const LobeError& error : result.errors) CHECK(error.relative <= 0.08);
    options.max_error = 1e-9;  // below the error of the exit splines
    CHECK_THROWS_WITH(compress(smallest_tables(), options, "test"), Catch::Contains("--max-error"));
}
