#include "tables/pack/rounding.hpp"

#include <cmath>

namespace medulla::tables {
namespace {

/// Squared error of the components in block `i`, in units of the squared rounding unit.
double block_rounding(const PackedTable& table, std::uint32_t i) {
    double sum = 0;
    for (Eigen::Index r = 0; r < table.rounding.size(); ++r)
        if (table.place(r) / rank_multiple == i) sum += table.rounding[r];
    return sum;
}

double squared_unit(std::uint32_t bits) { return std::pow(greatest_of(bits), -2); }

/// A block, or a pair of blocks, that is widened as one.
struct Unit {
    PackedTable* table;
    std::uint32_t first, second;  ///< equal without a pair
    double rounding;
    std::size_t step;  ///< bytes that four more bits take

    std::uint32_t& bits() const { return table->bits[first]; }
    double error() const { return rounding * squared_unit(bits()); }
    double gain() const { return error() - rounding * squared_unit(bits() + 4); }
};

}  // namespace

double rounding_error(const PackedTable& table) {
    double sum = 0;
    for (std::uint32_t i = 0; i < table.stride() / rank_multiple; ++i)
        sum += block_rounding(table, i) * squared_unit(table.bits.empty() ? 16 : table.bits[i]);
    return sum;
}

double mean_bits(const std::vector<const PackedTable*>& tables) {
    double bits = 0, numbers = 0;
    for (const PackedTable* table : tables) {
        const auto rows = static_cast<double>(table->rows());
        for (const std::uint32_t b : table->bits) bits += rows * b, numbers += rows;
    }
    return bits / numbers;
}

void set_bits(const std::vector<PackedTable*>& tables, double error, std::size_t bytes) {
    std::vector<Unit> units;
    double sum = 0;
    for (PackedTable* table : tables) {
        const std::uint32_t blocks = table->stride() / rank_multiple;
        table->bits.assign(blocks, 4);
        for (std::uint32_t i = 0; i < (table->paired ? blocks / 2 : blocks); ++i) {
            const std::uint32_t second = table->paired ? i + blocks / 2 : i;
            const double rounding = block_rounding(*table, i) + (second != i ? block_rounding(*table, second) : 0);
            units.push_back({table, i, second, rounding, 4 * table->rows() * (second != i ? 2 : 1)});
            sum += units.back().error();
        }
    }
    while (sum > error) {
        const Unit* best = nullptr;
        for (const Unit& unit : units)
            if (unit.bits() < 16 && unit.step <= bytes &&
                (best == nullptr || unit.gain() * double(best->step) > best->gain() * double(unit.step)))
                best = &unit;
        if (best == nullptr || !(best->gain() > 0)) return;
        sum -= best->gain(), bytes -= best->step;
        best->table->bits[best->second] = best->bits() += 4;
    }
}

}  // namespace medulla::tables
