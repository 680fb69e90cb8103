#include "plot/figure.hpp"

#include <cmath>

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

/// Bytes of the valid UTF-8 sequence at `at`; 0: none. (Overlong forms and surrogates are left to gnuplot.)
std::size_t sequence_at(const std::string& text, std::size_t at) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned char first = byte(at);
    const std::size_t size = first < 0x80 ? 1 : first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : first >= 0xc2 ? 2 : 0;
    if (first > 0xf4 || at + size > text.size()) return 0;
    for (std::size_t i = at + 1; i < at + size; ++i)
        if ((byte(i) & 0xc0) != 0x80) return 0;
    return size;
}

}  // namespace

Axis log_axis(const std::string& label, double low, double high) {
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

std::string literal(const std::string& text) {
    std::string out;
    for (std::size_t i = 0; i < text.size();) {
        const std::size_t size = sequence_at(text, i);
        const auto c = static_cast<unsigned char>(text[i]);
        if (size == 0 || c < ' ' || c == 127) {
            out += '?';
            ++i;
            continue;
        }
        if (std::string("\\{}_^@&~").find(text[i]) != std::string::npos) out += '\\';
        out.append(text, i, size);
        i += size;
    }
    return out;
}

}  // namespace medulla::plot
