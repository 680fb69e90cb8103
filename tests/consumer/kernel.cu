// The runtime in kernels: fibres made, evaluated and drawn from per thread, on tables that were copied as bytes.
// Compiled where there is an nvcc.
#include "medulla/medulla.hpp"

using namespace medulla;

// Host and device pass compile this file apart: one layout for both.
static_assert(sizeof(DenseTables) == 296 && alignof(DenseTables) == 8, "layout");
static_assert(sizeof(Fibre<3>) == 240 && alignof(Fibre<3>) == 16, "layout");
static_assert(sizeof(NearField<3>) == 368 && alignof(NearField<3>) == 16, "layout");
static_assert(sizeof(FarField<3>) <= 2048 && alignof(FarField<3>) == 16, "layout");
static_assert(sizeof(Sample<3>) == 56 && sizeof(Evaluation<3>) == 16 && sizeof(RandomNumbers) == 20, "layout");

/// A path vertex: the fibre of a textured material, a direction, and one light.
__global__ void vertex(const DenseTables* tables, const FurParameters<3>* parameters, const Vector* known, const float* h,
                       const RandomNumbers* u, const Vector* light, Sample<3>* sample, Evaluation<3>* lit) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    const Fibre<3> fibre = make_fibre(parameters[i], tables);
    const NearField<3> hit = near_field(fibre, known[i], h[i]);
    sample[i] = hit.sample(u[i]);
    lit[i] = hit.evaluate(light[i]);
}

/// The same of whole fibres.
__global__ void far_vertex(const Fibre<3>* fibre, const Vector* known, const RandomNumbers* u, const Vector* light,
                           Sample<3>* sample, Evaluation<3>* lit) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    const FarField<3> hit = far_field(*fibre, known[i]);
    sample[i] = hit.sample(u[i]);
    lit[i] = hit.evaluate(light[i]);
}
