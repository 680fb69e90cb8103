// SIGINT and SIGTERM during a job: what runs may end, and what is done is kept.
#pragma once

#include <signal.h>

#include <atomic>

namespace medulla::tables {

/// Catches SIGINT and SIGTERM in its lifetime. The first allows running slices a few seconds to end, the second none:
/// then the process ends with a message.
class Interrupts {
  public:
    Interrupts();
    ~Interrupts();
    Interrupts(const Interrupts&) = delete;
    Interrupts& operator=(const Interrupts&) = delete;

  private:
    struct sigaction old_[3];
};

/// Whether a signal came in the lifetime of the last Interrupts, and which.
const std::atomic<bool>& stop_requested();
int caught_signal();

}  // namespace medulla::tables
