// Floors that change with place: closed forms, conserved quantities and runs cut by hand at the border.
#include "sim/plant/local_floor.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"
#include "tests/physics/random_robot.h"
#include "tests/physics/solid_ball.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

SurfacePatch like_floor(const Surface& floor) {
  SurfacePatch patch;
  patch.static_friction = floor.static_friction;
  patch.kinetic_friction = floor.kinetic_friction;
  patch.rolling_resistance = floor.rolling_resistance;
  return patch;
}

// A strip across e1, so long that nothing rolls around it.
SurfacePatch strip(const Surface& floor, double from_m, double to_m) {
  SurfacePatch patch = like_floor(floor);
  patch.polygon_W_m = {{from_m, -1e3}, {to_m, -1e3}, {to_m, 1e3}, {from_m, 1e3}};
  return patch;
}

SurfacePatch circle(const Surface& floor, const Vector2d& center, double radius_m) {
  SurfacePatch patch = like_floor(floor);
  patch.center_W_m = center;
  patch.radius_m = radius_m;
  return patch;
}

// Rolls along e1 at this speed.
void roll(Scenario& s, double speed_mps) {
  s.initial.angular_velocity_B_radps = Vector3d(0, speed_mps / s.ball.radius_m, 0);
}

TEST(LocalFloor, DepthIsTheDistanceToTheBorder) {
  Surface floor;
  const SurfacePatch round = circle(floor, {1, 2}, 0.5);
  EXPECT_DOUBLE_EQ(depth_m(round, {1, 2}), 0.5);
  EXPECT_DOUBLE_EQ(depth_m(round, {1.75, 2}), -0.25);
  // An L, which is not convex.
  SurfacePatch corner = like_floor(floor);
  corner.polygon_W_m = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 3}, {0, 3}};
  EXPECT_DOUBLE_EQ(depth_m(corner, {0.5, 2}), 0.5);
  EXPECT_DOUBLE_EQ(depth_m(corner, {1.25, 1.5}), -0.25);
  EXPECT_DOUBLE_EQ(depth_m(corner, {1.5, 0.75}), 0.25);
  EXPECT_DOUBLE_EQ(depth_m(corner, {5, -4}), -5);  // (2, 0) is 3 and 4 away
  EXPECT_DOUBLE_EQ(depth_m(corner, {0.9, 0.9}), std::hypot(0.1, 0.1));
  EXPECT_DOUBLE_EQ(depth_m(corner, {-1, -1}), -std::sqrt(2.0));
  EXPECT_EQ(depth_m(corner, {0, 2}), 0);  // the border itself
  EXPECT_TRUE(std::isnan(depth_m(corner, {std::nan(""), 0})));
}

TEST(LocalFloor, TheLastPatchCountsWhereTheyOverlap) {
  Surface surface;
  surface.static_friction = surface.kinetic_friction = 0.9;
  surface.patches = {circle(surface, {0, 0}, 2), circle(surface, {1, 0}, 2), circle(surface, {0, 0}, 0.5)};
  for (std::size_t i = 0; i < 3; ++i) surface.patches[i].static_friction = static_cast<double>(i + 1);
  LocalFloor floor(surface);
  const auto at = [&](double x) {
    floor.stand_at({x, 0});
    EXPECT_LE(floor.overdue_m({x, 0}), 0) << x;
    return floor.static_friction();
  };
  EXPECT_EQ(at(-3), 0.9);
  EXPECT_EQ(at(-1.5), 1);
  EXPECT_EQ(at(-0.75), 2);
  EXPECT_EQ(at(0.1), 3);
  EXPECT_EQ(at(2.5), 2);
  EXPECT_EQ(at(4), 0.9);
  // On patch 1, at 0.6: patch 2 begins at 0.5, patch 1 ends at 3, and patch 0, which ends at 2, does not matter.
  floor.stand_at({0.6, 0});
  EXPECT_NEAR(floor.overdue_m({0.5, 0}), 0, 1e-15);
  EXPECT_NEAR(floor.overdue_m({0.3, 0}), 0.2, 1e-15);
  EXPECT_NEAR(floor.overdue_m({2.5, 0}), -0.5, 1e-15);
  EXPECT_NEAR(floor.overdue_m({3.25, 0}), 0.25, 1e-15);
}

// On a strip of c_rr a homogeneous ball slows down by v' = -A v / sqrt(v^2 + c^2), A = 5/7 c_rr g, c = omega_c r.
// So v sqrt(v^2 + c^2) + c^2 asinh(v / c) falls by 2 A per metre, and sqrt(v^2 + c^2) + c ln(v / (c + sqrt(v^2 + c^2)))
// by A per second.
struct Slowing {
  double a_mps2, c_mps;
  [[nodiscard]] double speed_after(double v0_mps, double way_m) const {
    const auto lost = [&](double v) { return (v * std::hypot(v, c_mps) + c_mps * c_mps * std::asinh(v / c_mps)) / 2; };
    const double target = lost(v0_mps) - a_mps2 * way_m;
    double v = v0_mps;
    for (int i = 0; i < 60; ++i) v -= (lost(v) - target) / std::hypot(v, c_mps);
    return v;
  }
  [[nodiscard]] double time_s(double v0_mps, double v1_mps) const {
    const auto spent = [&](double v) {
      return std::hypot(v, c_mps) + c_mps * std::log(v / (c_mps + std::hypot(v, c_mps)));
    };
    return (spent(v0_mps) - spent(v1_mps)) / a_mps2;
  }
};

// The place after the strip depends on the times at both borders. Ticks are irregular, so that borders fall anywhere in
// steps, and the strips include one that is a tenth of a tick wide.
TEST(LocalFloor, AStripThatResistsIsEnteredAndLeftInTime) {
  for (const Actuation actuation : {Actuation::kPrescribed, Actuation::kStepper, Actuation::kIdeal}) {
    for (const double width_m : {1.3, 0.21, 1e-3, 1e-4}) {
      SCOPED_TRACE(std::string(to_string(actuation)) + " " + std::to_string(width_m));
      Scenario s = solid_ball();
      s.run.actuation = actuation;
      s.duration_s = 4;
      const double v0 = 0.9, begin_m = 0.777, c_rr = 0.02;
      s.surface.patches = {strip(s.surface, begin_m, begin_m + width_m)};
      s.surface.patches[0].rolling_resistance = c_rr;
      roll(s, v0);
      Plant plant(s);
      go(plant, 4, actuation == Actuation::kPrescribed ? 0.37 : 0.00137);
      const double g = s.gravity_mps2, r = s.ball.radius_m;
      const Slowing slowing{5.0 / 7 * c_rr * g, 1e-3 * std::sqrt(g / r) * r};
      const double v1 = slowing.speed_after(v0, width_m);
      const double left_s = begin_m / v0 + slowing.time_s(v0, v1);
      ASSERT_LT(left_s, 4);
      // 4000 steps at 1e-10 of the state while rolling with driven masses; one of 1e-13 otherwise.
      const Sample end = plant.sample();
      EXPECT_NEAR(end.velocity_W_mps[0], v1, 1e-10);
      EXPECT_NEAR(end.position_W_m[0], begin_m + width_m + v1 * (4 - left_s), 3e-10);
    }
  }
}

// Chords of a circle. The time on it is the chord's length at nearly v0.
TEST(LocalFloor, AGlancingBallCrossesACircleOnce) {
  for (const double aside : {0.0, 0.5, 0.99, 0.99999, 1.0000001}) {
    SCOPED_TRACE(aside);
    Scenario s = solid_ball();
    s.duration_s = 4;
    s.surface.patches = {circle(s.surface, {1.5, 0}, 0.3)};
    s.surface.patches[0].rolling_resistance = 0.02;
    s.initial.position_W_m = {0, 0.3 * aside};
    roll(s, 0.9);
    Plant plant(s);
    go(plant, 4, 0.5);
    const double chord_m = 0.6 * std::sqrt(std::max(0.0, 1 - aside * aside));
    const Slowing slowing{5.0 / 7 * 0.02 * 9.81, 1e-3 * std::sqrt(9.81 * 0.1)};
    EXPECT_NEAR(plant.sample().velocity_W_mps[0], slowing.speed_after(0.9, chord_m), 1e-9);
  }
}

// A force pushes a ball from rest. Where f_s / N is more than the patch holds, the ball slips as it arrives there, at
// t = sqrt(2 x / a) with a = 5/7 F / m.
TEST(LocalFloor, RollingEndsAtTheBorderOfASlipperyPatch) {
  Scenario s = solid_ball();
  s.run.on_violation = OnViolation::kStop;
  s.external_force_W_n = {2, 0, 0};
  const double a = 5.0 / 7 * 2 / 0.5, f_s_over_n = 2.0 / 7 * 2 / (0.5 * 9.81);
  for (const Actuation actuation : {Actuation::kPrescribed, Actuation::kStepper}) {
    for (const double hold : {1 - 1e-6, 1 + 1e-6}) {
      s.run.actuation = actuation;
      s.surface.static_friction = s.surface.kinetic_friction = 0.5;
      s.surface.patches = {strip(s.surface, 1.1, 50)};
      s.surface.patches[0].static_friction = s.surface.patches[0].kinetic_friction = hold * f_s_over_n;
      Plant plant(s);
      go(plant, 3, 0.0123);
      if (hold > 1) {
        EXPECT_EQ(plant.end(), PhysicsEnd::kNone);
        EXPECT_EQ(plant.sample().floor_static_friction, s.surface.patches[0].static_friction);
        continue;
      }
      ASSERT_EQ(plant.end(), PhysicsEnd::kSlipped);
      EXPECT_NEAR(plant.time_s(), std::sqrt(2 * 1.1 / a), 1e-11);
      EXPECT_EQ(plant.sample().floor_static_friction, s.surface.patches[0].static_friction);
      EXPECT_NEAR(plant.extrema().mu_required_max.value, f_s_over_n, 1e-12);
    }
  }
}

// A ball that slides without turning has v' = -mu_k g, and its slip falls by 7/2 mu_k g. It rolls where none is left.
TEST(LocalFloor, ASlideOverABorderFollowsBothFrictions) {
  for (const Actuation actuation : {Actuation::kPrescribed, Actuation::kStepper}) {
    Scenario s = solid_ball();
    s.run.actuation = actuation;
    s.surface.static_friction = s.surface.kinetic_friction = 0.1;
    s.surface.patches = {strip(s.surface, 0.4, 90)};
    s.surface.patches[0].static_friction = 0.4;
    s.surface.patches[0].kinetic_friction = 0.3;
    s.initial.has_velocity = true;
    s.initial.velocity_W_mps = {2, 0, 0};
    Plant plant(s);
    go(plant, 1, 0.01);
    const double g = 9.81, v0 = 2, mu1 = 0.1, mu2 = 0.3;
    const double border_s = (v0 - std::sqrt(v0 * v0 - 2 * mu1 * g * 0.4)) / (mu1 * g);
    const double slip = v0 - 3.5 * mu1 * g * border_s, rolls_s = border_s + slip / (3.5 * mu2 * g);
    ASSERT_EQ(plant.regimes().size(), 2u);
    EXPECT_EQ(plant.regimes()[1].regime, Regime::kRolling);
    EXPECT_NEAR(plant.regimes()[1].time_s, rolls_s, 1e-10);
    const double at_border = v0 - mu1 * g * border_s, v1 = 5.0 / 7 * v0, on_patch_s = rolls_s - border_s;
    const double place = 0.4 + on_patch_s * (at_border + v1) / 2 + v1 * (1 - rolls_s);
    EXPECT_NEAR(plant.sample().position_W_m[0], place, 1e-10);
    EXPECT_NEAR(plant.sample().velocity_W_mps[0], v1, 1e-10);
  }
}

TEST(LocalFloor, ASlideOntoInfiniteFrictionEndsInWords) {
  Scenario s = solid_ball();
  s.surface.static_friction = s.surface.kinetic_friction = 0.1;
  s.surface.patches = {strip(s.surface, 0.4, 90)};
  s.surface.patches[0].static_friction = s.surface.patches[0].kinetic_friction =
      std::numeric_limits<double>::infinity();
  s.initial.has_velocity = true;
  s.initial.velocity_W_mps = {2, 0, 0};
  Plant plant(s);
  go(plant, 1, 0.01);
  EXPECT_EQ(plant.end(), PhysicsEnd::kInconsistent);
  EXPECT_NE(plant.end_text().find("infinite friction"), std::string::npos) << plant.end_text();
}

// An impact has the friction of the place where the ball lands, whatever it started above.
TEST(LocalFloor, AnImpactHasTheFrictionOfItsPlace) {
  for (const double to_m : {0.3, 0.5}) {
    Scenario s = solid_ball();
    s.surface.static_friction = s.surface.kinetic_friction = 0.1;
    s.surface.patches = {circle(s.surface, {0, 0}, 0.4)};
    s.surface.patches[0].static_friction = s.surface.patches[0].kinetic_friction = 0.25;
    s.initial.height_m = 0.5;
    s.initial.has_velocity = true;
    const double falls_s = std::sqrt(2 * 0.5 / 9.81);
    s.initial.velocity_W_mps = {to_m / falls_s, 0, 0};
    s.initial.angular_velocity_B_radps = {0, -200, 0};  // it slips through the impact
    Plant plant(s);
    plant.advance(falls_s * 0.99, {});
    plant.advance(falls_s * 1.0001, {});
    ASSERT_EQ(plant.impacts().size(), 1u);
    const double mu = to_m < 0.4 ? 0.25 : 0.1;
    EXPECT_NEAR(plant.impacts()[0].friction_impulse_ns / plant.impacts()[0].normal_impulse_ns, mu, 1e-12);
    EXPECT_EQ(plant.sample().floor_static_friction, mu);
  }
}

// The time at which a run on one floor passes x: bisection over runs from the start.
double passes_s(const Scenario& s, double x_m) {
  double low = 0, high = s.duration_s;
  for (int i = 0; i < 60 && high - low > 1e-15 * high; ++i) {
    const double middle = (low + high) / 2;
    Plant plant(s);
    plant.advance(middle, {});
    (plant.sample().position_W_m[0] > x_m ? high : low) = middle;
  }
  return high;
}

Scenario continued(const Scenario& s, const Sample& from) {
  Scenario next = s;
  next.initial.orientation = {from.orientation[0], from.orientation[1], from.orientation[2], from.orientation[3]};
  next.initial.angular_velocity_B_radps = from.angular_velocity_B_radps;
  next.initial.position_W_m = from.position_W_m.head<2>();
  next.duration_s = s.duration_s - from.time_s;
  for (std::size_t i = 0; i < s.masses.size(); ++i) next.masses[i].initial_position = from.mass_position[i];
  return next;
}

// Random robots with masses at rest or at constant rates. The run with a border is the run on the first floor up to
// there, and one on the second floor from there. Where the masses rest, energy is kept on the ideal floor, and falls by
// the work of the moment on the other: T . omega, by Gauss and Legendre's rule.
TEST(LocalFloor, ARunCutByHandAtTheBorderIsTheSame) {
  const std::uint64_t seed = ballast::test::random_seed(121);
  constexpr std::array<double, 5> kPlace{-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831,
                                         0.9061798459386640};
  constexpr std::array<double, 5> kWeight{0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                          0.4786286704993665, 0.2369268850561891};
  int crossings = 0;
  double worst = 0, worst_j = 0;
  for (int trial = 0; trial < 30; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(trial % 4);
    const bool rest = trial % 2 == 0;
    for (Mass& mass : s.masses) {
      mass.motion.clear();
      if (rest) mass.initial_velocity = 0;
    }
    s.external_force_W_n.setZero();
    const double r = s.ball.radius_m, rate = std::sqrt(s.gravity_mps2 / r);
    s.initial.orientation = random.attitude();
    s.initial.position_W_m.setZero();
    s.initial.angular_velocity_B_radps = s.initial.orientation.conjugate() * (rate * Vector3d(0, 2, 0));
    s.surface.creep_radps = rate * random.uniform(0.2, 1);  // a rate that the panels resolve
    s.duration_s = 3 / rate;
    Scenario resists = s;
    resists.surface.rolling_resistance = random.uniform(0.01, 0.1);
    const double border_m = r * random.uniform(0.5, 2.5);
    Scenario both = resists;
    both.surface.patches = {strip(s.surface, -1e3, border_m)};

    Plant whole(both);
    const double border_s = passes_s(s, border_m);
    if (!(border_s < s.duration_s)) continue;
    ++crossings;
    Plant first(s);
    first.advance(border_s, {});
    Plant second(continued(resists, first.sample()));
    whole.advance(border_s, {});
    const double scale_j = std::abs(test::whole(s, whole.sample()).energy_j) + s.ball.mass_kg * s.gravity_mps2 * r;
    const double start_j = test::whole(s, Plant(s).sample()).energy_j;
    double work_j = test::whole(s, whole.sample()).energy_j - start_j;
    if (rest) {
      EXPECT_LT(std::abs(work_j), 1e-12 * scale_j);
    }
    work_j = 0;
    constexpr int kPanels = 100;
    const double half_s = (s.duration_s - border_s) / kPanels / 2;
    for (int panel = 0; panel < kPanels; ++panel) {
      for (std::size_t i = 0; i < kPlace.size(); ++i) {
        whole.advance(border_s + (2 * panel + 1 + kPlace[i]) * half_s, {});
        const Sample p = whole.sample();
        const double level = (test::attitude(p) * p.angular_velocity_B_radps).head<2>().norm();
        work_j -= half_s * kWeight[i] * p.normal_force_n * resists.surface.rolling_resistance * r * level * level /
                  std::hypot(level, s.surface.creep_radps);
      }
    }
    whole.advance(s.duration_s, {});
    second.advance(s.duration_s - border_s, {});
    ASSERT_EQ(whole.end(), PhysicsEnd::kNone) << whole.end_text();
    const Sample a = whole.sample(), b = second.sample();
    const double apart = (a.position_W_m - b.position_W_m).norm() / r +
                         (a.angular_velocity_B_radps - b.angular_velocity_B_radps).norm() / rate +
                         std::min((a.orientation - b.orientation).norm(), (a.orientation + b.orientation).norm()) +
                         std::abs(a.normal_force_n - b.normal_force_n) / (s.ball.mass_kg * s.gravity_mps2);
    worst = std::max(worst, apart);
    if (!rest) continue;
    const double change_j = test::whole(s, a).energy_j - start_j;
    EXPECT_LT(work_j, -1e-3 * scale_j);
    worst_j = std::max(worst_j, std::abs(change_j - work_j) / scale_j);
  }
  EXPECT_GE(crossings, 20);
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
  RecordProperty("worst_energy", std::to_string(worst_j * 1e12) + "e-12");
  // Steps of 1e-13 of the state, whose errors grow 100-fold in such a run, and the dense output that locates the
  // border.
  EXPECT_LT(worst, 1e-10);
  EXPECT_LT(worst_j, 1e-11);
}

// Three driven masses on circles, which the motors only hold.
Scenario driven_ball() {
  Scenario s;
  s.duration_s = 0.6;
  s.gravity_mps2 = 9.81;
  s.ball = {
      .radius_m = 0.15, .mass_kg = 0.8, .inertia_kgm2 = {0.010, 0.011, 0.012}, .center_of_mass_B_m = {0, 0, -0.01}};
  s.surface.static_friction = s.surface.kinetic_friction = 0.8;
  s.initial.angular_velocity_B_radps = {0.5, 4, 0.2};
  s.run.on_violation = OnViolation::kContinue;
  s.run.tolerance = 1e-12;
  for (int i = 0; i < 3; ++i) {
    Mass m;
    m.mass_kg = 0.2;
    m.rail = firmware::circle_about(0.1, i * 1.1, 0.3);
    m.initial_position = -1.2 + 0.4 * i;
    m.motor.holding_torque_nm = 0.5;
    m.motor.rotor_inertia_kgm2 = 1e-5;
    m.motor.viscous_damping_nms = 1e-3;
    m.motor.corner_speed_radps = 1e3;
    m.motor.shaft_ratio = 4;
    s.masses.push_back(m);
  }
  return s;
}

// The motors step; the second half of each tick is free of pulses.
void drive(Plant& plant, double end_s) {
  constexpr double kTick_s = 0.001;
  for (int k = static_cast<int>(std::lround(plant.time_s() / kTick_s)); plant.time_s() < end_s; ++k) {
    std::array<StepPulse, 3> pulses{};
    for (int i = 0; i < 3; ++i)
      pulses[static_cast<std::size_t>(i)] = {1e-4 * (i + 1), i, (k / 100 + i) % 2 == 0 ? 1 : -1};
    plant.advance(std::min((k + 1) * kTick_s, end_s), pulses);
  }
}

// A patch is to the plant what friction_falls is at the instant of the border, whose code shares only what sets the
// friction. Masses driven by pulses, in rolling and sliding.
TEST(LocalFloor, ASlipperyPatchIsAFloorThatFallsAtTheBorder) {
  Scenario s = driven_ball();
  const double border_m = 0.17, part = 0.05;
  Scenario patched = s;
  patched.surface.patches = {strip(s.surface, border_m, 10)};
  patched.surface.patches[0].static_friction = part * s.surface.static_friction;
  patched.surface.patches[0].kinetic_friction = part * s.surface.kinetic_friction;
  Plant whole(patched);
  drive(whole, s.duration_s);
  ASSERT_EQ(whole.end(), PhysicsEnd::kNone) << whole.end_text();

  double low = 0, high = s.duration_s;
  for (int i = 0; i < 60 && high - low > 1e-14; ++i) {
    const double middle = (low + high) / 2;
    Plant plant(s);
    drive(plant, middle);
    (plant.sample().position_W_m[0] > border_m ? high : low) = middle;
  }
  ASSERT_LT(high, 0.5);
  Fault falls;
  falls.kind = FaultKind::kFrictionFalls;
  falls.time_s = high;
  falls.end_s = kToTheEnd;
  falls.value = part * s.surface.static_friction;
  s.faults = {falls};
  Plant cut(s);
  drive(cut, s.duration_s);
  const Sample a = whole.sample(), b = cut.sample();
  EXPECT_GE(whole.regimes().size(), 2u);  // it slips
  ASSERT_EQ(whole.regimes().size(), cut.regimes().size());
  // The borders' times differ by the rounding of a place, and slip starts with them.
  for (std::size_t i = 0; i < whole.regimes().size(); ++i) {
    EXPECT_NEAR(whole.regimes()[i].time_s, cut.regimes()[i].time_s, 1e-10);
  }
  EXPECT_LT((a.position_W_m - b.position_W_m).norm(), 1e-10);
  EXPECT_LT((a.angular_velocity_B_radps - b.angular_velocity_B_radps).norm(), 1e-9);
  EXPECT_NEAR(a.normal_force_n, b.normal_force_n, 1e-8);
}

// Driven masses leave vector registers (driven_lanes.h) for the general equations where the floor resists. Nothing but
// the floor's moment and the motors changes the energy, on either side of the border.
TEST(LocalFloor, DrivenMassesPayTheFloorTheWorkOfItsMoment) {
  Scenario s = driven_ball();
  s.surface.creep_radps = 2;  // a rate that ticks resolve
  const double border_m = 0.17, c_rr = 0.05;
  s.surface.patches = {strip(s.surface, border_m, 10)};
  s.surface.patches[0].rolling_resistance = c_rr;
  const auto energy_j = [&](const Plant& plant) {
    double energy = test::whole(s, plant.sample()).energy_j + test::rotor_energy_j(s, plant.sample());
    for (int i = 0; i < 3; ++i) energy -= plant.motor_energy(i).work_j;
    return energy;
  };
  double low = 0, high = s.duration_s;
  for (int i = 0; i < 60 && high - low > 1e-14; ++i) {
    const double middle = (low + high) / 2;
    Plant plant(s);
    go(plant, middle, 0.001);
    (plant.sample().position_W_m[0] > border_m ? high : low) = middle;
  }
  ASSERT_LT(high, 0.5);
  Plant plant(s);
  const double start_j = energy_j(plant);
  go(plant, high, 0.001);
  const double at_border_j = energy_j(plant);
  double work_j = 0;
  const int panels = 2000;
  const double half_s = (s.duration_s - high) / panels / 2, place = std::sqrt(0.6);
  const auto power_w = [&] {
    const Sample p = plant.sample();
    const double level = (test::attitude(p) * p.angular_velocity_B_radps).head<2>().norm();
    return -p.normal_force_n * c_rr * s.ball.radius_m * level * level / std::hypot(level, 2.0);
  };
  for (int k = 0; k < panels; ++k) {
    const double middle_s = high + (2 * k + 1) * half_s;
    for (const auto& [at, weight] : {std::pair(-place, 5.0 / 9), std::pair(0.0, 8.0 / 9), std::pair(place, 5.0 / 9)}) {
      plant.advance(middle_s + at * half_s, {});
      work_j += half_s * weight * power_w();
    }
  }
  plant.advance(s.duration_s, {});
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone) << plant.end_text();
  const double scale_j = 1.4 * 9.81 * s.ball.radius_m;
  RecordProperty("before", std::to_string((at_border_j - start_j) / scale_j * 1e12) + "e-12");
  RecordProperty("after", std::to_string((energy_j(plant) - at_border_j - work_j) / scale_j * 1e12) + "e-12");
  EXPECT_LT(work_j, -1e-3 * scale_j);
  // 600 ticks at a tolerance of 1e-12, whose errors do not add up in one direction.
  EXPECT_NEAR(at_border_j, start_j, 1e-11 * scale_j);
  EXPECT_NEAR(energy_j(plant) - at_border_j, work_j, 1e-11 * scale_j);
}

// Patches that are all like the floor change no more than where steps end.
TEST(LocalFloor, PatchesLikeTheFloorChangeNothing) {
  const std::uint64_t seed = ballast::test::random_seed(122);
  int compared = 0;
  for (int trial = 0; trial < 10; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(2);
    if (trial % 2 == 1) random.make_floor_real(s);
    s.initial.angular_velocity_B_radps = std::sqrt(s.gravity_mps2 / s.ball.radius_m) * random.vector(1);
    Scenario tiled = s;
    for (int i = 0; i < 40; ++i) {
      tiled.surface.patches.push_back(circle(s.surface, 2 * s.ball.radius_m * random.vector(1).head<2>(),
                                             s.ball.radius_m * random.uniform(0.1, 1)));
    }
    Plant bare(s), patched(tiled);
    bare.advance(s.duration_s, {});
    patched.advance(s.duration_s, {});
    if (bare.end() != PhysicsEnd::kNone) continue;
    ++compared;
    // Up to 80 cuts of steps at 1e-13 each, whose errors grow.
    EXPECT_LT((bare.sample().position_W_m - patched.sample().position_W_m).norm(), 1e-9 * s.ball.radius_m);
    EXPECT_LT((bare.sample().orientation - patched.sample().orientation).norm(), 1e-9);
    EXPECT_NEAR(bare.extrema().mu_required_max.value, patched.extrema().mu_required_max.value,
                1e-9 * (1 + bare.extrema().mu_required_max.value));
  }
  EXPECT_GE(compared, 5);
}

}  // namespace
}  // namespace ballast::sim
