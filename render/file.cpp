#include "render/file.hpp"

#include <cerrno>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "render/error.hpp"

namespace medulla::render {

std::string read_file(const std::string& path, std::uint64_t most) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw Error("{}: cannot be read: {}", path, std::strerror(errno));
    std::string text;
    std::string block(1 << 16, '\0');
    while (file.read(block.data(), std::streamsize(block.size())), file.gcount() > 0) {
        text.append(block, 0, std::size_t(file.gcount()));
        if (text.size() > most) throw Error("{}: expected at most {} MiB", path, most >> 20);
    }
    if (file.bad()) throw Error("{}: cannot be read: {}", path, std::strerror(errno));
    return text;
}

std::string path_beside(const std::string& beside, const std::string& name) {
    return (std::filesystem::path(beside).parent_path() / name).string();
}

bool ends_with(std::string_view text, std::string_view end) {
    return text.size() > end.size() && text.substr(text.size() - end.size()) == end;
}

std::uint64_t fingerprint(const void* bytes, std::size_t count) {
    std::uint64_t h = 0xcbf29ce484222325u;
    for (std::size_t i = 0; i < count; ++i) h = (h ^ static_cast<const unsigned char*>(bytes)[i]) * 0x100000001b3u;
    return h;
}

namespace {

template <class T>
bool read(std::string_view word, T& x) {
    if (!word.empty() && word[0] == '+') word.remove_prefix(1);
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), x);
    return error == std::errc() && end == word.data() + word.size();
}

}  // namespace

void split(std::string_view text, std::vector<std::string_view>& words) {
    words.clear();
    for (;;) {
        text.remove_prefix(std::min(text.size(), text.find_first_not_of(" \t\r\n")));
        if (text.empty()) return;
        const std::size_t size = std::min(text.size(), text.find_first_of(" \t\r\n"));
        words.push_back(text.substr(0, size));
        text.remove_prefix(size);
    }
}

bool read_number(std::string_view word, double& x) { return read(word, x) && std::isfinite(x); }
bool read_whole(std::string_view word, std::int64_t& x) { return read(word, x); }

std::string printable(std::string_view text, std::size_t most) {
    std::string shown(text.substr(0, most));
    for (char& c : shown)
        if (c < ' ' || c > '~') c = '?';
    return shown;
}

}  // namespace medulla::render
