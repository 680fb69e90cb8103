#include "sim2d/disc/lanes.hpp"

#include <algorithm>

namespace medulla::sim2d::lanes {
namespace {

#if defined(__x86_64__) && defined(__GNUC__)
#define MEDULLA_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define MEDULLA_CLONES
#endif

const std::size_t block = 4;  ///< rows of a product that share their loads of b

}  // namespace

MEDULLA_CLONES void product(const DiscReal* a, std::size_t a_stride, const DiscReal* b, DiscReal* c, std::size_t rows,
                            std::size_t inner, std::size_t stride, std::size_t active) {
    // Eight columns at a time, so that b's panel (inner x 8) stays in the first-level cache over all rows.
    for (std::size_t k = 0; k < active; k += 8) {
        std::size_t r = 0;
        for (; r + block <= rows; r += block) {
            DiscReal sum[block][8] = {};
            const DiscReal *a0 = a + r * a_stride, *a1 = a0 + a_stride, *a2 = a1 + a_stride, *a3 = a2 + a_stride;
            for (std::size_t n = 0; n < inner; ++n) {
                const DiscReal* x = b + n * stride + k;
                const DiscReal w0 = a0[n], w1 = a1[n], w2 = a2[n], w3 = a3[n];
#pragma omp simd
                for (std::size_t l = 0; l < 8; ++l) {
                    sum[0][l] += w0 * x[l];
                    sum[1][l] += w1 * x[l];
                    sum[2][l] += w2 * x[l];
                    sum[3][l] += w3 * x[l];
                }
            }
            for (std::size_t q = 0; q < block; ++q)
                for (std::size_t l = 0; l < 8; ++l) c[(r + q) * stride + k + l] = sum[q][l];
        }
        for (; r < rows; ++r) {
            DiscReal sum[8] = {};
            for (std::size_t n = 0; n < inner; ++n)
#pragma omp simd
                for (std::size_t l = 0; l < 8; ++l) sum[l] += a[r * a_stride + n] * b[n * stride + k + l];
            for (std::size_t l = 0; l < 8; ++l) c[r * stride + k + l] = sum[l];
        }
    }
}

MEDULLA_CLONES void mix(DiscReal* x, DiscReal* y, const DiscReal* even, const DiscReal* odd, DiscReal scale,
                        std::size_t active) {
#pragma omp simd
    for (std::size_t k = 0; k < active; ++k) {
        const DiscReal u = x[k], v = y[k];
        x[k] = scale * (even[k] * u + odd[k] * v);
        y[k] = scale * (odd[k] * u + even[k] * v);
    }
}

MEDULLA_CLONES void sum_difference(const DiscReal* x, const DiscReal* y, DiscReal scale, DiscReal* sum,
                                   DiscReal* difference, std::size_t active) {
#pragma omp simd
    for (std::size_t k = 0; k < active; ++k) {
        const DiscReal u = x[k], v = y[k];
        sum[k] = scale * (u + v);
        difference[k] = scale * (u - v);
    }
}

MEDULLA_CLONES void advance(DiscReal* flux, DiscReal transmission, const DiscReal* weight, const DiscReal* source,
                            std::size_t step, std::size_t taps, std::size_t active) {
    if (taps == 6) {
        const DiscReal w0 = weight[0], w1 = weight[1], w2 = weight[2], w3 = weight[3], w4 = weight[4], w5 = weight[5];
        const DiscReal *s1 = source + step, *s2 = s1 + step, *s3 = s2 + step, *s4 = s3 + step, *s5 = s4 + step;
#pragma omp simd
        for (std::size_t k = 0; k < active; ++k)
            flux[k] = (transmission * flux[k] + (w0 * source[k] + w1 * s1[k])) +
                      ((w2 * s2[k] + w3 * s3[k]) + (w4 * s4[k] + w5 * s5[k]));
        return;
    }
    for (std::size_t k = 0; k < active; ++k) flux[k] *= transmission;
    for (std::size_t q = 0; q < taps; ++q)
#pragma omp simd
        for (std::size_t k = 0; k < active; ++k) flux[k] += weight[q] * source[q * step + k];
}

MEDULLA_CLONES void multiply_add(const DiscReal* x, const DiscReal* y, DiscReal* sum, std::size_t rows,
                                 std::size_t stride, std::size_t active) {
    for (std::size_t r = 0; r < rows; ++r, x += stride, y += stride)
#pragma omp simd
        for (std::size_t k = 0; k < active; ++k) sum[k] += x[k] * y[k];
}

MEDULLA_CLONES void subtract(DiscReal* x, const DiscReal* y, const DiscReal* scale, std::size_t rows,
                             std::size_t stride, std::size_t active) {
    for (std::size_t r = 0; r < rows; ++r, x += stride, y += stride)
#pragma omp simd
        for (std::size_t k = 0; k < active; ++k) x[k] -= scale[k] * y[k];
}

}  // namespace medulla::sim2d::lanes
