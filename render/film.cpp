#include "render/film.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>

#include "render/error.hpp"
#include "render/file.hpp"

namespace medulla::render {
namespace {

struct Header {
    char magic[8];
    std::uint64_t key, pixels, nonfinite;
    std::uint32_t samples, width, height, reserved;
    std::uint64_t checksum;  ///< of the pixels and layers
};
static_assert(sizeof(Header) == 56);
std::uint64_t checksum_of(const Film& film) {
    return fingerprint(film.pixels.data(), film.pixels.size() * sizeof(Pixel)) +
           31 * fingerprint(film.layers.data(), film.layers.size() * sizeof(Layers));
}

constexpr char magic[8] = {'f', 'u', 'r', 'f', 'i', 'l', 'm', '1'};

}  // namespace

double Film::standard_error(std::size_t i) const {
    if (samples < 2) return std::numeric_limits<double>::infinity();
    const double n = samples, mean = pixels[i].luminance_sum() / n;
    return std::sqrt(std::max(0.0, pixels[i].squares / n - mean * mean) / (n - 1));
}

double Film::error() const {
    double variance = 0, sum = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        const double e = standard_error(i);
        variance += e * e, sum += pixels[i].luminance_sum() / samples;
    }
    const double n = double(pixels.size());
    return sum > 0 ? std::sqrt(variance / n) / (sum / n) : std::numeric_limits<double>::infinity();
}

void Film::mean(double (&rgb)[3]) const {
    for (int c = 0; c < 3; ++c) {
        rgb[c] = 0;
        for (const Pixel& p : pixels) rgb[c] += p.sum[c];
        rgb[c] /= double(samples) * double(pixels.size());
    }
}

void save(const Film& film, const std::string& key, const std::string& path) {
    Header header{};
    std::memcpy(header.magic, magic, sizeof magic);
    header.key = fingerprint(key.data(), key.size()), header.pixels = film.pixels.size(),
    header.nonfinite = film.nonfinite;
    header.samples = film.samples, header.width = std::uint32_t(film.width), header.height = std::uint32_t(film.height);
    header.checksum = checksum_of(film);
    const std::string temporary = path + ".new";
    std::ofstream file(temporary, std::ios::binary);
    file.write(reinterpret_cast<const char*>(&header), sizeof header);
    file.write(reinterpret_cast<const char*>(film.pixels.data()), std::streamsize(film.pixels.size() * sizeof(Pixel)));
    file.write(reinterpret_cast<const char*>(film.layers.data()), std::streamsize(film.layers.size() * sizeof(Layers)));
    file.close();
    if (!file || std::rename(temporary.c_str(), path.c_str()) != 0)
        throw Error("{}: cannot be written: {}", path, std::strerror(errno));
}

bool load(Film& film, const std::string& key, const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) return false;
    Header header{};
    file.read(reinterpret_cast<char*>(&header), sizeof header);
    if (!file || std::memcmp(header.magic, magic, sizeof magic) != 0)
        throw Error("{}: expected an unfinished picture of fur-render, found another file", path);
    if (header.key != fingerprint(key.data(), key.size()) || header.pixels != film.pixels.size() ||
        header.width != std::uint32_t(film.width) || header.height != std::uint32_t(film.height))
        throw Error("{}: expected the same scene and options; remove the file to begin anew", path);
    file.read(reinterpret_cast<char*>(film.pixels.data()), std::streamsize(film.pixels.size() * sizeof(Pixel)));
    file.read(reinterpret_cast<char*>(film.layers.data()), std::streamsize(film.layers.size() * sizeof(Layers)));
    if (!file || checksum_of(film) != header.checksum) throw Error("{}: damaged; remove the file to begin anew", path);
    film.samples = header.samples, film.nonfinite = header.nonfinite;
    return true;
}

}  // namespace medulla::render
