// In the air: the plant against the paper's closed forms for a detached ball and disk (app_detachment), which the
// firmware has and the plant has not.
#include "sim/closed_forms/detached.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sim/closed_forms/rolling_disk.h"
#include "sim/plant/plant.h"
#include "tests/physics/closed_form_run.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;

// Thrown up so that it stays in the air, with masses moving and a force on it.
Scenario thrown(test::RandomRobot& random, int mass_count) {
  Scenario s = random.scenario(mass_count);
  const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
  s.external_force_W_n = s.ball.mass_kg * s.gravity_mps2 * random.vector(0.5);
  s.initial.angular_velocity_B_radps = speed / r * random.vector(3);
  s.initial.has_velocity = true;
  s.initial.velocity_W_mps = speed * Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), 2);
  s.duration_s = 4 * r / speed;
  s.initial.height_m = 40 * r;
  return s;
}

// The rails, centre of mass and force of such a robot in the plane of e1 and e3, the ball turned by minus phi about e2.
Scenario thrown_disk(test::RandomRobot& random, int mass_count, closed_forms::DiskState& start) {
  Scenario s = thrown(random, mass_count);
  const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
  s.ball.center_of_mass_B_m[1] = s.external_force_W_n[1] = s.initial.velocity_W_mps[1] = 0;
  for (Mass& mass : s.masses) {
    const double angle = random.uniform(-3, 3);
    const Vector3d center(0.2 * r * random.uniform(-1, 1), 0, 0.2 * r * random.uniform(-1, 1));
    const Vector3d along(std::cos(angle), 0, std::sin(angle)), across(-std::sin(angle), 0, std::cos(angle));
    mass.rail = mass.rail.shape == firmware::RailShape::kLine
                    ? firmware::line(center, along)
                    : firmware::circle(center, r * random.uniform(0.1, 0.75), along, across);
  }
  start = {random.uniform(-3, 3), speed / r * random.uniform(-3, 3)};
  s.initial.orientation = closed_forms::orientation_of(start);
  s.initial.angular_velocity_B_radps = closed_forms::angular_velocity_of(start);
  return s;
}

firmware::MassMotion at_start(const Scenario& s) {
  firmware::MassMotion m;
  for (std::size_t i = 0; i < s.masses.size(); ++i) {
    m.position[i] = s.masses[i].initial_position;
    m.velocity[i] = s.masses[i].initial_velocity;
    m.acceleration[i] = s.masses[i].motion.empty() ? 0 : s.masses[i].motion[0].acceleration_start;
  }
  return m;
}

// Masses that move violently, so that zddot is made of them as much as of gravity.
void shake(Scenario& s, test::RandomRobot& random) {
  const double r = s.ball.radius_m, rate = std::sqrt(s.gravity_mps2 / r);
  for (Mass& mass : s.masses) {
    const double unit = mass.rail.shape == firmware::RailShape::kCircle ? 1 : r;
    mass.initial_position = unit * random.uniform(-3, 3);
    mass.initial_velocity = 3 * unit * rate * random.uniform(-1, 1);
    const double acceleration = 10 * unit * rate * rate * random.uniform(-1, 1);
    mass.motion = {{1, acceleration, acceleration}};
  }
}

// zddot_GC of eq_detach_ball_1d (no masses: eq_detach_ball_static) at states nobody designed. 1e-12 of its size: some
// hundred operations and the solution of a 6x6 system, whose condition is that of the ball's inertia. Omegadot, which
// the plant does not show, is compared by the flights below.
TEST(Detached, AccelerationIsTheClosedFormOnRandomStates) {
  const std::uint64_t seed = ballast::test::random_seed(51);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  double worst = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    Scenario s = thrown(random, trial % (kMaxMasses + 1));
    shake(s, random);
    const auto p = Plant(s).sample();
    const auto& initial = s.initial;
    const auto form = closed_forms::detached_motion(test::ball_params(s), initial.orientation,
                                                    initial.angular_velocity_B_radps, at_start(s));
    const Vector3d plant_W = initial.orientation * p.acceleration_B_mps2;
    worst = std::max(worst, (plant_W - form.acceleration_W_mps2).norm() / form.acceleration_W_mps2.norm());
    ASSERT_EQ(p.regime, Regime::kFlight);
  }
  EXPECT_LT(worst, 1e-12);
}

TEST(Detached, AccelerationIsTheDisksClosedFormInItsPlane) {
  const std::uint64_t seed = ballast::test::random_seed(52);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  double worst = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    closed_forms::DiskState disk;
    Scenario s = thrown_disk(random, trial % (kMaxMasses + 1), disk);
    shake(s, random);
    const auto form = closed_forms::detached_disk_motion(test::ball_params(s), disk, at_start(s));
    const Vector3d plant_W = s.initial.orientation * Plant(s).sample().acceleration_B_mps2;
    worst = std::max(worst, (plant_W - form.acceleration_W_mps2).norm() / form.acceleration_W_mps2.norm());
  }
  EXPECT_LT(worst, 1e-12);
}

// Whole flights against CVODE on eq_detach_ball_1d, over the pieces of the masses' motion; without masses
// eq_detach_ball_static. Both integrate to 1e-13 or so per step over some thousand steps, and a free body's error grows
// with the angle it turns, a few tens of radians: 1e-10, of lengths and speeds of the ball's own.
TEST(Detached, FlightsAgreeWithCvodeOnTheClosedForm) {
  const std::uint64_t seed = ballast::test::random_seed(53);
  double worst = 0;
  for (int trial = 0; trial < 45; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    const Scenario s = thrown(random, trial % (kMaxMasses + 1));
    const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
    Plant plant(s);
    test::ClosedFormFlight reference(s);
    for (int k = 1; k <= 10; ++k) {
      const double t = s.duration_s * k / 10;
      plant.advance(t, {});
      ASSERT_TRUE(reference.advance(t));
      const auto p = plant.sample();
      ASSERT_EQ(p.regime, Regime::kFlight);
      const auto q = reference.orientation();
      const double error = std::max({std::min((p.orientation - q).norm(), (p.orientation + q).norm()),
                                     (p.angular_velocity_B_radps - reference.angular_velocity_B()).norm() * r / speed,
                                     (p.position_W_m - reference.position_W()).norm() / r,
                                     (p.velocity_W_mps - reference.velocity_W()).norm() / speed});
      EXPECT_LT(error, 1e-10);
      worst = std::max(worst, error);
    }
  }
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

// The same for eq_detach_disk_1d: phi, phidot and the centre's two coordinates, while the plant integrates the ball.
TEST(Detached, DiskFlightsAgreeWithCvodeOnTheClosedForm) {
  const std::uint64_t seed = ballast::test::random_seed(54);
  double worst = 0;
  for (int trial = 0; trial < 27; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    closed_forms::DiskState start;
    const Scenario s = thrown_disk(random, trial % (kMaxMasses + 1), start);
    const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
    const firmware::BallParams ball = test::ball_params(s);
    const auto law = [&](double, const firmware::MassMotion& masses, const double* y, double* d) {
      const auto motion = closed_forms::detached_disk_motion(ball, {y[0], y[1]}, masses);
      d[0] = y[1];
      d[1] = motion.angular_acceleration_radps2;
      d[2] = y[4], d[3] = y[5];
      d[4] = motion.acceleration_W_mps2[0];
      d[5] = motion.acceleration_W_mps2[2];
    };
    const auto& v = s.initial.velocity_W_mps;
    test::PrescribedRun reference(
        s, {start.angle_rad, start.angular_velocity_radps, s.initial.position_W_m[0], s.initial.height_m, v[0], v[2]},
        law);
    Plant plant(s);
    plant.advance(s.duration_s, {});
    ASSERT_TRUE(reference.advance(s.duration_s));
    const auto p = plant.sample();
    ASSERT_EQ(p.regime, Regime::kFlight);
    const double* y = reference.y();
    const Eigen::Quaterniond q = closed_forms::orientation_of({y[0], y[1]});
    const Eigen::Vector4d as_ball(q.w(), q.x(), q.y(), q.z());
    const Vector3d omega = closed_forms::angular_velocity_of({y[0], y[1]});
    const double error = std::max({std::min((p.orientation - as_ball).norm(), (p.orientation + as_ball).norm()),
                                   (p.angular_velocity_B_radps - omega).norm() * r / speed,
                                   (p.position_W_m - Vector3d(y[2], s.initial.position_W_m[1], y[3])).norm() / r,
                                   (p.velocity_W_mps - Vector3d(y[4], 0, y[5])).norm() / speed});
    EXPECT_LT(error, 1e-10);
    worst = std::max(worst, error);
  }
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

}  // namespace
}  // namespace ballast::sim
