// Floors that slope and resist: energy, creep and flight by laws that do not depend on the plant's equations.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;

// T . omega of physics.md, "Real floors".
double power_of_resistance_w(const Scenario& s, const Sample& p) {
  const Surface& f = s.surface;
  const double creep = f.creep_radps > 0 ? f.creep_radps : 1e-3 * std::sqrt(s.gravity_mps2 / s.ball.radius_m);
  const Vector3d omega_W = test::attitude(p) * p.angular_velocity_B_radps;
  const double level = omega_W.head<2>().norm();
  return -p.normal_force_n * (f.rolling_resistance * s.ball.radius_m * level * level / std::hypot(level, creep) +
                              f.spin_friction_m * omega_W[2] * omega_W[2] / std::hypot(omega_W[2], creep));
}

// In rolling the contact force does no work, so the energy of a ball whose masses rest falls by the work of T. Gauss
// and Legendre's rule with five points integrates it: the panels are so short that its error is rounding.
TEST(RealFloor, EnergyFallsByTheWorkOfItsMoment) {
  const std::uint64_t seed = ballast::test::random_seed(91);
  constexpr std::array<double, 5> kPlace{-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831,
                                         0.9061798459386640};
  constexpr std::array<double, 5> kWeight{0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                          0.4786286704993665, 0.2369268850561891};
  double worst = 0;
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(trial % 4);
    random.make_floor_real(s);
    for (auto& mass : s.masses) {
      mass.motion.clear();
      mass.initial_velocity = 0;
    }
    const double rate = std::sqrt(s.gravity_mps2 / s.ball.radius_m);
    s.surface.creep_radps = rate * random.uniform(0.2, 1);  // a rate the panels resolve
    s.surface.slope_rad *= 0.2;
    s.initial.angular_velocity_B_radps = rate * random.vector(1);
    s.duration_s = 8 / rate;
    Plant plant(s);
    const double start_j = test::whole(s, plant.sample()).energy_j;
    double total_kg = s.ball.mass_kg;
    for (const auto& mass : s.masses) total_kg += mass.mass_kg;
    const double scale_j = total_kg * s.gravity_mps2 * s.ball.radius_m + std::abs(start_j);
    constexpr int kPanels = 400;
    double work_j = 0;
    for (int panel = 0; panel < kPanels && plant.end() == PhysicsEnd::kNone; ++panel) {
      const double half_s = s.duration_s / kPanels / 2, middle_s = (2 * panel + 1) * half_s;
      for (std::size_t i = 0; i < kPlace.size(); ++i) {
        plant.advance(middle_s + kPlace[i] * half_s, {});
        work_j += half_s * kWeight[i] * power_of_resistance_w(s, plant.sample());
      }
      plant.advance(middle_s + half_s, {});
      const double change_j = test::whole(s, plant.sample()).energy_j - start_j;
      worst = std::max(worst, std::abs(change_j - work_j) / scale_j);
    }
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone) << plant.end_text();
    EXPECT_LT(work_j, -1e-3 * scale_j);
  }
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
  EXPECT_LT(worst, 1e-11);
}

// Through sliding, flight and impacts too, energy never rises.
TEST(RealFloor, EnergyNeverRisesInAnyRegime) {
  const std::uint64_t seed = ballast::test::random_seed(92);
  int slides = 0, flights = 0;
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(0);
    random.make_floor_real(s);
    const double rate = std::sqrt(s.gravity_mps2 / s.ball.radius_m), speed = rate * s.ball.radius_m;
    s.run.on_violation = OnViolation::kContinue;
    const double friction = random.uniform(0.05, 0.5);
    s.surface.static_friction = friction;
    s.surface.kinetic_friction = friction * random.uniform(0.7, 1);
    s.surface.restitution = random.uniform(0, 0.6);
    s.initial.angular_velocity_B_radps = rate * random.vector(2);
    s.initial.has_velocity = true;
    s.initial.velocity_W_mps = speed * random.vector(1);
    s.initial.height_m = s.ball.radius_m * random.uniform(0.05, 0.4);
    s.duration_s = 8 / rate;
    Plant plant(s);
    double before_j = test::whole(s, plant.sample()).energy_j;
    const double rounding_j = 1e-10 * (std::abs(before_j) + s.ball.mass_kg * speed * speed);
    for (int k = 1; k <= 200 && plant.end() == PhysicsEnd::kNone; ++k) {
      plant.advance(k * s.duration_s / 200, {});
      const double now_j = test::whole(s, plant.sample()).energy_j;
      EXPECT_LT(now_j, before_j + rounding_j);
      before_j = now_j;
    }
    for (const RegimeStart& start : plant.regimes()) {
      slides += start.regime == Regime::kSliding ? 1 : 0;
      flights += start.regime == Regime::kFlight ? 1 : 0;
    }
  }
  EXPECT_GE(slides, 10);
  EXPECT_GE(flights, 20);
}

// On a slope within c_rr a ball creeps at the rate at which the moment balances its weight about the contact point:
// tan a = c_rr omega / sqrt(omega^2 + omega_c^2).
TEST(RealFloor, ABallCreepsDownASlopeWithinItsResistance) {
  Scenario s;
  s.run.actuation = Actuation::kPrescribed;
  s.gravity_mps2 = 9.81;
  s.ball = {.radius_m = 0.2, .mass_kg = 2, .inertia_kgm2 = {0.05, 0.05, 0.05}};
  s.surface.rolling_resistance = 0.05;
  for (const double tangent : {0.01, 0.03, 0.049}) {
    s.surface.slope_rad = std::atan(tangent);
    s.surface.downhill_rad = 2.5;
    const double creep = 1e-3 * std::sqrt(9.81 / 0.2);
    const double rate = creep * tangent / std::sqrt(0.05 * 0.05 - tangent * tangent);
    s.duration_s = 20;
    Plant plant(s);
    plant.advance(20, {});
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone) << plant.end_text();
    const Sample p = plant.sample();
    // Its start from rest has faded by exp(-60) or more. The rate is 1e-10 of what a step may be wrong by per second.
    const Eigen::Vector2d expected = 0.2 * rate * Eigen::Vector2d(std::cos(2.5), std::sin(2.5));
    EXPECT_NEAR((p.velocity_W_mps.head<2>() - expected).norm(), 0, 1e-8 * expected.norm()) << tangent;
    const double weight_n = 2 * 9.81;
    EXPECT_NEAR(p.normal_force_n, weight_n * std::cos(s.surface.slope_rad), 1e-9 * weight_n);
    EXPECT_NEAR(p.static_friction_n, weight_n * std::sin(s.surface.slope_rad), 1e-9 * weight_n);
  }
}

// In flight the centre of mass falls along gravity, and nothing turns the ball.
TEST(RealFloor, FlightFallsAlongGravity) {
  test::RandomRobot random(ballast::test::random_seed(93));
  Scenario s = random.scenario(2);
  random.make_floor_real(s);
  s.surface.static_friction = s.surface.kinetic_friction = 0.3;
  s.external_force_W_n.setZero();
  const double rate = std::sqrt(s.gravity_mps2 / s.ball.radius_m), speed = rate * s.ball.radius_m;
  s.initial.angular_velocity_B_radps = rate * random.vector(1);
  s.initial.has_velocity = true;
  s.initial.velocity_W_mps = speed * Vector3d(0.3, -0.4, 2);
  Plant plant(s);
  const test::Whole start = test::whole(s, plant.sample());
  for (int k = 1; k <= 20; ++k) {
    const double t = 0.1 * k / rate;
    plant.advance(t, {});
    ASSERT_EQ(plant.sample().regime, Regime::kFlight);
    const test::Whole now = test::whole(s, plant.sample());
    const Vector3d fallen = start.center_W_m + t * start.velocity_W_mps + t * t / 2 * test::gravity_W_mps2(s);
    EXPECT_LT((now.center_W_m - fallen).norm(), 1e-10 * s.ball.radius_m);
    EXPECT_LT((now.angular_momentum_W - start.angular_momentum_W).norm(),
              1e-10 * now.mass_kg * speed * s.ball.radius_m);
  }
}

// The state of newton_euler_test.cpp that has no solution.
TEST(RealFloor, APlantThatNoNormalForceBalancesIsInconsistent) {
  Scenario s;
  s.run.actuation = Actuation::kPrescribed;
  s.gravity_mps2 = 10;
  s.ball = {.radius_m = 1, .mass_kg = 1, .inertia_kgm2 = {0.1, 0.1, 0.1}, .center_of_mass_B_m = {0.5, 0, 0}};
  s.surface.rolling_resistance = 3;
  s.surface.creep_radps = 1e-6;
  s.initial.angular_velocity_B_radps = {0, 1, 0};
  const Plant plant(s);
  EXPECT_EQ(plant.end(), PhysicsEnd::kInconsistent);
  EXPECT_NE(plant.end_text().find("resistance"), std::string::npos) << plant.end_text();
}

}  // namespace
}  // namespace ballast::sim
