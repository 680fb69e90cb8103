// pbrt-v4's adapter through pbrt's conventions: v of a curve's hit, the shading frame, the cosine outside f.
#include "adapter_checks.hpp"
#include "integrations/pbrt-v4/medulla_bxdf.h"

namespace {

using adapters::Exit;
using adapters::Hit;
using adapters::V3;

class Adapter {
  public:
    explicit Adapter(const medulla::FurParameters<3>& p) : tables_(p) {
        // Four wavelengths in place of three channels.
        parameters_.eta = p.eta, parameters_.kappa = p.kappa, parameters_.alpha = p.alpha;
        parameters_.beta_m = p.beta_m, parameters_.beta_n = p.beta_n, parameters_.layers = p.layers;
        parameters_.sigma_ms = p.sigma_ms, parameters_.sigma_ma = p.sigma_ma, parameters_.g = p.g;
        for (float& s : parameters_.sigma_ca) s = p.sigma_ca[0];
    }
    Exit evaluate(const Hit& hit, V3 drawn) const {
        const Frame f(hit);
        const pbrt::MedullaBxDF bxdf(parameters_, tables_.get(), f.v);
        const pbrt::Vector3f wo = f.local(hit.known()), wi = f.local(drawn);
        const auto mode = pbrt::TransportMode::Radiance;
        return {double(bxdf.f(wo, wi, mode)[3]) * std::abs(adapters::dot(drawn, f.z)),
                double(bxdf.PDF(wo, wi, mode, pbrt::BxDFReflTransFlags::All))};
    }
    Exit sample(const Hit& hit, const float (&u)[5], V3& drawn) const {
        const Frame f(hit);
        const pbrt::MedullaBxDF bxdf(parameters_, tables_.get(), f.v);
        auto s = bxdf.Sample_f(f.local(hit.known()), u[0], {u[1], u[2]}, pbrt::TransportMode::Radiance,
                               pbrt::BxDFReflTransFlags::All);
        if (!s) return {};
        drawn = double(s->wi.x) * f.x + double(s->wi.y) * f.y + double(s->wi.z) * f.z;
        return {double(s->f[3]) * std::abs(double(s->wi.z)), double(s->pdf)};
    }

  private:
    struct Frame {
        V3 x, y, z;
        float v;
        // Curve::RecursiveIntersect: dpdv is dpdu turned by a right angle in the plane across the ray; v grows along
        // it; a cylinder's dpdv is turned about dpdu by -90 to 90 degrees over v. Frame::FromXZ: y = z cross x.
        explicit Frame(const Hit& hit) {
            using namespace adapters;
            const V3 dpdv = unit(cross(hit.travel, hit.tangent));
            v = float(0.5 + 0.5 * dot(hit.normal, dpdv));
            const double turn = -(-0.5 + double(v)) * medulla::pi;
            const V3 turned = std::cos(turn) * dpdv + std::sin(turn) * cross(hit.tangent, dpdv);
            x = hit.tangent, z = unit(cross(hit.tangent, turned)), y = cross(z, x);
        }
        pbrt::Vector3f local(V3 w) const {
            return {float(adapters::dot(w, x)), float(adapters::dot(w, y)), float(adapters::dot(w, z))};
        }
    };
    adapters::OwnedTables tables_;
    medulla::FurParameters<4> parameters_;
};

}  // namespace

TEST_CASE("pbrt-v4's adapter", "[integrations]") {
    adapters::check([](const medulla::FurParameters<3>& p) { return Adapter(p); });
}
