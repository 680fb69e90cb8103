// What both programs share: the words of CLI11, exit statuses, one line for an error.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "tables/error.hpp"

namespace medulla::tables {

/// The words were wrong, though CLI11 took them: exit status 2, as for its own errors.
class UsageError : public Error {
  public:
    using Error::Error;
};

/// Ended by a signal: exit status 128 + its number.
class Interrupted : public Error {
  public:
    template <class... Args>
    explicit Interrupted(int number, fmt::format_string<Args...> format, Args&&... args)
        : Error(format, std::forward<Args>(args)...), signal(number) {}
    const int signal;
};

/// Parses, runs and turns every error into one line on standard error. 0 done, 1 could not be done, 2 wrong words,
/// 128 + number of a signal.
int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action);

}  // namespace medulla::tables
