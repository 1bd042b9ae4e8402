// The controller on a board: the firmware's tick, once per control tick.
#pragma once

#include "firmware/control/controller.h"
#include "hal/board.h"

namespace ballast::hal {

// `params` must have been accepted by firmware::validate(); both references must outlive the loop.
template <Board B>
class ControlLoop {
 public:
  ControlLoop(const firmware::ControllerParams& params, B& board) : params_(params), board_(board) {
    firmware::reset(params_, state_);
  }

  // Waits for one tick and serves it. Anything but kOk: no tick was served to its end, and the reason.
  Status step() {
    if (const Status status = board_.wait_tick(inputs_.tick); status != Status::kOk) return status;

    // An input that did not arrive keeps its last value and its old tick. The firmware judges staleness.
    if (const Status status = board_.read_sensors(inputs_.sensors); failed(status)) return status;
    if (const Status status = board_.read_verdict(inputs_.monitor); failed(status)) return status;
    inputs_.operator_command = firmware::OperatorInput();
    if (const Status status = board_.read_operator(inputs_.operator_command); failed(status)) return status;

    // Steps first: what takes longer than deciding on them comes after they are on their way.
    firmware::tick(params_, state_, inputs_, steps_);
    if (const Status status = board_.write_steps(steps_); status != Status::kOk) return status;

    firmware::predict(params_, state_);
    firmware::measure(params_, inputs_, state_);
    firmware::report(params_, state_, inputs_, status_);
    status_.overruns = board_.overruns();
    if (const Status status = board_.write_status(status_); status != Status::kOk) return status;
    board_.kick_watchdog();
    return Status::kOk;
  }

  // Serves ticks until there are no more, and says why.
  Status run() {
    for (;;) {
      if (const Status status = step(); status != Status::kOk) return status;
    }
  }

  [[nodiscard]] const firmware::ControllerState& state() const { return state_; }

 private:
  static bool failed(Status status) { return status != Status::kOk && status != Status::kEmpty; }

  const firmware::ControllerParams& params_;
  B& board_;
  firmware::ControllerState state_;
  firmware::Inputs inputs_;
  firmware::StepCommand steps_;
  firmware::ControllerStatus status_;
};

}  // namespace ballast::hal
