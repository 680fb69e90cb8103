// The BCSDF in kernels: a material prepared once, then evaluated and sampled per thread. Compiled where there is an nvcc.
#include "medulla/medulla.hpp"

using namespace medulla;

/// One exit and one sample per thread.
__global__ void shade(const FurFibre<3>* fibre, const float* h, const RandomNumbers* u, FurSample<3>* sample,
                      Colour<3>* near_value, Colour<3>* far_value) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    NearField<3> near;
    near_field(*fibre, 0.3f, h[i], near);
    NearSampler<3> sampler;
    sampler.prepare(near);
    sample[i] = sampler.sample(u[i]);
    near_value[i] = near.eval(sample[i].theta_r, sample[i].phi);
    far_value[i] = eval(*fibre, 0.3f, sample[i].theta_r, sample[i].phi, OffsetRange{});
}

/// Eight exits of one ray, and eight rays, per thread.
__global__ void shade_many(const FurFibre<3>* fibre, const float* theta, const float* h, const float* phi,
                           Colour<3>* exits, Colour<3>* rays) {
    const unsigned i = 8 * (blockIdx.x * blockDim.x + threadIdx.x);
    NearField<3> near;
    near_field(*fibre, 0.3f, h[i], near);
    eval(near, 8, theta + i, phi + i, exits + i);
    eval(*fibre, 8, theta + i, h + i, theta + i, phi + i, rays + i);
}

/// `pack` is view_of_copy(a pack that the host opened, its bytes' copy on the device).
__global__ void material(PackView pack, FurParameters<3> parameters, FurFibre<3>* fibre) {
    prepare(parameters, pack, *fibre);
}
