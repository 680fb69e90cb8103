// Simulation -> tables.h5 -> pack: round trips, determinism, and invalid files.
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "medulla/lookup.hpp"
#include "tables/error.hpp"
#include "tables/job/simulate.hpp"
#include "tables/pack/source.hpp"
#include "tables/store/file.hpp"
#include "tables/store/tables_file.hpp"
#include "tests/support/small_request.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

Request small_request(Method method) { return test::small_request(method, {5, 3, 4, 3}, 72, 2000); }

void check_same(const Table& a, const Table& b) {
    CHECK(a.lobe == b.lobe);
    CHECK(a.energy == b.energy);
    CHECK(a.energy_error == b.energy_error);
    CHECK(a.standard_error == b.standard_error);
    CHECK(a.mean_length == b.mean_length);
    for (std::size_t k = 0; k < a.axes.size(); ++k) CHECK(a.axes[k].values == b.axes[k].values);
}

}  // namespace

TEST_CASE("The same seed gives the same values for 1, 2 and 5 threads, another seed others", "[tables]") {
    for (const Method method : {Method::mc, Method::automatic}) {
        Request request = small_request(method);
        request.threads = 1;
        const Tables one = simulate(request, ProgressMode::none);
        for (const int threads : {2, 5}) {
            request.threads = threads;
            const Tables other = simulate(request, ProgressMode::none);
            check_same(*one.azimuthal, *other.azimuthal);
            check_same(*one.longitudinal, *other.longitudinal);
        }
        if (method != Method::mc) continue;
        request.seed = 2;
        CHECK(simulate(request, ProgressMode::none).azimuthal->lobe != one.azimuthal->lobe);
    }
}

TEST_CASE("Axes that begin at -0 and at 0 are the same job, values and bytes", "[tables]") {
    for (const Method method : {Method::analog, Method::mc}) {
        Request request = small_request(method);
        const Tables plus = simulate(request, ProgressMode::none);
        request.sigma.values[0] = request.g.values[0] = request.h.values[0] = request.theta_i.values[0] = -0.0;
        const Tables minus = simulate(request, ProgressMode::none);
        check_same(*plus.azimuthal, *minus.azimuthal);
        check_same(*plus.longitudinal, *minus.longitudinal);
    }
    for (const double end : {parse_range("-0:1", "--g-range", 3).low, parse_range("-1:-0", "--g-range", 3).high})
        CHECK_FALSE(std::signbit(end));
}

TEST_CASE("At 90 degrees the slab's closed form is what its solvers have: all light is scattered, however thin it is",
          "[tables]") {
    for (const double sigma : {1e-300, 1e-17, 1.0, 1e3}) CHECK(longitudinal_energy(sigma, pi / 2) == 1);
    for (const float sigma : {1e-30f, 1.0f}) {
        CHECK(longitudinal_energy(sigma, float(pi / 2)) == 1);  // beyond pi/2, where its cosine is negative
        CHECK(longitudinal_energy(sigma, -float(pi / 2)) == 1);
    }
    CHECK(longitudinal_energy(0.0, pi / 2) == 0);
    CHECK(std::isnan(longitudinal_energy(1.0, std::nan(""))));
    CHECK(longitudinal_energy(0.5, 1.0) == Approx(1 - std::exp(-1 / std::cos(1.0))));
}

TEST_CASE("A cell's values do not depend on the table around it", "[tables]") {
    const Tables whole = simulate(small_request(Method::mc), ProgressMode::none);
    Request part = small_request(Method::mc);
    part.longitudinal = false;
    part.sigma = {"sigma", {part.sigma.values[2]}};
    const Tables alone = simulate(part, ProgressMode::none);
    const std::size_t slice = alone.azimuthal->lobe.size();
    CHECK(std::equal(alone.azimuthal->lobe.begin(), alone.azimuthal->lobe.end(),
                     whole.azimuthal->lobe.begin() + 2 * slice));
    CHECK_FALSE(alone.longitudinal);
}

TEST_CASE("Tables files return what was written, with every compression, and are reproducible byte for byte",
          "[tables]") {
    const test::TemporaryFolder folder;
    const Tables tables = simulate(small_request(Method::mc), ProgressMode::none);
    for (const Compression compression : {Compression::none, Compression::gzip, Compression::zstd}) {
        const std::string path = folder / "t.h5", again = folder / "u.h5";
        write_tables(path, tables, compression);
        write_tables(again, tables, compression);
        CHECK(read_file(path) == read_file(again));
        const Tables read = read_tables(path);
        check_same(*read.azimuthal, *tables.azimuthal);
        check_same(*read.longitudinal, *tables.longitudinal);
        CHECK(read.azimuthal->method == tables.azimuthal->method);
    }
    for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
        CHECK(entry.path().extension() == ".h5");  // no temporary file is left
}

TEST_CASE("A damaged tables file is refused, never misread", "[tables]") {
    const test::TemporaryFolder folder;
    const Tables tables = simulate(small_request(Method::mc), ProgressMode::none);
    const std::string path = folder / "t.h5", broken = folder / "broken.h5";
    write_tables(path, tables, Compression::zstd);
    const std::vector<unsigned char> good = read_file(path);
    int refused = 0;
    for (std::size_t i = 0; i < 60; ++i) {
        std::vector<unsigned char> bytes = good;
        bytes[(i * 7919 + 13) * 31 % bytes.size()] ^= static_cast<unsigned char>(1u << (i % 8));
        write_file(broken, bytes.data(), bytes.size());
        try {
            const Tables read = read_tables(broken);
            check_same(*read.azimuthal, *tables.azimuthal);  // a flip in unused bytes may pass if no value differs
            check_same(*read.longitudinal, *tables.longitudinal);
        } catch (const Error&) {
            ++refused;
        }
    }
    CHECK(refused > 30);
    CHECK_THROWS_AS(read_tables(folder / "missing.h5"), Error);
    write_file(broken, good.data(), good.size() / 2);
    CHECK_THROWS_AS(read_tables(broken), Error);
    write_file(broken, std::string("not a table"));
    CHECK_THROWS_AS(read_tables(broken), Error);
}

TEST_CASE("Between its nodes a table is interpolated by the splines of a pack", "[tables]") {
    const Tables tables = simulate(small_request(Method::mc), ProgressMode::none);
    const auto source = table_source(tables);
    Parameters at;
    at.sigma = 1.3, at.g = 0.35, at.h = 0.2;
    const std::vector<double> lobe = source->lobe(TableKind::azimuthal, at, 72);
    double sum = 0;
    for (const double x : lobe) sum += x * 2 * pi / 72;
    CHECK(sum == Approx(1).epsilon(1e-5));  // weights sum to 1, so integrals of float lobes do
    CHECK_THROWS_AS((at.sigma = 5, source->check(TableKind::azimuthal, at, "x")), Error);
}
