// The plant's Newton-Euler formulation against the firmware's closed forms, and against Newton's laws written out mass
// by mass.
#include "sim/plant/newton_euler.h"

#include <gtest/gtest.h>

#include "firmware/model/rolling.h"
#include "tests/physics/closed_form_run.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;

struct RandomState {
  Scenario scenario;
  std::array<double, 4> q;
  std::array<double, 3> omega;
  std::array<double, kMaxMasses> position{}, velocity{}, acceleration{};
};

RandomState draw(test::RandomRobot& random) {
  RandomState s{.scenario = random.scenario(random.integer(0, kMaxMasses)), .q = {}, .omega = {}};
  const double rate = std::sqrt(s.scenario.gravity_mps2 / s.scenario.ball.radius_m);
  const Eigen::Quaterniond q = random.attitude();
  s.q = {q.w(), q.x(), q.y(), q.z()};
  for (double& o : s.omega) o = 3 * rate * random.uniform(-1, 1);
  for (std::size_t i = 0; i < s.scenario.masses.size(); ++i) {
    const double unit = s.scenario.masses[i].rail.shape == firmware::RailShape::kCircle ? 1 : s.scenario.ball.radius_m;
    s.position[i] = unit * random.uniform(-3, 3);
    s.velocity[i] = 3 * unit * rate * random.uniform(-1, 1);
    s.acceleration[i] = 10 * unit * rate * rate * random.uniform(-1, 1);
  }
  return s;
}

CarriedMasses carried(const RandomState& s, const Body& body) {
  CarriedMasses masses;
  carry_along(body, s.position.data(), s.velocity.data(), s.acceleration.data(), masses);
  return masses;
}

// N and f_s are differences of larger forces, so they are held against the size of
// the forces they are made of, which never exceeds a few times that of the masses' own accelerations.
TEST(NewtonEuler, AgreesWithThePapersClosedFormsOnTenThousandRandomStates) {
  const std::uint64_t seed = ballast::test::random_seed(20261120);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  double worst_rate = 0, worst_force = 0;
  for (int trial = 0; trial < 10000; ++trial) {
    const RandomState s = draw(random);
    const Body body(s.scenario);
    MotionOf<double> plant;
    rolling_prescribed(body, 0, s.q.data(), s.omega.data(), carried(s, body), plant);

    const firmware::BallParams ball = test::ball_params(s.scenario);
    firmware::MassMotion masses;
    masses.position = s.position;
    masses.velocity = s.velocity;
    masses.acceleration = s.acceleration;
    const auto paper = firmware::rolling_forces(ball, firmware::Quaternion(s.q[0], s.q[1], s.q[2], s.q[3]),
                                                Vector3d(s.omega[0], s.omega[1], s.omega[2]), masses);

    const double rate_scale = paper.angular_acceleration_B_radps2.norm();
    worst_rate = std::max(
        worst_rate, (plant.angular_acceleration_B_radps2 - paper.angular_acceleration_B_radps2).norm() / rate_scale);
    const double force_scale = std::abs(paper.normal_force_n) + paper.static_friction_n;
    const Vector3d force_W = plant.rotation_B_to_W * plant.contact_force_B_n;
    worst_force = std::max({worst_force, std::abs(plant.normal_force_n - paper.normal_force_n) / force_scale,
                            std::abs(plant.static_friction_n - paper.static_friction_n) / force_scale,
                            (force_W.head<2>() - paper.friction_force_W_n).norm() / force_scale});
  }
  RecordProperty("worst_relative_angular_acceleration", std::to_string(worst_rate));
  EXPECT_LT(worst_rate, 1e-12);
  EXPECT_LT(worst_force, 1e-12);
}

// Section 4 without any of the sums' rearrangements: the residuals of Newton's and Euler's equations, mass by mass.
TEST(NewtonEuler, SatisfiesSectionFourWrittenOut) {
  const std::uint64_t seed = ballast::test::random_seed(4);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < 1000; ++trial) {
    const RandomState s = draw(random);
    const Body body(s.scenario);
    MotionOf<double> m;
    rolling_prescribed(body, 0, s.q.data(), s.omega.data(), carried(s, body), m);
    const Eigen::Quaterniond q(s.q[0], s.q[1], s.q[2], s.q[3]);
    const Vector3d up = q.conjugate() * Vector3d::UnitZ();
    const Vector3d w(s.omega[0], s.omega[1], s.omega[2]);
    const Vector3d dw = m.angular_acceleration_B_radps2;
    const Vector3d a = dw.cross(body.radius_m * up);
    const Vector3d gravity = body.gravity_mps2 * up;
    Vector3d newton = -(q.conjugate() * s.scenario.external_force_W_n);
    Vector3d euler = body.inertia_kgm2.cwiseProduct(dw) + w.cross(body.inertia_kgm2.cwiseProduct(w));
    double size = newton.norm();
    const auto add = [&](double mass, const Vector3d& zeta, const Vector3d& c) {
      const Vector3d force = mass * (a + dw.cross(zeta) + c + gravity);
      newton += force;
      euler += zeta.cross(force);
      size += force.norm();
    };
    add(body.shell_mass_kg, body.center_of_mass_B_m, w.cross(w.cross(body.center_of_mass_B_m)));
    for (std::size_t i = 0; i < s.scenario.masses.size(); ++i) {
      const auto rail = firmware::evaluate(body.rail[i], s.position[i]);
      add(body.mass_kg[i], rail.position,
          w.cross(w.cross(rail.position) + 2 * s.velocity[i] * rail.d1) + s.velocity[i] * s.velocity[i] * rail.d2 +
              s.acceleration[i] * rail.d1);
    }
    // Rounding: some hundred operations on terms of this size.
    EXPECT_LT((newton - m.contact_force_B_n).norm(), 1e-13 * size) << "trial " << trial;
    EXPECT_LT((euler + body.radius_m * up.cross(m.contact_force_B_n)).norm(), 1e-13 * size * body.radius_m)
        << "trial " << trial;
    EXPECT_NEAR(m.normal_force_n, (q * m.contact_force_B_n).z(), 1e-13 * size);
    EXPECT_NEAR(m.static_friction_n, (q * m.contact_force_B_n).head<2>().norm(), 1e-13 * size);
  }
}

// Section 5 turned round and back: the forces that a prescribed motion needs, given to driven masses, make that motion.
TEST(NewtonEuler, DrivenMassesUnderTheNeededForcesMoveAsPrescribed) {
  const std::uint64_t seed = ballast::test::random_seed(5);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < 1000; ++trial) {
    const RandomState s = draw(random);
    const Body body(s.scenario);
    Motion prescribed, driven;
    std::array<double, kMaxMasses> force{};
    rolling_prescribed(body, 0, s.q.data(), s.omega.data(), carried(s, body), prescribed);
    generalised_forces(body, s.omega.data(), s.position.data(), s.velocity.data(), s.acceleration.data(), prescribed,
                       force.data());
    rolling_driven(body, 0, s.q.data(), s.omega.data(), s.position.data(), s.velocity.data(), force.data(), driven);
    // Two solutions of 3x3 systems with condition numbers up to about 1e3: 1e3 roundings.
    const double scale = prescribed.angular_acceleration_B_radps2.norm();
    EXPECT_LT((driven.angular_acceleration_B_radps2 - prescribed.angular_acceleration_B_radps2).norm(), 1e-11 * scale);
    EXPECT_LT((driven.contact_force_B_n - prescribed.contact_force_B_n).norm(),
              1e-11 * prescribed.contact_force_B_n.norm());
    for (std::size_t i = 0; i < s.scenario.masses.size(); ++i) {
      const double size =
          std::abs(s.acceleration[i]) + scale * (s.scenario.masses[i].rail.radius_m > 0 ? 1 : body.radius_m);
      EXPECT_NEAR(driven.mass_acceleration[i], s.acceleration[i], 1e-10 * size);
    }
  }
}

}  // namespace
}  // namespace ballast::sim
