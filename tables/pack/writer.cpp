#include "tables/pack/writer.hpp"

#include <cmath>
#include <cstring>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

/// A growing array of bytes; every appended array starts at a multiple of 4.
class Blob {
  public:
    template <class T>
    std::uint32_t append(const T* data, std::size_t count) {
        bytes_.resize((bytes_.size() + 3) / 4 * 4);
        const std::size_t offset = bytes_.size();
        bytes_.resize(offset + count * sizeof(T));
        if (count > 0) std::memcpy(bytes_.data() + offset, data, count * sizeof(T));
        return static_cast<std::uint32_t>(offset);
    }
    /// Appends knots, or finds equal ones: tables share the knots of equal axes.
    std::uint32_t append_knots(const std::vector<Knot<float>>& knots) {
        const std::size_t size = knots.size() * sizeof knots[0];
        for (const auto& [offset, length] : knots_)
            if (length == size && std::memcmp(bytes_.data() + offset, knots.data(), size) == 0) return offset;
        knots_.emplace_back(append(knots.data(), knots.size()), size);
        return knots_.back().first;
    }
    template <class T>
    void put(std::size_t offset, const T& value) {
        std::memcpy(bytes_.data() + offset, &value, sizeof value);
    }
    std::vector<unsigned char>& bytes() { return bytes_; }

  private:
    std::vector<unsigned char> bytes_;
    std::vector<std::pair<std::uint32_t, std::size_t>> knots_;  ///< offset and bytes
};

PackTable write_table(Blob& blob, const PackedTable& table) {
    const auto rank = static_cast<std::uint32_t>(table.weights.size()),
               even = static_cast<std::uint32_t>(table.even_rank), stride = table.stride();
    if (even < 1 || even > rank) throw Error("pack: expected 1 to {} even components, found {}", rank, even);
    if (stride > max_rank) throw Error("pack: expected at most {} components, found {}", max_rank, stride);
    PackTable layout = {};
    layout.kind = static_cast<std::uint32_t>(table.kind);
    layout.even_rank = even;
    layout.odd_rank = rank - even;
    layout.rank_stride = stride;
    layout.axis_count = static_cast<std::uint32_t>(table.axes.size());
    layout.low = table.low;
    layout.high = table.high;
    std::vector<std::size_t> starts;  // of a row's blocks
    for (std::size_t i = 0; i < stride / rank_multiple; ++i) {
        const std::uint32_t bits = table.bits.empty() ? 16 : table.bits[i];
        starts.push_back(layout.row_bytes);
        layout.block_bits[i] = static_cast<std::uint8_t>(bits);
        layout.row_bytes += bits;
    }
    Eigen::VectorXd scales = table.weights;
    Eigen::VectorXd integrals = Eigen::VectorXd::Zero(rank);
    for (std::size_t k = 0; k < table.axes.size(); ++k) {
        const PackedAxis& axis = table.axes[k];
        const Eigen::MatrixXd& rows = axis.coefficients;
        std::vector<unsigned char> stored(static_cast<std::size_t>(rows.rows()) * layout.row_bytes, 0);
        const bool exit = table.has_exit() && k + 1 == table.axes.size();
        const Eigen::VectorXd basis_integrals = axis.spline.integrals();
        for (Eigen::Index r = 0; r < rank; ++r) {
            const std::uint32_t place = table.place(r), bits = layout.block_bits[place / rank_multiple];
            const double greatest = rows.col(r).cwiseAbs().maxCoeff(), unit = greatest / greatest_of(bits);
            const int step = 1 << (16 - bits);
            scales[r] *= unit / step;
            for (Eigen::Index i = 0; i < rows.rows(); ++i) {
                const double q = greatest > 0 ? std::nearbyint(rows(i, r) / unit) * step : 0;
                store_number(
                    stored.data() + static_cast<std::size_t>(i) * layout.row_bytes + starts[place / rank_multiple],
                    bits, place % rank_multiple, static_cast<int>(q));
                if (exit && r < table.even_rank) integrals[r] += 2 * q * basis_integrals[i];
            }
        }
        const std::vector<Knot<float>> knots = axis.spline.float_knots();
        PackAxis& out = layout.axes[k];
        out.quantity = static_cast<std::uint32_t>(axis.quantity);
        out.nodes = axis.nodes;
        out.spans = axis.spline.spans();
        out.knots_offset = blob.append_knots(knots);
        out.rows_offset = blob.append(stored.data(), stored.size());
    }
    const auto floats = [&](const Eigen::VectorXd& values, std::uint32_t count) {
        std::vector<float> padded(stride, 0.0f);
        for (Eigen::Index r = 0; r < rank; ++r) padded[table.place(r)] = static_cast<float>(values[r]);
        return blob.append(padded.data(), count);
    };
    layout.scales_offset = floats(scales, stride);
    if (table.has_exit()) layout.integrals_offset = floats(integrals, table.even_stride());
    return layout;
}

}  // namespace

std::size_t PackedTable::rows() const {
    std::size_t sum = 0;
    for (const PackedAxis& axis : axes) sum += static_cast<std::size_t>(axis.spline.size());
    return sum;
}

std::vector<unsigned char> write_pack(const std::vector<PackedTable>& tables, const std::string& provenance) {
    Blob blob;
    PackHeader header = {};
    blob.append(&header, 1);
    std::vector<PackTable> layouts;
    for (const PackedTable& table : tables) layouts.push_back(write_table(blob, table));
    std::memcpy(header.magic, pack_magic, sizeof header.magic);
    header.version = pack_version;
    header.table_count = static_cast<std::uint32_t>(layouts.size());
    header.tables_offset = blob.append(layouts.data(), layouts.size());
    header.text_bytes = static_cast<std::uint32_t>(provenance.size());
    header.text_offset = blob.append(provenance.data(), provenance.size());
    header.byte_count = blob.bytes().size();
    blob.put(0, header);
    header.checksum = pack_checksum(blob.bytes().data(), blob.bytes().size());
    blob.put(0, header);
    const OpenResult opened = open_pack(blob.bytes().data(), blob.bytes().size());
    if (opened.status != PackStatus::ok) throw Error("pack: written bytes do not open: {}", describe(opened.status));
    return std::move(blob.bytes());
}

}  // namespace medulla::tables
