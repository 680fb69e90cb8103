#include "tables/bake/baked_file.hpp"

#include <sys/stat.h>

#include <cstring>
#include <fstream>

#include "medulla/baked.hpp"
#include "tables/error.hpp"
#include "tables/store/file.hpp"

namespace medulla::tables {

std::vector<unsigned char> read_baked(const std::string& path) {
    std::vector<unsigned char> bytes = read_file(path, std::uint64_t{1} << 32);
    const BakedStatus status = open_baked(bytes.data(), bytes.size()).status;
    if (status == BakedStatus::other_version)
        throw Error("{}: expected a baked material of version {}, found version {}", path, baked_version,
                    detail::load<std::uint32_t>(bytes.data() + 8));
    if (status != BakedStatus::ok) throw Error("{}: expected a baked material: {}", path, describe(status));
    return bytes;
}

bool is_baked(const std::string& path) {
    struct stat info = {};
    if (::stat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return false;
    std::ifstream file(path, std::ios::binary);
    char magic[8] = {};
    file.read(magic, sizeof magic);
    return file.gcount() == 8 && std::memcmp(magic, baked_magic, sizeof magic) == 0;
}

}  // namespace medulla::tables
