// The line to the host: the monitor's verdict and the operator's commands in, the status out.
#pragma once

#include <concepts>
#include <cstdint>

#include "firmware/control/inputs.h"
#include "firmware/control/status.h"
#include "hal/status.h"

namespace ballast::hal {

// read_verdict(verdict):  kOk: a verdict that has not been read before. kEmpty: none came, `verdict` is untouched.
// read_operator(command): kOk: the next command. Each is handed out once, one per tick, in the order of arrival. A stop
//                         goes first and cancels the commands before it (operator_queue.h). kEmpty: none waits.
// write_status(status):   reports the tick being served.
template <class B>
concept HostLink = requires(B& board, firmware::MonitorVerdict& verdict, firmware::OperatorInput& command,
                            const firmware::ControllerStatus& status) {
  { board.read_verdict(verdict) } -> std::same_as<Status>;
  { board.read_operator(command) } -> std::same_as<Status>;
  { board.write_status(status) } -> std::same_as<Status>;
};

// Messages that came in and were not used, since the start.
struct LinkCounters {
  std::int64_t malformed = 0;     // wrong size, wrong type or a value outside its range
  std::int64_t repeated = 0;      // a tick that had come before, or a command that was handed out before
  std::int64_t out_of_order = 0;  // any other tick than the next
  std::int64_t foreign = 0;       // of another scenario or another run
  std::int64_t old = 0;           // commands older than their sender's newest, or of a tick still to come
  std::int64_t dropped = 0;       // commands cancelled by a stop, or without a free place
  std::int64_t taken_back = 0;    // verdicts that take back a trip; they are used as if they did not
  LinkCounters& operator+=(const LinkCounters& more) {
    malformed += more.malformed;
    repeated += more.repeated;
    out_of_order += more.out_of_order;
    foreign += more.foreign;
    old += more.old;
    dropped += more.dropped;
    taken_back += more.taken_back;
    return *this;
  }
  [[nodiscard]] std::int64_t refused() const { return malformed + repeated + out_of_order + foreign + old + dropped; }
};

}  // namespace ballast::hal
