#include "tables/table/axis.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>

#include "sim2d/elementary.hpp"
#include "tables/error.hpp"

namespace medulla::tables {
namespace {

constexpr double infinity = std::numeric_limits<double>::max();

// g = +-1 is no distribution; the solvers are tested for |g| <= 0.999.
constexpr std::array<AxisRule, 8> rules = {{
    {"sigma", "1", "optical radius of scattering", 0, infinity, false},
    {"g", "1", "mean cosine of the phase function", -0.999, 0.999, false},
    {"absorption", "1", "optical radius of absorption", 0, infinity, false},
    {"h", "medulla radius", "offset of the incident ray", 0, 1, false},
    {"theta_i", "radian", "inclination of the direction towards the light", 0, pi / 2, false},
    {"side", "1", "0 back (same side as the light), 1 forward", 0, 1, false},
    {"phi", "radian", "azimuth of exit, 0 = forward, counter-clockwise; bin centres", -pi, pi, true},
    {"theta_r", "radian", "inclination of exit; bin centres", -pi / 2, pi / 2, true},
}};

double number(const std::string& text, const std::string& option, const std::string& whole) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
        throw Error("{}: expected LO:HI or LO:HI:N, found '{}'", option, whole);
    return value;
}

}  // namespace

const AxisRule& axis_rule(const std::string& name) {
    for (const AxisRule& rule : rules)
        if (name == rule.name) return rule;
    throw Error("axis '{}': expected one of sigma, g, absorption, h, theta_i, side, phi, theta_r", name);
}

void check_axis(const Axis& axis, const std::string& where) {
    const AxisRule& rule = axis_rule(axis.name);
    if (axis.values.empty()) throw Error("{}/{}: expected at least one value, found none", where, axis.name);
    for (std::size_t i = 0; i < axis.size(); ++i) {
        const double x = axis.values[i];
        if (!(x >= rule.low && x <= rule.high))
            throw Error("{}/{}: expected values in [{:g}, {:g}], found {:g}", where, axis.name, rule.low, rule.high, x);
        if (i > 0 && !(axis.values[i - 1] < x))
            throw Error("{}/{}: expected increasing values, found {:g} after {:g}", where, axis.name, x,
                        axis.values[i - 1]);
    }
    if (!rule.bins) return;
    const Axis expected = exit_axis(axis.name, axis.size());
    for (std::size_t i = 0; i < axis.size(); ++i)
        if (std::abs(axis.values[i] - expected.values[i]) > 1e-9)
            throw Error("{}/{}: expected the centres of {} equal bins, found {:g} as number {} (expected {:g})", where,
                        axis.name, axis.size(), axis.values[i], i, expected.values[i]);
}

Quantity quantity_of(const std::string& name) {
    for (const Quantity q : {Quantity::sigma, Quantity::g, Quantity::absorption, Quantity::h, Quantity::theta_i,
                             Quantity::phi, Quantity::theta_r})
        if (name == name_of(q)) return q;
    throw Error("axis '{}' cannot stand in a pack", name);
}

const char* name_of(Quantity quantity) {
    constexpr const char* names[] = {"sigma", "g", "absorption", "h", "theta_i", "phi", "theta_r"};
    static_assert(std::size(names) == quantity_count);
    return names[static_cast<std::size_t>(quantity)];
}

Axis exit_axis(const std::string& name, std::size_t bins) {
    const AxisRule& rule = axis_rule(name);
    const double width = (rule.high - rule.low) / static_cast<double>(bins);
    Axis axis{name, std::vector<double>(bins)};
    for (std::size_t i = 0; i < bins; ++i) axis.values[i] = rule.low + (static_cast<double>(i) + 0.5) * width;
    return axis;
}

double bin_width(const Axis& axis) {
    const AxisRule& rule = axis_rule(axis.name);
    return (rule.high - rule.low) / static_cast<double>(axis.size());
}

Range parse_range(const std::string& text, const std::string& option, std::size_t default_count) {
    std::vector<std::string> parts(1);
    for (const char c : text)
        if (c == ':')
            parts.emplace_back();
        else
            parts.back() += c;
    if (parts.size() < 2 || parts.size() > 3) throw Error("{}: expected LO:HI or LO:HI:N, found '{}'", option, text);
    Range range{number(parts[0], option, text), number(parts[1], option, text), default_count};
    if (parts.size() == 3) {
        const double n = number(parts[2], option, text);
        if (!(n >= 1 && n <= 4096 && n == std::floor(n)))
            throw Error("{}: expected a whole number of nodes from 1 to 4096, found '{}'", option, parts[2]);
        range.count = static_cast<std::size_t>(n);
    }
    if (range.high < range.low) throw Error("{}: expected LO <= HI, found {:g} > {:g}", option, range.low, range.high);
    if (range.low == range.high) {
        if (parts.size() == 3 && range.count != 1)
            throw Error("{}: expected one node where LO = HI, found {}", option, range.count);
        range.count = 1;
    } else if (range.count == 1) {
        throw Error("{}: expected LO = HI for one node, found {:g} < {:g}", option, range.low, range.high);
    }
    return range;
}

Axis graded_axis(const std::string& name, const Range& range) {
    Axis axis{name, std::vector<double>(range.count, range.low)};
    for (std::size_t i = 0; i + 1 < range.count; ++i) {
        const double u = static_cast<double>(i) / static_cast<double>(range.count - 1);
        double t = u;
        // Square roots and quotients only: the same nodes on every processor.
        const double rest = 1 - u, root = std::sqrt(rest);
        if (name == "sigma" || name == "absorption") t = u * u * std::sqrt(u);
        if (name == "g") t = 1 - rest * root;
        if (name == "theta_i") t = 1 - 1.2 * rest * rest / (rest + 0.2);
        if (name == "h") t = sim2d::portable::sin(pi / 2 * (1 - rest * root));
        axis.values[i] = range.low + (range.high - range.low) * t;
    }
    axis.values.back() = range.high;
    return axis;
}

}  // namespace medulla::tables
