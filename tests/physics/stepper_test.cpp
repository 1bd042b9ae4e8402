// The motor model of physics.md section 5, alone and coupled to the ball.
#include "sim/motors/stepper.h"

#include <gtest/gtest.h>

#include <numbers>

#include "sim/motors/motor_presets.h"
#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"

namespace ballast::sim {
namespace {

constexpr double kPi = std::numbers::pi;

Motor motor() {
  Motor m;
  m.holding_torque_nm = 0.4;
  m.detent_torque_nm = 0.02;
  m.rotor_inertia_kgm2 = 5.4e-6;
  m.viscous_damping_nms = 0.01;
  m.corner_speed_radps = 30;
  m.step_error = 0;
  m.shaft_ratio = 1;
  return m;
}

TEST(Stepper, TorqueIsTheFormulaOfSectionFive) {
  Stepper s(motor(), 0.5, 0);
  for (int i = 0; i < 10; ++i) s.step(+1, 0);
  const double field = 0.5 + 10 * 2 * kPi / 3200;
  for (const double phi : {0.5, 0.51, 0.53}) {
    for (const double rate : {-3.0, 0.0, 20.0}) {
      EXPECT_NEAR(s.torque_nm(phi, rate), 0.4 * std::sin(50 * (field - phi)) - 0.02 * std::sin(200 * phi) - 0.01 * rate,
                  1e-14);
    }
  }
}

TEST(Stepper, HoldingTorqueFallsAboveTheCornerSpeed) {
  const Stepper s(motor(), 0, 0);
  EXPECT_EQ(s.available_torque_nm(-30), 0.4);
  EXPECT_DOUBLE_EQ(s.available_torque_nm(60), 0.2);
}

TEST(Stepper, ToothErrorsAreFixedBySeedAndBounded) {
  Motor m = motor();
  m.step_error = 0.015;
  m.microsteps = 1;
  m.detent_torque_nm = m.viscous_damping_nms = 0;
  const double full_step = 2 * kPi / 200;
  // The zero of the torque is where the field points; the rotor is put where an ideal motor's field would point.
  const auto error = [&](std::uint64_t seed, int steps) {
    Stepper s(m, 0, seed);
    for (int i = 0; i < steps; ++i) s.step(+1, 0);
    return std::asin(s.torque_nm(steps * full_step, 0) / 0.4) / 50;
  };
  double largest = 0;
  for (int steps = 1; steps <= 200; ++steps) {
    EXPECT_EQ(error(1, steps), error(1, steps));
    largest = std::max(largest, std::abs(error(1, steps)));
  }
  EXPECT_LE(largest, 2 * 0.015 * full_step);  // two teeth, each within 1.5 % of a step
  EXPECT_GT(largest, 0.5 * 0.015 * full_step);
  EXPECT_NE(error(1, 7), error(2, 7));
  EXPECT_NEAR(error(1, 207), error(1, 7), 1e-12);  // the pattern repeats with the revolution
}

// Half a tooth pitch is pi of the electrical angle, two full steps; past it four full steps are lost at once.
TEST(Stepper, LostStepsAreCountedPerTooth) {
  Stepper s(motor(), 0, 0);
  for (int i = 0; i < 31; ++i) s.step(+1, 0);  // 31/16 full steps ahead: not yet
  s.count_slips(0);
  EXPECT_EQ(s.lost_steps(), 0);
  for (int i = 0; i < 2; ++i) s.step(+1, 0);
  s.count_slips(0);
  EXPECT_EQ(s.lost_steps(), 64);
  for (int i = 0; i < 64; ++i) s.step(+1, 0);
  s.count_slips(0);
  EXPECT_EQ(s.lost_steps(), 128);
  EXPECT_EQ(s.slips(), 2);
  EXPECT_EQ(s.steps_behind(0), 97);
  // A tooth that the rotor recovers is not lost; it has slipped once more for that.
  s.count_slips(2 * kPi / 50);
  EXPECT_EQ(s.lost_steps(), 64);
  EXPECT_EQ(s.slips(), 3);
  EXPECT_NEAR(s.steps_behind(2 * kPi / 50), 97 - 64, 1e-12);
  s.count_slips(5 * 2 * kPi / 50);  // and ahead is off as well
  EXPECT_EQ(s.lost_steps(), 3 * 64);
}

TEST(Stepper, BalanceHoldsTheLoad) {
  Stepper s(motor(), 0.3, 0);
  for (const double rate : {0.0, 2.0, -20.0}) {
    s.balance(0.15, rate);
    EXPECT_NEAR(s.torque_nm(0.3, rate), 0.15, 1e-15);
  }
  s.balance(-7, 0);  // cannot be held: all there is
  EXPECT_NEAR(s.torque_nm(0.3, 0), -0.4 - 0.02 * std::sin(200 * 0.3), 1e-15);
}

Scenario driven_ball(double holding_torque_nm, double damping) {
  Scenario s;
  s.duration_s = 5;
  s.gravity_mps2 = 9.81;
  s.ball = {
      .radius_m = 0.15, .mass_kg = 0.8, .inertia_kgm2 = {0.010, 0.011, 0.012}, .center_of_mass_B_m = {0, 0, -0.01}};
  for (int i = 0; i < 3; ++i) {
    Mass m;
    m.mass_kg = 0.25;
    m.rail = firmware::circle_about(0.11, i * 1.1, 0.3);
    m.initial_position = -1.2 + 0.4 * i;
    m.motor = motor();
    m.motor.holding_torque_nm = holding_torque_nm;
    m.motor.detent_torque_nm = 0;
    m.motor.viscous_damping_nms = damping;
    m.motor.rotor_inertia_kgm2 = 1e-4;
    m.motor.corner_speed_radps = 1e6;
    s.masses.push_back(m);
  }
  return s;
}

// With fixed fields, no damping and no detent the whole is conservative: a magnetic spring per mass. The rotor's own
// spin is not coupled to the ball's in section 5, nor here.
TEST(DrivenPlant, ConservesEnergyWithFixedFields) {
  Scenario s = driven_ball(2.0, 0);
  s.initial.angular_velocity_B_radps = {0.5, -0.3, 0.2};
  Plant plant(s);
  const auto start = plant.sample();
  const test::Fields field = test::balanced_fields(s, start);
  const auto energy = [&](const Plant::Sample& p) {
    return test::whole(s, p).energy_j + test::rotor_energy_j(s, p) + test::magnetic_energy_j(s, p, field);
  };
  const double before = energy(start);
  for (int k = 1; k <= 5000; ++k) plant.advance(k * 0.001, {});
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
  const auto end = plant.sample();
  EXPECT_GT((end.angular_velocity_B_radps - start.angular_velocity_B_radps).norm(), 0.01);  // something moved
  // 5 s of steps each good to 1e-12, against energies of a few joules.
  EXPECT_NEAR(energy(end), before, 1e-8);
}

// The motors balance their load at t = 0, so a ball at rest in a stable position stays there.
TEST(DrivenPlant, StaysAtRestInEquilibrium) {
  Scenario s = driven_ball(2.0, 0.01);
  s.masses.resize(1);
  s.masses[0].rail = firmware::circle({0, 0, 0}, 0.11, {1, 0, 0}, {0, 0, 1});
  s.masses[0].initial_position = -kPi / 2;  // straight below the centre
  Plant plant(s);
  for (int k = 1; k <= 2000; ++k) plant.advance(k * 0.001, {});
  EXPECT_LT(plant.sample().angular_velocity_B_radps.norm(), 1e-12);  // rounding only
  EXPECT_NEAR(plant.sample().mass_position[0], -kPi / 2, 1e-12);
}

// Held sideways by a motor too weak for it, the mass falls and the rotor slips from tooth to tooth; the count is the
// distance between field and rotor, in teeth.
TEST(DrivenPlant, WeakMotorLosesStepsAndTheCountIsRight) {
  Scenario s = driven_ball(0.05, 1e-3);  // 0.25 kg * 9.81 * 0.11 m = 0.27 N m is needed
  s.masses.resize(1);
  s.masses[0].rail = firmware::circle({0, 0, 0}, 0.11, {1, 0, 0}, {0, 0, 1});
  s.masses[0].initial_position = 0;
  Plant plant(s);
  for (int k = 1; k <= 400 && plant.sample().mass_position[0] > -1; ++k) plant.advance(k * 0.001, {});
  const auto p = plant.sample();
  const double field = std::asin(1.0) / 50;  // balance() put it at the angle of greatest torque
  const auto teeth = std::llround((field - p.mass_position[0]) * 50 / (2 * kPi));
  EXPECT_GE(teeth, 5);
  EXPECT_EQ(p.lost_steps[0], teeth * 64);
  EXPECT_LT(plant.motor_extrema(0).torque_margin, 0);
}

TEST(DrivenPlant, PulsesMoveTheMassToWhereTheyAreCommanded) {
  Scenario s = driven_ball(2.0, 0.02);
  s.masses.resize(1);
  s.masses[0].rail = firmware::circle({0, 0, 0}, 0.11, {1, 0, 0}, {0, 0, 1});
  s.masses[0].initial_position = -kPi / 2;
  Plant plant(s);
  // 80 microsteps in 0.8 s, one each 10 ms, in the middle of a tick; then time to settle.
  for (int k = 0; k < 5000; ++k) {
    std::vector<StepPulse> pulses;
    if (k < 800 && k % 10 == 0) pulses.push_back({0.0005, 0, +1});
    plant.advance((k + 1) * 0.001, pulses);
  }
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
  const double commanded = 80 * 2 * kPi / 3200;
  const auto p = plant.sample();
  // Lag under gravity: at most asin(0.27/2)/50 = 2.7e-3 rad.
  EXPECT_NEAR(p.mass_position[0], -kPi / 2 + commanded, 3e-3);
  EXPECT_EQ(p.lost_steps[0], 0);
}

Motor nema17() {
  const MotorPreset& preset = *find_motor_preset("nema17");
  Motor m;
  m.holding_torque_nm = preset.holding_torque_nm;
  m.rotor_inertia_kgm2 = preset.rotor_inertia_kgm2;
  m.rated_current_a = preset.rated_current_a;
  m.resistance_ohm = preset.resistance_ohm;
  m.inductance_h = preset.inductance_h;
  m.supply_voltage_v = preset.supply_voltage_v;
  m.corner_speed_radps = PhaseCurrent(m).corner_speed_radps();
  return m;
}

// A motor that turns as the run begins, faster than its supply drives the whole current: it is balanced under its load,
// and stays so when the first tick begins and when the even pulses come.
TEST(Stepper, BalancedAtSpeedStaysBalanced) {
  Motor m = nema17();
  m.step_error = 0;
  const double speed = 4 * m.corner_speed_radps, load_nm = 0.06;
  Stepper stepper(m, 0, 1);
  stepper.balance(load_nm, speed);
  EXPECT_NEAR(stepper.torque_nm(0, speed), load_nm, 1e-12);
  stepper.wait(0);
  EXPECT_NEAR(stepper.torque_nm(0, speed), load_nm, 1e-12);
  const double microstep_rad = 2 * kPi / (m.steps_per_revolution * m.microsteps);
  for (int k = 0; k < 20; ++k) {
    const double time_s = (k + 0.5) * microstep_rad / speed;
    stepper.step(1, time_s);
    stepper.wait(time_s);
    // Half a microstep of the field ahead of the even motion: the torque is that of the load and half of what a
    // microstep is worth.
    EXPECT_NEAR(stepper.torque_nm(speed * time_s, speed), load_nm,
                m.holding_torque_nm * m.steps_per_revolution / 4 * microstep_rad)
        << k;
  }
}

// A load that drives the motor is held by more than the motor could drive: that is no lack of torque.
TEST(Stepper, MarginOfABrakingMotorIsThatOfBraking) {
  Motor m = nema17();
  m.step_error = 0;
  const double speed = 2 * m.corner_speed_radps, load_nm = -0.21;
  const PhaseCurrent phases(m);
  ASSERT_LT(phases.pull_out(speed).torque_nm, 0.21);
  ASSERT_GT(phases.most_braking(speed).torque_nm, 0.21);
  Stepper stepper(m, 0, 1);
  stepper.balance(load_nm, speed);
  ASSERT_NEAR(stepper.torque_nm(0, speed), load_nm, 1e-9);
  EXPECT_NEAR(stepper.torque_margin(0, speed), 1 - 0.21 / phases.most_braking(speed).torque_nm, 1e-6);
}

}  // namespace
}  // namespace ballast::sim
