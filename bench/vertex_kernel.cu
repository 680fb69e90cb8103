// Path vertices of a GPU thread, for bench_vertex to compile: near field and far field, each with its fibre made, a
// direction drawn and a light evaluated.
#include "medulla/medulla.hpp"

using namespace medulla;

namespace {

template <class Field>
__device__ Colour<3> vertex(const Field& field, RandomNumbers u, Vector light, Vector& drawn) {
    const Sample<3> s = field.sample(u);
    const Evaluation<3> e = field.evaluate(light);
    drawn = s.direction;
    Colour<3> sum;
    for (int c = 0; c < 3; ++c) sum[c] = s.weight[c] + e.value[c] / (e.pdf + s.pdf);
    return sum;
}

}  // namespace

extern "C" __global__ void near_vertex(const FurParameters<3>* parameters, const DenseTables* tables, const Vector* known,
                                       const float* h, const RandomNumbers* u, const Vector* light, Vector* drawn,
                                       Colour<3>* sum) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    sum[i] = vertex(near_field(make_fibre(parameters[i], tables), known[i], h[i]), u[i], light[i], drawn[i]);
}

extern "C" __global__ void far_vertex(const FurParameters<3>* parameters, const DenseTables* tables, const Vector* known,
                                      const RandomNumbers* u, const Vector* light, Vector* drawn, Colour<3>* sum) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    sum[i] = vertex(far_field(make_fibre(parameters[i], tables), known[i]), u[i], light[i], drawn[i]);
}
