#include "render/image_file.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <png.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <vector>

#include "render/error.hpp"
#include "render/random.hpp"

namespace medulla::render {
namespace {

float srgb(float x) { return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f; }

}  // namespace

// Narkowicz 2015's fit of the ACES curve: a toe, a shoulder, 0.8 at 1.
float filmic(float x) { return std::clamp(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 0.0f, 1.0f); }

void write_png(const Film& film, const Picture& picture, const std::string& path) {
    std::vector<std::uint8_t> bytes(3 * film.pixels.size());
    const float scale = std::exp2(picture.exposure);
    for (std::size_t i = 0; i < film.pixels.size(); ++i) {
        const Rgb c = film.colour(i);
        const float channel[3] = {c.x, c.y, c.z};
        // One dither for the three channels, half a step either way: no bands in a smooth wall, no coloured noise.
        const float dither = unit_float(scatter_bits(std::uint32_t(i))) - 0.5f;
        for (std::size_t k = 0; k < 3; ++k) {
            const float x = std::max(0.0f, scale * channel[k]);
            const float display = srgb(picture.filmic ? filmic(x) : std::min(1.0f, x));
            bytes[3 * i + k] = std::uint8_t(std::clamp(255 * display + dither + 0.5f, 0.0f, 255.0f));
        }
    }
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = png_uint_32(film.width), image.height = png_uint_32(film.height), image.format = PNG_FORMAT_RGB;
    std::FILE* file = std::fopen(path.c_str(), "wb");
    if (file == nullptr) throw Error("{}: cannot be written: {}", path, std::strerror(errno));
    const bool written = png_image_write_to_stdio(&image, file, 0, bytes.data(), 0, nullptr) != 0;
    if (std::fclose(file) != 0 || !written) throw Error("{}: cannot be written: {}", path, image.message);
}

void write_exr(const Film& film, const std::string& path) {
    const char* names[4] = {"R", "G", "B", "standard_error.Y"};
    std::vector<float> planes[4];
    for (std::size_t i = 0; i < film.pixels.size(); ++i) {
        const Rgb c = film.colour(i);
        planes[0].push_back(c.x), planes[1].push_back(c.y), planes[2].push_back(c.z);
        planes[3].push_back(float(film.standard_error(i)));
    }
    try {
        Imf::Header header(film.width, film.height);
        Imf::FrameBuffer buffer;
        for (int k = 0; k < 4; ++k) {
            header.channels().insert(names[k], Imf::Channel(Imf::FLOAT));
            buffer.insert(names[k], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(planes[k].data()), sizeof(float),
                                               sizeof(float) * std::size_t(film.width)));
        }
        Imf::OutputFile file(path.c_str(), header);
        file.setFrameBuffer(buffer);
        file.writePixels(film.height);
    } catch (const std::exception& error) {
        throw Error("{}: cannot be written: {}", path, error.what());
    }
}

}  // namespace medulla::render
