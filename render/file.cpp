#include "render/file.hpp"

#include <cerrno>
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

std::uint64_t fingerprint(const void* bytes, std::size_t count) {
    std::uint64_t h = 0xcbf29ce484222325u;
    for (std::size_t i = 0; i < count; ++i) h = (h ^ static_cast<const unsigned char*>(bytes)[i]) * 0x100000001b3u;
    return h;
}

}  // namespace medulla::render
