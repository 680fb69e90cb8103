// Mean path lengths in the slab: against derivatives of adding-doubling's energies, the exact mean, limits of thin
// slabs.
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "sim2d/reference/slab_doubling.hpp"
#include "sim2d/slab/angles.hpp"
#include "sim2d/slab/deterministic.hpp"
#include "sim2d/slab/modes.hpp"
#include "sim2d/slab/single.hpp"

namespace {

using namespace medulla;
using namespace medulla::sim2d;
constexpr double half_pi = pi / 2;

}  // namespace

TEST_CASE("slab mean paths are derivatives of adding-doubling's energies with respect to absorption", "[slab][paths]") {
    for (double g : {-0.6, 0.0, 0.5}) {
        const SlabSolver solver(g);
        for (double sigma : {0.05, 1.0, 16.0}) {
            const std::size_t n = 64;
            const double step = 1e-3;
            std::vector<SlabDoubling> reference;
            for (double absorption : {step, -step, 2 * step, -2 * step})
                reference.push_back(slab_doubling(sigma, g, n, absorption));
            const auto profiles = solver.solve(sigma, reference[0].theta, 90);
            for (std::size_t i = 0; i < n; ++i) {
                if (std::abs(reference[0].theta[i]) > 1.3) continue;  // adding-doubling's directions are not graded
                // -d energy / d absorption at 0 by central differences of fourth order.
                const auto slope = [&](std::vector<double> SlabDoubling::*side) {
                    double energy[4] = {};
                    for (std::size_t k = 0; k < 4; ++k)
                        for (std::size_t r = 0; r < n; ++r)
                            energy[k] += reference[k].weight[r] * (reference[k].*side)[i * n + r];
                    return (8 * (energy[1] - energy[0]) - (energy[3] - energy[2])) / (12 * step);
                };
                const double mu = std::cos(reference[0].theta[i]), through = std::exp(-2 * sigma / mu) * 2 / mu;
                CAPTURE(g, sigma, mu);
                // Rounding of the energies, about 1e-9, divided by the step.
                CHECK(profiles[i].back.energy * profiles[i].back.mean_length ==
                      Approx(slope(&SlabDoubling::back)).epsilon(3e-6));
                CHECK(profiles[i].forward.energy * profiles[i].forward.mean_length + through ==
                      Approx(slope(&SlabDoubling::forward)).epsilon(3e-6));
            }
        }
    }
}

TEST_CASE("slab mean path of isotropic light is pi for every sigma and g", "[slab][paths]") {
    // Blanco and Fournier 2003: pi area / perimeter in the plane. Scattered and unscattered light together.
    const Quadrature rule = unit_gauss_legendre(128);
    for (double g : {-0.9, 0.0, 0.5, 0.95}) {
        const SlabSolver solver(g);
        for (double sigma : {1e-12, 1e-8, 1e-5, 0.01, 0.2, 2.0, 16.0, 100.0, 1e3}) {
            // theta = (pi/2) (1 - (1 - u)^3), since paths vary within a distance of sigma from grazing.
            std::vector<double> theta, weight;
            for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
                const double rest = 1 - rule.nodes[i], grazing = half_pi * std::pow(rest, 3);
                theta.push_back(half_pi - grazing);
                weight.push_back(rule.weights[i] * half_pi * 3 * rest * rest * slab_cosine(theta.back()));
            }
            const auto profiles = solver.solve(sigma, theta, 90);
            double scattered = 0, through = 0;
            for (std::size_t i = 0; i < theta.size(); ++i) {
                scattered += weight[i] * (profiles[i].back.energy * profiles[i].back.mean_length +
                                          profiles[i].forward.energy * profiles[i].forward.mean_length);
                through += weight[i] * (1 - slab_energy(sigma, theta[i])) * 2 / slab_cosine(theta[i]);
            }
            CAPTURE(g, sigma);
            // The documented 3e-4 for thin slabs applies to the scattered light.
            CHECK(std::abs(scattered + through - pi) < 1e-9 * pi + (sigma < 0.005 ? 3e-4 * scattered : 0));
        }
    }
}

TEST_CASE("slab mean paths grow as log(1 / sigma), continuously across the range of the nodes", "[slab][paths]") {
    for (double g : {-0.8, 0.0, 0.8}) {
        const SlabSolver solver(g);
        for (auto side : {&SlabProfile::back, &SlabProfile::forward}) {
            const auto path = [&](double sigma) { return (solver.solve(sigma, {0.6}, 90)[0].*side).mean_length; };
            CAPTURE(g);
            CHECK(std::isinf(path(0)));
            // Only singly scattered light contributes there: equal steps for equal factors.
            const double step = path(1e-40) - path(1e-30);
            CHECK(step > 0);
            CHECK(path(1e-300) - path(1e-290) == Approx(step).epsilon(1e-8));
            CHECK(path(1e-20) - path(1e-10) == Approx(step).epsilon(1e-8));
            CHECK(path(1e-317) - path(1e-307) == Approx(step).epsilon(1e-6));  // sigma has 20 bits
            CHECK(path(0.999999 * 1.5e-4) == Approx(path(1.000001 * 1.5e-4)).epsilon(1e-6));
        }
    }
    // Five times the directions resolve the grazing angles of thin slabs, where the solver extrapolates.
    const SlabSolver solver(0.8);
    const SlabOrdinates fine(0.8, 320, true);
    for (double depth : {1e-5, 5e-5, 2e-4, 1e-3}) {
        const SlabOrdinates::Paths multiple = fine.multiply_scattered_paths(depth);
        for (const std::size_t node : {std::size_t(100), fine.directions().theta.size() - 1}) {
            const double theta = fine.directions().theta[node], sigma = depth / 2;
            const SlabSides single = slab_single_paths(sigma, 0.8, theta);
            const SlabProfile profile = solver.solve(sigma, {theta}, 90)[0];
            const double energy = slab_energy(sigma, theta);
            CAPTURE(depth, theta);
            CHECK(profile.back.energy / energy * profile.back.mean_length ==
                  Approx(single.back + multiple.back(Eigen::Index(node)) / sigma).epsilon(3e-4));
            CHECK(profile.forward.energy / energy * profile.forward.mean_length ==
                  Approx(single.forward + multiple.forward(Eigen::Index(node)) / sigma).epsilon(3e-4));
        }
    }
}
