#include "render/environment.hpp"

#include "render/error.hpp"

namespace medulla::render {
namespace {

constexpr double pi = 3.14159265358979323846;

/// The first of `count` increasing entries (the last is 1) that is greater than u, and the position of u in its step.
template <class T>
std::size_t find(const T* sums, std::size_t count, double u, double& within) {
    const std::size_t i = std::min(count - 1, std::size_t(std::upper_bound(sums, sums + count, T(u)) - sums));
    const double low = i == 0 ? 0 : double(sums[i - 1]), width = double(sums[i]) - low;
    within = width > 0 ? std::clamp((u - low) / width, 0.0, 1.0) : 0.5;
    return i;
}

}  // namespace

Environment::Environment(Image image, float turn, Rgb scale, const std::string& path)
    : image_(std::move(image)), turn_(turn) {
    const std::size_t width = std::size_t(image_.width), height = std::size_t(image_.height);
    in_row_.resize(width * height);
    double sum = 0;
    for (std::size_t y = 0; y < height; ++y) {
        const double top = std::cos(pi * double(y) / double(height)),
                     bottom = std::cos(pi * double(y + 1) / double(height));
        double row = 0;
        for (std::size_t x = 0; x < width; ++x) {
            Rgb& p = image_.pixels[y * width + x];
            if (!finite(p))
                throw Error("{}: pixel {}, {}: expected finite numbers, found {:g} {:g} {:g}", path, x, y, p.x, p.y,
                            p.z);
            p = scale * Rgb{std::max(0.0f, p.x), std::max(0.0f, p.y), std::max(0.0f, p.z)};
            if (!(greatest(p) <= 1e30f)) throw Error("{}: pixel {}, {}: expected numbers up to 1e30", path, x, y);
            in_row_[y * width + x] = float(row += double(luminance(p)));
        }
        for (std::size_t x = 0; x < width && row > 0; ++x)
            in_row_[y * width + x] = float(double(in_row_[y * width + x]) / row);
        rows_.push_back(sum += row * (top - bottom) * 2 * pi / double(width));
    }
    if (!(sum > 0)) throw Error("{}: expected some light, found none", path);
    for (double& r : rows_) r /= sum;
    one_over_integral_ = float(1 / sum);
}

std::size_t Environment::pixel(Vec3 direction) const {
    const float around = std::atan2(direction.x, -direction.z) + turn_;
    const double u = 0.5 + double(around) / (2 * pi), v = std::acos(std::clamp(double(direction.y), -1.0, 1.0)) / pi;
    const auto x = std::size_t((u - std::floor(u)) * image_.width), y = std::size_t(v * image_.height);
    return std::min(y, std::size_t(image_.height) - 1) * std::size_t(image_.width) +
           std::min(x, std::size_t(image_.width) - 1);
}

Vec3 Environment::sample(Pair random) const {
    const std::size_t width = std::size_t(image_.width), height = std::size_t(image_.height);
    double in_x, in_y;
    const std::size_t y = find(rows_.data(), height, double(random.y), in_y);
    const std::size_t x = find(in_row_.data() + y * width, width, double(random.x), in_x);
    // Uniform over the pixel's solid angle: uniform in azimuth and in the cosine.
    const double top = std::cos(pi * double(y) / double(height)),
                 bottom = std::cos(pi * double(y + 1) / double(height));
    const double cosine = top + in_y * (bottom - top), sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    const double around = (((double(x) + in_x) / double(width)) - 0.5) * 2 * pi - double(turn_);
    return {float(sine * std::sin(around)), float(cosine), float(-sine * std::cos(around))};
}

}  // namespace medulla::render
