// Mitsuba 3's plugin through Mitsuba's conventions: the shading frame of a bsplinecurve, the cosine in eval.
#include "adapter_checks.hpp"
#include "integrations/mitsuba3/medulla.cpp"

namespace {

using adapters::Exit;
using adapters::Hit;
using adapters::V3;
using mitsuba::Color3f;

class Adapter {
  public:
    explicit Adapter(const medulla::FurParameters<3>& p) : texture_(new mitsuba::Texture{Color3f(0)}) {
        const float degree = float(medulla::pi / 180);
        mitsuba::Properties props;
        props.numbers = {{"eta", p.eta},
                         {"kappa", p.kappa},
                         {"layers", p.layers},
                         {"alpha", p.alpha / degree},
                         {"beta_m", p.beta_m / degree},
                         {"beta_n", p.beta_n / degree},
                         {"sigma_ms", p.sigma_ms},
                         {"sigma_ma", p.sigma_ma},
                         {"g", p.g}};
        texture_->colour = Color3f(p.sigma_ca[0], p.sigma_ca[1], p.sigma_ca[2]);
        props.texture = texture_.get();
        bsdf_.reset(new mitsuba::Medulla<float, Color3f>(props));
    }
    Exit evaluate(const Hit& hit, V3 drawn) const {
        const Frame f(hit);
        const auto e = bsdf_->eval_pdf({}, {f.local(hit.known())}, f.local(drawn), true);
        CHECK(bsdf_->pdf({}, {f.local(hit.known())}, f.local(drawn), true) == e.second);
        return {double(e.first[1]), double(e.second)};
    }
    Exit sample(const Hit& hit, const float (&u)[5], V3& drawn) const {
        const Frame f(hit);
        const auto s = bsdf_->sample({}, {f.local(hit.known())}, u[0], {{u[1], u[2]}}, true);
        drawn = double(s.first.wo.x()) * f.s + double(s.first.wo.y()) * f.t + double(s.first.wo.z()) * f.n;
        return {double(s.second[1]) * double(s.first.pdf), double(s.first.pdf)};
    }

  private:
    struct Frame {
        V3 s, t, n;  // s = dp_du, around the curve as u grows; t = n cross s
        explicit Frame(const Hit& hit) : s(cross(hit.tangent, hit.normal)), t(cross(hit.normal, s)), n(hit.normal) {}
        mitsuba::Vector3f local(V3 w) const {
            return {float(adapters::dot(w, s)), float(adapters::dot(w, t)), float(adapters::dot(w, n))};
        }
    };
    std::unique_ptr<mitsuba::Texture> texture_;
    std::unique_ptr<mitsuba::BSDF<float, Color3f>> bsdf_;
};

}  // namespace

TEST_CASE("Mitsuba 3's plugin", "[integrations]") {
    adapters::check([](const medulla::FurParameters<3>& p) { return Adapter(p); });
    mitsuba::Properties props;
    props.preset = "unicorn";
    CHECK_THROWS((mitsuba::Medulla<float, Color3f>(props)));
    props.preset = "bobcat", props.numbers["kappa"] = 1.2f;
    CHECK_THROWS((mitsuba::Medulla<float, Color3f>(props)));
}
