#include "tools/ballast/motor_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "sim/motors/stepper.h"
#include "sim/plant/plant.h"

namespace ballast {
namespace {

constexpr double kMostLookedAt_s = 1000;
constexpr int kMostSamples = 20'000;

struct Worst {
  double margin = 1;  // part of the available torque left unused
  double time_s = 0, speed_radps = 0, load_nm = 0, drag_nm = 0, available_nm = 0;
};

double full_steps_hz(const sim::Motor& motor, double speed) {
  return motor.steps_per_revolution * std::abs(motor.shaft_ratio * speed) / (2 * std::numbers::pi);
}

double motion_end_s(const sim::Scenario& scenario) {
  double end_s = 0;
  for (const sim::Mass& mass : scenario.masses) {
    double duration_s = 0;
    for (const sim::MotionPiece& piece : mass.motion) duration_s += piece.duration_s;
    end_s = std::max(end_s, duration_s);
  }
  return end_s;
}

std::string lack_of_torque(std::size_t mass, const Worst& worst) {
  return fmt::format(
      "mass.{}.motor: lacks torque at t = {:.3g} s: the load takes {:.3g} N m and drag {:.3g} N m at the shaft, and at "
      "{:.3g} rad/s the motor has {:.3g} N m; a stronger motor, another gear ratio, or a slower motion helps",
      mass, worst.time_s, std::abs(worst.load_nm), std::abs(worst.drag_nm), std::abs(worst.speed_radps),
      worst.available_nm);
}

std::string times_text(const std::vector<double>& times_s) {
  std::string times;
  const std::size_t shown = std::min<std::size_t>(times_s.size(), 4);
  for (std::size_t k = 0; k < shown; ++k) times += fmt::format("{}{:.3g}", k == 0 ? "" : ", ", times_s[k]);
  if (times_s.size() > shown) times += fmt::format(" and {} times more", times_s.size() - shown);
  return times;
}

// `once`, `twice`: when the full steps come at the natural frequency and at twice that; not both are empty.
std::string resonance(std::size_t i, const sim::Mass& mass, const std::vector<double>& once,
                      const std::vector<double>& twice) {
  std::string passes;
  if (!once.empty()) passes = fmt::format("at t = {} s its full steps come at it", times_text(once));
  if (!twice.empty()) {
    passes += fmt::format("{}at t = {} s {} at twice that", once.empty() ? "" : ", ", times_text(twice),
                          once.empty() ? "its full steps come" : "they come");
  }
  return fmt::format(
      "mass.{}.motor: passes a resonance: rotor and mass swing at {:.3g} Hz (damping ratio {:.2g}), and {}; finer "
      "microsteps, more viscous_damping, or passing through quickly helps",
      i, swing_hz(mass), damping_ratio(mass), passes);
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

double swing_hz(const sim::Mass& mass) {
  return std::sqrt(mass.motor.rail_stiffness() / mass.moving_inertia()) / (2 * std::numbers::pi);
}

double damping_ratio(const sim::Mass& mass) {
  const double damping = mass.motor.viscous_damping_nms * mass.motor.shaft_ratio * mass.motor.shaft_ratio;
  return damping / (2 * std::sqrt(mass.motor.rail_stiffness() * mass.moving_inertia()));
}

MotorFindings check_motors(const sim::Scenario& scenario) {
  MotorFindings findings;
  sim::Scenario rolled = scenario;
  rolled.run.actuation = sim::Actuation::kPrescribed;
  rolled.faults.clear();
  const double end_s = std::min({scenario.duration_s, motion_end_s(scenario) + 1, kMostLookedAt_s});
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
  if (plant.time_s() < std::min(scenario.duration_s, motion_end_s(scenario))) {
    findings.notes.push_back(fmt::format("the motors are checked up to t = {:.3g} s only", plant.time_s()));
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (worst[i].margin < 0) findings.warnings.push_back(lack_of_torque(i, worst[i]));
    const auto &once = passes[i][0].found, &twice = passes[i][1].found;
    if (!once.empty() || !twice.empty()) findings.notes.push_back(resonance(i, scenario.masses[i], once, twice));
  }
  return findings;
}

}  // namespace ballast
