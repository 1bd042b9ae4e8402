// Longest control ticks of a robot, by what the tick does. worst_tick_main.cpp measures them on the board.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "tests/firmware/whole_tick.h"
#include "tests/target/unit_ball.h"

namespace ballast::hal::test {

struct WorstTicks {
  std::uint32_t masses = 0;
  // Counts of the machine's counter.
  std::uint32_t run = 0;   // arm, start, motion
  std::uint32_t stop = 0;  // its request, and all ticks until it is over and predicted
  std::uint32_t move = 0;  // its request, and all ticks until it is over
  // So that the measurement proves what it says.
  std::uint32_t predicted_stops = 0, predicted_moves = 0;
  std::uint32_t pulses = 0;
};

inline constexpr std::array<int, 3> kWorstTickMasses{1, 3, 8};
inline constexpr std::array<int, 6> kStopTicks{0, 30, 99, 150, 199, 700};  // after the start
inline constexpr std::size_t kWorstTickBytes = std::size_t{4} * 7 * kWorstTickMasses.size();

template <class A, class M>
void worst_tick_fields(A& archive, M& m) {
  for (auto& w : m) {
    for (auto* field : {&w.masses, &w.run, &w.stop, &w.move, &w.predicted_stops, &w.predicted_moves, &w.pulses}) {
      archive(*field);
    }
  }
}

// The paper's ball and motion with so many masses, 3200 microsteps a turn.
inline void paper_robot(int masses, firmware::ControllerParams& params) {
  constexpr firmware::Wide kPi = 3.14159265358979323846;
  constexpr std::array<firmware::Wide, 3> kRadius{0.95, 0.9, 0.85}, kAzimuth{0, kPi / 2, kPi / 4},
      kElevation{0, 0, kPi / 4};
  constexpr std::array<firmware::ProfilePiece, 2> kMotion{{{0.1, 1, 1}, {0.1, 1, 0}}};
  params.control_period_s = 1e-3;
  params.timer_frequency_hz = 1e7;
  firmware::BallParams& ball = unit_ball(masses, params);
  for (std::size_t i = 0; i < static_cast<std::size_t>(masses); ++i) {
    const std::size_t k = i % kRadius.size();
    ball.mass_kg[i] = static_cast<firmware::Real>(3) / static_cast<firmware::Real>(masses);
    ball.rail[i] =
        firmware::circle_about(static_cast<firmware::Real>(kRadius[k]), static_cast<firmware::Real>(kAzimuth[k]),
                               static_cast<firmware::Real>(kElevation[k]));
    params.motor[i] = {3200 / (2 * kPi), 5000, 2, 20, 2e-6};
    static_cast<void>(params.motion[i].set(0, 0, kMotion.data(), static_cast<int>(kMotion.size())));
  }
}

// Serves ticks of one robot and keeps the longest of each kind.
template <class Counter>
class TickMeter {
 public:
  TickMeter(Counter counter, const firmware::ControllerParams& params, firmware::ControllerState& state,
            firmware::Inputs& inputs, firmware::Outputs& outputs, WorstTicks& worst)
      : counter_(counter), params_(params), state_(state), inputs_(inputs), outputs_(outputs), worst_(worst) {}

  void begin() {
    firmware::reset(params_, state_);
    inputs_ = {};
    // Askew and turning, so that no product is 0.
    inputs_.sensors.orientation = firmware::Quaternion(firmware::Real(0.8), 0, firmware::Real(0.6), 0);
    inputs_.sensors.gyro_B_radps = firmware::Vector3(firmware::Real(0.25), firmware::Real(0.5), firmware::Real(-0.125));
    tick(firmware::OperatorCommand::kArm, worst_.run);
  }
  void tick(const firmware::OperatorInput& command, std::uint32_t& worst) {
    ++inputs_.tick;
    inputs_.sensors.tick = inputs_.monitor.tick = inputs_.tick;
    inputs_.operator_command = command;
    const std::uint32_t began = counter_();
    firmware::whole_tick(params_, state_, inputs_, outputs_);
    worst = std::max(worst, counter_() - began);
    for (int b = 0; b < outputs_.steps.burst_count; ++b) {
      worst_.pulses += static_cast<std::uint32_t>(outputs_.steps.bursts[static_cast<std::size_t>(b)].count);
    }
  }
  // Until the masses rest and the plan is predicted; false: that takes too long.
  bool finish(std::uint32_t& worst) {
    for (int k = 0; k < 5000; ++k) {
      if (state_.mode == firmware::Mode::kArmed && state_.planned) return true;
      tick(firmware::OperatorCommand::kNone, worst);
    }
    return false;
  }

 private:
  Counter counter_;
  const firmware::ControllerParams& params_;
  firmware::ControllerState& state_;
  firmware::Inputs& inputs_;
  firmware::Outputs& outputs_;
  WorstTicks& worst_;
};

// False: the parameters are refused, or a stop or move does not end.
template <class Counter>
bool measure_worst_ticks(int masses, Counter counter, firmware::ControllerParams& params,
                         firmware::ControllerState& state, firmware::Inputs& inputs, firmware::Outputs& outputs,
                         WorstTicks& worst) {
  using firmware::OperatorCommand;
  paper_robot(masses, params);
  if (!firmware::validate(params).ok()) return false;
  worst = {};
  worst.masses = static_cast<std::uint32_t>(masses);
  TickMeter<Counter> meter(counter, params, state, inputs, outputs, worst);
  for (const int ticks : kStopTicks) {
    meter.begin();
    meter.tick(OperatorCommand::kStart, worst.run);
    for (int k = 0; k < ticks; ++k) meter.tick(OperatorCommand::kNone, worst.run);
    meter.tick(OperatorCommand::kStop, worst.stop);
    if (!meter.finish(worst.stop)) return false;
    ++worst.predicted_stops;
  }
  firmware::MoveRequest move;
  move.masses = (1u << masses) - 1;
  for (std::size_t i = 0; i < static_cast<std::size_t>(masses); ++i) {
    // Different ways: no two masses have their pieces' borders together.
    move.target_position[i] = 0.5 + 0.25 * static_cast<firmware::Wide>(i);
  }
  meter.begin();
  meter.tick(move, worst.move);
  if (!meter.finish(worst.move)) return false;
  ++worst.predicted_moves;
  return true;
}

}  // namespace ballast::hal::test
