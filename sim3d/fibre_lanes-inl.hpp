// Flights and meetings with the cuticle over lanes of floats, included once per instruction set by fibre_tracer.cpp.
#if defined(MEDULLA_FIBRE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef MEDULLA_FIBRE_LANES_INL
#undef MEDULLA_FIBRE_LANES_INL
#else
#define MEDULLA_FIBRE_LANES_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "sim3d/fibre_lanes.hpp"
#include "sim3d/fibre_surface-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace medulla::sim3d {
namespace HWY_NAMESPACE {

/// What left in some lanes: deposits go into the sums one after the other.
struct Leaving {
    V3 d;
    VF weight, cortex, medulla;  ///< weight is 0 where nothing left
    VU kind;
};

HWY_INLINE VI Place(VF share, std::uint32_t count) {
    const VI i = hn::ConvertTo(I(), hn::Mul(share, Constant(static_cast<float>(count))));
    return hn::Min(hn::Max(i, hn::Zero(I())), hn::Set(I(), static_cast<std::int32_t>(count) - 1));
}

HWY_INLINE void Deposit(LaneFibre& st, const Leaving& out) {
    const F f;
    constexpr std::size_t most = hn::MaxLanes(F());
    const VF y = hn::MulAdd(out.d.z, Constant(st.sin_azimuth), hn::Mul(out.d.y, Constant(st.cos_azimuth)));
    const VF z = hn::NegMulAdd(out.d.y, Constant(st.sin_azimuth), hn::Mul(out.d.z, Constant(st.cos_azimuth)));
    const VF half = Constant(0.5f), x = hn::Max(hn::Min(out.d.x, Constant(1)), Constant(-1));
    const VI row = Place(hn::MulAdd(hn::Asin(f, x), Constant(1 / kPiF), half), st.theta_bins);
    const VI column = Place(hn::Add(Turns(y, z), half), st.phi_bins);
    alignas(64) std::int32_t bin[most];
    alignas(64) std::uint32_t kind[most];
    alignas(64) float weight[most], cortex[most], medulla[most], left[64 * most];
    hn::Store(hn::Add(hn::Mul(row, hn::Set(I(), static_cast<std::int32_t>(st.phi_bins))), column), I(), bin);
    hn::Store(out.kind, U(), kind);
    hn::Store(out.weight, f, weight), hn::Store(out.cortex, f, cortex), hn::Store(out.medulla, f, medulla);
    const VF rest = hn::Mul(out.medulla, Constant(st.medulla_rate));
    const std::size_t channels = st.rate.size();
    for (std::size_t c = 0; c < channels; ++c)
        hn::Store(hn::Mul(out.weight, Exp2(hn::MulAdd(out.cortex, Constant(st.rate[c]), rest))), f, left + c * most);
    FibreSums& sums = *st.sums;
    const std::size_t size = std::size_t{st.theta_bins} * st.phi_bins;
    for (std::size_t i = 0; i < hn::Lanes(f); ++i) {
        if (!(weight[i] > 0)) continue;
        const std::size_t k = kind[i];
        const double w = static_cast<double>(weight[i]);
        sums.white[k] += w;
        sums.cortex[k] += w * static_cast<double>(cortex[i]), sums.medulla[k] += w * static_cast<double>(medulla[i]);
        double* sum = sums.bins.data() + k * channels * size + static_cast<std::size_t>(bin[i]);
        for (std::size_t c = 0; c < channels; ++c) sum[c * size] += static_cast<double>(left[c * most + i]);
    }
}

/// Lanes that meet the cuticle: what leaves to outside, and what is inside afterwards.
struct Met {
    V3 out, in;
    VF F;      ///< split lanes: share that stays on, or goes to, the side that `in` or `out` says
    MF split;  ///< both branches leave the facets at once
};

/// Lanes that are not split, followed one by one. @return whether each is outside afterwards, and its direction
HWY_INLINE MF Settle(const LaneFibre& st, const Met& met, const Facet& facet, MF lanes, Side side, V3 d, V3 normal,
                     MF reflect, MF leaves, VU index, std::uint32_t order, V3& settled) {
    const F f;
    constexpr std::size_t most = hn::MaxLanes(F());
    alignas(64) float on[most], drawn[most], mirrored[most], free[most], outside[most];
    alignas(64) float v[4][3][most];
    alignas(64) std::uint32_t path[most];
    const VF one = Constant(1);
    hn::Store(hn::IfThenElseZero(lanes, one), f, on);
    hn::Store(hn::IfThenElseZero(facet.drawn, one), f, drawn);
    hn::Store(hn::IfThenElseZero(reflect, one), f, mirrored), hn::Store(hn::IfThenElseZero(leaves, one), f, free);
    const V3 all[4] = {met.out, met.in, d, normal};
    for (int k = 0; k < 4; ++k)
        hn::Store(all[k].x, f, v[k][0]), hn::Store(all[k].y, f, v[k][1]), hn::Store(all[k].z, f, v[k][2]);
    hn::Store(index, U(), path);
    for (std::size_t i = 0; i < hn::Lanes(f); ++i) {
        outside[i] = 0;
        if (!(on[i] > 0)) continue;
        const auto vec = [&](int k) { return Vec3{double(v[k][0][i]), double(v[k][1][i]), double(v[k][2][i])}; };
        LaneMeeting m{vec(2), vec(3), side, Next::meet_tail, path[i]};
        Side left = side;
        if (drawn[i] > 0) {
            const bool stays = mirrored[i] > 0, out = stays == (side == Side::outside);
            m.d = vec(out ? 0 : 1), m.side = left = out ? Side::outside : Side::inside, m.next = Next::meet;
        }
        if (!(drawn[i] > 0) || !(free[i] > 0)) left = settle(st, m, order);
        outside[i] = left == Side::outside ? 1.0f : 0.0f;
        v[2][0][i] = static_cast<float>(m.d.x), v[2][1][i] = static_cast<float>(m.d.y);
        v[2][2][i] = static_cast<float>(m.d.z);
    }
    settled = {hn::Load(f, v[2][0]), hn::Load(f, v[2][1]), hn::Load(f, v[2][2])};
    return hn::And(lanes, hn::Gt(hn::Load(f, outside), hn::Zero(f)));
}

/// One meeting. Split lanes: `met`. Of other lanes those that `arrive` are followed: `outside` of them left, in the
/// direction `settled`.
template <bool kRough>
HWY_INLINE Met Meet(const LaneFibre& st, Side side, V3 d, V3 normal, const Words4& words, MF alive, MF arrive, VU index,
                    std::uint32_t order, MF& outside, V3& settled) {
    const F f;
    const float s = side == Side::outside ? 1.0f : -1.0f;
    const Facet facet = DrawFacet<kRough>(st, d, normal, s, words);
    const VF c = hn::Max(hn::Neg(Dot(d, facet.n)), hn::Zero(f));
    VF outer = c, inner = c;
    const VF eta = Constant(st.eta);
    if (side == Side::inside) {
        const VF cos2 = hn::NegMulAdd(hn::Mul(eta, eta), hn::NegMulAdd(c, c, Constant(1)), Constant(1));
        outer = hn::Sqrt(hn::Max(cos2, hn::Zero(f)));
    } else {
        inner = hn::Div(hn::Sqrt(hn::MulAdd(c, c, Constant(st.excess))), eta);
    }
    Met met;
    met.F = ReflectanceAt(st, d, facet.n, c, outer, side == Side::inside);
    const V3 mirror = Refreshed(Along(d, facet.n, hn::Add(c, c)));
    const VF ratio = side == Side::inside ? eta : Constant(1 / st.eta);  // index here over that on the other side
    const VF other = side == Side::inside ? outer : inner;
    const V3 through = Refreshed(Along(Scaled(d, ratio), facet.n, hn::MulSub(c, ratio, other)));
    met.out = side == Side::outside ? mirror : through, met.in = side == Side::outside ? through : mirror;
    const MF total = hn::Ge(met.F, Constant(1));
    outside = hn::Lt(met.F, hn::Zero(f));  // none
    met.split = alive;
    if (kRough) {
        const VF chance = Uniform23(words.d);
        const MF out = hn::Or(LeavesFacets(st, met.out, normal, 1, chance), side == Side::inside ? total : outside),
                 in = LeavesFacets(st, met.in, normal, -1, chance);
        met.split = hn::And(hn::And(alive, facet.drawn), hn::And(out, in));
        const MF rest = hn::AndNot(met.split, arrive);
        if (!hn::AllFalse(f, rest)) {
            const MF reflect = hn::Lt(SpareUniform(words), met.F);
            const MF mirror_out = side == Side::outside ? out : in, through_out = side == Side::outside ? in : out;
            const MF leaves = hn::Or(hn::And(reflect, mirror_out), hn::AndNot(reflect, through_out));
            outside = Settle(st, met, facet, rest, side, d, normal, reflect, leaves, index, order, settled);
        }
    }
    return met;
}

/// Outward normal of the ellipse at a point of the stretched plane.
HWY_INLINE V3 NormalAt(const LaneFibre& st, VF y, VF z) {
    const VF ny = hn::Mul(y, Constant(st.stretch));
    const VF n = hn::Div(Constant(1), hn::Sqrt(hn::MulAdd(ny, ny, hn::Mul(z, z))));
    return {hn::Zero(F()), hn::Mul(ny, n), hn::Mul(z, n)};
}

/// Light meets the fibre: R is deposited, what enters becomes rays. @return how many
template <bool kRough>
std::size_t Enter(LaneFibre& st, std::size_t count) {
    const F f;
    const U u;
    LaneRays& r = st.rays;
    std::size_t out = 0;
    const std::uint32_t counter[4] = {st.batch << 24, 0, static_cast<std::uint32_t>(st.cell),
                                      static_cast<std::uint32_t>(st.cell >> 32)};
    const std::uint32_t next[4] = {counter[0] | 1, 0, counter[2], counter[3]};
    for (std::size_t i = 0; i < count; i += hn::Lanes(f)) {
        const MF alive = hn::FirstN(f, count - i);
        const VU index =
            hn::Add(hn::Iota(u, static_cast<std::uint32_t>(i)), hn::Set(u, static_cast<std::uint32_t>(st.first)));
        const Words4 a = DrawWords(counter, st.key, index);
        const VF within =
            hn::Add(hn::ConvertTo(f, hn::BitCast(I(), hn::Iota(u, static_cast<std::uint32_t>(i)))), Uniform23(a.a));
        const VF share = hn::MulAdd(within, Constant(st.stratum), Constant(st.first_stratum));
        const VF h =
            hn::Max(hn::Min(hn::MulAdd(share, Constant(st.h_span), Constant(st.h_low)), Constant(1)), Constant(-1));
        const VF half = hn::Sqrt(hn::Mul(hn::Sub(Constant(1), h), hn::Add(Constant(1), h)));
        const VF y = hn::MulAdd(half, Constant(st.entry_y), hn::Mul(h, Constant(st.across_y)));
        const VF z = hn::MulAdd(half, Constant(st.entry_z), hn::Mul(h, Constant(st.across_z)));
        const V3 d{Constant(st.travel_x), Constant(st.travel_y), Constant(st.travel_z)}, normal = NormalAt(st, y, z);
        const Words4 b = kRough ? DrawWords(next, st.key, index) : a;
        MF outside;
        V3 settled = d;
        const Met met = Meet<kRough>(st, Side::outside, d, normal, b, alive, alive, index, 0, outside, settled);
        const VF one = Constant(1), zero = hn::Zero(f);
        Leaving leaving{Chosen(met.split, met.out, settled),
                        hn::IfThenElse(met.split, met.F, hn::IfThenElseZero(outside, one)), zero, zero, hn::Zero(u)};
        leaving.weight = hn::IfThenElseZero(alive, leaving.weight);
        Deposit(st, leaving);
        const V3 in = Chosen(met.split, met.in, settled);
        const VF weight = hn::IfThenElse(met.split, hn::Sub(one, met.F), one);
        const Squeeze squeeze(hn::AndNot(outside, alive));
        squeeze.Store(y, &r.y[out]), squeeze.Store(z, &r.z[out]), squeeze.Store(zero, &r.s[out]);
        squeeze.Store(in.x, &r.dx[out]), squeeze.Store(in.y, &r.dy[out]), squeeze.Store(in.z, &r.dz[out]);
        squeeze.Store(weight, &r.weight[out]), squeeze.Store(zero, &r.cortex[out]),
            squeeze.Store(zero, &r.medulla[out]);
        squeeze.Store(hn::Set(u, static_cast<std::uint32_t>(Class::TT)), &r.kind[out]),
            squeeze.Store(index, &r.index[out]);
        out += hn::CountTrue(f, hn::AndNot(outside, alive));
    }
    return out;
}

/// One flight of every ray. @param order from 1   @return how many go on
template <bool kRough>
std::size_t Fly(LaneFibre& st, std::uint32_t order, std::size_t count) {
    const F f;
    const U u;
    LaneRays& r = st.rays;
    std::size_t out = 0;
    const std::uint32_t counter[4] = {2 * order | st.batch << 24, 0, static_cast<std::uint32_t>(st.cell),
                                      static_cast<std::uint32_t>(st.cell >> 32)};
    const std::uint32_t next[4] = {counter[0] | 1, 0, counter[2], counter[3]};
    const VF one = Constant(1), zero = hn::Zero(f), tiny = Constant(1e-30f);
    for (std::size_t i = 0; i < count; i += hn::Lanes(f)) {
        const VF y = hn::LoadU(f, &r.y[i]), z = hn::LoadU(f, &r.z[i]), s = hn::LoadU(f, &r.s[i]);
        const V3 d{hn::LoadU(f, &r.dx[i]), hn::LoadU(f, &r.dy[i]), hn::LoadU(f, &r.dz[i])};
        VF weight = hn::LoadU(f, &r.weight[i]);
        const VF cortex = hn::LoadU(f, &r.cortex[i]), medulla = hn::LoadU(f, &r.medulla[i]);
        const VU kind = hn::LoadU(u, &r.kind[i]), index = hn::LoadU(u, &r.index[i]);
        MF alive = hn::FirstN(f, count - i);
        const Words4 words = DrawWords(counter, st.key, index);

        // Distances along d to the rim, and to where it is in the medulla: t1 to t2.
        const VF dy = hn::Mul(d.y, Constant(st.stretch));
        const VF q = hn::Max(hn::MulAdd(dy, dy, hn::Mul(d.z, d.z)), tiny), per_q = hn::Div(one, q);
        const VF b = hn::MulAdd(y, dy, hn::Mul(z, d.z)), a = hn::Abs(b), b2 = hn::Mul(b, b);
        const MF outward = hn::Gt(b, zero);
        const VF sum = hn::Max(hn::Add(hn::Sqrt(hn::MulAdd(q, s, b2)), a), tiny);
        const VF longer = hn::Mul(sum, per_q), shorter = hn::Div(s, sum);
        const VF rim = hn::IfThenElse(outward, shorter, longer), behind = hn::IfThenElse(outward, longer, shorter);
        const VF c = hn::Sub(Constant(st.ring), s);  // r^2 - kappa^2
        const VF root2 = hn::NegMulAdd(q, c, b2), root = hn::Sqrt(hn::Max(root2, zero));
        const MF within = hn::Le(c, zero);
        const MF meets = hn::And(hn::Gt(root2, zero), hn::Or(within, hn::Lt(b, zero)));
        const VF part = hn::Max(hn::Add(root, a), tiny);
        const VF t1 = hn::IfThenElse(hn::AndNot(within, meets), hn::Div(c, part), zero);
        const VF t2 = hn::Min(hn::IfThenElse(outward, hn::Div(hn::Neg(c), part), hn::Mul(part, per_q)), rim);
        const VF in_medulla = hn::IfThenElseZero(meets, hn::Max(hn::Sub(t2, t1), zero));
        const VF in_cortex = hn::Max(hn::Sub(rim, in_medulla), zero);
        const VF passes = Exp2(hn::Mul(in_medulla, Constant(-st.sigma_ms * kLog2E)));

        // At the rim, if it gets there.
        VF ry = hn::MulAdd(rim, dy, y), rz = hn::MulAdd(rim, d.z, z);
        const VF n = hn::Div(one, hn::Sqrt(hn::Max(hn::MulAdd(ry, ry, hn::Mul(rz, rz)), tiny)));
        ry = hn::Mul(ry, n), rz = hn::Mul(rz, n);
        const VF event = Uniform31(words.a);
        const MF arrives = hn::And(alive, hn::Le(event, passes));
        const Words4 facets = kRough ? DrawWords(next, st.key, index) : words;
        MF outside;
        V3 settled = d;
        // Lanes that must be followed one by one matter only where the ray arrives.
        const Met met = Meet<kRough>(st, Side::inside, d, NormalAt(st, ry, rz), facets, alive, arrives, index, order,
                                     outside, settled);
        const VF all_cortex = hn::Add(cortex, in_cortex), all_medulla = hn::Add(medulla, in_medulla);
        Leaving leaving{Chosen(met.split, met.out, settled),
                        hn::IfThenElse(met.split, hn::Mul(hn::Mul(weight, passes), hn::Sub(one, met.F)),
                                       hn::IfThenElseZero(outside, weight)),
                        all_cortex, all_medulla, kind};
        leaving.weight = hn::IfThenElseZero(alive, leaving.weight);
        if (!hn::AllFalse(f, hn::Gt(leaving.weight, zero))) Deposit(st, leaving);

        // On: a collision before the rim, or a reflection there.
        const MF stays = hn::And(arrives, hn::Or(hn::And(met.split, hn::Le(event, hn::Mul(passes, met.F))),
                                                 hn::AndNot(met.split, hn::AndNot(outside, alive))));
        const MF collides = hn::AndNot(arrives, alive);
        alive = hn::Or(stays, collides);
        if (hn::AllFalse(f, alive)) continue;
        const VF flight =
            hn::Min(hn::Div(hn::Neg(hn::Log(f, event)), Constant(std::max(st.sigma_ms, 1e-30f))), in_medulla);
        const VF t = hn::Add(t1, flight), cy = hn::MulAdd(t, dy, y), cz = hn::MulAdd(t, d.z, z);
        const VF product = hn::Mul(q, hn::Mul(hn::Max(hn::Sub(rim, t), zero), hn::Add(behind, t)));
        const VF fresh = hn::NegMulAdd(cy, cy, hn::NegMulAdd(cz, cz, one));
        const V3 turned = st.planar ? ScatterPlanar(st, d, words) : ScatterHg3d(st, d, words);
        const V3 on = Refreshed(Chosen(collides, turned, Chosen(met.split, met.in, settled)));
        const VF new_cortex = hn::IfThenElse(collides, hn::Add(cortex, t1), all_cortex);
        const VF new_medulla = hn::IfThenElse(collides, hn::Add(medulla, flight), all_medulla);
        const VU new_kind = hn::IfThenElse(hn::RebindMask(u, collides), AfterCollision(kind), AfterReflection(kind));
        // Roulette where all channels are faint: what is kept is brought back to `keep`.
        const float keep = 0.1f;
        const VF faint =
            Exp2(hn::MulAdd(new_cortex, Constant(st.faintest), hn::Mul(new_medulla, Constant(st.medulla_rate))));
        const VF survival = hn::Min(one, hn::Mul(hn::Mul(weight, faint), Constant(1 / keep)));
        alive = hn::And(alive, hn::Lt(Uniform23(words.d), survival));
        weight = hn::Div(weight, hn::Max(survival, tiny));

        const Squeeze squeeze(alive);
        squeeze.Store(hn::IfThenElse(collides, cy, ry), &r.y[out]),
            squeeze.Store(hn::IfThenElse(collides, cz, rz), &r.z[out]);
        squeeze.Store(hn::IfThenElseZero(collides, hn::IfThenElse(hn::Gt(product, Constant(0.1f)), fresh, product)),
                      &r.s[out]);
        squeeze.Store(on.x, &r.dx[out]), squeeze.Store(on.y, &r.dy[out]), squeeze.Store(on.z, &r.dz[out]);
        squeeze.Store(weight, &r.weight[out]);
        squeeze.Store(new_cortex, &r.cortex[out]), squeeze.Store(new_medulla, &r.medulla[out]);
        squeeze.Store(new_kind, &r.kind[out]), squeeze.Store(index, &r.index[out]);
        out += hn::CountTrue(f, alive);
    }
    st.sums->flights += count;
    return out;
}

template <bool kRough>
void Follow(LaneFibre& st, std::size_t count, std::uint32_t most_flights) {
    count = Enter<kRough>(st, count);
    for (std::uint32_t order = 1; count > 0; ++order) {
        if (order == most_flights) {
            for (std::size_t i = 0; i < count; ++i) st.sums->lost += static_cast<double>(st.rays.weight[i]);
            return;
        }
        count = Fly<kRough>(st, order, count);
    }
}

void TraceLanes(LaneFibre& st, std::size_t count, std::uint32_t most_flights) {
    st.rough ? Follow<true>(st, count, most_flights) : Follow<false>(st, count, most_flights);
}

const char* FibreTarget() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace medulla::sim3d
HWY_AFTER_NAMESPACE();
#endif
