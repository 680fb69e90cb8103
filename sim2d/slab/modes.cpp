// Discrete ordinates by eigen-modes. The phase function is sampled where the directions resolve it and averaged over
// their cells where they do not; in both cases its diagonal is corrected so that energy is conserved exactly.
#include "sim2d/slab/modes.hpp"

#include <algorithm>
#include <cmath>

#include "medulla/phase.hpp"
#include "sim2d/elementary.hpp"
#include "sim2d/slab/single.hpp"

namespace medulla::sim2d {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Scattering from inclination b to a: forward p(a - b), across p(pi - a - b). `across` as p(a + b; -g).
double phase(double difference, double g, bool across) { return portable::planar_hg_pdf(difference, across ? -g : g); }

}  // namespace

SlabOrdinates::SlabOrdinates(double g, std::size_t count, bool resolved)
    : g_(g), resolved_(resolved), directions_(slab_directions(count)) {
    cell_edge_.push_back(pi / 2);
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

    MatrixXd within(n, n), across(n, n);  // parts even and odd in theta combine the direct and the mirrored term
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
        *m = (0.5 * (*m + m->transpose())).eval();  // no change for samples; makes cell averages reciprocal
    }
    // Each row must integrate to 1. The defect belongs to the peak: the same direction for g > 0, the reversed one
    // (across, mirrored) for g < 0.
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
        // leaves them unchanged and gives e the eigenvalue k^2 = a e.q. The others obey
        // k^2 >= min X min Y = (1 - g^2)(1 - max(g, 0)); a quarter of that sorts mode 0 first, without spreading the
        // singular values.
        const VectorXd q = mu.asDiagonal() * y_factor.solve(VectorXd(mu.cwiseProduct(root)));
        const double k2 = (1 - g_ * g_) * (1 - std::max(g_, 0.0)) / 4;
        x += (k2 / root.dot(q)) * q * q.transpose();
    }
    const Eigen::LLT<MatrixXd> x_factor(x);
    // B = L^-1 M R^-T.
    MatrixXd b = x_factor.matrixL().solve(MatrixXd(mu.asDiagonal()));
    b = y_factor.matrixL().solve(MatrixXd(b.transpose())).transpose().eval();
    const Eigen::BDCSVD<MatrixXd> svd(b, Eigen::ComputeFullU | Eigen::ComputeFullV);
    // X, Y <= 2 bound the singular values by min(mu) / 2 from below; smaller ones are rounding.
    modes.k = svd.singularValues().cwiseMax(mu.minCoeff() / 2).cwiseInverse();
    const MatrixXd s = x_factor.matrixU().solve(svd.matrixU());
    const MatrixXd t = y_factor.matrixU().solve(svd.matrixV());
    const VectorXd inverse_root = root.cwiseInverse();
    modes.sum = inverse_root.asDiagonal() * s;
    modes.difference = inverse_root.asDiagonal() * t;
    modes.project_sum = modes.k.asDiagonal() * s.transpose() * root.asDiagonal();
    modes.project_difference = modes.k.asDiagonal() * t.transpose() * root.asDiagonal();
    if (parity == Parity::even) {
        modes.direct = within + within_mirror;
        modes.across = across + across_mirror;
        modes.sum_of_sum = modes.project_sum * modes.sum;
        modes.difference_of_difference = modes.project_difference * modes.difference;
    }
    return modes;
}

namespace {

/// Radiance that leaves at the nodes, per column.
struct Radiance {
    MatrixXd back, forward;
};

/// The conditions at both ends of a layer, for amplitudes A of S and B of D: alpha = (A + B) / 2 decays from x = 0,
/// beta = (A - B) / 2 from x = depth. Mode 0 where conservative: A = a + k b (depth / 2 - tau), B = b.
class Ends {
  public:
    Ends(const SlabModes& modes, double depth) : m_(modes) {
        decay_ = (-depth * m_.k.array()).exp();
        const VectorXd lost = -(-depth * m_.k.array()).unaryExpr([](double v) { return portable::expm1(v); });
        // S + D at 0 and S - D at depth, halved sum and difference: of x = alpha(0) + beta(depth), y = alpha(0) -
        // beta(depth).
        MatrixXd symmetric = m_.sum * (1 + decay_.array()).matrix().asDiagonal();
        symmetric += m_.difference * lost.asDiagonal();
        MatrixXd antisymmetric = m_.sum * lost.asDiagonal();
        antisymmetric += m_.difference * (1 + decay_.array()).matrix().asDiagonal();
        if (m_.conservative) {
            slope_ = m_.k(0) * depth / 2;
            symmetric.col(0) = 2 * m_.sum.col(0);
            antisymmetric.col(0) = 2 * slope_ * m_.sum.col(0) + 2 * m_.difference.col(0);
        }
        symmetric_.compute(symmetric);
        antisymmetric_.compute(antisymmetric);
    }

    /// y of the field of isotropic light of radiance 1 on the far side and -1 on the near side; its x is 0.
    VectorXd tilted() const { return antisymmetric_.solve(VectorXd::Constant(m_.k.size(), -4)); }

    /// Exit radiance of a source inside, without incident light. Its particular solution starts at 0; given are its
    /// alpha at depth and beta at 0, and for a conservative mode 0 (whose alpha and beta are 0) A and B at depth.
    Radiance leaving(const MatrixXd& alpha, const MatrixXd& beta, const Eigen::RowVectorXd& a_end,
                     const Eigen::RowVectorXd& b_end) const {
        const MatrixXd outward = m_.sum - m_.difference;
        MatrixXd rhs_symmetric = -outward * (alpha + beta), rhs_antisymmetric = outward * (alpha - beta);
        if (m_.conservative) {
            const MatrixXd end = m_.sum.col(0) * a_end - m_.difference.col(0) * b_end;
            rhs_symmetric -= end;
            rhs_antisymmetric += end;
        }
        const MatrixXd x = symmetric_.solve(rhs_symmetric), y = antisymmetric_.solve(rhs_antisymmetric);
        // I- = S at 0 and I+ = S at depth, since nothing enters there.
        const MatrixXd alpha0 = (x + y) / 2, beta_end = (x - y) / 2;
        MatrixXd a0 = alpha0 + decay_.asDiagonal() * beta_end + beta,
                 a1 = decay_.asDiagonal() * alpha0 + beta_end + alpha;
        if (m_.conservative) {
            a0.row(0) = x.row(0) + slope_ * y.row(0);
            a1.row(0) = x.row(0) - slope_ * y.row(0) + a_end;
        }
        return {m_.sum * a0, m_.sum * a1};
    }

  private:
    const SlabModes& m_;
    VectorXd decay_;  ///< exp(-k depth)
    double slope_ = 0;
    Eigen::PartialPivLU<MatrixXd> symmetric_, antisymmetric_;
};

/// Exit radiance of one parity, all orders: sources `plus`, `minus` [node, incident] times exp(-tau / mu_i) / mu_i.
Radiance exit_radiance(const SlabModes& m, double depth, const std::vector<double>& mu_i, const MatrixXd& plus,
                       const MatrixXd& minus) {
    const Index n = m.k.size(), count = plus.cols();
    const MatrixXd c_sum = m.project_sum * (plus + minus), c_difference = m.project_difference * (plus - minus);
    // alpha(depth) and beta(0) of the particular solution that starts at 0 are slab path factors at mu = 1/k.
    MatrixXd alpha(n, count), beta(n, count);
    for (Index i = 0; i < count; ++i) {
        const double mu = mu_i[std::size_t(i)];
        for (Index j = 0; j < n; ++j) {
            alpha(j, i) = (c_sum(j, i) + c_difference(j, i)) / 2 * slab_forward_factor(depth, mu, 1 / m.k(j));
            beta(j, i) = (c_sum(j, i) - c_difference(j, i)) / 2 * slab_back_factor(depth, mu, 1 / m.k(j));
        }
    }
    Eigen::RowVectorXd a_end, b_end;
    if (m.conservative) {
        // Mode 0: B' = source, A' = -k B + source.
        a_end.resize(count), b_end.resize(count);
        for (Index i = 0; i < count; ++i) {
            const double mu = mu_i[std::size_t(i)], fed = mu > 0 ? -portable::expm1(-depth / mu) : 1;
            // Integral of 1 - exp(-tau / mu) over the depth. The difference loses digits only where it is small against
            // depth * fed, to which it is added.
            const double fed_twice = mu > 0 ? depth - mu * fed : depth;
            b_end(i) = c_sum(0, i) * fed;
            a_end(i) = -m.k(0) * c_sum(0, i) * fed_twice + c_difference(0, i) * fed;
            alpha(0, i) = beta(0, i) = 0;
        }
    }
    return Ends(m, depth).leaving(alpha, beta, a_end, b_end);
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

namespace {

/// Means over [0, 1] of exp(-x v) and of exp(-x v) (v - 1/2), x >= 0.
double mean_decay(double x) { return x > 0 ? -portable::expm1(-x) / x : 1.0; }
double mean_tilt(double x) {
    if (x > 1) return (mean_decay(x) - (1 + portable::exp(-x)) / 2) / x;
    double sum = 0, power = 1;  // sum of (-x)^k / k! k / (2 (k + 1) (k + 2)), whose 17th term is below eps
    for (int k = 1; k < 17; ++k) {
        power *= -x / k;
        sum += power * k / (2.0 * (k + 1) * (k + 2));
    }
    return sum;
}

}  // namespace

SlabOrdinates::Paths SlabOrdinates::multiply_scattered_paths(double depth) const {
    const SlabModes& m = modes_[0];
    const SlabDirections& d = directions_;
    const Index n = m.k.size();
    const Ends ends(m, depth);

    // Two sources: radiance 1 everywhere, the sum of the probabilities of both sides, and the reversed difference of
    // the far and the near side: alpha = y/2 exp(-k tau), beta = -y/2 exp(-k (depth - tau)), mode 0 of slope -k y.
    MatrixXd alpha(n, 2), beta(n, 2);
    Eigen::RowVector2d a_end, b_end;
    const VectorXd constant = m.project_sum * VectorXd::Constant(n, 2);
    for (Index j = 0; j < n; ++j) alpha(j, 0) = beta(j, 0) = constant(j) / 2 * depth * mean_decay(m.k(j) * depth);
    b_end(0) = constant(0) * depth;
    a_end(0) = -m.k(0) * constant(0) * depth * depth / 2;

    const VectorXd y = ends.tilted();
    const MatrixXd &of_sum = m.sum_of_sum, &of_difference = m.difference_of_difference;
    const VectorXd decay = (-depth * m.k.array()).exp();
    a_end(1) = y(0) * depth * (of_difference(0, 0) - of_sum(0, 0) * m.k(0) * m.k(0) * depth * depth / 12);
    b_end(1) = 0;
    for (Index j = 1; j < n; ++j) {
        // Of mode 0, A = k y (depth / 2 - tau) and B = y.
        const double k = m.k(j), mean = mean_decay(k * depth), tilt = mean_tilt(k * depth);
        double sum = y(0) * depth * (of_difference(j, 0) * mean + of_sum(j, 0) * m.k(0) * depth * tilt);
        for (Index i = 1; i < n; ++i) {
            // exp(-k (depth - tau)) times either exponential of mode i, integrated over the depth.
            const double along = std::max(decay(i), decay(j)) * mean_decay(std::abs(m.k(i) - k) * depth),
                         against = mean_decay((m.k(i) + k) * depth);
            sum += y(i) / 2 * depth *
                   ((of_sum(j, i) + of_difference(j, i)) * along - (of_sum(j, i) - of_difference(j, i)) * against);
        }
        alpha(j, 1) = sum / 2;
        beta(j, 1) = -sum / 2;
        // Mode 0 fed by mode j: A' = -k B + D's source, B' = S's source, odd about the middle.
        a_end(1) += y(j) * depth * (of_difference(0, j) * mean + of_sum(0, j) * m.k(0) * depth * tilt);
    }
    alpha.row(0).setZero(), beta.row(0).setZero();
    const MatrixXd all = ends.leaving(alpha, beta, a_end, b_end).back;

    // Subtract unscattered and singly scattered light. mu times a factor is symmetric in both directions.
    Paths paths{(all.col(0) - all.col(1)) / 2, (all.col(0) + all.col(1)) / 2};
    const auto cosine = Eigen::Map<const VectorXd>(d.mu.data(), n),
               weight = Eigen::Map<const VectorXd>(d.weight.data(), n);
    for (Index j = 0; j < n; ++j) {
        const double mu = cosine(j);
        paths.forward(j) -= depth / mu * portable::exp(-depth / mu);
        for (Index i = 0; i <= j; ++i) {
            const double to = cosine(i), back_again = mu / to;
            const double forward =
                m.direct(i, j) * slab_forward_factor(depth, mu, to) * slab_forward_path(depth, mu, to);
            const double back = m.across(i, j) * slab_back_factor(depth, mu, to) * slab_back_path(depth, mu, to);
            paths.forward(j) -= weight(i) * forward;
            paths.back(j) -= weight(i) * back;
            if (i == j) continue;
            paths.forward(i) -= weight(j) * back_again * forward;
            paths.back(i) -= weight(j) * back_again * back;
        }
    }
    for (Index j = 0; j < n; ++j) {
        const double scattered = -portable::expm1(-depth / cosine(j));
        paths.forward(j) /= scattered;
        paths.back(j) /= scattered;
    }
    return paths;
}

}  // namespace medulla::sim2d
