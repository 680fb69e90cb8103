// Slices kept one by one: hashes, shares of workers, shard files and what may be wrong with them, merging.
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "tables/error.hpp"
#include "tables/job/precompute.hpp"
#include "tables/store/file.hpp"
#include "tables/store/merge.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

Request small_request() {
    Request request = default_request();
    request.sigma = graded_axis("sigma", {0, 4, 4});
    request.g = graded_axis("g", {0, 0.6, 3});
    request.h = graded_axis("h", {0, 1, 3});
    request.theta_i = graded_axis("theta_i", {0, 1.2, 2});
    request.bins = 36;
    request.paths = 200;
    request.method = Method::mc;
    return request;
}

struct Folder {
    std::filesystem::path path =
        std::filesystem::temp_directory_path() / ("medulla_shards_" + std::to_string(::getpid()));
    Folder() { std::filesystem::create_directories(path); }
    ~Folder() { std::filesystem::remove_all(path); }
    std::string operator/(const std::string& name) const { return path / name; }
};

JobReport run(const Request& request, const std::string& output, bool resume = false,
              std::optional<Shard> shard = std::nullopt) {
    Job job;
    job.request = request, job.output = output, job.resume = resume, job.shard = shard;
    job.progress = ProgressMode::none;
    return run_job(job);
}

/// Message of the Error that `action` throws; empty where it throws none.
template <class Action>
std::string complaint(Action action) {
    try {
        action();
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("SHA-256 of FIPS 180-4's examples", "[shards]") {
    CHECK(hex(sha256("abc")) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    CHECK(hex(sha256("")) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    Sha256 parts;
    parts.add("a", 1), parts.add("bc", 2);
    CHECK(parts.finish() == sha256("abc"));
}

TEST_CASE("A configuration's hash depends on all that decides bytes, and on nothing else", "[shards]") {
    const Request request = small_request();
    const Digest base = configuration_hash(plan_of(request));
    std::set<Digest> seen = {base};
    const auto differs = [&](auto change) {
        Request other = request;
        change(other);
        CHECK(seen.insert(configuration_hash(plan_of(other))).second);
    };
    differs([](Request& r) { r.seed = 2; });
    differs([](Request& r) { r.paths = 201; });
    differs([](Request& r) { r.bins = 38; });
    differs([](Request& r) { r.method = Method::analog; });
    differs([](Request& r) { r.azimuthal = false; });
    differs([](Request& r) { r.longitudinal = false; });
    differs([](Request& r) { r.sigma.values[1] = std::nextafter(r.sigma.values[1], 9); });
    differs([](Request& r) { r.h.values.pop_back(); });
    differs([](Request& r) { r.theta_i.values[1] = 1.1; });
    Request threads = request;
    threads.threads = 7;
    CHECK(configuration_hash(plan_of(threads)) == base);
}

TEST_CASE("The hash of the contents sees every array and axis", "[shards]") {
    const Tables tables = simulate(small_request(), ProgressMode::none);
    std::set<Digest> seen = {contents_hash(tables)};
    const auto differs = [&](auto change) {
        Tables other = tables;
        change(*other.azimuthal, *other.longitudinal);
        CHECK(seen.insert(contents_hash(other)).second);
    };
    differs([](Table& a, Table&) { a.lobe.back() = std::nextafter(a.lobe.back(), 9.0f); });
    differs([](Table&, Table& l) { l.energy[1] = std::nextafter(l.energy[1], 9.0); });
    differs([](Table& a, Table&) { a.energy_error[2] += 1; });
    differs([](Table& a, Table&) { a.standard_error[2] += 1; });
    differs([](Table&, Table& l) {
        l.mean_length.back() += 1;  // the first one is infinite: sigma is 0
    });
    differs([](Table& a, Table&) { a.axes[2].values[1] += 0.01; });
    // A value moved from the end of one array to the start of the next is another table.
    differs([](Table& a, Table&) {
        a.energy_error.insert(a.energy_error.begin(), a.energy.back());
        a.energy.pop_back();
    });
}

TEST_CASE("The shares of workers are disjoint, complete, and as even as their costliest slice allows", "[shards]") {
    for (const Method method : {Method::automatic, Method::analog}) {
        Request request = default_request();
        request.method = method;
        const std::vector<SliceId> all = slices_of(plan_of(request));
        for (const std::uint32_t count : {1u, 2u, 3u, 7u, 64u, 1000u}) {
            std::map<std::tuple<TableName, std::uint32_t, std::uint32_t>, int> seen;
            std::uint64_t total = 0, greatest = 0, dearest = 0;
            for (std::uint32_t i = 1; i <= count; ++i) {
                std::uint64_t load = 0;
                for (const SliceId& id : share_of(request, all, {i, count})) {
                    ++seen[{id.table, id.sigma, id.g}];
                    load += expected_cost(request, id);
                    dearest = std::max(dearest, expected_cost(request, id));
                }
                total += load, greatest = std::max(greatest, load);
            }
            CHECK(seen.size() == all.size());
            CHECK(std::all_of(seen.begin(), seen.end(), [](const auto& entry) { return entry.second == 1; }));
            // Graham's bound for list scheduling: no load exceeds the mean by more than one job.
            CHECK(greatest <= total / count + dearest + 1);
        }
    }
}

TEST_CASE("Which shard a process is: the words, Slurm's and Open MPI's environment", "[shards]") {
    CHECK(parse_shard("2/3").index == 2);
    CHECK(parse_shard("2/3").count == 3);
    for (const char* wrong : {"0/3", "4/3", "1", "/", "1/", "/2", "1/2/3", "-1/2", "1/0", "a/b", "", "1/99999999999"})
        CHECK_THROWS_AS(parse_shard(wrong), Error);
    using Environment = std::map<std::string, std::string>;
    const auto shard = [](const Environment& variables) {
        return launcher_shard([&](const char* name) -> const char* {
            const auto entry = variables.find(name);
            return entry == variables.end() ? nullptr : entry->second.c_str();
        });
    };
    const auto is = [](const std::optional<Shard>& found, std::uint32_t index, std::uint32_t count) {
        return found && found->index == index && found->count == count;
    };
    CHECK_FALSE(shard({}));
    CHECK(is(shard({{"SLURM_ARRAY_TASK_ID", "0"}, {"SLURM_ARRAY_TASK_COUNT", "4"}, {"SLURM_ARRAY_TASK_MIN", "0"}}), 1,
             4));
    CHECK(is(shard({{"SLURM_ARRAY_TASK_ID", "4"}, {"SLURM_ARRAY_TASK_COUNT", "4"}, {"SLURM_ARRAY_TASK_MIN", "1"}}), 4,
             4));
    CHECK(is(shard({{"SLURM_ARRAY_TASK_ID", "14"},
                    {"SLURM_ARRAY_TASK_COUNT", "3"},
                    {"SLURM_ARRAY_TASK_MIN", "10"},
                    {"SLURM_ARRAY_TASK_STEP", "2"}}),
             3, 3));
    CHECK(is(shard({{"OMPI_COMM_WORLD_RANK", "0"}, {"OMPI_COMM_WORLD_SIZE", "2"}}), 1, 2));
    CHECK(is(shard({{"SLURM_ARRAY_TASK_ID", "2"},
                    {"SLURM_ARRAY_TASK_COUNT", "3"},
                    {"SLURM_ARRAY_TASK_MIN", "1"},
                    {"OMPI_COMM_WORLD_RANK", "1"},
                    {"OMPI_COMM_WORLD_SIZE", "4"}}),
             6, 12));
    CHECK_THROWS_AS(shard({{"SLURM_ARRAY_TASK_ID", "1"}}), Error);
    CHECK_THROWS_AS(
        shard({{"SLURM_ARRAY_TASK_ID", "9"}, {"SLURM_ARRAY_TASK_COUNT", "3"}, {"SLURM_ARRAY_TASK_MIN", "1"}}), Error);
    CHECK_THROWS_AS(shard({{"OMPI_COMM_WORLD_RANK", "2"}, {"OMPI_COMM_WORLD_SIZE", "2"}}), Error);
    CHECK_THROWS_AS(shard({{"OMPI_COMM_WORLD_RANK", "x"}, {"OMPI_COMM_WORLD_SIZE", "2"}}), Error);
}

TEST_CASE("A shard gives back what was written, and any flipped byte, cut or swap is damage", "[shards]") {
    const Folder folder;
    const SliceSolver solver(small_request());
    ShardFolder shards(folder / "t.h5.shards", solver.plan());
    shards.open(true);
    const SliceId id = {TableName::longitudinal, 2, 1};
    const Slice slice = solver.solve(id);
    shards.write(id, slice);
    std::string why;
    const std::optional<Slice> read = shards.read(id, why);
    REQUIRE(read);
    CHECK(why.empty());
    CHECK(read->lobe == slice.lobe);
    CHECK(std::memcmp(read->mean_length.data(), slice.mean_length.data(), slice.cells * sizeof(double)) == 0);
    CHECK(read->energy == slice.energy);

    const std::string file = shards.file_of(id);
    const std::vector<unsigned char> good = read_file(file);
    for (std::size_t i = 0; i < good.size(); ++i) {
        std::vector<unsigned char> bytes = good;
        bytes[i] ^= static_cast<unsigned char>(1u << (i % 8));
        write_file(file, bytes.data(), bytes.size());
        CHECK_FALSE(shards.read(id, why));
        CHECK_FALSE(why.empty());
    }
    for (std::size_t size = 0; size < good.size(); size += 1 + size / 3) {
        write_file(file, good.data(), size);
        CHECK_FALSE(shards.read(id, why));
    }
    const SliceId other = {TableName::longitudinal, 2, 2};
    write_file(shards.file_of(other), good.data(), good.size());  // whole, but not what its name says
    CHECK_FALSE(shards.read(other, why));
    write_file(file, good.data(), good.size());
    CHECK(shards.kept({id, other, {TableName::azimuthal, 0, 0}}) == std::vector<bool>{true, false, false});

    Request seed = small_request();
    seed.seed = 2;
    const Tables another = plan_of(seed);
    const ShardFolder foreign(folder / "t.h5.shards", another);
    const std::string text = complaint([&] { (void)foreign.read(id, why); });
    CHECK(contains(text, file));
    CHECK(contains(text, hex(configuration_hash(another))));
    CHECK(contains(text, hex(configuration_hash(solver.plan()))));
    CHECK(configuration_hash(read_configuration(shards.path())) == configuration_hash(solver.plan()));
    ShardFolder second(folder / "t.h5.shards", solver.plan());
    CHECK(contains(complaint([&] { second.open(false); }), "at work"));
}

TEST_CASE("A job leaves its file alone, and a stopped one goes on from its shards", "[shards]") {
    const Folder folder;
    const Request request = small_request();
    const std::string output = folder / "t.h5", shards = output + ".shards";
    const Tables expected = simulate(request, ProgressMode::none);
    CHECK(contents_hash(run(request, output).tables) == contents_hash(expected));
    CHECK_FALSE(std::filesystem::exists(shards));
    const std::vector<unsigned char> bytes = read_file(output);
    CHECK(run(request, output, true).was_complete);

    Request other = request;
    other.seed = 3;
    CHECK(contains(complaint([&] { run(other, output, true); }), output + ": expected configuration "));
    std::filesystem::remove(output);

    run(request, output, false, Shard{1, 2});  // what a stopped run would have left: about half
    CHECK(contains(complaint([&] { run(request, output); }), "--resume"));
    CHECK(contains(complaint([&] { run(other, output, true); }), "expected configuration"));
    const SliceId first = share_of(request, slices_of(plan_of(request)), {1, 2}).front();
    const Tables plan = plan_of(request);
    const std::string file = ShardFolder(shards, plan).file_of(first);
    std::vector<unsigned char> damaged = read_file(file);
    damaged[damaged.size() / 2] ^= 1;
    write_file(file, damaged.data(), damaged.size());
    write_file(shards + "/azimuthal-s0000-g0000.shard.tmp-elsewhere-1-0", std::string("left by a killed run"));
    const JobReport report = run(request, output, true);
    CHECK(report.kept > 0);
    CHECK(report.kept < report.slices);
    CHECK(read_file(output) == bytes);
    CHECK_FALSE(std::filesystem::exists(shards));
}

TEST_CASE("Workers' shards and parts of the axes merge to what one process makes", "[shards]") {
    const Folder folder;
    const Request request = small_request();
    const std::string whole = hex(contents_hash(simulate(request, ProgressMode::none)));
    for (const std::uint32_t count : {1u, 2u, 4u}) {
        const std::string output = folder / ("n" + std::to_string(count) + ".h5");
        for (std::uint32_t i = 1; i <= count; ++i) run(request, output, false, Shard{i, count});
        CHECK(hex(contents_hash(merge({output + ".shards"}))) == whole);
        CHECK(hex(contents_hash(merge({output}))) == whole);  // named by the output it belongs to
        write_tables(output, merge({output}), Compression::zstd);
        CHECK(hex(contents_hash(merge({output}))) == whole);
    }
    // Folders of their own, one slice twice.
    run(request, folder / "a.h5", false, Shard{1, 2});
    run(request, folder / "b.h5", false, Shard{2, 2});
    CHECK(hex(contents_hash(merge({folder / "a.h5", folder / "b.h5", folder / "a.h5.shards"}))) == whole);
    CHECK(contains(complaint([&] { merge({folder / "a.h5"}); }), "missing"));
    // Tables files of parts of the axes.
    Request low = request, high = request;
    low.g.values.pop_back();
    high.g.values = {request.g.values.back()};
    run(low, folder / "low.h5"), run(high, folder / "high.h5");
    const Tables both = merge({folder / "high.h5", folder / "low.h5"});
    CHECK(hex(contents_hash(both)) == whole);
    CHECK(configuration_hash(both) == configuration_hash(plan_of(request)));
    Request seed = high;
    seed.seed = 9;
    run(seed, folder / "seed.h5");
    CHECK(contains(complaint([&] { merge({folder / "low.h5", folder / "seed.h5"}); }), "seed"));
    Tables twisted = read_tables(folder / "high.h5");
    twisted.azimuthal->mean_length[0] += 1e-9;
    write_tables(folder / "twisted.h5", twisted, Compression::zstd);
    CHECK(contains(complaint([&] { merge({folder / "high.h5", folder / "twisted.h5"}); }), "different values"));
}
