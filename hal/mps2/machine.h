// hal::target::Machine on these boards. There is one of each piece of hardware, so StepPins is static.
//
// on_tick() and on_step_timer() run in interrupts of the same priority; the control loop calls everything else.
#pragma once

#include "hal/mps2/board.h"
#include "hal/mps2/registers.h"
#include "hal/target/machine.h"
#include "hal/target/step_player.h"

namespace ballast::hal::mps2 {

struct StepPins {
  static std::uint32_t span() { return reload; }
  static std::uint32_t left() { return reg(kSysTickValue); }
  // The timer's reload value is its greatest, so an armed interrupt comes once.
  static void arm(std::uint32_t counts) {
    reg(kTimer0 + 0x0c) = 1;
    reg(kTimer0 + 4) = counts;
  }
  static void cancel() {
    reg(kTimer0 + 4) = 0xffffffff;
    if (reg(kTimer0 + 0x0c) == 0) return;  // it has not expired
    reg(kTimer0 + 0x0c) = 1;
    reg(kNvicClearPending) = 1u << kTimer0Irq;
  }
  static std::uint32_t pin(std::uint8_t motor) { return step_pin(motor); }
  static void step(std::uint32_t pin) { reg(kPins) = levels ^= pin; }
  static void turn(std::uint8_t motor, std::int8_t direction) {
    const std::uint32_t turn = direction_pin(motor);
    reg(kPins) = levels = direction > 0 ? levels & ~turn : levels | turn;
  }
  static inline std::uint32_t levels = 0;
  static inline std::uint32_t reload = 0;  // of the tick timer
};

class Machine {
 public:
  static constexpr const char* kName = mps2::kName;
  static constexpr std::uint32_t kCounterHz = kClockHz;

  // Opens the files of the link, which the first two words of the command line name: input, then output. False: failed.
  [[nodiscard]] bool open_link();

  Status read(std::span<std::uint8_t> bytes, std::size_t& count);
  Status write(std::span<const std::uint8_t> bytes);
  [[nodiscard]] bool start(const firmware::ControllerParams& params, const target::Commit& commit);
  std::uint32_t wait_tick();
  [[nodiscard]] bool tick_due() const { return ticks_begun_ != ticks_served_; }
  [[nodiscard]] std::uint32_t counter() const { return ~reg(kTimer1 + 4); }
  void load(const firmware::StepCommand& steps) {
    if (play_) player_.load(steps);
  }
  void played(target::PlayedPulses& pulses) const { player_.played(pulses); }
  [[nodiscard]] std::uint32_t pulses_given() const { return player_.given(); }  // up to the last control tick
  void kick_watchdog() { reg(kWatchdogBase + 0x0c) = 1; }
  void report(target::EndReport& end_report) const;

  // The interrupts.
  void on_tick() {
    ticks_begun_ = ticks_begun_ + 1;
    player_.begin_tick();
  }
  void on_step_timer() { player_.on_timer(); }

 private:
  // Members start as zero, so the object needs no place in flash.
  std::int32_t in_ = 0, out_ = 0;
  volatile std::uint32_t ticks_begun_ = 0;
  std::uint32_t ticks_served_ = 0;
  bool play_ = false;
  target::StepPlayer<StepPins> player_;
};

static_assert(target::Machine<Machine>);

extern Machine the_machine;

// The text after the first two words of the command line.
const char* command_line_rest();

}  // namespace ballast::hal::mps2
