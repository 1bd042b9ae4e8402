// The friction that motors add to what a motion needs: where their full steps come at a resonance, and how the need
// changes with a property of the motors. Each change is rolled: firmware, motors and ball, on a floor that
// holds whatever is needed.
#pragma once

#include <csignal>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast {

// A speed within this part of a resonant one is near it.
inline constexpr double kNearResonance = 0.3;

struct Interval {
  double start_s, end_s;
};

// One motor's resonances, and when the motion comes near them.
struct MotorResonance {
  std::size_t mass = 0;
  double swing_hz = 0;  // of rotor and mass about the field
  double damping_ratio = 0;
  double rail_speed = 0;       // at which the full steps come at swing_hz; at twice that speed, at twice swing_hz
  double microsteps_hz = 0;    // step rate at rail_speed
  double greatest_speed = 0;   // of the motion
  std::vector<Interval> near;  // either resonance
};
[[nodiscard]] std::vector<MotorResonance> resonances(const sim::Scenario& scenario);

// A run with its motors.
struct Figures {
  double need = 0;  // greatest f_s/N; infinite where the ball leaves the floor
  double need_time_s = 0;
  double commanded = 0;  // greatest f_s/N of the commanded motion
  double share = 0;      // greatest difference of f_s/N between real and commanded motion
  double near = 0;       // greatest f_s/N while a motor is near a resonance, and at other times
  double away = 0;
  double least_normal_n = 0;
  bool completed = false;
  std::string end;  // why it ended
};

// A change of the motors and what it does.
struct Change {
  std::string what;                 // in words
  std::vector<std::string> sets{};  // the keys, as for --set
  std::optional<Figures> figures{};
  std::string refusal{};  // without figures: why it is not possible
  std::string key{};      // in [mass.motor]; empty: several keys
  bool buyable = true;    // false: no shop sells it, such as a motor without detent torque
};

struct Tuning {
  std::vector<MotorResonance> resonances;
  Figures now;
  std::vector<Change> microsteps;  // coarsest first, the present one among them
  std::vector<Change> others;      // most helpful first
  std::optional<Change> together;  // all changes that help
  bool complete = true;            // false: a signal ended it
};

// `progress` is called before each run. Without a value `refusal` says why the scenario cannot be run with its motors.
[[nodiscard]] std::optional<Tuning> tune(const sim::Scenario& scenario, const volatile std::sig_atomic_t* signalled,
                                         const std::function<void(const std::string& what)>& progress,
                                         std::string& refusal);

}  // namespace ballast
