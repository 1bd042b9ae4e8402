#include "tools/qemu/turns.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <string>
#include <system_error>

namespace ballast::sil {

Turns::~Turns() {
  if (started_) sched_setaffinity(0, sizeof allowed_, &allowed_);
}

void Turns::start() {
  started_ = sched_getaffinity(0, sizeof allowed_, &allowed_) == 0;
  be_together();
}

void Turns::take_with(pid_t process) {
  process_ = process;
  if (started_ && CPU_COUNT(&allowed_) >= 2) be_apart();
}

// Without this the scheduler would leave both on one processor for a while.
void Turns::be_apart() {
  cpu_set_t others = allowed_;
  CPU_CLR(static_cast<std::size_t>(std::max(sched_getcpu(), 0)), &others);
  move_process(others);
  sched_setaffinity(0, sizeof allowed_, &allowed_);
  apart_ = true;
}

void Turns::be_together() {
  const int here = sched_getcpu();
  if (!started_ || here < 0) return;
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(static_cast<std::size_t>(here), &one);
  sched_setaffinity(0, sizeof one, &one);
  move_process(one);
  apart_ = false;
}

// Moves all threads of the process: each has its own set of processors.
void Turns::move_process(const cpu_set_t& processors) const {
  if (process_ == 0) return;
  std::error_code gone;
  const std::filesystem::directory_iterator threads("/proc/" + std::to_string(process_) + "/task", gone);
  for (auto at = begin(threads); !gone && at != end(threads); at.increment(gone)) {
    const std::string name = at->path().filename();
    pid_t thread = 0;
    if (std::from_chars(name.data(), name.data() + name.size(), thread).ec == std::errc())
      sched_setaffinity(thread, sizeof processors, &processors);
  }
}

void Turns::came() {
  late_ = std::max(late_ - 1, 0);
  ++turns_apart_;
}

void Turns::did_not_come() {
  late_ += kForgiven;
  if (late_ < kTooOften) return;
  together_for_ = turns_apart_ < kLongApart ? std::min(2 * together_for_, kLongestTogether) : kShortestTogether;
  together_left_ = together_for_;
  late_ = turns_apart_ = 0;
  be_together();
}

void Turns::wait_together() {
  if (together_left_ > 0 && --together_left_ == 0) be_apart();
}

}  // namespace ballast::sil
