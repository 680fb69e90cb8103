// Errors of the offline programs: a sentence that names file, field, expected and found. main() catches them once.
#pragma once

#include <fmt/core.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace medulla::tables {

class Error : public std::runtime_error {
  public:
    template <class... Args>
    explicit Error(fmt::format_string<Args...> format, Args&&... args)
        : std::runtime_error(fmt::format(format, std::forward<Args>(args)...)) {}
};

/// Ended by a signal: exit status 128 + its number.
class Interrupted : public Error {
  public:
    template <class... Args>
    explicit Interrupted(int number, fmt::format_string<Args...> format, Args&&... args)
        : Error(format, std::forward<Args>(args)...), signal(number) {}
    const int signal;
};

}  // namespace medulla::tables
