/* A fur fibre as a closure of Cycles, to be placed beside kernel/closure/bsdf_principled_hair_chiang.h.
 * docs/integrations.md has the conventions and the places where Cycles lists its closures.
 *
 * Frame: X = dPdu, root to tip; Y = X x wi; Z = X x Y. These are the fibre's axes, and right-handed. h: sine of the
 * angle from the normal to Z about X, as in Cycles' own hair.
 * Measure: eval includes the cosine, so it returns the fibre's value unchanged.
 * Transport: sd->wi is the known direction, towards the viewer; wo is drawn.
 * Random numbers: three; z, which chooses the lobe, is split into two of 12 bits. */

#pragma once

#include "kernel/types.h"

#include "kernel/closure/alloc.h"
#include "kernel/closure/bsdf_util.h"

#include "medulla/medulla.hpp"
#include "medulla/random.hpp"

CCL_NAMESPACE_BEGIN

struct MedullaBSDF {
  SHADER_CLOSURE_BASE;

  /* From closure_alloc_extra: a fibre is larger than a closure. */
  ccl_private medulla::Fibre<3> *fibre;
  float h;
};

static_assert(sizeof(ShaderClosure) >= sizeof(MedullaBSDF), "MedullaBSDF is too large!");

ccl_device_inline medulla::Vector medulla_vector(const float3 w)
{
  return {w.x, w.y, w.z};
}

ccl_device_inline float3 medulla_local(const ccl_private ShaderData *sd,
                                       const ccl_private MedullaBSDF *bsdf,
                                       const float3 w)
{
  const float3 X = safe_normalize(sd->dPdu);
  return to_local(w, X, bsdf->N, safe_normalize(cross(X, bsdf->N)));
}

ccl_device_inline medulla::NearField<3> medulla_hit(const ccl_private ShaderData *sd,
                                                    const ccl_private MedullaBSDF *bsdf)
{
  return medulla::near_field(
      *bsdf->fibre, medulla_vector(medulla_local(sd, bsdf, sd->wi)), bsdf->h);
}

ccl_device_inline Spectrum medulla_spectrum(const medulla::Colour<3> &colour)
{
  return make_float3(colour.value[0], colour.value[1], colour.value[2]);
}

/* Sets up a closure from bsdf_alloc; false if there is no room for it or the parameters are invalid.
 * type: the ClosureType that was added for it. */
ccl_device bool bsdf_medulla_setup(ccl_private ShaderData *sd,
                                   ccl_private MedullaBSDF *bsdf,
                                   const ClosureType type,
                                   const medulla::FurParameters<3> &parameters,
                                   const medulla::DenseTables *tables)
{
  ccl_private void *memory = closure_alloc_extra(sd, sizeof(medulla::Fibre<3>));
  if (memory == nullptr) {
    return false;
  }
  bsdf->type = type;
  bsdf->fibre = new (memory) medulla::Fibre<3>(medulla::make_fibre(parameters, tables));

  const float3 X = safe_normalize(sd->dPdu);
  const float3 Y = safe_normalize(cross(X, sd->wi));
  const float3 Z = safe_normalize(cross(X, Y));
  bsdf->h = ((sd->type & PRIMITIVE_CURVE) == PRIMITIVE_CURVE_RIBBON) ? -sd->v :
                                                                       dot(cross(sd->Ng, X), Z);
  bsdf->N = Y;
  return bsdf->fibre->status != medulla::FibreStatus::bad_parameters;
}

ccl_device Spectrum bsdf_medulla_eval(const ccl_private ShaderData *sd,
                                      const ccl_private ShaderClosure *sc,
                                      const float3 wo,
                                      ccl_private float *pdf)
{
  const ccl_private MedullaBSDF *bsdf = (const ccl_private MedullaBSDF *)sc;
  const medulla::Evaluation<3> e =
      medulla_hit(sd, bsdf).evaluate(medulla_vector(medulla_local(sd, bsdf, wo)));
  *pdf = e.pdf;
  return medulla_spectrum(e.value);
}

ccl_device int bsdf_medulla_sample(const ccl_private ShaderClosure *sc,
                                   const ccl_private ShaderData *sd,
                                   const float3 rand,
                                   ccl_private Spectrum *eval,
                                   ccl_private float3 *wo,
                                   ccl_private float *pdf,
                                   ccl_private float2 *sampled_roughness)
{
  const ccl_private MedullaBSDF *bsdf = (const ccl_private MedullaBSDF *)sc;
  const float beta_m = bsdf->fibre->parameters.beta_m;
  *sampled_roughness = make_float2(beta_m, beta_m);

  const medulla::Stretched<2> lobe = medulla::stretch<2>(rand.z);
  const medulla::Sample<3> s =
      medulla_hit(sd, bsdf).sample({lobe.u[0], lobe.u[1], rand.x, rand.y});
  *pdf = s.pdf;
  *eval = medulla_spectrum(s.value);
  const float3 X = safe_normalize(sd->dPdu);
  *wo = to_global(make_float3(s.direction.x, s.direction.y, s.direction.z),
                  X,
                  bsdf->N,
                  safe_normalize(cross(X, bsdf->N)));
  if (!(s.pdf > 0.0f)) {
    return LABEL_NONE;
  }
  return LABEL_GLOSSY | (s.lobe == medulla::Lobe::R ? LABEL_REFLECT : LABEL_TRANSMIT);
}

CCL_NAMESPACE_END
