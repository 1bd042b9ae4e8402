// Robots whose motions run out of bursts, and what overload_main.cpp writes to the link about them. The same on the
// host: nothing here depends on the machine.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "tests/target/unit_ball.h"
#include "tests/firmware/whole_tick.h"

namespace ballast::hal::test {

struct OverloadRobot {
  int motors;
  firmware::Wide timer_hz;
  int fastest_ticks, slowest_ticks;  // from the step rate to rest, at the greatest acceleration
};
inline constexpr std::array<OverloadRobot, 4> kOverloadRobots{
    {{8, 1e6, 5, 200}, {8, 1e6, 3, 6}, {3, 1e6, 3, 6}, {8, 1e7, 3, 6}}};
inline constexpr std::uint32_t kOverloadMotions = 12;  // per robot
inline constexpr std::int64_t kOverloadTicks = 400;    // of 1 ms, per motion, from its start

// Of one robot's motions together.
struct OverloadLoad {
  std::uint32_t overloads = 0, rested = 0;  // motions that ended so
  std::uint32_t counts_overload = 0;        // of the machine's counter, the longest tick that found an overload
  std::uint32_t counts_stop = 0;            // and of the stop after it
  std::uint32_t counts_before = 0;          // and before it
  std::uint32_t checksum = 0;               // of all the pulses and statuses' modes
};
inline constexpr std::size_t kOverloadBytes = kOverloadRobots.size() * 6 * 4;

template <class A, class M>
void overload_fields(A& archive, M& loads) {
  for (auto& m : loads) {
    for (auto* field : {&m.overloads, &m.rested, &m.counts_overload, &m.counts_stop, &m.counts_before, &m.checksum}) {
      archive(*field);
    }
  }
}

// splitmix64: the standard library's distributions differ between implementations.
class OverloadRandom {
 public:
  explicit OverloadRandom(std::uint64_t seed) : state_(seed) {}
  firmware::Wide between(firmware::Wide low, firmware::Wide high) {
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    z ^= z >> 31;
    return low + (high - low) * (static_cast<firmware::Wide>(z >> 11) * 0x1p-53);
  }

 private:
  std::uint64_t state_;
};

// Jerk-limited motions of all motors at once, up to 60 steps a tick, on circles.
inline void overload_params(const OverloadRobot& robot, OverloadRandom& random, firmware::ControllerParams& params) {
  using firmware::Wide;
  constexpr Wide kPeriod_s = 1e-3, kPi = 3.14159265358979323846;
  params.control_period_s = kPeriod_s;
  params.timer_frequency_hz = robot.timer_hz;
  firmware::BallParams& ball = unit_ball(robot.motors, params);
  for (std::size_t i = 0; i < static_cast<std::size_t>(robot.motors); ++i) {
    ball.mass_kg[i] = firmware::Real(0.3);
    ball.rail[i] =
        firmware::circle_about(firmware::Real(0.95), static_cast<firmware::Real>(static_cast<Wide>(i % 3) * kPi / 4),
                               static_cast<firmware::Real>(static_cast<Wide>(i % 2) * kPi / 4));
    const Wide rate_hz = 60 / kPeriod_s, top = rate_hz / 3200;
    const Wide ticks = random.between(robot.fastest_ticks, robot.slowest_ticks);
    const Wide most = top / (kPeriod_s * ticks);
    // The acceleration itself comes and goes in a fifth of that time.
    params.motor[i] = {i % 2 == 0 ? 3200.0 : -3200.0, rate_hz, most, 5 * most * most / top, 2e-6};
    std::array<firmware::ProfilePiece, 40> pieces;
    int count = 0;
    Wide v = 0;
    while (count + 4 <= static_cast<int>(pieces.size())) {
      const Wide to = 0.999 * top * random.between(-1, 1);
      Wide a = most * random.between(0.1, 0.999) * (to > v ? 1 : -1);
      const Wide jerk = params.motor[i].max_jerk;
      if (std::fabs(to - v) < a * a / jerk) a = std::copysign(0.999 * std::sqrt(std::fabs(to - v) * jerk), a);
      const Wide ramp = 1.001 * std::fabs(a) / jerk, flat = std::fmax((to - v) / a - ramp, 0);
      const auto add = [&](const firmware::ProfilePiece& piece) { pieces[static_cast<std::size_t>(count++)] = piece; };
      add({ramp, 0, a});
      if (flat > 0) add({flat, a, a});
      add({ramp, a, 0});
      v += a * (ramp + flat);
      add({kPeriod_s * random.between(0.1, 20), 0, 0});
    }
    static_cast<void>(params.motion[i].set(random.between(-3, 3), 0, pieces.data(), count));
  }
}

// Runs the robot's motions, each to its overload and the end of the stop after it. `counter` counts what ticks take.
template <class Counter>
bool measure_overloads(const OverloadRobot& robot, Counter counter, firmware::ControllerParams& params,
                       firmware::ControllerState& state, firmware::Inputs& inputs, firmware::Outputs& outputs,
                       OverloadLoad& load) {
  using firmware::OperatorCommand;
  OverloadRandom random(20261122);
  const auto sum = [&load](std::uint32_t value) { load.checksum = load.checksum * 1664525u + 1013904223u + value; };
  for (std::uint32_t motion = 0; motion < kOverloadMotions; ++motion) {
    overload_params(robot, random, params);
    if (!firmware::validate(params).ok()) return false;
    firmware::reset(params, state);
    bool overloaded = false;
    for (std::int64_t k = 0; k < (overloaded ? 2 : 1) * kOverloadTicks; ++k) {
      inputs.tick = inputs.sensors.tick = inputs.monitor.tick = k;
      inputs.operator_command = k == 0   ? OperatorCommand::kArm
                                : k == 1 ? OperatorCommand::kStart
                                         : OperatorCommand::kNone;
      const std::uint32_t began = counter();
      firmware::whole_tick(params, state, inputs, outputs);
      const std::uint32_t took = counter() - began;
      const bool now = (state.faults & static_cast<std::uint32_t>(firmware::Fault::kStepOverload)) != 0;
      std::uint32_t& most = now ? (overloaded ? load.counts_stop : load.counts_overload) : load.counts_before;
      if (took > most) most = took;
      load.overloads += now && !overloaded;
      overloaded = now;
      sum(static_cast<std::uint32_t>(state.mode));
      for (int b = 0; b < outputs.steps.burst_count; ++b) {
        const firmware::StepBurst& burst = outputs.steps.bursts[static_cast<std::size_t>(b)];
        for (const std::int32_t value :
             {std::int32_t{burst.motor}, std::int32_t{burst.direction}, std::int32_t{burst.count}, burst.first_ticks,
              burst.interval_ticks, burst.add_ticks}) {
          sum(static_cast<std::uint32_t>(value));
        }
      }
      if (now && !state.moving) {
        load.rested += 1;
        break;
      }
    }
  }
  return true;
}

}  // namespace ballast::hal::test
