// The plant's messages against statics and the pushed ball, and every field's place.
#include "tools/sil/plant_messages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <utility>

namespace ballast::sil {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPi = std::numbers::pi;

// A homogeneous sphere: I = 2/5 M r^2.
sim::Scenario sphere() {
  sim::Scenario s;
  s.id = 4711;
  s.duration_s = 1;
  s.gravity_mps2 = 9.81;
  s.ball = {.radius_m = 0.5, .mass_kg = 2, .inertia_kgm2 = {0.2, 0.2, 0.2}, .center_of_mass_B_m = {0, 0, 0}};
  s.surface.static_friction = 0.3;
  s.run.actuation = sim::Actuation::kPrescribed;
  s.run.control_period_s = 0.0025;
  return s;
}

PlantMessages at_start(const sim::Scenario& scenario) {
  return plant_messages(scenario, sim::Plant(scenario).sample(), 0, false);
}

void expect_accelerometer(const PlantMessages& m, const Eigen::Vector3d& expected) {
  for (int j = 0; j < 3; ++j) EXPECT_NEAR(m.sensors.accelerometer_B_mps2[j], expected[j], 1e-14) << "axis " << j;
}

TEST(PlantMessages, AccelerometerAtRestReadsGUpward) {
  sim::Scenario s = sphere();
  expect_accelerometer(at_start(s), {0, 0, 9.81});
  // A quarter turn about the first axis brings the body's second axis upright.
  s.initial.orientation = Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitX());
  expect_accelerometer(at_start(s), {0, 9.81, 0});
  // Tilted by 30 degrees about the second axis, the first axis dips.
  s.initial.orientation = Eigen::AngleAxisd(kPi / 6, Eigen::Vector3d::UnitY());
  expect_accelerometer(at_start(s), {-9.81 * std::sin(kPi / 6), 0, 9.81 * std::cos(kPi / 6)});
}

// A sphere rolls down a slope with 5/7 of the pull along it, so the accelerometer reads 2/7 of that pull uphill.
TEST(PlantMessages, AccelerometerOnASlopeReadsAgainstGravity) {
  sim::Scenario s = sphere();
  s.surface.slope_rad = 0.2;
  s.surface.downhill_rad = 2.1;
  const double uphill = -2. / 7 * 9.81 * std::sin(0.2);
  expect_accelerometer(at_start(s), {uphill * std::cos(2.1), uphill * std::sin(2.1), 9.81 * std::cos(0.2)});
}

// Pushed through its centre by F, a sphere rolls with a = F / (7/5 M); the floor holds it back with 2/7 F.
TEST(PlantMessages, PushedBallIsHeldBackByTheFloor) {
  sim::Scenario s = sphere();
  s.external_force_W_n = {1.4, -0.7, 0};
  const double a1 = 1.4 / 2.8, a2 = -0.7 / 2.8, friction = std::hypot(0.4, 0.2), weight = 2 * 9.81;
  PlantMessages m = at_start(s);
  EXPECT_NEAR(m.contact.friction_force_W_n[0], -0.4, 1e-14);
  EXPECT_NEAR(m.contact.friction_force_W_n[1], 0.2, 1e-14);
  EXPECT_NEAR(m.contact.static_friction_n, friction, 1e-14);
  EXPECT_NEAR(m.contact.normal_force_n, weight, 1e-13);
  EXPECT_NEAR(m.contact.mu_required, friction / weight, 1e-15);
  EXPECT_NEAR(m.contact.margin, 1 - friction / (0.3 * weight), 1e-14);
  EXPECT_EQ(m.contact.regime, contact_t::REGIME_ROLLING);
  expect_accelerometer(m, {a1, a2, 9.81});
  // A quarter turn about the vertical: the body's first axis is the space's second, its second the space's first
  // reversed. The forces stay in the space frame.
  s.initial.orientation = Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitZ());
  m = at_start(s);
  expect_accelerometer(m, {a2, -a1, 9.81});
  EXPECT_NEAR(m.contact.friction_force_W_n[0], -0.4, 1e-14);
  EXPECT_NEAR(m.contact.friction_force_W_n[1], 0.2, 1e-14);
}

TEST(PlantMessages, MarginIsWhatIsLeftOfTheFrictionCone) {
  EXPECT_NEAR(friction_margin(10, 1, 0.4), 0.75, 1e-15);
  EXPECT_NEAR(friction_margin(10, 6, 0.4), -0.5, 1e-15);
  EXPECT_EQ(friction_margin(10, 1, kInfinity), 1);
  EXPECT_EQ(friction_margin(10, 1e6, 0.4), -1);
  for (const double n : {0.0, -3.0}) EXPECT_EQ(friction_margin(n, 0, 0.4), -1);
  sim::Scenario s = sphere();
  sim::Plant::Sample sample = sim::Plant(s).sample();
  sample.normal_force_n = -1;
  const PlantMessages m = plant_messages(s, sample, 0, true);
  EXPECT_EQ(m.contact.margin, -1);
  EXPECT_EQ(m.contact.mu_required, kInfinity);
  EXPECT_EQ(m.contact.normal_force_n, -1);
}

// A mass lifted on a vertical line by a leadscrew: (m (g + a) + J s^2 a) / s at the shaft.
TEST(PlantMessages, MotorTorqueIsThatOfTheShaft) {
  sim::Scenario s = sphere();
  const double shaft = 2 * kPi / 0.05, inertia = 3e-5, a = 1.5;
  sim::Mass m;
  m.mass_kg = 0.5;
  m.rail = firmware::line({0, 0, 0.1}, {0, 0, 1});
  m.initial_position = -0.15;
  m.initial_velocity = 0.02;
  m.motion = {{0.1, a, a}};
  m.motor.shaft_ratio = shaft;
  m.motor.rotor_inertia_kgm2 = inertia;
  m.motor.holding_torque_nm = m.motor.corner_speed_radps = 1;
  s.masses = {m};
  const plant_state_t state = at_start(s).state;
  EXPECT_EQ(state.mass_count, 1);
  EXPECT_NEAR(state.motor_torque_nm[0], (0.5 * (9.81 + a) + inertia * shaft * shaft * a) / shaft, 1e-15);
  EXPECT_EQ(state.mass_position[0], -0.15);
  EXPECT_EQ(state.mass_velocity[0], 0.02);
  EXPECT_EQ(state.mass_position_B_m[0][0], 0);
  EXPECT_EQ(state.mass_position_B_m[0][1], 0);
  EXPECT_NEAR(state.mass_position_B_m[0][2], -0.05, 1e-16);
  EXPECT_NEAR(state.center_of_mass_B_m[2], 0.5 * -0.05 / 2.5, 1e-16);
}

// A sample in which every number is another.
TEST(PlantMessages, EveryNumberIsInItsPlace) {
  sim::Scenario s = sphere();
  s.masses.resize(3);
  sim::Plant::Sample sample{};
  sample.orientation = {0.1, 0.2, 0.3, 0.4};
  sample.angular_velocity_B_radps = {1, 2, 3};
  sample.position_W_m = {4, 5, 6};
  sample.velocity_W_mps = {7, 8, 9};
  sample.acceleration_B_mps2 = {10, 11, 12};
  sample.up_B = {0, 0, 1};
  sample.normal_force_n = 13;
  sample.center_of_mass_B_m = {14, 15, 16};
  sample.normal_force_min_n = 17;
  sample.mu_required_max = 18;
  sample.floor_static_friction = s.surface.static_friction;
  for (std::size_t i = 0; i < sim::kMaxMasses; ++i) {
    const auto x = static_cast<double>(i);
    sample.mass_position[i] = 20 + x;
    sample.mass_velocity[i] = 30 + x;
    sample.mass_position_B_m[i] = {40 + x, 50 + x, 60 + x};
    sample.motor_torque_nm[i] = 70 + x;
    sample.end_switches[i] = static_cast<int>(i) + 1;
    sample.lost_steps[i] = 80 + static_cast<std::int64_t>(i);
  }
  using sim::Regime;
  const std::pair<Regime, std::int8_t> regimes[] = {{Regime::kSliding, contact_t::REGIME_SLIDING},
                                                    {Regime::kFlight, contact_t::REGIME_FLIGHT},
                                                    {Regime::kRolling, contact_t::REGIME_ROLLING}};
  for (const auto& [regime, code] : regimes) {
    sample.regime = regime;
    EXPECT_EQ(plant_messages(s, sample, 5, false).contact.regime, code);
  }
  const PlantMessages m = plant_messages(s, sample, 5, false, sim::Plant::ContactForces{19, 19.5});
  EXPECT_EQ(m.sensors.scenario_id, 4711);
  EXPECT_EQ(m.sensors.mass_count, 3);
  EXPECT_EQ(m.state.mass_count, 3);
  EXPECT_EQ(m.contact.normal_force_n, 13);
  EXPECT_EQ(m.contact.normal_force_min_n, 17);
  EXPECT_EQ(m.contact.mu_required_max, 18);
  EXPECT_EQ(m.sensors.attitude_valid, 1);
  EXPECT_EQ(m.contact.commanded_tick, 5);
  EXPECT_EQ(m.contact.commanded_normal_force_n, 19);
  EXPECT_EQ(m.contact.commanded_static_friction_n, 19.5);
  EXPECT_EQ(m.contact.commanded_mu_required, 19.5 / 19);
  for (int j = 0; j < 4; ++j) {
    EXPECT_EQ(m.state.orientation[j], sample.orientation[j]);
    EXPECT_EQ(m.sensors.orientation[j], sample.orientation[j]);
  }
  for (int j = 0; j < 3; ++j) {
    EXPECT_EQ(m.state.angular_velocity_B_radps[j], 1 + j);
    EXPECT_EQ(m.sensors.gyro_B_radps[j], 1 + j);
    EXPECT_EQ(m.state.position_W_m[j], 4 + j);
    EXPECT_EQ(m.state.velocity_W_mps[j], 7 + j);
    EXPECT_EQ(m.state.center_of_mass_B_m[j], 14 + j);
    EXPECT_EQ(m.sensors.accelerometer_B_mps2[j], 10 + j + (j == 2 ? 9.81 : 0));
  }
  for (int i = 0; i < 8; ++i) {
    const bool there = i < 3;  // beyond the masses there are, the arrays are 0
    EXPECT_EQ(m.state.mass_position[i], there ? 20 + i : 0);
    EXPECT_EQ(m.state.mass_velocity[i], there ? 30 + i : 0);
    for (int j = 0; j < 3; ++j) EXPECT_EQ(m.state.mass_position_B_m[i][j], there ? 40 + 10 * j + i : 0);
    EXPECT_EQ(m.state.motor_torque_nm[i], there ? 70 + i : 0);
    EXPECT_EQ(m.state.lost_steps[i], there ? 80 + i : 0);
    EXPECT_EQ(m.sensors.limit_switch[i], there ? i + 1 : 0);
  }
}

void expect_times(const PlantMessages& m, std::int64_t tick, std::int64_t utime, double time_s, bool last) {
  EXPECT_EQ(m.contact.tick, tick);
  EXPECT_EQ(m.state.tick, tick);
  EXPECT_EQ(m.sensors.tick, tick);
  EXPECT_EQ(m.contact.utime, utime);
  EXPECT_EQ(m.state.utime, utime);
  EXPECT_EQ(m.sensors.utime, utime);
  EXPECT_EQ(m.contact.time_s, time_s);
  EXPECT_EQ(m.state.time_s, time_s);
  EXPECT_EQ(m.contact.last, last);
  EXPECT_EQ(m.state.last, last);
  EXPECT_EQ(m.sensors.last, last);
}

TEST(PlantMessages, TimesInCountdownAndRun) {
  const sim::Scenario s = sphere();
  sim::Plant plant(s);
  expect_times(plant_messages(s, plant.sample(), -2, false), -2, -5000, 0, false);
  expect_times(plant_messages(s, plant.sample(), -1, false), -1, -2500, 0, false);
  expect_times(plant_messages(s, plant.sample(), 0, false), 0, 0, 0, false);
  plant.advance(0.0025, {});
  expect_times(plant_messages(s, plant.sample(), 1, false), 1, 2500, 0.0025, false);
  plant.advance(0.0038767, {});  // a run that ends inside tick 1: the sample's own time, rounded up to whole us
  expect_times(plant_messages(s, plant.sample(), 2, true), 2, 3877, 0.0038767, true);
}

}  // namespace
}  // namespace ballast::sil
