// The lights of a scene: sampling them, and finding those that a ray hits. A light blocks nothing.
#pragma once

#include <limits>
#include <vector>

#include "render/random.hpp"
#include "render/scene.hpp"

namespace medulla::render {

struct LightSample {
    Vec3 direction;
    float distance = std::numeric_limits<float>::infinity();
    Rgb radiance;
    float pdf = 0;  ///< per steradian, including the choice of the light; 0: no light from there
};

class Lights {
  public:
    explicit Lights(const std::vector<Light>& lights) : lights_(lights), choice_(1 / float(lights.size())) {}

    LightSample sample(Vec3 from, float pick, Pair u) const {
        const std::size_t i = std::min(lights_.size() - 1, std::size_t(pick * float(lights_.size())));
        const Light& light = lights_[i];
        LightSample s;
        s.radiance = light.radiance;
        switch (light.form) {
            case LightForm::sky:
                s.direction = about({0, 1, 0}, 1 - 2 * u.x, u.y);
                s.pdf = choice_ / (4 * pi_f);
                break;
            case LightForm::sun: {
                const float cap = cap_of(light);
                s.direction = about(light.direction, 1 - cap * u.x, u.y);
                s.pdf = choice_ / (2 * pi_f * cap);
                s.radiance = (1 / (2 * pi_f * cap)) * light.radiance;
                break;
            }
            case LightForm::rectangle: {
                const Vec3 to = light.corner + u.x * light.edge_a + u.y * light.edge_b - from;
                s.distance = length(to);
                s.direction = (1 / s.distance) * to;
                s.pdf = choice_ * rectangle_pdf(light, s.direction, s.distance);
                break;
            }
            case LightForm::environment:
                s.direction = light.environment->sample(u);
                s.radiance = light.environment->radiance(s.direction);
                s.pdf = choice_ * light.environment->pdf(s.direction);
                break;
        }
        return s;
    }

    /// Calls visit(radiance, pdf) for every light that a ray hits before `distance`; pdf is that of `sample`.
    template <class Visit>
    void met(Vec3 from, Vec3 direction, float distance, Visit&& visit) const {
        const bool escaped = distance == std::numeric_limits<float>::infinity();
        for (const Light& light : lights_) {
            if (light.form == LightForm::rectangle) {
                const Vec3 normal = cross(light.edge_a, light.edge_b);
                const float slope = dot(direction, normal);
                if (!(slope < 0)) continue;
                const float t = dot(light.corner - from, normal) / slope;
                if (!(t > 0 && t < distance)) continue;
                const Vec3 p = from + t * direction - light.corner;
                const float a = dot(p, light.edge_a) / dot(light.edge_a, light.edge_a);
                const float b = dot(p, light.edge_b) / dot(light.edge_b, light.edge_b);
                if (a >= 0 && a <= 1 && b >= 0 && b <= 1)
                    visit(light.radiance, choice_ * rectangle_pdf(light, direction, t));
            } else if (escaped && light.form == LightForm::sky) {
                visit(light.radiance, choice_ / (4 * pi_f));
            } else if (escaped && light.form == LightForm::environment) {
                const Rgb radiance = light.environment->radiance(direction);
                if (greatest(radiance) > 0) visit(radiance, choice_ * light.environment->pdf(direction));
            } else if (escaped) {
                const float cap = cap_of(light);
                const Vec3 off = direction - light.direction;  // 1 - cos = |off|^2 / 2, without loss of digits
                if (0.5f * dot(off, off) <= cap)
                    visit((1 / (2 * pi_f * cap)) * light.radiance, choice_ / (2 * pi_f * cap));
            }
        }
    }

  private:
    static float cap_of(const Light& sun) {  // 1 - cos
        const float s = std::sin(0.5f * sun.angle);
        return 2 * s * s;
    }
    static float rectangle_pdf(const Light& light, Vec3 direction, float distance) {
        const float slope = -dot(direction, cross(light.edge_a, light.edge_b));  // cosine times area
        return slope > 0 ? distance * distance / slope : 0;
    }
    static Vec3 about(Vec3 axis, float cosine, float turn) {
        const Basis basis = basis_about(axis);
        const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine)), a = 2 * pi_f * turn;
        return cosine * basis.x + sine * std::cos(a) * basis.y + sine * std::sin(a) * basis.z;
    }

    const std::vector<Light>& lights_;
    float choice_;  ///< probability of each
};

}  // namespace medulla::render
