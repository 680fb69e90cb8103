// The C library's functions under one name for float and double. The standard library has inline functions for floats,
// which a build without optimisation does not inline: of two files compiled for different processors the linker keeps
// one file's, and code for AVX could end up in a program for every processor. These are in the runtime's tagged
// namespace.
#pragma once

#include <math.h>

#include "medulla/config.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace detail {
namespace math {

MEDULLA_HOT float sqrt(float x) noexcept { return ::sqrtf(x); }
MEDULLA_HOT float abs(float x) noexcept { return ::fabsf(x); }
MEDULLA_HOT float exp(float x) noexcept { return ::expf(x); }
MEDULLA_HOT float expm1(float x) noexcept { return ::expm1f(x); }
MEDULLA_HOT float log(float x) noexcept { return ::logf(x); }
MEDULLA_HOT float erf(float x) noexcept { return ::erff(x); }
MEDULLA_HOT float erfc(float x) noexcept { return ::erfcf(x); }
MEDULLA_HOT float sin(float x) noexcept { return ::sinf(x); }
MEDULLA_HOT float cos(float x) noexcept { return ::cosf(x); }
MEDULLA_HOT float atan2(float y, float x) noexcept { return ::atan2f(y, x); }
MEDULLA_HOT float ceil(float x) noexcept { return ::ceilf(x); }
MEDULLA_HOT float floor(float x) noexcept { return ::floorf(x); }
MEDULLA_HOT float copysign(float x, float y) noexcept { return ::copysignf(x, y); }
MEDULLA_HOT double sqrt(double x) noexcept { return ::sqrt(x); }
MEDULLA_HOT double abs(double x) noexcept { return ::fabs(x); }
MEDULLA_HOT double exp(double x) noexcept { return ::exp(x); }
MEDULLA_HOT double expm1(double x) noexcept { return ::expm1(x); }
MEDULLA_HOT double log(double x) noexcept { return ::log(x); }
MEDULLA_HOT double erf(double x) noexcept { return ::erf(x); }
MEDULLA_HOT double erfc(double x) noexcept { return ::erfc(x); }
MEDULLA_HOT double sin(double x) noexcept { return ::sin(x); }
MEDULLA_HOT double cos(double x) noexcept { return ::cos(x); }
MEDULLA_HOT double atan2(double y, double x) noexcept { return ::atan2(y, x); }
MEDULLA_HOT double ceil(double x) noexcept { return ::ceil(x); }
MEDULLA_HOT double floor(double x) noexcept { return ::floor(x); }
MEDULLA_HOT double copysign(double x, double y) noexcept { return ::copysign(x, y); }

}  // namespace math
}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
