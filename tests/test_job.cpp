// Jobs: hashes, worker shares, slice files and their defects, resuming, merging.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "tables/error.hpp"
#include "tables/job/launcher.hpp"
#include "tables/job/precompute.hpp"
#include "tables/store/file.hpp"
#include "tables/store/job_difference.hpp"
#include "tables/store/merge.hpp"
#include "tests/support/small_request.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace medulla;
using namespace medulla::tables;

namespace {

Request small_request() { return test::small_request(Method::mc, {4, 3, 3, 2}, 36, 200); }

JobReport run(const Request& request, const std::string& output, bool resume = false,
              std::optional<WorkerShare> share = std::nullopt) {
    Job job;
    job.request = request, job.output = output, job.resume = resume, job.share = share;
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

TEST_CASE("SHA-256 of FIPS 180-4's examples", "[job]") {
    CHECK(hex(sha256("abc")) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    CHECK(hex(sha256("")) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    Sha256 parts;
    parts.add("a", 1), parts.add("bc", 2);
    CHECK(parts.finish() == sha256("abc"));
}

TEST_CASE("The configuration hash depends on everything that decides bytes, and on nothing else", "[job]") {
    const Request request = small_request();
    const Digest base = configuration_hash(plan_of(request));
    std::set<Digest> seen = {base};
    const auto differs = [&](auto change) {
        Request other = request;
        change(other);
        CHECK(seen.insert(configuration_hash(plan_of(other))).second);
        CHECK_FALSE(job_difference(plan_of(request), plan_of(other)).empty());  // and an option says why
    };
    CHECK(job_difference(plan_of(request), plan_of(request)).empty());
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

TEST_CASE("The contents hash depends on every array and axis", "[job]") {
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
    // Moving a value from the end of one array to the start of the next changes the hash.
    differs([](Table& a, Table&) {
        a.energy_error.insert(a.energy_error.begin(), a.energy.back());
        a.energy.pop_back();
    });
}

TEST_CASE("Worker shares are disjoint, complete, and as balanced as the costliest slice allows", "[job]") {
    for (const Method method : {Method::automatic, Method::analog}) {
        Request request = default_request();
        request.method = method;
        const std::vector<SliceId> all = slices_of(plan_of(request));
        for (const std::uint32_t count : {1u, 2u, 3u, 7u, 64u, 1000u}) {
            std::map<std::tuple<TableId, std::uint32_t, std::uint32_t>, int> seen;
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

TEST_CASE("Worker share of a process: from its option, and from the environment of launchers", "[job]") {
    CHECK(parse_worker_share("2/3").index == 2);
    CHECK(parse_worker_share("2/3").count == 3);
    for (const char* wrong : {"0/3", "4/3", "1", "/", "1/", "/2", "1/2/3", "-1/2", "1/0", "a/b", "", "1/99999999999"})
        CHECK_THROWS_AS(parse_worker_share(wrong), Error);
    using Environment = std::map<std::string, std::string>;
    const auto share = [](const Environment& variables) {
        return launched([&](const char* name) -> const char* {
            const auto entry = variables.find(name);
            return entry == variables.end() ? nullptr : entry->second.c_str();
        });
    };
    const auto is = [](const std::optional<Launched>& found, std::uint32_t index, std::uint32_t count) {
        return found && found->share.index == index && found->share.count == count && !found->from.empty();
    };
    CHECK_FALSE(share({}));
    CHECK(is(share({{"SLURM_ARRAY_TASK_ID", "0"}, {"SLURM_ARRAY_TASK_COUNT", "4"}, {"SLURM_ARRAY_TASK_MIN", "0"}}), 1,
             4));
    CHECK(is(share({{"SLURM_ARRAY_TASK_ID", "4"}, {"SLURM_ARRAY_TASK_COUNT", "4"}, {"SLURM_ARRAY_TASK_MIN", "1"}}), 4,
             4));
    CHECK(is(share({{"SLURM_ARRAY_TASK_ID", "14"},
                    {"SLURM_ARRAY_TASK_COUNT", "3"},
                    {"SLURM_ARRAY_TASK_MIN", "10"},
                    {"SLURM_ARRAY_TASK_STEP", "2"}}),
             3, 3));
    CHECK(is(share({{"OMPI_COMM_WORLD_RANK", "0"}, {"OMPI_COMM_WORLD_SIZE", "2"}}), 1, 2));
    CHECK(is(share({{"SLURM_ARRAY_TASK_ID", "2"},
                    {"SLURM_ARRAY_TASK_COUNT", "3"},
                    {"SLURM_ARRAY_TASK_MIN", "1"},
                    {"OMPI_COMM_WORLD_RANK", "1"},
                    {"OMPI_COMM_WORLD_SIZE", "4"}}),
             6, 12));
    // A step within an array; an mpirun within a step, whose helpers are Slurm's ranks.
    CHECK(is(share({{"SLURM_JOB_ID", "5"},
                    {"SLURM_ARRAY_TASK_ID", "2"},
                    {"SLURM_ARRAY_TASK_COUNT", "3"},
                    {"SLURM_ARRAY_TASK_MIN", "1"},
                    {"SLURM_STEP_ID", "0"},
                    {"SLURM_PROCID", "0"},
                    {"SLURM_STEP_NUM_TASKS", "2"}}),
             3, 6));
    CHECK(is(share({{"SLURM_STEP_ID", "0"},
                    {"SLURM_PROCID", "1"},
                    {"SLURM_NTASKS", "2"},
                    {"PMI_RANK", "5"},
                    {"PMI_SIZE", "8"}}),
             6, 8));
    // One process alone makes the whole table: also a batch script, which has a SLURM_PROCID.
    CHECK_FALSE(share({{"PMI_RANK", "0"}, {"PMI_SIZE", "1"}}));
    CHECK_FALSE(share({{"SLURM_JOB_ID", "5"}, {"SLURM_PROCID", "0"}, {"SLURM_NTASKS", "16"}}));
    CHECK_THROWS_AS(share({{"PMIX_RANK", "0"}}), Error);
    CHECK_THROWS_AS(share({{"SLURM_ARRAY_TASK_ID", "1"}}), Error);
    CHECK_THROWS_AS(
        share({{"SLURM_ARRAY_TASK_ID", "9"}, {"SLURM_ARRAY_TASK_COUNT", "3"}, {"SLURM_ARRAY_TASK_MIN", "1"}}), Error);
    CHECK_THROWS_AS(share({{"OMPI_COMM_WORLD_RANK", "2"}, {"OMPI_COMM_WORLD_SIZE", "2"}}), Error);
    CHECK_THROWS_AS(share({{"OMPI_COMM_WORLD_RANK", "x"}, {"OMPI_COMM_WORLD_SIZE", "2"}}), Error);
}

TEST_CASE("A slice file returns what was written, and any changed byte, truncation or swap is detected", "[job]") {
    const test::TemporaryFolder folder;
    const SliceSolver solver(small_request());
    SliceFolder slices(folder / "t.h5.shards", solver.plan());
    slices.open(true);
    const SliceId id = {TableId::longitudinal, 2, 1};
    const Slice slice = solver.solve(id);
    slices.write(id, slice);
    std::string why;
    const std::optional<Slice> read = slices.read(id, why);
    REQUIRE(read);
    CHECK(why.empty());
    CHECK(read->lobe == slice.lobe);
    CHECK(std::memcmp(read->mean_length.data(), slice.mean_length.data(), slice.cells * sizeof(double)) == 0);
    CHECK(read->energy == slice.energy);

    const std::string file = slices.file_of(id);
    const std::vector<unsigned char> good = read_file(file);
    for (std::size_t i = 0; i < good.size(); ++i) {
        std::vector<unsigned char> bytes = good;
        bytes[i] ^= static_cast<unsigned char>(1u << (i % 8));
        write_file(file, bytes.data(), bytes.size());
        CHECK_FALSE(slices.read(id, why));
        CHECK_FALSE(why.empty());
    }
    for (std::size_t size = 0; size < good.size(); size += 1 + size / 3) {
        write_file(file, good.data(), size);
        CHECK_FALSE(slices.read(id, why));
    }
    const SliceId other = {TableId::longitudinal, 2, 2};
    write_file(slices.file_of(other), good.data(), good.size());  // valid, but of another slice than its name says
    CHECK_FALSE(slices.read(other, why));
    write_file(file, good.data(), good.size());
    CHECK(slices.kept({id, other, {TableId::azimuthal, 0, 0}}) == std::vector<bool>{true, false, false});

    Request seed = small_request();
    seed.seed = 2;
    const Tables another = plan_of(seed);
    const SliceFolder foreign(folder / "t.h5.shards", another);
    const std::string text = complaint([&] { (void)foreign.read(id, why); });
    CHECK(contains(text, file));
    CHECK(contains(text, fmt::format("--seed: expected {}, found {}", seed.seed, small_request().seed)));
    CHECK(configuration_hash(read_configuration(slices.path())) == configuration_hash(solver.plan()));
    SliceFolder second(folder / "t.h5.shards", solver.plan());
    CHECK(contains(complaint([&] { second.open(false); }), "at work"));
}

TEST_CASE("A job leaves only its file, and an interrupted one resumes from its slice files", "[job]") {
    const test::TemporaryFolder folder;
    const Request request = small_request();
    const std::string output = folder / "t.h5", shards = output + ".shards";
    const Tables expected = simulate(request, ProgressMode::none);
    CHECK(contents_hash(run(request, output).tables) == contents_hash(expected));
    CHECK_FALSE(std::filesystem::exists(shards));
    const std::vector<unsigned char> bytes = read_file(output);
    CHECK(run(request, output, true).was_complete);

    Request other = request;
    other.seed = 3;
    CHECK(contains(complaint([&] { run(other, output, true); }),
                   output + ": it belongs to another job: --seed: expected 3"));
    std::filesystem::remove(output);

    run(request, output, false, WorkerShare{1, 2});  // as an interrupted run would leave it: about half
    CHECK(contains(complaint([&] { run(request, output); }), "--resume"));
    CHECK(contains(complaint([&] { run(other, output, true); }), "another job: --seed: expected 3"));
    const SliceId first = share_of(request, slices_of(plan_of(request)), {1, 2}).front();
    const Tables plan = plan_of(request);
    const std::string file = SliceFolder(shards, plan).file_of(first);
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

TEST_CASE("Slice files of workers and tables of parts of the axes merge to the result of one process", "[job]") {
    const test::TemporaryFolder folder;
    const Request request = small_request();
    const std::string whole = hex(contents_hash(simulate(request, ProgressMode::none)));
    for (const std::uint32_t count : {1u, 2u, 4u}) {
        const std::string output = folder / ("n" + std::to_string(count) + ".h5");
        for (std::uint32_t i = 1; i <= count; ++i) run(request, output, false, WorkerShare{i, count});
        CHECK(hex(contents_hash(merge({output + ".shards"}))) == whole);
        CHECK(hex(contents_hash(merge({output}))) == whole);  // named by its output
        write_tables(output, merge({output}), Compression::zstd);
        CHECK(hex(contents_hash(merge({output}))) == whole);
    }
    // Separate folders, with some slices given twice.
    run(request, folder / "a.h5", false, WorkerShare{1, 2});
    run(request, folder / "b.h5", false, WorkerShare{2, 2});
    CHECK(hex(contents_hash(merge({folder / "a.h5", folder / "b.h5", folder / "a.h5.shards"}))) == whole);
    CHECK(contains(complaint([&] { merge({folder / "a.h5"}); }), "missing"));
    // Tables files that cover parts of the axes.
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
