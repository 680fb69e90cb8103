// The standard streams of a program: a message may be lost there and never ends a job; a product that cannot be written
// is an error.
#pragma once

#include <fmt/core.h>

#include <cstddef>
#include <string>
#include <utility>

namespace medulla::tables {

/// The first thing a program does. A stream that was closed by whoever started it is opened so that it refuses to be
/// written: no file of ours takes its number. A reader that went away (SIGPIPE) and a file that grew too long (SIGXFSZ)
/// are errors of the write instead of signals that end the process.
void guard_streams();

enum class Patience { none, some };

/// Writes a message to a stream (STDOUT_FILENO, STDERR_FILENO). It is dropped where the stream is closed or full, or
/// takes nothing for a while (Patience::some: one second). Never throws; may be called by a signal handler.
void message(int stream, const char* text, std::size_t size, Patience patience = Patience::some) noexcept;
inline void message(int stream, const std::string& text, Patience patience = Patience::some) noexcept {
    message(stream, text.data(), text.size(), patience);
}

/// A message on standard error.
template <class... Args>
void note(fmt::format_string<Args...> format, Args&&... args) {
    message(2, fmt::format(format, std::forward<Args>(args)...));
}

/// Adds to what a program gives on standard output.
void print_text(const std::string& text);
template <class... Args>
void print(fmt::format_string<Args...> format, Args&&... args) {
    print_text(fmt::format(format, std::forward<Args>(args)...));
}

/// Brings all that was printed to standard output. Throws Error if it cannot be written, unless it is messages.
void flush_output();

/// Says that what is printed are messages beside a product that is a file: from now on they may be lost.
void print_messages();

/// Writes all bytes, also where a descriptor takes them in parts or not at once. False, with errno, if it cannot.
bool write_all(int descriptor, const void* data, std::size_t size);

}  // namespace medulla::tables
