// mutate tables|pack COUNT [SEED]: reads COUNT mutated files. Counts crashes, hangs, undetected changes (the file opens
// and a value differs), allocations above the limit and numbers that are not finite; all counts must be 0. Tables are
// read in subprocesses.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <string>

#include "medulla/medulla.hpp"
#include "tables/error.hpp"
#include "tables/job/simulate.hpp"
#include "tables/pack/compress.hpp"
#include "tables/pack/writer.hpp"
#include "tables/store/file.hpp"
#include "tables/store/tables_file.hpp"
#include "tests/support/small_request.hpp"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define MEDULLA_WATCH 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define MEDULLA_WATCH 0
#endif
#endif
#ifndef MEDULLA_WATCH
#define MEDULLA_WATCH 1
#endif

// Sees every allocation of the process and its libraries: glibc allows programs to replace malloc.
namespace {
std::size_t greatest_request = 0;
void see(std::size_t size) {
    if (size > greatest_request) greatest_request = size;
}
}  // namespace
#if MEDULLA_WATCH
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* malloc(std::size_t size) { return see(size), __libc_malloc(size); }
void* calloc(std::size_t n, std::size_t size) { return see(n * size), __libc_calloc(n, size); }
void* realloc(void* old, std::size_t size) { return see(size), __libc_realloc(old, size); }
}
#endif

namespace {

using namespace medulla;
using namespace medulla::tables;
using Bytes = std::vector<unsigned char>;
using Random = std::mt19937_64;

// HDF5 always allocates 1 MiB for its chunk cache and page buffers; the files here are far smaller.
constexpr std::size_t allowed_request = std::size_t{64} << 20;
constexpr int seconds_of_a_hang = 20;

std::size_t below(Random& random, std::size_t n) { return static_cast<std::size_t>(random() % n); }

/// One kind of damage: bits, bytes, numbers, blocks, truncation, growth; up to four at once.
Bytes mutate(const Bytes& good, Random& random) {
    Bytes bytes = good;
    const std::size_t changes = 1 + (random() % 4 == 0 ? below(random, 4) : 0);
    for (std::size_t change = 0; change < changes && !bytes.empty(); ++change) {
        // Structure is near the start and a small part of the file: every second change is made there.
        const std::size_t reach = random() % 2 ? bytes.size() : std::min<std::size_t>(bytes.size(), 4096);
        const std::size_t at = below(random, reach), room = bytes.size() - at;
        const auto put = [&](std::uint64_t value, std::size_t size) {
            std::memcpy(bytes.data() + at, &value, std::min(size, room));
        };
        switch (random() % 10) {
            case 0:
            case 1:
                bytes[at] ^= static_cast<unsigned char>(1u << (random() % 8));
                break;
            case 2:
                bytes[at] = static_cast<unsigned char>(random());
                break;
            case 3:
                put(random(), std::size_t{1} << (random() % 4));
                break;
            case 4: {
                static constexpr std::uint64_t telling[] = {0,
                                                            1,
                                                            0x7f,
                                                            0x80,
                                                            0xff,
                                                            0x7fff,
                                                            0xffff,
                                                            0x7fffffff,
                                                            0x80000000,
                                                            0xffffffff,
                                                            0x7fffffffffffffff,
                                                            0x8000000000000000,
                                                            ~0ull};
                put(telling[random() % std::size(telling)], std::size_t{1} << (random() % 4));
                break;
            }
            case 5: {
                const std::size_t n = 1 + below(random, std::min<std::size_t>(room, 512));
                std::fill_n(bytes.begin() + at, n, random() % 2 ? 0 : 0xff);
                break;
            }
            case 6: {
                const std::size_t n = 1 + below(random, std::min<std::size_t>(room, 512));
                std::copy_n(good.begin() + below(random, good.size() - std::min(n, good.size() - 1)),
                            std::min(n, good.size() / 2), bytes.begin() + at - (at + n > bytes.size() ? n : 0));
                break;
            }
            case 7:
                bytes.resize(at);
                break;
            case 8:
                bytes.insert(bytes.begin() + at, 1 + below(random, 64), static_cast<unsigned char>(random()));
                break;
            default:
                bytes.erase(bytes.begin() + at,
                            bytes.begin() + at + 1 + below(random, std::min<std::size_t>(room, 64)));
        }
    }
    return bytes;
}

struct Counts {
    std::uint64_t read = 0, unchanged = 0, refused = 0, same = 0, silent = 0, crashed = 0, hung = 0, greedy = 0,
                  wild = 0;

    bool clean() const { return silent + crashed + hung + greedy + wild == 0; }
    void print(const char* what) const {
        fmt::print(
            "{}: {} mutated ({} came out unchanged), {} refused, {} read as what was written; {} silent "
            "differences, {} crashes, {} hangs, {} greedy, {} not finite\n",
            what, read, unchanged, refused, same, silent, crashed, hung, greedy, wild);
        std::fflush(stdout);
    }
};

// --- tables ------------------------------------------------------------------------------------------------------

template <class T>
bool equal(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

bool equal(const std::optional<Table>& a, const std::optional<Table>& b) {
    if (!a || !b) return !a && !b;
    if (a->axes.size() != b->axes.size() || a->method != b->method || a->seed != b->seed || a->paths != b->paths)
        return false;
    for (std::size_t k = 0; k < a->axes.size(); ++k)
        if (a->axes[k].name != b->axes[k].name || !equal(a->axes[k].values, b->axes[k].values)) return false;
    return equal(a->lobe, b->lobe) && equal(a->energy, b->energy) && equal(a->energy_error, b->energy_error) &&
           equal(a->standard_error, b->standard_error) && equal(a->mean_length, b->mean_length);
}

enum class Verdict : unsigned char { unchanged, refused, same, silent, greedy };

Verdict judge(const std::string& path, const Bytes& good, const Bytes& bytes, const Tables& expected) {
    if (bytes == good) return Verdict::unchanged;
    greatest_request = 0;
    bool same = true, refused = false;
    try {
        const Tables read = read_tables(path);
        same = equal(read.azimuthal, expected.azimuthal) && equal(read.longitudinal, expected.longitudinal);
    } catch (const Error&) {
        refused = true;
    }
    if (greatest_request > allowed_request) return Verdict::greedy;
    return refused ? Verdict::refused : same ? Verdict::same : Verdict::silent;
}

/// The mutation of number `i`, independent of process and batch.
Bytes mutation(const std::vector<Bytes>& files, std::uint64_t seed, std::uint64_t i) {
    Random random(seed * 0x9e3779b97f4a7c15u + i);
    return mutate(files[i % files.size()], random);
}

/// Reads mutations first .. last - 1 in a child and adds their verdicts. @return number of the first one without
/// verdict
std::uint64_t run_batch(const std::vector<Bytes>& files, const Tables& expected, const std::string& path,
                        std::uint64_t seed, std::uint64_t first, std::uint64_t last, Counts& counts) {
    int ends[2];
    if (::pipe(ends) != 0) throw Error("no pipe");
    std::fflush(stdout);
    const pid_t child = ::fork();
    if (child < 0) throw Error("no process");
    if (child == 0) {
        ::close(ends[0]);
        const int null = ::open("/dev/null", O_WRONLY);
        ::dup2(null, STDERR_FILENO);
        for (std::uint64_t i = first; i < last; ++i) {
            const Bytes bytes = mutation(files, seed, i);
            const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
            if (::write(file, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) ::_exit(3);
            ::close(file);
            const auto verdict = static_cast<unsigned char>(judge(path, files[i % files.size()], bytes, expected));
            if (::write(ends[1], &verdict, 1) != 1) ::_exit(3);
        }
        ::_exit(0);
    }
    ::close(ends[1]);
    std::uint64_t next = first;
    bool hung = false;
    for (;;) {
        struct pollfd ready = {ends[0], POLLIN, 0};
        if (::poll(&ready, 1, seconds_of_a_hang * 1000) == 0) {
            hung = true;
            break;
        }
        unsigned char verdicts[4096];
        const ssize_t n = ::read(ends[0], verdicts, sizeof verdicts);
        if (n <= 0) break;
        for (ssize_t k = 0; k < n; ++k, ++next, ++counts.read) {
            const auto verdict = static_cast<Verdict>(verdicts[k]);
            ++(verdict == Verdict::unchanged ? counts.unchanged
               : verdict == Verdict::refused ? counts.refused
               : verdict == Verdict::same    ? counts.same
               : verdict == Verdict::silent  ? counts.silent
                                             : counts.greedy);
            if (verdict == Verdict::silent || verdict == Verdict::greedy)
                fmt::print("number {} of seed {}: {}\n", next, seed,
                           verdict == Verdict::silent ? "silent difference" : "greedy");
        }
    }
    ::close(ends[0]);
    if (hung) ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    if (next == last && WIFEXITED(status) && WEXITSTATUS(status) == 0) return next;
    if (WIFEXITED(status) && WEXITSTATUS(status) == 3) throw Error("{}: cannot be written", path);
    ++counts.read;
    ++(hung ? counts.hung : counts.crashed);
    fmt::print("number {} of seed {}: {}\n", next, seed, hung ? "hang" : "crash");
    return next + 1;
}

Request small_request() {
    Request request = test::small_request(Method::analog, {3, 2, 3, 2}, 36, 500);
    request.absorption = graded_axis("absorption", {0, 1, 2});
    return request;
}

Counts mutate_tables(std::uint64_t count, std::uint64_t seed) {
    const Tables tables = simulate(small_request(), ProgressMode::none);
    const std::string path = fmt::format("/dev/shm/medulla_mutate_{}.h5", ::getpid());
    std::vector<Bytes> files;
    for (const Compression compression : {Compression::zstd, Compression::gzip, Compression::none}) {
        write_tables(path, tables, compression);
        files.push_back(read_file(path));
    }
    Counts counts;
    for (std::uint64_t next = 0; next < count;) {
        next = run_batch(files, tables, path, seed, next, std::min(count, next + 2000), counts);
        if (counts.read % 20000 == 0) counts.print("so far");
    }
    ::unlink(path.c_str());
    return counts;
}

// --- packs -------------------------------------------------------------------------------------------------------

/// Some of all that a renderer asks a pack, also outside its axes; false: a question that has an answer got none.
bool ask(const PackView& pack, Random& random) {
    const float sigmas[] = {0, 0.3f, 2, 16, -1, 1e30f}, gs[] = {0, 0.5f, 0.95f, -1}, hs[] = {0, 0.7f, 1, -0.3f};
    const float sigma = sigmas[random() % 6], g = gs[random() % 4], h = hs[random() % 4];
    float sum = 0;
    for (const TableView& table : pack.tables) {
        if (!table || !table.has_exit()) continue;
        const auto kind = static_cast<TableKind>(table.layout.kind);
        if (kind == TableKind::azimuthal)
            for (const float absorption : {0.0f, 0.7f, 30.0f})
                if (absorption == 0 || absorbs(pack)) sum += azimuthal(pack, sigma, g, h, 1.0f, absorption);
        if (kind == TableKind::longitudinal_back) sum += longitudinal(pack, Side::back, sigma, g, h, 0.3f);
        if (kind == TableKind::longitudinal_forward) sum += longitudinal(pack, Side::forward, sigma, g, h, 0.3f);
        LobeQuery query = {};
        query.sigma = sigma, query.g = g, query.h = h, query.theta_i = h;
        const Contraction contraction = contract(table, query);
        ExitDistribution distribution;
        distribute(table, contraction, distribution);
        sum += distribution.pdf(0.2f) + distribution.sample(0.7f);
    }
    return std::isfinite(sum) || sigma < 0;  // a root of sigma is taken
}

/// Half of the mutations get their checksum mended: then the checks behind it, and the lookups, must hold.
Counts mutate_packs(std::uint64_t count, std::uint64_t seed) {
    CompressOptions options;
    options.rank = 4;
    options.solver = tensor::Solver::als;
    options.spans = {8, 8, 8};
    Bytes good = compress(simulate(small_request(), ProgressMode::none), options, "mutate").pack;
    Counts counts;
    std::uint64_t mended = 0, mended_opened = 0;
    for (std::uint64_t i = 0; i < count; ++i, ++counts.read) {
        Random random(seed * 0x9e3779b97f4a7c15u + i);
        Bytes bytes = mutate(good, random);
        if (bytes == good) {
            ++counts.unchanged;
            continue;
        }
        const bool mend = i % 2 == 1 && bytes.size() >= sizeof(PackHeader);
        if (mend) {
            const std::uint64_t size = bytes.size();
            if (random() % 4) std::memcpy(bytes.data() + offsetof(PackHeader, byte_count), &size, sizeof size);
            const std::uint64_t sum = pack_checksum(bytes.data(), bytes.size());
            std::memcpy(bytes.data() + offsetof(PackHeader, checksum), &sum, sizeof sum);
            ++mended;
        }
        // Of exactly its size, so that a sanitizer sees the first byte past the end.
        const Bytes exact(bytes);
        const OpenResult opened = open_pack(exact.data(), exact.size());
        if (opened.status != PackStatus::ok) {
            ++counts.refused;
            continue;
        }
        if (!ask(opened.pack, random)) {
            ++counts.wild;
            fmt::print("number {} of seed {}: not finite\n", i, seed);
        }
        if (mend) {
            ++mended_opened, ++counts.same;
        } else {
            ++counts.silent;
            fmt::print("number {} of seed {}: silent difference\n", i, seed);
        }
    }
    fmt::print("packs: {} had their checksum mended, of these {} opened and were asked\n", mended, mended_opened);
    return counts;
}

}  // namespace

int main(int argc, char** argv) {
    const std::string kind = argc > 1 ? argv[1] : "";
    if (argc < 3 || (kind != "tables" && kind != "pack")) {
        fmt::print(stderr, "mutate tables|pack COUNT [SEED]\n");
        return 2;
    }
    try {
        const std::uint64_t count = std::stoull(argv[2]), seed = argc > 3 ? std::stoull(argv[3]) : 1;
        const Counts counts = kind == "tables" ? mutate_tables(count, seed) : mutate_packs(count, seed);
        counts.print(kind.c_str());
        return counts.clean() && counts.read == count ? 0 : 1;
    } catch (const std::exception& error) {
        fmt::print(stderr, "mutate: {}\n", error.what());
        return 1;
    }
}
