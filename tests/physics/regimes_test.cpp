// Sliding, flight, impact and back: the plant's regimes against closed forms, conserved quantities and an integration
// written here mass by mass.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <numbers>

#include "sim/masses/motion.h"
#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

void go(Plant& plant, const Scenario& scenario, double period_s) {
  for (std::int64_t k = 1; plant.time_s() < scenario.duration_s && plant.end() == PhysicsEnd::kNone; ++k) {
    plant.advance(std::min(static_cast<double>(k) * period_s, scenario.duration_s), {});
  }
}

std::vector<Regime> order(const Plant& plant) {
  std::vector<Regime> regimes;
  for (const auto& r : plant.regimes()) regimes.push_back(r.regime);
  return regimes;
}

// Homogeneous, 2/5 m r^2.
Scenario billiard_ball() {
  Scenario s;
  s.duration_s = 2;
  s.gravity_mps2 = 9.81;
  s.run.actuation = Actuation::kPrescribed;
  s.run.on_violation = OnViolation::kContinue;
  s.ball = {.radius_m = 0.03, .mass_kg = 0.2, .inertia_kgm2 = {}, .center_of_mass_B_m = {0, 0, 0}};
  s.ball.inertia_kgm2.setConstant(0.4 * 0.2 * 0.03 * 0.03);
  s.surface = {.static_friction = 0.25, .kinetic_friction = 0.2, .restitution = 0};
  return s;
}

void start_with(Scenario& s, const Vector3d& velocity_W_mps, double height_m = 0) {
  s.initial.has_velocity = true;
  s.initial.velocity_W_mps = velocity_W_mps;
  s.initial.height_m = height_m;
}

// Sliding ends at 2 v0 / (7 mu g) with 5/7 v0, whatever the ticks and also where the run is to stop at violations.
TEST(Sliding, BilliardBallRollsAtFiveSevenths) {
  for (const double period_s : {0.001, 0.01, 0.5}) {
    for (const auto on_violation : {OnViolation::kContinue, OnViolation::kStop}) {
      SCOPED_TRACE(period_s);
      Scenario s = billiard_ball();
      s.run.on_violation = on_violation;
      s.duration_s = 0.35;
      start_with(s, {1.2, -1.6, 0});
      Plant plant(s);
      go(plant, s, period_s);
      ASSERT_EQ(order(plant), (std::vector{Regime::kSliding, Regime::kRolling}));
      EXPECT_EQ(plant.regimes()[0].time_s, 0);
      EXPECT_NEAR(plant.regimes()[1].time_s, 2 * 2.0 / (7 * 0.2 * 9.81), 1e-9);
      EXPECT_LT((plant.sample().velocity_W_mps - 5.0 / 7 * Vector3d(1.2, -1.6, 0)).norm(), 1e-9);
      EXPECT_EQ(plant.time_s(), s.duration_s);
      EXPECT_FALSE(plant.rolling_lost());
      EXPECT_EQ(plant.extrema().mu_required_max.value, 0.2);
      EXPECT_NEAR(plant.extrema().normal_force_min.value, 0.2 * 9.81, 1e-12);
    }
  }
}

// Backspin: v' = -mu g e, spin by mu g r / (2/5 r^2); draw shot that comes back. Slip v0 + r w0 vanishes after 2/7 of
// it over mu g.
TEST(Sliding, DrawShotComesBack) {
  Scenario s = billiard_ball();
  const double v0 = 0.5, spin = 100;  // about -e2: the contact point runs ahead
  s.initial.angular_velocity_B_radps = {0, -spin, 0};
  start_with(s, {v0, 0, 0});
  Plant plant(s);
  go(plant, s, 0.01);
  const double end_s = 2 * (v0 + 0.03 * spin) / (7 * 0.2 * 9.81);
  ASSERT_EQ(order(plant), (std::vector{Regime::kSliding, Regime::kRolling}));
  EXPECT_NEAR(plant.regimes()[1].time_s, end_s, 1e-9);
  EXPECT_NEAR(plant.sample().velocity_W_mps[0], v0 - 0.2 * 9.81 * end_s, 1e-9);
  EXPECT_LT(plant.sample().velocity_W_mps[0], 0);
}

// Section 4 written out mass by mass as one linear system in (a, Omegadot, N), and integrated with the classical
// Runge-Kutta method in small steps: a ball whose centre of mass and three masses are off its centre.
TEST(Sliding, OffCentreBallAgreesWithAnIndependentIntegration) {
  const std::uint64_t seed = ballast::test::random_seed(17);
  int compared = 0;
  for (int trial = 0; trial < 8; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(3);
    s.run.on_violation = OnViolation::kContinue;
    for (auto& mass : s.masses) mass.motion.clear();
    s.surface = {.static_friction = 0.3, .kinetic_friction = 0.2, .restitution = 0};
    const double r = s.ball.radius_m, scale = std::sqrt(s.gravity_mps2 * r);
    start_with(s, 2 * scale * Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), 0));
    Plant plant(s);
    s.duration_s = 0.3 * r / scale;
    go(plant, s, 0.05);
    if (plant.regimes().size() != 1 || plant.end() != PhysicsEnd::kNone) continue;
    ++compared;

    using State = Eigen::Matrix<double, 12, 1>;  // q, Omega, x y, vx vy vz
    const auto rhs = [&](double t, const State& y) {
      const Eigen::Quaterniond q(y[0], y[1], y[2], y[3]);
      const Vector3d w = y.segment<3>(4), up = q.conjugate() * Vector3d::UnitZ();
      const Vector3d slip = Vector3d(y[9], y[10], 0) - (q * w).cross(Vector3d(0, 0, r));
      const Vector3d pushed = up - 0.2 * (q.conjugate() * slip.normalized());  // R_B / N
      Eigen::Matrix<double, 7, 7> matrix = Eigen::Matrix<double, 7, 7>::Zero();
      Eigen::Matrix<double, 7, 1> right = Eigen::Matrix<double, 7, 1>::Zero();
      const auto hat = [](const Vector3d& v) {
        Eigen::Matrix3d m;
        m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
        return m;
      };
      const auto add = [&](double m, const Vector3d& at, const Vector3d& c) {
        matrix.block<3, 3>(0, 0) += m * Eigen::Matrix3d::Identity();
        matrix.block<3, 3>(0, 3) -= m * hat(at);
        matrix.block<3, 3>(3, 0) += m * hat(at);
        matrix.block<3, 3>(3, 3) -= m * hat(at) * hat(at);
        right.head<3>() -= m * (c + s.gravity_mps2 * up);
        right.segment<3>(3) -= m * at.cross(c + s.gravity_mps2 * up);
      };
      add(s.ball.mass_kg, s.ball.center_of_mass_B_m, w.cross(w.cross(s.ball.center_of_mass_B_m)));
      for (const auto& mass : s.masses) {
        const auto rail = firmware::evaluate(mass.rail, mass.initial_position + t * mass.initial_velocity);
        const double rate = mass.initial_velocity;
        add(mass.mass_kg, rail.position, w.cross(w.cross(rail.position) + 2 * rate * rail.d1) + rate * rate * rail.d2);
      }
      matrix.block<3, 3>(3, 3) += Eigen::Matrix3d(s.ball.inertia_kgm2.asDiagonal());
      right.segment<3>(3) -= w.cross(s.ball.inertia_kgm2.cwiseProduct(w));
      right.head<3>() += q.conjugate() * s.external_force_W_n;
      matrix.block<3, 1>(0, 6) = -pushed;
      matrix.block<3, 1>(3, 6) = r * up.cross(pushed);
      matrix.block<1, 3>(6, 0) = up.transpose();
      const Eigen::Matrix<double, 7, 1> u = matrix.fullPivLu().solve(right);
      const Eigen::Quaterniond dq = q * Eigen::Quaterniond(0, w[0] / 2, w[1] / 2, w[2] / 2);
      const Vector3d a = q * Vector3d(u.head<3>());
      State d;
      d << dq.w(), dq.x(), dq.y(), dq.z(), u[3], u[4], u[5], y[9], y[10], a[0], a[1], a[2];
      return d;
    };
    State y = State::Zero();
    const auto& q0 = s.initial.orientation;
    y.head<4>() << q0.w(), q0.x(), q0.y(), q0.z();
    y.segment<3>(4) = s.initial.angular_velocity_B_radps;
    y.segment<2>(7) = s.initial.position_W_m;
    y.tail<3>() = s.initial.velocity_W_mps;
    constexpr int kSteps = 4000;  // error of some (1/4000)^4 times the number of e-foldings: below 1e-12
    const double h = s.duration_s / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const double t = i * h;
      const State k1 = rhs(t, y), k2 = rhs(t + h / 2, y + h / 2 * k1), k3 = rhs(t + h / 2, y + h / 2 * k2),
                  k4 = rhs(t + h, y + h * k3);
      y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    const auto p = plant.sample();
    EXPECT_LT((p.orientation - y.head<4>()).norm(), 1e-9);
    EXPECT_LT((p.angular_velocity_B_radps - y.segment<3>(4)).norm(), 1e-9 * scale / r);
    EXPECT_LT((p.velocity_W_mps - y.tail<3>()).norm(), 1e-9 * scale);
    EXPECT_LT((p.position_W_m.head<2>() - y.segment<2>(7)).norm(), 1e-9);
    EXPECT_LT(std::abs(y[11]),
              1e-9 * scale);  // the constraint, which nothing in the reference enforces on the velocity
  }
  EXPECT_GE(compared, 4);
}

Scenario loaded_ball(double offset, double static_friction, double kinetic_friction, double restitution) {
  Scenario s;
  s.duration_s = 8;
  s.gravity_mps2 = 1;
  s.run.actuation = Actuation::kPrescribed;
  s.run.on_violation = OnViolation::kContinue;
  s.ball = {.radius_m = 1, .mass_kg = 1, .inertia_kgm2 = {0.3, 0.35, 0.4}, .center_of_mass_B_m = {0, 0, -offset}};
  s.surface = {.static_friction = static_friction, .kinetic_friction = kinetic_friction, .restitution = restitution};
  s.initial.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Vector3d(1, 2, 0).normalized()));
  return s;
}

// Through sliding, rolling, flight and impacts of a ball with its weight off centre, energy never rises, and the
// result does not depend on the ticks.
TEST(Regimes, EnergyOnlyFallsAndTicksDoNotMatter) {
  int slides = 0, flights = 0, rolls = 0;
  for (const double friction : {0.1, 0.3}) {
    for (const double kinetic : {1.0, 0.7}) {
      for (const double restitution : {0.0, 0.6}) {
        SCOPED_TRACE(::testing::Message() << friction << " " << kinetic << " " << restitution);
        Scenario s = loaded_ball(0.4, friction, kinetic * friction, restitution);
        s.initial.angular_velocity_B_radps = {0.5, 2, 0.7};
        start_with(s, {1.5, -0.5, 0}, 0.2);
        Plant fine(s), coarse(s);
        double before = test::whole(s, fine.sample()).energy_j;
        for (int k = 1; k <= 400 && fine.end() == PhysicsEnd::kNone; ++k) {
          fine.advance(k * 0.02, {});
          const double now = test::whole(s, fine.sample()).energy_j;
          EXPECT_LE(now, before + 1e-10);  // some 1e3 steps good to 1e-14 of speeds of 1, and the slip given up
          before = now;
        }
        ASSERT_EQ(fine.end(), PhysicsEnd::kNone) << fine.end_text();
        go(coarse, s, 0.37);
        ASSERT_EQ(order(fine), order(coarse));
        for (std::size_t i = 0; i < fine.regimes().size(); ++i) {
          EXPECT_NEAR(fine.regimes()[i].time_s, coarse.regimes()[i].time_s, 1e-7);  // errors grow through impacts
          slides += fine.regimes()[i].regime == Regime::kSliding;
          flights += fine.regimes()[i].regime == Regime::kFlight;
          rolls += fine.regimes()[i].regime == Regime::kRolling;
          if (i > 0) {
            EXPECT_GT(fine.regimes()[i].time_s, fine.regimes()[i - 1].time_s);
            EXPECT_NE(fine.regimes()[i].regime, fine.regimes()[i - 1].regime);
          }
        }
        EXPECT_EQ(fine.regimes()[0].time_s, 0);
      }
    }
  }
  EXPECT_GE(slides, 4);
  EXPECT_GE(flights, 4);
  EXPECT_GE(rolls, 2);
}

// At an energy-conserving floor nothing is lost in a smooth-contact drop: no slip, no offset.
TEST(Impact, BounceHeightsFollowRestitution) {
  for (const double e : {0.0, 0.6}) {
    SCOPED_TRACE(e);
    Scenario s = billiard_ball();
    s.surface.restitution = e;
    s.initial.height_m = 0.5;
    s.duration_s = 3;
    Plant plant(s);
    go(plant, s, 0.01);
    const double first_s = std::sqrt(2 * 0.5 / 9.81), speed = 9.81 * first_s;
    ASSERT_EQ(order(plant), (std::vector{Regime::kFlight, Regime::kRolling}));
    ASSERT_FALSE(plant.impacts().empty());
    double t = first_s, v = speed;
    for (const auto& impact : plant.impacts()) {
      EXPECT_NEAR(impact.time_s, t, 1e-9);
      const bool rest = v < 1e-6 * std::sqrt(9.81 * 0.03);
      EXPECT_NEAR(impact.normal_impulse_ns, 0.2 * v * (1 + (rest ? 0 : e)), 1e-9 * 0.2 * speed);
      EXPECT_TRUE(impact.sticking);
      EXPECT_NEAR(impact.friction_impulse_ns, 0, 1e-12);
      v *= e;
      t += 2 * v / 9.81;
    }
    // Rest: the geometric series' end, but for the bounces below the rest speed.
    EXPECT_NEAR(plant.regimes()[1].time_s, first_s + (e == 0 ? 0 : 2 * speed / 9.81 * e / (1 - e)), 1e-6);
    EXPECT_EQ(plant.sample().position_W_m[2], 0);
    EXPECT_EQ(plant.sample().velocity_W_mps.norm(), 0);
    EXPECT_EQ(plant.extrema().normal_force_min.value, 0);
  }
}

// A spinning ball dropped: |P_t| = mu P_n if the slip outlives the impact, else what stops it: 2/7 m r w.
TEST(Impact, FrictionIsCoulombs) {
  for (const double spin : {20.0, 400.0}) {
    SCOPED_TRACE(spin);
    Scenario s = billiard_ball();
    s.initial.angular_velocity_B_radps = {0, spin, 0};
    start_with(s, {0, 0, 0}, 0.3);
    Plant plant(s);
    go(plant, s, 0.01);
    const double normal = 0.2 * std::sqrt(2 * 9.81 * 0.3), stop = 2.0 / 7 * 0.2 * 0.03 * spin;
    ASSERT_EQ(plant.impacts().size(), 1u);
    const bool sticks = stop <= 0.25 * normal;
    EXPECT_EQ(sticks, spin == 20.0);  // both are tried
    EXPECT_EQ(plant.impacts()[0].sticking, sticks);
    EXPECT_NEAR(plant.impacts()[0].normal_impulse_ns, normal, 1e-10);
    EXPECT_NEAR(plant.impacts()[0].friction_impulse_ns, sticks ? stop : 0.2 * normal, 1e-10);
    if (sticks) {
      EXPECT_EQ(order(plant), (std::vector{Regime::kFlight, Regime::kRolling}));
    } else {
      EXPECT_EQ(order(plant), (std::vector{Regime::kFlight, Regime::kSliding, Regime::kRolling}));
    }
    // Either way a homogeneous ball ends with 2/7 of the surface speed.
    EXPECT_NEAR(plant.sample().velocity_W_mps[0], 2.0 / 7 * 0.03 * spin, 1e-9);
  }
}

// In flight the system's centre of mass flies a parabola, and its angular momentum about it stays, masses moving or
// not.
TEST(Flight, CenterOfMassIsBallisticAndAngularMomentumStays) {
  const std::uint64_t seed = ballast::test::random_seed(23);
  for (int trial = 0; trial < 10; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(1 + trial % 5);
    s.external_force_W_n.setZero();
    s.run.on_violation = OnViolation::kContinue;
    const double r = s.ball.radius_m, g = s.gravity_mps2, speed = std::sqrt(g * r);
    start_with(s, speed * Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), 3), r);
    Plant plant(s);
    const test::Whole start = test::whole(s, plant.sample());
    const double t = 2 * speed / g;
    s.duration_s = t;
    go(plant, s, 0.01);
    ASSERT_EQ(order(plant), std::vector{Regime::kFlight});
    const test::Whole end = test::whole(s, plant.sample());
    const Vector3d gravity(0, 0, -g);
    // Steps good to 1e-12, some hundred of them.
    EXPECT_LT((end.center_W_m - start.center_W_m - t * start.velocity_W_mps - t * t / 2 * gravity).norm(), 1e-9 * r);
    EXPECT_LT((end.velocity_W_mps - start.velocity_W_mps - t * gravity).norm(), 1e-9 * speed);
    EXPECT_LT((end.angular_momentum_W - start.angular_momentum_W).norm(), 1e-9 * start.mass_kg * r * speed);
    EXPECT_EQ(plant.sample().normal_force_n, 0);
    EXPECT_EQ(plant.sample().static_friction_n, 0);
    EXPECT_EQ(plant.extrema().mu_required_max.value, 0);
  }
}

// A ball with one mass on a vertical line: N = M g + m thetaddot = 25 - 50 t until it leaves at t = 0.5; then its
// centre obeys z'' = -g - m thetaddot / M = 20 (t - 1/2), and z = 10/3 (t - 1/2)^3 as long as the mass goes on like
// that.
TEST(Flight, HopWithAMassMovingAgreesWithTheClosedForm) {
  Scenario s;
  s.duration_s = 0.8;
  s.gravity_mps2 = 10;
  s.run.actuation = Actuation::kPrescribed;
  s.run.on_violation = OnViolation::kContinue;
  s.ball = {.radius_m = 1, .mass_kg = 2, .inertia_kgm2 = {0.8, 0.8, 0.8}, .center_of_mass_B_m = {0, 0, 0}};
  Mass m;
  m.mass_kg = 0.5;
  m.rail = firmware::line({0, 0, 0}, {0, 0, 1});
  m.motion = {{2.0, 0, -200}};
  m.motor.shaft_ratio = m.motor.holding_torque_nm = m.motor.rotor_inertia_kgm2 = m.motor.corner_speed_radps = 1;
  s.masses.push_back(m);
  for (const double period_s : {0.001, 0.07, 0.8}) {
    SCOPED_TRACE(period_s);
    Plant plant(s);
    go(plant, s, period_s);
    ASSERT_EQ(order(plant), (std::vector{Regime::kRolling, Regime::kFlight}));
    EXPECT_NEAR(plant.regimes()[1].time_s, 0.5, 1e-9);
    EXPECT_NEAR(plant.sample().position_W_m[2], 10.0 / 3 * 0.3 * 0.3 * 0.3, 1e-9);
    EXPECT_NEAR(plant.sample().velocity_W_mps[2], 10 * 0.3 * 0.3, 1e-9);
    EXPECT_NEAR(plant.sample().acceleration_B_mps2[2], 20 * 0.3, 1e-9);
    EXPECT_TRUE(plant.rolling_lost());
  }
}

// Random robots thrown onto random floors, prescribed and driven: every run gets to its end, through regimes that
// follow one another, in contact forces inside the cone and never below the ground.
TEST(Regimes, RandomRobotsThrownOntoTheFloorGoOnToTheEnd) {
  const std::uint64_t seed = ballast::test::random_seed(29);
  std::array<int, 3> seen{};
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(trial % 4);
    s.run.on_violation = OnViolation::kContinue;
    s.run.actuation = trial % 3 == 0 ? Actuation::kStepper : Actuation::kPrescribed;
    const double mu = random.uniform(0.05, 0.5), e = random.uniform(0, 0.8);
    s.surface = {.static_friction = mu, .kinetic_friction = mu * random.uniform(0.6, 1), .restitution = e};
    const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
    s.initial.angular_velocity_B_radps = speed / r * random.vector(2);
    start_with(s, speed * random.vector(1.5), random.uniform(0, 0.5) * r);
    s.duration_s = 10 * r / speed;
    Plant plant(s);
    for (int k = 1; k <= 100 && plant.end() == PhysicsEnd::kNone; ++k) {
      plant.advance(s.duration_s * k / 100, {});
      const auto p = plant.sample();
      ++seen[static_cast<std::size_t>(p.regime)];
      EXPECT_GE(p.position_W_m[2], -1e-12 * r);
      EXPECT_GE(p.normal_force_n, 0);
      EXPECT_LE(p.static_friction_n, s.surface.static_friction * p.normal_force_n);
    }
    EXPECT_EQ(plant.end(), PhysicsEnd::kNone) << plant.end_text();
    EXPECT_EQ(plant.regimes()[0].time_s, 0);
    for (std::size_t i = 1; i < plant.regimes().size(); ++i) {
      EXPECT_GT(plant.regimes()[i].time_s, plant.regimes()[i - 1].time_s);
      EXPECT_NE(plant.regimes()[i].regime, plant.regimes()[i - 1].regime);
    }
  }
  for (const int count : seen) EXPECT_GT(count, 100);  // each regime has its share of the 4000 samples
}

// The masses as they are make the contact what it is; held still they make it another. In every regime.
TEST(Regimes, ContactForcesOfTheMassesAsTheyAreAreTheSamples) {
  const std::uint64_t seed = ballast::test::random_seed(53);
  std::array<int, 3> seen{};
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(2);
    s.run.on_violation = OnViolation::kContinue;
    s.surface = {.static_friction = 0.3, .kinetic_friction = 0.25, .restitution = 0.4};
    const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
    if (trial % 3 == 1) start_with(s, 5 * speed * Vector3d(1, 0, 0));
    if (trial % 3 == 2) start_with(s, speed * random.vector(1), random.uniform(0, 1.5) * r);
    s.duration_s = 5 * r / speed;
    Plant plant(s);
    for (int k = 1; k <= 20 && plant.end() == PhysicsEnd::kNone; ++k) {
      plant.advance(s.duration_s * k / 20, {});
      const auto p = plant.sample();
      std::array<double, kMaxMasses> acceleration{}, faster{};
      for (std::size_t i = 0; i < s.masses.size(); ++i) {
        const PrescribedMotion motion(s.masses[i]);
        std::size_t piece = 0;
        while (motion.end_s(piece) <= p.time_s) ++piece;
        acceleration[i] = motion.at(piece, p.time_s).acceleration;
        faster[i] = acceleration[i] + speed * speed / r;
      }
      const auto as_they_are =
          plant.contact_forces(p.mass_position.data(), p.mass_velocity.data(), acceleration.data());
      // The same operations; what the last step of the integrator had in hand was before its quaternion was brought
      // back to unit length, which changes it by 1e-13.
      const double weight = 10 * s.gravity_mps2;
      EXPECT_NEAR(as_they_are.normal_force_n, p.normal_force_n, 1e-12 * weight);
      EXPECT_NEAR(as_they_are.static_friction_n, p.static_friction_n, 1e-12 * weight);
      const auto others = plant.contact_forces(p.mass_position.data(), p.mass_velocity.data(), faster.data());
      if (p.regime != Regime::kFlight) {
        EXPECT_GT(std::abs(others.normal_force_n - p.normal_force_n) +
                      std::abs(others.static_friction_n - p.static_friction_n),
                  1e-6 * weight);
      } else {
        EXPECT_EQ(others.normal_force_n, 0);
        EXPECT_EQ(others.static_friction_n, 0);
      }
      ++seen[static_cast<std::size_t>(p.regime)];
    }
  }
  for (const int count : seen) EXPECT_GT(count, 10);
}

// Where rolling slips, with kinetic friction less than or equal to static: contact forces on the cone, the slip begins
// against them, and it ends where the slip does.
TEST(Regimes, RollingSlipsWhereStopSaysAndComesBack) {
  for (const double kinetic : {0.17, 0.12}) {
    SCOPED_TRACE(kinetic);
    auto read = read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/paper_ball.toml", {"run.actuation=prescribed"});
    ASSERT_TRUE(read.ok());
    Scenario s = read.scenario;
    s.surface.static_friction = 0.17;
    s.surface.kinetic_friction = kinetic;
    s.duration_s = 9;
    Plant stops(s);
    go(stops, s, 0.01);
    EXPECT_EQ(stops.end(), PhysicsEnd::kSlipped);
    EXPECT_EQ(order(stops), std::vector{Regime::kRolling});
    s.run.on_violation = OnViolation::kContinue;
    Plant fine(s), coarse(s);
    go(fine, s, 0.001);
    go(coarse, s, 0.13);
    ASSERT_GE(fine.regimes().size(), 3u);
    ASSERT_EQ(order(fine), order(coarse));
    EXPECT_NEAR(fine.regimes()[1].time_s, stops.time_s(), 1e-9);
    for (std::size_t i = 0; i < fine.regimes().size(); ++i) {
      EXPECT_NEAR(fine.regimes()[i].time_s, coarse.regimes()[i].time_s, 1e-9);
    }
    EXPECT_LT((fine.sample().position_W_m - coarse.sample().position_W_m).norm(), 1e-8);
    EXPECT_NEAR(fine.extrema().mu_required_max.value, 0.17, 1e-9);
  }
}

// A heavy point far off centre on a very rough floor: friction along the slip digs it in. The critical kinetic friction
// is (1/M + x^2/I) / (x h / I) with x and h the contact's distances from the centre of mass.
TEST(Inconsistent, PainleveIsNamed) {
  const auto slide = [](double kinetic_friction, double direction) {
    Scenario s = loaded_ball(0, 10, kinetic_friction, 0);
    s.ball.inertia_kgm2.setConstant(0.01);
    s.ball.center_of_mass_B_m = {0.6, 0, 0.6};
    s.initial.orientation.setIdentity();
    start_with(s, {direction, 0, 0});
    return Plant(s);
  };
  const double inertia = 0.01, x = 0.6, h = 1.6;
  const double critical = (1 + x * x / inertia) / (x * h / inertia);
  EXPECT_EQ(slide(0.99 * critical, -1).end(), PhysicsEnd::kNone);
  EXPECT_EQ(slide(1.01 * critical, 1).end(), PhysicsEnd::kNone);  // the weight ahead of the contact: no digging in
  const Plant jammed = slide(1.01 * critical, -1);
  EXPECT_EQ(jammed.end(), PhysicsEnd::kInconsistent);
  EXPECT_NE(jammed.end_text().find("Painleve"), std::string::npos);
  EXPECT_EQ(jammed.time_s(), 0);
}

// The same while the ball slides: friction turns it until the kinetic friction is critical. N grows without bound up to
// that instant, and the state that is left there has numbers.
TEST(Inconsistent, PainleveWhileSlidingLeavesAState) {
  int jammed = 0;
  for (int k = 0; k < 60; ++k) {
    const double inertia = 0.02, x = 0.2, z = 0.09;
    const double critical = (inertia + x * x) / (x * (1 + z));
    Scenario s = loaded_ball(0, 10, (0.97 + 0.0005 * k) * critical, 0);
    s.ball.inertia_kgm2.setConstant(inertia);
    s.ball.center_of_mass_B_m = {x, 0, z};
    s.initial.orientation.setIdentity();
    s.initial.angular_velocity_B_radps = {0, 0.05, 0};
    start_with(s, {-8, 0, 0});
    s.duration_s = 0.2;
    Plant plant(s);
    go(plant, s, 1e-2);
    if (plant.end() != PhysicsEnd::kInconsistent) continue;
    ++jammed;
    EXPECT_GT(plant.time_s(), 0) << k;
    const Sample sample = plant.sample();
    ASSERT_TRUE(std::isfinite(sample.normal_force_n) && sample.up_B.allFinite()) << k;
  }
  EXPECT_GT(jammed, 10);
}

// The paper's heavy ball: where N falls to 0 the floor still holds it by f_s = 5.05, and without that force its centre
// would accelerate into the floor. Perfect friction has no way on, and that is said.
TEST(Inconsistent, PerfectFrictionThatHasNoWayOnIsNamed) {
  auto read = read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/paper_detach.toml", {"run.on_violation=continue"});
  ASSERT_TRUE(read.ok());
  Plant plant(read.scenario);
  go(plant, read.scenario, 0.01);
  EXPECT_EQ(plant.end(), PhysicsEnd::kInconsistent);
  EXPECT_NE(plant.end_text().find("perfect friction"), std::string::npos);
  EXPECT_NEAR(plant.time_s(), 3.609500738, 1e-8);  // where it detaches in a run that stops there
}

// Driven masses through a drop, impacts, sliding and rolling, with the fields at rest and nothing that dissipates in
// the motors: the magnetic springs take part, and the whole never gains energy. In flight it keeps it.
TEST(Driven, EnergyBalanceThroughAllRegimes) {
  Scenario s;
  s.duration_s = 3;
  s.gravity_mps2 = 9.81;
  s.run.on_violation = OnViolation::kContinue;
  s.ball = {
      .radius_m = 0.15, .mass_kg = 0.8, .inertia_kgm2 = {0.010, 0.011, 0.012}, .center_of_mass_B_m = {0, 0, -0.01}};
  s.surface = {.static_friction = 0.15, .kinetic_friction = 0.12, .restitution = 0.5};
  for (int i = 0; i < 2; ++i) {
    Mass m;
    m.mass_kg = 0.25;
    m.rail = firmware::circle_about(0.11, i * 1.1, 0.3);
    m.initial_position = -1.2 + 0.4 * i;
    m.motor.holding_torque_nm = 8;
    m.motor.rotor_inertia_kgm2 = 1e-3;
    m.motor.corner_speed_radps = 1e6;
    m.motor.step_error = 0;
    m.motor.shaft_ratio = 1;
    s.masses.push_back(m);
  }
  s.initial.angular_velocity_B_radps = {1, 4, 0.5};
  start_with(s, {0.6, 0.2, 0}, 0.1);
  Plant plant(s);
  const test::Fields field = test::balanced_fields(s, plant.sample());
  const auto whole = [&] {
    const auto p = plant.sample();
    return test::whole(s, p).energy_j + test::rotor_energy_j(s, p) + test::magnetic_energy_j(s, p, field);
  };
  double before = whole();
  const double first = before;
  std::size_t impacts = 0;
  bool flew = true;
  for (int k = 1; k <= 3000 && plant.end() == PhysicsEnd::kNone; ++k) {
    plant.advance(k * 0.001, {});
    const double now = whole();
    const bool flies = plant.sample().regime == Regime::kFlight;
    if (flew && flies && plant.impacts().size() == impacts) {
      EXPECT_NEAR(now, before, 1e-9);  // steps good to 1e-12, springs of 20 kN m/rad^2: some 1e2 times that
    }
    EXPECT_LE(now, before + 1e-9);
    flew = flies;
    impacts = plant.impacts().size();
    before = now;
  }
  ASSERT_EQ(plant.end(), PhysicsEnd::kNone) << plant.end_text();
  EXPECT_GE(plant.impacts().size(), 2u);
  EXPECT_LT(before, first - 0.1);
  EXPECT_GE(plant.regimes().size(), 2u);
}

// An impact at the start that has no answer: there is a regime, a state and forces to show nevertheless.
TEST(Inconsistent, AStartingImpactLeavesARegimeAndAState) {
  Scenario s = loaded_ball(0.06, 0.9, 0.9, 1.0);
  s.ball = {.radius_m = 0.1,
            .mass_kg = 1,
            .inertia_kgm2 = Vector3d::Constant(0.004),
            .center_of_mass_B_m = Vector3d(0.06, 0, -0.01)};
  s.masses.clear();
  s.gravity_mps2 = 9.81;
  s.initial = {};
  s.initial.has_velocity = true;
  s.initial.velocity_W_mps = {1.614, 0, -1};
  s.initial.angular_velocity_B_radps = {0, 14.009, 0};
  const Plant plant(s);
  EXPECT_EQ(plant.end(), PhysicsEnd::kInconsistent);
  ASSERT_EQ(plant.regimes().size(), 1u);
  EXPECT_EQ(plant.regimes()[0].regime, Regime::kFlight);
  EXPECT_EQ(plant.sample().up_B, Vector3d::UnitZ());
  EXPECT_EQ(plant.extrema().normal_force_min.time_s, 0);
}

// A mass that is pulled down with 60 m/s^2 lifts a sliding ball off at once: N jumps past 0, and what it would be on
// the floor is no force that ever acts.
TEST(Regimes, ForcesOfARegimeThatIsOverAsItBeginsDoNotCount) {
  Scenario s;
  s.duration_s = 0.04;
  s.gravity_mps2 = 10;
  s.run.actuation = Actuation::kPrescribed;
  s.run.on_violation = OnViolation::kContinue;
  s.ball = {
      .radius_m = 0.1, .mass_kg = 1, .inertia_kgm2 = Vector3d::Constant(0.004), .center_of_mass_B_m = Vector3d::Zero()};
  s.surface = {.static_friction = 0.2, .kinetic_friction = 0.15, .restitution = 0};
  Mass mass;
  mass.mass_kg = 1;
  mass.rail = firmware::line(Vector3d::Zero(), Vector3d::UnitZ());
  mass.motion = {{0.02, 0, 0}, {0.02, -60, -60}};
  mass.motor.shaft_ratio = 1;
  s.masses.push_back(mass);
  s.initial.has_velocity = true;
  s.initial.velocity_W_mps = {0.2, 0, 0};
  Plant plant(s);
  go(plant, s, 0.001);
  EXPECT_EQ(order(plant), (std::vector{Regime::kSliding, Regime::kFlight}));
  EXPECT_EQ(plant.extrema().normal_force_min.value, 0);
  EXPECT_NEAR(plant.extrema().normal_force_max.value, 20, 1e-12);
}

// Without gravity the scales of speed and force are those of the external force. From height h under the acceleration a
// the ball lands after sqrt(2h/a), and bounces of e add up to that times (1 + e) / (1 - e).
TEST(Impact, BouncingWithoutGravityEndsByRest) {
  Scenario s;
  s.duration_s = 3;
  s.gravity_mps2 = 0;
  s.external_force_W_n = {0, 0, -10};
  s.run.actuation = Actuation::kPrescribed;
  s.run.on_violation = OnViolation::kContinue;
  s.ball = {
      .radius_m = 0.1, .mass_kg = 1, .inertia_kgm2 = Vector3d::Constant(0.004), .center_of_mass_B_m = Vector3d::Zero()};
  s.surface = {.static_friction = 0.5, .kinetic_friction = 0.5, .restitution = 0.6};
  s.initial.height_m = 1;
  Plant plant(s);
  go(plant, s, 0.01);
  EXPECT_EQ(order(plant), (std::vector{Regime::kFlight, Regime::kRolling}));
  // Bounces slower than 1e-6 of the scale of speed, 1 m/s, are left out: 1e-7 s each.
  EXPECT_NEAR(plant.regimes()[1].time_s, std::sqrt(0.2) * 1.6 / 0.4, 1e-6);
  EXPECT_LT(plant.impacts().size(), 40u);
}

// Slips that begin, in robots and motions of all kinds: a step of the integrator that went on with the law of a
// beginning slip would make transitions depend on the ticks.
TEST(Regimes, TransitionsDoNotDependOnTheTicks) {
  const std::uint64_t seed = ballast::test::random_seed(61);
  int transitions = 0;
  for (int trial = 0; trial < 150; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(random.integer(1, 4));
    s.surface = {.static_friction = random.uniform(0.002, 0.05), .kinetic_friction = 0, .restitution = 0};
    s.surface.kinetic_friction = random.uniform(0.5, 0.9) * s.surface.static_friction;
    s.run.on_violation = OnViolation::kContinue;
    s.duration_s = std::min(s.duration_s, 1.0);
    Plant fine(s), coarse(s);
    go(fine, s, 0.001);
    go(coarse, s, 0.0371);
    ASSERT_EQ(order(fine), order(coarse));
    for (std::size_t i = 0; i < fine.regimes().size(); ++i, ++transitions) {
      EXPECT_NEAR(fine.regimes()[i].time_s, coarse.regimes()[i].time_s, 1e-9) << i;
    }
    // Where a slip ends slowly the state keeps some hundred times the tolerance of its steps.
    EXPECT_LT((fine.sample().orientation - coarse.sample().orientation).norm(), 1e-9);
  }
  EXPECT_GT(transitions, 100);
}

}  // namespace
}  // namespace ballast::sim
