// Numbers that a pack must not have, bit by bit: every compiler and every option refuses them, -ffast-math included.
// Prints each one that was not refused, and "refused" when all were; where the pack itself is refused, why.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>

#include "medulla/medulla.hpp"

using namespace medulla;

static std::vector<unsigned char> pack;
static int accepted = 0;

static std::uint32_t word_at(std::size_t offset) {
    std::uint32_t word;
    std::memcpy(&word, pack.data() + offset, sizeof word);
    return word;
}

/// Checks that the pack with one word replaced and a corrected checksum is refused for the given reason.
static void refuse(const char* what, std::size_t offset, std::uint32_t word, PackStatus reason) {
    std::vector<unsigned char> bytes = pack;
    std::memcpy(bytes.data() + offset, &word, sizeof word);
    const std::uint64_t sum = pack_checksum(bytes.data(), bytes.size());
    std::memcpy(bytes.data() + offsetof(PackHeader, checksum), &sum, sizeof sum);
    const PackStatus status = open_pack(bytes.data(), bytes.size()).status;
    if (status == reason) return;
    ++accepted;
    std::printf("%s = %08x: %s\n", what, unsigned(word), describe(status));
}

int main() {
    const auto* built_in = reinterpret_cast<const unsigned char*>(default_pack_words);
    pack.assign(built_in, built_in + default_pack_size);
    if (const PackStatus status = open_pack(pack.data(), pack.size()).status; status != PackStatus::ok) {
        std::printf("%s\n", describe(status));
        return 1;
    }
    const std::uint32_t quiet_nan = 0x7fc00000u, signalling_nan = 0x7f800001u, infinity = 0x7f800000u, minus = 1u << 31;
    const std::size_t tables = word_at(offsetof(PackHeader, tables_offset));
    for (std::uint32_t i = 0; i < word_at(offsetof(PackHeader, table_count)); ++i) {
        const std::size_t table = tables + i * sizeof(PackTable);
        for (const std::uint32_t bad : {quiet_nan, signalling_nan, infinity, quiet_nan | minus, infinity | minus}) {
            refuse("low", table + offsetof(PackTable, low), bad, PackStatus::bad_number);
            refuse("high", table + offsetof(PackTable, high), bad, PackStatus::bad_number);
            refuse("a scale", word_at(table + offsetof(PackTable, scales_offset)) + 4, bad, PackStatus::bad_number);
            if (const std::uint32_t integrals = word_at(table + offsetof(PackTable, integrals_offset)))
                refuse("an integral", integrals + 4, bad, PackStatus::bad_number);
            for (std::uint32_t k = 0; k < word_at(table + offsetof(PackTable, axis_count)); ++k) {
                const std::size_t axis = table + offsetof(PackTable, axes) + k * sizeof(PackAxis);
                const std::size_t knots = word_at(axis + offsetof(PackAxis, knots_offset));
                const std::uint32_t count = word_at(axis + offsetof(PackAxis, spans)) + 1 + 2 * ghost_knots;
                for (std::size_t number = 0; number < 4; ++number)
                    for (const std::size_t knot : {std::size_t(0), std::size_t(count / 2), std::size_t(count - 1)})
                        refuse("a knot", knots + knot * sizeof(Knot<float>) + 4 * number, bad, PackStatus::bad_knots);
            }
        }
        for (std::size_t k = 0; k < max_axes; ++k)
            refuse("an axis's reserved word",
                   table + offsetof(PackTable, axes) + k * sizeof(PackAxis) + offsetof(PackAxis, reserved) + 8,
                   quiet_nan, PackStatus::bad_reserved);
    }
    for (std::size_t i = 0; i < 5; ++i)
        refuse("the header's reserved word", offsetof(PackHeader, reserved) + 4 * i, 1, PackStatus::bad_reserved);
    if (accepted == 0) std::printf("refused\n");
    return accepted == 0 ? 0 : 1;
}
