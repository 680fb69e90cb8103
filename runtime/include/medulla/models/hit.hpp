// The front door of every model in this folder, which is that of near_field.hpp: value, pdf, evaluate and sample of a
// hit whose known direction is given. A model supplies two functions, its density and its draw.
//
// Measure. `value` is energy per steradian about the drawn direction; for a BCSDF S it is S times the cosine of the
// drawn direction's inclination, so that a light's radiance multiplies it as it is. Angles are the papers'
// (vector.hpp).
#pragma once

#include "medulla/config.hpp"
#include "medulla/near_field.hpp"
#include "medulla/vector.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {
namespace models {

/// The first parameter that is out of its range; name null: there is none.
struct Wrong {
    const char* name = nullptr;
    float value = 0, low = 0, high = 0;  ///< the range is [low, high]
};

/// Model::visit(model, f) calls f(name, value, low, high) for each number.
template <class Model>
MEDULLA_FN Wrong wrong_parameter(const Model& model) noexcept {
    Wrong wrong;
    Model::visit(model, [&](const char* name, float value, float low, float high) {
        const bool inside = low < 0 ? detail::within(value, high) : detail::within(value, low, high);
        if (!inside && wrong.name == nullptr) wrong = {name, value, low, high};
    });
    return wrong;
}

/// The known direction, away from the fibre: a Vector or Angles.
struct Known {
    detail::Polar polar;
    MEDULLA_FN Known(Vector w) noexcept : polar(detail::polar_of(w)) {}
    MEDULLA_FN Known(Angles a) noexcept : polar(detail::polar_of(a)) {}
};

/// What a model draws: an exit and the lobe that it is of.
struct Exit {
    int lobe = -1;             ///< of Lobe; -1: there is no light
    float theta = 0, phi = 0;  ///< phi from the known azimuth [radians]
};

/// Derived has at(theta, cosine, phi), value and pdf per steradian, phi in [-pi, pi] from the known azimuth, and
/// draw(numbers). known.cosine 0: the hit is black.
template <class Derived, int Channels>
struct Hit {
    detail::Polar known;
    float known_theta = 0;        ///< [radians]
    const char* wrong = nullptr;  ///< the parameter for which the hit is black; null: all are in their ranges

    MEDULLA_FN Colour<Channels> value(Vector drawn) const noexcept { return evaluate(drawn).value; }
    MEDULLA_FN Colour<Channels> value(Angles drawn) const noexcept { return evaluate(drawn).value; }
    MEDULLA_FN float pdf(Vector drawn) const noexcept { return evaluate(drawn).pdf; }
    MEDULLA_FN float pdf(Angles drawn) const noexcept { return evaluate(drawn).pdf; }
    MEDULLA_FN Evaluation<Channels> evaluate(Vector drawn) const noexcept {
        return detail::run_fused([&] { return towards(detail::polar_of(drawn)); });
    }
    MEDULLA_FN Evaluation<Channels> evaluate(Angles drawn) const noexcept {
        return detail::run_fused([&] { return towards(detail::polar_of(drawn)); });
    }
    MEDULLA_FN Sample<Channels> sample(RandomNumbers u) const noexcept {
        return detail::run_fused([&] { return draw_and_evaluate(u); });
    }

  protected:
    /// @return whether there is anything to set: the direction is one and the parameters are in their ranges
    template <class Model>
    MEDULLA_FN bool begin(const Model& model, const Known& direction) noexcept {
        wrong = wrong_parameter(model).name;
        if (wrong != nullptr || !(direction.polar.cosine > 0)) return false;
        known = direction.polar;
        known_theta = detail::angle(known.sine, known.cosine);
        return true;
    }

  private:
    MEDULLA_HOT Sample<Channels> draw_and_evaluate(RandomNumbers u) const noexcept {
        Sample<Channels> s;
        if (!(known.cosine > 0)) return s;
        const Exit exit = derived().draw(u);
        if (exit.lobe < 0) return s;
        const float phi = detail::wrap_angle(exit.phi);
        const Evaluation<Channels> e = derived().at(exit.theta, detail::cosine_of(exit.theta), phi);
        detail::set_sample(known, static_cast<Lobe>(exit.lobe), exit.theta, phi, e, s);
        return s;
    }
    MEDULLA_FN const Derived& derived() const noexcept { return static_cast<const Derived&>(*this); }
    MEDULLA_FN Evaluation<Channels> towards(const detail::Polar& drawn) const noexcept {
        if (!(known.cosine > 0 && drawn.cosine > 0)) return {};
        const Angles between = detail::angles_between(known, drawn);
        return derived().at(between.theta, drawn.cosine, between.phi);
    }
};

}  // namespace models

namespace detail {

template <int Channels>
MEDULLA_FN float mean_of(const float (&x)[std::size_t(Channels)]) noexcept {
    float sum = 0;
    for (const float value : x) sum += value;
    return sum * (1.0f / float(Channels));
}

/// Draws one of `Count` lobes by its share and makes `u` uniform again; the last one with a share takes what rounding
/// leaves. -1: there is none.
template <int Count>
MEDULLA_FN int draw_of(const float (&share)[std::size_t(Count)], float& u) noexcept {
    int last = -1;
    float below = 0, at_last = 0;
    for (int k = 0; k < Count; ++k) {
        if (!(share[k] > 0)) continue;
        last = k;
        at_last = below;
        if (u < below + share[k]) break;
        below += share[k];
    }
    if (last >= 0) u = lesser(greater((u - at_last) / share[last], 0.0f), 1.0f);
    return last;
}

/// Divides by the sum. @return whether there is one
template <int Count>
MEDULLA_FN bool normalise_shares(float (&share)[std::size_t(Count)]) noexcept {
    float sum = 0;
    for (const float x : share) sum += x;
    const float inverse = sum > 1e-30f ? 1 / sum : 0.0f;
    for (float& x : share) x *= inverse;
    return inverse > 0;
}

}  // namespace detail
}  // namespace MEDULLA_TARGET
}  // namespace medulla
