// libFuzzer: bytes -> open_pack -> everything that a renderer does with a pack, all finite. The checksum is corrected
// in half of the inputs (by their first byte), so that the checks behind it are reached.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "medulla/medulla.hpp"
#include "tests/support/exercise_pack.hpp"

using namespace medulla;

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
    if (opened.status != PackStatus::ok) return 0;
    if (const std::string wrong = testing::exercise(opened.pack); !wrong.empty()) {
        std::fprintf(stderr, "not finite, or below 0: %s\n", wrong.c_str());
        std::abort();
    }
    return 0;
}
