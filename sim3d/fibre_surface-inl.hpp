// Arithmetic of directions, collisions and facets over lanes of floats, included once per instruction set.
#if defined(MEDULLA_FIBRE_SURFACE_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef MEDULLA_FIBRE_SURFACE_INL
#undef MEDULLA_FIBRE_SURFACE_INL
#else
#define MEDULLA_FIBRE_SURFACE_INL
#endif

#include <cmath>

#include "sim2d/tracer/math-inl.hpp"
#include "sim3d/fibre_lanes.hpp"

HWY_BEFORE_NAMESPACE();
namespace medulla::sim3d {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using namespace medulla::sim2d::HWY_NAMESPACE;  // F, VF, Philox, Exp2, ScatterTurn, Squeeze, ...

struct V3 {
    VF x, y, z;
};
HWY_INLINE VF Dot(V3 a, V3 b) { return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z))); }
HWY_INLINE V3 Scaled(V3 a, VF s) { return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)}; }
HWY_INLINE V3 Along(V3 a, V3 n, VF t) {
    return {hn::MulAdd(n.x, t, a.x), hn::MulAdd(n.y, t, a.y), hn::MulAdd(n.z, t, a.z)};
}
HWY_INLINE V3 Chosen(MF m, V3 a, V3 b) {
    return {hn::IfThenElse(m, a.x, b.x), hn::IfThenElse(m, a.y, b.y), hn::IfThenElse(m, a.z, b.z)};
}
/// A direction whose length is 1 but for rounding: one Newton step.
HWY_INLINE V3 Refreshed(V3 a) { return Scaled(a, hn::NegMulAdd(Constant(0.5f), Dot(a, a), Constant(1.5f))); }
HWY_INLINE V3 Unit(V3 a) { return Scaled(a, hn::Div(Constant(1), hn::Sqrt(hn::Max(Dot(a, a), Constant(1e-30f))))); }

/// Angle of (x, y) in turns, [-1/2, 1/2].
HWY_INLINE VF Turns(VF x, VF y) {
    const VF ax = hn::Abs(x), ay = hn::Abs(y);
    const VF ratio = hn::Div(hn::Min(ax, ay), hn::Max(hn::Max(ax, ay), Constant(1e-30f)));
    VF t = hn::Mul(hn::Atan(F(), ratio), Constant(0.5f / kPiF));
    t = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(Constant(0.25f), t), t);
    t = hn::IfThenElse(hn::Lt(x, hn::Zero(F())), hn::Sub(Constant(0.5f), t), t);
    return hn::CopySign(t, y);
}

/// Uniform number of the low bits that Uniform23 leaves over.
HWY_INLINE VF SpareUniform(const Words4& w) {
    const VU low = hn::Set(U(), 511u);
    const VU bits = hn::Or(hn::Or(hn::ShiftLeft<23>(hn::And(w.b, low)), hn::ShiftLeft<14>(hn::And(w.c, low))),
                           hn::ShiftLeft<5>(hn::And(w.d, low)));
    return Uniform23(bits);
}

/// Henyey-Greenstein in space about d; see fibre_walk.cpp.
HWY_INLINE V3 ScatterHg3d(const LaneFibre& st, V3 d, const Words4& words) {
    const float g = std::abs(st.g);
    const VF one = Constant(1), u = Uniform23(words.b),
             per = hn::Div(one, hn::MulAdd(u, Constant(2 * g), Constant(1 - g)));
    const VF peak = hn::Mul(hn::Sub(one, u), hn::MulAdd(u, Constant(g), one));
    const VF turn = hn::Mul(hn::Mul(peak, Constant(2 * (1 - g) * (1 - g))), hn::Mul(per, per));
    const VF sine = hn::Sqrt(hn::Max(hn::Mul(turn, hn::Sub(Constant(2), turn)), hn::Zero(F())));
    const VF straight = hn::Sub(one, turn), cosine = st.g < 0 ? hn::Neg(straight) : straight;
    const VDirection w = sim2d::HWY_NAMESPACE::Turn(Uniform23(words.c));
    // Two directions across d (Duff et al. 2017).
    const VF sign = hn::CopySign(one, d.z), a = hn::Div(Constant(-1), hn::Add(sign, d.z)),
             xy = hn::Mul(hn::Mul(d.x, d.y), a);
    const V3 e{hn::MulAdd(hn::Mul(sign, a), hn::Mul(d.x, d.x), one), hn::Mul(sign, xy), hn::Neg(hn::Mul(sign, d.x))};
    const V3 f{xy, hn::MulAdd(a, hn::Mul(d.y, d.y), sign), hn::Neg(d.y)};
    return Along(Along(Scaled(d, cosine), e, hn::Mul(sine, w.x)), f, hn::Mul(sine, w.y));
}

HWY_INLINE V3 ScatterPlanar(const LaneFibre& st, V3 d, const Words4& words) {
    const VDirection e = Rotate({d.y, d.z}, ScatterTurn(SignedUnit(words.b), std::abs(st.g), st.g < 0 ? -1.0f : 1.0f));
    return {d.x, e.x, e.y};
}

/// Classes after a reflection at the cuticle from inside, and after a collision: class_of's order.
HWY_INLINE VU AfterReflection(VU kind) {
    const I in;
    const VI k = hn::BitCast(in, kind), last = hn::Set(in, static_cast<std::int32_t>(Class::higher));
    const VI collided = hn::Set(in, static_cast<std::int32_t>(Class::scattered_reflected));
    return hn::BitCast(U(), hn::IfThenElse(hn::Gt(k, last), collided, hn::Min(hn::Add(k, hn::Set(in, 1)), last)));
}
HWY_INLINE VU AfterCollision(VU kind) {
    const I in;
    const VI k = hn::BitCast(in, kind), last = hn::Set(in, static_cast<std::int32_t>(Class::higher));
    return hn::BitCast(U(), hn::IfThenElse(hn::Gt(k, last), k, hn::Add(k, hn::Set(in, 3))));
}

/// phi(mu) - mu Q(mu), mu >= 0: E[(p - mu)+] of a standard normal p; absolute error 2e-7 (Abramowitz and
/// Stegun 7.1.26).
HWY_INLINE VF MassBeyond(VF mu) {
    const VF bell = Exp2(hn::Mul(hn::Mul(mu, mu), Constant(-0.5f * kLog2E)));
    const VF t = hn::Div(Constant(1), hn::MulAdd(mu, Constant(0.3275911f * 0.70710678f), Constant(1)));
    VF p = Constant(1.061405429f);
    p = hn::MulAdd(p, t, Constant(-1.453152027f));
    p = hn::MulAdd(p, t, Constant(1.421413741f));
    p = hn::MulAdd(p, t, Constant(-0.284496736f));
    p = hn::MulAdd(p, t, Constant(0.254829592f));
    const VF tail = hn::Mul(Constant(0.5f), hn::Mul(p, t));
    return hn::Max(hn::Mul(bell, hn::NegMulAdd(mu, tail, Constant(0.39894228f))), hn::Zero(F()));
}

/// A facet: unit normal towards the side of the light; not `drawn` where it is of the tail (sample_visible_tail).
struct Facet {
    V3 n;
    MF drawn;
};
template <bool kRough>
HWY_INLINE Facet DrawFacet(const LaneFibre& st, V3 d, V3 normal, float s, const Words4& words) {
    const F f;
    const V3 smooth = Scaled(normal, Constant(s));
    if (!kRough) return {smooth, hn::FirstN(f, hn::Lanes(f))};
    const VF zero = hn::Zero(f), one = Constant(1);
    const VF dn = hn::MulAdd(d.y, normal.y, hn::Mul(d.z, normal.z)),
             dt = hn::MulSub(d.z, normal.y, hn::Mul(d.y, normal.z));
    const VF seen = hn::Mul(hn::MulAdd(Constant(st.tilt), d.x, dn), Constant(-s));
    const VF kx = hn::Mul(d.x, Constant(-s * st.along)), kt = hn::Mul(dt, Constant(-s * st.around));
    const VF K = hn::Sqrt(hn::MulAdd(kx, kx, hn::Mul(kt, kt))), per = hn::Div(one, hn::Max(K, Constant(1e-12f)));
    const VF mu = hn::Mul(seen, per), mass = hn::Add(mu, MassBeyond(hn::Max(mu, zero)));
    const VF radius = hn::Sqrt(hn::Mul(hn::Log(f, Uniform31(words.a)), Constant(-2)));
    const VDirection turn = sim2d::HWY_NAMESPACE::Turn(Uniform23(words.b));
    VF p = hn::Mul(radius, turn.x);
    const VF q = hn::Mul(radius, turn.y), share = hn::Mul(Uniform23(words.c), mass), size = hn::Abs(p);
    // p of the body, |p| < mu, is taken with probability mu / mass: the rest of all draws are the tail's.
    const MF drawn = hn::And(hn::Lt(size, mu), hn::Lt(share, mu));
    p = hn::IfThenElse(hn::Lt(hn::Add(share, share), hn::Add(mu, size)), size, hn::Neg(size));
    const MF slanted = hn::Gt(K, Constant(1e-12f));
    const VF cx = hn::IfThenElse(slanted, hn::Mul(kx, per), one), ct = hn::IfThenElseZero(slanted, hn::Mul(kt, per));
    const VF a = hn::MulAdd(Constant(st.along), hn::MulSub(p, cx, hn::Mul(q, ct)), Constant(st.tilt));
    const VF b = hn::Mul(Constant(st.around), hn::MulAdd(p, ct, hn::Mul(q, cx)));
    const V3 n = Unit({a, hn::NegMulAdd(b, normal.z, normal.y), hn::MulAdd(b, normal.y, normal.z)});
    return {Scaled(n, Constant(s)), drawn};
}

/// Whether a direction leaves the facets for its side s without meeting another.
HWY_INLINE MF LeavesFacets(const LaneFibre& st, V3 d, V3 normal, float s, VF chance) {
    const VF zero = hn::Zero(F());
    const VF dn = hn::MulAdd(d.y, normal.y, hn::Mul(d.z, normal.z)),
             dt = hn::MulSub(d.z, normal.y, hn::Mul(d.y, normal.z));
    const VF up = hn::Mul(dn, Constant(s)), clear = hn::MulAdd(Constant(s * st.tilt), d.x, up);
    const VF kx = hn::Mul(d.x, Constant(st.along)), kt = hn::Mul(dt, Constant(st.around));
    const VF K = hn::Max(hn::Sqrt(hn::MulAdd(kx, kx, hn::Mul(kt, kt))), Constant(1e-12f));
    const VF mass = hn::Mul(K, MassBeyond(hn::Max(hn::Div(clear, K), zero)));
    return hn::And(hn::And(hn::Gt(up, zero), hn::Gt(clear, zero)),
                   hn::Lt(hn::Mul(chance, hn::Add(clear, mass)), clear));
}

/// Reflectance at a facet n met by d at the cosine c; `outer` is the cosine outside, <= 0 for total reflection.
HWY_INLINE VF ReflectanceAt(const LaneFibre& st, V3 d, V3 n, VF c, VF outer, bool inside) {
    const VF one = Constant(1), tiny = Constant(1e-30f);
    VF cosine = outer, excess = Constant(st.excess);
    if (st.bravais) {
        const VF in_plane = hn::Sqrt(hn::Max(hn::NegMulAdd(n.x, n.x, one), tiny));
        const VF along = hn::Div(hn::MulAdd(c, n.x, d.x), in_plane),
                 sine = inside ? hn::Mul(along, Constant(st.eta)) : along;
        const VF cos2 = hn::Max(hn::NegMulAdd(sine, sine, one), Constant(1e-12f));
        excess = hn::Div(excess, cos2), cosine = hn::Min(one, hn::Div(outer, hn::Sqrt(cos2)));
    }
    const VF x = hn::Sqrt(hn::MulAdd(cosine, cosine, excess)), nc = hn::Mul(hn::Add(one, excess), cosine);
    const VF rs = hn::Div(hn::Sub(cosine, x), hn::Add(cosine, x)), rp = hn::Div(hn::Sub(nc, x), hn::Add(nc, x));
    const VF Rs = hn::Mul(rs, rs), Rp = hn::Mul(rp, rp);
    // F1 = Rs / (1 + Rs) + Rp / (1 + Rp) over a common denominator.
    const VF below = hn::Mul(hn::Add(one, Rs), hn::Add(one, Rp)), both = hn::Mul(Rs, Rp);
    const VF F1 = hn::Div(hn::Add(hn::Add(Rs, Rp), hn::Add(both, both)), below);
    const VF layered =
        hn::Div(hn::Mul(F1, Constant(st.layers)), hn::Max(hn::MulAdd(F1, Constant(st.layers - 1), one), tiny));
    return inside ? hn::IfThenElse(hn::Gt(outer, hn::Zero(F())), layered, one) : layered;
}

}  // namespace HWY_NAMESPACE
}  // namespace medulla::sim3d
HWY_AFTER_NAMESPACE();
#endif
