#include "tables/job/interrupts.hpp"

#include <unistd.h>

#include "tables/streams.hpp"

namespace medulla::tables {
namespace {

std::atomic<bool> stop{false};
std::atomic<int> caught{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

constexpr unsigned seconds_of_grace = 5;

/// Ends the process from a signal handler, with a message. Slice files are complete or absent, so nothing is left half
/// written.
[[noreturn]] void give_up() {
    constexpr char text[] = "medulla-precompute: interrupted: unfinished slices discarded; continue with --resume\n";
    message(STDERR_FILENO, text, sizeof text - 1);
    ::_exit(128 + caught);
}

}  // namespace

Interrupts::Interrupts() {
    stop = false, caught = 0;
    struct sigaction action = {};
    action.sa_handler = [](int number) {
        if (number == SIGALRM || caught.exchange(number) != 0) give_up();
        stop = true;
        ::alarm(seconds_of_grace);
    };
    action.sa_flags = SA_RESTART;
    ::sigaction(SIGINT, &action, &old_[0]);
    ::sigaction(SIGTERM, &action, &old_[1]);
    ::sigaction(SIGALRM, &action, &old_[2]);
}

Interrupts::~Interrupts() {
    ::alarm(0);
    ::sigaction(SIGALRM, &old_[2], nullptr);
    ::sigaction(SIGINT, &old_[0], nullptr);
    ::sigaction(SIGTERM, &old_[1], nullptr);
}

const std::atomic<bool>& stop_requested() { return stop; }
int caught_signal() { return caught; }

}  // namespace medulla::tables
