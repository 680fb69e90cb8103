// The product, compiled once per instruction set; the best one of the machine is chosen at run time.
// Tiles of six rows by up to four vectors stay in registers over the inner dimension: Goto & van de Geijn 2008,
// "Anatomy of high-performance matrix multiplication". The matrices here fit the second-level cache, so contiguous rows
// of b are used in place.
#include "tensor/product.hpp"

#include <algorithm>
#include <vector>

// Tiles are arrays of vectors, which those of unknown size cannot be.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tensor/product.cpp"
#include "hwy/foreach_target.h"
// After foreach_target.
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace medulla::tensor::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Index = Eigen::Index;
using detail::Strided;

constexpr int kRows = 6;
/// Six rows of these, the vectors of b and a broadcast fill the registers: 32 with AVX-512, else 16.
constexpr int kVectors = HWY_TARGET <= HWY_AVX3 ? 4 : 2;

template <int rows, int vectors>
void Tile(Strided a, const double* b, Index b_down, Index inner, double* c, Index stride, bool add) {
    const hn::ScalableTag<double> d;
    const Index n = static_cast<Index>(hn::Lanes(d));
    hn::Vec<decltype(d)> sum[rows][vectors];
    for (int r = 0; r < rows; ++r)
        for (int v = 0; v < vectors; ++v) sum[r][v] = hn::Zero(d);
    for (Index k = 0; k < inner; ++k) {
        hn::Vec<decltype(d)> row[vectors];
        for (int v = 0; v < vectors; ++v) row[v] = hn::LoadU(d, b + k * b_down + v * n);
        for (int r = 0; r < rows; ++r) {
            const auto x = hn::Set(d, a.at[r * a.down + k * a.across]);
            for (int v = 0; v < vectors; ++v) sum[r][v] = hn::MulAdd(x, row[v], sum[r][v]);
        }
    }
    for (int r = 0; r < rows; ++r)
        for (int v = 0; v < vectors; ++v) {
            double* to = c + r * stride + v * n;
            hn::StoreU(add ? hn::Add(hn::LoadU(d, to), sum[r][v]) : sum[r][v], d, to);
        }
}

template <int vectors>
void Tiles(Strided a, const double* b, Index b_down, Index inner, double* c, Index stride, Index rows, bool add) {
    Index i = 0;
    for (; i + kRows <= rows; i += kRows)
        Tile<kRows, vectors>({a.at + i * a.down, a.down, a.across}, b, b_down, inner, c + i * stride, stride, add);
    const Strided rest{a.at + i * a.down, a.down, a.across};
    c += i * stride;
    switch (rows - i) {
        case 5:
            return Tile<5, vectors>(rest, b, b_down, inner, c, stride, add);
        case 4:
            return Tile<4, vectors>(rest, b, b_down, inner, c, stride, add);
        case 3:
            return Tile<3, vectors>(rest, b, b_down, inner, c, stride, add);
        case 2:
            return Tile<2, vectors>(rest, b, b_down, inner, c, stride, add);
        case 1:
            return Tile<1, vectors>(rest, b, b_down, inner, c, stride, add);
        default:
            return;
    }
}

/// A panel of whole vectors.
void Panel(int vectors, Strided a, const double* b, Index b_down, Index inner, double* c, Index stride, Index rows,
           bool add) {
    if constexpr (kVectors > 2) {
        if (vectors == 4) return Tiles<4>(a, b, b_down, inner, c, stride, rows, add);
        if (vectors == 3) return Tiles<3>(a, b, b_down, inner, c, stride, rows, add);
    }
    if (vectors == 2) return Tiles<2>(a, b, b_down, inner, c, stride, rows, add);
    Tiles<1>(a, b, b_down, inner, c, stride, rows, add);
}

void Product(Strided a, Strided b, double* c, Index stride, Index rows, Index inner, Index columns, bool add) {
    const Index lanes = static_cast<Index>(hn::Lanes(hn::ScalableTag<double>()));
    std::vector<double> packed, last;
    for (Index from = 0; from < columns; from += kVectors * lanes) {
        const Index width = std::min(kVectors * lanes, columns - from), whole = (width + lanes - 1) / lanes * lanes;
        const double* panel = b.at + from * b.across;
        Index panel_down = b.down;
        if (b.across != 1 || whole != width) {
            packed.assign(static_cast<std::size_t>(inner * whole), 0.0);
            for (Index k = 0; k < inner; ++k)
                for (Index j = 0; j < width; ++j)
                    packed[static_cast<std::size_t>(k * whole + j)] = panel[k * b.down + j * b.across];
            panel = packed.data(), panel_down = whole;
        }
        const int vectors = static_cast<int>(whole / lanes);
        if (whole == width) {
            Panel(vectors, a, panel, panel_down, inner, c + from, stride, rows, add);
            continue;
        }
        last.resize(static_cast<std::size_t>(rows * whole));
        Panel(vectors, a, panel, panel_down, inner, last.data(), whole, rows, false);
        for (Index i = 0; i < rows; ++i)
            for (Index j = 0; j < width; ++j) {
                double& to = c[i * stride + from + j];
                to = (add ? to : 0.0) + last[static_cast<std::size_t>(i * whole + j)];
            }
    }
}

}  // namespace medulla::tensor::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace medulla::tensor::detail {

HWY_EXPORT(Product);

void product(Strided a, Strided b, double* c, Eigen::Index stride, Eigen::Index rows, Eigen::Index inner,
             Eigen::Index columns, bool add) {
    HWY_DYNAMIC_DISPATCH(Product)(a, b, c, stride, rows, inner, columns, add);
}

}  // namespace medulla::tensor::detail
#endif
