// Renders a scene: threads make passes over tiles, until the given number of samples, time or error is reached.
#pragma once

#include <functional>
#include <string>

#include "render/film.hpp"
#include "render/path.hpp"

namespace medulla::render {

struct RenderOptions {
    PathOptions path;
    std::uint32_t samples = 64;  ///< per pixel; an upper bound where seconds or error are set
    double seconds = 0;          ///< stop after the first pass that ends later than this; 0: no limit
    double error = 0;            ///< stop at this Film::error; 0: no limit
    int threads = 0;             ///< 0: all there are
    std::uint32_t seed = 0;
    bool stats = false;      ///< fill the times of Counts
    std::string unfinished;  ///< file of the unfinished picture; empty: none
    bool resume = false;     ///< continue from that file
    std::string key;         ///< identifies the picture in that file: everything that its pixels depend on
};

struct Report {
    Counts counts;
    double seconds = 0;  ///< rendering alone
};

/// Samples per pixel of a pass, after which time and error are checked.
inline constexpr std::uint32_t samples_per_pass = 8;

/// @param progress called after each tile with the share that is done, by one thread at a time
Report render(const PathTracer& tracer, const RenderOptions& options, Film& film,
              const std::function<void(double)>& progress);

}  // namespace medulla::render
