// Levenberg-Marquardt for CP with the longest block eliminated and the Schur complement solved by preconditioned
// conjugate gradients. See lm.hpp for sources.
#include "tensor/lm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace medulla::tensor {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Inexact Newton: loose solves of many systems are faster than tight solves of few. On the table of bench/stand_in.hpp
// at ranks 16 and 128, a tenth of the residual and 20 iterations reach the error of 1e-3 and 300 iterations in a fifth
// of the time (bench/bench_cp).
constexpr double residual_kept = 0.1;
constexpr int most_iterations = 12;

double dot(const RowMatrix& a, const RowMatrix& b) { return (a.array() * b.array()).sum(); }
double squared_norm(const Factors& factors) {
    double sum = 0;
    for (const RowMatrix& f : factors) sum += f.squaredNorm();
    return sum;
}

/// State at one point: objective, factors with balanced columns, MTTKRPs.
struct Point {
    Factors factors, matricised;
    double squared_error = 0, objective = 0;
};

class Objective {
  public:
    Objective(const SplitTensor& tensor, double scale, double ridge) : tensor_(tensor), scale_(scale), ridge_(ridge) {}

    Point at(Factors factors) const {
        const std::size_t order = factors.size();
        Point p;
        p.factors = std::move(factors);
        p.matricised.resize(order);
        RowMatrix side = tensor_.down(p.factors, scale_);
        for (std::size_t k = 0; k < order; ++k) {
            if (k == tensor_.split()) side = tensor_.across(p.factors, scale_);
            p.matricised[k] = tensor_.mode(side, p.factors, k);
        }
        RowMatrix all = RowMatrix::Ones(p.factors[0].cols(), p.factors[0].cols());
        for (const RowMatrix& f : p.factors) all.array() *= multiplied(f.transpose(), f).array();
        const double total = all.diagonal().cwiseSqrt().sum();
        p.squared_error = 1 + all.sum() - 2 * dot(p.matricised[0], p.factors[0]);
        // As in ALS: where rounding of the three terms matters, subtract cell by cell.
        if (p.squared_error < 1e5 * std::numeric_limits<double>::epsilon() * (1 + total * total))
            p.squared_error = tensor_.residual_squared(p.factors, Eigen::VectorXd::Ones(p.factors[0].cols()), scale_);
        p.objective = (p.squared_error + ridge_ * squared_norm(p.factors)) / 2;
        return p;
    }

    /// Makes column lengths equal across modes: the same tensor with the smallest penalty. MTTKRPs are scaled alike.
    void balance(Point& p) const {
        const double order = static_cast<double>(p.factors.size());
        for (Index r = 0; r < p.factors[0].cols(); ++r) {
            double log_mean = 0;
            for (const RowMatrix& f : p.factors) log_mean += std::log(f.col(r).norm()) / order;
            const double mean = std::exp(log_mean);
            if (!(mean > 0)) continue;  // a vanished component
            for (std::size_t k = 0; k < p.factors.size(); ++k) {
                const double stretch = mean / p.factors[k].col(r).norm();
                p.factors[k].col(r) *= stretch;
                p.matricised[k].col(r) /= stretch;
            }
        }
        p.objective = (p.squared_error + ridge_ * squared_norm(p.factors)) / 2;
    }

  private:
    const SplitTensor& tensor_;
    double scale_, ridge_;
};

/// The Gauss-Newton system at a point, its longest block eliminated. Short modes are all but `longest`.
class NormalEquations {
  public:
    NormalEquations(const Point& point, double ridge) : u_(point.factors), order_(u_.size()), rank_(u_[0].cols()) {
        for (std::size_t k = 1; k < order_; ++k)
            if (u_[k].rows() > u_[longest_].rows()) longest_ = k;
        for (const RowMatrix& f : u_) grams_.push_back(multiplied(f.transpose(), f));
        pairs_.resize(order_ * order_);
        for (std::size_t n = 0; n < order_; ++n)
            for (std::size_t m = 0; m < order_; ++m) {
                RowMatrix& product = pairs_[n * order_ + m];
                if (m < n) {
                    product = pairs_[m * order_ + n];
                    continue;
                }
                product = RowMatrix::Ones(rank_, rank_);
                for (std::size_t k = 0; k < order_; ++k)
                    if (k != n && k != m) product.array() *= grams_[k].array();
            }
        gradient_.resize(order_);
        for (std::size_t n = 0; n < order_; ++n)
            gradient_[n] = multiplied(u_[n], pair(n, n)) - point.matricised[n] + ridge * u_[n];
    }

    const Factors& gradient() const { return gradient_; }

    /// The step for a shift (ridge + damping) of the diagonal; `residual_dot_step`: (residual of the conjugate
    /// gradients) . step.
    Factors step(double shift, double& residual_dot_step) {
        shift_ = shift;
        inverse_.resize(order_);
        const MatrixXd identity = MatrixXd::Identity(rank_, rank_);
        for (std::size_t n = 0; n < order_; ++n) inverse_[n] = (pair(n, n) + shift * identity).llt().solve(identity);
        const std::size_t last = longest_;
        Factors d(order_), r(order_), z(order_), p, image(order_);
        const RowMatrix eliminated = multiplied(gradient_[last], inverse_[last]);
        const RowMatrix back = multiplied(eliminated.transpose(), u_[last]);
        for (std::size_t n = 0; n < order_; ++n) {
            d[n] = RowMatrix::Zero(u_[n].rows(), rank_);
            if (n == last) continue;
            r[n] = multiplied(u_[n], (back.array() * pair(n, last).array()).matrix().eval()) - gradient_[n];
        }
        precondition(r, z);
        p = z;
        double rz = product(r, z), first = product(r, r);
        for (int k = 0; k < most_iterations && first > 0; ++k) {
            apply(p, image);
            const double curvature = product(p, image);
            if (!(curvature > 0)) break;  // rounding: the matrix is positive definite
            const double a = rz / curvature;
            for (std::size_t n = 0; n < order_; ++n)
                if (n != last) {
                    d[n] += a * p[n];
                    r[n] -= a * image[n];
                }
            if (product(r, r) <= residual_kept * residual_kept * first) break;
            precondition(r, z);
            const double next = product(r, z);
            const double b = next / rz;
            rz = next;
            for (std::size_t n = 0; n < order_; ++n)
                if (n != last) p[n] = z[n] + b * p[n];
        }
        residual_dot_step = product(r, d);
        coupling_ = RowMatrix::Zero(rank_, rank_);
        for (std::size_t n = 0; n < order_; ++n)
            if (n != last) coupling_.array() += multiplied(d[n].transpose(), u_[n]).array() * pair(n, last).array();
        RowMatrix pushed = gradient_[last];
        add_product(u_[last], coupling_, pushed);
        d[last] = -multiplied(pushed, inverse_[last]);
        return d;
    }

  private:
    const RowMatrix& pair(std::size_t n, std::size_t m) const { return pairs_[n * order_ + m]; }

    double product(const Factors& a, const Factors& b) const {
        double sum = 0;
        for (std::size_t n = 0; n < order_; ++n)
            if (n != longest_) sum += dot(a[n], b[n]);
        return sum;
    }

    void precondition(const Factors& r, Factors& z) const {
        for (std::size_t n = 0; n < order_; ++n)
            if (n != longest_) multiply(r[n], inverse_[n], z[n]);
    }

    /// Schur complement of the longest block times p.
    void apply(const Factors& p, Factors& image) {
        const std::size_t last = longest_;
        inner_.resize(order_);
        for (std::size_t n = 0; n < order_; ++n)
            if (n != last) multiply(p[n].transpose(), u_[n], inner_[n]);
        coupling_.setZero(rank_, rank_);
        for (Index row = 0; row < rank_; ++row)
            for (std::size_t n = 0; n < order_; ++n)
                if (n != last)
                    coupling_.row(row).array() += inner_[n].row(row).array() * pair(n, last).row(row).array();
        if (3 * u_[last].rows() < 2 * rank_) {  // fewer multiplications through the factor than through its Gram
            multiply(u_[last], coupling_, thin_);
            multiply(thin_, inverse_[last], thin_image_);
            multiply(thin_image_.transpose(), u_[last], through_);
        } else {
            multiply(inverse_[last], coupling_.transpose(), half_);
            multiply(half_, grams_[last], through_);
        }
        // Row by row, so that what all sums share is read from memory once.
        sums_.resize(order_);
        for (RowMatrix& sum : sums_) sum.resize(rank_, rank_);
        for (Index row = 0; row < rank_; ++row)
            for (std::size_t n = 0; n < order_; ++n) {
                if (n == last) continue;
                auto sum = sums_[n].row(row).array();
                sum = -through_.row(row).array() * pair(n, last).row(row).array();
                for (std::size_t m = 0; m < order_; ++m)
                    if (m != n && m != last) sum += inner_[m].row(row).array() * pair(n, m).row(row).array();
            }
        for (std::size_t n = 0; n < order_; ++n) {
            if (n == last) continue;
            multiply(p[n], pair(n, n), image[n]);
            add_product(u_[n], sums_[n], image[n]);
            image[n] += shift_ * p[n];
        }
    }

    const Factors& u_;
    std::size_t order_, longest_ = 0;
    Index rank_;
    double shift_ = 0;
    std::vector<RowMatrix> grams_, pairs_, inverse_, inner_, sums_;
    RowMatrix coupling_, half_, through_, thin_, thin_image_;
    Factors gradient_;
};

}  // namespace

Fit lm_steps(const SplitTensor& tensor, double scale, Factors start, double ridge, int max_steps, double tolerance) {
    const Objective objective(tensor, scale, ridge);
    const std::size_t order = start.size();
    const Index rank = start[0].cols();
    Point point = objective.at(std::move(start));
    objective.balance(point);
    Fit fit;
    fit.ridge = ridge;
    double damping = 1e-2, growth = 2;
    bool moved = true;
    std::vector<NormalEquations> equations;
    fit.stop = Stop::sweeps;
    for (int step = 0; step < max_steps; ++step) {
        fit.iterations = step + 1;
        if (moved) {
            equations.clear();
            equations.emplace_back(point, ridge);
        }
        double residual_dot_step = 0;
        const Factors d = equations[0].step(ridge + damping, residual_dot_step);
        Factors moved_factors(order);
        double slope = 0, length = 0;
        for (std::size_t k = 0; k < order; ++k) {
            moved_factors[k] = point.factors[k] + d[k];
            slope += dot(equations[0].gradient()[k], d[k]);
            length += d[k].squaredNorm();
        }
        // Decrease of the quadratic model at a step that leaves (H + ridge + damping) d = -gradient - residual.
        const double predicted = (damping * length + residual_dot_step - slope) / 2;
        Point next = objective.at(std::move(moved_factors));
        const double gain = (point.objective - next.objective) / predicted;
        moved = predicted > 0 && gain > 1e-4;  // false also where the objective is not finite
        if (moved) {
            objective.balance(next);
            point = std::move(next);
            damping *= std::max(0.2, 1 - std::pow(2 * gain - 1, 3));  // Nielsen 1999
            damping = std::max(damping, 1e-12);
            growth = 2;
        } else {
            damping *= growth;
            growth *= 2;
        }
        fit.error = std::sqrt(point.squared_error);
        fit.trace.push_back(fit.error);
        double total = 0;
        for (Index r = 0; r < rank; ++r) {
            double component = 1;
            for (const RowMatrix& f : point.factors) component *= f.col(r).norm();
            total += component;
        }
        if (fit.error <= rounding_floor(order, static_cast<int>(rank), total)) {
            fit.stop = Stop::exact;
            break;
        }
        if (damping > 1e8) {
            fit.stop = Stop::stalled;
            break;
        }
        if (is_flat(fit.trace, tolerance)) {
            fit.stop = Stop::converged;
            break;
        }
    }
    fit.factors = std::move(point.factors);
    fit.weights = Eigen::VectorXd::Ones(rank);
    for (RowMatrix& f : fit.factors) fit.weights.array() *= normalise_columns(f, f).array();
    return fit;
}

}  // namespace medulla::tensor
