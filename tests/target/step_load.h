// The record that step_load_main.cpp writes to the link.
#pragma once

#include <array>
#include <cstdint>

namespace ballast::hal::test {

// The step generator by itself, one motor.
struct GeneratorLoad {
  std::uint32_t steps_per_tick = 0;  // constant; 0: S-curves to and fro
  std::uint32_t ticks = 0;
  std::uint32_t pulses = 0;
  std::uint32_t counts = 0;  // of the machine's counter, the loop around it too
};

// The whole controller tick with the step interrupt.
struct TogetherLoad {
  std::uint32_t motors = 0;
  std::uint32_t period_us = 0;  // of the control tick
  std::uint32_t steps_per_tick = 0;
  std::uint32_t commanded = 0, given = 0;  // pulses
  std::uint32_t late_ticks = 0;            // control ticks that began before the one before was served
  std::uint32_t late_counts = 0;           // the most a pulse was late
  std::uint32_t faults = 0;                // of the controller, in the end; all ones: it was not running
  // Turns of the loop that waits for the control tick: with nothing to do, with the controller's tick, and with that
  // and the pulses. As many turns as there are in the first take all the time.
  std::uint32_t turns_idle = 0, turns_tick = 0, turns_pulses = 0;
};

inline constexpr std::uint32_t kLoadTicks = 100;  // counted in TogetherLoad

struct StepLoad {
  std::array<GeneratorLoad, 5> generator;
  std::array<TogetherLoad, 2> together;
};
inline constexpr std::size_t kStepLoadBytes = std::size_t{4} * (5 * 4 + 2 * 11);

template <class A, class M>
void step_load_fields(A& archive, M& m) {
  for (auto& g : m.generator) {
    for (auto* field : {&g.steps_per_tick, &g.ticks, &g.pulses, &g.counts}) archive(*field);
  }
  for (auto& t : m.together) {
    for (auto* field : {&t.motors, &t.period_us, &t.steps_per_tick, &t.commanded, &t.given, &t.late_ticks,
                        &t.late_counts, &t.faults, &t.turns_idle, &t.turns_tick, &t.turns_pulses}) {
      archive(*field);
    }
  }
}

}  // namespace ballast::hal::test
