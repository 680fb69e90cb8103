// Adding-doubling (van de Hulst): R2 = R + T (1 - R R)^-1 R T, T2 = T (1 - R R)^-1 T.
#include "sim2d/reference/slab_doubling.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "medulla/phase.hpp"
#include "sim2d/elementary.hpp"
#include "sim2d/slab/angles.hpp"

namespace medulla::sim2d {

SlabDoubling slab_doubling(double sigma, double g, std::size_t directions, double absorption) {
    using Eigen::Index;
    using Eigen::MatrixXd;
    // Layers of at most 5e-7: the box error (h / mu)^2 / 12 is below 1e-8 for mu > 2e-3, rounding grows as eps
    // 2^doublings.
    const int doublings = sigma > 2.5e-7 ? int(std::ceil(std::log2(2 * sigma / 5e-7))) : 0;
    const Quadrature rule = gauss_legendre(directions);
    const Index n = Index(directions);
    SlabDoubling result;
    for (double x : rule.nodes) result.theta.push_back(pi / 2 * x);
    Eigen::VectorXd mu(n), weight(n);
    MatrixXd within(n, n), across(n, n);
    for (Index i = 0; i < n; ++i) {
        const double a = result.theta[std::size_t(i)];
        mu(i) = portable::cos(a);
        weight(i) = pi / 2 * rule.weights[std::size_t(i)];
        result.weight.push_back(weight(i));
        for (Index j = 0; j < n; ++j) {
            const double b = result.theta[std::size_t(j)];  // travel directions b and pi - b
            within(i, j) = portable::planar_hg_pdf(a - b, g);
            across(i, j) = portable::planar_hg_pdf(a + b, -g);
        }
    }
    // A layer of optical depth h, radiance averaged over its two faces (box scheme), in sum and difference of exits.
    const double h = std::ldexp(2 * sigma, -doublings);
    const MatrixXd loss =
        ((1 + absorption / sigma) * MatrixXd::Identity(n, n) - within * weight.asDiagonal()) * (h / 2);
    const MatrixXd turn = across * weight.asDiagonal() * (h / 2);
    const MatrixXd m = mu.asDiagonal();
    const MatrixXd sum = (m + loss - turn).partialPivLu().solve(m - loss + turn);
    const MatrixXd difference = (m + loss + turn).partialPivLu().solve(m - loss - turn);
    MatrixXd t = (sum + difference) / 2, r = (sum - difference) / 2;
    for (int k = 0; k < doublings; ++k) {
        const MatrixXd between = (MatrixXd::Identity(n, n) - r * r).partialPivLu().solve(t);
        r = (r + t * (r * between)).eval();
        t = (t * between).eval();
    }
    // Unit energy from direction b: radiance 1 / (weight mu). theta_i = -b, the rule is symmetric.
    const std::size_t count = directions;
    result.back.resize(count * count);
    result.forward.resize(count * count);
    for (std::size_t i = 0; i < count; ++i) {
        const Index in = Index(count - 1 - i);
        for (std::size_t e = 0; e < count; ++e) {
            const double scale = mu(Index(e)) / (mu(in) * weight(in));
            result.back[i * count + e] = scale * r(Index(e), in);
            result.forward[i * count + e] = scale * t(Index(e), in);
        }
    }
    return result;
}

}  // namespace medulla::sim2d
