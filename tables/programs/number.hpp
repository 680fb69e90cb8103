// Options whose value is a number: decimal, within bounds, nothing after it. What CLI11 itself takes too (nan,
// hexadecimal, -1 as the greatest unsigned number) is refused by the option's name.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>

#include "tables/error.hpp"

namespace medulla::tables {

/// All of `text` as a decimal number, 1e3 and -0.5 among them; none for nan, inf and what does not fit T.
template <class T>
std::optional<T> parse_number(const std::string& text) {
    const char *first = text.data(), *last = first + text.size();
    if (text.size() > 1 && text[0] == '+' && text[1] != '-') ++first;
    T value = 0;
    const auto [end, error] = std::from_chars(first, last, value);
    if (first == last || error != std::errc() || end != last) return std::nullopt;
    if constexpr (std::is_floating_point_v<T>)
        if (!std::isfinite(value)) return std::nullopt;
    return value;
}

/// What a number must be. `open`: the ends do not belong to it.
template <class T>
struct Bounds {
    T least = std::numeric_limits<T>::lowest(), most = std::numeric_limits<T>::max();
    bool open = false;

    bool holds(T value) const { return open ? least < value && value < most : least <= value && value <= most; }
    std::string text() const {
        const std::string kind = std::is_floating_point_v<T> ? "a number" : "a whole number";
        const bool no_least = std::is_floating_point_v<T> && least == std::numeric_limits<T>::lowest();
        if (most == std::numeric_limits<T>::max() && std::is_floating_point_v<T>)
            return no_least ? kind : fmt::format("{} {} {}", kind, open ? "above" : "of at least", least);
        return fmt::format("{} in {}{}, {}{}", kind, open ? "(" : "[", least, most, open ? ")" : "]");
    }
};

/// Number above 0.
inline constexpr Bounds<double> above_zero = {0, std::numeric_limits<double>::max(), true};

template <class T>
T number_of(const std::string& option, const std::string& text, const Bounds<T>& bounds) {
    const std::optional<T> value = parse_number<T>(text);
    if (!value || !bounds.holds(*value))
        throw CLI::ValidationError(option, fmt::format("expected {}, found '{}'", bounds.text(), text));
    return *value;
}

/// The number in a T or in an optional of one.
template <class T>
struct NumberIn {
    using type = T;
};
template <class T>
struct NumberIn<std::optional<T>> {
    using type = T;
};

/// Adds an option that sets `target`, a number or an optional one.
template <class Target>
CLI::Option* add_number(CLI::App& app, const std::string& option, Target& target, const std::string& help,
                        const Bounds<typename NumberIn<Target>::type>& bounds = {}) {
    using T = typename NumberIn<Target>::type;
    CLI::Option* added = app.add_option_function<std::string>(
        option, [option, &target, bounds](const std::string& text) { target = number_of<T>(option, text, bounds); },
        help);
    added->type_name(std::is_floating_point_v<T> ? "FLOAT" : (std::is_unsigned_v<T> ? "UINT" : "INT"));
    if constexpr (std::is_arithmetic_v<Target>)
        added->default_function([&target] { return fmt::format("{}", target); });
    return added;
}

}  // namespace medulla::tables
