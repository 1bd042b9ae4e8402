// Faults of plant and motors against closed forms: pushes, a floor that becomes slippery, motors without current,
// with half a coil, reversed, or with their mass held.
#include <gtest/gtest.h>

#include <numbers>

#include "sim/motors/stepper.h"
#include "sim/plant/plant.h"
#include "tests/physics/solid_ball.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;

Fault fault(FaultKind kind, double time_s, double value, double end_s = kToTheEnd) {
  Fault f;
  f.kind = kind;
  f.time_s = time_s;
  f.end_s = end_s;
  f.value = value;
  return f;
}

// A rolling solid ball has 7/5 m of inertia along the floor: v = F t / (7/5 m) while it is pushed, and keeps it. The
// push neither begins nor ends with a tick of most of these periods; 1e-12 is the integrator's tolerance.
TEST(PlantFault, APushGivesItsImpulse) {
  Scenario s = solid_ball();
  s.faults = {fault(FaultKind::kPush, 0.5003, 0.2, 0.8001)};
  s.faults[0].direction_W = Vector3d(0.6, 0.8, 0);
  const double gained = 0.2 * (0.8001 - 0.5003) / (1.4 * 0.5);
  for (const double period_s : {0.001, 0.1, 3.0}) {
    Plant plant(s);
    go(plant, 0.5, period_s);
    EXPECT_EQ(plant.sample().velocity_W_mps.norm(), 0);
    go(plant, 3, period_s);
    EXPECT_LT((plant.sample().velocity_W_mps - gained * Vector3d(0.6, 0.8, 0)).norm(), 1e-12);
    // The floor takes 2/7 of it, from the first instant on.
    EXPECT_NEAR(plant.extrema().static_friction_max.value, 0.2 * 2 / 7, 1e-12);
    EXPECT_NEAR(plant.extrema().static_friction_max.time_s, 0.5003, 1e-12);
    EXPECT_NEAR(plant.sample().static_friction_n, 0, 1e-12);
  }
}

TEST(PlantFault, PushesAddUp) {
  Scenario s = solid_ball();
  s.faults = {fault(FaultKind::kPush, 0.5, 0.2, 1.5), fault(FaultKind::kPush, 1, 0.1, 2)};
  Plant plant(s);
  go(plant, 3, 0.01);
  EXPECT_NEAR(plant.sample().velocity_W_mps[0], (0.2 + 0.1) / (1.4 * 0.5), 1e-12);
}

// Pulled along with F it needs 2/7 F of friction; the floor gives less from 1.2345 s on.
TEST(PlantFault, ARunSlipsWhereTheFloorBecomesSlippery) {
  Scenario s = solid_ball();
  s.surface.static_friction = s.surface.kinetic_friction = 0.5;
  s.surface.kinetic_friction = 0.4;
  s.external_force_W_n = Vector3d(1, 0, 0);
  const double needed = 2.0 / 7 / (0.5 * 9.81);
  for (const double period_s : {0.001, 0.1, 3.0}) {
    s.faults = {fault(FaultKind::kFrictionFalls, 1.2345, 1.01 * needed)};
    Plant enough(s);
    go(enough, 3, period_s);
    EXPECT_FALSE(enough.rolling_lost());
    EXPECT_EQ(enough.sample().floor_static_friction, 1.01 * needed);

    s.faults[0].value = 0.99 * needed;
    Plant plant(s);
    go(plant, 3, period_s);
    ASSERT_EQ(plant.regimes().size(), 2u);
    EXPECT_EQ(plant.regimes()[1].regime, Regime::kSliding);
    EXPECT_EQ(plant.regimes()[1].time_s, 1.2345);
    // The kinetic friction falls in proportion: v' = F / m - mu_k g from there on.
    const double rolled = 1.2345 / (1.4 * 0.5), slide_s = 3 - 1.2345;
    const double kinetic = 0.99 * needed * 0.4 / 0.5;
    EXPECT_NEAR(plant.sample().velocity_W_mps[0], rolled + (1 / 0.5 - kinetic * 9.81) * slide_s, 1e-10);
  }
}

// Over the ice and on: rolling is found again after the patch.
TEST(PlantFault, APatchOfIceEnds) {
  Scenario s = solid_ball();
  s.surface.static_friction = s.surface.kinetic_friction = 0.5;
  s.external_force_W_n = Vector3d(1, 0, 0);
  s.faults = {fault(FaultKind::kFrictionFalls, 1, 0.01, 1.5)};
  Plant plant(s);
  go(plant, 3, 0.01);
  ASSERT_EQ(plant.regimes().size(), 3u);
  EXPECT_EQ(plant.regimes()[1].time_s, 1);
  EXPECT_EQ(plant.regimes()[2].regime, Regime::kRolling);
  EXPECT_GT(plant.regimes()[2].time_s, 1.5);
}

Motor motor() {
  Motor m;
  m.holding_torque_nm = 2;
  m.corner_speed_radps = 1e9;
  m.step_error = 0;
  m.viscous_damping_nms = 0.25;
  m.shaft_ratio = 1;
  return m;
}

// 50 teeth: a lag of a quarter of a tooth pitch's 2 pi / 50 is the greatest torque.
TEST(StepperFault, WithoutCurrentOnlyTheDampingIsLeft) {
  Stepper stepper(motor(), 0, 1);
  const double lag = -std::numbers::pi / 2 / 50;
  EXPECT_NEAR(stepper.torque_nm(lag, 0), 2, 1e-12);
  stepper.power(false);
  EXPECT_EQ(stepper.torque_nm(lag, 0), 0);
  EXPECT_EQ(stepper.torque_nm(lag, 2), -0.5);
  stepper.power(true);
  EXPECT_NEAR(stepper.torque_nm(lag, 0), 2, 1e-12);
}

// Coils at a right angle: torque -cos(a) sin(r) of the first, k sin(a) cos(r) of the second, a and r the electrical
// angles of field and rotor, times the torque of a whole coil.
TEST(StepperFault, AWeakCoilGivesItsPartOfTheTorque) {
  for (const double k : {0.0, 0.3, 1.0}) {
    for (int step = 0; step < 64; ++step) {
      Stepper stepper(motor(), 0, 1);
      stepper.weaken_coil(k);
      for (int j = 0; j < step; ++j) stepper.step(1, 0);
      const double a =
          step * 2 * std::numbers::pi / 64;  // 4 full steps, of 16 microsteps each, are a turn of the field
      for (const double rotor_rad : {-0.01, 0.0, 0.003, 0.02}) {
        const double r = 50 * rotor_rad;
        EXPECT_NEAR(stepper.torque_nm(rotor_rad, 0), 2 * (k * std::sin(a) * std::cos(r) - std::cos(a) * std::sin(r)),
                    1e-12);
      }
    }
  }
}

// Two motors at full steps that only the second coils hold: the mass whose second coil is gone swings out.
TEST(PlantFault, AWeakCoilIsItsOwnMotors) {
  Scenario s = solid_ball();
  s.run.actuation = Actuation::kStepper;
  Mass mass;
  mass.mass_kg = 0.2;
  mass.rail = firmware::circle_about(0.05, 0, 0);
  mass.motor = motor();
  s.masses = {mass, mass, mass};
  for (int weak = 0; weak < 3; ++weak) {
    SCOPED_TRACE(weak);
    s.faults = {fault(FaultKind::kWeakCoil, 0.5, 0)};
    s.faults[0].mass = weak;
    Plant plant(s);
    std::vector<StepPulse> pulses;
    for (int j = 0; j < 16; ++j) {
      for (int i = 0; i < 3; ++i) pulses.push_back({0.03 * j, i, 1});
    }
    plant.advance(0.499, pulses);
    const auto before = plant.sample().mass_position;
    go(plant, 0.6, 0.01);
    for (int i = 0; i < 3; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double moved = std::abs(plant.sample().mass_position[k] - before[k]);
      EXPECT_EQ(moved > 0.01, i == weak) << "mass " << i << " has moved by " << moved;
    }
  }
}

TEST(StepperFault, SwallowedPulsesAreLostStepsOfTheirDirection) {
  Stepper stepper(motor(), 0, 1);
  const double microstep = 2 * std::numbers::pi / 3200;
  for (int j = 0; j < 10; ++j) stepper.step(1, j);
  stepper.swallow(4);
  for (int j = 10; j < 20; ++j) stepper.step(1, j);
  // The field has made 16 of 20, and the rotor, where it asks for no torque, is with it.
  EXPECT_NEAR(stepper.torque_nm(16 * microstep, 0), 0, 1e-12);
  EXPECT_NEAR(stepper.steps_behind(16 * microstep), 4, 1e-9);
  EXPECT_EQ(stepper.lost_steps(), 4);
}

TEST(StepperFault, ReversedWiringTurnsItTheOtherWay) {
  Stepper stepper(motor(), 0, 1);
  const double microstep = 2 * std::numbers::pi / 3200;
  stepper.reverse(true);
  for (int j = 0; j < 10; ++j) stepper.step(1, j);
  EXPECT_NEAR(stepper.torque_nm(-10 * microstep, 0), 0, 1e-12);
  EXPECT_NEAR(stepper.steps_behind(-10 * microstep), 20, 1e-9);
  EXPECT_EQ(stepper.lost_steps(), 20);
}

// Masses of 0.2 kg on rings of 0.05 m in a heavy ball, driven at 1 rad/s, one of them held from 0.5 s on: it stays
// within a hundredth of a radian of where it was held (plant.cpp, kBlockStiffness), while its motor goes on and loses
// steps. The others go on.
TEST(PlantFault, ABlockedRailHoldsItsMass) {
  Scenario s = solid_ball();
  s.run.actuation = Actuation::kStepper;
  Mass mass;
  mass.mass_kg = 0.2;
  mass.rail = firmware::circle_about(0.05, 0, 0);
  mass.motor = motor();
  mass.motor.holding_torque_nm = 0.3;
  mass.motor.viscous_damping_nms = 0.05;
  s.masses = {mass, mass};
  for (int blocked = 0; blocked < 2; ++blocked) {
    SCOPED_TRACE(blocked);
    s.faults = {fault(FaultKind::kBlockedRail, 0.5, 0, 1.5)};
    s.faults[0].mass = blocked;
    const auto held_one = static_cast<std::size_t>(blocked), free_one = 1 - held_one;
    Plant plant(s);
    const auto drive = [&plant](double end_s) {
      std::vector<StepPulse> pulses;  // 3200 microsteps are a turn: 509 pulses a second make 1 rad/s
      while (plant.time_s() < end_s - 1e-9) {
        pulses.clear();
        for (int j = 0; j < 5; ++j) {
          for (int i = 0; i < 2; ++i) pulses.push_back({0.002 * j, i, 1});
        }
        plant.advance(plant.time_s() + 0.01, pulses);
      }
    };
    drive(0.5);
    const double held = plant.sample().mass_position[held_one];
    EXPECT_GT(held, 0.4);
    for (double t = 0.6; t < 1.45; t += 0.1) {
      drive(t);
      EXPECT_NEAR(plant.sample().mass_position[held_one], held, 0.01);
    }
    EXPECT_GT(plant.sample().mass_position[free_one], held + 0.5);
    EXPECT_GT(plant.sample().lost_steps[held_one], 0);
    EXPECT_EQ(plant.sample().lost_steps[free_one], 0);
    drive(3);
    EXPECT_GT(plant.sample().mass_position[held_one], held + 0.5);  // let go, it follows again
  }
}

}  // namespace
}  // namespace ballast::sim
