// CP solvers on the table of stand_in.hpp: seconds, error and degeneracy of full ALS and the compressed solvers.
// Usage: bench_cp [--full] [--json] [rank ...]; --full adds three 500-sweep runs of full-tensor ALS per rank.
#include <omp.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <vector>

#include "bench/stand_in.hpp"
#include "tensor/cp.hpp"

using namespace medulla::tensor;

namespace {

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Bench {
    const Tensor& table;
    bool json;
    bool first = true;

    void run(const char* name, CpResult (*solver)(const Tensor&, const CpOptions&), CpOptions options) {
        const double begin = cpu_seconds();
        const CpReport r = solver(table, options).report;
        const double cpu = cpu_seconds() - begin;
        if (json)
            std::printf(
                "%s\n  {\"solver\": \"%s\", \"rank\": %d, \"seconds\": %.4f, \"cpu_seconds\": %.4f, "
                "\"error\": %.6g, \"norm_ratio\": %.4g, \"least_cosine\": %.4f, \"sweeps\": %d, \"stop\": \"%s\"}",
                first ? "" : ",", name, options.rank, r.seconds, cpu, r.relative_error, r.degeneracy.norm_ratio,
                r.degeneracy.least_cosine, r.iterations, to_string(r.stop).c_str());
        else
            std::printf("%-16s %5d %9.3f %9.3f %10.3e %8.2f %8.4f %7d  %s\n", name, options.rank, r.seconds, cpu,
                        r.relative_error, r.degeneracy.norm_ratio, r.degeneracy.least_cosine, r.iterations,
                        to_string(r.stop).c_str());
        std::fflush(stdout);
        first = false;
    }
};

}  // namespace

int main(int argc, char** argv) {
    bool full = false, json = false;
    std::vector<int> ranks;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--full") == 0)
            full = true;
        else if (std::strcmp(argv[i], "--json") == 0)
            json = true;
        else if (std::atoi(argv[i]) > 0)
            ranks.push_back(std::atoi(argv[i]));
        else
            return std::fprintf(stderr, "usage: bench_cp [--full] [--json] [rank ...]\n"), 2;
    }
    if (ranks.empty()) ranks = {4, 8, 16, 32, 64, 96, 128};
    const Tensor table = single_scattering_table(24, 16, 16, 720);
    if (!json) {
        std::printf("stand-in table 24 x 16 x 16 x 720, %d thread(s)\n", omp_get_max_threads());
        std::printf("%-16s %5s %9s %9s %10s %8s %8s %7s  %s\n", "solver", "rank", "seconds", "cpu s", "error", "norms",
                    "cosine", "sweeps", "stop");
    } else {
        std::printf("[");
    }
    Bench bench{table, json};
    for (int rank : ranks) {
        CpOptions options;
        options.rank = rank;
        bench.run("lm", cp_lm, options);
        bench.run("compressed als", cp_als_compressed, options);
        bench.run("nonnegative", cp_nonnegative, options);
        if (!full) continue;
        options.tolerance = 0;
        for (options.seed = 1; options.seed <= 3; ++options.seed) bench.run("als (full)", cp_als, options);
    }
    if (json) std::printf("\n]\n");
}
