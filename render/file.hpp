// Files that a scene names: their bytes, their numbers in either byte order, and their placement in the world.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "render/vector.hpp"

namespace medulla::render {

/// All bytes of a file. Throws Error where it cannot be read or is longer than `most`.
std::string read_file(const std::string& path, std::uint64_t most);

/// `name` relative to the folder of the file `beside`, if it is not absolute.
std::string path_beside(const std::string& beside, const std::string& name);

bool ends_with(std::string_view text, std::string_view end);

/// FNV-1a.
std::uint64_t fingerprint(const void* bytes, std::size_t count);

/// The words of a text, separated by white space.
void split(std::string_view text, std::vector<std::string_view>& words);
/// Parses all of `word` as a finite number, in every locale alike; false if it is not one.
bool read_number(std::string_view word, double& x);
bool read_whole(std::string_view word, std::int64_t& x);
/// A text as quoted in a message: its first `most` characters, in ASCII.
std::string printable(std::string_view text, std::size_t most = 40);

/// The number at these bytes of a file, in the file's byte order.
template <class T>
T load(const char* bytes, bool big_endian = false) {
    unsigned char ordered[sizeof(T)];
    const std::uint16_t one = 1;
    const bool host_is_big = *reinterpret_cast<const unsigned char*>(&one) == 0;
    for (std::size_t i = 0; i < sizeof(T); ++i)
        ordered[i] = static_cast<unsigned char>(bytes[host_is_big == big_endian ? i : sizeof(T) - 1 - i]);
    T value;
    std::memcpy(&value, ordered, sizeof value);
    return value;
}

/// Transform from a file's axes and unit to the world's: scale, up axis to y, turn about y, translate.
struct Placement {
    float scale = 1;
    int up = 1;      ///< which of the file's axes is up: 0 x, 1 y, 2 z
    float turn = 0;  ///< about y, counter-clockwise seen from above [radians]
    Vec3 translate;

    Vec3 direction(Vec3 w) const {
        const Vec3 v = up == 2 ? Vec3{w.x, w.z, -w.y} : up == 0 ? Vec3{-w.y, w.x, w.z} : w;
        const float c = std::cos(turn), s = std::sin(turn);
        return {c * v.x + s * v.z, v.y, c * v.z - s * v.x};
    }
    Vec3 point(Vec3 p) const { return scale * direction(p) + translate; }
};

}  // namespace medulla::render
