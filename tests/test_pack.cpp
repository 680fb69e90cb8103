// Packs: the runtime reads what was written, and anything else is refused with a reason.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "medulla/medulla.hpp"
#include "tables/pack/writer.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/exercise_pack.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

/// The exit axis of the small pack.
Spline small_exit() {
    std::vector<double> breakpoints;
    for (int i = 0; i <= 8; ++i) breakpoints.push_back(pi * i / 8);
    return Spline(breakpoints);
}
/// Coefficients of its even bump and constant, and of its odd wave.
Eigen::VectorXd small_column(int r) {
    const Spline exit = small_exit();
    Eigen::VectorXd c(exit.size());
    for (Eigen::Index j = 0; j < exit.size(); ++j)
        c[j] =
            r == 0 ? 1.5 + std::cos(static_cast<double>(j)) : (r == 1 ? 1.0 : 0.1 * std::sin(static_cast<double>(j)));
    return c;
}

/// Rank-3 lobes: (1 + sigma)(1 - g) bump + (1 + g) constant + h wave, exactly representable up to rounding.
std::vector<unsigned char> small_pack() {
    const std::vector<double> sigma = {0, 1, 2, 4}, g = {0, 0.5}, h = {0, 0.3, 1};
    PackedTable table{TableKind::azimuthal, {}, Eigen::VectorXd::Ones(3), 2, 0, 1};
    const auto parameter = [&](Quantity q, const std::vector<double>& nodes, auto f0, auto f1, auto f2) {
        const Spline spline = Spline::through(q, nodes);
        Eigen::MatrixXd values(static_cast<Eigen::Index>(nodes.size()), 3);
        for (std::size_t i = 0; i < nodes.size(); ++i)
            values.row(static_cast<Eigen::Index>(i)) << f0(nodes[i]), f1(nodes[i]), f2(nodes[i]);
        table.axes.push_back({q, static_cast<std::uint32_t>(nodes.size()), spline, spline.from_nodes() * values});
        if (q == Quantity::h)  // the wave is odd in h: its coefficients about 0 cancel for any rounding
            table.axes.back().coefficients.col(2) = Spline::through(q, nodes, Mirror::odd).from_nodes() * values.col(2);
    };
    const auto one = [](double) { return 1.0; };
    parameter(
        Quantity::sigma, sigma, [](double x) { return 1 + x; }, [](double) { return 2.0; }, one);
    parameter(
        Quantity::g, g, [](double x) { return 1 - x; }, [](double x) { return 1 + x; }, one);
    parameter(
        Quantity::h, h, one, [](double) { return 0.5; }, [](double x) { return x; });
    Eigen::MatrixXd coefficients(small_exit().size(), 3);
    for (int r = 0; r < 3; ++r) coefficients.col(r) = small_column(r);
    table.axes.push_back({Quantity::phi, 36, small_exit(), coefficients});
    return write_pack({table}, "{\"made\":\"test\"}");
}

/// Rewrites the checksum after a change, so that the checks after it are reached.
void seal(std::vector<unsigned char>& bytes) {
    const std::uint64_t sum = pack_checksum(bytes.data(), bytes.size());
    std::memcpy(bytes.data() + offsetof(PackHeader, checksum), &sum, sizeof sum);
}

template <class T>
void poke(std::vector<unsigned char>& bytes, std::size_t offset, T value) {
    std::memcpy(bytes.data() + offset, &value, sizeof value);
}

}  // namespace

TEST_CASE("Numbers of every width are read as they were stored, one by one and eight at a time", "[pack]") {
    for (const std::uint32_t bits : {4u, 8u, 12u, 16u}) {
        const int step = 1 << (16 - bits), greatest = greatest_of(bits);
        for (int first = -greatest; first <= greatest; ++first) {
            unsigned char block[16] = {};
            int numbers[8];
            for (int r = 0; r < 8; ++r) {
                numbers[r] = ((first + r * 911 + greatest) % (2 * greatest + 1) - greatest) * step;
                store_number(block, bits, std::uint32_t(r), numbers[r]);
            }
            float eight[8];
            detail::store_eight(detail::convert_eight(block, bits), eight);
            for (std::uint32_t r = 0; r < 8; ++r)
                if (load_number(block, bits, r) != numbers[r] || eight[r] != float(numbers[r])) FAIL(numbers[r]);
            for (std::uint32_t i = bits; i < 16; ++i) REQUIRE(block[i] == 0);  // writes no further bytes
        }
    }
    SUCCEED();
}

TEST_CASE("A row of blocks of different widths has the numbers of each", "[pack]") {
    // Factor r of sigma is 1 + r + sigma, four widths of eight components each; other axes do nothing.
    constexpr int rank = 32;
    PackedTable table{TableKind::back_fraction, {}, Eigen::VectorXd::Ones(rank), rank, 0, 1};
    table.bits = {8, 16, 4, 12};
    const std::vector<double> nodes = {0, 1, 4};
    for (const Quantity quantity : {Quantity::sigma, Quantity::g, Quantity::theta_i}) {
        const std::vector<double> at = quantity == Quantity::sigma ? nodes : std::vector<double>{0};
        const Spline spline = Spline::through(quantity, at);
        Eigen::MatrixXd values(static_cast<Eigen::Index>(at.size()), rank);
        for (std::size_t i = 0; i < at.size(); ++i)
            for (int r = 0; r < rank; ++r)
                values(static_cast<Eigen::Index>(i), r) = quantity == Quantity::sigma ? 1 + r + at[i] : 1.0;
        table.axes.push_back({quantity, static_cast<std::uint32_t>(at.size()), spline, spline.from_nodes() * values});
    }
    const std::vector<unsigned char> bytes = write_pack({table}, "{}");
    const OpenResult opened = open_pack(bytes.data(), bytes.size());
    REQUIRE(opened.status == PackStatus::ok);
    const TableView& view = opened.pack[TableKind::back_fraction];
    REQUIRE(view.layout.row_bytes == 8 + 16 + 4 + 12);
    for (const double sigma : nodes) {
        LobeQuery query;
        query.sigma = float(sigma);
        const Contraction contraction = contract(view, query);
        for (std::uint32_t r = 0; r < rank; ++r) {
            const double greatest = table.axes[0].coefficients.col(r).cwiseAbs().maxCoeff();
            const double unit = greatest / greatest_of(table.bits[r / 8]);
            CHECK(double(contraction.weight[r]) == Approx(1 + r + sigma).epsilon(1e-6).margin(unit / 2));
            // The plain reference implementation reads the same.
            const auto scale = double(detail::load<float>(bytes.data() + view.layout.scales_offset + 4 * r));
            for (std::uint32_t j = 0; j < view.layout.axes[0].spans + 3; ++j)
                CHECK(scale * view.number(0, j, r) * view.number(1, 0, r) * view.number(2, 0, r) ==
                      Approx(table.axes[0].coefficients(j, r)).margin(unit / 2 * (1 + 1e-6)));
        }
    }
}

TEST_CASE("Blending and summing rows gives the same bits as eight components at a time", "[pack]") {
    const OpenResult opened = open_pack(default_pack_words, default_pack_size);
    REQUIRE(opened.status == PackStatus::ok);
    for (const TableView& table : opened.pack.tables) {
        if (!table) continue;
        const std::uint32_t k = table.layout.axis_count - 1, stride = table.layout.rank_stride;
        Contraction c, scaled;
        start_contraction(table, c.weight);
        for (std::uint32_t row = 0; row + 4 <= table.layout.axes[k].spans + 3; ++row) {
            const AxisPoint at = {row, {{0.1f, 0.55f, 0.33f, 0.02f}}};
            detail::RowSums sums[4];
            detail::four_row_sums(table, k, row, c.weight, sums);
            for (std::uint32_t i = 0; i < 4; ++i) {
                const detail::RowSums one = detail::row_sums(table, k, row + i, c.weight);
                REQUIRE(one.even == sums[i].even);
                REQUIRE(one.odd == sums[i].odd);
            }
            contract_axis(table, k, at, c.weight, scaled.weight);
            const unsigned char* block = table.row(k, row);
            detail::Eight sum[2] = {detail::zero_eight(), detail::zero_eight()};
            for (std::uint32_t first = 0; first < stride; first += 8) {
                const std::uint32_t bits = table.bits(first);
                const detail::Eight term =
                    detail::times(detail::load_eight(c.weight + first),
                                  detail::blend(block, bits, table.layout.row_bytes, at.weights));
                float expected[8];
                detail::store_eight(term, expected);
                for (std::uint32_t r = 0; r < 8; ++r) REQUIRE(scaled.weight[first + r] == expected[r]);
                detail::Eight& part = sum[first < table.even_stride() ? 0 : 1];
                part = detail::plus(part, term);
                block += bits;
            }
            REQUIRE(detail::sum_of_blend(table, k, row, at.weights, c.weight, -1) ==
                    detail::sum_of(detail::plus(sum[0], detail::times(-1.0f, sum[1]))));
        }
    }
}

TEST_CASE("A pack's lobes are those of its factors, and integrate to 1", "[pack]") {
    const std::vector<unsigned char> bytes = small_pack();
    const OpenResult opened = open_pack(bytes.data(), bytes.size());
    REQUIRE(opened.status == PackStatus::ok);
    const TableView& table = opened.pack[TableKind::azimuthal];
    REQUIRE(table);
    CHECK_FALSE(opened.pack[TableKind::longitudinal_back]);
    CHECK(std::string(opened.pack.text, opened.pack.text_bytes) == "{\"made\":\"test\"}");
    const Spline exit = small_exit();
    const double steps = 2000, h = 0.3;
    for (const float sigma : {0.0f, 0.7f, 4.0f})
        for (const float g : {0.0f, 0.2f, 0.5f}) {
            LobeQuery query;
            query.sigma = sigma, query.g = g, query.h = float(h);
            const Contraction contraction = contract(table, query);
            Eigen::VectorXd even =
                (1 + double(sigma)) * (1 - double(g)) * small_column(0) + 2 * (1 + double(g)) * 0.5 * small_column(1);
            const double whole = 2 * exit.integrals().dot(even);
            // Half of 1 / 32767 of the largest coefficient, on each of four axes.
            const double rounding = 4 * 0.5 / greatest_number *
                                    (even.cwiseAbs().maxCoeff() + h * small_column(2).cwiseAbs().maxCoeff()) / whole;
            double integral = 0;
            for (int i = 0; i < steps; ++i) {
                const double phi = -pi + 2 * pi * (i + 0.5) / steps, side = phi < 0 ? -1 : 1;
                const double value = lobe(table, contraction, static_cast<float>(phi));
                const double expected = exit.basis(std::abs(phi)).dot(even + side * h * small_column(2)) / whole;
                CHECK(value == Approx(expected).epsilon(1e-5).margin(rounding));
                integral += value * 2 * pi / steps;
                CHECK(lobe(table, contraction, static_cast<float>(phi + 4 * pi)) == Approx(value).epsilon(1e-4));
            }
            CHECK(integral == Approx(1).epsilon(2e-6));  // float sums; midpoint rule, (2 pi / 2000)^2 / 24 of a slope
            // h < 0 gives the mirror image; h = 0 is symmetric to the last bit.
            CHECK(azimuthal(opened.pack, sigma, g, -0.4f, 1.0f) == azimuthal(opened.pack, sigma, g, 0.4f, -1.0f));
            query.h = 0;
            const Contraction central = contract(table, query);
            const float there = lobe(table, central, 1.0f);
            CHECK(std::abs(lobe(table, central, -1.0f) - there) <=
                  1e-6f * there);  // float rounding of the odd factor, which is 0 at h = 0
        }
    CHECK(azimuthal(opened.pack, 0, 0.2f, 0.1f, 0.3f) == 0);
    CHECK(std::isnan(longitudinal(opened.pack, Side::back, 1, 0.2f, 0.1f, 0.3f)));  // no such table
    CHECK(std::isnan(azimuthal(PackView{}, 1, 0.2f, 0.1f, 0.3f)));
    CHECK(std::isnan(azimuthal(opened.pack, 1, std::nanf(""), 0.1f, 0.3f)));
}

TEST_CASE("Each defect of a pack is refused with its own status", "[pack]") {
    const std::vector<unsigned char> good = small_pack();
    const auto status_after = [&](auto change, bool reseal = true) {
        std::vector<unsigned char> bytes = good;
        change(bytes);
        if (reseal && bytes.size() >= sizeof(PackHeader)) seal(bytes);
        return open_pack(bytes.data(), bytes.size()).status;
    };
    PackHeader header;
    std::memcpy(&header, good.data(), sizeof header);
    const std::size_t table = header.tables_offset, axis = table + offsetof(PackTable, axes);
    CHECK(open_pack(nullptr, 0).status == PackStatus::null_pointer);
    CHECK(status_after([](auto& b) { b.resize(10); }) == PackStatus::too_short);
    CHECK(status_after([](auto& b) { poke(b, 0, 'X'); }) == PackStatus::not_a_pack);
    CHECK(status_after([](auto& b) { poke(b, offsetof(PackHeader, version), 99u); }) == PackStatus::other_version);
    CHECK(status_after([](auto& b) { b.insert(b.end(), 16, 0); }) == PackStatus::wrong_size);
    CHECK(status_after([](auto& b) { poke(b, sizeof(PackHeader), 0x5a5a5a5au); }, false) == PackStatus::wrong_checksum);
    CHECK(status_after([&](auto& b) { poke(b, table + offsetof(PackTable, even_rank), 1000u); }) ==
          PackStatus::bad_table);
    CHECK(status_after([&](auto& b) { poke(b, table + offsetof(PackTable, kind), 7u); }) == PackStatus::bad_table);
    CHECK(status_after([&](auto& b) { poke(b, table + offsetof(PackTable, row_bytes), 36u); }) ==
          PackStatus::bad_table);
    CHECK(status_after([&](auto& b) { poke<std::uint8_t>(b, table + offsetof(PackTable, block_bits), 10); }) ==
          PackStatus::bad_table);
    CHECK(status_after([&](auto& b) { poke<std::uint8_t>(b, table + offsetof(PackTable, block_bits) + 63, 8); }) ==
          PackStatus::bad_table);
    CHECK(status_after([&](auto& b) { poke(b, axis + offsetof(PackAxis, quantity), 6u); }) == PackStatus::bad_axis);
    CHECK(status_after([&](auto& b) { poke(b, axis + offsetof(PackAxis, rows_offset), 0xfffffff0u); }) ==
          PackStatus::out_of_bounds);
    CHECK(status_after([&](auto& b) { poke(b, axis + offsetof(PackAxis, spans), 4000u); }) ==
          PackStatus::out_of_bounds);
    CHECK(status_after([&](auto& b) { poke(b, offsetof(PackHeader, text_bytes), 0x7fffffffu); }) ==
          PackStatus::out_of_bounds);
    PackTable layout;
    std::memcpy(&layout, good.data() + table, sizeof layout);
    CHECK(status_after([&](auto& b) { poke(b, layout.scales_offset, NAN); }) == PackStatus::bad_number);
    CHECK(status_after([&](auto& b) { poke(b, layout.scales_offset, 1e30f); }) == PackStatus::bad_number);
    CHECK(status_after([&](auto& b) { poke(b, layout.axes[0].knots_offset, INFINITY); }) == PackStatus::bad_knots);
    CHECK(status_after([&](auto& b) { poke(b, layout.axes[0].knots_offset + 2 * sizeof(Knot<float>), -5.0f); }) ==
          PackStatus::bad_knots);
    CHECK(status_after([&](auto& b) { poke(b, layout.integrals_offset, 3e5f); }) == PackStatus::bad_number);
    CHECK(status_after([&](auto& b) { poke(b, axis + offsetof(PackAxis, reserved), 1u); }) == PackStatus::bad_reserved);
    CHECK(status_after([](auto& b) { poke(b, offsetof(PackHeader, reserved) + 16, 1u); }) == PackStatus::bad_reserved);
    for (int s = 0; s <= static_cast<int>(PackStatus::big_endian); ++s)
        CHECK(std::string(describe(static_cast<PackStatus>(s))) != "unknown status");
}

TEST_CASE("Axes are refused from where differences of knots, their reciprocals or scales are not normal floats",
          "[pack]") {
    const auto status_of = [](double factor) {
        analytic::TableSpec spec = analytic::azimuthal_table(3);
        for (double& t : spec.axes[0].breakpoints) t *= factor;
        spec.axes[0].factor = [](int, double) { return 1.0; };
        analytic::PackBuilder builder;
        builder.add(spec);
        const std::vector<unsigned char> bytes = builder.bytes();
        const OpenResult opened = open_pack(bytes.data(), bytes.size());
        if (opened.status == PackStatus::ok) {
            CHECK(testing::exercise(opened.pack) == "");
            const AxisView<float> axis = opened.pack[TableKind::azimuthal].axis(0);
            CHECK(std::isfinite(64 / (axis.upper() - axis.lower())));
        }
        return opened.status;
    };
    // 24 spans of the axis are [0, 4]: the shortest is 1/6.
    CHECK(status_of(1) == PackStatus::ok);
    CHECK(status_of(0x1p-97) == PackStatus::ok);
    CHECK(status_of(0x1p97) == PackStatus::ok);
    for (const int power : {-98, -110, -120, -123, -125, -130, 98, 110, 120, 125}) {
        CAPTURE(power);
        CHECK(status_of(std::ldexp(1.0, power)) == PackStatus::bad_knots);
    }
    // One span narrower than the rest, down to denormals.
    for (const double narrow : {1e-31, 1e-37, 1e-38, 1e-40, 1.5e-45}) {
        analytic::TableSpec spec = analytic::azimuthal_table(3);
        spec.axes[0].breakpoints = {0, narrow, 1, 2, 4};
        spec.axes[0].factor = [](int, double) { return 1.0; };
        analytic::PackBuilder builder;
        builder.add(spec);
        const std::vector<unsigned char> bytes = builder.bytes();
        CAPTURE(narrow);
        CHECK(open_pack(bytes.data(), bytes.size()).status == PackStatus::bad_knots);
    }
}

TEST_CASE("Every changed byte of a pack is detected", "[pack]") {
    std::vector<unsigned char> bytes = small_pack();
    std::mt19937 random(5);
    for (int i = 0; i < 20000; ++i) {
        const std::size_t at = random() % bytes.size();
        const auto flip = static_cast<unsigned char>(1u << (random() % 8));
        bytes[at] ^= flip;
        CHECK_FALSE(open_pack(bytes.data(), bytes.size()).status == PackStatus::ok);
        bytes[at] ^= flip;
    }
}

TEST_CASE("Mutated packs with a valid checksum give finite numbers and never read outside their bytes", "[pack]") {
    const std::vector<unsigned char> good = small_pack();
    std::mt19937 random(6);
    int opened_count = 0;
    for (int i = 0; i < 20000; ++i) {
        std::vector<unsigned char> bytes = good;
        for (unsigned n = 1 + random() % 4; n > 0; --n)
            bytes[random() % bytes.size()] = static_cast<unsigned char>(random());
        seal(bytes);
        const OpenResult opened = open_pack(bytes.data(), bytes.size());
        if (opened.status != PackStatus::ok || !opened.pack[TableKind::azimuthal]) continue;  // a pack may be empty
        ++opened_count;
        // Reads stay inside the pack, which the address sanitizer checks.
        CHECK(testing::exercise(opened.pack) == "");
    }
    CHECK(opened_count > 0);
}
