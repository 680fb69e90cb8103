// What both programs share: the words of CLI11, exit statuses, one line for an error.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "tables/error.hpp"
#include "tables/streams.hpp"

namespace medulla::tables {

/// The words were wrong, though CLI11 took them: exit status 2, as for its own errors.
class UsageError : public Error {
  public:
    using Error::Error;
};

/// It could not be done, and why stands on standard error already: exit status 1 without a further line.
class Reported {};

/// Text that came from outside, without line ends and what else a terminal obeys.
std::string one_line(std::string text);

/// One line on standard error, whatever stood in a file or a word that `text` quotes.
void say(const std::string& program, const std::string& text);

/// "1 node", "2 nodes"
std::string counted(std::size_t count, const std::string& thing);

/// Parses, runs and turns every error into one line on standard error. 0 done, 1 could not be done, 2 wrong words,
/// 128 + number of a signal. Status 1 also where standard output cannot take what was printed to it.
int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action);

}  // namespace medulla::tables
