#include "tools/ballast/motor_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "sim/motors/stepper.h"
#include "sim/plant/plant.h"
#include "tools/program/short_number.h"
#include "tools/tracking/followed_plan.h"

namespace ballast {
namespace {

using program::short_number;
using program::short_time;

constexpr double kMostLookedAt_s = 1000;
constexpr int kMostSamples = 20'000;

struct Worst {
  double margin = 1;  // part of the available torque left unused
  double time_s = 0, speed_radps = 0, load_nm = 0, drag_nm = 0, available_nm = 0;
};

double full_steps_hz(const sim::Motor& motor, double speed) {
  return motor.steps_per_revolution * std::abs(motor.shaft_ratio * speed) / (2 * std::numbers::pi);
}

std::string lack_of_torque(std::size_t mass, const Worst& worst) {
  return fmt::format(
      "mass.{}.motor: lacks torque at t = {} s: the load takes {} N m and drag {} N m at the shaft, and at {} rad/s "
      "the motor has {} N m; a stronger motor, another gear ratio, or a slower motion helps",
      mass, short_time(worst.time_s), short_number(std::abs(worst.load_nm)), short_number(std::abs(worst.drag_nm)),
      short_number(std::abs(worst.speed_radps)), short_number(worst.available_nm));
}

// "1.2, 3.4 s", or "1.2, 3.4, 5, 6 s and 7 more times".
std::string times_text(const std::vector<double>& times_s) {
  std::string times;
  const std::size_t shown = std::min<std::size_t>(times_s.size(), 4);
  for (std::size_t k = 0; k < shown; ++k) times += (k == 0 ? "" : ", ") + short_time(times_s[k]);
  times += " s";
  const std::size_t more = times_s.size() - shown;
  if (more > 0) times += fmt::format(" and {} more {}", more, more == 1 ? "time" : "times");
  return times;
}

// A resonance that one or several motors meet.
struct Resonance {
  std::string what, motors;
};

// The text of Resonance::what. `once`, `twice`: when the full steps come at the natural frequency and at twice that;
// not both are empty.
std::string resonance(const sim::Mass& mass, const std::vector<double>& once, const std::vector<double>& twice) {
  std::string passes;
  if (!once.empty()) passes = fmt::format("its full steps come at that rate at t = {}", times_text(once));
  if (!twice.empty()) {
    passes += once.empty() ? "its full steps come" : ", and";
    passes += " at twice that rate at t = " + times_text(twice);
  }
  return fmt::format(
      "passes a resonance: rotor and mass swing at {} Hz (damping ratio {}), and {}; finer microsteps, more "
      "viscous_damping, or passing through quickly helps",
      short_number(swing_hz(mass)), short_number(mass.damping_ratio()), passes);
}

// Where the rate of full steps passes `hz`.
class Passes {
 public:
  explicit Passes(double hz) : hz_(hz) {}
  void add(double time_s, double rate_hz) {
    const bool above = rate_hz > hz_;
    if (above_ && above != *above_) found.push_back(time_s);
    above_ = above;
  }
  std::vector<double> found;

 private:
  double hz_;
  std::optional<bool> above_;
};

}  // namespace

double swing_hz(const sim::Mass& mass) { return mass.swing_radps() / (2 * std::numbers::pi); }

MotorFindings check_motors(const sim::Scenario& scenario) {
  MotorFindings findings;
  sim::Scenario rolled = scenario;
  rolled.run.actuation = sim::Actuation::kPrescribed;
  rolled.faults.clear();
  const double end_s = std::min({scenario.duration_s, plan::motion_end_s(scenario) + 1, kMostLookedAt_s});
  const int samples = std::min(kMostSamples, static_cast<int>(std::ceil(end_s / scenario.run.control_period_s)));
  const std::size_t count = scenario.masses.size();
  std::vector<Worst> worst(count);
  std::vector<sim::Stepper> steppers;
  std::vector<std::array<Passes, 2>> passes;
  for (const sim::Mass& mass : scenario.masses) {
    steppers.emplace_back(mass.motor, 0, 0);
    passes.push_back({Passes(swing_hz(mass)), Passes(2 * swing_hz(mass))});
  }

  sim::Plant plant(rolled);
  for (int k = 0; k <= samples && plant.end() == sim::PhysicsEnd::kNone; ++k) {
    plant.advance(end_s * k / std::max(samples, 1), {});
    const sim::Plant::Sample sample = plant.sample();
    for (std::size_t i = 0; i < count; ++i) {
      const sim::Motor& motor = scenario.masses[i].motor;
      const double speed = motor.shaft_ratio * sample.mass_velocity[i];
      const double available = steppers[i].available_torque_nm(speed);
      const double drag = motor.viscous_damping_nms * speed;
      const double margin = 1 - std::abs(sample.motor_torque_nm[i] + drag) / available;
      if (margin < worst[i].margin)
        worst[i] = {margin, sample.time_s, speed, sample.motor_torque_nm[i], drag, available};
      const double rate_hz = full_steps_hz(motor, sample.mass_velocity[i]);
      for (Passes& pass : passes[i]) pass.add(sample.time_s, rate_hz);
    }
  }
  if (plant.time_s() < std::min(scenario.duration_s, plan::motion_end_s(scenario))) {
    findings.notes.push_back(fmt::format("the motors are checked up to t = {} s only", short_time(plant.time_s())));
  }
  std::vector<Resonance> resonances;
  for (std::size_t i = 0; i < count; ++i) {
    if (worst[i].margin < 0) findings.warnings.push_back(lack_of_torque(i, worst[i]));
    const auto &once = passes[i][0].found, &twice = passes[i][1].found;
    if (once.empty() && twice.empty()) continue;
    const std::string what = resonance(scenario.masses[i], once, twice), motor = fmt::format("mass.{}.motor", i);
    const auto same = std::find_if(resonances.begin(), resonances.end(), [&](const auto& r) { return r.what == what; });
    if (same == resonances.end()) {
      resonances.push_back({what, motor});
    } else {
      same->motors += ", " + motor;
    }
  }
  for (const Resonance& found : resonances) findings.notes.push_back(found.motors + ": " + found.what);
  return findings;
}

}  // namespace ballast
