// The pack (.furpack): one flat little-endian blob of low-rank tables, used where it lies. docs/formats.md.
// A format is a struct: layout, validator, and views that borrow the bytes; nothing is copied or allocated.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "medulla/axis.hpp"
#include "medulla/config.hpp"
#include "medulla/detail/math.hpp"

namespace medulla {
inline namespace MEDULLA_TARGET {

inline constexpr char pack_magic[8] = {'F', 'U', 'R', 'P', 'A', 'C', 'K', '\n'};
inline constexpr std::uint32_t pack_version = 4;
inline constexpr std::uint32_t max_rank = 512;
inline constexpr std::uint32_t max_axes = 6;
inline constexpr std::uint32_t max_spans = 4096;
/// Sum over components of |scale| times the greatest number in every axis: what a value can reach. Over the least
/// integral that lookup.hpp divides by, 1e-30, that is a finite float: no pack makes an infinity or a NaN. The pack
/// built in reaches 1540.
inline constexpr float most_reach = 1e7f;
/// Neighbouring knots are at least this far apart, and none is further from 0 than most_knot: then every difference of
/// knots, its reciprocal and 64 over an axis's length are normal floats, which compilers and processors
/// that flush denormals or assume finite numbers treat alike. Square roots of sigma are 2^-75 to 2^64.
inline constexpr float least_span = 0x1p-100f, most_knot = 0x1p100f;
inline constexpr std::uint32_t rank_multiple = 8;  ///< rows are padded with zeros to a multiple of this rank

MEDULLA_FN constexpr std::uint32_t padded_rank(std::uint32_t rank) noexcept {
    return (rank + rank_multiple - 1) / rank_multiple * rank_multiple;
}

/// Factors are whole numbers of 16 bits, -32767 .. 32767. Eight components side by side are a block, of whose numbers a
/// row keeps the upper 4, 8, 12 or 16 bits; the others are 0. A block of b bits takes b bytes: the upper eight bits of
/// each number, then the next four, two to a byte (the even component's in the lower half), or eight. Of four bits
/// there are only those, two to a byte.
inline constexpr int greatest_number = 32767;
inline constexpr std::uint32_t max_blocks = max_rank / rank_multiple;
MEDULLA_FN constexpr bool is_width(std::uint32_t bits) noexcept {
    return bits == 4 || bits == 8 || bits == 12 || bits == 16;
}

/// Number r of a block, 0 <= r < 8.
MEDULLA_FN int load_number(const unsigned char* block, std::uint32_t bits, std::uint32_t r) noexcept {
    const auto half = [r](const unsigned char* halves) { return halves[r / 2] >> (r % 2 * 4) & 15; };
    const int upper = bits == 4 ? half(block) * 16 : block[r];
    const int lower = bits == 12 ? half(block + 8) * 16 : (bits == 16 ? block[8 + r] : 0);
    return (upper < 128 ? upper : upper - 256) * 256 + lower;
}

/// Sets number r of a block whose number was 0.
inline void store_number(unsigned char* block, std::uint32_t bits, std::uint32_t r, int number) noexcept {
    const auto word = static_cast<unsigned>(number);
    const auto put_half = [r](unsigned char* halves, unsigned half) {
        halves[r / 2] |= static_cast<unsigned char>((half & 15u) << (r % 2 * 4));
    };
    if (bits == 4) return put_half(block, word >> 12);
    block[r] = static_cast<unsigned char>(word >> 8 & 255u);
    if (bits == 12) put_half(block + 8, word >> 4);
    if (bits == 16) block[8 + r] = static_cast<unsigned char>(word & 255u);
}

/// The tables a pack can hold. The numbers are part of the format.
enum class TableKind : std::uint32_t {
    azimuthal = 0,             ///< C^N / E, axes (sigma, g, [absorption,] h, phi)
    longitudinal_back = 1,     ///< C^M of the backward side, axes (sigma, g, theta_i, theta_r)
    longitudinal_forward = 2,  ///< C^M of the forward side, the same axes
    back_fraction = 3,         ///< share of the slab's scattered energy that leaves backward, axes (sigma, g, theta_i)
    survival =
        4,  ///< length l: exp(-absorption l) of the disc's scattered light is left, axes (sigma, g, absorption, h)
};
inline constexpr std::uint32_t table_kinds = 5;

/// Whether a table has an exit axis: lobes do.
MEDULLA_FN constexpr bool is_lobe(TableKind kind) noexcept { return kind <= TableKind::longitudinal_forward; }

struct PackHeader {
    char magic[8];
    std::uint32_t version;
    std::uint32_t table_count;
    std::uint64_t byte_count;     ///< of the whole pack
    std::uint64_t checksum;       ///< pack_checksum of the whole pack with this field as 0
    std::uint32_t tables_offset;  ///< of PackTable[table_count]; every offset is from the pack's first byte
    std::uint32_t text_offset;    ///< provenance: JSON text, not terminated
    std::uint32_t text_bytes;
    std::uint32_t reserved[5];  ///< 0
};
static_assert(sizeof(PackHeader) == 64 && offsetof(PackHeader, checksum) == 24);

struct PackAxis {
    std::uint32_t quantity;      ///< a Quantity
    std::uint32_t nodes;         ///< nodes (or bins) of the table it was made from, for information
    std::uint32_t spans;         ///< of the spline
    std::uint32_t knots_offset;  ///< Knot<float>[spans + 5]
    std::uint32_t rows_offset;   ///< spans + 3 rows of blocks: spline coefficients, one row for each
    std::uint32_t reserved[3];   ///< 0
};
static_assert(sizeof(PackAxis) == 32);

struct PackTable {
    std::uint32_t kind;           ///< a TableKind, each at most once
    std::uint32_t even_rank;      ///< components that are their own mirror image in the exit direction, >= 1
    std::uint32_t odd_rank;       ///< components that change sign there; 0 without an exit axis
    std::uint32_t rank_stride;    ///< each of the two rounded up to rank_multiple, and added: 8 .. max_rank
    std::uint32_t axis_count;     ///< 1 .. max_axes; the last one is the exit direction, where there is one
    std::uint32_t scales_offset;  ///< float[rank_stride]: weight of one unit in every axis
    std::uint32_t
        integrals_offset;     ///< float[even_rank, padded]: integral of a component's exit spline; 0: no exit axis
    float low, high;          ///< least and greatest value of the table it was made from
    std::uint32_t row_bytes;  ///< of a row, on every axis: the sum of block_bits
    std::uint8_t block_bits[max_blocks];  ///< 4, 8, 12 or 16 for each block there is, then 0
    PackAxis axes[max_axes];
};
static_assert(sizeof(PackTable) == 296 && offsetof(PackTable, axes) == 104);

/// 64-bit FNV-1a with the header's checksum field read as zeros. Any change of one byte changes it.
MEDULLA_FN std::uint64_t pack_checksum(const unsigned char* bytes, std::size_t count) noexcept {
    std::uint64_t hash = 0xcbf29ce484222325u;
    const std::size_t field = offsetof(PackHeader, checksum);
    for (std::size_t i = 0; i < count; ++i) {
        const bool skipped = i >= field && i < field + sizeof(std::uint64_t);
        hash = (hash ^ (skipped ? 0u : bytes[i])) * 0x100000001b3u;
    }
    return hash;
}

/// One low-rank table where it lies in the pack.
struct TableView {
    const unsigned char* bytes = nullptr;  ///< of the pack; null: the pack has no such table
    PackTable layout = {};

    MEDULLA_FN explicit operator bool() const noexcept { return bytes != nullptr; }
    MEDULLA_FN AxisView<float> axis(std::uint32_t k) const noexcept {
        return {bytes + layout.axes[k].knots_offset, layout.axes[k].spans};
    }
    /// Components [0, even_stride) are mirror-even, [even_stride, rank_stride) mirror-odd.
    MEDULLA_FN std::uint32_t even_stride() const noexcept { return padded_rank(layout.even_rank); }
    /// Row `row_index` of axis k: its blocks, one after the other.
    MEDULLA_FN const unsigned char* row(std::uint32_t k, std::uint32_t row_index) const noexcept {
        return bytes + layout.axes[k].rows_offset + std::size_t(row_index) * layout.row_bytes;
    }
    /// Of the block that begins with component `first`.
    MEDULLA_FN std::uint32_t bits(std::uint32_t first) const noexcept {
        return layout.block_bits[first / rank_multiple];
    }
    /// One number of a row: the reference implementation of lookup.hpp's blocks.
    MEDULLA_FN int number(std::uint32_t k, std::uint32_t row_index, std::uint32_t r) const noexcept {
        const unsigned char* block = row(k, row_index);
        for (std::uint32_t first = 0; first + rank_multiple <= r; first += rank_multiple) block += bits(first);
        return load_number(block, bits(r), r % rank_multiple);
    }
    MEDULLA_FN bool has_exit() const noexcept { return layout.integrals_offset != 0; }
    MEDULLA_FN std::uint32_t parameter_axes() const noexcept { return layout.axis_count - (has_exit() ? 1u : 0u); }
};

/// A validated pack. It borrows the bytes it was opened on.
struct PackView {
    TableView tables[table_kinds];
    const char* text = nullptr;  ///< provenance, JSON
    std::uint32_t text_bytes = 0;

    MEDULLA_FN const TableView& operator[](TableKind kind) const noexcept {
        return tables[static_cast<std::uint32_t>(kind)];
    }
};

enum class PackStatus {
    ok,
    null_pointer,
    too_short,
    not_a_pack,
    other_version,
    wrong_size,
    wrong_checksum,
    bad_table,
    bad_axis,
    bad_knots,
    bad_number,
    bad_reserved,
    out_of_bounds,
    big_endian,
};

inline const char* describe(PackStatus status) noexcept {
    switch (status) {
        case PackStatus::ok:
            return "ok";
        case PackStatus::null_pointer:
            return "no bytes";
        case PackStatus::too_short:
            return "shorter than a pack's header";
        case PackStatus::not_a_pack:
            return "does not begin with FURPACK";
        case PackStatus::other_version:
            return "a pack of another format version";
        case PackStatus::wrong_size:
            return "its size is not the byte count in its header";
        case PackStatus::wrong_checksum:
            return "its checksum does not match";
        case PackStatus::bad_table:
            return "a table's kind, rank, bits or number of axes is outside the format";
        case PackStatus::bad_axis:
            return "a table's axes are not those of its kind";
        case PackStatus::bad_knots:
            return "an axis's knots do not increase, lie too close together or too far apart, or do not span its range";
        case PackStatus::bad_number:
            return "a scale or integral is not finite, or larger than that of any density";
        case PackStatus::bad_reserved:
            return "a field that this format version leaves at 0 is not 0";
        case PackStatus::out_of_bounds:
            return "an offset points outside the pack";
        case PackStatus::big_endian:
            return "packs are little-endian; this machine is not";
    }
    return "unknown status";
}

struct OpenResult {
    PackView pack;
    PackStatus status;
};

namespace detail {

template <class T>
MEDULLA_FN T load(const unsigned char* bytes) noexcept {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

/// Whether the `count` floats there are neither infinite nor NaN, by their bits: with -ffast-math a compiler may take
/// every float for finite, those passed to or returned by a function included, and leave out the test.
MEDULLA_FN bool finite(const void* floats, std::uint32_t count) noexcept {
    for (std::uint32_t i = 0; i < count; ++i)
        if ((load<std::uint32_t>(static_cast<const unsigned char*>(floats) + 4 * i) & 0x7f800000u) == 0x7f800000u)
            return false;
    return true;
}

/// Whether the words there are all 0.
MEDULLA_FN bool zeros(const std::uint32_t* words, std::uint32_t count) noexcept {
    for (std::uint32_t i = 0; i < count; ++i)
        if (words[i] != 0) return false;
    return true;
}

MEDULLA_FN bool little_endian() noexcept {
    const std::uint32_t one = 1;
    return *reinterpret_cast<const unsigned char*>(&one) == 1;
}

MEDULLA_FN bool inside(std::uint64_t offset, std::uint64_t bytes, std::uint64_t total) noexcept {
    return offset >= sizeof(PackHeader) && offset <= total && bytes <= total - offset;
}

/// Axes of a kind in their order; absorption may follow g in the azimuthal table, and does in that of survival.
MEDULLA_FN bool axes_fit(const PackTable& table) noexcept {
    const auto kind = static_cast<TableKind>(table.kind);
    Quantity expected[max_axes] = {Quantity::sigma, Quantity::g};
    std::uint32_t n = 2;
    if (kind == TableKind::azimuthal) {
        if (table.axis_count == 5) expected[n++] = Quantity::absorption;
        expected[n++] = Quantity::h;
        expected[n++] = Quantity::phi;
    } else if (kind == TableKind::survival) {
        expected[n++] = Quantity::absorption;
        expected[n++] = Quantity::h;
    } else {
        expected[n++] = Quantity::theta_i;
        if (is_lobe(kind)) expected[n++] = Quantity::theta_r;
    }
    if (table.axis_count != n) return false;
    for (std::uint32_t k = 0; k < n; ++k) {
        if (table.axes[k].quantity != static_cast<std::uint32_t>(expected[k])) return false;
        if (table.axes[k].spans < 1 || table.axes[k].spans > max_spans) return false;
    }
    return (table.integrals_offset != 0) == is_lobe(kind);
}

MEDULLA_FN PackStatus check_knots(const AxisView<float>& axis) noexcept {
    if (!finite(axis.knots, std::uint32_t(sizeof(Knot<float>) / 4) * (axis.spans + 1 + 2 * ghost_knots)))
        return PackStatus::bad_knots;
    const auto last = std::int32_t(axis.spans + ghost_knots);
    for (std::int32_t i = -std::int32_t(ghost_knots); i <= last; ++i) {
        const Knot<float> k = axis.knot(i);
        if (!(detail::math::abs(k.t) <= most_knot)) return PackStatus::bad_knots;
        if (i < last && !(axis.knot(i + 1).t - k.t >= least_span)) return PackStatus::bad_knots;
        // The reciprocals are stored, so they are checked: 1e-4 covers the rounding of differences of close knots.
        const float inverse[3] = {k.inverse1, k.inverse2, k.inverse3};
        for (std::int32_t step = 1; step <= 3 && i + step <= last; ++step) {
            const float product = inverse[step - 1] * (axis.knot(i + step).t - k.t);
            if (!(product > 0.9999f && product < 1.0001f)) return PackStatus::bad_knots;
        }
    }
    return PackStatus::ok;
}

/// Exit axes run from 0 to the end of the half that is stored.
MEDULLA_FN bool half_circle(const AxisView<float>& axis, Quantity quantity) noexcept {
    if (quantity != Quantity::phi && quantity != Quantity::theta_r) return true;
    const float end = quantity == Quantity::phi ? float(pi) : float(pi / 2);
    return !(axis.lower() < 0 || axis.lower() > 0) && detail::math::abs(axis.upper() - end) < 1e-6f * end;
}

MEDULLA_FN PackStatus check_table(const TableView& view, std::uint64_t total) noexcept {
    const PackTable& table = view.layout;
    if (table.kind >= table_kinds || table.even_rank < 1 || table.even_rank > max_rank || table.odd_rank > max_rank)
        return PackStatus::bad_table;
    if (table.rank_stride != padded_rank(table.even_rank) + padded_rank(table.odd_rank) || table.rank_stride > max_rank)
        return PackStatus::bad_table;
    if (!view.has_exit() && table.odd_rank != 0) return PackStatus::bad_table;
    std::uint32_t row_bytes = 0;
    for (std::uint32_t i = 0; i < max_blocks; ++i) {
        const std::uint32_t bits = table.block_bits[i];
        if (i < table.rank_stride / rank_multiple ? !is_width(bits) : bits != 0) return PackStatus::bad_table;
        row_bytes += bits;
    }
    if (table.row_bytes != row_bytes) return PackStatus::bad_table;
    if (table.axis_count < 1 || table.axis_count > max_axes) return PackStatus::bad_table;
    if (!axes_fit(table)) return PackStatus::bad_axis;
    if (!finite(&table.low, 1) || !finite(&table.high, 1)) return PackStatus::bad_number;
    for (std::uint32_t k = 0; k < max_axes; ++k)
        if (!zeros(table.axes[k].reserved, 3)) return PackStatus::bad_reserved;
    for (std::uint32_t k = 0; k < table.axis_count; ++k) {
        const PackAxis& axis = table.axes[k];
        const std::uint64_t knot_bytes = std::uint64_t(axis.spans + 1 + 2 * ghost_knots) * sizeof(Knot<float>);
        const std::uint64_t rows = std::uint64_t(axis.spans + 3) * table.row_bytes;
        if (!inside(axis.knots_offset, knot_bytes, total)) return PackStatus::out_of_bounds;
        if (!inside(axis.rows_offset, rows, total)) return PackStatus::out_of_bounds;
        const PackStatus status = check_knots(view.axis(k));
        if (status != PackStatus::ok) return status;
        const auto quantity = static_cast<Quantity>(axis.quantity);
        if (!half_circle(view.axis(k), quantity)) return PackStatus::bad_knots;
    }
    // Odd components have no integral.
    const std::uint32_t integrals = view.has_exit() ? view.even_stride() : 0;
    if (!inside(table.scales_offset, std::uint64_t(table.rank_stride) * 4, total) ||
        (view.has_exit() && !inside(table.integrals_offset, std::uint64_t(integrals) * 4, total)))
        return PackStatus::out_of_bounds;
    const unsigned char *scale = view.bytes + table.scales_offset, *integral = view.bytes + table.integrals_offset;
    if (!finite(scale, table.rank_stride) || !finite(integral, integrals)) return PackStatus::bad_number;
    double reach = 0;  // double: 512 floats times 32767^6 are finite
    for (std::uint32_t r = 0; r < table.rank_stride; ++r)
        reach += detail::math::abs(double(load<float>(scale + 4 * r)));
    for (std::uint32_t k = 0; k < table.axis_count; ++k) reach *= greatest_number;
    if (!(reach <= double(most_reach))) return PackStatus::bad_number;
    // Both halves of the axis, of coefficients of at most greatest_number each; 1e-5 is the rounding of knots.
    const AxisView<float> exit = view.axis(view.parameter_axes());
    const double most = integrals > 0 ? 2 * greatest_number * double(exit.upper()) * (1 + 1e-5) : 0;
    for (std::uint32_t r = 0; r < integrals; ++r)
        if (!(detail::math::abs(double(load<float>(integral + 4 * r))) <= most)) return PackStatus::bad_number;
    return PackStatus::ok;
}

}  // namespace detail

/// The tables of an open pack in a copy of its bytes that lies elsewhere, in a GPU's memory for one.
inline PackView view_of_copy(const PackView& pack, const void* copy) noexcept {
    PackView moved = pack;
    moved.text = nullptr;
    moved.text_bytes = 0;
    for (TableView& table : moved.tables)
        if (table) table.bytes = static_cast<const unsigned char*>(copy);
    return moved;
}

/// Checks every size, offset, axis, knot and number of a pack before anything is used, and gives views into it.
/// Bytes need no alignment and must outlive the view. Takes about 1 ns per byte.
inline OpenResult open_pack(const void* data, std::size_t size) noexcept {
    OpenResult result = {PackView{}, PackStatus::null_pointer};
    const auto fail = [&](PackStatus status) { return OpenResult{PackView{}, status}; };
    if (data == nullptr) return result;
    const auto* bytes = static_cast<const unsigned char*>(data);
    if (!detail::little_endian()) return fail(PackStatus::big_endian);
    if (size < sizeof(PackHeader)) return fail(PackStatus::too_short);
    const auto header = detail::load<PackHeader>(bytes);
    if (std::memcmp(header.magic, pack_magic, sizeof pack_magic) != 0) return fail(PackStatus::not_a_pack);
    if (header.version != pack_version) return fail(PackStatus::other_version);
    if (header.byte_count != size) return fail(PackStatus::wrong_size);
    if (header.checksum != pack_checksum(bytes, size)) return fail(PackStatus::wrong_checksum);
    if (!detail::zeros(header.reserved, 5)) return fail(PackStatus::bad_reserved);
    if (header.table_count > table_kinds) return fail(PackStatus::bad_table);
    if (!detail::inside(header.tables_offset, std::uint64_t(header.table_count) * sizeof(PackTable), size) ||
        !detail::inside(header.text_offset, header.text_bytes, size))
        return fail(PackStatus::out_of_bounds);
    for (std::uint32_t i = 0; i < header.table_count; ++i) {
        TableView view;
        view.bytes = bytes;
        view.layout = detail::load<PackTable>(bytes + header.tables_offset + i * sizeof(PackTable));
        const PackStatus status = detail::check_table(view, size);
        if (status != PackStatus::ok) return fail(status);
        if (result.pack.tables[view.layout.kind]) return fail(PackStatus::bad_table);
        result.pack.tables[view.layout.kind] = view;
    }
    result.pack.text = reinterpret_cast<const char*>(bytes + header.text_offset);
    result.pack.text_bytes = header.text_bytes;
    result.status = PackStatus::ok;
    return result;
}

}  // namespace MEDULLA_TARGET
}  // namespace medulla
