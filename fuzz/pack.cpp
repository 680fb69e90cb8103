// libFuzzer: bytes -> open_pack -> everything that a renderer asks of a pack. The checksum is mended in half of the
// inputs (by their first byte), so that the checks behind it are reached.
#include <cstring>
#include <vector>

#include "medulla/medulla.hpp"

using namespace medulla;

namespace {

void ask(const PackView& pack) {
    volatile float keep = 0;
    for (const float sigma : {0.0f, 0.7f, 30.0f, -1.0f})
        for (const float other : {0.0f, 0.6f, -2.0f}) {
            keep = azimuthal(pack, sigma, other, other, 1.0f);
            for (const Side side : {Side::back, Side::forward})
                keep = longitudinal(pack, side, sigma, other, other, 0.3f);
            for (const TableView& table : pack.tables) {
                if (!table || !table.has_exit()) continue;
                LobeQuery query = {};
                query.sigma = sigma, query.g = other, query.h = other, query.theta_i = other;
                ExitDistribution distribution;
                distribute(table, contract(table, query), distribution);
                keep = distribution.pdf(0.2f);
                keep = distribution.sample(0.7f);
            }
        }
    (void)keep;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
    if (size == 0) return 0;
    std::vector<unsigned char> bytes(data + 1, data + size);
    if (data[0] % 2 == 1 && bytes.size() >= sizeof(PackHeader)) {
        const std::uint64_t count = bytes.size();
        std::memcpy(bytes.data() + offsetof(PackHeader, byte_count), &count, sizeof count);
        const std::uint64_t sum = pack_checksum(bytes.data(), bytes.size());
        std::memcpy(bytes.data() + offsetof(PackHeader, checksum), &sum, sizeof sum);
    }
    const OpenResult opened = open_pack(bytes.data(), bytes.size());
    if (opened.status == PackStatus::ok) ask(opened.pack);
    return 0;
}
