#include "tables/job/progress.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "tables/streams.hpp"

namespace medulla::tables {

Progress::Progress(ProgressMode mode, std::string label, std::size_t total, std::size_t done)
    : mode_(mode),
      label_(std::move(label)),
      total_(total),
      before_(done),
      done_(done),
      start_(std::chrono::steady_clock::now()),
      printed_(start_) {
    if (mode_ == ProgressMode::automatic) mode_ = ::isatty(STDERR_FILENO) ? ProgressMode::bar : ProgressMode::plain;
}

Progress::~Progress() {
    const std::lock_guard<std::mutex> lock(mutex_);
    print(true);
}

void Progress::add(std::size_t cells) {
    const std::lock_guard<std::mutex> lock(mutex_);
    done_ += cells;
    const auto now = std::chrono::steady_clock::now();
    const double pause = mode_ == ProgressMode::bar ? 0.1 : 5.0;
    if (std::chrono::duration<double>(now - printed_).count() < pause) return;
    printed_ = now;
    print(false);
}

void Progress::print(bool last) {
    if (mode_ == ProgressMode::none || total_ == 0) return;
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    const double rate = seconds > 0 ? static_cast<double>(done_ - before_) / seconds : 0;
    const std::string left =
        last ? fmt::format("took {}", duration_text(seconds))
             : (rate > 0 ? fmt::format("{} left", duration_text(static_cast<double>(total_ - done_) / rate)) : "");
    const std::string counts = fmt::format("{}/{} cells, {:.3g} cells/s, {}", done_, total_, rate, left);
    if (mode_ == ProgressMode::plain) {
        message(STDERR_FILENO, fmt::format("{}: {}\n", label_, counts), Patience::none);
        return;
    }
    constexpr std::size_t width = 28;
    const std::size_t full = std::min(width, width * done_ / total_);
    const std::string bar = fmt::format("\r{} [{}{}] {}\033[K{}", label_, std::string(full, '#'),
                                        std::string(width - full, '.'), counts, last ? "\n" : "");
    message(STDERR_FILENO, bar, Patience::none);
}

std::string duration_text(double seconds) {
    if (seconds < 100) return fmt::format("{:.1f} s", seconds);
    const auto whole = static_cast<long>(std::lround(seconds));
    if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
    return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

}  // namespace medulla::tables
