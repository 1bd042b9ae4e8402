// End stops: their law against its closed form, what they do to N and f_s, and what they keep: energy and momentum.
#include "sim/motors/end_stop.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;

// No current in it: nothing but its rotor's inertia.
Motor idle_motor(double shaft_ratio, double rotor_inertia_kgm2) {
  Motor motor;
  motor.shaft_ratio = shaft_ratio;
  motor.rotor_inertia_kgm2 = rotor_inertia_kgm2;
  motor.holding_torque_nm = 1e-300;
  motor.corner_speed_radps = 1e300;
  motor.step_error = 0;
  return motor;
}

// A mass that falls along a vertical line through the centre of a ball at rest, from `height_m` onto the lower stop at
// 0: one degree of freedom, and N = M g + m thetaddot.
struct Drop {
  static constexpr double kGravity = 9.81, kMass = 0.25, kShell = 0.8, kRotor = 0.35, kStiffness = 4000;
  explicit Drop(double restitution, double height_m, double period_s = 1e-3) : height(height_m) {
    scenario.duration_s = 2;
    scenario.gravity_mps2 = kGravity;
    scenario.run.actuation = Actuation::kStepper;
    scenario.run.control_period_s = period_s;
    scenario.ball = {
        .radius_m = 0.5, .mass_kg = kShell, .inertia_kgm2 = {0.1, 0.11, 0.12}, .center_of_mass_B_m = {0, 0, -0.01}};
    Mass m;
    m.mass_kg = kMass;
    m.rail = firmware::line({0, 0, 0}, {0, 0, 1});
    m.rail.lower_end = 0;
    m.rail.upper_end = 0.3;
    m.end_stops = {kStiffness, restitution};
    m.initial_position = height_m;
    m.motor = idle_motor(10, kRotor / 100);
    scenario.masses = {m};
    damping_ratio = end_stop_damping_ratio(restitution);
  }
  [[nodiscard]] double inertia() const { return kMass + kRotor; }
  [[nodiscard]] double fall() const { return kMass * kGravity / inertia(); }
  [[nodiscard]] double omega() const { return std::sqrt(kStiffness / inertia()); }
  [[nodiscard]] double touch_s() const { return std::sqrt(2 * height / fall()); }
  [[nodiscard]] double speed() const { return std::sqrt(2 * height * fall()); }

  // Depth, its rate and acceleration `s` after the touch: xddot = fall - 2 D w xdot - w^2 x, D < 1.
  [[nodiscard]] Vector3d pressed(double s) const {
    const double w = omega(), d = damping_ratio * w, wd = w * std::sqrt(1 - damping_ratio * damping_ratio);
    const double rest = fall() / (w * w);
    const double a = -rest, b = (speed() + d * a) / wd;  // x - rest = exp(-d s) (a cos + b sin)
    const double c = std::cos(wd * s), n = std::sin(wd * s), e = std::exp(-d * s);
    const double x = rest + e * (a * c + b * n);
    const double v = e * ((wd * b - d * a) * c - (wd * a + d * b) * n);
    return {x, v, fall() - 2 * d * v - w * w * x};
  }
  // When spring and damper first give 0, that is xddot = fall again.
  [[nodiscard]] double release_s() const {
    const double step = 1e-3 / omega();
    double high = 2 * step;
    while (pressed(high)[2] < fall() && high < 20 / omega()) high += step;
    double low = high - step;
    for (int i = 0; i < 100; ++i) {
      const double half = (low + high) / 2;
      (pressed(half)[2] < fall() ? low : high) = half;
    }
    return low;
  }

  Scenario scenario;
  double height, damping_ratio;
};

TEST(EndStop, DampingRatioGivesTheRestitution) {
  EXPECT_EQ(end_stop_damping_ratio(1), 0);
  for (const double ratio : {1e-6, 0.1, 0.5, 0.9, 0.999}) {
    const double a = std::acos(ratio);
    EXPECT_NEAR(end_stop_damping_ratio(std::exp(-2 * a * ratio / std::sin(a))), ratio, 1e-9) << ratio;
  }
  EXPECT_NEAR(end_stop_damping_ratio(std::exp(-2)), 1, 1e-6);
  for (const double ratio : {1.001, 2.0, 5.0}) {
    const double a = std::acosh(ratio);
    EXPECT_NEAR(end_stop_damping_ratio(std::exp(-2 * a * ratio / std::sinh(a))), ratio, 1e-9 * ratio) << ratio;
  }
}

// A stop a millimetre inside the shell gives way by more; one a centimetre inside does not.
TEST(EndStop, AMassThatASoftStopLetsOutOfTheBallIsNoticed) {
  for (const double inside_m : {0.001, 0.01}) {
    Drop drop(0.6, 0.02);
    firmware::Rail& rail = drop.scenario.masses[0].rail;
    rail.origin_B_m = {0, 0, inside_m - drop.scenario.ball.radius_m};
    const double release_s = drop.release_s();
    double deepest_m = 0, out_s = 0;
    for (double s = 0; s < release_s; s += 1e-5 * release_s) {
      deepest_m = std::max(deepest_m, drop.pressed(s)[0]);
      if (drop.pressed(s)[0] > inside_m && out_s == 0) out_s = drop.touch_s() + s;
    }
    Plant plant(drop.scenario);
    for (int k = 1; plant.time_s() < drop.touch_s() + release_s; ++k) plant.advance(k * 1e-3, {});
    const EndStopRecord& stop = plant.end_stop(0);
    ASSERT_EQ(stop.touches, 1);
    if (inside_m > deepest_m) {
      EXPECT_EQ(stop.outside_ball_m, 0);
      EXPECT_EQ(stop.outside_ball_s, -1);
      continue;
    }
    // Seen at the ends of steps, at most half a tick from the deepest point, where the depth is flat: w^2 x h^2 / 2.
    const double missed_m = drop.omega() * drop.omega() * deepest_m * 0.5e-3 * 0.5e-3 / 2;
    EXPECT_NEAR(stop.outside_ball_m, deepest_m - inside_m, missed_m);
    EXPECT_GE(stop.outside_ball_s, out_s - 1e-9);
    EXPECT_LE(stop.outside_ball_s, out_s + 1e-3);
  }
}

// Touch, depth, release and N against the closed form, at ticks that know nothing of them.
TEST(EndStop, AFallingMassPressesAsTheClosedFormSays) {
  for (const double restitution : {1.0, 0.6, 0.35}) {
    for (const double period_s : {1e-3, 0.0217}) {
      SCOPED_TRACE(testing::Message() << "restitution " << restitution << ", ticks of " << period_s << " s");
      const Drop drop(restitution, 0.02, period_s);
      Plant plant(drop.scenario);
      const double weight = (Drop::kShell + Drop::kMass) * Drop::kGravity;
      const double touch_s = drop.touch_s(), release_s = drop.release_s();
      ASSERT_LT(release_s, 10 / drop.omega()) << "the weight does not keep it down";
      double greatest_n = 0;
      for (double s = 0; s < release_s; s += 1e-5 * release_s) {
        greatest_n = std::max(greatest_n, weight - Drop::kMass * drop.pressed(s)[2]);
      }
      for (int k = 1; plant.time_s() < touch_s + release_s + 0.01; ++k) {
        plant.advance(k * period_s, {});
        const double s = plant.time_s() - touch_s;
        const auto sample = plant.sample();
        // 1e-12 per step, grown by the stop's frequency of 80 / s; positions of 1e-2 m, forces of 10 N.
        if (s <= 0) {
          EXPECT_NEAR(sample.mass_position[0], drop.height - drop.fall() * plant.time_s() * plant.time_s() / 2, 1e-12);
          EXPECT_NEAR(sample.normal_force_n, weight - Drop::kMass * drop.fall(), 1e-10);
          EXPECT_EQ(sample.end_switches[0], 0);
        } else if (s < release_s) {
          EXPECT_NEAR(sample.mass_position[0], -drop.pressed(s)[0], 1e-11);
          EXPECT_NEAR(sample.mass_velocity[0], -drop.pressed(s)[1], 1e-9);
          EXPECT_NEAR(sample.normal_force_n, weight - Drop::kMass * drop.pressed(s)[2], 1e-7);
          EXPECT_EQ(sample.end_switches[0], 1);
        } else {
          const double t = s - release_s;
          const Vector3d left = drop.pressed(release_s);
          EXPECT_NEAR(sample.mass_position[0], -left[0] - left[1] * t - drop.fall() * t * t / 2, 1e-11);
        }
      }
      EXPECT_EQ(plant.end_stop(0).touches, 1);
      // The plant's standard for instants is 1e-9 of the run's time unit.
      EXPECT_NEAR(plant.end_stop(0).first_s, touch_s, 1e-10);
      EXPECT_NEAR(plant.extrema().normal_force_max.value, greatest_n, 1e-7 * greatest_n);
      EXPECT_LT(plant.motor_extrema(0).max_torque_nm, 1e-12) << "the stop's force is not the motor's";
    }
  }
}

// Bounces end; then the spring carries the weight.
TEST(EndStop, BouncesComeToRestWhereTheSpringCarriesTheWeight) {
  Drop drop(0.3, 0.02);
  Plant plant(drop.scenario);
  for (int k = 1; k <= 2000; ++k) plant.advance(k * 1e-3, {});
  // Damped by D w = 30 / s for over a second.
  EXPECT_NEAR(plant.sample().mass_position[0], -Drop::kMass * Drop::kGravity / Drop::kStiffness, 1e-10);
  EXPECT_NEAR(plant.sample().normal_force_n, (Drop::kShell + Drop::kMass) * Drop::kGravity, 1e-6);
  EXPECT_GE(plant.end_stop(0).touches, 2);
  EXPECT_LE(plant.end_stop(0).touches, 10);
}

// In the air, the ball free to recoil along the line: m and J against it are an inertia D = m + J - m^2 / M, smaller
// than the m + J the damper is made for, so D_r rises by sqrt((m + J) / D), and the closed form holds with that.
TEST(EndStop, RestitutionWithTheBallRecoilingAndTheImpulse) {
  for (const double restitution : {1.0, 0.7, 0.4}) {
    SCOPED_TRACE(restitution);
    Drop drop(restitution, 0.02);
    Scenario& s = drop.scenario;
    s.initial.has_velocity = true;
    s.initial.velocity_W_mps = {0.3, 0, 1};
    s.initial.height_m = 0.5;
    s.duration_s = 0.2;
    s.masses[0].initial_velocity = -0.5;
    Plant plant(s);
    const auto before = plant.sample();
    const test::Whole whole_before = test::whole(s, before);
    for (int k = 1; k <= 200; ++k) plant.advance(k * 1e-3, {});
    ASSERT_EQ(plant.regimes().size(), 1u) << "it flies";
    ASSERT_EQ(plant.end_stop(0).touches, 1);
    EXPECT_NEAR(plant.end_stop(0).first_s, 0.02 / 0.5, 1e-10);
    const auto after = plant.sample();
    const double m = Drop::kMass, whole = Drop::kShell + m, d = drop.inertia() - m * m / whole;
    const double ratio = drop.damping_ratio * std::sqrt(drop.inertia() / d);
    const double a = std::acos(ratio), e = std::exp(-2 * a * ratio / std::sin(a));
    EXPECT_NEAR(after.mass_velocity[0], 0.5 * e, 1e-10);
    // The ball's share of the impulse: momentum, which gravity alone changes.
    const double jump = after.mass_velocity[0] - before.mass_velocity[0];
    EXPECT_NEAR(after.velocity_W_mps[2] - before.velocity_W_mps[2], -Drop::kGravity * 0.2 - m / whole * jump, 1e-10);
    const test::Whole whole_after = test::whole(s, after);
    EXPECT_LT((whole_after.velocity_W_mps - whole_before.velocity_W_mps + Vector3d(0, 0, 0.2 * Drop::kGravity)).norm(),
              1e-10);
  }
}

// A random robot with masses on lines between stops and motors without current.
Scenario with_stops(test::RandomRobot& random, int mass_count, double restitution) {
  Scenario s = random.scenario(mass_count);
  s.run.actuation = Actuation::kStepper;
  s.external_force_W_n.setZero();
  const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
  for (auto& m : s.masses) {
    m.rail = firmware::line(0.3 * r * random.direction(), random.direction());
    m.rail.lower_end = -0.1 * r;
    m.rail.upper_end = 0.15 * r;
    m.end_stops = {m.mass_kg * s.gravity_mps2 / (0.01 * r) * random.uniform(1, 30), restitution};
    m.initial_position = 0.05 * r * random.uniform(-1, 1);
    m.initial_velocity = speed * random.uniform(-0.5, 0.5);
    m.motion.clear();
    m.motor = idle_motor(3, random.uniform(0.01, 1) * m.mass_kg / 9);
  }
  return s;
}

double spring_energy_j(const Scenario& s, const Plant::Sample& p) {
  double energy = 0;
  for (std::size_t i = 0; i < s.masses.size(); ++i) {
    const auto& rail = s.masses[i].rail;
    const double depth = std::max({0.0, rail.lower_end - p.mass_position[i], p.mass_position[i] - rail.upper_end});
    energy += s.masses[i].end_stops.stiffness_npm * depth * depth / 2;
  }
  return energy;
}

// Restitution 1 keeps the energy of ball, masses, rotors and springs; less takes it, and never gives any. Rolling and
// in the air.
TEST(EndStop, EnergyIsKeptByRestitutionOneAndNeverMade) {
  const std::uint64_t seed = ballast::test::random_seed(61);
  int touches = 0;
  double lost = 0;
  for (int trial = 0; trial < 24; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    const bool keeps = trial % 2 == 0;
    Scenario s = with_stops(random, 1 + trial % 3, keeps ? 1 : 0.5);
    const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
    s.duration_s = 2 * r / speed;
    if (trial % 4 >= 2) {
      s.initial.has_velocity = true;
      s.initial.velocity_W_mps = {0, 0, 2 * speed};
    }
    double mass = s.ball.mass_kg;
    for (const auto& m : s.masses) mass += m.mass_kg;
    const double scale = mass * speed * speed;
    Plant plant(s);
    const auto energy = [&] {
      const auto p = plant.sample();
      return test::whole(s, p).energy_j + test::rotor_energy_j(s, p) + spring_energy_j(s, p);
    };
    const double start = energy();
    double last = start;
    for (int k = 1; k <= 100 && plant.end() == PhysicsEnd::kNone; ++k) {
      plant.advance(s.duration_s * k / 100, {});
      const double now = energy();
      // Integration: 1e-12 per step, some hundred steps a tick at worst while a stop pushes.
      if (keeps) {
        EXPECT_NEAR(now, start, 1e-10 * scale);
      } else {
        EXPECT_LE(now, last + 1e-10 * scale);
      }
      last = now;
    }
    int here = 0;
    for (std::size_t i = 0; i < s.masses.size(); ++i) here += plant.end_stop(static_cast<int>(i)).touches;
    if (!keeps) lost += (start - last) / scale;
    touches += here;
  }
  EXPECT_GT(touches, 40);
  EXPECT_GT(lost, 0.01);
}

// A stop's force is between ball and mass: in the air it changes neither momentum, wherever the line lies.
TEST(EndStop, MomentumInTheAirIsKept) {
  const std::uint64_t seed = ballast::test::random_seed(62);
  int touches = 0;
  for (int trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = with_stops(random, 1 + trial % 3, random.uniform(0.2, 1));
    const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
    s.duration_s = 2 * r / speed;
    s.initial.has_velocity = true;
    s.initial.velocity_W_mps = {0.5 * speed, 0, 3 * speed};
    Plant plant(s);
    const test::Whole start = test::whole(s, plant.sample());
    for (int k = 1; k <= 50; ++k) {
      plant.advance(s.duration_s * k / 50, {});
      const test::Whole now = test::whole(s, plant.sample());
      const Vector3d fallen(0, 0, -s.gravity_mps2 * plant.time_s());
      EXPECT_LT((now.velocity_W_mps - start.velocity_W_mps - fallen).norm(), 1e-10 * speed);
      EXPECT_LT((now.angular_momentum_W - start.angular_momentum_W).norm(), 1e-10 * now.mass_kg * r * speed);
    }
    ASSERT_EQ(plant.regimes().size(), 1u) << "it flies";
    for (std::size_t i = 0; i < s.masses.size(); ++i) touches += plant.end_stop(static_cast<int>(i)).touches;
  }
  EXPECT_GT(touches, 12);
}

// On the floor the impulse of what the messages say of f and N is what the momentum of the whole has gained.
TEST(EndStop, ContactForcesCarryTheImpulseToTheFloor) {
  Drop drop(1, 0.1);
  Scenario& s = drop.scenario;
  s.masses[0].rail = firmware::line({0, 0, 0.1}, {1, 0, 0.3});
  s.masses[0].rail.lower_end = 0;
  s.masses[0].rail.upper_end = 0.3;
  s.masses[0].initial_velocity = -0.8;
  Plant plant(s);
  const test::Whole start = test::whole(s, plant.sample());
  constexpr double kStep_s = 2e-5;
  Vector3d impulse = Vector3d::Zero();
  double most_f_n = 0;
  const auto force_n = [&] {
    const auto p = plant.sample();
    most_f_n = std::max(most_f_n, p.static_friction_n);
    return Vector3d(p.friction_force_W_n[0], p.friction_force_W_n[1], p.normal_force_n);
  };
  Vector3d before = force_n();
  for (int k = 1; k <= 20000; ++k) {
    plant.advance(k * kStep_s, {});
    const Vector3d now = force_n();
    impulse += kStep_s / 2 * (before + now);
    before = now;
  }
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
  ASSERT_EQ(plant.regimes().size(), 1u);
  ASSERT_GE(plant.end_stop(0).touches, 1);
  const test::Whole end = test::whole(s, plant.sample());
  const Vector3d gained = end.mass_kg * (end.velocity_W_mps - start.velocity_W_mps) +
                          Vector3d(0, 0, end.mass_kg * s.gravity_mps2 * plant.time_s());
  // Trapezoids over kinks at touch and release: the step times the force's change within it, some 1e-6 N s.
  EXPECT_LT((impulse - gained).norm(), 5e-6);
  EXPECT_GT(most_f_n, 2) << "the stop is felt at the floor";
  EXPECT_NEAR(plant.extrema().static_friction_max.value, most_f_n, 1e-3 * most_f_n);
}

// An open spline's stop is where it ends, or before it; the mass turns there.
TEST(EndStop, TicksDoNotMatterWhateverStopsPush) {
  test::RandomRobot random(63);
  Scenario s = with_stops(random, 3, 0.6);
  s.duration_s = 2 * std::sqrt(s.ball.radius_m / s.gravity_mps2);
  const auto end_with = [&](int ticks) {
    Plant plant(s);
    for (int k = 1; k <= ticks; ++k) plant.advance(s.duration_s * k / ticks, {});
    EXPECT_EQ(plant.end(), PhysicsEnd::kNone);
    EXPECT_GE(plant.end_stop(0).touches + plant.end_stop(1).touches + plant.end_stop(2).touches, 3);
    return plant.sample();
  };
  const auto coarse = end_with(7), fine = end_with(1000);
  for (std::size_t i = 0; i < 3; ++i) {
    // Errors of 1e-12 a step, grown by bounces: far below the 1e-9 instants are held to.
    EXPECT_NEAR(coarse.mass_position[i], fine.mass_position[i], 1e-9 * s.ball.radius_m);
  }
  EXPECT_LT((coarse.orientation - fine.orientation).norm(), 1e-9);
}

// The field goes on past the stop: the rotor cannot follow, slips tooth by tooth, and every slip is counted.
TEST(EndStop, AMotorDrivenIntoItsStopLosesTheSteps) {
  Drop drop(0.5, 0.1);
  Scenario& s = drop.scenario;
  Motor& motor = s.masses[0].motor;
  motor.shaft_ratio = 2 * pi / 0.1;  // 0.1 m per turn
  motor.rotor_inertia_kgm2 = 1e-4;
  motor.holding_torque_nm = 0.2;
  motor.viscous_damping_nms = 0.01;
  motor.microsteps = 16;
  Plant plant(s);
  constexpr int kSteps = 9600;  // 3 turns down; the stop is one turn away
  constexpr double kPeriod_s = 2e-4;
  int switched = 0;
  for (int k = 0; k < kSteps; ++k) {
    plant.advance((k + 1) * kPeriod_s, std::array{StepPulse{0, 0, -1}});
    switched += plant.sample().end_switches[0];
  }
  for (int k = 0; k < 2000; ++k) plant.advance(kSteps * kPeriod_s + (k + 1) * kPeriod_s, {});
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
  const auto p = plant.sample();
  EXPECT_GT(switched, kSteps / 3) << "two turns against the stop, of three";
  // No further in than where weight and the greatest torque press the mass to, no further out than a tooth.
  const double press_n = motor.holding_torque_nm * motor.shaft_ratio + Drop::kMass * Drop::kGravity;
  EXPECT_GT(p.mass_position[0], -press_n / Drop::kStiffness);
  EXPECT_LT(p.mass_position[0], 0.1 / 50);
  // Every slip is a tooth, four full steps. What the rotor is behind in the end is lost, but for less than half a tooth
  // of lag; slips there and back, as it bounces, count too.
  constexpr double kPerMetre = 3200 / 0.1;
  EXPECT_EQ(p.lost_steps[0] % 64, 0);
  EXPECT_GE(static_cast<double>(p.lost_steps[0]), kSteps - kPerMetre * (drop.height - p.mass_position[0]) - 32);
  EXPECT_GT(plant.end_stop(0).max_force_n, 0.9 * motor.holding_torque_nm * motor.shaft_ratio);
}

}  // namespace
}  // namespace ballast::sim
