// 04: a board of one's own. hal/board.h lists what the controller needs from the world; a board is one class with these
// functions, and hal::ControlLoop runs the firmware on it. tools/docs/porting.md has the contract of each.
//
// This board has no hardware. Its comments say what a real one does. Prints:
//   2005 ticks, 102 pulses forward, 0 back, motor at 102, 2005 watchdog kicks
#include <cstdio>
#include <memory>

#include "hal/control_loop.h"
#include "one_mass.h"

using namespace ballast;

class OwnBoard {
 public:
  // --- hal::Clock ---
  // A real board sleeps here until its timer interrupts. This one is always due, until it has served enough.
  hal::Status wait_tick(std::int64_t& tick) {
    if (tick_ == kLastTick) return hal::Status::kEnded;
    tick = ++tick_;
    return hal::Status::kOk;
  }
  [[nodiscard]] std::int64_t overruns() const { return 0; }  // ticks that were late

  // --- hal::SensorSource ---
  // The IMU and the end switches. kEmpty would say that no sample came; the firmware judges how old the last one is.
  hal::Status read_sensors(firmware::Sensors& sensors) {
    sensors.tick = tick_;
    sensors.orientation = firmware::Quaternion::Identity();
    return hal::Status::kOk;
  }

  // --- hal::HostLink ---
  hal::Status read_verdict(firmware::MonitorVerdict& verdict) {
    verdict = {.tick = tick_, .tripped = false};
    return hal::Status::kOk;
  }
  hal::Status read_operator(firmware::OperatorInput& command) {
    if (tick_ == kFirstTick) command = firmware::OperatorCommand::kArm;
    if (tick_ == kFirstTick + 1) command = firmware::OperatorCommand::kStart;
    return hal::Status::kOk;
  }
  hal::Status write_status(const firmware::ControllerStatus& status) {
    status_ = status;
    return hal::Status::kOk;
  }

  // --- hal::StepOutput ---
  // The pulses of the next tick. A real board hands them to its step timer, which counts pulse_ticks() of each burst.
  hal::Status write_steps(const firmware::StepCommand& steps) {
    for (int b = 0; b < steps.burst_count; ++b) {
      const firmware::StepBurst& burst = steps.bursts[static_cast<std::size_t>(b)];
      for (int j = 0; j < burst.count; ++j) {
        const std::int64_t after = firmware::pulse_ticks(burst, j);  // timer ticks after the start of the control tick
        if (after < 0 || after >= 1000) return hal::Status::kIo;     // 1 ms of a 1 MHz timer
        ++(burst.direction > 0 ? forward_ : back_);
      }
    }
    return hal::Status::kOk;
  }

  // --- hal::Watchdog ---
  void kick_watchdog() { ++kicks_; }

  void print() const {
    std::printf("%lld ticks, %ld pulses forward, %ld back, motor at %lld, %ld watchdog kicks\n",
                static_cast<long long>(tick_ - kFirstTick + 1), forward_, back_,
                static_cast<long long>(status_.steps_issued[0]), kicks_);
  }

 private:
  static constexpr std::int64_t kFirstTick = -2, kLastTick = 2002;
  std::int64_t tick_ = kFirstTick - 1;
  firmware::ControllerStatus status_;
  long forward_ = 0, back_ = 0, kicks_ = 0;
};

static_assert(hal::Board<OwnBoard>);  // names the function that is missing

int main() {
  static const firmware::ControllerParams params = one_mass();
  if (!firmware::validate(params).ok()) return 1;
  static OwnBoard board;
  static hal::ControlLoop<OwnBoard> loop(params, board);
  const hal::Status status = loop.run();
  board.print();
  return status == hal::Status::kEnded ? 0 : 1;
}
