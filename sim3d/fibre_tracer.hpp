// The fast tracer: the same light in the same fibre as fibre_walk.hpp, in lanes of floats (Highway, run-time dispatch),
// with expected-value deposits: every flight deposits what of it would leave, whether it gets that far or not.
#pragma once

#include "sim3d/fibre.hpp"
#include "sim3d/fibre_profile.hpp"

namespace medulla::sim3d {

/// Paths of fibres without an interface between cortex and medulla (eta_m = eta_c). A path's first meeting with the
/// cuticle is split: R, and the path that enters with the rest of the weight. Faint paths end by roulette, on the
/// channel that absorbs least. The same arguments give the same bytes on one instruction set, for any number of
/// threads. white_energy and lost() add up to 1 within the noise, not to rounding as the reference's do.
/// @throws std::invalid_argument also where eta_m is another index than eta_c, or batches exceed 256
FibreProfile trace_fibre(const Fibre& fibre, const Light& light, const FibreOptions& options);

/// Instruction set that trace_fibre runs on.
const char* fibre_tracer_target();

}  // namespace medulla::sim3d
