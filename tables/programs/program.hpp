// Shared by both programs: command lines by CLI11, exit statuses, one-line error messages.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "tables/error.hpp"
#include "tables/streams.hpp"

namespace medulla::tables {

/// Wrong arguments that CLI11 accepted: exit status 2, as for its own errors.
class UsageError : public Error {
  public:
    using Error::Error;
};

/// Failure that was already reported on standard error: exit status 1 without a further message.
class Reported {};

/// External text without line ends and other control characters.
std::string one_line(std::string text);

/// Prints one line on standard error; replaces control characters that `text` may quote from files or arguments.
void say(const std::string& program, const std::string& text);

/// "1 node", "2 nodes"
std::string counted(std::size_t count, const std::string& thing);

/// Parses, runs and prints every error as one line on standard error. @return exit status: 0 done, 1 failed, 2 wrong
/// arguments, 128 + number of a signal; also 1 if standard output cannot be written
int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action);

}  // namespace medulla::tables
