// Baking: the validator, mutated bytes, files and their bad input, factors with mirror images.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <random>

#include "tables/bake/baked_file.hpp"
#include "tables/bake/fibre_file.hpp"
#include "tables/error.hpp"
#include "tables/store/file.hpp"
#include "tensor/mirrored.hpp"
#include "tests/support/exercise_pack.hpp"
#include "tests/support/small_bake.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace medulla;
using namespace medulla::tables;
using Catch::Matchers::Contains;

namespace {

using Bytes = std::vector<unsigned char>;

/// With the checksum that belongs to the bytes, so that the checks behind it are reached.
Bytes sealed(Bytes bytes) {
    const std::uint64_t count = bytes.size();
    std::memcpy(bytes.data() + offsetof(BakedHeader, byte_count), &count, sizeof count);
    const std::uint64_t sum = pack_checksum(bytes.data(), bytes.size());
    std::memcpy(bytes.data() + offsetof(BakedHeader, checksum), &sum, sizeof sum);
    return bytes;
}
template <class Change>
BakedStatus status_with(Change&& change) {
    Bytes bytes = test::baked_preset("red_fox");
    BakedHeader header;
    std::memcpy(&header, bytes.data(), sizeof header);
    change(header);
    std::memcpy(bytes.data(), &header, sizeof header);
    bytes = sealed(bytes);
    return open_baked(bytes.data(), bytes.size()).status;
}

/// Everything that a renderer does with it.
const char* exercise(const BakedMaterial& material) {
    for (const float sigma : {0.0f, 0.3f, 50.0f}) {
        const float colour[1] = {sigma};
        const BakedFibre<1> fibre = make_fibre(material, colour);
        for (const float theta : {0.0f, -1.2f, 1.5707f}) {
            for (const float h : {0.0f, 0.7f, -1.0f})
                if (const char* wrong = testing::detail::exercise_field(near_field(fibre, Angles{theta, 0}, h)))
                    return wrong;
            if (const char* wrong = testing::detail::exercise_field(far_field(fibre, Angles{theta, 0}))) return wrong;
        }
    }
    return nullptr;
}

}  // namespace

TEST_CASE("baked material, every status of the validator", "[baked]") {
    const Bytes& good = test::baked_preset("red_fox");
    CHECK(open_baked(nullptr, 5).status == BakedStatus::null_pointer);
    CHECK(open_baked(good.data(), 8).status == BakedStatus::too_short);
    CHECK(open_baked(good.data(), 100).status == BakedStatus::too_short);
    CHECK(open_baked(good.data(), good.size() - 1).status == BakedStatus::wrong_size);
    Bytes bytes = good;
    bytes.back() ^= 1;
    CHECK(open_baked(bytes.data(), bytes.size()).status == BakedStatus::wrong_checksum);
    const auto changed = [](auto&& change) { return status_with(change); };
    CHECK(changed([](BakedHeader&) {}) == BakedStatus::ok);
    CHECK(changed([](BakedHeader& h) { h.magic[0] = 'X'; }) == BakedStatus::not_baked);
    CHECK(changed([](BakedHeader& h) { h.version = 2; }) == BakedStatus::other_version);
    CHECK(changed([](BakedHeader& h) { h.functions = 9; }) == BakedStatus::bad_size);
    CHECK(changed([](BakedHeader& h) { h.functions = 1u << 31; }) == BakedStatus::bad_size);
    CHECK(changed([](BakedHeader& h) { h.rows = 0; }) == BakedStatus::bad_size);
    CHECK(changed([](BakedHeader& h) { h.inclinations = 256; }) == BakedStatus::out_of_bounds);
    CHECK(changed([](BakedHeader& h) { h.cells_offset = 0xfffffff0u; }) == BakedStatus::out_of_bounds);
    CHECK(changed([](BakedHeader& h) { h.text_bytes = 0xffffffffu; }) == BakedStatus::out_of_bounds);
    CHECK(changed([](BakedHeader& h) { h.turn = NAN; }) == BakedStatus::bad_number);
    CHECK(changed([](BakedHeader& h) { h.sigma[2] = h.sigma[1]; }) == BakedStatus::bad_number);
    CHECK(changed([](BakedHeader& h) { h.sigma[0] = 0.1f; }) == BakedStatus::bad_number);
    CHECK(changed([](BakedHeader& h) { h.eta = 0.5f; }) == BakedStatus::bad_material);
    CHECK(changed([](BakedHeader& h) { h.g = NAN; }) == BakedStatus::bad_material);
    CHECK(changed([](BakedHeader& h) { h.reserved[1] = 1; }) == BakedStatus::bad_reserved);
    CHECK(changed([](BakedHeader& h) { h.bytes_offset += 1; }) == BakedStatus::bad_sum);
    CHECK(changed([](BakedHeader& h) { h.scales_offset = h.text_offset; }) != BakedStatus::ok);
}

TEST_CASE("baked material, mutated bytes are refused or harmless", "[baked]") {
    const Bytes& good = test::baked_preset("red_fox");
    std::mt19937_64 random(5);
    int opened = 0, refused = 0;
    for (int i = 0; i < 3000; ++i) {
        Bytes bytes = good;
        const std::size_t changes = 1 + random() % 3;
        for (std::size_t c = 0; c < changes; ++c) {
            // Every second change within the header.
            const std::size_t reach = random() % 2 ? sizeof(BakedHeader) : bytes.size();
            const std::size_t at = random() % reach;
            if (random() % 3 == 0 && at + 4 <= bytes.size()) {
                const std::uint32_t word = random() % 2 ? 0x7f7fffffu : static_cast<std::uint32_t>(random());
                std::memcpy(bytes.data() + at, &word, 4);
            } else {
                bytes[at] = static_cast<unsigned char>(random());
            }
        }
        if (random() % 20 == 0) bytes.resize(sizeof(BakedHeader) + random() % bytes.size());
        bytes = sealed(bytes);
        const BakedResult result = open_baked(bytes.data(), bytes.size());
        if (result.status != BakedStatus::ok) {
            ++refused;
            continue;
        }
        ++opened;
        const char* wrong = exercise(result.material);
        CHECK(wrong == nullptr);
        if (wrong != nullptr) return;
    }
    CHECK(opened > 100);  // bytes of functions and coefficients may be anything
    CHECK(refused > 500);
}

TEST_CASE("light of a fibre, file and back, damage and other kinds of file", "[baked]") {
    const test::TemporaryFolder folder;
    const std::string path = folder / "fox.h5";
    FibreRequest request = test::small_fibre("red_fox");
    request.paths = 200, request.check_paths = 200;
    const FibreLight light = test::simulated(request);
    write_fibre(Output(path), light, Compression::zstd);
    CHECK(is_fibre_file(path));
    const FibreLight again = read_fibre(path);
    REQUIRE(again.cells.size() == light.cells.size());
    CHECK(again.request.material.fur.beta_n == light.request.material.fur.beta_n);
    for (std::size_t i = 0; i < light.cells.size(); ++i) {
        CHECK(again.cells[i].density == light.cells[i].density);
        CHECK(again.cells[i].R == light.cells[i].R);
    }
    // Any thread count gives the same bytes.
    CHECK(simulate_cell(light, 3).density == light.cells[3].density);
    const Bytes bytes = read_file(path);
    int found = 0;
    for (std::size_t at = 100; at < bytes.size(); at += bytes.size() / 50) {
        Bytes damaged = bytes;
        damaged[at] ^= 0x10;
        write_file(path, damaged.data(), damaged.size());
        try {
            const FibreLight other = read_fibre(path);  // a byte that HDF5 does not use
            bool same = other.request.seed == light.request.seed;
            for (std::size_t i = 0; i < light.cells.size(); ++i)
                same = same && other.cells[i].density == light.cells[i].density;
            CHECK(same);
        } catch (const Error&) {
            ++found;
        }
    }
    CHECK(found > 10);
    write_file(path, "neither HDF5 nor a pack");
    CHECK_THROWS_WITH(read_fibre(path), Contains("expected the light of a fibre (HDF5)"));
    CHECK_THROWS_WITH(read_baked(path), Contains("does not begin with FURBAKE"));
}

TEST_CASE("light of a fibre, partial results", "[baked]") {
    const test::TemporaryFolder folder;
    FibreRequest request = test::small_fibre("red_fox");
    request.paths = 100, request.check_paths = 100;
    const FibreLight light = test::simulated(request);
    const PartialFibre partial(folder / "a.h5", light);
    std::vector<std::optional<LightCell>> cells(light.cells.size() + light.checks.size()), read(cells.size());
    cells[2] = light.cells[2], cells.back() = light.checks.back();
    partial.write(cells);
    partial.read(read);
    CHECK(!read[0].has_value());
    REQUIRE(read[2].has_value());
    CHECK(read[2]->density == cells[2]->density);
    CHECK(read.back()->error == cells.back()->error);
    request.paths = 101;
    const PartialFibre other(folder / "a.h5", plan_of(request));
    CHECK_THROWS_WITH(other.read(read), Contains("paths: expected 101, found 100"));
    Bytes bytes = read_file(partial.path());
    bytes[bytes.size() / 2] ^= 1;
    write_file(partial.path(), bytes.data(), bytes.size());
    std::vector<std::optional<LightCell>> none(cells.size());
    partial.read(none);  // damaged: all again
    for (const auto& cell : none) CHECK(!cell.has_value());
    partial.remove();
    CHECK(!partial.exists());
}

TEST_CASE("materials that cannot be baked are refused by field", "[baked]") {
    FibreRequest request = test::small_fibre("red_fox");
    const auto refusal = [&](auto&& change) {
        FibreRequest bad = request;
        change(bad.material.fur);
        try {
            check_fibre_request(bad, "fox.json");
        } catch (const Error& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    using Fur = FurParameters<3>;
    CHECK_THAT(refusal([](Fur& p) { p.kappa = 0; }), Contains("fox.json: /kappa: expected a medulla"));
    CHECK_THAT(refusal([](Fur& p) { p.sigma_ms = 0; }), Contains("/sigma_ms"));
    CHECK_THAT(refusal([](Fur& p) { p.alpha = 1.4f; }), Contains("/alpha: expected degrees"));
    CHECK_THAT(refusal([](Fur& p) { p.sigma_ca[1] = 7; }), Contains("/sigma_ca: expected values of at most 6"));
    CHECK(refusal([](Fur&) {}).empty());
}

TEST_CASE("factors with mirror images: exact for a matrix that has them", "[baked]") {
    // X = C [B; mirror B] of rank 3 with columns mirrored end to end.
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    tensor::RowMatrix B(3, 20), C(60, 6);
    for (Eigen::Index i = 0; i < B.size(); ++i) B.data()[i] = std::pow(uniform(random), 4);
    for (Eigen::Index i = 0; i < C.size(); ++i) C.data()[i] = uniform(random) < 0.4 ? 0 : uniform(random);
    std::vector<Eigen::Index> mirror(20);
    for (std::size_t j = 0; j < mirror.size(); ++j) mirror[j] = 19 - static_cast<Eigen::Index>(j);
    const tensor::RowMatrix X = C * tensor::with_mirrored(B, mirror);
    tensor::MirroredOptions options;
    options.rank = 3, options.sweeps = 5000, options.tolerance = 1e-7;
    const tensor::MirroredResult found = tensor::mirrored_factors(X, mirror, options);
    CHECK(found.error < 0.02);
    CHECK(found.B.minCoeff() >= 0);
    const tensor::RowMatrix F = tensor::with_mirrored(found.B, mirror),
                            fitted = tensor::nonnegative_coefficients(X, F, 2000);
    CHECK(fitted.minCoeff() >= 0);
    CHECK((X - fitted * F).norm() <= 1.01 * found.error * X.norm() + 1e-9 * X.norm());
}
