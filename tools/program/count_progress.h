// Progress of many equal pieces of work, on stderr: a bar on a terminal, otherwise a line every ten seconds.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <iostream>
#include <string>

#include "tools/program/rough_time.h"

namespace ballast::program {

class CountProgress {
 public:
  // `what`: "seeds". `before`: pieces that were done before this object was made; the time left does not count them.
  CountProgress(std::uint64_t count, std::string what, bool wanted, std::uint64_t before = 0)
      : count_(count),
        before_(before),
        what_(std::move(what)),
        wanted_(wanted),
        terminal_(isatty(STDERR_FILENO) == 1),
        begun_(Clock::now()),
        next_(begun_) {
    if (!terminal_) next_ += std::chrono::seconds(10);
  }

  // `more`: what else there is to say, such as "3 broken".
  void show(std::uint64_t done, const std::string& more) {
    const auto now = Clock::now();
    if (!wanted_ || now < next_) return;
    next_ = now + (terminal_ ? std::chrono::milliseconds(200) : std::chrono::milliseconds(10000));
    const double part = static_cast<double>(done) / static_cast<double>(count_);
    const double rate = static_cast<double>(done - std::min(before_, done)) / seconds();
    const double left_s = rate > 0 ? static_cast<double>(count_ - done) / rate : 0;
    constexpr int kWidth = 40;
    std::string bar(kWidth, '.');
    std::fill_n(bar.begin(), static_cast<int>(part * kWidth), '#');
    std::cerr << fmt::format("{}[{}] {:3.0f} %  {} of {} {}, {:.3g}/s, {} left, {}{}", terminal_ ? "\r\033[K" : "", bar,
                             100 * part, done, count_, what_, rate, rough_time(left_s), more, terminal_ ? "" : "\n");
    drawn_ = terminal_;
  }

  void clear() {
    if (drawn_) std::cerr << "\r\033[K";
    drawn_ = false;
  }

  [[nodiscard]] double seconds() const { return std::chrono::duration<double>(Clock::now() - begun_).count(); }

 private:
  using Clock = std::chrono::steady_clock;

  std::uint64_t count_, before_;
  std::string what_;
  bool wanted_, terminal_, drawn_ = false;
  Clock::time_point begun_, next_;
};

}  // namespace ballast::program
