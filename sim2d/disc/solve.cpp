#include "sim2d/disc/solve.hpp"

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#include "sim2d/disc/gmres.hpp"
#include "sim2d/disc/single.hpp"
#include "sim2d/disc/transport.hpp"

namespace medulla::sim2d {
namespace {

/// High modes decay into denormals, which cost 100 cycles each: flushes them to zero in its lifetime.
class FlushDenormals {
  public:
#if defined(__SSE2__)
    FlushDenormals() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | 0x8040u); }  // flush to zero, denormals are zeros
    ~FlushDenormals() { _mm_setcsr(saved_); }
    FlushDenormals(const FlushDenormals&) = delete;
    FlushDenormals& operator=(const FlushDenormals&) = delete;

  private:
    unsigned saved_;
#else
    FlushDenormals() {}  // elsewhere only slower
#endif
};

/// Approximate norm of (1 - A)^-1: the expected number of further collisions, 2 sigma^2 (1 - g) / j^2 by diffusion of
/// the slowest mode, j = 2.405 the first zero of J0, plus those of light that travels straight.
double amplification(double g, double sigma) { return 1 + 2 * sigma + 0.346 * sigma * sigma * (1 - g); }

/// Every row's column 0: to = a x + b y.
void combine(DiscField& to, double a, const DiscField& x, double b, const DiscField& y, std::size_t stride) {
    for (std::size_t i = 0; i < to.size(); i += stride)
        to[i] = static_cast<DiscReal>(a * static_cast<double>(x[i]) + b * static_cast<double>(y[i]));
}

}  // namespace

DiscExit solve_disc_transport(const DiscGrid& grid, double sigma, double sigma_a, double tolerance, int most_steps) {
    const std::size_t stride = grid.stride, most = static_cast<std::size_t>(most_steps);
    const FlushDenormals flush;
    const double extinction = sigma + sigma_a;
    DiscTransport transport(grid, extinction);
    DiscField radiance(transport.size()), source(transport.size());
    transport.first_collision(source);
    transport.stream(source, radiance, stride);
    transport.uniform_radiance(radiance);
    transport.scatter(radiance, source, stride, 1);  // second collisions over sigma^2, column 0 over sigma: finite at 0
    const auto collide = [&](const DiscField& in, DiscField& out, std::size_t active) {
        transport.stream(in, radiance, active);
        transport.scatter(radiance, out, active, sigma);
    };
    const DiscIteration many = gmres(collide, std::move(source), stride, tolerance, most);

    std::vector<DiscReal> rows(2 * grid.offset.size() * stride);
    transport.stream(many.solution, radiance, stride, rows.data());
    DiscExit exit;
    exit.iterations = many.iterations;
    exit.residual = many.residual;
    exit.unconverged = many.left * amplification(grid.mean_cosine, sigma);
    exit.offset = grid.offset;
    exit.modes = stride - 1;
    for (std::size_t m = 0; m + 1 < grid.offset.size(); ++m) {
        const double collided = disc_energy(extinction, grid.offset[m]) / extinction;  // F / sigma
        const DiscReal *re = &rows[2 * m * stride], *im = re + stride;
        exit.rest.push_back(static_cast<double>(re[0]) / collided);
        for (std::size_t k = 1; k < stride; ++k)
            exit.lobes.push_back(sigma / collided * std::complex<double>(re[k], im[k]));
    }
    // The last chord is the tangent: I / F -> J(r = 1, psi = pi / 2) / sigma.
    exit.rest.push_back(transport.grazing(many.solution, 0).real());
    for (std::size_t k = 1; k < stride; ++k) exit.lobes.push_back(sigma * transport.grazing(many.solution, k));
    exit.length = exit.rest;
    if (sigma_a == 0) return exit;

    // Column 0 again. T = uniform + sigma stream(S), S = p * T the solution above, is the integral of exp(-sigma_a s)
    // over a path s, so W = 1 - sigma_a T is the mean of exp(-sigma_a L) and M, that of L exp(-sigma_a L), is the
    // radiance of a source W: M = stream(W) + sigma stream(p * M). Weighting by t is streaming twice.
    const std::size_t first = 8;
    DiscField uniform(transport.size()), flown(transport.size()), twice(transport.size());
    transport.uniform_radiance(uniform);
    transport.stream(many.solution, flown, first);
    combine(radiance, 1, uniform, sigma, flown, stride);  // T
    transport.stream(radiance, twice, first);
    combine(twice, 1, uniform, -sigma_a, twice, stride);  // stream(W)
    DiscField lengths(transport.size());
    transport.scatter(twice, lengths, first, 1);
    for (std::size_t i = 0; i < lengths.size(); ++i)
        if (i % stride > 0) lengths[i] = 0;
    const DiscIteration one = gmres(collide, std::move(lengths), stride, tolerance, most);
    exit.unconverged = std::max(exit.unconverged, one.left * amplification(grid.mean_cosine, sigma));
    combine(radiance, 1, one.solution, -sigma_a, flown, stride);
    DiscField source_of_lengths = radiance;
    transport.stream(source_of_lengths, radiance, first, rows.data());
    for (std::size_t m = 0; m + 1 < grid.offset.size(); ++m)
        exit.length[m] =
            static_cast<double>(rows[2 * m * stride]) * extinction / disc_energy(extinction, grid.offset[m]);
    exit.length.back() = transport.grazing(source_of_lengths, 0).real();
    return exit;
}

}  // namespace medulla::sim2d
