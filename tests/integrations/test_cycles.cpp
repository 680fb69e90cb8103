// The Cycles closure through Cycles' conventions: dPdu, normals of thick curves, v of ribbons.
#include "adapter_checks.hpp"
#include "integrations/cycles/bsdf_medulla.h"

namespace {

using adapters::Exit;
using adapters::Hit;
using adapters::V3;

template <bool Ribbon>
class Adapter {
  public:
    explicit Adapter(const medulla::FurParameters<3>& p) : tables_(p), parameters_(p) {}
    Exit evaluate(const Hit& hit, V3 drawn) const {
        Closure c(*this, hit);
        float pdf = 0;
        const auto closure = reinterpret_cast<const ccl::ShaderClosure*>(&c.bsdf);
        const ccl::Spectrum value = ccl::bsdf_medulla_eval(&c.sd, closure, single(drawn), &pdf);
        return {double(value.z), double(pdf)};
    }
    Exit sample(const Hit& hit, const float (&u)[5], V3& drawn) const {
        Closure c(*this, hit);
        float pdf = 0;
        ccl::Spectrum value;
        ccl::float3 wo;
        ccl::float2 roughness;
        const auto closure = reinterpret_cast<const ccl::ShaderClosure*>(&c.bsdf);
        ccl::bsdf_medulla_sample(closure, &c.sd, {u[0], u[1], u[2]}, &value, &wo, &pdf, &roughness);
        drawn = {double(wo.x), double(wo.y), double(wo.z)};
        return {double(value.z), double(pdf)};
    }

  private:
    static ccl::float3 single(V3 w) { return {float(w.x), float(w.y), float(w.z)}; }
    struct Closure {
        ccl::ShaderData sd = {};
        ccl::MedullaBSDF bsdf = {};
        // curve_shader_setup: v of a ribbon is the sine along cross(tangent, -D), and Ng is wi there.
        Closure(const Adapter& a, const Hit& hit) {
            sd.wi = single(hit.known()), sd.dPdu = single(3.0 * hit.tangent);
            sd.type = Ribbon ? ccl::PRIMITIVE_CURVE_RIBBON : ccl::PRIMITIVE_CURVE_THICK;
            sd.Ng = Ribbon ? sd.wi : single(hit.normal);
            sd.v = Ribbon ? float(adapters::dot(hit.normal, adapters::unit(cross(hit.tangent, hit.known())))) : 0;
            REQUIRE(ccl::bsdf_medulla_setup(&sd, &bsdf, ccl::CLOSURE_BSDF_MEDULLA_ID, a.parameters_, a.tables_.get()));
        }
    };
    adapters::OwnedTables tables_;
    medulla::FurParameters<3> parameters_;
};

}  // namespace

TEST_CASE("The Cycles closure on thick curves", "[integrations]") {
    adapters::check([](const medulla::FurParameters<3>& p) { return Adapter<false>(p); });
}

TEST_CASE("The Cycles closure on ribbons", "[integrations]") {
    adapters::check([](const medulla::FurParameters<3>& p) { return Adapter<true>(p); });
}

TEST_CASE("The Cycles closure says when there is no room or a parameter is bad", "[integrations]") {
    ccl::ShaderData sd = {};
    sd.wi = {0, 0, 1}, sd.Ng = {0, 0, 1}, sd.dPdu = {1, 0, 0}, sd.type = ccl::PRIMITIVE_CURVE_THICK;
    ccl::MedullaBSDF bsdf = {};
    medulla::FurParameters<3> p;
    CHECK(ccl::bsdf_medulla_setup(&sd, &bsdf, ccl::CLOSURE_BSDF_MEDULLA_ID, p, nullptr));
    p.eta = 0;
    CHECK(!ccl::bsdf_medulla_setup(&sd, &bsdf, ccl::CLOSURE_BSDF_MEDULLA_ID, p, nullptr));
    sd.full = true;
    CHECK(!ccl::bsdf_medulla_setup(&sd, &bsdf, ccl::CLOSURE_BSDF_MEDULLA_ID, medulla::FurParameters<3>(), nullptr));
}
