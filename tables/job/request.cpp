#include "tables/job/request.hpp"

#include <algorithm>

#include "tables/error.hpp"
#include "tables/store/slices.hpp"

namespace medulla::tables {

Method method_of(const std::string& name) {
    for (const Method m : {Method::automatic, Method::analog, Method::mc, Method::deterministic})
        if (name == name_of(m)) return m;
    throw Error("--method: expected auto, analog, mc or deterministic, found '{}'", name);
}

const char* name_of(Method method) {
    constexpr const char* names[] = {"auto", "analog", "mc", "deterministic"};
    return names[static_cast<std::size_t>(method)];
}

Request default_request() {
    Request request;
    request.sigma = graded_axis("sigma", {0, 16, 24});
    request.g = graded_axis("g", {0, 0.95, 16});
    request.h = graded_axis("h", {0, 1, 16});
    request.theta_i = graded_axis("theta_i", {0, pi / 2, 16});
    return request;
}

void check_request(const Request& request) {
    const std::pair<const Axis*, const char*> axes[] = {{&request.sigma, "--sigma-range"},
                                                        {&request.g, "--g-range"},
                                                        {&request.h, "--h-range"},
                                                        {&request.theta_i, "--theta-range"}};
    for (const auto& [axis, option] : axes) check_axis(*axis, option);
    if (request.absorption.size() > 0) {
        check_axis(request.absorption, "--absorption-range");
        if (!request.azimuthal) throw Error("--absorption-range: expected the azimuthal table, which has that axis");
        if (request.absorption.values.back() > greatest_radius)
            throw Error("--absorption-range: expected at most {:g}, found {:g}", greatest_radius,
                        request.absorption.values.back());
    }
    if (request.sigma.values.back() > greatest_radius)
        throw Error("--sigma-range: expected at most {:g}, found {:g}", greatest_radius, request.sigma.values.back());
    if (request.bins < 8 || request.bins > 4096 || request.bins % 2 != 0)
        throw Error("--bins: expected an even number from 8 to 4096, found {}", request.bins);
    const int fewer_bits = request.method == Method::analog ? 0 : 5;  // of random numbers than the analog tracer has
    if (request.paths < 1 || request.paths > most_paths >> fewer_bits)
        throw Error("--paths: expected 1 to {}, found {}", most_paths >> fewer_bits, request.paths);
    const std::size_t most =
        std::max(request.h.size() * std::max<std::size_t>(request.absorption.size(), 1), request.theta_i.size()) *
        request.bins;
    if (most > most_slice_values)
        throw Error(
            "--bins: expected at most {} numbers in a slice (--h-range, --absorption-range or --theta-range times "
            "--bins), found {}",
            most_slice_values, most);
    if (request.target_error != 0 && !(request.target_error >= least_target && request.target_error <= greatest_target))
        throw Error("--target-error: expected {:g} to {:g}, found {:g}", least_target, greatest_target,
                    request.target_error);
    if (!(request.time_budget >= 0 && request.time_budget <= 1e9))
        throw Error("--time-budget: expected more than 0 and at most 1e9 seconds, found {:g}", request.time_budget);
    if (request.threads < 0 || request.threads > 1024)
        throw Error("--threads: expected 0 (all) to 1024, found {}", request.threads);
}

}  // namespace medulla::tables
