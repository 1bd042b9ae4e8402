// Electrical work in = mechanical change + losses.
#include <gtest/gtest.h>

#include <cmath>

#include "sim/motors/motor_presets.h"
#include "sim/motors/phase_current.h"
#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"

namespace ballast::sim {
namespace {

Motor motor(const char* name, double shaft_ratio, double damping_nms, double supply_v) {
  const MotorPreset& preset = *find_motor_preset(name);
  Motor m;
  m.holding_torque_nm = preset.holding_torque_nm;
  m.detent_torque_nm = 0.05 * preset.holding_torque_nm;
  m.rotor_inertia_kgm2 = preset.rotor_inertia_kgm2;
  m.viscous_damping_nms = damping_nms;
  m.rated_current_a = preset.rated_current_a;
  m.resistance_ohm = preset.resistance_ohm;
  m.inductance_h = preset.inductance_h;
  m.supply_voltage_v = supply_v;
  m.corner_speed_radps = PhaseCurrent(m).corner_speed_radps();
  m.shaft_ratio = shaft_ratio;
  return m;
}

// A rolling ball, one motor of each class; the first on a supply that cannot drive its currents at the speed asked for.
Scenario ball() {
  Scenario s;
  s.duration_s = 1;
  s.gravity_mps2 = 9.81;
  s.ball = {
      .radius_m = 0.15, .mass_kg = 0.8, .inertia_kgm2 = {0.010, 0.011, 0.012}, .center_of_mass_B_m = {0, 0, -0.01}};
  s.initial.angular_velocity_B_radps = {0.5, -0.3, 0.2};
  s.run.tolerance = 1e-12;  // of the mechanics
  const Motor motors[] = {motor("nema11", 10, 2e-4, 10), motor("nema17", 4, 0.01, 24), motor("nema23", 2, 0.02, 30)};
  for (int i = 0; i < 3; ++i) {
    Mass m;
    m.mass_kg = 0.2;
    m.rail = firmware::circle_about(0.1, i * 1.1, 0.3);
    m.initial_position = -1.2 + 0.4 * i;
    m.motor = motors[i];
    s.masses.push_back(m);
  }
  return s;
}

TEST(MotorEnergy, WhatGoesInIsWhatComesOut) {
  const Scenario s = ball();
  Plant plant(s);
  const auto mechanical = [&] {
    const auto p = plant.sample();
    return test::whole(s, p).energy_j + test::rotor_energy_j(s, p);
  };
  const double before = mechanical();
  double fastest = 0;
  for (int k = 0; k < 1000; ++k) {
    // Microsteps at growing rates, the first motor's up to 16 a millisecond: 31 rad/s, its corner is at 15.
    std::vector<StepPulse> pulses;
    const int count = std::min(16, k / 20);
    for (int j = 0; j < count; ++j) pulses.push_back({0.001 * j / count, 0, +1});
    for (int j = 0; j < 3; ++j) pulses.push_back({0.001 * (j + 0.5) / 3, 1 + j % 2, j == 1 ? -1 : +1});
    std::sort(pulses.begin(), pulses.end(), [](const auto& a, const auto& b) { return a.offset_s < b.offset_s; });
    plant.advance((k + 1) * 0.001, pulses);
    fastest = std::max(fastest, 10 * std::abs(plant.sample().mass_velocity[0]));
  }
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
  EXPECT_GT(fastest, 1.5 * s.masses[0].motor.corner_speed_radps);

  double work_j = 0;
  for (int i = 0; i < 3; ++i) {
    const MotorEnergy e = plant.motor_energy(i);
    const Motor& m = s.masses[static_cast<std::size_t>(i)].motor;
    // Lobatto's rule of order 6 over steps of at most a radian of a swing, each: 1e-8 of what is exchanged.
    const double scale = e.electrical_j + std::abs(e.work_j);
    EXPECT_NEAR(e.electrical_j, e.copper_j + e.friction_j + e.work_j + e.stored_j, 1e-8 * scale) << i;
    const double full_w = 2 * m.rated_current_a * m.rated_current_a * m.resistance_ohm;
    if (i == 0) {
      EXPECT_LT(e.copper_j, 0.95 * full_w);  // the supply no longer drives the whole current
    } else {
      EXPECT_NEAR(e.copper_j, full_w, 1e-9 * full_w);
    }
    EXPECT_GT(e.friction_j, 0);
    work_j += e.work_j;
  }
  EXPECT_GT(std::abs(work_j), 1e-2);
  // Summed over some 1e4 steps; the mechanics are good to 1e-11 of a few joules.
  EXPECT_NEAR(mechanical() - before, work_j, 1e-8 * (1 + std::abs(work_j)));
}

// The energy lost in a stop is the motor's work on mass and ball, and not a gap in its account.
TEST(MotorEnergy, AStopsHeatIsWorkOfTheMotor) {
  Scenario s = ball();
  s.masses.resize(1);
  Mass& mass = s.masses[0];
  mass.rail = firmware::line({0, 0, -0.02}, {1, 0, 0});
  mass.rail.lower_end = -0.05;
  mass.rail.upper_end = 0.01;
  mass.end_stops = {2000, 0.4};
  mass.initial_position = 0;
  mass.motor = motor("nema11", 2 * M_PI / 0.02, 2e-4, 24);
  Plant plant(s);
  for (int k = 0; k < 400; ++k) {
    std::vector<StepPulse> pulses;
    for (int j = 0; j < 8; ++j) pulses.push_back({0.001 * j / 8, 0, +1});  // 49 rad/s, 0.16 m/s
    plant.advance((k + 1) * 0.001, pulses);
  }
  ASSERT_GE(plant.end_stop(0).touches, 1);
  const MotorEnergy e = plant.motor_energy(0);
  // As above; a motor that slips against its stop swings harder, and steps are bounded by the plant's 1e-9 only.
  EXPECT_NEAR(e.electrical_j, e.copper_j + e.friction_j + e.work_j + e.stored_j, 1e-7 * e.electrical_j);
  EXPECT_GT(e.work_j, 0);
}

// A motor that holds still turns all of it into heat.
TEST(MotorEnergy, HoldingIsHeat) {
  Scenario s = ball();
  s.initial.angular_velocity_B_radps.setZero();
  s.masses.resize(1);
  s.masses[0].rail = firmware::circle({0, 0, 0}, 0.11, {1, 0, 0}, {0, 0, 1});
  s.masses[0].initial_position = -M_PI / 2;  // straight below the centre
  s.masses[0].motor.detent_torque_nm = 0;
  Plant plant(s);
  for (int k = 1; k <= 1000; ++k) plant.advance(k * 0.001, {});
  const MotorEnergy e = plant.motor_energy(0);
  EXPECT_NEAR(e.electrical_j, 2 * 0.67 * 0.67 * 9.2, 1e-10);  // 1 s; rounding
  EXPECT_NEAR(e.copper_j, e.electrical_j, 1e-10);
  EXPECT_NEAR(e.work_j, 0, 1e-12);
}

}  // namespace
}  // namespace ballast::sim
