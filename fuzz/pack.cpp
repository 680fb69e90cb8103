// libFuzzer: bytes -> open_pack -> everything that a renderer asks of a pack, all of it finite. The checksum is mended
// in half of the inputs (by their first byte), so that the checks behind it are reached.
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "medulla/medulla.hpp"

using namespace medulla;

namespace {

void ask(const PackView& pack) {
    for (const float sigma : {0.0f, 0.7f, 30.0f, -1.0f})
        for (const float other : {0.0f, 0.6f, -2.0f}) {
            const auto see = [&](float value) {  // sigma < 0 and h < -1 have no answer: roots of them are taken
                if (!std::isfinite(value) && sigma >= 0 && other >= 0) std::abort();
            };
            for (const TableView& table : pack.tables) {
                if (!table || !table.has_exit()) continue;
                const auto kind = static_cast<TableKind>(table.layout.kind);
                if (kind == TableKind::azimuthal) see(azimuthal(pack, sigma, other, other, 1.0f));
                if (kind == TableKind::longitudinal_back)
                    see(longitudinal(pack, Side::back, sigma, other, other, 0.3f));
                if (kind == TableKind::longitudinal_forward)
                    see(longitudinal(pack, Side::forward, sigma, other, other, 0.3f));
                LobeQuery query = {};
                query.sigma = sigma, query.g = other, query.h = other, query.theta_i = other;
                ExitDistribution distribution;
                distribute(table, contract(table, query), distribution);
                see(distribution.pdf(0.2f));
                see(distribution.sample(0.7f));
            }
        }
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
