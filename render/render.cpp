#include "render/render.hpp"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <mutex>
#include <thread>

namespace medulla::render {
namespace {

constexpr int tile = 16;
constexpr double seconds_between_saves = 5;
constexpr std::uint32_t timed_every = 8;  // of a pixel's samples: clock readings cost as much as some shading

double since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

Report render(const PathTracer& tracer, const RenderOptions& options, Film& film,
              const std::function<void(double)>& progress) {
    Report report;
    if (options.resume) load(film, options.key, options.unfinished);
    const std::uint64_t nonfinite_before = film.nonfinite;
    const int columns = (film.width + tile - 1) / tile, rows = (film.height + tile - 1) / tile, tiles = columns * rows;
    const int threads = options.threads > 0 ? options.threads : int(std::max(1u, std::thread::hardware_concurrency()));
    const auto start = std::chrono::steady_clock::now();
    double saved = 0;
    std::mutex mutex;

    while (film.samples < options.samples) {
        const std::uint32_t first = film.samples, last = std::min(options.samples, first + samples_per_pass);
        std::atomic<int> next{0};
        int done = 0;
        const auto work = [&] {
            Counts counts;
            for (int t; (t = next.fetch_add(1)) < tiles;) {
                const int x0 = t % columns * tile, y0 = t / columns * tile;
                for (int y = y0; y < std::min(film.height, y0 + tile); ++y)
                    for (int x = x0; x < std::min(film.width, x0 + tile); ++x) {
                        const std::size_t index = std::size_t(y) * std::size_t(film.width) + std::size_t(x);
                        for (std::uint32_t s = first; s < last; ++s) {
                            const bool timed = options.stats && s % timed_every == 0;
                            Layers layers;
                            film.pixels[index].add(tracer.sample(x, y, s, options.seed, timed, counts,
                                                                 film.layers.empty() ? nullptr : &layers));
                            if (!film.layers.empty()) film.layers[index] += layers;
                        }
                    }
                const std::lock_guard<std::mutex> lock(mutex);
                ++done;
                double share = (first + double(last - first) * done / tiles) / options.samples;
                if (options.seconds > 0) share = std::max(share, std::min(1.0, since(start) / options.seconds));
                progress(share);
            }
            const std::lock_guard<std::mutex> lock(mutex);
            report.counts += counts;
        };
        std::vector<std::thread> others;
        for (int i = 1; i < threads; ++i) others.emplace_back(work);
        work();
        for (std::thread& thread : others) thread.join();
        film.samples = last;
        film.nonfinite = nonfinite_before + report.counts.nonfinite;

        const double now = since(start);
        if (options.seconds > 0 && now >= options.seconds) break;
        if (options.error > 0 && film.samples >= 2 * samples_per_pass && film.error() <= options.error) break;
        if (!options.unfinished.empty() && now - saved > seconds_between_saves && film.samples < options.samples) {
            save(film, options.key, options.unfinished);
            saved = now;
        }
    }
    report.seconds = since(start);
    return report;
}

}  // namespace medulla::render
