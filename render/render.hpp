// A picture from a scene: passes over tiles by threads, until the samples, the time or the error that was set.
#pragma once

#include <functional>
#include <string>

#include "render/film.hpp"
#include "render/path.hpp"

namespace medulla::render {

struct RenderOptions {
    PathOptions path;
    std::uint32_t samples = 64;  ///< per pixel; an upper bound where seconds or error are set
    double seconds = 0;          ///< stop after the pass in which they have gone by; 0: no limit
    double error = 0;            ///< stop at this Film::error; 0: no limit
    int threads = 0;             ///< 0: all there are
    std::uint32_t seed = 0;
    bool stats = false;      ///< fill the times of Counts
    std::string unfinished;  ///< where to keep a picture in work; empty: nowhere
    bool resume = false;     ///< begin from there
    std::string key;         ///< of what decides the picture, for that file
};

struct Report {
    Counts counts;
    double seconds = 0;  ///< rendering alone
};

/// Samples per pixel between two looks at the clock and the error.
inline constexpr std::uint32_t samples_per_pass = 8;

/// @param progress called after each tile with the share done, from one thread at a time
Report render(const PathTracer& tracer, const RenderOptions& options, Film& film,
              const std::function<void(double)>& progress);

}  // namespace medulla::render
