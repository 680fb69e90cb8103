#include "tables/job/precompute.hpp"

#include <omp.h>

#include <filesystem>
#include <mutex>

#include "tables/error.hpp"
#include "tables/job/budget.hpp"
#include "tables/job/interrupts.hpp"
#include "tables/parallel.hpp"
#include "tables/store/file.hpp"
#include "tables/store/job_difference.hpp"

namespace medulla::tables {
namespace {

/// The output, if it is already that of this job. Throws Error if it is of another job.
std::optional<Tables> finished(const Job& job, const Tables& plan) {
    if (!std::filesystem::exists(job.output)) return std::nullopt;
    Tables tables = read_tables(job.output);
    if (configuration_hash(plan) != configuration_hash(tables)) {
        const std::string difference = job_difference(plan, tables);
        throw Error("{}: it belongs to another job: {}", job.output,
                    difference.empty() ? "expected the options of this job, found others" : difference);
    }
    return tables;
}

/// A stored slice, with its expected time, since the time it took is unknown.
Refinable refinable(const Request& request, const SliceFolder& folder, const SliceId& id) {
    std::string why;
    const std::optional<Slice> slice = folder.read(id, why);
    if (!slice) throw Error("{}: damaged: {}", folder.file_of(id), why);
    return {id, slice->standard_error, static_cast<double>(expected_cost(request, id)) * 1e-6};
}

/// Solves and stores the missing ones of `slices`; with a time budget first coarsely, then where the error falls most.
void solve(const Job& job, const SliceSolver& solver, const SliceFolder& folder, const std::vector<SliceId>& slices,
           const std::vector<bool>& kept) {
    const double start = omp_get_wtime(), budget = job.request.time_budget;
    std::vector<SliceId> missing;
    std::vector<Refinable> coarse;
    std::size_t cells = 0, done = 0;
    for (std::size_t i = 0; i < slices.size(); ++i) {
        const std::size_t count = slice_cells(solver.plan().at(slices[i].table));
        cells += count;
        if (!kept[i]) {
            missing.push_back(slices[i]);
            continue;
        }
        done += count;
        if (budget > 0) coarse.push_back(refinable(job.request, folder, slices[i]));
    }
    {
        Progress progress(job.progress, "precompute", cells, done);
        std::mutex mutex;
        in_parallel(missing.size(), job.request.threads, stop_requested(), [&](std::size_t i) {
            const double began = omp_get_wtime();
            const Slice slice = budget > 0 ? solver.solve(missing[i], refinements[0]) : solver.solve(missing[i]);
            folder.write(missing[i], slice);
            progress.add(slice.cells);
            if (budget == 0) return;
            const std::lock_guard<std::mutex> lock(mutex);
            coarse.push_back({missing[i], slice.standard_error, omp_get_wtime() - began});
        });
    }
    if (budget == 0 || stop_requested()) return;
    refine(solver, std::move(coarse), budget - (omp_get_wtime() - start), job.request.threads, stop_requested(),
           [&](const SliceId& id, const Slice& slice) { folder.write(id, slice); });
}

std::size_t count_kept(const SliceFolder& folder, const std::vector<SliceId>& slices) {
    std::size_t count = 0;
    for (const SliceId& id : slices) count += std::filesystem::exists(folder.file_of(id));
    return count;
}

void throw_if_interrupted(const SliceFolder& folder, const std::vector<SliceId>& slices) {
    if (stop_requested())
        throw Interrupted(caught_signal(), "interrupted: {} of {} slices kept in {}; continue with --resume",
                          count_kept(folder, slices), slices.size(), folder.path());
}

}  // namespace

Tables assemble(const SliceFolder& folder, const Tables& plan) {
    Tables tables = plan;
    for (auto* table : {&tables.azimuthal, &tables.longitudinal})
        if (*table) (*table)->allocate();
    for (const SliceId& id : slices_of(plan)) {
        std::string why;
        const std::optional<Slice> slice = folder.read(id, why);
        if (!slice) throw Error("{}: damaged: {}", folder.file_of(id), why);
        put_slice(tables, id, *slice);
    }
    return tables;
}

JobReport run_job(const Job& job) {
    const Interrupts interrupts;
    const Output output(job.output, job.inputs);
    output.require_plain();  // slices are kept beside it
    check_name(SliceFolder::beside(job.output));
    const SliceSolver solver(job.request);
    const Tables& plan = solver.plan();
    SliceFolder folder(SliceFolder::beside(job.output), plan);
    JobReport report;
    report.folder = folder.path();
    const std::vector<SliceId> all = slices_of(plan);
    const std::vector<SliceId> slices = job.share ? share_of(job.request, all, *job.share) : by_cost(job.request, all);
    report.slices = slices.size();
    if (job.resume)
        if (auto tables = finished(job, plan)) {
            report.tables = std::move(*tables);
            report.was_complete = true;
            report.kept = slices.size();
            if (!job.share && std::filesystem::exists(folder.path())) {  // killed between the last two steps
                folder.open(true);
                folder.remove();
            }
            return report;
        }
    if (!job.resume && !job.share && !folder.files().empty())
        throw Error("{}: contains slices of an earlier run; continue with --resume, or delete it", folder.path());
    folder.open(!job.share);
    try {
        const std::vector<bool> kept = folder.kept(slices);
        report.kept = static_cast<std::size_t>(std::count(kept.begin(), kept.end(), true));
        if (job.share && !job.resume && report.kept > 0)
            throw Error("{}: already contains {} of this worker's {} slices; continue with --resume, or delete it",
                        folder.path(), report.kept, slices.size());
        solve(job, solver, folder, slices, kept);
        throw_if_interrupted(folder, slices);
        if (job.share) {
            report.tables = plan;
            return report;
        }
        report.tables = assemble(folder, plan);
        throw_if_interrupted(folder, slices);
        write_tables(output, report.tables, job.compression, folder.scratch());
    } catch (const Interrupted&) {
        throw;
    } catch (const Error& error) {
        const std::size_t count = count_kept(folder, slices);
        folder.remove_if_empty();
        if (count == 0 || job.share) throw;
        throw Error("{}; {} of {} slices kept in {}, continue with --resume", error.what(), count, slices.size(),
                    folder.path());
    }
    folder.remove();
    return report;
}

}  // namespace medulla::tables
