// An absorbing medulla, from tables to fibre: the fifth axis of C^N, the energies it leaves, packs with that axis, and
// fibres that use them (docs/physics.md, section 2; docs/bcsdf.md).
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "medulla/medulla.hpp"
#include "sim2d/disc/deterministic.hpp"
#include "sim2d/disc/single.hpp"
#include "tables/job/simulate.hpp"
#include "tables/pack/compress.hpp"
#include "tables/pack/source.hpp"
#include "tables/store/slices.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fibre_of.hpp"
#include "tests/support/fur_reference.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

Request small_request(Method method) {
    Request request = default_request();
    request.method = method;
    request.sigma = graded_axis("sigma", {0, 4, 6});
    request.g = graded_axis("g", {0, 0.7, 3});
    request.h = graded_axis("h", {0, 1, 6});
    request.theta_i = graded_axis("theta_i", {0, pi / 2, 4});
    request.bins = 72;
    request.paths = 3000;
    return request;
}

Tables simulated(Method method, bool absorbs) {
    Request request = small_request(method);
    if (absorbs) request.absorption = graded_axis("absorption", {0, 2, 4});
    return simulate(request, ProgressMode::none);
}

/// Noise-free versions of both tables with the axis, and their pack.
const Tables& absorbing_tables() {
    static const Tables tables = simulated(Method::deterministic, true);
    return tables;
}
const CompressResult& absorbing_pack() {
    static const CompressResult result = compress(absorbing_tables(), {}, "test");
    return result;
}

Parameters parameters_of(const Table& table, std::size_t cell) {
    Parameters at;
    for (const char* name : {"sigma", "g", "absorption", "h"}) at.set(name, table.parameter(cell, name));
    return at;
}

}  // namespace

TEST_CASE("The fifth axis at absorption 0 is the table without it, byte for byte", "[absorption]") {
    for (const Method method : {Method::deterministic, Method::mc, Method::automatic}) {
        const Tables plain = simulated(method, false), all = simulated(method, true);
        const Table &a = *plain.azimuthal, &b = *all.azimuthal;
        REQUIRE(b.axes.size() == 5);
        REQUIRE(b.axes[2].name == "absorption");
        std::size_t cell = 0;
        for (std::size_t other = 0; other < b.cells(); ++other) {
            if (b.parameter(other, "absorption") != 0) continue;
            CHECK(std::memcmp(a.lobe_of(cell), b.lobe_of(other), a.bins() * sizeof(float)) == 0);
            CHECK(a.energy[cell] == b.energy[other]);
            CHECK(a.energy_error[cell] == b.energy_error[other]);
            CHECK(a.standard_error[cell] == b.standard_error[other]);
            CHECK(a.mean_length[cell] == b.mean_length[other]);
            ++cell;
        }
        CHECK(cell == a.cells());
        Tables slab_a = plain, slab_b = all;
        slab_a.azimuthal.reset(), slab_b.azimuthal.reset();
        CHECK(contents_hash(slab_a) == contents_hash(slab_b));
    }
}

TEST_CASE("Absorbed energies fall along the axis, within what first collisions allow", "[absorption]") {
    for (const Method method : {Method::deterministic, Method::mc}) {
        const Tables all = simulated(method, true);
        const Table& table = *all.azimuthal;
        const std::size_t step = table.axis("h").size();
        for (std::size_t cell = 0; cell < table.cells(); ++cell) {
            const Parameters at = parameters_of(table, cell);
            INFO(table.describe(cell));
            CHECK(table.mean_length[cell] > 0);
            if (at.absorption == 0 || at.sigma == 0 || at.h == 1) continue;
            const double extinction = at.sigma + at.absorption;
            CHECK(table.energy[cell] > 0);
            CHECK(table.energy[cell] <
                  at.sigma / extinction * sim2d::disc_energy(extinction, at.h) + 5 * table.energy_error[cell]);
            CHECK(table.energy[cell] < table.energy[cell - step]);
            CHECK(table.energy_error[cell] > 0);
        }
    }
}

TEST_CASE("Survival lengths: closed form at sigma = 0, the limit at the rim, the mean path at absorption 0",
          "[absorption]") {
    Request request = small_request(Method::deterministic);
    request.longitudinal = false;
    request.sigma = graded_axis("sigma", {0, 8, 12});
    request.g = {"g", {0.6}};
    request.h = graded_axis("h", {0, 1, 12});
    request.bins = 24;
    const sim2d::DiscSolver solver(0.6);
    for (const std::size_t nodes : {4, 8}) {
        request.absorption = graded_axis("absorption", {0, 2, nodes});
        const Tables tables = simulate(request, ProgressMode::none);
        const Table& table = *tables.azimuthal;
        const std::vector<double> lengths = survival_lengths(table);
        REQUIRE(lengths.size() == table.cells());
        for (std::size_t cell = 0; cell < table.cells(); ++cell) {
            const Parameters at = parameters_of(table, cell);
            INFO(table.describe(cell));
            if (at.absorption == 0) CHECK(lengths[cell] == table.mean_length[cell]);
            if (at.absorption == 0 || (at.sigma > 0 && at.h < 1)) continue;
            // The share that is left where almost nothing is scattered: from collisions uniform on the chord, or of a
            // nearly grazing ray, where lengths vary as c log c, c = sqrt(1 - h^2).
            const double h = std::min(at.h, 1 - 1e-14), sigma = std::max(at.sigma, 1e-9);
            const double left = solver.solve(sigma, at.absorption, {h}, 24)[0].energy / sim2d::disc_energy(sigma, h);
            // The errors here are 1.3e-3 and 2.2e-4 at the rim (they fall as nodes^-2 and faster) and 2.8e-5 inside.
            const double bound = at.h < 1 ? 1e-4 : (nodes == 4 ? 2e-3 : 4e-4);
            CHECK(std::abs(std::exp(-at.absorption * lengths[cell]) - left) < bound);
            if (at.h < 1) CHECK(lengths[cell] == Approx(-std::log(left) / at.absorption).epsilon(1e-3));
        }
        const auto source = table_source(tables);
        for (std::size_t cell = 0; cell < table.cells(); ++cell) {
            const Parameters at = parameters_of(table, cell);
            CHECK(energy_of(*source, TableKind::azimuthal, at) ==
                  Approx(table.energy[cell]).epsilon(1e-9).margin(1e-15));
        }
    }
}

TEST_CASE("Stored mean lengths add up: isotropic uniform light loses pi / 2 per unit of absorption", "[absorption]") {
    // d energy / d absorption at 0 is -energy mean_length, whose integral over the offsets is pi / 2 less the
    // unscattered light's own (Blanco and Fournier 2003). Gauss-Legendre in asin h as the nodes of the axis.
    Request request = small_request(Method::deterministic);
    request.longitudinal = false;
    request.sigma = {"sigma", {0.3, 2}};
    request.g = {"g", {0, 0.8}};
    request.absorption = {"absorption", {0, 1e-4}};
    request.bins = 24;
    const int points = 32;
    request.h.values.clear();
    for (int i = 0; i < points; ++i) request.h.values.push_back(std::sin(pi / 2 * (i + 0.5) / points));
    const Tables tables = simulate(request, ProgressMode::none);
    const Table& table = *tables.azimuthal;
    for (std::size_t row = 0; row < 4; ++row) {
        double stored = 0, lost = 0;
        for (std::size_t i = 0; i < request.h.size(); ++i) {
            const std::size_t clear = row * 2 * request.h.size() + i, dim = clear + request.h.size();
            const double h = request.h.values[i], sigma = table.parameter(clear, "sigma"),
                         half = std::sqrt((1 - h) * (1 + h)), weight = half * pi / 2 / points;
            const double through = std::exp(-2 * sigma * half) * 2 * half;
            stored += weight * (table.energy[clear] * table.mean_length[clear] + through);
            lost += weight * ((table.energy[clear] - table.energy[dim]) / 1e-4 + through);
        }
        INFO(table.describe(row * 2 * request.h.size()));
        CHECK(stored == Approx(pi / 2).epsilon(1e-3));  // errors of the midpoint rule and of the solver's energies
        CHECK(lost ==
              Approx(pi / 2).epsilon(1e-3));  // and the quadratic term, 1e-4 / 2 times the mean square of a path
    }
}

TEST_CASE("A pack with the axis has lobes and survivals within the errors it reports", "[absorption][compress]") {
    const CompressResult& result = absorbing_pack();
    REQUIRE(result.errors[0].kind == TableKind::azimuthal);
    REQUIRE(result.errors[0].survival);
    CHECK(*result.errors[0].survival < 2e-3);
    CHECK_FALSE(result.errors[1].survival);
    const OpenResult opened = open_pack(result.pack.data(), result.pack.size());
    REQUIRE(opened.status == PackStatus::ok);
    const PackView& pack = opened.pack;
    REQUIRE(absorbs(pack));
    const Table& table = *absorbing_tables().azimuthal;
    for (std::size_t cell = 0; cell < table.cells(); ++cell) {
        const Parameters at = parameters_of(table, cell);
        const auto sigma = float(at.sigma), g = float(at.g), h = float(at.h), a = float(at.absorption);
        INFO(table.describe(cell));
        const double left = double(survival(pack, sigma, g, -h, a)), whole = azimuthal_energy(at.sigma, at.h);
        CHECK((left > 0 && left <= 1));
        CHECK(std::abs(left * whole - table.energy[cell]) < *result.errors[0].survival + 1e-6);
        if (at.absorption == 0) CHECK(left == 1);
        const LobeQuery query = {sigma, g, h, 0, a};
        const TableView& lobes = pack[TableKind::azimuthal];
        const float density = float(whole * left) * lobe(lobes, contract(lobes, query), 0.4f);
        CHECK(azimuthal(pack, sigma, g, h, 0.4f, a) == Approx(density).epsilon(1e-5).margin(1e-7));
    }
    // Beyond the axis the length is clamped to its end: less and less is left.
    CHECK(survival(pack, 1, 0.3f, 0.2f, 20) < survival(pack, 1, 0.3f, 0.2f, 2));
    CHECK(std::isnan(survival(PackView{}, 1, 0.3f, 0.2f, 1)));
    CHECK(survival(PackView{}, 1, 0.3f, 0.2f, 0) == 1);
}

TEST_CASE("The fibre's scattered energies are those of the table at the absorption of its medulla",
          "[absorption][bcsdf]") {
    const CompressResult& result = absorbing_pack();
    const PackView pack = open_pack(result.pack.data(), result.pack.size()).pack;
    const Table& table = *absorbing_tables().azimuthal;
    FurParameters<3> p;
    p.eta = 1.55f, p.kappa = 0.6f, p.layers = 0.7f;
    for (float& c : p.sigma_ca) c = 0;
    for (std::size_t cell = 0; cell < table.cells(); ++cell) {
        const Parameters at = parameters_of(table, cell);
        if (at.sigma == 0 || at.h == 1) continue;
        p.sigma_ms = float(at.sigma) / p.kappa, p.sigma_ma = float(at.absorption) / p.kappa, p.g = float(at.g);
        const test::FibreOf<3> fibre(p, pack);
        // The optical radius grows by up to eta / sqrt(eta^2 - 1) = 1.31 towards grazing light, beyond the axis of the
        // pack.
        REQUIRE(fibre.status ==
                (at.sigma < table.axis("sigma").values.back() / 1.31 ? FibreStatus::ok : FibreStatus::beyond_tables));
        const NearField<3> hit = near_field(fibre, Angles{0, 0}, float(at.h) * p.kappa * p.eta);
        REQUIRE(hit.known.cosine > 0);
        INFO(table.describe(cell));
        const double passed = 1 - double(hit.A[0][0]);
        CHECK(std::abs(double(hit.A[3][0]) / passed - table.energy[cell]) < *result.errors[0].survival + 1e-5);
        // No energy is created: all lobes together are at most the incident energy.
        CHECK(hit.albedo()[1] <= 1.000001f);
    }
}

namespace {

/// The analytic pack's tables with an axis of absorption, and lengths that depend on all four parameters.
struct AbsorbingAnalyticPack {
    std::vector<unsigned char> bytes;
    PackView view;
    explicit AbsorbingAnalyticPack(bool lengths = true) {
        analytic::TableSpec lobes = analytic::azimuthal_table();
        const analytic::AxisSpec absorption = {Quantity::absorption, analytic::even(0, 2, 12),
                                               [](int r, double c) { return std::exp(-0.05 * c * c * r); }};
        lobes.axes.insert(lobes.axes.begin() + 2, absorption);
        analytic::TableSpec left = {TableKind::survival, 2, 2, {}};
        left.axes = {
            {Quantity::sigma, analytic::even(0, 4, 24),
             [](int r, double c) { return r == 0 ? std::exp(-0.1 * c * c) : 0.3; }},
            {Quantity::g, analytic::even(-0.95, 0.95, 24), [](int r, double x) { return r == 0 ? 1 : 1 + x; }},
            {Quantity::absorption, analytic::even(0, 2, 12),
             [](int r, double c) { return 1 / (1 + (r == 0 ? 0.1 : 0.4) * c * c); }},
            {Quantity::h, analytic::even(0, 1, 8), [](int r, double c) { return r == 0 ? 1 - 0.6 * c * c : 1; }}};
        analytic::PackBuilder builder;
        builder.add(lobes);
        builder.add(analytic::longitudinal_table(true)), builder.add(analytic::longitudinal_table(false));
        if (lengths) builder.add(left);
        bytes = builder.bytes();
        const OpenResult opened = open_pack(bytes.data(), bytes.size());
        REQUIRE(opened.status == PackStatus::ok);
        view = opened.pack;
    }
};

FurParameters<3> absorbing_fur() {
    FurParameters<3> p = medulla::parameters_of<3>(*find_preset("bobcat"));
    p.sigma_ma = 0.9f, p.sigma_ms = 1.4f, p.kappa = 0.8f, p.g = 0.4f;
    return p;
}

}  // namespace

TEST_CASE("Near field with the axis: reference implementation, Eq. 20 without it, clear medulla at sigma_ma = 0",
          "[absorption][bcsdf]") {
    const AbsorbingAnalyticPack knows, lobes_only(false);
    const analytic::AnalyticPack plain;
    FurParameters<3> p = absorbing_fur();
    for (const float theta_i : {0.0f, -0.7f, 1.3f})
        for (const float h : {-0.95f, -0.4f, 0.1f, 0.7f})
            for (const PackView* pack : {&knows.view, &lobes_only.view}) {
                const test::FibreOf<3> fibre(p, *pack);
                REQUIRE(fibre.status == FibreStatus::ok);
                const reference::Factors factors(*pack);
                for (const float phi : {-2.5f, 0.3f, 2.0f}) {
                    const LobeValues<3> found = near_field(fibre, Angles{theta_i, 0}, h).lobes(0.2f, phi);
                    const reference::Lobes expected =
                        reference::near_lobes(p, &factors, double(theta_i), 0.2, double(phi), double(h));
                    INFO("theta_i " << theta_i << " h " << h << " phi " << phi << " axis " << absorbs(*pack));
                    for (int lobe = 3; lobe < all_lobe_count; ++lobe)
                        for (int c = 0; c < 3; ++c)
                            CHECK(found.N[lobe][c] == Approx(expected.N[lobe][c]).epsilon(2e-4).margin(1e-7));
                }
            }
    p.sigma_ma = 0;
    const test::FibreOf<3> absorbing(p, knows.view), clear(p, plain.view);
    for (const float h : {-0.8f, 0.2f}) {
        const LobeValues<3> a = near_field(absorbing, Angles{0.4f, 0}, h).lobes(0.1f, 1.0f),
                            b = near_field(clear, Angles{0.4f, 0}, h).lobes(0.1f, 1.0f);
        // A different axis rounds its factors differently.
        for (int lobe = 0; lobe < all_lobe_count; ++lobe)
            CHECK(a.N[lobe][0] == Approx(b.N[lobe][0]).epsilon(2e-3).margin(1e-6));
    }
}

TEST_CASE("Dense tables of a simulated pack with the axis: lobes and energies of the factors",
          "[absorption][bcsdf][tables]") {
    // Absorption varies with sigma, and sigma with theta_i.
    const OpenResult real = open_pack(absorbing_pack().pack.data(), absorbing_pack().pack.size());
    REQUIRE(real.status == PackStatus::ok);
    const FurParameters<3> p = absorbing_fur();
    const test::FibreOf<3> fibre(p, real.pack);
    const reference::Factors factors(real.pack);
    double difference = 0, norm = 0;
    for (const float theta_i : {0.0f, -0.7f, 1.3f, 1.55f})
        for (const float h : {-1.0f, -0.6f, 0.1f, 0.7f}) {
            const NearField<3> hit = near_field(fibre, Angles{theta_i, 0}, h);
            const reference::Ray ray = reference::trace(p, &factors, double(theta_i), double(h));
            for (int lobe = 3; lobe < all_lobe_count; ++lobe)
                CHECK(hit.A[lobe][1] == Approx(ray.A[lobe][1]).epsilon(1e-4).margin(1e-7));
            for (int i = 0; i < 24; ++i) {
                const float phi = -3.1f + 0.26f * float(i);
                const LobeValues<3> x = hit.lobes(0.2f, phi);
                const reference::Lobes y =
                    reference::near_lobes(p, &factors, double(theta_i), 0.2, double(phi), double(h));
                for (int lobe = 3; lobe < lobe_count; ++lobe) {
                    difference += std::pow(double(x.N[lobe][1]) - y.N[lobe][1], 2);
                    norm += std::pow(y.N[lobe][1], 2);
                }
            }
        }
    CHECK(std::sqrt(difference / norm) < 1e-4);
}

TEST_CASE("Far field with the axis is the mean of near fields, and sample weights average to its albedo",
          "[absorption][bcsdf]") {
    const AbsorbingAnalyticPack pack;
    const test::FibreOf<3> fibre(absorbing_fur(), pack.view);
    for (const float theta_i : {0.0f, 0.9f}) {
        const Angles known = {theta_i, 0};
        const FarField<3> mean_field = far_field(fibre, known, Offsets(), FarQuality::fine);
        const int points = 4000, samples = 20000;
        for (const float phi : {-2.0f, 0.4f, 3.0f}) {
            double mean[2] = {};
            for (int i = 0; i < points; ++i) {
                const LobeValues<3> l =
                    near_field(fibre, known, -1 + 2 * (float(i) + 0.5f) / float(points)).lobes(0.1f, phi);
                for (int k = 0; k < 2; ++k) mean[k] += double(l.N[k + 3][1]) / points;
            }
            const LobeValues<3> found = mean_field.lobes(0.1f, phi);
            INFO("theta_i " << theta_i << " phi " << phi);
            // Error of the far field's quadrature: 0.3 % of a lobe (docs/bcsdf.md).
            for (int k = 0; k < 2; ++k) CHECK(double(found.N[k + 3][1]) == Approx(mean[k]).epsilon(3e-3).margin(1e-6));
        }
        // The mean weight of samples is the albedo, within 5 standard errors.
        double albedo = 0, sum = 0, squares = 0;
        for (int i = 0; i < points; ++i)
            albedo += double(near_field(fibre, known, -1 + 2 * (float(i) + 0.5f) / float(points)).albedo()[1]) / points;
        std::uint32_t state = 7;
        const auto next = [&] { return float((state = state * 1664525u + 1013904223u) >> 8) * 0x1p-24f; };
        for (int i = 0; i < samples; ++i) {
            const Sample<3> s = mean_field.sample({next(), next(), next(), next(), next()});
            const double w = s.valid ? double(s.weight[1]) : 0;
            sum += w, squares += w * w;
        }
        const double mean = sum / samples, error = std::sqrt((squares / samples - mean * mean) / samples);
        CHECK(std::abs(mean - albedo) < 5 * error + 3e-3 * albedo);
        // Near samples are drawn from the lobe at the absorption: a grey fibre's weight is its albedo.
        const NearField<3> hit = near_field(fibre, known, 0.3f);
        for (int i = 0; i < samples; ++i) {
            const Sample<3> s = hit.sample({next(), next(), next(), next(), 0});
            REQUIRE(s.valid);
            CHECK(s.weight[1] == Approx(hit.albedo()[1]).epsilon(2e-6));
        }
    }
}

TEST_CASE("Packs whose axes of absorption do not fit are refused", "[absorption][pack]") {
    const AbsorbingAnalyticPack good;
    PackHeader header;
    std::memcpy(&header, good.bytes.data(), sizeof header);
    for (std::uint32_t i = 0; i < header.table_count; ++i) {
        std::vector<unsigned char> bytes = good.bytes;
        PackTable table;
        unsigned char* at = bytes.data() + header.tables_offset + i * sizeof table;
        std::memcpy(&table, at, sizeof table);
        if (table.axis_count < 4 || table.axes[2].quantity != static_cast<std::uint32_t>(Quantity::absorption))
            continue;
        table.axes[2].quantity = static_cast<std::uint32_t>(Quantity::sigma);
        std::memcpy(at, &table, sizeof table);
        PackHeader sealed = header;
        sealed.checksum = pack_checksum(bytes.data(), bytes.size());
        std::memcpy(bytes.data(), &sealed, sizeof sealed);
        CHECK(open_pack(bytes.data(), bytes.size()).status == PackStatus::bad_axis);
    }
}
