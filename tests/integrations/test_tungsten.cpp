// Tungsten's adapter through Tungsten's conventions: the local frame of a curve in half_cylinder mode, the cosine in
// eval.
#include "adapter_checks.hpp"
#include "integrations/tungsten/MedullaBcsdf.hpp"

namespace {

using adapters::Exit;
using adapters::Hit;
using adapters::V3;

class Adapter {
  public:
    explicit Adapter(const medulla::FurParameters<3>& p) : bsdf_(new Tungsten::MedullaBcsdf) {
        bsdf_->prepare(p, false);
    }
    Exit evaluate(const Hit& hit, V3 drawn) const {
        const Frame f(hit);
        Tungsten::SurfaceScatterEvent event;
        event.wi = f.local(hit.known()), event.wo = f.local(drawn);
        return {double(bsdf_->eval(event)[1]), double(bsdf_->pdf(event))};
    }
    Exit sample(const Hit& hit, const float (&u)[5], V3& drawn) const {
        const Frame f(hit);
        Tungsten::PathSampleGenerator sampler = {u};
        Tungsten::SurfaceScatterEvent event;
        event.wi = f.local(hit.known()), event.sampler = &sampler;
        if (!bsdf_->sample(event)) return {};
        drawn = double(event.wo.x()) * f.T + double(event.wo.y()) * f.B + double(event.wo.z()) * f.N;
        return {double(event.weight[1]) * double(event.pdf), double(event.pdf)};
    }

  private:
    struct Frame {
        V3 T, B, N;  // Curves::tangentSpace: B along the derivative, T = B cross N
        explicit Frame(const Hit& hit) : T(cross(hit.tangent, hit.normal)), B(hit.tangent), N(hit.normal) {}
        Tungsten::Vec3f local(V3 w) const {
            return {float(adapters::dot(w, T)), float(adapters::dot(w, B)), float(adapters::dot(w, N))};
        }
    };
    std::unique_ptr<Tungsten::MedullaBcsdf> bsdf_;
};

}  // namespace

TEST_CASE("Tungsten's adapter", "[integrations]") {
    adapters::check([](const medulla::FurParameters<3>& p) { return Adapter(p); });
}

TEST_CASE("Tungsten's adapter, whole width: the mean of the near field", "[integrations]") {
    medulla::FurParameters<3> p = medulla::parameters_of<3>(*medulla::find_preset("bobcat"));
    Tungsten::MedullaBcsdf whole;
    whole.prepare(p, true);
    const Adapter near_adapter(p);
    // bcsdf_cylinder: the normal faces the ray, whatever its offset.
    Tungsten::SurfaceScatterEvent event;
    event.wi = Tungsten::Vec3f(0, 0.6f, 0.8f), event.wo = Tungsten::Vec3f(0.48f, -0.6f, 0.64f);
    double mean = 0;
    constexpr int offsets = 400;
    for (int i = 0; i < offsets; ++i) {
        const Hit hit({0, 1, 0}, {0, -0.6, -0.8}, 2 * (i + 0.5) / offsets - 1);
        mean += near_adapter.evaluate(hit, {0.48, -0.6, 0.64}).value / offsets;
    }
    CHECK(double(whole.eval(event)[0]) == Approx(mean).epsilon(2e-3));
}

TEST_CASE("Tungsten's adapter refuses what it does not know", "[integrations]") {
    Tungsten::MedullaBcsdf bsdf;
    const Tungsten::Scene scene;
    CHECK_NOTHROW(bsdf.fromJson({{{"preset", "bobcat"}, {"field", "far"}}}, scene));
    CHECK_NOTHROW(bsdf.prepareForRender());
    CHECK_THROWS_WITH(bsdf.fromJson({{{"preset", "unicorn"}}}, scene), Catch::Contains("unicorn"));
    CHECK_THROWS_WITH(bsdf.fromJson({{{"field", "middle"}}}, scene), Catch::Contains("middle"));
    medulla::FurParameters<3> p;
    p.kappa = 1.2f;
    CHECK_THROWS(bsdf.prepare(p, false));
}
