// Controller and world in one process: plain mailboxes, no threads, no allocation, no wall clock.
#pragma once

#include <cstdint>

#include "hal/board.h"
#include "hal/operator_queue.h"

namespace ballast::hal {

// The world fills the mailboxes, releases a tick, lets ControlLoop::step() serve it and takes what came out. A mailbox
// left empty is a message that did not come. With no tick released wait_tick() returns kEmpty at once.
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
  // Queued; kIo: the queue is full and the command was not taken.
  Status give_operator(const firmware::OperatorInput& command) {
    const bool taken = commands_.push(command, command.command == firmware::OperatorCommand::kStop);
    return taken ? Status::kOk : Status::kIo;
  }
  // Makes a tick due. The first may have any number; later ones must be the next one, others are counted and ignored.
  // `last`: once it is served wait_tick() returns kEnded.
  void release_tick(std::int64_t tick, bool last = false) {
    if (ticked_ && tick == tick_) {
      ++counters_.repeated;
    } else if (ticked_ && tick != tick_ + 1) {
      ++counters_.out_of_order;
    } else {
      ticked_ = true;
      due_ = true;
      tick_ = tick;
      last_ = last;
    }
  }
  Status take_steps(firmware::StepCommand& steps) {
    if (!has_steps_) return Status::kEmpty;
    steps = steps_;
    has_steps_ = false;
    return Status::kOk;
  }
  Status take_status(firmware::ControllerStatus& status) {
    if (!has_status_) return Status::kEmpty;
    status = status_;
    has_status_ = false;
    return Status::kOk;
  }
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
    tick = tick_;
    return Status::kOk;
  }
  [[nodiscard]] std::int64_t overruns() const { return 0; }
  Status read_sensors(firmware::Sensors& sensors) {
    if (!has_sensors_) return Status::kEmpty;
    sensors = sensors_;
    has_sensors_ = false;
    return Status::kOk;
  }
  Status read_verdict(firmware::MonitorVerdict& verdict) {
    if (!has_verdict_) return Status::kEmpty;
    verdict = verdict_;
    has_verdict_ = false;
    return Status::kOk;
  }
  Status read_operator(firmware::OperatorInput& command) {
    if (commands_.front() == nullptr) return Status::kEmpty;
    command = *commands_.front();
    commands_.pop();
    return Status::kOk;
  }
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

  std::int64_t tick_ = 0;
  bool ticked_ = false;  // a tick has been released
  bool due_ = false;     // and not yet served
  bool last_ = false;    // and it is the last one
  LinkCounters counters_;
  std::int64_t watchdog_kicks_ = 0;
};

static_assert(Board<LockstepBoard>);

}  // namespace ballast::hal
