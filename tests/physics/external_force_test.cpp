// Forces that change with time, and drag in a wind: the plant against closed forms and the balance of energy.
#include "sim/plant/external_force.h"

#include <gtest/gtest.h>

#include <numbers>

#include "sim/plant/plant.h"
#include "tests/physics/random_robot.h"
#include "tests/physics/solid_ball.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;

// v = v_t tanh(g t / v_t), fallen v_t^2 / g ln cosh(g t / v_t), with v_t = sqrt(m g / c).
TEST(Drag, AFallingBallComesToItsTerminalVelocity) {
  Scenario s = solid_ball();
  s.drag.coefficient_kgpm = 0.05;
  s.initial.height_m = 60;
  s.initial.has_velocity = true;
  const double terminal = std::sqrt(0.5 * 9.81 / 0.05);
  for (const double period_s : {0.001, 0.1, 3.0}) {
    Plant plant(s);
    go(plant, 3, period_s);
    ASSERT_EQ(plant.regimes().back().regime, Regime::kFlight);
    const double part = 9.81 * 3 / terminal;
    EXPECT_NEAR(plant.sample().velocity_W_mps[2], -terminal * std::tanh(part), 1e-10);
    EXPECT_NEAR(plant.sample().position_W_m[2], 60 - terminal * terminal / 9.81 * std::log(std::cosh(part)), 1e-10);
  }
}

// Rolling: 7/5 m v' = c u |u| with u = wind - v, so 1/u grows by k = 5 c / (7 m) per second: v = w - u0 / (1 + k u0 t).
TEST(Drag, ARollingBallIsTakenAlongByTheWind) {
  Scenario s = solid_ball();
  s.drag.coefficient_kgpm = 0.2;
  s.drag.wind_W_mps = {3, -4, 0};
  const Vector3d along(0.6, -0.8, 0);
  const double k = 5 * 0.2 / (7 * 0.5);
  for (const double start_mps : {0.0, 2.0}) {
    // Against the wind it would turn round, which the formula does not describe.
    s.initial.angular_velocity_B_radps = Vector3d(0, 0, 1).cross(start_mps * along) / 0.1;
    Plant plant(s);
    go(plant, 3, 0.01);
    const double u0 = 5 - start_mps, u = u0 / (1 + k * u0 * 3);
    EXPECT_LT((plant.sample().velocity_W_mps - (5 - u) * along).norm(), 1e-10);
    EXPECT_LT((plant.sample().position_W_m - (5 * 3 - std::log(1 + k * u0 * 3) / k) * along).norm(), 1e-10);
    // A rolling solid ball passes 2/7 of a force at its centre to the floor.
    EXPECT_NEAR(plant.sample().static_friction_n, 2.0 / 7 * 0.2 * u * u, 1e-10);
    EXPECT_NEAR(plant.extrema().static_friction_max.value, 2.0 / 7 * 0.2 * u0 * u0, 1e-10);
  }
}

// Sliding: v' = -mu g - (c / m) v^2, v = V tan(atan(v0 / V) - t sqrt(mu g c / m)), V = sqrt(mu m g / c).
TEST(Drag, ASlidingBallIsSlowedByFloorAndAir) {
  Scenario s = solid_ball();
  s.surface = {.static_friction = 0.25, .kinetic_friction = 0.2, .restitution = 0};
  s.drag.coefficient_kgpm = 0.3;
  s.initial.has_velocity = true;
  s.initial.velocity_W_mps = {0, 6, 0};
  Plant plant(s);
  go(plant, 0.4, 0.01);
  ASSERT_EQ(plant.regimes().size(), 1u);
  ASSERT_EQ(plant.regimes()[0].regime, Regime::kSliding);
  const double scale = std::sqrt(0.2 * 0.5 * 9.81 / 0.3);
  EXPECT_NEAR(plant.sample().velocity_W_mps[1],
              scale * std::tan(std::atan(6 / scale) - 0.4 * std::sqrt(0.2 * 9.81 * 0.3 / 0.5)), 1e-10);
}

// A force along e1 that rises from 0 at t = 0.5 to 2 N at 1.3 s and is gone at 2 s; 7/5 m v' = F.
TEST(ForceTable, ARollingBallFollowsTheRamp) {
  Scenario s = solid_ball();
  s.force_table = {{0.5, 1.3, 2.0}, {Vector3d(0, 0, 0), Vector3d(2, 0, 0), Vector3d(0, 0, 0)}};
  const double inertia = 1.4 * 0.5;
  const double v1 = 0.8 * 1.0 / inertia, v2 = v1 + 0.7 * 1.0 / inertia;
  // A ramp up from 0 gives h^2 / 6 of its top, a ramp down to 0 h^2 / 3.
  const double x2 = (0.8 * 0.8 * 2 / 6 + 0.7 * 0.7 * 2 / 3) / inertia + 0.7 * v1;
  for (const double period_s : {0.001, 0.013, 3.0}) {
    SCOPED_TRACE(period_s);
    Plant plant(s);
    go(plant, 3, period_s);
    // No step crosses a kink, so that few are needed, each with an error of 1e-12 of 1 + |Omega| = 1 + v / r.
    EXPECT_NEAR(plant.sample().velocity_W_mps[0], v2, 1e-11);
    EXPECT_NEAR(plant.sample().position_W_m[0], x2 + v2 * 1.0, 1e-11);
    EXPECT_NEAR(plant.extrema().static_friction_max.value, 2.0 / 7 * 2, 1e-13);
    EXPECT_NEAR(plant.extrema().static_friction_max.time_s, 1.3, 1e-12);
  }
}

TEST(ForceTable, IsLinearBetweenItsTimesAndConstantOutside) {
  Scenario s = solid_ball();
  s.force_table = {{-1, 1, 2}, {Vector3d(1, 0, 0), Vector3d(3, 0, -2), Vector3d(0, 1, 0)}};
  const ExternalForce force(s);
  const auto at = [&](double t) {
    const auto f = force.at(t, Vec3<double>{0, 0, 0});
    return Vector3d(f.x, f.y, f.z);
  };
  EXPECT_EQ(at(-5), Vector3d(1, 0, 0));
  EXPECT_EQ(at(0), Vector3d(2, 0, -1));
  EXPECT_EQ(at(1), Vector3d(3, 0, -2));
  EXPECT_EQ(at(1.5), Vector3d(1.5, 0.5, -1));
  EXPECT_EQ(at(9), Vector3d(0, 1, 0));
  EXPECT_EQ(force.next_kink_s(0), 1);
  EXPECT_EQ(force.next_kink_s(1), 2);
  EXPECT_EQ(force.next_kink_s(2), std::numeric_limits<double>::infinity());
}

// The kinetic energy of everything, and what it gains by gravity and by the force: masses at rest on their rails, so
// that the rails do no work, and the contact point does none.
TEST(Drag, EnergyChangesByTheWorkOfTheForce) {
  const std::uint64_t seed = ballast::test::random_seed(31);
  for (int trial = 0; trial < 4; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(3);
    for (Mass& mass : s.masses) {
      mass.motion.clear();
      mass.initial_velocity = 0;
    }
    s.duration_s = 2;
    const double weight = s.ball.mass_kg * s.gravity_mps2, speed = std::sqrt(s.gravity_mps2 * s.ball.radius_m);
    s.external_force_W_n.setZero();
    s.force_table = {{0, 0.6, 2},
                     {0.05 * weight * random.vector(1), 0.05 * weight * random.vector(1), Vector3d::Zero()}};
    s.drag.coefficient_kgpm = 0.2 * weight / (speed * speed);
    s.drag.wind_W_mps = 0.3 * speed * random.vector(1);
    Plant plant(s);
    const ExternalForce force(s);
    const auto power = [&](double t, const Plant::Sample& now) {
      const Vector3d& v = now.velocity_W_mps;
      const Vector3d relative = v - s.drag.wind_W_mps;
      const auto& table = s.force_table;
      const std::size_t i = t < 0.6 ? 0 : 1;  // linear interpolation, by hand
      const double part = (t - table.times_s[i]) / (table.times_s[i + 1] - table.times_s[i]);
      const Vector3d pushed = (1 - part) * table.forces_W_n[i] + part * table.forces_W_n[i + 1];
      return v.dot(pushed - s.drag.coefficient_kgpm * relative.norm() * relative);
    };
    const auto energy = [&](const Plant::Sample& now) {
      const Eigen::Quaterniond q(now.orientation[0], now.orientation[1], now.orientation[2], now.orientation[3]);
      const Vector3d& w = now.angular_velocity_B_radps;
      double sum = w.dot(s.ball.inertia_kgm2.cwiseProduct(w)) / 2;
      const auto add = [&](double m, const Vector3d& at) {
        const Vector3d v = now.velocity_W_mps + q * w.cross(at);
        sum += m * (v.squaredNorm() / 2 + s.gravity_mps2 * (q * at)[2]);
      };
      add(s.ball.mass_kg, s.ball.center_of_mass_B_m);
      for (std::size_t i = 0; i < 3; ++i) add(s.masses[i].mass_kg, now.mass_position_B_m[i]);
      return sum;
    };
    // Simpson's rule over ticks of 1 ms; 0.6 s is a border.
    const double before = energy(plant.sample());
    double work = 0, gross = 0;
    for (int k = 0; k < 1000; ++k) {
      const double p0 = power(plant.time_s(), plant.sample());
      plant.advance((2 * k + 1) * 1e-3, {});
      const double p1 = power(plant.time_s(), plant.sample());
      plant.advance((2 * k + 2) * 1e-3, {});
      const double p2 = power(plant.time_s() - 1e-12, plant.sample());
      work += 2e-3 / 6 * (p0 + 4 * p1 + p2);
      gross += 2e-3 * std::abs(p1);
    }
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
    EXPECT_GT(gross, 1e-3 * weight * s.ball.radius_m);  // there is something to balance
    // Simpson: h^4 / 180 of a fourth derivative of up to (10 / s)^4: 1e-9 of the work.
    EXPECT_NEAR(energy(plant.sample()) - before, work, 1e-8 * gross);
  }
}

// Motors of a ball that starts in the air are balanced for the forces of that instant: falling freely, their masses
// feel none, and stay until the table's force sets in.
TEST(ForceTable, MotorsAreBalancedForItsStart) {
  Scenario s = solid_ball();
  s.run.actuation = Actuation::kStepper;
  s.initial.height_m = 60;
  s.force_table = {{0, 0.5, 1}, {Vector3d::Zero(), Vector3d::Zero(), Vector3d(20, 0, 0)}};
  Mass mass;
  mass.mass_kg = 0.1;
  mass.rail = firmware::line({0, 0, 0}, {1, 0, 0});
  mass.motor.shaft_ratio = 100;
  mass.motor.holding_torque_nm = 0.5;
  mass.motor.rotor_inertia_kgm2 = 1e-5;
  mass.motor.viscous_damping_nms = 1e-3;
  mass.motor.corner_speed_radps = 1e6;
  mass.motor.step_error = 0;
  s.masses = {mass};
  Plant plant(s);
  for (int k = 1; k <= 500; ++k) {
    plant.advance(0.001 * k, {});
    ASSERT_NEAR(plant.sample().mass_position[0], 0, 1e-13) << "after " << k << " ms";
  }
  go(plant, 1, 0.01);
  EXPECT_GT(std::abs(plant.sample().mass_position[0]), 1e-9);
}

}  // namespace
}  // namespace ballast::sim
