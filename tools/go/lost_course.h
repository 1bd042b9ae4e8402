// Watches a course that is followed.
#pragma once

#include <cstdint>
#include <optional>

#include "hal/lcm/messages.h"

namespace ballast::go {

// So often a ball that has lost its course is halted, and goes on from there.
inline constexpr int kMostGoesOn = 3;

class LostCourse {
 public:
  // To be called with each status. True: the governor has had the ball on its backup for longer than it takes to return
  // to the course, where it can.
  bool lost(const controller_status_t& status) {
    constexpr std::int64_t kReturns_us = 3'000'000;
    const bool backup = status.mode == controller_status_t::MODE_RUNNING && status.backup_active != 0;
    if (!backup) {
      since_us_.reset();
    } else if (!since_us_) {
      since_us_ = status.utime;
    }
    return since_us_ && status.utime - *since_us_ > kReturns_us;
  }

 private:
  std::optional<std::int64_t> since_us_;
};

}  // namespace ballast::go
