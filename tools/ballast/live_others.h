// Tells which commands on the bus come from operators elsewhere, such as `ballast operate` in a terminal.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "hal/lcm/bus.h"
#include "hal/lcm/messages.h"

namespace ballast {

class LiveOthers {
 public:
  struct Said {
    std::int8_t command = 0;  // of operator_t
    bool refused = false;
    std::string text;  // "stop", or "the controller refuses the stop: .."
  };

  // `own`: the sender whose messages are left out, as are those of the run itself.
  explicit LiveOthers(std::int64_t own) : own_(own) {}

  // Takes a message of the shown run, whose newest status this is.
  void hear(const operator_t& message, const controller_status_t& status);

  // Commands heard since, and refusals of them. To be called often, with the newest status.
  [[nodiscard]] std::vector<Said> poll(const controller_status_t& status);

 private:
  [[nodiscard]] bool is_new(const operator_t& message);

  struct Sender {
    std::int64_t number = 0, newest = 0;  // sequence number of the newest message
    std::int64_t course = 0;              // the newest one
  };
  struct Waiting {
    operator_t message;
    std::int64_t run_id = 0, commands_before = 0;
    hal::WallClock::time_point deadline;
  };

  std::int64_t own_;
  std::deque<Sender> senders_;  // the one first heard first; it is the first to be forgotten
  std::vector<Said> said_;
  std::optional<Waiting> waiting_;  // the newest command without an answer, if the next one is its
};

}  // namespace ballast
