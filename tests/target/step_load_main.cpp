// Measures the processor's load by steps besides their interrupt: the step generator by itself,
// and 50 kHz on one motor and on three beside the whole controller tick, with nothing at the other end of the link.
#include <algorithm>
#include <cmath>

#include "firmware/control/controller.h"
#include "firmware/motion/step_generator.h"
#include "hal/mps2/machine.h"
#include "hal/mps2/startup.h"
#include "tests/firmware/whole_tick.h"
#include "tests/target/step_load.h"
#include "tests/target/unit_ball.h"

using namespace ballast;
using namespace ballast::hal;
using mps2::the_machine;

namespace {

constexpr firmware::Wide kPeriod_s = 1e-3, kTimer_hz = 1e7;

// As StepTickConstant and StepTickSCurve of tools/benchmarks/step_benchmark.cpp.
void measure_generator(test::GeneratorLoad& load) {
  static firmware::Profile profile;
  static firmware::StepCommand command;
  constexpr std::uint32_t kStrokes = 4;
  firmware::Wide microsteps_per_unit = 1000 * static_cast<firmware::Wide>(load.steps_per_tick);
  load.ticks = 1000;
  if (load.steps_per_tick == 0) {
    std::array<firmware::ProfilePiece, 2 * kStrokes> pieces;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      const firmware::Wide a = (i / 2) % 2 == 0 ? 2 : -2;  // from -1 to 1 rail unit/s in 2 s, and back
      pieces[i] = i % 2 == 0 ? firmware::ProfilePiece{1, 0, a} : firmware::ProfilePiece{1, a, 0};
    }
    static_cast<void>(profile.set(0, -1, pieces.data(), static_cast<int>(pieces.size())));
    microsteps_per_unit = 20000 / 0.625;
    load.ticks = 2 * kStrokes * 1000;
  } else {
    static_cast<void>(profile.set(0, 1, nullptr, 0));
  }
  command = {};
  const firmware::StepTiming timing{kTimer_hz, kPeriod_s, 2e-6};
  const std::uint32_t began = the_machine.counter();
  for (std::uint32_t tick = 0; tick < load.ticks; ++tick) {
    command.tick = tick;
    command.burst_count = 0;
    command.steps = {};
    if (firmware::generate_steps(profile, static_cast<firmware::Wide>(tick) * kPeriod_s, 0, microsteps_per_unit, 62000,
                                 timing, 0, command) != firmware::StepError::kNone) {
      load.pulses = 0;
      return;
    }
    load.pulses += static_cast<std::uint32_t>(std::abs(command.steps[0]));
  }
  load.counts = the_machine.counter() - began;
}

firmware::ControllerParams params;
firmware::ControllerState state;
firmware::Inputs inputs;
firmware::Outputs outputs;

// The paper's ball with so many of its masses, each at constant speed.
void prepare(const test::TogetherLoad& load) {
  const auto motors = static_cast<int>(load.motors);
  params.control_period_s = load.period_us * 1e-6;
  params.timer_frequency_hz = kTimer_hz;
  firmware::BallParams& ball = test::unit_ball(motors, params);
  constexpr firmware::Wide kPi = 3.14159265358979323846;
  constexpr firmware::Wide kRadius[] = {0.95, 0.9, 0.85}, kAzimuth[] = {0, kPi / 2, kPi / 4},
                           kElevation[] = {0, 0, kPi / 4};
  for (std::size_t i = 0; i < static_cast<std::size_t>(motors); ++i) {
    ball.mass_kg[i] = 1;
    ball.rail[i] =
        firmware::circle_about(static_cast<firmware::Real>(kRadius[i]), static_cast<firmware::Real>(kAzimuth[i]),
                               static_cast<firmware::Real>(kElevation[i]));
    const firmware::Wide rate_hz = load.steps_per_tick / params.control_period_s;  // 1 rad/s
    params.motor[i] = {rate_hz, 1.05 * rate_hz, 2, 20, 2e-6};
    static_cast<void>(params.motion[i].set(0, 1, nullptr, 0));
  }
}

// Turns until the next control tick; a tick that is due already is late.
std::uint32_t idle(std::uint32_t& late_ticks) {
  std::uint32_t turns = 0;
  const bool late = the_machine.tick_due();
  while (!the_machine.tick_due()) {
    asm volatile("" : "+r"(turns));
    ++turns;
  }
  const std::uint32_t begun = the_machine.wait_tick();
  late_ticks += late ? begun : begun - 1;
  return turns;
}

enum class What { kIdle, kTick, kPulses, kLateness };

// Turns of kLoadTicks control ticks in which the motion is under way.
std::uint32_t measure(What what, test::TogetherLoad& load) {
  if (!the_machine.start(params, {.stretch = 1, .play = what == What::kPulses || what == What::kLateness})) return 0;
  firmware::reset(params, state);
  static target::PlayedPulses played;
  std::uint32_t turns = 0, commanded = 0, given = 0;
  idle(load.late_ticks);
  load.late_ticks = 0;
  for (std::uint32_t k = 0; k < test::kLoadTicks + 4; ++k) {
    const std::uint32_t waited = idle(load.late_ticks);
    if (k == 4) given = the_machine.pulses_given();
    if (k >= 4) turns += waited;
    the_machine.kick_watchdog();
    if (what == What::kIdle) continue;
    inputs.tick = inputs.sensors.tick = inputs.monitor.tick = k;
    inputs.operator_command = k == 0   ? firmware::OperatorCommand::kArm
                              : k == 1 ? firmware::OperatorCommand::kStart
                                       : firmware::OperatorCommand::kNone;
    firmware::whole_tick(params, state, inputs, outputs);
    the_machine.load(outputs.steps);
    // Those of this tick are given in the next, and counted at the beginning of the one after that.
    if (k >= 2 && k < test::kLoadTicks + 2) {
      for (std::size_t i = 0; i < load.motors; ++i) {
        commanded += static_cast<std::uint32_t>(std::abs(outputs.steps.steps[i]));
      }
    }
    if (what == What::kLateness) {
      the_machine.played(played);
      for (std::size_t i = 0; i < static_cast<std::size_t>(played.count); ++i) {
        load.late_counts = std::max<std::uint32_t>(load.late_counts, played.pulse[i].late_counts);
      }
    }
  }
  idle(load.late_ticks);
  if (what == What::kPulses) {
    load.commanded = commanded;
    load.given = the_machine.pulses_given() - given;
    load.faults = state.mode == firmware::Mode::kRunning ? state.faults : ~0u;
  }
  return turns;
}

}  // namespace

int main() {
  if (!the_machine.open_link()) return static_cast<int>(mps2::Exit::kNoLink);
  static test::StepLoad load;
  constexpr std::uint32_t kStepsPerTick[] = {1, 5, 20, 60, 0};
  for (std::size_t i = 0; i < load.generator.size(); ++i) {
    load.generator[i].steps_per_tick = kStepsPerTick[i];
    measure_generator(load.generator[i]);
  }
  for (std::size_t i = 0; i < load.together.size(); ++i) {
    test::TogetherLoad& together = load.together[i];
    // 50 kHz each. The bursts of three motors surely carry 28 steps a tick, so theirs is half as long.
    together.motors = i == 0 ? 1 : 3;
    together.period_us = i == 0 ? 1000 : 500;
    together.steps_per_tick = together.period_us / 20;
    prepare(together);
    if (!firmware::validate(params).ok()) return static_cast<int>(mps2::Exit::kRefused);
    together.turns_idle = measure(What::kIdle, together);
    together.turns_tick = measure(What::kTick, together);
    together.turns_pulses = measure(What::kPulses, together);
    const std::uint32_t late_ticks = together.late_ticks;
    measure(What::kLateness, together);
    together.late_ticks = late_ticks;
  }
  static std::array<std::uint8_t, test::kStepLoadBytes> bytes;
  target::Writer writer(bytes);
  test::step_load_fields(writer, load);
  return the_machine.write(bytes) == Status::kOk ? 0 : static_cast<int>(mps2::Exit::kLinkCut);
}
