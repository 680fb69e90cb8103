// SIMD arithmetic of the tracer: random words, exponentials, directions as unit complex numbers, compaction.
// Included once per instruction set.
#if defined(MEDULLA_TRACER_MATH_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef MEDULLA_TRACER_MATH_INL
#undef MEDULLA_TRACER_MATH_INL
#else
#define MEDULLA_TRACER_MATH_INL
#endif

#include <cstddef>
#include <cstdint>

#include "hwy/contrib/math/math-inl.h"
#include "hwy/highway.h"
#include "sim2d/tracer/state.hpp"

HWY_BEFORE_NAMESPACE();
namespace medulla::sim2d {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::ScalableTag<float>;
using I = hn::RebindToSigned<F>;
using U = hn::RebindToUnsigned<F>;
using VF = hn::Vec<F>;
using VI = hn::Vec<I>;
using VU = hn::Vec<U>;
using MF = hn::Mask<F>;

static_assert(hn::MaxLanes(F()) <= kLaneMargin, "arrays have room for one vector behind their last element");

constexpr float kPiF = static_cast<float>(pi);

HWY_INLINE VF Constant(float x) { return hn::Set(F(), x); }

/// Low and high halves of 32 x 32 bit products.
HWY_INLINE void Multiply(VU a, std::uint32_t factor, VU& low, VU& high) {
#if HWY_TARGET == HWY_SCALAR
    const std::uint64_t product = std::uint64_t{hn::GetLane(a)} * factor;
    low = hn::Set(U(), static_cast<std::uint32_t>(product));
    high = hn::Set(U(), static_cast<std::uint32_t>(product >> 32));
#else
    const hn::RepartitionToWide<U> wide;
    const VU b = hn::Set(U(), factor);
    const auto even = hn::MulEven(a, b);
    const auto odd = hn::MulEven(hn::BitCast(U(), hn::ShiftRight<32>(hn::BitCast(wide, a))), b);
    low = hn::OddEven(hn::BitCast(U(), hn::ShiftLeft<32>(odd)), hn::BitCast(U(), even));
    high = hn::OddEven(hn::BitCast(U(), odd), hn::BitCast(U(), hn::ShiftRight<32>(even)));
#endif
}

/// Philox4x32-10 over lanes of counters; random.hpp has the scalar reference implementation.
struct Words4 {
    VU a, b, c, d;
};
HWY_INLINE Words4 Philox(Words4 w, std::uint32_t k0, std::uint32_t k1) {
    for (int round = 0; round < 10; ++round) {
        VU al, ah, bl, bh;
        Multiply(w.a, 0xD2511F53u, al, ah);
        Multiply(w.c, 0xCD9E8D57u, bl, bh);
        w = {hn::Xor(hn::Xor(bh, w.b), hn::Set(U(), k0)), bl, hn::Xor(hn::Xor(ah, w.d), hn::Set(U(), k1)), al};
        k0 += 0x9E3779B9u, k1 += 0xBB67AE85u;
    }
    return w;
}
HWY_INLINE Words4 DrawWords(const std::uint32_t counter[4], const std::uint32_t key[2], VU index) {
    const U u;
    return Philox({hn::Set(u, counter[0]), index, hn::Set(u, counter[2]), hn::Set(u, counter[3])}, key[0], key[1]);
}

/// (0, 1], 31 bits: for -log(u), whose largest value is then 22 mean free paths.
HWY_INLINE VF Uniform31(VU bits) {
    const VF x = hn::ConvertTo(F(), hn::BitCast(I(), hn::ShiftRight<1>(bits)));
    return hn::MulAdd(x, Constant(0x1p-31f), Constant(0x1p-32f));
}
/// (0, 1), 23 bits: never 0 or 1.
HWY_INLINE VF Uniform23(VU bits) {
    const VF x = hn::ConvertTo(F(), hn::BitCast(I(), hn::ShiftRight<9>(bits)));
    return hn::MulAdd(x, Constant(0x1p-23f), Constant(0x1p-24f));
}

/// sin(pi v) for 0 <= v <= 1/2, relative error 1e-7.
HWY_INLINE VF SinPi(VF v) {
    const VF x = hn::Mul(v, Constant(kPiF)), z = hn::Mul(x, x);
    VF p = Constant(2.6019031e-6f);
    p = hn::MulAdd(p, z, Constant(-1.9807414e-4f));
    p = hn::MulAdd(p, z, Constant(8.3330255e-3f));
    p = hn::MulAdd(p, z, Constant(-1.6666657e-1f));
    return hn::MulAdd(hn::Mul(p, z), x, x);
}

/// 2^z for z <= 0, relative error 2e-7; at least 2^-126; NaN for NaN.
HWY_INLINE VF Exp2(VF z) {
    z = hn::IfThenElse(hn::Lt(z, Constant(-126.0f)), Constant(-126.0f), z);  // hn::Max would drop NaN on x86
    const VI n = hn::NearestInt(z);
    const VF f = hn::Sub(z, hn::ConvertTo(F(), n));
    VF p = Constant(1.3333558e-3f);
    p = hn::MulAdd(p, f, Constant(9.6181291e-3f));
    p = hn::MulAdd(p, f, Constant(5.5504109e-2f));
    p = hn::MulAdd(p, f, Constant(2.4022651e-1f));
    p = hn::MulAdd(p, f, Constant(6.9314718e-1f));
    p = hn::MulAdd(p, f, Constant(1.0f));
    return hn::BitCast(F(), hn::Add(hn::BitCast(I(), p), hn::ShiftLeft<23>(n)));
}
constexpr float kLog2E = 1.44269504f;

struct VDirection {
    VF x, y;
};
HWY_INLINE VDirection Rotate(VDirection a, VDirection b) {
    return {hn::NegMulAdd(a.y, b.y, hn::Mul(a.x, b.x)), hn::MulAdd(a.x, b.y, hn::Mul(a.y, b.x))};
}
/// The direction a, rotated by minus the angle of b.
HWY_INLINE VDirection RotateBack(VDirection a, VDirection b) {
    return {hn::MulAdd(a.x, b.x, hn::Mul(a.y, b.y)), hn::NegMulAdd(a.x, b.y, hn::Mul(a.y, b.x))};
}

/// Planar Henyey-Greenstein by its inverse: tan(t / 2) = (1 - g) / (1 + g) tan(pi v), v uniform in [-1/2, 1/2].
/// This is the Moebius form of physics.md, section 1, squared; nothing cancels as g -> 1.
HWY_INLINE VDirection ScatterTurn(VF v, float g, float flip) {
    const VF b = hn::Mul(Constant(1 - g), SinPi(hn::Abs(v)));
    const VF a = hn::Mul(Constant(1 + g), SinPi(hn::Sub(Constant(0.5f), hn::Abs(v))));
    const VF n = hn::Div(Constant(flip), hn::MulAdd(a, a, hn::Mul(b, b)));
    const VF ab = hn::Mul(a, b);
    return {hn::Mul(hn::Mul(hn::Sub(a, b), hn::Add(a, b)), n), hn::Mul(hn::CopySign(hn::Add(ab, ab), v), n)};
}
HWY_INLINE VF SignedUnit(VU bits) { return hn::Mul(hn::ConvertTo(F(), hn::BitCast(I(), bits)), Constant(0x1p-32f)); }

/// exp(2 pi i f), 0 <= f <= 1.
HWY_INLINE VDirection Turn(VF f) { return ScatterTurn(hn::Sub(f, Constant(0.5f)), 0.0f, -1.0f); }

/// 1 - exp(-x), x >= 0.
HWY_INLINE VF Absorbed(VF x) {
    // Below 1/8 the series, whose first dropped term is x^6 / 5040; above, the difference is accurate to 2e-6.
    VF p = Constant(-1.0f / 720);
    p = hn::MulAdd(p, x, Constant(1.0f / 120));
    p = hn::MulAdd(p, x, Constant(-1.0f / 24));
    p = hn::MulAdd(p, x, Constant(1.0f / 6));
    p = hn::MulAdd(p, x, Constant(-0.5f));
    p = hn::MulAdd(p, x, Constant(1.0f));
    const VF direct = hn::Sub(Constant(1), Exp2(hn::Mul(x, Constant(-kLog2E))));
    return hn::IfThenElse(hn::Lt(x, Constant(0.125f)), hn::Mul(p, x), direct);
}

/// Depth of the first collision in mean free paths: -log(1 - u share).
HWY_INLINE VF ForcedDepth(VF u, VF share) { return hn::Neg(hn::Log1p(F(), hn::Neg(hn::Mul(u, share)))); }

/// Angle of a direction in turns, [0, 1), to 1e-3, which is enough to place a window.
HWY_INLINE VF RoughTurns(VDirection d) {
    const VF ax = hn::Abs(d.x), ay = hn::Abs(d.y), one = Constant(1);
    const VF r = hn::Div(hn::Min(ax, ay), hn::Max(hn::Max(ax, ay), Constant(1e-30f)));
    VF t = hn::Mul(r, hn::MulAdd(hn::Sub(one, r), Constant(0.0434f), Constant(0.125f)));
    t = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(Constant(0.25f), t), t);
    t = hn::IfThenElse(hn::Lt(d.x, hn::Zero(F())), hn::Sub(Constant(0.5f), t), t);
    return hn::IfThenElse(hn::Lt(d.y, hn::Zero(F())), hn::Sub(one, t), t);
}

/// Stores the lanes of a mask contiguously; overwrites up to a vector beyond them.
/// AVX2 has no such instruction, so one permutation is looked up and used for all arrays.
class Squeeze {
  public:
    explicit Squeeze(MF kept) : kept_(kept) {
#if HWY_TARGET == HWY_AVX2
        std::uint8_t bits[8];
        hn::StoreMaskBits(F(), kept, bits);
        const U u;
        const VU packed = hn::Shr(hn::Set(u, kSqueeze.lanes[bits[0]]), hn::ShiftLeft<2>(hn::Iota(u, 0)));
        order_ = hn::And(packed, hn::Set(u, 7));
#endif
    }
    HWY_INLINE void Store(VF v, float* to) const {
#if HWY_TARGET == HWY_AVX2
        hn::StoreU(hn::TableLookupLanes(v, hn::IndicesFromVec(F(), hn::BitCast(I(), order_))), F(), to);
#else
        hn::StoreU(hn::Compress(v, kept_), F(), to);  // in registers: AMD's compressing store takes over 100 cycles
#endif
    }
    HWY_INLINE void Store(VU v, std::uint32_t* to) const {
#if HWY_TARGET == HWY_AVX2
        hn::StoreU(hn::TableLookupLanes(v, hn::IndicesFromVec(U(), order_)), U(), to);
#else
        hn::StoreU(hn::Compress(v, hn::RebindMask(U(), kept_)), U(), to);
#endif
    }

  private:
    MF kept_;
#if HWY_TARGET == HWY_AVX2
    VU order_;
#endif
};

}  // namespace HWY_NAMESPACE
}  // namespace medulla::sim2d
HWY_AFTER_NAMESPACE();
#endif
