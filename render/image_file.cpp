#include "render/image_file.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <png.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <functional>
#include <vector>

#include "medulla/fur_parameters.hpp"
#include "render/error.hpp"
#include "render/random.hpp"

namespace medulla::render {
namespace {

float srgb(float x) { return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f; }

}  // namespace

// Narkowicz 2015's fit of the ACES curve: a toe, a shoulder, 0.8 at 1.
float filmic(float x) {
    x = std::min(x, 8.0f);  // the curve is 1 from 7.25 on; squares of great radiances are infinite
    return std::clamp(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 0.0f, 1.0f);
}

void write_png(const Film& film, const Picture& picture, const std::string& path) {
    write_png(
        film, [&](std::size_t i) { return film.colour(i); }, picture, path);
}

void write_png(const Film& film, const std::function<Rgb(std::size_t)>& colour, const Picture& picture,
               const std::string& path) {
    std::vector<std::uint8_t> bytes(3 * film.pixels.size());
    const float scale = std::exp2(picture.exposure);
    for (std::size_t i = 0; i < film.pixels.size(); ++i) {
        const Rgb c = colour(i);
        const float channel[3] = {c.x, c.y, c.z};
        // Dither of half a step either way, the same for the three channels: no banding, no coloured noise.
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
    const bool closed = std::fclose(file) == 0;
    if (!written || !closed)
        throw Error("{}: cannot be written: {}", path, written ? std::strerror(errno) : image.message);
}

namespace {

/// A channel's name, and its value of a pixel.
struct Channel {
    std::string name;
    std::function<float(std::size_t)> value;
};

void add(std::vector<Channel>& channels, const std::string& layer, const char* names,
         const std::function<Vec3(std::size_t)>& value) {
    channels.push_back({layer + names[0], [=](std::size_t i) { return value(i).x; }});
    channels.push_back({layer + names[1], [=](std::size_t i) { return value(i).y; }});
    channels.push_back({layer + names[2], [=](std::size_t i) { return value(i).z; }});
}

std::vector<Channel> channels_of(const Film& film) {
    std::vector<Channel> channels;
    add(channels, "", "RGB", [&](std::size_t i) { return film.colour(i); });
    channels.push_back({"standard_error.Y", [&](std::size_t i) { return float(film.standard_error(i)); }});
    if (film.layers.empty()) return channels;
    const float share = 1 / float(film.samples);
    const std::vector<Layers>& all = film.layers;
    for (int k = 0; k < 7; ++k)
        add(channels, k == Layers::other ? "other." : fmt::format("lobe_{}.", lobe_names[k]), "RGB",
            [=, &all](std::size_t i) { return share * all[i].lobe[k]; });
    add(channels, "direct.", "RGB", [=, &all](std::size_t i) { return share * all[i].direct; });
    add(channels, "indirect.", "RGB",
        [=, &all, &film](std::size_t i) { return film.colour(i) - share * all[i].direct; });
    add(channels, "albedo.", "RGB", [=, &all](std::size_t i) { return share * all[i].albedo; });
    add(channels, "normal.", "XYZ", [=, &all](std::size_t i) { return share * all[i].normal; });
    add(channels, "tangent.", "XYZ", [=, &all](std::size_t i) { return share * all[i].tangent; });
    channels.push_back(
        {"depth.Z", [=, &all](std::size_t i) { return all[i].hit > 0 ? all[i].depth / all[i].hit : 0; }});
    channels.push_back({"A", [=, &all](std::size_t i) { return share * all[i].hit; }});
    return channels;
}

}  // namespace

void write_layer_pngs(const Film& film, const Picture& picture, const std::string& prefix) {
    const float share = 1 / float(film.samples);
    const auto write = [&](const std::string& name, const std::function<Rgb(std::size_t)>& colour) {
        write_png(film, colour, picture, fmt::format("{}{}.png", prefix, name));
    };
    const std::vector<Layers>& all = film.layers;
    for (int k = 0; k < Layers::other; ++k) write(lobe_names[k], [&](std::size_t i) { return share * all[i].lobe[k]; });
    write("direct", [&](std::size_t i) { return share * all[i].direct; });
    write("indirect", [&](std::size_t i) { return film.colour(i) - share * all[i].direct; });
}

void write_exr(const Film& film, const std::string& path) {
    const std::vector<Channel> channels = channels_of(film);
    const std::size_t width = std::size_t(film.width);
    std::vector<float> row(channels.size() * width);  // one row of each: no second picture in memory
    try {
        Imf::Header header(film.width, film.height);
        Imf::FrameBuffer buffer;
        for (std::size_t k = 0; k < channels.size(); ++k) {
            header.channels().insert(channels[k].name, Imf::Channel(Imf::FLOAT));
            buffer.insert(channels[k].name,
                          Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(row.data() + k * width), sizeof(float), 0));
        }
        Imf::OutputFile file(path.c_str(), header);
        file.setFrameBuffer(buffer);
        for (std::size_t y = 0; y < std::size_t(film.height); ++y) {
            for (std::size_t k = 0; k < channels.size(); ++k)
                for (std::size_t x = 0; x < width; ++x) row[k * width + x] = channels[k].value(y * width + x);
            file.writePixels(1);
        }
    } catch (const std::exception& error) {
        throw Error("{}: cannot be written: {}", path, error.what());
    }
}

}  // namespace medulla::render
