#include "tables/streams.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

constexpr int patience_ms = 1000, most_tries = 100;
// A stream that is ready takes so much at once, whatever it is (POSIX: a pipe at least 512 bytes).
constexpr std::size_t most_at_once = 512;
constexpr std::size_t buffered = std::size_t{1} << 16;

std::atomic<bool> stalled[3] = {};  ///< a stream that let a message wait in vain; no further one waits for it
static_assert(std::atomic<bool>::is_always_lock_free);

std::string printed;  ///< what standard output has not been given yet
bool messages_only = false;

}  // namespace

void guard_streams() {
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        if (::fcntl(stream, F_GETFD) < 0 && errno == EBADF) {
            // The lowest free number is this one, since those below it are open.
            const int flags = stream == STDIN_FILENO ? O_WRONLY : O_RDONLY;
            if (::open("/dev/null", flags) != stream) ::_exit(1);
        }
    ::signal(SIGPIPE, SIG_IGN);
    ::signal(SIGXFSZ, SIG_IGN);
}

void message(int stream, const char* text, std::size_t size, Patience patience) noexcept {
    const int before = errno;
    for (int tries = 0; size > 0 && tries < most_tries; ++tries) {
        struct pollfd ready = {stream, POLLOUT, 0};
        const bool wait = patience == Patience::some && !stalled[stream];
        const int found = ::poll(&ready, 1, wait ? patience_ms : 0);
        if (found < 0 && errno == EINTR) continue;
        if (found == 0 && wait) stalled[stream] = true;
        if (found <= 0 || !(ready.revents & POLLOUT)) break;
        const ssize_t n = ::write(stream, text, std::min(size, most_at_once));
        if (n < 0 && (errno == EINTR || errno == EAGAIN)) continue;
        if (n <= 0) break;
        text += n, size -= static_cast<std::size_t>(n), tries = 0;
    }
    errno = before;
}

void print_text(const std::string& text) {
    printed += text;
    if (printed.size() >= buffered) flush_output();
}

void flush_output() {
    const std::string text = std::exchange(printed, std::string());
    if (messages_only)
        message(STDOUT_FILENO, text);
    else if (!write_all(STDOUT_FILENO, text.data(), text.size()))
        throw Error("standard output: cannot be written: {}", std::strerror(errno));
}

void print_messages() { messages_only = true; }

bool write_all(int descriptor, const void* data, std::size_t size) {
    const auto* bytes = static_cast<const char*>(data);
    while (size > 0) {
        const ssize_t n = ::write(descriptor, bytes, size);
        if (n < 0 && errno == EAGAIN) {  // whoever shares the descriptor made it one that does not wait
            struct pollfd ready = {descriptor, POLLOUT, 0};
            ::poll(&ready, 1, -1);
        } else if (n <= 0 && !(n < 0 && errno == EINTR)) {
            if (n == 0) errno = EIO;
            return false;
        } else if (n > 0) {
            bytes += n, size -= static_cast<std::size_t>(n);
        }
    }
    return true;
}

}  // namespace medulla::tables
