// The standard streams of a program. Messages may be lost and never end a job; output that cannot be written is an
// error.
#pragma once

#include <fmt/core.h>

#include <cstddef>
#include <string>
#include <utility>

namespace medulla::tables {

/// Must be called first. Opens streams that were closed at the start such that writes fail, so that no file gets their
/// number. A missing reader (SIGPIPE) and a file beyond its size limit (SIGXFSZ) become write errors instead of
/// signals.
void guard_streams();

enum class Patience { none, some };

/// Writes a message to a stream (STDOUT_FILENO, STDERR_FILENO). It is dropped if the stream is closed or full, or
/// blocks (Patience::some: for one second). Never throws; may be called from a signal handler.
void message(int stream, const char* text, std::size_t size, Patience patience = Patience::some) noexcept;
inline void message(int stream, const std::string& text, Patience patience = Patience::some) noexcept {
    message(stream, text.data(), text.size(), patience);
}

/// A message on standard error.
template <class... Args>
void note(fmt::format_string<Args...> format, Args&&... args) {
    message(2, fmt::format(format, std::forward<Args>(args)...));
}

/// Prints to standard output, buffered until flush_output.
void print_text(const std::string& text);
template <class... Args>
void print(fmt::format_string<Args...> format, Args&&... args) {
    print_text(fmt::format(format, std::forward<Args>(args)...));
}

/// Writes the buffered text to standard output. Throws Error if that fails, unless the text is only messages.
void flush_output();

/// Declares printed text as messages, since the product is a file: from then on they may be lost.
void print_messages();

/// Writes all bytes, also if a descriptor accepts them in parts or with delays. @return false, with errno, on failure
bool write_all(int descriptor, const void* data, std::size_t size);

}  // namespace medulla::tables
