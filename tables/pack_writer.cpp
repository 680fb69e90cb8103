#include "tables/pack_writer.hpp"

#include <cmath>
#include <cstring>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

/// Bytes that grow; every part starts on a multiple of 16.
class Blob {
  public:
    template <class T>
    std::uint32_t append(const T* data, std::size_t count) {
        bytes_.resize((bytes_.size() + 15) / 16 * 16);
        const std::size_t offset = bytes_.size();
        bytes_.resize(offset + count * sizeof(T));
        if (count > 0) std::memcpy(bytes_.data() + offset, data, count * sizeof(T));
        return static_cast<std::uint32_t>(offset);
    }
    /// The same for what tables share: the knots of equal axes are written once.
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
               even = static_cast<std::uint32_t>(table.even_rank);
    if (even < 1 || even > rank) throw Error("pack: expected 1 to {} even components, found {}", rank, even);
    const std::uint32_t stride = padded_rank(even) + padded_rank(rank - even);
    if (stride > max_rank) throw Error("pack: expected at most {} components, found {}", max_rank, stride);
    // Where component r is stored: even ones from 0 on, odd ones from the next multiple on.
    const auto place = [&](Eigen::Index r) {
        return static_cast<std::uint32_t>(r < table.even_rank ? r : r - table.even_rank + padded_rank(even));
    };
    PackTable layout = {};
    layout.kind = static_cast<std::uint32_t>(table.kind);
    layout.even_rank = even;
    layout.odd_rank = rank - even;
    layout.rank_stride = stride;
    layout.axis_count = static_cast<std::uint32_t>(table.axes.size());
    layout.low = table.low;
    layout.high = table.high;
    Eigen::VectorXd scales = table.weights;
    Eigen::VectorXd integrals = Eigen::VectorXd::Zero(rank);
    for (std::size_t k = 0; k < table.axes.size(); ++k) {
        const PackedAxis& axis = table.axes[k];
        const Eigen::MatrixXd& rows = axis.coefficients;
        std::vector<unsigned char> stored(static_cast<std::size_t>(rows.rows()) * row_bytes(stride), 0);
        const bool exit = table.has_exit() && k + 1 == table.axes.size();
        const Eigen::VectorXd basis_integrals = axis.spline.integrals();
        for (Eigen::Index r = 0; r < rank; ++r) {
            const double greatest = rows.col(r).cwiseAbs().maxCoeff();
            const double unit = greatest / greatest_number;
            scales[r] *= unit;
            for (Eigen::Index i = 0; i < rows.rows(); ++i) {
                const double q = greatest > 0 ? std::nearbyint(rows(i, r) / unit) : 0;
                store_number(stored.data() + static_cast<std::size_t>(i) * row_bytes(stride), place(r),
                             static_cast<int>(q));
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
    const auto floats = [&](const Eigen::VectorXd& values) {
        std::vector<float> padded(stride, 0.0f);
        for (Eigen::Index r = 0; r < rank; ++r) padded[place(r)] = static_cast<float>(values[r]);
        return blob.append(padded.data(), padded.size());
    };
    layout.scales_offset = floats(scales);
    if (table.has_exit()) layout.integrals_offset = floats(integrals);
    return layout;
}

}  // namespace

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
