#include "plot/figure.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <utility>

namespace medulla::plot {
namespace {

/// 1, 2 or 5 times a power of ten: the greatest that is at most x, or the least that is at least x.
double round_number(double x, bool up) {
    // A rounding error of log10 or pow must not cost a step.
    const double slack = 1e-9, decade = std::pow(10, std::floor(std::log10(x) + slack));
    const double steps[] = {1, 2, 5, 10};
    double best = steps[up ? 3 : 0];
    for (const double step : steps) {
        if (!up && step * decade <= x * (1 + slack)) best = step;
        if (up && step * decade >= x * (1 - slack)) {
            best = step;
            break;
        }
    }
    return best * decade;
}

/// Bytes of the valid UTF-8 sequence at `at`, 0: none (RFC 3629).
std::size_t sequence_at(const std::string& text, std::size_t at) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned char first = byte(at);
    const std::size_t size = first < 0x80 ? 1 : first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : first >= 0xc2 ? 2 : 0;
    if (first > 0xf4 || at + size > text.size()) return 0;
    for (std::size_t i = at + 1; i < at + size; ++i)
        if ((byte(i) & 0xc0) != 0x80) return 0;
    // Longer than necessary, a surrogate, or above the last character.
    const unsigned char second = size > 2 ? byte(at + 1) : 0;
    const bool wrong = (first == 0xe0 && second < 0xa0) || (first == 0xed && second >= 0xa0) ||
                       (first == 0xf0 && second < 0x90) || (first == 0xf4 && second >= 0x90);
    return wrong ? 0 : size;
}

}  // namespace

Axis log_axis(const std::string& label, double low, double high) {
    if (!(low > 0 && low <= high && std::isfinite(high)))
        throw std::invalid_argument(
            fmt::format("logarithmic axis: expected 0 < low <= high, found {} and {}", low, high));
    Axis axis;
    axis.label = label, axis.log = true;
    axis.low = round_number(low, false), axis.high = round_number(high, true);
    if (!(axis.low < axis.high)) axis.high = round_number(axis.low * 1.5, true);
    return axis;
}

Axis symmetric_axis(const std::string& label, double reach) {
    Axis axis;
    axis.label = label;
    axis.high = reach > 0 ? round_number(reach, true) : 1;
    axis.low = -axis.high, axis.step = axis.high / 2;
    return axis;
}

std::vector<std::size_t> thinned(const std::vector<double>& x, const std::vector<double>& y, double tolerance) {
    // Douglas and Peucker, with the vertical distance: x increases.
    std::vector<bool> kept(x.size(), false);
    std::vector<std::pair<std::size_t, std::size_t>> open;
    if (!x.empty()) kept.front() = kept.back() = true, open.emplace_back(0, x.size() - 1);
    while (!open.empty()) {
        const auto [first, last] = open.back();
        open.pop_back();
        std::size_t worst = first;
        double most = tolerance;
        for (std::size_t i = first + 1; i < last; ++i) {
            const double line = y[first] + (y[last] - y[first]) * (x[i] - x[first]) / (x[last] - x[first]);
            if (std::abs(y[i] - line) > most) most = std::abs(y[i] - line), worst = i;
        }
        if (worst == first) continue;
        kept[worst] = true;
        open.emplace_back(first, worst), open.emplace_back(worst, last);
    }
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < kept.size(); ++i)
        if (kept[i]) out.push_back(i);
    return out;
}

std::string printable(const std::string& text) {
    std::string out;
    for (std::size_t i = 0; i < text.size();) {
        const std::size_t size = sequence_at(text, i);
        const auto c = static_cast<unsigned char>(text[i]);
        if (size == 0 || c < ' ' || c == 127) {
            out += '?';
            ++i;
            continue;
        }
        out.append(text, i, size);
        i += size;
    }
    return out;
}

}  // namespace medulla::plot
