#include "tables/store/json_text.hpp"

namespace medulla::tables {
namespace {

/// Bytes of the UTF-8 character at the start of [first, last); 0 where there is none (RFC 3629).
std::size_t utf8_length(const unsigned char* first, const unsigned char* last) {
    const unsigned lead = *first;
    const std::size_t size = lead < 0x80   ? 1
                             : lead < 0xc2 ? 0
                             : lead < 0xe0 ? 2
                             : lead < 0xf0 ? 3
                             : lead < 0xf5 ? 4
                                           : 0;
    if (size < 2 || static_cast<std::size_t>(last - first) < size) return size < 2 ? size : 0;
    for (std::size_t i = 1; i < size; ++i)
        if ((first[i] & 0xc0) != 0x80) return 0;
    // Longer than need be, half of a surrogate pair, beyond the last character.
    const unsigned second = first[1];
    const bool wrong = (lead == 0xe0 && second < 0xa0) || (lead == 0xed && second >= 0xa0) ||
                       (lead == 0xf0 && second < 0x90) || (lead == 0xf4 && second >= 0x90);
    return wrong ? 0 : size;
}

}  // namespace

std::string json_name(const std::string& bytes) {
    std::string text;
    const auto* at = reinterpret_cast<const unsigned char*>(bytes.data());
    const auto* last = at + bytes.size();
    while (at < last) {
        const std::size_t size = utf8_length(at, last);
        if (size == 0) {
            text += fmt::format("\\x{:02x}", *at++);
            continue;
        }
        if (*at == '\\') text += '\\';
        text.append(reinterpret_cast<const char*>(at), size);
        at += size;
    }
    return text;
}

}  // namespace medulla::tables
