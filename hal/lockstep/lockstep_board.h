// Controller and world in one process: plain mailboxes without threads, allocation or a wall clock.
#pragma once

#include <cstdint>

#include "hal/board.h"
#include "hal/board_parts.h"
#include "hal/operator_queue.h"

namespace ballast::hal {

// The world fills the mailboxes, releases a tick, lets ControlLoop::step() serve it and takes the outputs. An empty
// mailbox stands for a message that did not come. While no tick is released, wait_tick() returns kEmpty at once.
class LockstepBoard {
 public:
  // --- the world's side ---
  void give_sensors(const firmware::Sensors& sensors) {
    sensors_ = sensors;
    has_sensors_ = true;
  }
  void give_verdict(const firmware::MonitorVerdict& verdict) {
    verdict_ = verdict;
    has_verdict_ = true;
  }
  // kIo: the queue is full and the command was refused.
  Status give_operator(const firmware::OperatorInput& command) {
    const bool taken = commands_.push(command, command.command == firmware::OperatorCommand::kStop);
    return taken ? Status::kOk : Status::kIo;
  }
  // Makes a tick due if it is the first or the next one; any other is counted and ignored. `last`: once it is served,
  // wait_tick() returns kEnded.
  void release_tick(std::int64_t tick, bool last = false) {
    if (!order_.is_next(tick, counters_)) return;
    order_.begin(tick);
    due_ = true;
    last_ = last;
  }
  Status take_steps(firmware::StepCommand& steps) { return hand_out(has_steps_, steps_, steps); }
  Status take_status(firmware::ControllerStatus& status) { return hand_out(has_status_, status_, status); }
  [[nodiscard]] LinkCounters counters() const {
    LinkCounters counters = counters_;
    counters.dropped = commands_.dropped();
    return counters;
  }
  [[nodiscard]] std::int64_t watchdog_kicks() const { return watchdog_kicks_; }

  // --- the controller's side: hal/board.h ---
  Status wait_tick(std::int64_t& tick) {
    if (!due_) return last_ ? Status::kEnded : Status::kEmpty;
    due_ = false;
    tick = order_.newest();
    return Status::kOk;
  }
  [[nodiscard]] std::int64_t overruns() const { return 0; }
  Status read_sensors(firmware::Sensors& sensors) { return hand_out(has_sensors_, sensors_, sensors); }
  Status read_verdict(firmware::MonitorVerdict& verdict) { return hand_out(has_verdict_, verdict_, verdict); }
  Status read_operator(firmware::OperatorInput& command) { return commands_.take(command); }
  Status write_steps(const firmware::StepCommand& steps) {
    steps_ = steps;
    has_steps_ = true;
    return Status::kOk;
  }
  Status write_status(const firmware::ControllerStatus& status) {
    status_ = status;
    has_status_ = true;
    return Status::kOk;
  }
  void kick_watchdog() { ++watchdog_kicks_; }

 private:
  firmware::Sensors sensors_;
  firmware::MonitorVerdict verdict_;
  OperatorQueue<firmware::OperatorInput, 8> commands_;
  firmware::StepCommand steps_;
  firmware::ControllerStatus status_;
  bool has_sensors_ = false, has_verdict_ = false, has_steps_ = false, has_status_ = false;

  TickOrder order_;    // of the ticks released
  bool due_ = false;   // the newest is not yet served
  bool last_ = false;  // it is the last one
  LinkCounters counters_;
  std::int64_t watchdog_kicks_ = 0;
};

static_assert(Board<LockstepBoard>);

}  // namespace ballast::hal
