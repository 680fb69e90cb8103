#include "tables/bake/fibre_job.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <mutex>

#include "tables/error.hpp"
#include "tables/job/interrupts.hpp"
#include "tables/parallel.hpp"
#include "tables/store/file.hpp"

namespace medulla::tables {
namespace {

constexpr double seconds_between_writes = 5;

/// Light, and as much again for the file in memory.
void check_memory(const FibreRequest& request) {
    const double needed = 3 * light_bytes(request);
    const double pages = static_cast<double>(::sysconf(_SC_PHYS_PAGES)),
                 page = static_cast<double>(::sysconf(_SC_PAGESIZE));
    if (pages > 0 && needed > 0.8 * pages * page)
        throw Error("--bins: expected light of {} x {} bins to fit {:.3g} GB of memory, found {:.3g} GB", request.rows,
                    request.columns, 0.8e-9 * pages * page, 1e-9 * needed);
}

std::size_t count_of(const std::vector<std::optional<LightCell>>& cells) {
    return static_cast<std::size_t>(
        std::count_if(cells.begin(), cells.end(), [](const auto& c) { return c.has_value(); }));
}

}  // namespace

FibreJobReport run_fibre_job(const FibreJob& job) {
    const Interrupts interrupts;
    check_fibre_request(job.request, job.where);
    check_memory(job.request);
    const Output output(job.output, job.inputs);
    output.require_plain();  // what is done is kept beside it
    FibreLight light = plan_of(job.request);
    const PartialFibre partial(job.output, light);
    check_name(partial.path());
    std::vector<std::optional<LightCell>> cells(light.cells.size() + light.checks.size());
    FibreJobReport report;
    report.cells = cells.size();
    if (job.resume && std::filesystem::exists(job.output)) {
        const FibreLight found = read_fibre(job.output);
        const std::string expected = configuration_text(light.request), other = configuration_text(found.request);
        if (expected != other)
            throw Error("{}: it belongs to another job: {}", job.output, configuration_difference(expected, other));
        report.was_complete = true, report.kept = cells.size(), report.noise = median_noise(found);
        if (partial.exists()) partial.remove();  // killed between the last two steps
        return report;
    }
    if (partial.exists()) {
        if (!job.resume)
            throw Error("{}: has cells of an earlier run; continue with --resume, or delete it", partial.path());
        partial.read(cells);
    }
    report.kept = count_of(cells);
    std::vector<std::size_t> missing;
    for (std::size_t i = 0; i < cells.size(); ++i)
        if (!cells[i]) missing.push_back(i);
    try {
        std::mutex mutex;
        using Clock = std::chrono::steady_clock;
        auto written = Clock::now();
        {
            Progress progress(job.progress, "simulate", cells.size(), report.kept);
            in_parallel(missing.size(), job.threads, stop_requested(), [&](std::size_t k) {
                LightCell cell = simulate_cell(light, missing[k]);
                progress.add(1);
                const std::lock_guard<std::mutex> lock(mutex);
                cells[missing[k]] = std::move(cell);
                if (std::chrono::duration<double>(Clock::now() - written).count() < seconds_between_writes) return;
                partial.write(cells);
                written = Clock::now();
            });
        }
        if (stop_requested()) {
            partial.write(cells);
            throw Interrupted(caught_signal(), "interrupted: {} of {} cells kept in {}; continue with --resume",
                              count_of(cells), cells.size(), partial.path());
        }
        for (std::size_t i = 0; i < cells.size(); ++i)
            (i < light.cells.size() ? light.cells[i] : light.checks[i - light.cells.size()]) = std::move(*cells[i]);
        write_fibre(output, light, job.compression);
    } catch (const Interrupted&) {
        throw;
    } catch (const Error& error) {
        if (!partial.exists()) throw;
        throw Error("{}; cells kept in {}, continue with --resume", error.what(), partial.path());
    }
    if (partial.exists()) partial.remove();
    report.noise = median_noise(light);
    return report;
}

}  // namespace medulla::tables
