// Measures the cost of step pulses: the loop that waits for control ticks counts its turns, once with pulses and once
// without; what it misses went into them. Interrupts, their entry code, loading the commands and keeping the record of
// what was given are all in it. Written to the link, per case: u32 motors, u32 offset of a motor's pulses to the next
// motor's, pulses commanded and given, turns without and with them, the most a pulse was late in counts. As many turns
// as there are without pulses take kTicks control ticks.
#include "hal/mps2/machine.h"
#include "hal/mps2/startup.h"

using namespace ballast;
using namespace ballast::hal;
using mps2::the_machine;

namespace {

constexpr int kTicks = 100;
constexpr int kStepsPerTick = 50;    // 50 kHz at 1 kHz
constexpr int kIntervalTicks = 200;  // of 10 MHz

// Turns until the next control tick.
std::uint32_t idle() {
  std::uint32_t turns = 0;
  while (!the_machine.tick_due()) {
    asm volatile("" : "+r"(turns));
    ++turns;
  }
  static_cast<void>(the_machine.wait_tick());
  return turns;
}

struct Measurement {
  std::uint32_t pulses, turns;
};

Measurement measure(const firmware::StepCommand& command) {
  the_machine.load(command);
  idle();
  Measurement m{the_machine.pulses_given(), 0};
  for (int tick = 0; tick < kTicks; ++tick) {
    the_machine.load(command);
    the_machine.kick_watchdog();
    m.turns += idle();
  }
  m.pulses = the_machine.pulses_given() - m.pulses;
  return m;
}

}  // namespace

int main() {
  if (!the_machine.open_link()) return static_cast<int>(mps2::Exit::kNoLink);
  static firmware::ControllerParams params;
  params.control_period_s = 0.001;
  params.timer_frequency_hz = 1e7;
  if (!the_machine.start(params, {})) return static_cast<int>(mps2::Exit::kRefused);
  static firmware::StepCommand command;
  idle();
  const Measurement none = measure(command);
  for (const auto& [motors, offset] : {std::pair{1, 0}, std::pair{3, 0}, std::pair{3, 67}}) {
    command.motor_count = command.burst_count = motors;
    for (int i = 0; i < motors; ++i) {
      command.bursts[static_cast<std::size_t>(i)] = {.motor = static_cast<std::uint8_t>(i),
                                                     .direction = 1,
                                                     .count = kStepsPerTick,
                                                     .first_ticks = 10 + i * offset,
                                                     .interval_ticks = kIntervalTicks};
    }
    const Measurement some = measure(command);
    std::uint32_t late = 0;  // in the last control tick
    static target::PlayedPulses played;
    the_machine.played(played);
    for (std::size_t i = 0; i < static_cast<std::size_t>(played.count); ++i) {
      late = std::max<std::uint32_t>(late, played.pulse[i].late_counts);
    }
    std::uint8_t bytes[28];
    target::Writer writer(bytes);
    writer(static_cast<std::uint32_t>(motors));
    writer(static_cast<std::uint32_t>(offset));
    writer(static_cast<std::uint32_t>(kTicks * kStepsPerTick * motors));
    writer(some.pulses);
    writer(none.turns);
    writer(some.turns);
    writer(late);
    if (the_machine.write(bytes) != Status::kOk) return static_cast<int>(mps2::Exit::kLinkCut);
  }
  return 0;
}
