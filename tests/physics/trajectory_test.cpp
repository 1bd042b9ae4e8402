// Masses on trajectories chi(t) and on spline rails, under forces that change: the plant against the paper's closed
// forms, instant by instant and over whole runs, and against the same motion along rails.
#include <gtest/gtest.h>

#include <numbers>

#include "sim/closed_forms/detached.h"
#include "sim/masses/spline_rail.h"
#include "sim/plant/plant.h"
#include "tests/physics/random_robot.h"
#include "tests/physics/trajectory_run.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;

double rate_of(const Scenario& s) { return std::sqrt(s.gravity_mps2 / s.ball.radius_m); }

// A smooth walk through random points, slow enough for the ball to stay on the ground most of the time.
Trajectory random_trajectory(test::RandomRobot& random, const Scenario& s) {
  Trajectory t;
  const double beat_s = 1.5 / rate_of(s);
  const Vector3d middle = 0.3 * s.ball.radius_m * random.direction();
  t.periodic = random.integer(0, 1) == 0;
  double time = t.periodic ? random.uniform(-1, 1) : -random.uniform(0, 0.5) * beat_s;
  const std::size_t rows = static_cast<std::size_t>(random.integer(3, 7));
  while (t.periodic ? t.times_s.size() < rows : t.times_s.size() < 2 || t.times_s.back() < s.duration_s) {
    t.times_s.push_back(time);
    t.points_B_m.push_back(middle + 0.12 * s.ball.radius_m * random.vector(1));
    time += beat_s * random.uniform(0.8, 1.5);
  }
  if (t.periodic) t.points_B_m.back() = t.points_B_m.front();
  return t;
}

void add_changing_force(test::RandomRobot& random, Scenario& s) {
  const double weight = s.ball.mass_kg * s.gravity_mps2, speed = rate_of(s) * s.ball.radius_m;
  s.external_force_W_n.setZero();
  double time = random.uniform(-1, 0.5);
  for (int i = 0; i < 5; ++i) {
    s.force_table.times_s.push_back(time);
    s.force_table.forces_W_n.emplace_back(0.05 * weight * random.vector(1));
    time += random.uniform(0.1, 1);
  }
  s.drag = {.coefficient_kgpm = 0.1 * weight / (speed * speed), .wind_W_mps = 0.5 * speed * random.vector(1)};
}

Scenario random_scenario(test::RandomRobot& random) {
  Scenario s = random.scenario(random.integer(1, 4));
  for (Mass& mass : s.masses) {
    if (random.integer(0, 2) > 0) mass.trajectory = random_trajectory(random, s);
  }
  if (random.integer(0, 2) > 0) add_changing_force(random, s);
  return s;
}

// chi, chidot and chiddot of every mass, from its curve or its rail.
closed_forms::MassTrajectories trajectories(const Scenario& s, const firmware::BallParams& ball, double time_s) {
  firmware::MassMotion motion;
  for (std::size_t i = 0; i < s.masses.size(); ++i) {
    const PrescribedMotion along(s.masses[i]);
    std::size_t piece = 0;
    while (along.end_s(piece) <= time_s) ++piece;
    const auto p = along.at(piece, time_s);
    motion.position[i] = p.position, motion.velocity[i] = p.velocity, motion.acceleration[i] = p.acceleration;
  }
  closed_forms::MassTrajectories all = closed_forms::along_rails(ball, motion);
  for (std::size_t i = 0; i < s.masses.size(); ++i) {
    const Trajectory& t = s.masses[i].trajectory;
    if (t.times_s.empty()) continue;
    const auto chi =
        (t.periodic ? CubicSpline::closed(t.times_s, t.points_B_m) : CubicSpline::open(t.times_s, t.points_B_m))
            .at(time_s);
    all.position_B_m[i] = chi.position, all.velocity_B_mps[i] = chi.d1, all.acceleration_B_mps2[i] = chi.d2;
  }
  return all;
}

// eq_Om, eq_normal and eq_static_friction; in flight eq_detach_dOm and eq_ddot_z_GC: at every tick of runs that roll,
// fly and land, with the force of the instant.
TEST(Trajectories, EveryInstantAgreesWithTheClosedForms) {
  const std::uint64_t seed = ballast::test::random_seed(41);
  int rolling = 0, flying = 0;
  for (int trial = 0; trial < 60; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random_scenario(random);
    s.run.on_violation = OnViolation::kContinue;
    if (trial % 3 == 0) {
      s.initial.has_velocity = true;
      s.initial.height_m = 2 * s.ball.radius_m;
      s.initial.velocity_W_mps = s.ball.radius_m * rate_of(s) * random.vector(1);
    }
    firmware::BallParams ball = test::ball_on_rails(s);
    const ExternalForce force(s);
    Plant plant(s);
    for (int k = 1; k <= 40 && plant.end() == PhysicsEnd::kNone; ++k) {
      plant.advance(s.duration_s * k / 40, {});
      if (plant.end() != PhysicsEnd::kNone) break;
      const auto now = plant.sample();
      const auto f = force.at(now.time_s, vec3(now.velocity_W_mps));
      ball.external_force_W_n = Vector3d(f.x, f.y, f.z);
      const firmware::Quaternion q(now.orientation[0], now.orientation[1], now.orientation[2], now.orientation[3]);
      const auto masses = trajectories(s, ball, now.time_s);
      double total_kg = s.ball.mass_kg;
      for (const Mass& mass : s.masses) total_kg += mass.mass_kg;
      if (now.regime == Regime::kRolling) {
        ++rolling;
        const auto paper = closed_forms::rolling_forces_3d(ball, q, now.angular_velocity_B_radps, masses);
        const double size = total_kg * s.gravity_mps2 + std::abs(paper.normal_force_n) + paper.static_friction_n;
        // The velocity is the one the force was taken at.
        ASSERT_NEAR(now.normal_force_n, paper.normal_force_n, 1e-12 * size);
        ASSERT_NEAR(now.static_friction_n, paper.static_friction_n, 1e-12 * size);
        ASSERT_LT((now.friction_force_W_n - paper.friction_force_W_n).norm(), 1e-12 * size);
        const Vector3d acceleration_W = (q * paper.angular_acceleration_B_radps2).cross(Vector3d(0, 0, ball.radius_m));
        ASSERT_LT((q * now.acceleration_B_mps2 - acceleration_W).norm(),
                  1e-12 * (acceleration_W.norm() + s.gravity_mps2));
      } else if (now.regime == Regime::kFlight) {
        ++flying;
        const auto paper = closed_forms::detached_motion_3d(ball, q, now.angular_velocity_B_radps, masses);
        ASSERT_LT((q * now.acceleration_B_mps2 - paper.acceleration_W_mps2).norm(),
                  1e-12 * (paper.acceleration_W_mps2.norm() + s.gravity_mps2));
      }
    }
  }
  EXPECT_GT(rolling, 400);
  EXPECT_GT(flying, 50);
}

// Whole runs against CVODE on eq_Om: 1e-8 is the bar for the shipped scenarios.
TEST(Trajectories, RunsAgreeWithCvodeOnTheClosedForms) {
  const std::uint64_t seed = ballast::test::random_seed(43);
  int completed = 0;
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    const Scenario s = random_scenario(random);
    Plant plant(s);
    for (int k = 1; plant.time_s() < s.duration_s && plant.end() == PhysicsEnd::kNone; ++k) {
      plant.advance(std::min(k * s.run.control_period_s, s.duration_s), {});
    }
    ASSERT_NE(plant.end(), PhysicsEnd::kInconsistent) << plant.end_text();
    completed += plant.end() == PhysicsEnd::kNone;
    test::TrajectoryRun reference(s);
    ASSERT_TRUE(reference.advance(plant.time_s()));
    const auto now = plant.sample();
    EXPECT_LT(std::min((now.orientation - reference.orientation()).norm(),
                       (now.orientation + reference.orientation()).norm()),
              1e-8);
    EXPECT_LT((now.angular_velocity_B_radps - reference.angular_velocity_B()).norm(), 1e-8 * rate_of(s));
    EXPECT_LT((now.position_W_m.head<2>() - reference.position_W()).norm(), 1e-8);
  }
  EXPECT_GT(completed, 15);  // they are meant to roll, mostly
}

Scenario one_circle(test::RandomRobot& random) {
  Scenario s = random.scenario(1);
  const Vector3d x = random.direction(), y = x.cross(random.direction()).normalized();
  s.masses[0].rail = firmware::circle(0.1 * s.ball.radius_m * random.direction(), 0.5 * s.ball.radius_m, x, y);
  s.masses[0].mass_kg = 0.1 * s.ball.mass_kg;
  s.masses[0].initial_position = random.uniform(-3, 3);
  s.masses[0].initial_velocity = 0.8 * rate_of(s);
  s.masses[0].motion.clear();
  s.duration_s = 4 / rate_of(s);
  s.run.control_period_s = s.duration_s / 50;
  return s;
}

Plant::Sample end_of(const Scenario& s) {
  Plant plant(s);
  for (int k = 1; k <= 50; ++k) plant.advance(s.duration_s * k / 50, {});
  EXPECT_EQ(plant.end(), PhysicsEnd::kNone);
  return plant.sample();
}

double distance(const Plant::Sample& a, const Plant::Sample& b, const Scenario& s) {
  return std::max({(a.orientation - b.orientation).norm(),
                   (a.angular_velocity_B_radps - b.angular_velocity_B_radps).norm() / rate_of(s),
                   (a.position_W_m - b.position_W_m).norm() / s.ball.radius_m});
}

// A table that samples a motion round a circle: the state at the end with order 4, although the accelerations have 2,
// because what they are wrong by between two knots comes to nothing over them.
TEST(Trajectories, SampledCircleConvergesToTheRailWithOrderFour) {
  const std::uint64_t seed = ballast::test::random_seed(47);
  for (int trial = 0; trial < 3; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    const Scenario on_rail = one_circle(random);
    const auto exact = end_of(on_rail);
    const Mass& mass = on_rail.masses[0];
    double previous = 0;
    for (const int count : {20, 40, 80, 160}) {
      Scenario s = on_rail;
      const double step_s = s.duration_s / count;
      // 12 rows more on either side: what a not-a-knot end does wrong is a quarter of itself from row to row.
      for (int i = -12; i <= count + 12; ++i) {
        const double time = i * step_s;
        s.masses[0].trajectory.times_s.push_back(time);
        s.masses[0].trajectory.points_B_m.push_back(
            firmware::evaluate(mass.rail, mass.initial_position + mass.initial_velocity * time).position);
      }
      const double error = distance(end_of(s), exact, s);
      if (previous > 0) {
        EXPECT_NEAR(std::log2(previous / error), 4, 0.3) << count;
      }
      previous = error;
    }
    EXPECT_LT(previous, 1e-7);
  }
}

// The same circle as a spline rail of ever more pieces, from knot to knot of the coarsest: order 4, as above.
TEST(SplineRuns, CircleAsASplineRailConvergesToTheCircle) {
  const std::uint64_t seed = ballast::test::random_seed(53);
  test::RandomRobot random(seed);
  Scenario on_circle = one_circle(random);
  on_circle.masses[0].initial_position = 0;
  on_circle.masses[0].initial_velocity = 10. / 16 * 2 * std::numbers::pi / on_circle.duration_s;
  const auto exact = end_of(on_circle);
  const Mass& mass = on_circle.masses[0];
  const double radius = mass.rail.radius_m;
  std::vector<Vector3d> points;
  for (int i = 0; i < 300; ++i) {
    points.push_back(firmware::evaluate(mass.rail, 2 * std::numbers::pi * i / 300).position);
  }
  double previous = 0;
  for (const int pieces : {16, 32, 64}) {
    Scenario s = on_circle;
    s.masses[0].rail = spline_rail(points, true, pieces).rail;
    s.masses[0].initial_position *= radius;
    s.masses[0].initial_velocity *= radius;
    const double error = distance(end_of(s), exact, s);
    if (previous > 0) {
      EXPECT_NEAR(std::log2(previous / error), 4, 0.3) << pieces;
    }
    previous = error;
  }
  EXPECT_LT(previous, 1e-5);
}

// Where the plant's steps stop: at every row of the table after t = 0, in every period.
TEST(Trajectories, TheRowsOfTheTableAreStops) {
  const auto stops = [](const std::vector<double>& times_s, bool periodic) {
    Mass mass;
    mass.trajectory = {times_s, std::vector<Vector3d>(times_s.size(), Vector3d::Zero()), periodic};
    const PrescribedMotion motion(mass);
    std::vector<double> found;
    for (std::size_t piece = 0; motion.end_s(piece) < 3.2; ++piece) {
      EXPECT_EQ(motion.at(piece, 0.7).position, 0.7);
      EXPECT_EQ(motion.at(piece, 0.7).velocity, 1);
      EXPECT_EQ(motion.at(piece, 0.7).acceleration, 0);
      if (motion.end_s(piece) > 0) found.push_back(motion.end_s(piece));
    }
    return found;
  };
  EXPECT_EQ(stops({-1, 0.5, 2, 4}, false), (std::vector<double>{0.5, 2}));
  EXPECT_EQ(stops({10, 10.5, 12}, true), (std::vector<double>{0.5, 2, 2.5}));
  EXPECT_EQ(stops({0.25, 0.5, 1.25}, true), (std::vector<double>{0.25, 0.5, 1.25, 1.5, 2.25, 2.5}));
  EXPECT_EQ(stops({-2.5, -2.25, -0.5}, true), (std::vector<double>{1.5, 1.75}));
}

// A periodic table may begin anywhere in its period, and be written out period by period.
TEST(Trajectories, APeriodicTableHasNoBeginning) {
  const std::uint64_t seed = ballast::test::random_seed(59);
  test::RandomRobot random(seed);
  Scenario s = one_circle(random);
  const double period_s = s.duration_s / 3.7;
  Trajectory& table = s.masses[0].trajectory;
  table.periodic = true;
  const double part[] = {0, 0.2, 0.35, 0.7, 1};
  for (const double p : part) {
    table.times_s.push_back(p * period_s);
    table.points_B_m.push_back(0.1 * s.ball.radius_m * random.direction());
  }
  table.points_B_m.back() = table.points_B_m.front();
  const auto first = end_of(s);
  Scenario shifted = s;
  Trajectory& other = shifted.masses[0].trajectory;
  for (int i = 0; i < 5; ++i) {
    const int j = (i + 2) % 4;  // begins with the third row, five periods before
    const double wrapped = i + 2 < 4 ? 0 : 1;
    other.times_s[static_cast<std::size_t>(i)] = (part[j] + wrapped - 5) * period_s;
    other.points_B_m[static_cast<std::size_t>(i)] = table.points_B_m[static_cast<std::size_t>(j)];
  }
  EXPECT_LT(distance(end_of(shifted), first, s), 1e-11);
  Scenario twice = s;
  Trajectory& longer = twice.masses[0].trajectory;
  for (std::size_t i = 1; i < 5; ++i) {
    longer.times_s.push_back(period_s + table.times_s[i]);
    longer.points_B_m.push_back(table.points_B_m[i]);
  }
  EXPECT_LT(distance(end_of(twice), first, s), 1e-11);
}

// Every place of a spline rail in the firmware's closed form and in the plant, prescribed and turned round: driven
// masses under the forces needed.
TEST(SplineRuns, DrivenAlongASplineUnderTheNeededForcesMovesAsPrescribed) {
  const std::uint64_t seed = ballast::test::random_seed(61);
  for (int trial = 0; trial < 200; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(2);
    for (Mass& mass : s.masses) {
      std::vector<Vector3d> points;
      for (int i = 0; i < 6; ++i) points.push_back(0.6 * s.ball.radius_m * random.direction());
      mass.rail = spline_rail(points, random.integer(0, 1) == 0).rail;
    }
    const double length = s.ball.radius_m, rate = rate_of(s);
    const Body body(s);
    const Eigen::Quaterniond attitude = random.attitude();
    const double q[] = {attitude.w(), attitude.x(), attitude.y(), attitude.z()};
    const Vector3d omega = rate * random.vector(1);
    firmware::MassMotion m;
    CarriedMasses carried;
    for (std::size_t i = 0; i < 2; ++i) {
      m.position[i] = length * random.uniform(-2, 6);
      m.velocity[i] = length * rate * random.uniform(-1, 1);
      m.acceleration[i] = length * rate * rate * random.uniform(-1, 1);
    }
    carry_along(body, m.position.data(), m.velocity.data(), m.acceleration.data(), carried);
    Motion prescribed, driven;
    rolling_prescribed(body, 0, q, omega.data(), carried, prescribed);
    const auto paper = firmware::rolling_forces(test::ball_on_rails(s), attitude, omega, m);
    const double scale = paper.angular_acceleration_B_radps2.norm(), size = prescribed.contact_force_B_n.norm();
    EXPECT_LT((prescribed.angular_acceleration_B_radps2 - paper.angular_acceleration_B_radps2).norm(), 1e-12 * scale);
    EXPECT_NEAR(prescribed.normal_force_n, paper.normal_force_n, 1e-12 * size);
    std::array<double, kMaxMasses> force{};
    generalised_forces(body, omega.data(), m.position.data(), m.velocity.data(), m.acceleration.data(), prescribed,
                       force.data());
    rolling_driven(body, 0, q, omega.data(), m.position.data(), m.velocity.data(), force.data(), driven);
    // As in NewtonEuler.DrivenMassesUnderTheNeededForces…: condition 1e3.
    EXPECT_LT((driven.angular_acceleration_B_radps2 - prescribed.angular_acceleration_B_radps2).norm(), 1e-11 * scale);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_NEAR(driven.mass_acceleration[i], m.acceleration[i],
                  1e-10 * (std::abs(m.acceleration[i]) + scale * length));
    }
  }
}

// The stops that knots make, against a fine walk along the motion: between two of them the mass is between two knots,
// and none comes without a knot or the end of a piece.
TEST(SplineRails, MotionIsSmoothUntilTheNextKnot) {
  const std::uint64_t seed = ballast::test::random_seed(52);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  int knots = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Mass mass;
    mass.rail.shape = firmware::RailShape::kSpline;
    mass.rail.piece_length_m = random.uniform(0.01, 0.1);
    mass.initial_position = random.integer(0, 1) * 3 * mass.rail.piece_length_m;  // on a knot
    mass.initial_velocity = random.integer(0, 1) * random.uniform(-0.2, 0.2);
    for (int i = random.integer(0, 4); i > 0; --i) {
      mass.motion.push_back({random.uniform(0.1, 1), random.uniform(-1, 1), random.uniform(-1, 1)});
    }
    const PrescribedMotion motion(mass);
    double time = 0;
    std::size_t piece = 0;
    while (time < 5) {
      while (motion.end_s(piece) <= time) ++piece;
      const double until = motion.smooth_until_s(piece, time);
      ASSERT_GT(until, time);
      const double last = std::min(until, 6.0);
      const auto place = [&](double t) { return motion.at(piece, t).position / mass.rail.piece_length_m; };
      const double inside = std::floor(place((time + last) / 2));
      for (int k = 0; k <= 50; ++k) {
        const double at = place(time + (last - time) * k / 50);
        ASSERT_GT(at, inside - 2e-9) << "trial " << trial << " t " << time;
        ASSERT_LT(at, inside + 1 + 2e-9) << "trial " << trial << " t " << time;
      }
      if (until < motion.end_s(piece)) {
        ASSERT_NEAR(place(until), std::round(place(until)), 1e-9);
        ++knots;
      }
      time = until;
    }
  }
  EXPECT_GT(knots, 1000);
}

}  // namespace
}  // namespace ballast::sim
