// Discrete ordinates by eigen-modes; the phase function is sampled where the directions resolve it, averaged over
// the directions' cells where they do not, and its diagonal restores energy exactly in both cases.
#include "sim2d/slab_modes.hpp"

#include <algorithm>
#include <cmath>

#include "medulla/phase.hpp"
#include "sim2d/elementary.hpp"
#include "sim2d/slab_single.hpp"

namespace medulla::sim2d {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPi = 3.14159265358979323846;

/// Scattering from inclination b to a: forward p(a - b), across p(pi - a - b). `across` as p(a + b; -g).
double phase(double difference, double g, bool across) { return portable::planar_hg_pdf(difference, across ? -g : g); }

}  // namespace

SlabOrdinates::SlabOrdinates(double g, std::size_t count, bool resolved)
    : g_(g), resolved_(resolved), directions_(slab_directions(count)) {
    cell_edge_.push_back(kPi / 2);
    for (double w : directions_.weight) cell_edge_.push_back(cell_edge_.back() - w);
    cell_edge_.back() = 0;  // the weights sum to pi/2
    modes_[0] = decompose(Parity::even);
    modes_[1] = decompose(Parity::odd);
}

namespace {

/// Phase function between the direction `to` and node j of inclination sign * theta_j, in either hemisphere.
struct Kernel {
    double g;
    bool resolved;
    const SlabDirections& d;
    const std::vector<double>& edge;

    double operator()(double to, std::size_t j, double sign, bool across) const {
        // Across, the travel directions differ by pi - to - theta_j: p(to + theta_j; -g).
        const double s = across ? -sign : sign;
        if (resolved) return phase(to - s * d.theta[j], g, across);
        const double lo = s > 0 ? edge[j + 1] : -edge[j], hi = s > 0 ? edge[j] : -edge[j + 1];
        return planar_hg_integral(lo - to, hi - to, across ? -g : g) / d.weight[j];
    }
};

}  // namespace

SlabModes SlabOrdinates::decompose(Parity parity) const {
    const SlabDirections& d = directions_;
    const Index n = Index(d.theta.size());
    const double sign = parity == Parity::even ? 1 : -1;
    const Kernel p{g_, resolved_, d, cell_edge_};
    const VectorXd weight = Eigen::Map<const VectorXd>(d.weight.data(), n), root = weight.cwiseSqrt();
    const VectorXd mu = Eigen::Map<const VectorXd>(d.mu.data(), n);

    MatrixXd within(n, n), across(n, n);  // even and odd in theta need the direct and the mirrored term apart
    MatrixXd within_mirror(n, n), across_mirror(n, n);
    for (Index i = 0; i < n; ++i) {
        for (Index j = 0; j < n; ++j) {
            const double to = d.theta[std::size_t(i)];
            within(i, j) = p(to, std::size_t(j), 1, false);
            within_mirror(i, j) = p(to, std::size_t(j), -1, false);
            across(i, j) = p(to, std::size_t(j), 1, true);
            across_mirror(i, j) = p(to, std::size_t(j), -1, true);
        }
    }
    for (MatrixXd* m : {&within, &within_mirror, &across, &across_mirror}) {
        *m = (0.5 * (*m + m->transpose())).eval();  // a no-op for samples; makes cell averages reciprocal
    }
    // Each row must integrate to 1. What is missing belongs to the peak: the same direction for g > 0, the reversed
    // one (across, mirrored) for g < 0.
    const VectorXd missing = VectorXd::Ones(n) - (within + within_mirror + across + across_mirror) * weight;
    (g_ < 0 ? across_mirror : within).diagonal() += missing.cwiseQuotient(weight);

    const MatrixXd c = root.asDiagonal() * (within + sign * within_mirror) * root.asDiagonal();
    const MatrixXd f = root.asDiagonal() * (across + sign * across_mirror) * root.asDiagonal();
    const MatrixXd identity = MatrixXd::Identity(n, n);
    MatrixXd x = identity - c - f;
    const MatrixXd y = identity - c + f;
    const Eigen::LLT<MatrixXd> y_factor(y);

    SlabModes modes;
    modes.conservative = parity == Parity::even;
    if (modes.conservative) {
        // X has the null vector e = sqrt(weight). All other modes are orthogonal to q = M Y^-1 M e, so X + a q q^T
        // has them unchanged and e with k^2 = a e.q. The others obey k^2 >= min X min Y = (1 - g^2)(1 - max(g, 0));
        // a quarter of that sorts mode 0 first, without spreading the singular values.
        const VectorXd q = mu.asDiagonal() * y_factor.solve(VectorXd(mu.cwiseProduct(root)));
        const double k2 = (1 - g_ * g_) * (1 - std::max(g_, 0.0)) / 4;
        x += (k2 / root.dot(q)) * q * q.transpose();
    }
    const Eigen::LLT<MatrixXd> x_factor(x);
    // B = L^-1 M R^-T.
    MatrixXd b = x_factor.matrixL().solve(MatrixXd(mu.asDiagonal()));
    b = y_factor.matrixL().solve(MatrixXd(b.transpose())).transpose().eval();
    const Eigen::BDCSVD<MatrixXd> svd(b, Eigen::ComputeFullU | Eigen::ComputeFullV);
    // X, Y <= 2 bound the singular values by min(mu) / 2 from below; where eps max(1/k) exceeds that, they are
    // rounding.
    modes.k = svd.singularValues().cwiseMax(mu.minCoeff() / 2).cwiseInverse();
    const MatrixXd s = x_factor.matrixU().solve(svd.matrixU());
    const MatrixXd t = y_factor.matrixU().solve(svd.matrixV());
    const VectorXd inverse_root = root.cwiseInverse();
    modes.sum = inverse_root.asDiagonal() * s;
    modes.difference = inverse_root.asDiagonal() * t;
    modes.project_sum = modes.k.asDiagonal() * s.transpose() * root.asDiagonal();
    modes.project_difference = modes.k.asDiagonal() * t.transpose() * root.asDiagonal();
    return modes;
}

namespace {

/// Exit radiance of one parity, all orders: sources `plus`, `minus` [node, incident] times exp(-tau / mu_i) / mu_i.
struct Radiance {
    MatrixXd back, forward;
};

Radiance exit_radiance(const SlabModes& m, double depth, const std::vector<double>& mu_i, const MatrixXd& plus,
                       const MatrixXd& minus) {
    const Index n = m.k.size(), count = plus.cols();
    const MatrixXd c_sum = m.project_sum * (plus + minus), c_difference = m.project_difference * (plus - minus);
    // Amplitudes A of S and B of D; alpha = (A + B) / 2 decays from x = 0, beta = (A - B) / 2 from x = 2.
    // alpha(depth) and beta(0) of the particular solution that starts from nothing are slab path factors at mu = 1/k.
    MatrixXd alpha(n, count), beta(n, count);
    for (Index i = 0; i < count; ++i) {
        const double mu = mu_i[std::size_t(i)];
        for (Index j = 0; j < n; ++j) {
            alpha(j, i) = (c_sum(j, i) + c_difference(j, i)) / 2 * slab_forward_factor(depth, mu, 1 / m.k(j));
            beta(j, i) = (c_sum(j, i) - c_difference(j, i)) / 2 * slab_back_factor(depth, mu, 1 / m.k(j));
        }
    }
    const VectorXd decay = (-depth * m.k.array()).exp(),
                   lost = -(-depth * m.k.array()).unaryExpr([](double v) { return portable::expm1(v); });
    // Nothing enters: S + D = 0 at 0, S - D = 0 at depth. In x = alpha(0) + beta(depth), y = alpha(0) - beta(depth):
    MatrixXd symmetric = m.sum * (1 + decay.array()).matrix().asDiagonal();
    symmetric += m.difference * lost.asDiagonal();
    MatrixXd antisymmetric = m.sum * lost.asDiagonal();
    antisymmetric += m.difference * (1 + decay.array()).matrix().asDiagonal();
    Eigen::RowVectorXd a_end, b_end;
    const double slope = m.conservative ? m.k(0) * depth / 2 : 0;
    if (m.conservative) {
        // Mode 0: B' = source, A' = -k B + source. Homogeneous: A = a + k b (depth/2 - tau), B = b.
        symmetric.col(0) = 2 * m.sum.col(0);
        antisymmetric.col(0) = 2 * slope * m.sum.col(0) + 2 * m.difference.col(0);
        a_end.resize(count), b_end.resize(count);
        for (Index i = 0; i < count; ++i) {
            const double mu = mu_i[std::size_t(i)], fed = mu > 0 ? -portable::expm1(-depth / mu) : 1;
            // Integral of 1 - exp(-tau / mu) over the depth; the difference loses digits only where it is itself
            // small against depth * fed, beside which it is added.
            const double fed_twice = mu > 0 ? depth - mu * fed : depth;
            b_end(i) = c_sum(0, i) * fed;
            a_end(i) = -m.k(0) * c_sum(0, i) * fed_twice + c_difference(0, i) * fed;
            alpha(0, i) = beta(0, i) = 0;
        }
    }
    const MatrixXd outward = m.sum - m.difference;
    MatrixXd rhs_symmetric = -outward * (alpha + beta), rhs_antisymmetric = outward * (alpha - beta);
    if (m.conservative) {
        const MatrixXd end = m.sum.col(0) * a_end - m.difference.col(0) * b_end;
        rhs_symmetric -= end;
        rhs_antisymmetric += end;
    }
    const MatrixXd x = symmetric.partialPivLu().solve(rhs_symmetric);
    const MatrixXd y = antisymmetric.partialPivLu().solve(rhs_antisymmetric);
    // I- = S at 0 and I+ = S at depth, since nothing enters there.
    const MatrixXd alpha0 = (x + y) / 2, beta_end = (x - y) / 2;
    MatrixXd a0 = alpha0 + decay.asDiagonal() * beta_end + beta, a1 = decay.asDiagonal() * alpha0 + beta_end + alpha;
    if (m.conservative) {
        a0.row(0) = x.row(0) + slope * y.row(0);
        a1.row(0) = x.row(0) - slope * y.row(0) + a_end;
    }
    return {m.sum * a0, m.sum * a1};
}

}  // namespace

SlabOrdinates::Exit SlabOrdinates::multiply_scattered(double depth, const std::vector<double>& theta_i) const {
    const SlabDirections& d = directions_;
    const std::size_t n = d.theta.size(), count = theta_i.size();
    const Kernel p{g_, resolved_, d, cell_edge_};
    std::vector<double> mu_i;
    for (double theta : theta_i) mu_i.push_back(slab_cosine(theta));
    Exit exit;
    for (const int parity : {0, 1}) {
        const double sign = parity == 0 ? 1 : -1;
        MatrixXd plus(n, count), minus(n, count), single_back(n, count), single_forward(n, count);
        for (std::size_t i = 0; i < count; ++i) {
            for (std::size_t j = 0; j < n; ++j) {
                // Light travels at +theta_i; node theta_j and its mirror -theta_j share the source by parity.
                plus(Index(j), Index(i)) = (p(theta_i[i], j, 1, false) + sign * p(theta_i[i], j, -1, false)) / 2;
                minus(Index(j), Index(i)) = (p(theta_i[i], j, 1, true) + sign * p(theta_i[i], j, -1, true)) / 2;
                single_forward(Index(j), Index(i)) =
                    plus(Index(j), Index(i)) * slab_forward_factor(depth, mu_i[i], d.mu[j]) / d.mu[j];
                single_back(Index(j), Index(i)) =
                    minus(Index(j), Index(i)) * slab_back_factor(depth, mu_i[i], d.mu[j]) / d.mu[j];
            }
        }
        const Radiance total = exit_radiance(modes_[parity], depth, mu_i, plus, minus);
        const Eigen::ArrayXd opaque = Eigen::Map<const Eigen::ArrayXd>(d.mu.data(), Index(n)).unaryExpr([&](double mu) {
            return -portable::expm1(-depth / mu) / mu;
        });
        exit.back[parity] = opaque.inverse().matrix().asDiagonal() * (total.back - single_back);
        exit.forward[parity] = opaque.inverse().matrix().asDiagonal() * (total.forward - single_forward);
    }
    return exit;
}

}  // namespace medulla::sim2d
