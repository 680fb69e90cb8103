// Paths and their deposits over SIMD lanes of floats; kernel.cpp includes this once per instruction set.
#if defined(MEDULLA_TRACER_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef MEDULLA_TRACER_LANES_INL
#undef MEDULLA_TRACER_LANES_INL
#else
#define MEDULLA_TRACER_LANES_INL
#endif

#include <cstddef>
#include <cstdint>

#include "sim2d/tracer/math-inl.hpp"
#include "sim2d/tracer/state.hpp"

HWY_BEFORE_NAMESPACE();
namespace medulla::sim2d {
namespace HWY_NAMESPACE {
/// Coordinate of a lattice point. `tent` folds it (the baker's transform), which makes the integrand periodic.
HWY_INLINE VU Lattice(const PathTracer::State& s, VU reversed, std::uint32_t dim, bool tent) {
    const VI product = hn::Mul(hn::BitCast(I(), reversed), hn::Set(I(), static_cast<std::int32_t>(kLattice[dim])));
    const VU u = hn::Add(hn::BitCast(U(), product), hn::Set(U(), s.shift[dim]));
    if (!tent) return u;
    const VU fold = hn::BitCast(U(), hn::ShiftRight<31>(hn::BitCast(I(), u)));
    return hn::Xor(hn::Add(u, u), fold);
}

/// Distances to the boundary ahead and behind; in the disc s = ahead * behind.
struct Reach {
    VF ahead, behind;
};
template <Medium M>
HWY_INLINE Reach ReachOf(VF x, VF y, VF s, VDirection d) {
    const VF tiny = Constant(1e-30f);
    if (M == Medium::disc) {
        const VF a = hn::MulAdd(x, d.x, hn::Mul(y, d.y));
        const VF far = hn::Max(hn::Add(hn::Sqrt(hn::MulAdd(a, a, s)), hn::Abs(a)), tiny);
        const VF near = hn::Div(s, far);
        const MF outward = hn::Gt(a, hn::Zero(F()));
        return {hn::IfThenElse(outward, near, far), hn::IfThenElse(outward, far, near)};
    }
    const VF left = hn::IfThenElse(hn::Gt(d.x, hn::Zero(F())), hn::Sub(Constant(2), x), x);
    const VF per_cosine = hn::Div(Constant(1), hn::Max(hn::Abs(d.x), tiny));
    return {hn::Mul(left, per_cosine), hn::Mul(hn::Sub(Constant(2), left), per_cosine)};
}

/// Data shared by all deposits of one vertex. Positions and directions are in the frame turned by the offset.
struct Vertex {
    VF x, y, s, rest, dx, dy, cos_turn, sin_turn, weight;
};

/// Light that leaves towards u: weight p(d . u) exp(-sigma distance).
template <Medium M>
HWY_INLINE VF Escaping(const PathTracer::State& st, const Vertex& v, VF ux, VF uy, VF& distance, MF& forward) {
    const F f;
    if (M == Medium::disc) {
        const VF a = hn::MulAdd(v.x, ux, hn::Mul(v.y, uy));
        distance = hn::Max(hn::Sub(hn::Sqrt(hn::MulAdd(a, a, v.s)), a), hn::Zero(f));
    } else {
        const VF cosine = hn::NegMulAdd(uy, v.sin_turn, hn::Mul(ux, v.cos_turn));
        forward = hn::Gt(cosine, hn::Zero(f));
        distance = hn::Div(hn::IfThenElse(forward, v.rest, v.s), hn::Max(hn::Abs(cosine), Constant(1e-20f)));
    }
    // |d - u|^2 = 2 - 2 cos keeps the peak's digits as g -> 1.
    const VF ex = hn::Sub(v.dx, ux), ey = hn::Sub(v.dy, uy);
    const VF q = hn::MulAdd(Constant(st.g), hn::MulAdd(ex, ex, hn::Mul(ey, ey)), Constant(st.p_floor));
    return hn::Div(hn::Mul(v.weight, Exp2(hn::Mul(distance, Constant(-st.sigma * kLog2E)))), q);
}

/// The same deposit in absorbing media: times exp(-absorption path), into sums that are `stride` apart.
HWY_INLINE void DepositAbsorbed(PathTracer::State& st, VF value, VF path, float* sum, std::size_t stride) {
    const F f;
    for (std::size_t j = 0; j < st.absorbed_rate.size(); ++j) {
        const VF left = hn::Mul(value, Exp2(hn::Mul(path, Constant(st.absorbed_rate[j]))));
        hn::StoreU(hn::Add(hn::LoadU(f, sum + j * stride), left), f, sum + j * stride);
        float* length = st.absorbed_length.data() + j * kLaneMargin;
        hn::StoreU(hn::MulAdd(left, path, hn::LoadU(f, length)), f, length);
    }
}

/// Deposits of one vertex into the bins of its comb, and of its window. `length`: slab, sums of light times path.
template <Medium M, bool kWindow>
HWY_INLINE void DepositVertex(PathTracer::State& st, std::size_t i, VF length[2]) {
    const F f;
    const I in;
    const std::size_t lanes = hn::Lanes(f);
    const Deposits& p = st.deposits;
    const std::int32_t comb = static_cast<std::int32_t>(st.cell.plan.comb);
    Vertex v{hn::Set(f, p.far_x[i]),   hn::Set(f, p.far_y[i]),   hn::Set(f, M == Medium::disc ? p.s[i] : p.x[i]),
             hn::Set(f, 2 - p.x[i]),   hn::Set(f, p.far_dx[i]),  hn::Set(f, p.far_dy[i]),
             hn::Set(f, p.cos_far[i]), hn::Set(f, p.sin_far[i]), hn::Set(f, p.weight[i] * static_cast<float>(comb))};
    const VF so_far = hn::Set(f, M == Medium::disc ? p.length[i] : p.y[i]);
    const bool absorbs = M == Medium::disc && !st.absorbed_rate.empty();
    VF distance;
    MF forward = hn::Lt(so_far, so_far);
    float* sum = st.comb_sum.data() + static_cast<std::size_t>(p.offset[i]) * st.comb_stride;
    const VI bins = hn::Set(in, static_cast<std::int32_t>(st.cell.bins));
    const VI width = hn::Set(in, static_cast<std::int32_t>(st.cell.plan.window) - 1);
    VI bin = hn::Add(hn::Mul(hn::Iota(in, 0), hn::Set(in, comb)), hn::Set(in, p.offset[i] - p.window[i]));
    const VI stride = hn::Set(in, static_cast<std::int32_t>(lanes) * comb);
    for (std::size_t k = 0; k < st.comb_count; k += lanes) {
        const VF ux = hn::LoadU(f, st.comb_x.data() + k), uy = hn::LoadU(f, st.comb_y.data() + k);
        VF value = Escaping<M>(st, v, ux, uy, distance, forward);
        if (kWindow) {
            const VI relative = hn::Add(bin, hn::And(bins, hn::BroadcastSignBit(bin)));
            value = hn::IfThenElseZero(hn::RebindMask(f, hn::Gt(relative, width)), value);
            bin = hn::Add(bin, stride);
        }
        if (M == Medium::slab) {
            value = hn::IfThenElseZero(hn::FirstN(f, st.comb_count - k), value);
            const VF moment = hn::Mul(value, hn::Add(so_far, distance));
            length[0] = hn::Add(length[0], hn::IfThenZeroElse(forward, moment));
            length[1] = hn::Add(length[1], hn::IfThenElseZero(forward, moment));
        }
        hn::StoreU(hn::Add(hn::LoadU(f, sum + k), value), f, sum + k);
        if (absorbs)
            DepositAbsorbed(st, hn::IfThenElseZero(hn::FirstN(f, st.comb_count - k), value), hn::Add(so_far, distance),
                            st.absorbed_comb.data() + (sum + k - st.comb_sum.data()), st.comb_sum.size());
    }
    if (!kWindow) return;
    const std::size_t k0 = static_cast<std::size_t>(p.window[i]);
    v.x = hn::Set(f, p.near_x[i]), v.y = hn::Set(f, p.near_y[i]);
    v.dx = hn::Set(f, p.near_dx[i]), v.dy = hn::Set(f, p.near_dy[i]);
    v.cos_turn = hn::Set(f, p.cos_near[i]), v.sin_turn = hn::Set(f, p.sin_near[i]);
    v.weight = hn::Set(f, p.weight[i]);
    float* near_sum = st.window_sum.data() + k0;
    for (std::size_t k = 0; k < st.cell.plan.window; k += lanes) {
        const VF ux = hn::LoadU(f, st.window_x.data() + k0 + k), uy = hn::LoadU(f, st.window_y.data() + k0 + k);
        const VF value = Escaping<M>(st, v, ux, uy, distance, forward);
        if (M == Medium::slab) {
            const VF moment = hn::Mul(value, hn::Add(so_far, distance));
            length[0] = hn::Add(length[0], hn::IfThenZeroElse(forward, moment));
            length[1] = hn::Add(length[1], hn::IfThenElseZero(forward, moment));
        }
        hn::StoreU(hn::Add(hn::LoadU(f, near_sum + k), value), f, near_sum + k);
        if (absorbs)
            DepositAbsorbed(st, value, hn::Add(so_far, distance), st.absorbed_window.data() + k0 + k,
                            st.window_sum.size());
    }
}

/// Selects the vertices that deposit, by roulette, and stores them with their weight. @return their number
template <Medium M>
std::size_t Choose(PathTracer::State& st, std::size_t count) {
    const F f;
    const Paths& w = st.paths;
    Deposits& p = st.deposits;
    const VF rate = Constant(-st.sigma * kLog2E), beta = Constant(st.cell.plan.turned), flip = Constant(st.flip);
    const bool absorbs = M == Medium::disc && !st.absorbed_rate.empty();
    std::size_t out = 0;
    for (std::size_t i = 0; i < count; i += hn::Lanes(f)) {
        const VF x = hn::LoadU(f, &w.x[i]), y = hn::LoadU(f, &w.y[i]), s = hn::LoadU(f, &w.s[i]);
        const VF weight = hn::LoadU(f, &w.w[i]);
        const VDirection d{hn::Mul(flip, hn::LoadU(f, &w.dx[i])), hn::Mul(flip, hn::LoadU(f, &w.dy[i]))};
        // Estimate of what escapes: straight on along the phase function's peak, or turned, by the shortest way out.
        // It only sets a probability, so rough values suffice: 1 - r to 20 %, from s = 1 - r^2.
        const VF nearest = M == Medium::disc ? hn::Mul(s, hn::MulAdd(s, Constant(0.2f), Constant(0.5f)))
                                             : hn::Min(x, hn::Sub(Constant(2), x));
        const VF straight = Exp2(hn::Mul(hn::LoadU(f, &w.straight[i]), rate)), turned = Exp2(hn::Mul(nearest, rate));
        const VF escape = hn::Mul(weight, hn::MulAdd(beta, hn::Sub(turned, straight), straight));
        const VF chance = hn::Min(Constant(1), hn::Mul(escape, Constant(1 / st.cell.plan.roulette)));
        const MF chosen = hn::And(hn::Lt(hn::LoadU(f, &w.chance[i]), chance), hn::FirstN(f, count - i));
        if (hn::AllFalse(f, chosen)) continue;  // common deep in dense media
        const Squeeze squeeze(chosen);
        squeeze.Store(weight, &p.weight[out]), squeeze.Store(chance, &p.chance[out]),
            squeeze.Store(hn::LoadU(U(), &w.place[i]), &p.place[out]);
        squeeze.Store(x, &p.x[out]), squeeze.Store(y, &p.y[out]), squeeze.Store(s, &p.s[out]);
        squeeze.Store(d.x, &p.far_dx[out]), squeeze.Store(d.y, &p.far_dy[out]);
        if (absorbs) squeeze.Store(hn::LoadU(f, &w.length[i]), &p.length[out]);
        out += hn::CountTrue(f, chosen);
    }
    return out;
}

/// Deposits the selected vertices: draws the offset in comb and bin, then adds to every bin of comb and window.
template <Medium M, bool kWindow>
void Deposit(PathTracer::State& st, std::size_t count, TracerSums& sums) {
    const F f;
    const std::size_t lanes = hn::Lanes(f);
    Deposits& p = st.deposits;
    count = Choose<M>(st, count);
    const float comb = static_cast<float>(st.cell.plan.comb), bins = static_cast<float>(st.cell.bins);
    const float start = M == Medium::disc ? 0.5f : 0.25f;  // bin 0 lies this many turns below angle 0
    for (std::size_t i = 0; i < count; i += lanes) {
        const VF x = hn::LoadU(f, &p.x[i]), y = hn::LoadU(f, &p.y[i]);
        const VDirection d{hn::LoadU(f, &p.far_dx[i]), hn::LoadU(f, &p.far_dy[i])};
        const VF weight = hn::Div(hn::LoadU(f, &p.weight[i]), hn::Max(hn::LoadU(f, &p.chance[i]), Constant(1e-30f)));
        hn::StoreU(hn::Mul(weight, Constant(st.p_scale)), f, &p.weight[i]);
        const VF place = hn::Mul(Uniform23(hn::LoadU(U(), &p.place[i])), Constant(comb));
        const VF offset = hn::Floor(place);
        hn::StoreU(hn::ConvertTo(I(), offset), I(), &p.offset[i]);
        const VDirection turn = Turn(hn::Mul(place, Constant(1 / bins)));
        const VDirection far = RotateBack({x, y}, turn), far_d = RotateBack(d, turn);
        hn::StoreU(far.x, f, &p.far_x[i]), hn::StoreU(far.y, f, &p.far_y[i]);
        hn::StoreU(far_d.x, f, &p.far_dx[i]), hn::StoreU(far_d.y, f, &p.far_dy[i]);
        hn::StoreU(turn.x, f, &p.cos_far[i]), hn::StoreU(turn.y, f, &p.sin_far[i]);
        if (kWindow) {
            const VDirection inner = Turn(hn::Mul(hn::Sub(place, offset), Constant(1 / bins)));
            const VDirection near = RotateBack({x, y}, inner), near_d = RotateBack(d, inner);
            hn::StoreU(near.x, f, &p.near_x[i]), hn::StoreU(near.y, f, &p.near_y[i]);
            hn::StoreU(near_d.x, f, &p.near_dx[i]), hn::StoreU(near_d.y, f, &p.near_dy[i]);
            hn::StoreU(inner.x, f, &p.cos_near[i]), hn::StoreU(inner.y, f, &p.sin_near[i]);
            const float shift = start - 0.5f * static_cast<float>(st.cell.plan.window) / bins + 1;
            VF turns = hn::Add(RoughTurns(d), Constant(shift));
            turns = hn::Sub(turns, hn::Floor(turns));
            const VF first = hn::Min(hn::Floor(hn::Mul(turns, Constant(bins))), Constant(bins - 1));
            hn::StoreU(hn::ConvertTo(I(), first), I(), &p.window[i]);
        }
    }
    VF length[2] = {hn::Zero(f), hn::Zero(f)};
    for (std::size_t i = 0; i < count; ++i) DepositVertex<M, kWindow>(st, i, length);
    sums.deposits += count * (st.comb_count + st.cell.plan.window);
    if (M == Medium::slab) {
        const double width = 2 * pi / static_cast<double>(st.cell.bins);
        for (const int side : {0, 1})
            sums.length[side] += width * static_cast<double>(hn::GetLane(hn::SumOfLanes(f, length[side])));
    }
}

/// First collisions, in the direction of the light. @return sum of their flights
template <Medium M>
double Start(PathTracer::State& st, std::size_t count) {
    const F f;
    const std::size_t lanes = hn::Lanes(f);
    Paths& w = st.paths;
    double length = 0;
    for (std::size_t i = 0; i < count; i += lanes) {
        const VU reversed = hn::LoadU(U(), &w.reversed[i]);
        const VF depth = ForcedDepth(Uniform23(Lattice(st, reversed, 0, true)), Constant(st.first_share));
        if (M == Medium::disc) {
            const VF t = hn::Min(hn::Mul(depth, Constant(1 / st.sigma)), Constant(st.chord));
            hn::StoreU(hn::Sub(t, Constant(st.half)), f, &w.x[i]);
            hn::StoreU(Constant(st.h), f, &w.y[i]);
            hn::StoreU(hn::Mul(t, hn::Sub(Constant(st.chord), t)), f, &w.s[i]);
            hn::StoreU(t, f, &w.length[i]);
            const MF valid = hn::FirstN(f, count - i);
            length += static_cast<double>(hn::GetLane(hn::SumOfLanes(f, hn::IfThenElseZero(valid, t))));
        } else {
            const VF x = hn::Min(hn::Mul(depth, Constant(st.mu / st.sigma)), Constant(2));
            hn::StoreU(x, f, &w.x[i]);
            hn::StoreU(hn::Min(hn::Mul(depth, Constant(1 / st.sigma)), Constant(st.chord)), f, &w.y[i]);
        }
        hn::StoreU(Constant(st.dir_x), f, &w.dx[i]);
        hn::StoreU(Constant(st.dir_y), f, &w.dy[i]);
        hn::StoreU(Constant(1), f, &w.w[i]);
    }
    return length;
}

/// Scatters the paths at their vertices and draws the next flight; removes those that end. @return how many remain
template <Medium M, bool kForced>
std::size_t Fly(PathTracer::State& st, std::uint32_t order, std::uint32_t randomisation, std::size_t count, float keep,
                TracerSums& sums) {
    const F f;
    const U u;
    const std::size_t lanes = hn::Lanes(f);
    Paths& w = st.paths;
    const std::uint32_t counter[4] = {(order & 0xFFFFFFu) | randomisation << 24, 0,
                                      static_cast<std::uint32_t>(st.cell.cell),
                                      static_cast<std::uint32_t>(st.cell.cell >> 32)};
    const bool lattice = 2 * order < kLatticeDims, absorbs = M == Medium::disc && !st.absorbed_rate.empty();
    const VF per_sigma = Constant(1 / st.sigma), zero = hn::Zero(f);
    VF length = zero;
    std::size_t out = 0;
    for (std::size_t i = 0; i < count; i += lanes) {
        VF x = hn::LoadU(f, &w.x[i]), y = hn::LoadU(f, &w.y[i]), s = hn::LoadU(f, &w.s[i]);
        VDirection d{hn::LoadU(f, &w.dx[i]), hn::LoadU(f, &w.dy[i])};
        VF weight = hn::LoadU(f, &w.w[i]);
        const VU index = hn::LoadU(u, &w.index[i]), reversed = hn::LoadU(u, &w.reversed[i]);
        Words4 words = DrawWords(counter, st.key, index);
        if (lattice) {
            words.a = Lattice(st, reversed, 2 * order - 1, false);
            words.b = Lattice(st, reversed, 2 * order, true);
        }
        d = Rotate(d, ScatterTurn(SignedUnit(words.a), st.g, st.flip));
        // One Newton step keeps the length of the direction at 1 however long the path.
        const VF n = hn::NegMulAdd(hn::Mul(Constant(0.5f), d.x), d.x,
                                   hn::NegMulAdd(hn::Mul(Constant(0.5f), d.y), d.y, Constant(1.5f)));
        d = {hn::Mul(d.x, n), hn::Mul(d.y, n)};
        const Reach reach = ReachOf<M>(x, y, s, d);
        MF alive = hn::FirstN(f, count - i);
        VF t;
        VF chance = Uniform23(words.c);
        if (kForced) {
            const VF share = Absorbed(hn::Mul(Constant(st.sigma), reach.ahead));
            if (M == Medium::disc)
                length = hn::Add(length, hn::IfThenElseZero(alive, hn::Mul(weight, hn::Mul(share, per_sigma))));
            // Roulette. Rescaled, the number of a surviving path is uniform again, for the deposit.
            const VF factor = hn::Max(share, Constant(keep)), survival = hn::Div(share, factor);
            alive = hn::And(alive, hn::Lt(chance, survival));
            chance = hn::Div(chance, survival);
            weight = hn::Mul(weight, factor);
            t = hn::Min(hn::Mul(ForcedDepth(Uniform23(words.b), share), per_sigma), reach.ahead);
        } else {
            t = hn::Mul(hn::Neg(hn::Log(f, Uniform31(words.b))), per_sigma);
            if (M == Medium::disc)
                length = hn::Add(length, hn::IfThenElseZero(alive, hn::Mul(weight, hn::Min(t, reach.ahead))));
            alive = hn::And(alive, hn::Lt(t, reach.ahead));
            t = hn::Min(t, reach.ahead);
        }
        // Along the peak of the phase function, which for g < 0 lies behind.
        const VF straight = st.flip > 0 ? hn::Sub(reach.ahead, t) : hn::Add(reach.behind, t);
        x = hn::MulAdd(t, d.x, x);
        if (M == Medium::disc) {
            y = hn::MulAdd(t, d.y, y);
            s = hn::Mul(hn::Sub(reach.ahead, t), hn::Add(reach.behind, t));
            const VF fresh = hn::NegMulAdd(x, x, hn::NegMulAdd(y, y, Constant(1)));
            s = hn::IfThenElse(hn::Gt(s, Constant(0.1f)), fresh, s);
        } else {
            x = hn::Min(hn::Max(x, zero), Constant(2));
            y = hn::Add(y, t);
        }
        const Squeeze squeeze(alive);
        squeeze.Store(x, &w.x[out]), squeeze.Store(y, &w.y[out]);
        if (M == Medium::disc) squeeze.Store(s, &w.s[out]);
        if (absorbs) squeeze.Store(hn::Add(hn::LoadU(f, &w.length[i]), t), &w.length[out]);
        squeeze.Store(d.x, &w.dx[out]), squeeze.Store(d.y, &w.dy[out]);
        squeeze.Store(weight, &w.w[out]), squeeze.Store(chance, &w.chance[out]);
        squeeze.Store(straight, &w.straight[out]);
        squeeze.Store(index, &w.index[out]), squeeze.Store(reversed, &w.reversed[out]);
        squeeze.Store(words.d, &w.place[out]);
        out += hn::CountTrue(f, alive);
    }
    sums.scatterings += count;
    if (M == Medium::disc) sums.length[0] += static_cast<double>(hn::GetLane(hn::SumOfLanes(f, length)));
    return out;
}

template <Medium M, bool kWindow>
void Batch(PathTracer::State& st, std::uint32_t randomisation, std::size_t count, TracerSums& sums) {
    const TracerPlan& plan = st.cell.plan;
    const double flights = Start<M>(st, count);
    if (M == Medium::disc) sums.length[0] += flights;
    for (std::uint32_t order = 1; count > 0; ++order) {
        // Every path is scattered twice; later flights may end it.
        if (order == 1)
            count = Fly<M, true>(st, order, randomisation, count, 1e-37f, sums);
        else if (order <= plan.forced)
            count = Fly<M, true>(st, order, randomisation, count, plan.keep, sums);
        else
            count = Fly<M, false>(st, order, randomisation, count, 1, sums);
        Deposit<M, kWindow>(st, count, sums);
    }
}

void TraceBatch(PathTracer::State& st, std::uint32_t randomisation, std::size_t count, TracerSums& sums) {
    const bool window = st.cell.plan.window > 0;
    if (st.cell.medium == Medium::disc)
        window ? Batch<Medium::disc, true>(st, randomisation, count, sums)
               : Batch<Medium::disc, false>(st, randomisation, count, sums);
    else
        window ? Batch<Medium::slab, true>(st, randomisation, count, sums)
               : Batch<Medium::slab, false>(st, randomisation, count, sums);
}

/// Random words of `count` paths; the arrays are longer by kLaneMargin. words[k * stride + i], stride = count +
/// kLaneMargin.
void Words(const TracerCounter& c, const std::uint32_t* index, std::size_t count, std::uint32_t* words) {
    const U u;
    const std::size_t stride = count + kLaneMargin;
    for (std::size_t i = 0; i < count; i += hn::Lanes(u)) {
        const Words4 w = DrawWords(c.counter.data(), c.key.data(), hn::LoadU(u, index + i));
        hn::StoreU(w.a, u, words + i), hn::StoreU(w.b, u, words + stride + i);
        hn::StoreU(w.c, u, words + 2 * stride + i), hn::StoreU(w.d, u, words + 3 * stride + i);
    }
}

const char* Target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace medulla::sim2d
HWY_AFTER_NAMESPACE();
#endif
