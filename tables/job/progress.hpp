// Progress of a long job on standard error: cells done, rate, time left.
#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>

namespace medulla::tables {

enum class ProgressMode { automatic, bar, plain, none };

class Progress {
  public:
    /// `automatic` is a bar on a terminal, plain lines elsewhere. `total` in cells, `done` of them from an earlier run.
    Progress(ProgressMode mode, std::string label, std::size_t total, std::size_t done = 0);
    ~Progress();
    void add(std::size_t cells);  ///< from any thread

  private:
    void print(bool last);

    ProgressMode mode_;
    std::string label_;
    std::size_t total_, before_, done_;
    std::chrono::steady_clock::time_point start_, printed_;
    std::mutex mutex_;
};

/// "1.2 s", "3 min 20 s", "2 h 05 min".
std::string duration_text(double seconds);

}  // namespace medulla::tables
