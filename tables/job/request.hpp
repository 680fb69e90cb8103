// A request: axes of both tables, method and accuracy. Results depend on nothing else.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tables/table/axis.hpp"

namespace medulla::tables {

enum class Method { automatic, analog, mc, deterministic };
Method method_of(const std::string& name);
const char* name_of(Method method);

struct Request {
    bool azimuthal = true, longitudinal = true;
    Axis sigma, g, h, theta_i;             ///< theta_i in radians
    Axis absorption = {"absorption", {}};  ///< of C^N; empty: no such axis
    std::size_t bins = 720;  ///< exit directions over the full circle; half of them on each side of the slab
    Method method = Method::automatic;
    std::uint64_t paths = 100000;  ///< per cell, for the random methods, unless one of the next two is set
    double target_error = 0;       ///< each cell is solved until its relative L2 standard error is below; 0: not set
    double time_budget = 0;        ///< [seconds] for the whole job, spent where it reduces the error most; 0: not set
    std::uint64_t seed = 1;
    int threads = 0;  ///< 0: all
};

/// Nodes and ranges of the default tables: sigma 0:16:24, g 0:0.95:16, h 0:1:16, theta 0:90:16 degrees, 720 bins.
Request default_request();

/// Largest optical radius, of scattering and of absorption.
inline constexpr double greatest_radius = 1000;

/// Most paths of any method: what the tracers have random numbers for.
inline constexpr std::uint64_t most_paths = std::uint64_t{1} << 40;

/// Least and greatest target_error.
inline constexpr double least_target = 1e-5, greatest_target = 0.1;

/// Throws Error unless every cell is within the range of its solver.
void check_request(const Request& request);

}  // namespace medulla::tables
