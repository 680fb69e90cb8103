// A baked material (.furpack): the scattered light of one fibre, simulated in three dimensions, as a sum of exit
// functions. Layout, validator and a view that borrows the bytes. docs/formats.md, docs/truth.md 'Bake'.
//
// Energy per radian^2 of (theta_r, phi) that scattered light has, for light from theta_i at offset h >= 0:
//
//   E(theta_i, h) exp(-sigma_ca l) sum over k < 2 K of c_k(theta_i, h, sigma_ca) B_k(theta_r, phi - turn (2 gamma_t -
//   2 gamma_i)),
//
// where B_k >= 0 has integral 1, B_{K + k} is B_k mirrored in phi, c_k >= 0, l is the shortest way through the cortex
// of light that scatters, and E is the light that would leave scattered had nothing absorbed it. E is what R and the
// other unscattered light leave of 1, so a white fibre keeps its
// energy exactly.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"
#include "medulla/fur_parameters.hpp"
#include "medulla/pack.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

inline constexpr char baked_magic[8] = {'F', 'U', 'R', 'B', 'A', 'K', 'E', '\n'};
inline constexpr std::uint32_t baked_version = 1;
inline constexpr std::uint32_t max_exit_functions = 24;  ///< K, a multiple of 4
inline constexpr int absorption_nodes = 5;               ///< values of sigma_ca that coefficients are stored for

struct BakedHeader {
    char magic[8];
    std::uint32_t version;
    std::uint32_t functions;        ///< K: a multiple of 4, 4 .. max_exit_functions
    std::uint64_t byte_count;       ///< of the whole pack
    std::uint64_t checksum;         ///< pack_checksum of the whole pack with this field as 0
    std::uint32_t rows, columns;    ///< of theta_r and phi: 4 .. 256 cells of equal size, nodes at their centres
    std::uint32_t inclinations;     ///< nodes of theta_i, evenly over [-theta_high, theta_high]: 2 .. 256
    std::uint32_t offsets_inside;   ///< nodes of |h| up to the medulla's rim, even in asin(|h| / rim): 2 .. 256
    std::uint32_t offsets_beyond;   ///< nodes beyond it, even in sqrt((|h| - rim) / (1 - rim)): 0 .. 256
    std::uint32_t bytes_offset;     ///< uint8[rows][columns][K]: square roots of B_k at the nodes
    std::uint32_t sums_offset;      ///< uint32[K][rows]: sums of their squares over a row
    std::uint32_t cells_offset;     ///< uint8[cell][absorption][2 K]: square roots of c_k; cells are [theta_i][h]
    std::uint32_t scales_offset;    ///< float[cell][absorption]: unit of those squares
    std::uint32_t energies_offset;  ///< float[cell][2]: simulated over closed form, of R and of TT, TRT and higher
    std::uint32_t text_offset, text_bytes;  ///< provenance: JSON text, not terminated
    float theta_high;                       ///< [radians], in (0, pi/2)
    float turn;                             ///< [1], in [0, 1]
    float sigma_middle;             ///< of x = s / (s + sqrt(sigma_middle)), s = sqrt(sigma_ca) [1 / fibre radius], > 0
    float sigma[absorption_nodes];  ///< the nodes, ascending from 0 [1 / fibre radius]
    float eta, kappa, alpha, beta_m, beta_n, layers, sigma_ms, sigma_ma, g;  ///< FurParameters: what was simulated
    float sigma_ca[3];                                                       ///< the material's own colour
    float median_error, worst_error;  ///< relative L2 against independent paths, over cells and colours
    std::uint32_t reserved[2];        ///< 0
};
static_assert(sizeof(BakedHeader) == 176 && offsetof(BakedHeader, checksum) == 24);

enum class BakedStatus {
    ok,
    null_pointer,
    too_short,
    not_baked,
    other_version,
    wrong_size,
    wrong_checksum,
    bad_size,
    bad_number,
    bad_sum,
    bad_material,
    bad_reserved,
    out_of_bounds,
    big_endian,
};

inline const char* describe(BakedStatus status) noexcept {
    switch (status) {
        case BakedStatus::ok:
            return "ok";
        case BakedStatus::null_pointer:
            return "no bytes";
        case BakedStatus::too_short:
            return "shorter than the header of a baked material";
        case BakedStatus::not_baked:
            return "does not begin with FURBAKE";
        case BakedStatus::other_version:
            return "a baked material of another format version";
        case BakedStatus::wrong_size:
            return "its size is not the byte count in its header";
        case BakedStatus::wrong_checksum:
            return "its checksum does not match";
        case BakedStatus::bad_size:
            return "a number of functions, rows, columns or nodes is outside the format";
        case BakedStatus::bad_number:
            return "a number is not finite, negative, or larger than that of any lobe";
        case BakedStatus::bad_sum:
            return "an exit function is empty, or the sum of a row is not that of its numbers";
        case BakedStatus::bad_material:
            return "the material's parameters are out of their ranges";
        case BakedStatus::bad_reserved:
            return "a field that this format version leaves at 0 is not 0";
        case BakedStatus::out_of_bounds:
            return "an offset points outside the pack";
        case BakedStatus::big_endian:
            return "packs are little-endian; this machine is not";
    }
    return "unknown status";
}

/// A validated baked material where it lies. It borrows the bytes it was opened on.
struct BakedMaterial {
    BakedHeader header = {};
    const unsigned char* bytes = nullptr;         ///< of the pack; null: not open
    float x[absorption_nodes] = {};               ///< nodes of x
    float inverse[absorption_nodes] = {};         ///< 1 / product of their differences
    float unit[max_exit_functions] = {};          ///< density [1 / radian^2] of one square of B_k
    float area[max_exit_functions] = {};          ///< 1 / unit
    std::uint64_t mass[max_exit_functions] = {};  ///< sum of four times its squares, three times in the outermost rows

    MEDULLA_FN explicit operator bool() const noexcept { return bytes != nullptr; }
    MEDULLA_FN std::uint32_t offsets() const noexcept { return header.offsets_inside + header.offsets_beyond; }
    MEDULLA_FN std::uint32_t cells() const noexcept { return header.inclinations * offsets(); }
    /// K bytes of a node of (theta_r, phi).
    MEDULLA_FN const unsigned char* node(std::uint32_t row, std::uint32_t column) const noexcept {
        return bytes + header.bytes_offset + (std::size_t(row) * header.columns + column) * header.functions;
    }
    MEDULLA_FN std::uint32_t row_sum(std::uint32_t k, std::uint32_t row) const noexcept {
        return detail::load<std::uint32_t>(bytes + header.sums_offset + 4 * (std::size_t(k) * header.rows + row));
    }
    /// 2 K bytes of a cell.
    MEDULLA_FN const unsigned char* coefficients(std::uint32_t cell, int absorption) const noexcept {
        return bytes + header.cells_offset +
               (std::size_t(cell) * absorption_nodes + std::size_t(absorption)) * 2 * header.functions;
    }
    MEDULLA_FN float scale(std::uint32_t cell, int absorption) const noexcept {
        return detail::load<float>(bytes + header.scales_offset +
                                   4 * (std::size_t(cell) * absorption_nodes + std::size_t(absorption)));
    }
    /// 0: of R. 1: of TT, TRT and higher orders.
    MEDULLA_FN float energy(std::uint32_t cell, int which) const noexcept {
        return detail::load<float>(bytes + header.energies_offset + 4 * (std::size_t(cell) * 2 + std::size_t(which)));
    }
    /// What was simulated, in the material's own colour.
    MEDULLA_FN FurParameters<3> parameters() const noexcept {
        FurParameters<3> p;
        const BakedHeader& h = header;
        p.eta = h.eta;
        p.kappa = h.kappa;
        p.alpha = h.alpha;
        p.beta_m = h.beta_m;
        p.beta_n = h.beta_n;
        p.layers = h.layers;
        p.sigma_ms = h.sigma_ms;
        p.sigma_ma = h.sigma_ma;
        p.g = h.g;
        for (int c = 0; c < 3; ++c) p.sigma_ca[c] = h.sigma_ca[c];
        p.fresnel = Fresnel::exact;
        return p;
    }
};

struct BakedResult {
    BakedMaterial material;
    BakedStatus status;
};

namespace detail {

/// Four times the area of the hat of a row over that of one inside: the outermost ones end at the pole, half a cell
/// away.
MEDULLA_FN std::uint32_t row_area(std::uint32_t row, std::uint32_t rows) noexcept {
    return row == 0 || row + 1 == rows ? 3 : 4;
}

/// Coordinate x of an absorption: even steps of it are even errors, and it is 1 at infinity.
MEDULLA_FN float absorption_place(const BakedHeader& h, float sigma_ca) noexcept {
    const float s = detail::math::sqrt(sigma_ca);
    return s / (s + detail::math::sqrt(h.sigma_middle));
}

/// Sizes, nodes and numbers of the header, by bits where -ffast-math could take a NaN for a number.
MEDULLA_FN BakedStatus check_header(const BakedHeader& h) noexcept {
    const auto count = [](std::uint32_t n, std::uint32_t least) { return n >= least && n <= 256; };
    if (h.functions < 4 || h.functions > max_exit_functions || h.functions % 4 != 0 || !count(h.rows, 4) ||
        !count(h.columns, 4) || !count(h.inclinations, 2) || !count(h.offsets_inside, 2) || !count(h.offsets_beyond, 0))
        return BakedStatus::bad_size;
    if (!within(h.theta_high, 1e-3f, 1.5707f) || !within(h.turn, 0.0f, 1.0f) || !within(h.sigma_middle, 1e-3f, 1e3f) ||
        !within(h.median_error, 0.0f, 1e3f) || !within(h.worst_error, 0.0f, 1e3f))
        return BakedStatus::bad_number;
    for (int j = 0; j < absorption_nodes; ++j) {
        if (!within(h.sigma[j], 0.0f, 1e3f)) return BakedStatus::bad_number;
        // From 0, and far enough apart for weights of at most some thousands.
        const float step = absorption_place(h, h.sigma[j]) - (j > 0 ? absorption_place(h, h.sigma[j - 1]) : 0.0f);
        if (j > 0 ? !(step > 0.02f) : step > 0) return BakedStatus::bad_number;
    }
    return BakedStatus::ok;
}

/// Finite floats in [0, most].
MEDULLA_FN bool all_within(const unsigned char* floats, std::size_t count, float most) noexcept {
    for (std::size_t i = 0; i < count; ++i)
        if (!within(load<float>(floats + 4 * i), 0.0f, most)) return false;
    return true;
}

}  // namespace detail

/// Checks every size, offset and number of a baked material before anything is used. Bytes need no alignment and must
/// outlive the view. Takes about 2 ns per byte.
inline BakedResult open_baked(const void* data, std::size_t size) noexcept {
    const auto fail = [](BakedStatus status) { return BakedResult{BakedMaterial{}, status}; };
    if (data == nullptr) return fail(BakedStatus::null_pointer);
    const auto* bytes = static_cast<const unsigned char*>(data);
    if (!detail::little_endian()) return fail(BakedStatus::big_endian);
    if (size < 16) return fail(BakedStatus::too_short);
    if (std::memcmp(bytes, baked_magic, sizeof baked_magic) != 0) return fail(BakedStatus::not_baked);
    if (detail::load<std::uint32_t>(bytes + 8) != baked_version) return fail(BakedStatus::other_version);
    if (size < sizeof(BakedHeader)) return fail(BakedStatus::too_short);
    BakedMaterial material;
    BakedHeader& h = material.header;
    h = detail::load<BakedHeader>(bytes);
    if (h.byte_count != size) return fail(BakedStatus::wrong_size);
    if (h.checksum != pack_checksum(bytes, size)) return fail(BakedStatus::wrong_checksum);
    if (!detail::zeros(h.reserved, 2)) return fail(BakedStatus::bad_reserved);
    if (const BakedStatus status = detail::check_header(h); status != BakedStatus::ok) return fail(status);
    material.bytes = bytes;
    if (out_of_range(material.parameters()) != 0) return fail(BakedStatus::bad_material);
    const std::size_t cells = material.cells(), k_count = h.functions;
    const auto inside = [&](std::uint32_t offset, std::size_t count) {
        return offset >= sizeof(BakedHeader) && offset <= size && count <= size - offset;
    };
    if (!inside(h.bytes_offset, std::size_t(h.rows) * h.columns * k_count) ||
        !inside(h.sums_offset, 4 * k_count * h.rows) ||
        !inside(h.cells_offset, cells * absorption_nodes * 2 * k_count) ||
        !inside(h.scales_offset, 4 * cells * absorption_nodes) || !inside(h.energies_offset, 8 * cells) ||
        !inside(h.text_offset, h.text_bytes))
        return fail(BakedStatus::out_of_bounds);
    // A unit times 2 K squares of at most 255^2, and the share of a cell: energies of at most 4.
    if (!detail::all_within(bytes + h.energies_offset, 2 * cells, 16.0f) ||
        !detail::all_within(bytes + h.scales_offset, cells * absorption_nodes, 4.0f))
        return fail(BakedStatus::bad_number);
    for (std::uint32_t k = 0; k < h.functions; ++k) {
        std::uint64_t whole = 0;
        for (std::uint32_t row = 0; row < h.rows; ++row) {
            std::uint32_t sum = 0;
            for (std::uint32_t column = 0; column < h.columns; ++column) {
                const std::uint32_t b = material.node(row, column)[k];
                sum += b * b;
            }
            if (sum != material.row_sum(k, row)) return fail(BakedStatus::bad_sum);
            whole += std::uint64_t(sum) * detail::row_area(row, h.rows);
        }
        if (whole == 0) return fail(BakedStatus::bad_sum);
        const double area = 0.25 * double(whole) * (pi / h.rows) * (2 * pi / h.columns);
        material.mass[k] = whole;
        material.area[k] = float(area);
        material.unit[k] = float(1 / area);
    }
    for (int j = 0; j < absorption_nodes; ++j) material.x[j] = detail::absorption_place(h, h.sigma[j]);
    for (int j = 0; j < absorption_nodes; ++j) {
        float product = material.x[j] - 1;
        for (int m = 0; m < absorption_nodes; ++m)
            if (m != j) product *= material.x[j] - material.x[m];
        material.inverse[j] = 1 / product;
    }
    return {material, BakedStatus::ok};
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
