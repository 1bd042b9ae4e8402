// Masses behind a gear or a leadscrew: everything that the shaft ratio (motor angle per rail unit) goes into. phi =
// s theta, the rail feels s times the motor's torque and s^2 times its inertia and damping.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"

namespace ballast::sim {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kTeeth = 50;                  // N_r of 200 full steps
constexpr double kMicrostep = 2 * kPi / 3200;  // at the shaft
constexpr double kGear = 4;
constexpr double kTravel = 0.04;  // m per revolution
constexpr double kScrew = 2 * kPi / kTravel;

Motor motor(double shaft_ratio, double holding_torque_nm, double rotor_inertia_kgm2, double damping_nms) {
  Motor m;
  m.shaft_ratio = shaft_ratio;
  m.holding_torque_nm = holding_torque_nm;
  m.rotor_inertia_kgm2 = rotor_inertia_kgm2;
  m.viscous_damping_nms = damping_nms;
  m.corner_speed_radps = 1e6;
  m.step_error = 0;
  return m;
}

Scenario ball() {
  Scenario s;
  s.duration_s = 5;
  s.gravity_mps2 = 9.81;
  s.ball = {
      .radius_m = 0.15, .mass_kg = 0.8, .inertia_kgm2 = {0.010, 0.011, 0.012}, .center_of_mass_B_m = {0, 0, -0.01}};
  return s;
}

// One degree of freedom that leaves the ball where it is. `inertia` and `load()` are those of one mass at its rail.
struct Still {
  Scenario scenario;
  double inertia, shaft_ratio;
  double gravity_force;  // times cos(theta) on the circle
  bool circle;

  [[nodiscard]] const Motor& motor() const { return scenario.masses[0].motor; }
  [[nodiscard]] double load(double theta) const { return circle ? gravity_force * std::cos(theta) : gravity_force; }
};

// A mass on a vertical line through the centre.
Still lift(double position, double velocity, const Motor& motor) {
  Still s{ball(), 0.25, motor.shaft_ratio, 0.25 * 9.81, false};
  Mass m;
  m.mass_kg = 0.25;
  m.rail = firmware::line({0, 0, 0}, {0, 0, 1});
  m.initial_position = position;
  m.initial_velocity = velocity;
  m.motor = motor;
  s.scenario.masses = {m};
  return s;
}

// Two masses on one circle, each the other's mirror image.
Still mirrored(double position, double velocity, const Motor& motor) {
  Still s{ball(), 0.25 * 0.11 * 0.11, motor.shaft_ratio, 0.25 * 9.81 * 0.11, true};
  Mass m;
  m.mass_kg = 0.25;
  m.rail = firmware::circle({0, 0, 0}, 0.11, {1, 0, 0}, {0, 0, 1});
  m.initial_position = position;
  m.initial_velocity = velocity;
  m.motor = motor;
  Mass image = m;
  image.rail = firmware::circle({0, 0, 0}, 0.11, {-1, 0, 0}, {0, 0, 1});
  s.scenario.masses = {m, image};
  return s;
}

// Where the field stands once the motor is balanced: ahead of the rotor by what its torque at t = 0 takes. At constant
// velocity that is the load's and the damping's.
double field(const Still& s) {
  const Mass& m = s.scenario.masses[0];
  const double torque =
      s.load(m.initial_position) / s.shaft_ratio + m.motor.viscous_damping_nms * s.shaft_ratio * m.initial_velocity;
  return s.shaft_ratio * m.initial_position + std::asin(torque / m.motor.holding_torque_nm) / kTeeth;
}

std::array<Still, 2> gear_and_screw(double velocity_shaft_radps) {
  return {mirrored(-1.2, velocity_shaft_radps / kGear, motor(kGear, 0.2, 1e-4, 0.02)),
          lift(-0.02, velocity_shaft_radps / kScrew, motor(kScrew, 0.05, 1e-5, 1e-3))};
}

// The motors hold their masses, and the torques are those of statics.
TEST(DrivenShaft, HoldsItsLoad) {
  for (const Still& s : gear_and_screw(0)) {
    Plant plant(s.scenario);
    const double theta = s.scenario.masses[0].initial_position;
    const double torque = s.load(theta) / s.shaft_ratio;
    // Rounding of a shaft angle of a few radians, times 50 teeth and the holding torque; likewise below.
    EXPECT_NEAR(plant.sample().motor_torque_nm[0], torque, 1e-13);
    for (int k = 1; k <= 1000; ++k) plant.advance(k * 0.001, {});
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
    EXPECT_NEAR(plant.sample().mass_position[0], theta, 1e-12);
    EXPECT_NEAR(plant.motor_extrema(0).max_torque_nm, torque, 1e-12);
    EXPECT_NEAR(plant.motor_extrema(0).torque_margin, 1 - torque / s.motor().holding_torque_nm, 1e-11);
  }
}

// After 1000 microsteps the rotor lags behind the field by asin(load / (s tau_hold)) / N_r of the load where it now is.
TEST(DrivenShaft, StandsWhereLoadAndFieldBalance) {
  for (const Still& s : gear_and_screw(0)) {
    Plant plant(s.scenario);
    for (int k = 0; k < 4000; ++k) {
      std::vector<StepPulse> pulses;
      for (int i = 0; k % 2 == 0 && k < 2000 && i < static_cast<int>(s.scenario.masses.size()); ++i)
        pulses.push_back({0, i, +1});
      plant.advance((k + 1) * 0.001, pulses);
    }
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
    const double ahead = field(s) + 1000 * kMicrostep;
    double theta = ahead / s.shaft_ratio;
    for (int i = 0; i < 50; ++i) {
      const double torque = s.load(theta) / s.shaft_ratio;
      theta = (ahead - std::asin(torque / s.motor().holding_torque_nm) / kTeeth) / s.shaft_ratio;
    }
    // Two seconds of a decay rate above 10 per s leave less than 1e-9 of the last step.
    EXPECT_NEAR(plant.sample().mass_position[0], theta, 1e-9 / s.shaft_ratio);
    EXPECT_NEAR(plant.sample().motor_torque_nm[0], s.load(theta) / s.shaft_ratio, 1e-9);
    EXPECT_EQ(plant.sample().lost_steps[0], 0);
  }
}

// The equation of the one mass, (inertia + J s^2) theta'' = s (tau_hold sin(N_r (field - s theta)) - b s theta') -
// load, by Runge-Kutta in small steps.
TEST(DrivenShaft, MovesAsTheEquationOfOneMassSays) {
  for (const double velocity_shaft_radps : {1.5, -0.8}) {
    for (const Still& s : gear_and_screw(velocity_shaft_radps)) {
      const Mass& m = s.scenario.masses[0];
      const double shaft = s.shaft_ratio, field_rad = field(s);
      const auto acceleration = [&](double theta, double rate) {
        const double torque = m.motor.holding_torque_nm * std::sin(kTeeth * (field_rad - shaft * theta)) -
                              m.motor.viscous_damping_nms * shaft * rate;
        return (shaft * torque - s.load(theta)) / (s.inertia + m.motor.rotor_inertia_kgm2 * shaft * shaft);
      };
      Scenario scenario = s.scenario;
      scenario.run.tolerance = 1e-12;  // the equations are compared, not the steps
      Plant plant(scenario);
      double theta = m.initial_position, rate = m.initial_velocity;
      const double start = theta;
      double farthest = 0;
      const double h = 1e-5;
      for (int k = 1; k <= 100; ++k) {
        for (int j = 0; j < 100; ++j) {
          const double k1 = rate, a1 = acceleration(theta, rate);
          const double k2 = rate + h / 2 * a1, a2 = acceleration(theta + h / 2 * k1, k2);
          const double k3 = rate + h / 2 * a2, a3 = acceleration(theta + h / 2 * k2, k3);
          const double k4 = rate + h * a3, a4 = acceleration(theta + h * k3, k4);
          theta += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
          rate += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
        }
        plant.advance(k * 0.001, {});
        ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
        // Runge-Kutta's (h omega)^4 with omega of a few 100 per s: 1e-10 of the motion.
        ASSERT_NEAR(shaft * plant.sample().mass_position[0], shaft * theta, 1e-9) << k;
        ASSERT_NEAR(shaft * plant.sample().mass_velocity[0], shaft * rate, 1e-7) << k;
        farthest = std::max(farthest, shaft * std::abs(theta - start));
      }
      EXPECT_GT(farthest, 1e-3);  // rad at the shaft: it moves enough to be compared
    }
  }
}

// Three masses in general position, behind gears and screws.
Scenario general(double damping_nms) {
  Scenario s = ball();
  s.initial.angular_velocity_B_radps = {0.5, -0.3, 0.2};
  s.initial.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, -1).normalized()));
  for (int i = 0; i < 3; ++i) {
    Mass m;
    m.mass_kg = 0.2 + 0.05 * i;
    const bool circle = i != 1;
    m.rail = circle ? firmware::circle_about(0.11, i * 1.1, 0.3) : firmware::line({0.01, 0.02, 0}, {1, 0.5, -0.3});
    m.initial_position = circle ? -1.2 + 0.4 * i : 0.03;
    m.initial_velocity = circle ? 0.3 : -0.05;
    m.motor = circle ? motor(kGear, 2.0, 1e-4, damping_nms) : motor(kScrew, 0.2, 1e-5, damping_nms);
    s.masses.push_back(m);
  }
  return s;
}

TEST(DrivenShaft, ConservesEnergyWithFixedFields) {
  const Scenario s = general(0);
  Plant plant(s);
  const auto start = plant.sample();
  const test::Fields field_rad = test::balanced_fields(s, start);
  const auto energy = [&](const Plant::Sample& p) {
    return test::whole(s, p).energy_j + test::rotor_energy_j(s, p) + test::magnetic_energy_j(s, p, field_rad);
  };
  const double before = energy(start);
  for (int k = 1; k <= 2000; ++k) {
    plant.advance(k * 0.001, {});
    // Steps each good to 1e-12, against energies of a few joules.
    ASSERT_NEAR(energy(plant.sample()), before, 1e-8) << k;
  }
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
}

// balance() makes up for the load of masses that go on at constant velocity, and for the damping at that velocity: at
// t = 0 all is as if the same motion were prescribed, and the torque at each shaft is what that takes.
TEST(DrivenShaft, StartsAsIfTheVelocityWerePrescribed) {
  for (const double damping_nms : {0.0, 0.01}) {
    Scenario s = general(damping_nms);
    const auto driven = Plant(s).sample();
    s.run.actuation = Actuation::kPrescribed;
    const auto prescribed = Plant(s).sample();
    // Rounding of the shaft angles makes up to 1e-13 of torque, the shaft ratio up to 2e-11 of force.
    EXPECT_LT((driven.acceleration_B_mps2 - prescribed.acceleration_B_mps2).norm(), 1e-10);
    EXPECT_NEAR(driven.normal_force_n, prescribed.normal_force_n, 1e-10);
    EXPECT_NEAR(driven.static_friction_n, prescribed.static_friction_n, 1e-10);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(driven.motor_torque_nm[i], prescribed.motor_torque_nm[i], 1e-13);
      EXPECT_GT(std::abs(driven.motor_torque_nm[i]), 1e-3);
    }
  }
}

struct Hoist {
  const char* name;
  double velocity_mps, acceleration_mps2, duration_s;
};

class HoistTest : public testing::TestWithParam<Hoist> {};

// A mass on a vertical line with its acceleration prescribed: the shaft must give
//   (m (g + a) + J s^2 a) / s,
// and the motor that and the damping's b s v, of what it has at the speed s v.
TEST_P(HoistTest, TorqueAndMarginAreThoseOfTheClosedForm) {
  const auto& [name, v0, a, duration_s] = GetParam();
  const double inertia = 2e-5, damping = 2e-3, corner = 20, holding = 0.5;
  Still s = lift(-0.02, v0, motor(kScrew, holding, inertia, damping));
  s.scenario.run.actuation = Actuation::kPrescribed;
  s.scenario.masses[0].motor.corner_speed_radps = corner;
  s.scenario.masses[0].motion = {{duration_s, a, a}};
  s.scenario.duration_s = duration_s;
  Plant plant(s.scenario);

  const auto torque = [&](double acceleration) {
    return (0.25 * (9.81 + acceleration) + inertia * kScrew * kScrew * acceleration) / kScrew;
  };
  double margin = 1;
  const auto note = [&](double acceleration, double velocity) {
    const double speed = kScrew * velocity;
    const double available = std::abs(speed) <= corner ? holding : holding * corner / std::abs(speed);
    margin = std::min(margin, 1 - std::abs(torque(acceleration) + damping * speed) / available);
  };
  EXPECT_NEAR(plant.sample().motor_torque_nm[0], torque(a), 1e-14);
  note(a, v0);
  constexpr int kTicks = 100;
  for (int k = 1; k <= kTicks; ++k) {
    plant.advance(duration_s * k / kTicks, {});
    note(a, v0 + a * duration_s * k / kTicks);
  }
  note(0, v0 + a * duration_s);  // the value after the jump counts as well
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
  EXPECT_NEAR(plant.sample().motor_torque_nm[0], torque(0), 1e-14);
  EXPECT_NEAR(plant.motor_extrema(0).max_torque_nm, std::max(std::abs(torque(a)), std::abs(torque(0))), 1e-13);
  EXPECT_NEAR(plant.motor_extrema(0).torque_margin, margin, 1e-12);
  EXPECT_LT(margin, 0.99);
}

// The margin of a motor is that of its own speed, whatever the others do.
TEST(Hoists, EachHasItsOwnMargin) {
  Still s = lift(-0.02, 0.2, motor(kScrew, 0.5, 2e-5, 2e-3));
  s.scenario.run.actuation = Actuation::kPrescribed;
  s.scenario.masses[0].motor.corner_speed_radps = 20;
  Mass held = s.scenario.masses[0];
  held.initial_velocity = 0;
  held.initial_position = 0.03;
  s.scenario.duration_s = 0.05;
  s.scenario.masses.insert(s.scenario.masses.begin(), held);
  Plant plant(s.scenario);
  plant.advance(0.05, {});
  const double torque = 0.25 * 9.81 / kScrew, speed = kScrew * 0.2;
  EXPECT_NEAR(plant.motor_extrema(0).torque_margin, 1 - torque / 0.5, 1e-12);
  EXPECT_NEAR(plant.motor_extrema(1).torque_margin, 1 - (torque + 2e-3 * speed) / (0.5 * 20 / speed), 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Prescribed, HoistTest,
                         testing::Values(Hoist{"Up", 0, 2, 0.05},                      // to 15.7 rad/s at the shaft
                                         Hoist{"UpBeyondTheCornerSpeed", 0, 4, 0.08},  // to 50 rad/s
                                         Hoist{"BrakedOnTheWayDown", -0.1, 3, 0.03},
                                         Hoist{"DrivenDown", 0, -25, 0.004},  // the torque is negative
                                         Hoist{"Held", 0, 0, 0.05}),
                         [](const auto& hoist) { return std::string(hoist.param.name); });

}  // namespace
}  // namespace ballast::sim
