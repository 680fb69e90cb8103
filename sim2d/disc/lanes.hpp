// SIMD loops over the columns of the disc solver's rows: one column is one mode, and columns never couple.
// Without contraction and with a fixed order of sums every instruction set gives the same bits.
#pragma once

#include <cstddef>

#include "sim2d/disc/grid.hpp"

namespace medulla::sim2d::lanes {

/// c = a b: a is rows x inner with row length a_stride, b and c have rows of `stride`; columns [0, active), active a
/// multiple of 8.
void product(const DiscReal* a, std::size_t a_stride, const DiscReal* b, DiscReal* c, std::size_t rows,
             std::size_t inner, std::size_t stride, std::size_t active);
/// (x, y) -> scale (even x + odd y, odd x + even y).
void mix(DiscReal* x, DiscReal* y, const DiscReal* even, const DiscReal* odd, DiscReal scale, std::size_t active);
/// sum = scale (x + y), difference = scale (x - y); sum may be y.
void sum_difference(const DiscReal* x, const DiscReal* y, DiscReal scale, DiscReal* sum, DiscReal* difference,
                    std::size_t active);
/// flux = transmission flux + sum over taps of weight[a] source[a step].
void advance(DiscReal* flux, DiscReal transmission, const DiscReal* weight, const DiscReal* source, std::size_t step,
             std::size_t taps, std::size_t active);
/// sum += x y and x -= scale y, element by element of `rows` rows; scale and sum are one row.
void multiply_add(const DiscReal* x, const DiscReal* y, DiscReal* sum, std::size_t rows, std::size_t stride,
                  std::size_t active);
void subtract(DiscReal* x, const DiscReal* y, const DiscReal* scale, std::size_t rows, std::size_t stride,
              std::size_t active);

}  // namespace medulla::sim2d::lanes
