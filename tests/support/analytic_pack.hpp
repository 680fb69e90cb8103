// A small valid pack in memory from closed forms, so that the BCSDF is tested without a simulation: factors are
// interpolated by the runtime's splines. The lobes are invented, but have the properties of real ones.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <vector>

#include "medulla/pack.hpp"

namespace analytic {

using namespace medulla;

/// One axis of a table: breakpoints, and the factor of component r at x.
struct AxisSpec {
    Quantity quantity;
    std::vector<double> breakpoints;  ///< in the spline's coordinate
    std::function<double(int r, double x)> factor;
};

struct TableSpec {
    TableKind kind;
    int rank, even;  ///< number of components; the first `even` are even in the exit direction
    std::vector<AxisSpec> axes;
};

inline std::vector<double> even(double low, double high, int spans) {
    std::vector<double> t;
    for (int i = 0; i <= spans; ++i) t.push_back(low + (high - low) * i / spans);
    return t;
}

/// Solves the dense system a x = b (partial pivoting).
inline std::vector<double> solve(std::vector<std::vector<double>> a, std::vector<double> b) {
    const std::size_t n = b.size();
    for (std::size_t k = 0; k < n; ++k) {
        std::size_t pivot = k;
        for (std::size_t i = k + 1; i < n; ++i)
            if (std::abs(a[i][k]) > std::abs(a[pivot][k])) pivot = i;
        std::swap(a[k], a[pivot]), std::swap(b[k], b[pivot]);
        for (std::size_t i = k + 1; i < n; ++i) {
            const double f = a[i][k] / a[k][k];
            if (f == 0) continue;
            for (std::size_t j = k; j < n; ++j) a[i][j] -= f * a[k][j];
            b[i] -= f * b[k];
        }
    }
    for (std::size_t k = n; k-- > 0;) {
        for (std::size_t j = k + 1; j < n; ++j) b[k] -= a[k][j] * b[j];
        b[k] /= a[k][k];
    }
    return b;
}

/// Knots with two mirrored ghosts at either end.
inline std::vector<double> with_ghosts(const std::vector<double>& t) {
    const int n = int(t.size()) - 1;
    const auto at = [&](int i) {
        return i < 0 ? 2 * t[0] - t[std::min(-i, n)] - (-i > n ? 1.0 : 0.0)
                     : (i > n ? 2 * t[n] - t[std::max(2 * n - i, 0)] + (i > 2 * n ? 1.0 : 0.0) : t[i]);
    };
    std::vector<double> knots;
    for (int i = -2; i <= n + 2; ++i) knots.push_back(at(i));
    return knots;
}

template <class T>
std::vector<Knot<T>> packed_knots(const std::vector<double>& t) {
    std::vector<Knot<T>> knots;
    const auto inverse = [&](std::size_t i, std::size_t step) {
        return T(i + step < t.size() ? 1.0 / (double(T(t[i + step])) - double(T(t[i]))) : 0.0);
    };
    for (std::size_t i = 0; i < t.size(); ++i) knots.push_back({T(t[i]), inverse(i, 1), inverse(i, 2), inverse(i, 3)});
    return knots;
}

/// Coefficients of the spline through f at the breakpoints and the middle of the first and last span.
inline std::vector<double> interpolate(const std::vector<double>& t, const std::function<double(double)>& f) {
    const auto knots = packed_knots<double>(with_ghosts(t));
    const auto spans = std::uint32_t(t.size() - 1);
    const AxisView<double> axis = {reinterpret_cast<const unsigned char*>(knots.data()), spans};
    std::vector<double> sites(t.begin(), t.end());
    sites.push_back((t[0] + t[1]) / 2), sites.push_back((t[spans - 1] + t[spans]) / 2);
    if (spans == 1) sites.back() = t[0] + 0.75 * (t[1] - t[0]);
    std::vector<std::vector<double>> a(sites.size(), std::vector<double>(sites.size(), 0.0));
    std::vector<double> b;
    for (std::size_t i = 0; i < sites.size(); ++i) {
        const auto cell = locate(axis, sites[i]);
        const auto w = spline_weights(axis, cell);
        for (std::size_t k = 0; k < 4; ++k) a[i][cell.span + k] = w.w[k];
        b.push_back(f(sites[i]));
    }
    return solve(a, b);
}

class PackBuilder {
  public:
    void add(const TableSpec& spec) { specs_.push_back(spec); }

    std::vector<unsigned char> bytes() const {
        std::vector<unsigned char> out(sizeof(PackHeader) + specs_.size() * sizeof(PackTable), 0);
        std::vector<PackTable> tables;
        const auto put = [&](const void* data, std::size_t size) {
            const auto offset = std::uint32_t(out.size());
            const auto* p = static_cast<const unsigned char*>(data);
            out.insert(out.end(), p, p + size);
            return offset;
        };
        for (const TableSpec& spec : specs_) {
            PackTable table = {};
            table.kind = std::uint32_t(spec.kind);
            table.even_rank = std::uint32_t(spec.even), table.odd_rank = std::uint32_t(spec.rank - spec.even);
            table.rank_stride = padded_rank(table.even_rank) + padded_rank(table.odd_rank);
            const auto place = [&](int r) {
                return std::uint32_t(r < spec.even ? r : r - spec.even + int(padded_rank(table.even_rank)));
            };
            table.axis_count = std::uint32_t(spec.axes.size());
            for (std::uint32_t i = 0; i < table.rank_stride / rank_multiple; ++i)
                table.block_bits[i] = 16, table.row_bytes += 16;
            std::vector<float> scales(table.rank_stride, 0.0f), integrals(table.rank_stride, 0.0f);
            for (int r = 0; r < spec.rank; ++r) scales[place(r)] = 1;
            for (std::size_t k = 0; k < spec.axes.size(); ++k) {
                const AxisSpec& axis = spec.axes[k];
                const auto spans = std::uint32_t(axis.breakpoints.size() - 1);
                const auto knots = packed_knots<float>(with_ghosts(axis.breakpoints));
                std::vector<unsigned char> rows(std::size_t(spans + 3) * table.row_bytes, 0);
                for (int r = 0; r < spec.rank; ++r) {
                    const auto c = interpolate(axis.breakpoints, [&](double x) { return axis.factor(r, x); });
                    double most = 0;
                    for (double x : c) most = std::max(most, std::abs(x));
                    const double unit = most > 0 ? most / greatest_number : 1;
                    for (std::size_t j = 0; j < c.size(); ++j)
                        store_number(&rows[j * table.row_bytes + place(r) / 8 * 16], 16, place(r) % 8,
                                     int(std::lround(c[j] / unit)));
                    scales[place(r)] *= float(unit);
                }
                table.axes[k].quantity = std::uint32_t(axis.quantity);
                table.axes[k].nodes = table.axes[k].spans = spans;
                table.axes[k].knots_offset = put(knots.data(), knots.size() * sizeof knots[0]);
                table.axes[k].rows_offset = put(rows.data(), rows.size());
                if (is_lobe(spec.kind) && k + 1 == spec.axes.size())
                    integrals = exit_integrals(knots, rows, spans, table.rank_stride, padded_rank(table.even_rank));
            }
            table.scales_offset = put(scales.data(), scales.size() * 4);
            if (is_lobe(spec.kind)) table.integrals_offset = put(integrals.data(), integrals.size() * 4);
            tables.push_back(table);
        }
        PackHeader header = {};
        std::memcpy(header.magic, pack_magic, sizeof pack_magic);
        header.version = pack_version;
        header.table_count = std::uint32_t(specs_.size());
        header.tables_offset = sizeof(PackHeader);
        header.text_bytes = 2;
        header.text_offset = put("{}", 2);
        header.byte_count = out.size();
        std::memcpy(out.data() + sizeof header, tables.data(), tables.size() * sizeof(PackTable));
        std::memcpy(out.data(), &header, sizeof header);
        header.checksum = pack_checksum(out.data(), out.size());
        std::memcpy(out.data(), &header, sizeof header);
        return out;
    }

  private:
    /// Over both halves of the axis: twice the stored one's for even components, 0 for odd ones. Two Gauss nodes per
    /// span integrate a cubic exactly.
    static std::vector<float> exit_integrals(const std::vector<Knot<float>>& knots,
                                             const std::vector<unsigned char>& rows, std::uint32_t spans,
                                             std::uint32_t stride, std::uint32_t even) {
        std::vector<double> sum(stride, 0.0);
        const AxisView<float> axis = {reinterpret_cast<const unsigned char*>(knots.data()), spans};
        for (std::uint32_t i = 0; i < spans; ++i) {
            const double a = axis.knot(int(i)).t, b = axis.knot(int(i) + 1).t;
            for (double x : {-0.57735026918962576, 0.57735026918962576}) {
                const auto w = spline_weights(axis, Cell<float>{i, float((a + b) / 2 + x * (b - a) / 2)});
                for (std::uint32_t k = 0; k < 4; ++k)
                    for (std::uint32_t r = 0; r < even; ++r)
                        sum[r] +=
                            (b - a) * double(w.w[k]) * load_number(&rows[(i + k) * stride * 2 + r / 8 * 16], 16, r % 8);
            }
        }
        return std::vector<float>(sum.begin(), sum.end());
    }
    std::vector<TableSpec> specs_;
};

/// Azimuthal: sum over harmonics n of g^n exp(-0.1 sigma n) cos(n phi), the planar HG as sigma -> 0, leaning by
/// 0.4 h (g^2 - 1) sin(phi): without any symmetry that would hide a wrong sign. Rank `harmonics` + 1.
inline double azimuthal_density(double sigma, double g, double h, double phi, int harmonics) {
    double sum = 1;
    for (int n = 1; n < harmonics; ++n) sum += 2 * std::pow(g, n) * std::exp(-0.1 * sigma * n) * std::cos(n * phi);
    return (sum + 0.4 * h * (g * g - 1) * std::sin(phi)) / (2 * pi);
}

inline TableSpec azimuthal_table(int harmonics = 15, int phi_spans = 48) {
    TableSpec spec = {TableKind::azimuthal, harmonics + 1, harmonics, {}};
    const int last = harmonics;
    spec.axes.push_back(
        {Quantity::sigma, even(0, 4, 24), [=](int r, double c) { return r == last ? 1 : std::exp(-0.1 * c * c * r); }});
    spec.axes.push_back(
        {Quantity::g, even(-0.95, 0.95, 24), [=](int r, double x) { return r == last ? x * x - 1 : std::pow(x, r); }});
    spec.axes.push_back(
        {Quantity::h, even(0, 1, 8), [=](int r, double c) { return r == last ? 2 * c / (1 + c * c) : 1.0; }});
    spec.axes.push_back({Quantity::phi, even(0, pi, phi_spans / 2), [=](int r, double x) {
                             return r == last ? 0.4 * std::sin(x) / (2 * pi) : (r ? 2 : 1) * std::cos(r * x) / (2 * pi);
                         }});
    return spec;
}

/// Longitudinal: cos(theta_r)/2 (1 + lean sin(theta_i) sin(theta_r)), lean = -0.3 back and -0.9 g - 0.05 forward.
inline double longitudinal_density(bool back, double g, double theta_i, double theta_r) {
    const double lean = back ? -0.3 : -0.9 * g - 0.05;
    return std::cos(theta_r) / 2 * (1 + lean * std::sin(theta_i) * std::sin(theta_r));
}

inline TableSpec longitudinal_table(bool back, int rank = 2) {
    TableSpec spec = {back ? TableKind::longitudinal_back : TableKind::longitudinal_forward, rank, 1, {}};
    spec.axes.push_back({Quantity::sigma, even(0, 4, 12), [](int, double) { return 1.0; }});
    spec.axes.push_back({Quantity::g, even(-0.95, 0.95, 24),
                         [=](int r, double x) { return r == 1 ? (back ? -0.3 : -0.9 * x - 0.05) : 1.0; }});
    spec.axes.push_back({Quantity::theta_i, even(0, 1, 12), [](int r, double c) {
                             return r == 1 ? std::sin(from_spline_coordinate(Quantity::theta_i, c)) : 1.0;
                         }});
    spec.axes.push_back({Quantity::theta_r, even(0, pi / 2, 12),
                         [](int r, double x) { return r > 1 ? 0.0 : std::cos(x) / 2 * (r == 1 ? std::sin(x) : 1.0); }});
    return spec;
}

/// The pack of most tests; it owns its bytes.
struct AnalyticPack {
    std::vector<unsigned char> bytes;
    PackView view;
    explicit AnalyticPack(int harmonics = 15, int longitudinal_rank = 2, bool azimuthal = true,
                          bool longitudinal = true) {
        PackBuilder builder;
        if (azimuthal) builder.add(azimuthal_table(harmonics));
        if (longitudinal)
            builder.add(longitudinal_table(true, longitudinal_rank)),
                builder.add(longitudinal_table(false, longitudinal_rank));
        bytes = builder.bytes();
        // To run the tests with another pack: the tested properties do not depend on it.
        if (const char* file = std::getenv("MEDULLA_TEST_PACK")) {
            std::ifstream in(file, std::ios::binary);
            bytes.assign(std::istreambuf_iterator<char>(in), {});
        }
        view = open_pack(bytes.data(), bytes.size()).pack;
    }
    AnalyticPack(const AnalyticPack&) = delete;
    AnalyticPack& operator=(const AnalyticPack&) = delete;
};

inline const AnalyticPack& pack() {
    static const AnalyticPack p;
    return p;
}

}  // namespace analytic
