// Requests small enough to simulate in a test.
#pragma once

#include "tables/job/request.hpp"

namespace medulla::test {

/// Nodes of each axis: sigma in [0, 4], g in [0, 0.6], h in [0, 1], theta_i in [0, 1.2].
struct SmallAxes {
    std::size_t sigma, g, h, theta_i;
};

inline tables::Request small_request(tables::Method method, const SmallAxes& nodes, std::size_t bins,
                                     std::uint64_t paths) {
    using tables::graded_axis;
    tables::Request request = tables::default_request();
    request.sigma = graded_axis("sigma", {0, 4, nodes.sigma});
    request.g = graded_axis("g", {0, 0.6, nodes.g});
    request.h = graded_axis("h", {0, 1, nodes.h});
    request.theta_i = graded_axis("theta_i", {0, 1.2, nodes.theta_i});
    request.bins = bins;
    request.paths = paths;
    request.method = method;
    return request;
}

}  // namespace medulla::test
