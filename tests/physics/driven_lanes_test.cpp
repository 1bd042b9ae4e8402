// Four masses to a vector register against the same equations one mass after the other.
#include "sim/plant/driven_lanes.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "sim/motors/motor_presets.h"
#include "sim/plant/equations.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

// A robot with steppers on circles, half of them with windings, and a state of rolling. Its fields lead or lag by up
// to 1.5 electrical radians.
struct DrivenRobot {
  explicit DrivenRobot(test::RandomRobot& random) : DrivenRobot(model(random), random) {}
  DrivenRobot(const Scenario& scenario, test::RandomRobot& random) : equations(scenario) {
    State& y = state;
    const Eigen::Quaterniond q = random.attitude();
    y[kQ] = q.w();
    for (std::size_t j = 0; j < 3; ++j) {
      y[kQ + 1 + j] = q.vec()[static_cast<int>(j)];
      y[kOmega + j] = random.uniform(-3, 3);
    }
    const std::size_t n = equations.mass_count();
    for (std::size_t i = 0; i < n; ++i) {
      const Motor& motor = equations.motors.stepper(i).motor();
      const double field = equations.motors.stepper(i).field_rad();
      y[kTheta + i] = (field + random.uniform(-1.5, 1.5) / motor.rotor_teeth()) / motor.shaft_ratio;
      y[kTheta + n + i] = random.uniform(-3, 3) / motor.shaft_ratio;
    }
  }

  static Scenario model(test::RandomRobot& random) {
    Scenario s = random.scenario(random.integer(1, kMaxMasses));
    s.run.actuation = Actuation::kStepper;
    s.external_force_W_n.setZero();
    for (Mass& mass : s.masses) {
      const Eigen::Vector3d x = random.direction(), z = x.cross(random.direction()).normalized();
      mass.rail = firmware::circle(0.2 * s.ball.radius_m * random.direction(),
                                   s.ball.radius_m * random.uniform(0.1, 0.75), x, z);
      mass.motor.shaft_ratio = random.uniform(1, 5);
      mass.motor.detent_torque_nm = 0.03 * mass.motor.holding_torque_nm;
      mass.motor.viscous_damping_nms = 0.001;
      mass.motor.corner_speed_radps = random.uniform(0.5, 10);  // some are above it
      if (random.integer(0, 1) == 0) continue;
      mass.motor.rated_current_a = 1.5;
      mass.motor.resistance_ohm = 2;
      mass.motor.inductance_h = 0.003;
      mass.motor.supply_voltage_v = 1e3;
    }
    return s;
  }

  // By the equations that take the masses one after the other.
  [[nodiscard]] Motion one_by_one() const {
    const double *position = &state[kTheta], *velocity = position + equations.mass_count();
    const PerMass force = equations.motors.forces(position, velocity);
    Motion out;
    rolling_driven(equations.body, 0, &state[kQ], &state[kOmega], position, velocity, force.data(), out);
    return out;
  }
  [[nodiscard]] bool lanes(const DrivenLanes& functions, LaneMotion& out) const {
    const LaneMotors* motors = equations.motors.lanes();
    const double *position = &state[kTheta], *velocity = position + equations.mass_count();
    return motors != nullptr && functions.evaluate(equations.lane_body(), *motors, &state[kQ], &state[kOmega], position,
                                                   velocity, PerLane{}, out);
  }
  [[nodiscard]] State derivative(const DrivenLanes& functions) const {
    State out{};
    const LaneMotors* motors = equations.motors.lanes();
    EXPECT_TRUE(functions.derivative(equations.lane_body(), *motors, state.data(), PerLane{}, out.data()));
    return out;
  }

  Equations equations;
  State state{};
};

// The largest of the terms is the motors' torques; a few hundred operations round.
TEST(DrivenLanes, AgreeWithTheMassesOneByOneOnTenThousandStates) {
  const std::uint64_t seed = test::random_seed(20261122);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < 10000; ++trial) {
    const DrivenRobot robot(random);
    const Motion expected = robot.one_by_one();
    LaneMotion found;
    ASSERT_TRUE(robot.lanes(driven_lanes(), found)) << "trial " << trial;
    double force_scale = expected.contact_force_B_n.norm(), rate_scale = 0;
    for (std::size_t i = 0; i < robot.equations.mass_count(); ++i) {
      force_scale = std::max(force_scale, std::abs(expected.generalised_force[i]) / robot.equations.body.radius_m);
      rate_scale = std::max(rate_scale, std::abs(expected.mass_acceleration[i]));
    }
    for (std::size_t i = 0; i < robot.equations.mass_count(); ++i) {
      EXPECT_NEAR(found.generalised_force[i], expected.generalised_force[i],
                  1e-13 * force_scale * robot.equations.body.radius_m)
          << "trial " << trial;
      EXPECT_NEAR(found.mass_acceleration[i], expected.mass_acceleration[i], 1e-11 * rate_scale) << "trial " << trial;
    }
    for (int j = 0; j < 3; ++j) {
      const auto k = static_cast<std::size_t>(j);
      EXPECT_NEAR(found.angular_acceleration_B_radps2[k], expected.angular_acceleration_B_radps2[j],
                  1e-11 * expected.angular_acceleration_B_radps2.norm() + 1e-12 * rate_scale)
          << "trial " << trial;
      EXPECT_NEAR(found.contact_force_B_n[k], expected.contact_force_B_n[j], 1e-11 * force_scale) << "trial " << trial;
      EXPECT_NEAR(found.rotation_B_to_W[3 * k + 1], expected.rotation_B_to_W(j, 1), 1e-15);
    }
    EXPECT_NEAR(found.normal_force_n, expected.normal_force_n, 1e-11 * force_scale);
    EXPECT_NEAR(found.static_friction_n, expected.static_friction_n, 1e-11 * force_scale);
    EXPECT_NEAR(found.rolling_velocity_W_mps[0], expected.rolling_velocity_W_mps[0], 1e-14);
  }
}

// A run has the same bytes on every processor.
TEST(DrivenLanes, GiveTheSameBitsOnEveryProcessor) {
  const std::uint64_t seed = test::random_seed(6);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < 1000; ++trial) {
    const DrivenRobot robot(random);
    LaneMotion here{}, portable{};
    ASSERT_TRUE(robot.lanes(driven_lanes(), here));
    ASSERT_TRUE(robot.lanes(portable_driven_lanes(), portable));
    using Bits = std::array<std::uint64_t, sizeof(LaneMotion) / sizeof(double)>;
    EXPECT_EQ(std::bit_cast<Bits>(here), std::bit_cast<Bits>(portable)) << "trial " << trial;
  }
}

TEST(DrivenLanes, GiveTheDerivativeOfTheEquationsToTheBit) {
  constexpr std::uint64_t kSeed = 9;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  test::RandomRobot random(kSeed);
  for (int trial = 0; trial < 1000; ++trial) {
    const DrivenRobot robot(random);
    State expected{};
    Instant motion;
    robot.equations.derivative(0, robot.state.data(), expected.data(), motion);
    for (const DrivenLanes* functions : {&driven_lanes(), &portable_driven_lanes()}) {
      const State found = robot.derivative(*functions);
      for (std::size_t i = 0; i < robot.equations.size(); ++i) EXPECT_EQ(found[i], expected[i]) << "trial " << trial;
    }
  }
}

// Against the powers of Stepper and PhaseCurrent at the same four points: positions of a motion that is a polynomial of
// degree 5.
TEST(DrivenLanes, AddTheEnergiesOfEveryMotor) {
  constexpr std::uint64_t kSeed = 10;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  test::RandomRobot random(kSeed);
  for (int trial = 0; trial < 300; ++trial) {
    const DrivenRobot robot(random);
    const MotorDrives& motors = robot.equations.motors;
    const std::size_t n = robot.equations.mass_count();
    constexpr double kLength = 1e-3;
    const double kPlace[] = {0, (1 - std::sqrt(0.2)) / 2, (1 + std::sqrt(0.2)) / 2, 1};
    const double kWeight[] = {1. / 12, 5. / 12, 5. / 12, 1. / 12};
    State y[2] = {robot.state, robot.state}, dydt[2] = {State{}, State{}};
    LaneEnergies expected{};
    for (std::size_t i = 0; i < n; ++i) {
      const Stepper& stepper = motors.stepper(i);
      const Motor& motor = stepper.motor();
      const double start = robot.state[kTheta + i], rate = robot.state[kTheta + n + i];
      const double bend = random.uniform(-50, 50), twist = random.uniform(-1e7, 1e7);
      const auto position = [&](double t) { return start + t * (rate + t * (bend + twist * t * t * t)); };
      const auto velocity = [&](double t) { return rate + t * (2 * bend + 5 * twist * t * t * t); };
      const auto acceleration = [&](double t) { return 2 * bend + 20 * twist * t * t * t; };
      for (std::size_t k = 0; k < 2; ++k) {
        const double t = static_cast<double>(k) * kLength;
        y[k][kTheta + i] = position(t);
        y[k][kTheta + n + i] = dydt[k][kTheta + i] = velocity(t);
        dydt[k][kTheta + n + i] = acceleration(t);
      }
      for (std::size_t k = 0; k < 4; ++k) {
        const double part_s = kWeight[k] * kLength, t = kPlace[k] * kLength;
        const double angle = motor.shaft_ratio * position(t), speed = motor.shaft_ratio * velocity(t);
        const PhaseCurrent::Vector current = stepper.current(angle, speed);
        expected.work_j[i] += part_s * stepper.torque_nm(angle, speed) * speed;
        expected.friction_j[i] += part_s * motor.viscous_damping_nms * speed * speed;
        expected.copper_j[i] += part_s * stepper.phases().copper_loss_w(current);
        if (motor.has_winding()) expected.electrical_j[i] += part_s * stepper.terminal_power_w(current, speed);
      }
    }
    LaneEnergies found{}, portable{};
    const LaneSpan span{y[0].data(), dydt[0].data(), y[1].data(), dydt[1].data()};
    ASSERT_TRUE(driven_lanes().energies(*motors.lanes(), n, kLength, span, found)) << "trial " << trial;
    ASSERT_TRUE(portable_driven_lanes().energies(*motors.lanes(), n, kLength, span, portable));
    using Bits = std::array<std::uint64_t, sizeof(LaneEnergies) / sizeof(double)>;
    EXPECT_EQ(std::bit_cast<Bits>(found), std::bit_cast<Bits>(portable)) << "trial " << trial;
    for (std::size_t i = 0; i < n; ++i) {
      // Rounding of travel / length: 1e-16 / 1e-3 of a rate.
      const double scale = expected.friction_j[i] + expected.copper_j[i] + std::abs(expected.work_j[i]) + 1e-3;
      EXPECT_NEAR(found.work_j[i], expected.work_j[i], 1e-10 * scale) << "trial " << trial;
      EXPECT_NEAR(found.friction_j[i], expected.friction_j[i], 1e-10 * scale) << "trial " << trial;
      EXPECT_NEAR(found.copper_j[i], expected.copper_j[i], 1e-10 * scale) << "trial " << trial;
      EXPECT_NEAR(found.electrical_j[i], expected.electrical_j[i], 1e-10 * scale) << "trial " << trial;
    }
  }
}

TEST(DrivenLanes, LeaveAWindingShortOfVoltageToTheOtherEquations) {
  test::RandomRobot random(7);
  int with_winding = 0;
  for (int trial = 0; trial < 20; ++trial) {
    Scenario s = DrivenRobot::model(random);
    for (Mass& mass : s.masses) mass.motor.supply_voltage_v = 0.1;  // 3 V are needed for the current at rest
    const DrivenRobot robot(s, random);
    LaneMotion out;
    bool any = false;
    for (const Mass& mass : s.masses) any = any || mass.motor.has_winding();
    EXPECT_EQ(robot.lanes(driven_lanes(), out), !any);
    with_winding += any ? 1 : 0;
  }
  EXPECT_GT(with_winding, 10);
}

TEST(DrivenLanes, LeaveMotorsWithFaultsToTheOtherEquations) {
  test::RandomRobot random(8);
  DrivenRobot robot(random);
  LaneMotion out;
  ASSERT_TRUE(robot.lanes(driven_lanes(), out));
  robot.equations.motors.stepper(0).weaken_coil(0.5);
  EXPECT_FALSE(robot.lanes(driven_lanes(), out));
  robot.equations.motors.stepper(0).weaken_coil(1);
  EXPECT_TRUE(robot.lanes(driven_lanes(), out));
  robot.equations.motors.stepper(0).power(false);
  EXPECT_FALSE(robot.lanes(driven_lanes(), out));
}

}  // namespace
}  // namespace ballast::sim
