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

/// Parses, runs and turns every error into one line on standard error. 0 done, 1 could not be done, 2 wrong words.
int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action);

}  // namespace medulla::tables
