#include "render/image.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <png.h>

#include <cmath>

#include "render/error.hpp"
#include "render/file.hpp"

namespace medulla::render {
namespace {

constexpr std::int64_t most_pixels = std::int64_t(1) << 28;

class Memory : public Imf::IStream {
  public:
    Memory(const std::string& path, const std::string& bytes) : Imf::IStream(path.c_str()), bytes_(bytes) {}
    bool read(char* to, int count) override {
        if (count < 0 || std::uint64_t(count) > bytes_.size() - at_) throw std::runtime_error("unexpected end of file");
        std::copy_n(bytes_.data() + at_, count, to);
        at_ += std::uint64_t(count);
        return at_ < bytes_.size();
    }
    std::uint64_t tellg() override { return at_; }
    void seekg(std::uint64_t at) override {
        if (at > bytes_.size()) throw std::runtime_error("unexpected end of file");
        at_ = at;
    }
    void clear() override {}

  private:
    const std::string& bytes_;
    std::uint64_t at_ = 0;
};

}  // namespace

Image read_exr(const std::string& path, const std::string& bytes) {
    Image image;
    try {
        Memory memory(path, bytes);
        Imf::InputFile file(memory);
        const Imath::Box2i window = file.header().dataWindow();
        const std::int64_t width = std::int64_t(window.max.x) - window.min.x + 1,
                           height = std::int64_t(window.max.y) - window.min.y + 1;
        if (width < 1 || height < 1 || width > most_pixels / height)
            throw std::runtime_error(fmt::format("{} x {} pixels", width, height));
        const Imf::ChannelList& channels = file.header().channels();
        const bool colour = channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B");
        if (!colour && !channels.findChannel("Y")) throw std::runtime_error("no channels R, G, B or Y");
        image.width = int(width), image.height = int(height);
        image.pixels.resize(std::size_t(width) * std::size_t(height));
        static_assert(sizeof(Rgb) == 3 * sizeof(float));
        Imf::FrameBuffer buffer;
        const std::size_t row = sizeof(Rgb) * std::size_t(width);
        // Where pixel (0, 0) would be: OpenEXR's frame buffers count from there.
        char* origin = reinterpret_cast<char*>(image.pixels.data()) - window.min.x * std::ptrdiff_t(sizeof(Rgb)) -
                       window.min.y * std::ptrdiff_t(row);
        const char* names[3] = {"R", "G", "B"};
        for (std::size_t c = 0; c < (colour ? 3u : 1u); ++c)
            buffer.insert(colour ? names[c] : "Y",
                          Imf::Slice(Imf::FLOAT, origin + c * sizeof(float), sizeof(Rgb), row));
        file.setFrameBuffer(buffer);
        file.readPixels(window.min.y, window.max.y);
        if (!colour)
            for (Rgb& p : image.pixels) p = {p.x, p.x, p.x};
    } catch (const std::exception& error) {
        throw Error("{}: expected an OpenEXR picture, found {}", path, printable(error.what(), std::string::npos));
    }
    return image;
}

// Ward 1991, 'Real pixels'; the format of RADIANCE 2.0 and later: http://radsite.lbl.gov/radiance/refer/filefmts.pdf.
Image read_hdr(const std::string& path, const std::string& bytes) {
    std::string_view rest = bytes;
    const auto line = [&] {
        const std::size_t size = std::min(rest.find('\n'), std::size_t(4096));
        if (size >= rest.size()) throw Error("{}: expected a header that ends in an empty line, found the end", path);
        const std::string_view text = rest.substr(0, size);
        rest.remove_prefix(size + 1);
        return text;
    };
    const std::string_view first = line();
    if (first != "#?RADIANCE" && first != "#?RGBE")
        throw Error("{}: expected #?RADIANCE or #?RGBE, found {}", path, printable(first));
    double exposure = 1;
    for (;;) {
        const std::string_view text = line();
        if (text.empty()) break;
        if (text.substr(0, 7) == "FORMAT=" && text != "FORMAT=32-bit_rle_rgbe")
            throw Error("{}: expected FORMAT=32-bit_rle_rgbe, found {}", path, printable(text));
        if (text.substr(0, 9) == "EXPOSURE=") {
            std::vector<std::string_view> words;
            split(text.substr(9), words);
            double factor = 0;
            if (words.size() != 1 || !read_number(words[0], factor) || !(factor > 0))
                throw Error("{}: expected EXPOSURE > 0, found {}", path, printable(text));
            exposure *= factor;
        }
    }
    const std::string_view size = line();
    std::vector<std::string_view> words;
    split(size, words);
    std::int64_t width = 0, height = 0;
    if (words.size() != 4 || words[0] != "-Y" || words[2] != "+X" || !read_whole(words[1], height) ||
        !read_whole(words[3], width) || width < 1 || height < 1 || width > most_pixels / height)
        throw Error("{}: expected -Y HEIGHT +X WIDTH, found {}", path, printable(size));
    Image image;
    image.width = int(width), image.height = int(height);
    std::vector<std::uint8_t> row(4 * std::size_t(width));
    for (std::int64_t y = 0; y < height; ++y) {
        const auto take = [&](std::size_t count) {
            if (rest.size() < count) throw Error("{}: row {}: expected {} bytes, found the end", path, y, count);
            const std::string_view taken = rest.substr(0, count);
            rest.remove_prefix(count);
            return taken;
        };
        const auto byte = [](std::string_view text, std::size_t k) { return std::uint8_t(text[k]); };
        const bool runs = width >= 8 && width < 32768 && rest.size() >= 4 && byte(rest, 0) == 2 && byte(rest, 1) == 2 &&
                          byte(rest, 2) < 128;
        if (runs) {
            const std::string_view head = take(4);
            if (byte(head, 2) * 256 + byte(head, 3) != width)
                throw Error("{}: row {}: expected {} pixels, found {}", path, y, width,
                            byte(head, 2) * 256 + byte(head, 3));
            for (std::size_t c = 0; c < 4; ++c)
                for (std::size_t x = 0; x < std::size_t(width);) {
                    const std::uint8_t code = byte(take(1), 0);
                    const bool run = code > 128;
                    const std::size_t count = run ? code - 128u : code;
                    if (count == 0 || count > std::size_t(width) - x)
                        throw Error("{}: row {}: expected a run within {} pixels, found {} after {}", path, y, width,
                                    count, x);
                    const std::string_view values = take(run ? 1 : count);
                    for (std::size_t k = 0; k < count; ++k) row[4 * x++ + c] = byte(values, run ? 0 : k);
                }
        } else {
            int shift = 0;  // consecutive repeat counts are higher digits of one count
            for (std::size_t x = 0; x < std::size_t(width);) {
                const std::string_view p = take(4);
                if (byte(p, 0) == 1 && byte(p, 1) == 1 && byte(p, 2) == 1) {
                    const std::uint64_t count = shift < 24 ? std::uint64_t(byte(p, 3)) << shift : 0;
                    if (x == 0 || count == 0 || count > std::uint64_t(width) - x)
                        throw Error("{}: row {}: expected a run within {} pixels, found {} after {}", path, y, width,
                                    count, x);
                    for (std::uint64_t k = 0; k < count; ++k, ++x) std::copy_n(&row[4 * (x - 1)], 4, &row[4 * x]);
                    shift += 8;
                } else {
                    for (std::size_t c = 0; c < 4; ++c) row[4 * x + c] = byte(p, c);
                    ++x, shift = 0;
                }
            }
        }
        for (std::size_t x = 0; x < std::size_t(width); ++x) {
            const std::uint8_t* p = &row[4 * x];
            const double f = p[3] == 0 ? 0 : std::ldexp(1 / exposure, int(p[3]) - 136);
            image.pixels.push_back({float((p[0] + 0.5) * f), float((p[1] + 0.5) * f), float((p[2] + 0.5) * f)});
        }
    }
    return image;
}

Image read_png(const std::string& path, const std::string& bytes, bool linear) {
    Image image;
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    const auto check = [&](int done) {
        if (done != 0) return;
        const std::string message = png.message;
        png_image_free(&png);
        throw Error("{}: expected a PNG picture, found {}", path, printable(message, std::string::npos));
    };
    check(png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()));
    if (std::int64_t(png.width) > most_pixels / std::int64_t(png.height)) {
        png_image_free(&png);
        throw Error("{}: expected at most {} pixels, found {} x {}", path, most_pixels, png.width, png.height);
    }
    image.width = int(png.width), image.height = int(png.height);
    const std::size_t count = std::size_t(png.width) * png.height;
    png.format = PNG_FORMAT_RGB;
    std::vector<std::uint8_t> values(3 * count);
    const png_color black{};  // behind transparent pixels
    check(png_image_finish_read(&png, &black, values.data(), 0, nullptr));
    float decoded[256];  // libpng's own linear output is no more precise than the 8 bits
    for (int i = 0; i < 256; ++i) {
        const double x = i / 255.0;
        decoded[i] = float(!linear ? x : x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4));
    }
    image.pixels.reserve(count);
    for (std::size_t i = 0; i < count; ++i)
        image.pixels.push_back({decoded[values[3 * i]], decoded[values[3 * i + 1]], decoded[values[3 * i + 2]]});
    return image;
}

Image read_image(const std::string& path, const std::string& bytes, bool linear) {
    if (ends_with(path, ".png")) return read_png(path, bytes, linear);
    if (ends_with(path, ".exr")) return read_exr(path, bytes);
    if (ends_with(path, ".hdr")) return read_hdr(path, bytes);
    throw Error("{}: expected a name that ends in .exr, .hdr or .png", path);
}

}  // namespace medulla::render
