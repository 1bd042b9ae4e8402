// Stiffer motors and finer microsteps take the stepper run to the prescribed one. BALLAST_CONVERGENCE_OUT=1 prints the
// rows of a table.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <numbers>

#include "sim/masses/motion.h"
#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"

namespace ballast::sim {
namespace {

constexpr double kTick = 0.002;
constexpr int kTicks = 2500;  // 5 time units

// The paper's ball on a floor it cannot slip on. No detent and perfect teeth: what is left is that steps are steps and
// springs give.
Scenario ball(int microsteps, double holding_torque_nm) {
  const auto read = read_scenario(BALLAST_SCENARIO_DIR "/paper_ball.toml");
  EXPECT_TRUE(read.ok());
  Scenario s = read.scenario;
  s.surface.static_friction = s.surface.kinetic_friction = std::numeric_limits<double>::infinity();
  for (Mass& mass : s.masses) {
    mass.motor.microsteps = microsteps;
    mass.motor.holding_torque_nm = holding_torque_nm;
    mass.motor.detent_torque_nm = mass.motor.step_error = 0;
    mass.motor.corner_speed_radps = 1e6;
  }
  return s;
}

// Pulses where the motion crosses the middle between two microsteps, to rounding.
class Crossings {
 public:
  explicit Crossings(const Mass& mass)
      : motion_(mass),
        per_unit_(mass.motor.steps_per_revolution * mass.motor.microsteps * mass.motor.shaft_ratio /
                  (2 * std::numbers::pi)),
        start_(mass.initial_position) {}
  void add(int motor, double start_s, double end_s, std::vector<StepPulse>& pulses) {
    const double from = steps(start_s), to = steps(end_s);
    const int direction = to > from ? +1 : -1;
    for (; std::llround(to) != done_; done_ += direction) {
      const double edge = static_cast<double>(done_) + 0.5 * direction;
      double low = start_s, high = end_s;
      for (int k = 0; k < 60; ++k) {
        const double middle = (low + high) / 2;
        ((steps(middle) - edge) * direction < 0 ? low : high) = middle;
      }
      pulses.push_back({low - start_s, motor, direction});
    }
  }

 private:
  [[nodiscard]] double steps(double time_s) {
    while (motion_.end_s(piece_) < time_s) ++piece_;
    while (piece_ > 0 && motion_.end_s(piece_ - 1) >= time_s) --piece_;
    return (motion_.at(piece_, time_s).position - start_) * per_unit_;
  }

  PrescribedMotion motion_;
  double per_unit_, start_;
  std::size_t piece_ = 0;
  std::int64_t done_ = 0;
};

// Greatest distances between two runs, tick by tick.
struct Errors {
  double mass_rad = 0, place_m = 0, attitude_rad = 0;
  double friction = 0;  // of f_s / N, in the last fifth: long after the push, whose jumps of acceleration a spring
                        // answers by swinging about them by as much, however stiff it is
};

Errors compare(const Scenario& s, const Scenario& t) {
  Plant plant(s), other(t);
  std::vector<Crossings> crossings(s.masses.begin(), s.masses.end()), others(t.masses.begin(), t.masses.end());
  const auto advance = [](Plant& p, std::vector<Crossings>& from, int k) {
    std::vector<StepPulse> pulses;
    for (std::size_t i = 0; i < from.size(); ++i) {
      from[i].add(static_cast<int>(i), k * kTick, (k + 1) * kTick, pulses);
    }
    std::sort(pulses.begin(), pulses.end(), [](const auto& a, const auto& b) { return a.offset_s < b.offset_s; });
    p.advance((k + 1) * kTick, pulses);
    return p.sample();
  };
  Errors worst;
  for (int k = 0; k < kTicks; ++k) {
    const auto a = advance(plant, crossings, k), b = advance(other, others, k);
    for (std::size_t i = 0; i < s.masses.size(); ++i) {
      worst.mass_rad = std::max(worst.mass_rad, std::abs(a.mass_position[i] - b.mass_position[i]));
    }
    worst.place_m = std::max(worst.place_m, (a.position_W_m - b.position_W_m).norm());
    const double cosine = std::min(1.0, std::abs(a.orientation.dot(b.orientation)));
    worst.attitude_rad = std::max(worst.attitude_rad, 2 * std::acos(cosine));
    if (k < kTicks * 4 / 5) continue;
    const double friction = a.static_friction_n / a.normal_force_n - b.static_friction_n / b.normal_force_n;
    worst.friction = std::max(worst.friction, std::abs(friction));
  }
  EXPECT_EQ(plant.end(), PhysicsEnd::kNone);
  EXPECT_EQ(other.end(), PhysicsEnd::kNone);
  return worst;
}

Errors against_prescribed(int microsteps, double holding_torque_nm) {
  const Scenario s = ball(microsteps, holding_torque_nm);
  Scenario ideal = s;
  ideal.run.actuation = Actuation::kPrescribed;
  const Errors e = compare(s, ideal);
  if (std::getenv("BALLAST_CONVERGENCE_OUT") != nullptr) {
    std::printf("| %d | %g | %.2e | %.2e | %.2e | %.1e |\n", microsteps, holding_torque_nm, e.mass_rad, e.place_m,
                e.attitude_rad, e.friction);
  }
  return e;
}

// The spring gives by load and drag over its stiffness N_r tau_hold: order 1 in its inverse.
TEST(StepperConvergence, OfOrderOneInTheMotorsCompliance) {
  Errors before = against_prescribed(256, 48);
  for (const double torque : {96., 192., 384.}) {
    const Errors e = against_prescribed(256, torque);
    // Twice: up to the lag's own square, a few per cent, and what the microsteps leave.
    EXPECT_NEAR(std::log2(before.mass_rad / e.mass_rad), 1, 0.1) << torque;
    EXPECT_NEAR(std::log2(before.place_m / e.place_m), 1, 0.1) << torque;
    EXPECT_NEAR(std::log2(before.attitude_rad / e.attitude_rad), 1, 0.1) << torque;
    before = e;
  }
}

// The same springs, coarse steps against ones so fine that they count for nothing: order 1 in half a microstep itself,
// and better the more of them come in one swing of the rotor, which then follows their mean.
TEST(StepperConvergence, AtLeastOfOrderOneInTheMicrostep) {
  const double torque = 96;
  const Scenario fine = ball(1024, torque);
  Errors before = compare(ball(8, torque), fine);
  for (const int microsteps : {16, 64}) {
    const Errors e = compare(ball(microsteps, torque), fine);
    const double halvings = microsteps == 16 ? 1 : 2;
    EXPECT_GT(std::log2(before.mass_rad / e.mass_rad), 0.9 * halvings) << microsteps;
    EXPECT_GT(std::log2(before.place_m / e.place_m), 0.9 * halvings) << microsteps;
    EXPECT_GT(std::log2(before.friction / e.friction), 0.9 * halvings) << microsteps;
    before = e;
  }
}

// Both at once: every error of the motion is halved.
TEST(StepperConvergence, ToThePrescribedRun) {
  Errors before = against_prescribed(16, 48);
  for (const int finer : {2, 4, 8}) {
    const Errors e = against_prescribed(16 * finer, 48. * finer);
    EXPECT_NEAR(std::log2(before.mass_rad / e.mass_rad), 1, 0.15) << finer;
    EXPECT_NEAR(std::log2(before.place_m / e.place_m), 1, 0.1) << finer;
    EXPECT_NEAR(std::log2(before.attitude_rad / e.attitude_rad), 1, 0.1) << finer;
    before = e;
  }
}

// Forces: each microstep tugs by stiffness times microstep, so they only come near if the steps grow fine faster than
// the spring grows stiff.
TEST(StepperConvergence, OfTheFrictionIfStepsGrowFineFaster) {
  const Errors coarse = against_prescribed(16, 24), middle = against_prescribed(64, 48),
               fine = against_prescribed(256, 96);
  EXPECT_LT(middle.friction, 0.5 * coarse.friction);
  EXPECT_LT(fine.friction, 0.5 * middle.friction);
}

}  // namespace
}  // namespace ballast::sim
