// Many hits at once, each with its own fibre, direction, offset and exit: for wavefronts and arrays.
// Rests on near_field.hpp, whose near_field and evaluate are the reference implementation.
#pragma once

#include "medulla/config.hpp"
#include "medulla/near_field.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

/// result[i] = near_field(fibre_of(i), known[i], h[i]).evaluate(drawn[i]), i in [0, count).
/// @param fibre_of i to a `const Fibre<Channels>&`  @param Direction Vector or Angles
template <int Channels, class FibreOf, class Direction>
MEDULLA_FN void evaluate_batch(int count, FibreOf&& fibre_of, const Direction* known, const float* h,
                               const Direction* drawn, Evaluation<Channels>* result) noexcept {
    for (int i = 0; i < count; ++i) result[i] = near_field(fibre_of(i), known[i], h[i]).evaluate(drawn[i]);
}
/// The same of one fibre.
template <int Channels, class Direction>
MEDULLA_FN void evaluate_batch(const Fibre<Channels>& fibre, int count, const Direction* known, const float* h,
                               const Direction* drawn, Evaluation<Channels>* result) noexcept {
    evaluate_batch(
        count, [&](int) -> const Fibre<Channels>& { return fibre; }, known, h, drawn, result);
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
