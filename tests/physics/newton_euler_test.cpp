// The plant's Newton-Euler formulation against the firmware's closed forms, and against Newton's laws written out mass
// by mass.
#include "sim/plant/newton_euler.h"

#include <gtest/gtest.h>

#include "firmware/model/rolling.h"
#include "sim/plant/contact.h"
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

RandomState draw(test::RandomRobot& random, bool real_floor) {
  RandomState s{.scenario = random.scenario(random.integer(0, kMaxMasses)), .q = {}, .omega = {}};
  if (real_floor) random.make_floor_real(s.scenario);
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

// Whether the floor slopes and resists.
class NewtonEuler : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Floor, NewtonEuler, testing::Bool(),
                         [](const auto& real) { return std::string(real.param ? "real" : "ideal"); });

// The weight per mass and T_W / N of physics.md, "Real floors", in the body.
struct FloorLaw {
  FloorLaw(const Scenario& s, const Eigen::Quaterniond& q, const Vector3d& omega_B) {
    const Surface& f = s.surface;
    const Vector3d down_W(std::sin(f.slope_rad) * std::cos(f.downhill_rad),
                          std::sin(f.slope_rad) * std::sin(f.downhill_rad), -std::cos(f.slope_rad));
    gravity_B_mps2 = s.gravity_mps2 * (q.conjugate() * down_W);
    const double creep = f.creep_radps > 0 ? f.creep_radps : 1e-3 * std::sqrt(s.gravity_mps2 / s.ball.radius_m);
    const Vector3d omega_W = q * omega_B, level(omega_W[0], omega_W[1], 0);
    const Vector3d moment_W = -f.rolling_resistance * s.ball.radius_m * level / std::hypot(level.norm(), creep) -
                              Vector3d(0, 0, f.spin_friction_m * omega_W[2] / std::hypot(omega_W[2], creep));
    moment_B_m = q.conjugate() * moment_W;
  }
  Vector3d gravity_B_mps2, moment_B_m;
};

// N and f_s are differences of larger forces, so they are held against the size of
// the forces they are made of, which never exceeds a few times that of the masses' own accelerations.
TEST_P(NewtonEuler, AgreesWithThePapersClosedFormsOnTenThousandRandomStates) {
  const std::uint64_t seed = ballast::test::random_seed(20261120);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  double worst_rate = 0, worst_force = 0;
  for (int trial = 0; trial < 10000; ++trial) {
    const RandomState s = draw(random, GetParam());
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
TEST_P(NewtonEuler, SatisfiesSectionFourWrittenOut) {
  const std::uint64_t seed = ballast::test::random_seed(4);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < 1000; ++trial) {
    const RandomState s = draw(random, GetParam());
    const Body body(s.scenario);
    MotionOf<double> m;
    rolling_prescribed(body, 0, s.q.data(), s.omega.data(), carried(s, body), m);
    const Eigen::Quaterniond q(s.q[0], s.q[1], s.q[2], s.q[3]);
    const Vector3d up = q.conjugate() * Vector3d::UnitZ();
    const Vector3d w(s.omega[0], s.omega[1], s.omega[2]);
    const Vector3d dw = m.angular_acceleration_B_radps2;
    const Vector3d a = dw.cross(body.radius_m * up);
    const FloorLaw floor(s.scenario, q, w);
    const Vector3d gravity = -floor.gravity_B_mps2;
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
    const Vector3d moment = std::max(0.0, m.normal_force_n) * floor.moment_B_m;  // none where the floor would pull
    EXPECT_LT((euler + body.radius_m * up.cross(m.contact_force_B_n) - moment).norm(), 1e-13 * size * body.radius_m)
        << "trial " << trial;
    EXPECT_NEAR(m.normal_force_n, (q * m.contact_force_B_n).z(), 1e-13 * size);
    EXPECT_NEAR(m.static_friction_n, (q * m.contact_force_B_n).head<2>().norm(), 1e-13 * size);
  }
}

// The same in sliding, where the contact force is given by the law of friction, and in flight, where it is none.
TEST_P(NewtonEuler, DrivenMassesInSlidingAndFlightMoveAsPrescribed) {
  const std::uint64_t seed = ballast::test::random_seed(7);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  int slid = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const RandomState s = draw(random, GetParam());
    const Body body(s.scenario);
    const double mu = 0.3;
    const Eigen::Vector2d e(0.6, 0.8);
    OpenContact open;
    open_contact_prescribed(body, 0, s.q.data(), s.omega.data(), Vector3d::Zero(), carried(s, body), open);
    const ContactRelation relation{open.free_slip_rate_W_mps2, open.compliance_W};
    const bool flies =
        trial % 4 == 0 || !(relation.free[2] < 0) || !(normal_coefficient(relation, mu, e) > 0.1 / body.total_mass_kg);
    const Vector3d force_W = flies ? Vector3d(0, 0, 0) : sliding_force(relation, mu, e);
    slid += flies ? 0 : 1;
    Motion prescribed, driven;
    close_contact(body, open, force_W, prescribed);
    if (!flies) {
      // The contact stays closed.
      const double size = prescribed.acceleration_B_mps2.norm() + body.gravity_mps2;
      EXPECT_NEAR(prescribed.acceleration_B_mps2.dot(prescribed.up_B), 0, 1e-11 * size) << "trial " << trial;
    }
    std::array<double, kMaxMasses> force{};
    generalised_forces(body, s.omega.data(), s.position.data(), s.velocity.data(), s.acceleration.data(), prescribed,
                       force.data());
    open_contact_driven(body, 0, s.q.data(), s.omega.data(), Vector3d::Zero(), s.position.data(), s.velocity.data(),
                        force.data(), open);
    close_contact(body, open, force_W, driven);
    // Solutions of 6x6 systems with condition numbers up to about 1e3: 1e3 roundings.
    const double scale = prescribed.angular_acceleration_B_radps2.norm() + body.gravity_mps2 / body.radius_m;
    EXPECT_LT((driven.angular_acceleration_B_radps2 - prescribed.angular_acceleration_B_radps2).norm(), 1e-10 * scale);
    EXPECT_LT((driven.acceleration_B_mps2 - prescribed.acceleration_B_mps2).norm(), 1e-10 * scale * body.radius_m);
    if (flies) continue;
    const ContactRelation of_driven{open.free_slip_rate_W_mps2, open.compliance_W};
    if (!(normal_coefficient(of_driven, mu, e) > 0.1 / body.total_mass_kg)) continue;
    EXPECT_LT((sliding_force(of_driven, mu, e) - force_W).norm(), 1e-9 * force_W.norm());
  }
  EXPECT_GE(slid, 100);
}

// Half of the states above need a floor that pulls; the others have a moment.
TEST(RealFloor, HasNoMomentWhereItWouldPull) {
  const std::uint64_t seed = ballast::test::random_seed(6);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  int pulled = 0, pressed = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const RandomState s = draw(random, true);
    Scenario slope_only = s.scenario;
    slope_only.surface.rolling_resistance = slope_only.surface.spin_friction_m = 0;
    MotionOf<double> with, without;
    const Body body(s.scenario), free_body(slope_only);
    rolling_prescribed(body, 0, s.q.data(), s.omega.data(), carried(s, body), with);
    rolling_prescribed(free_body, 0, s.q.data(), s.omega.data(), carried(s, free_body), without);
    const bool same = with.contact_force_B_n == without.contact_force_B_n;
    EXPECT_EQ(same, !(without.normal_force_n > 0)) << "trial " << trial;
    EXPECT_EQ(with.normal_force_n > 0, without.normal_force_n > 0) << "trial " << trial;
    (without.normal_force_n > 0 ? pressed : pulled) += 1;
  }
  EXPECT_GE(pulled, 100);
  EXPECT_GE(pressed, 100);
}

// A ball that spins in place, by hand: T = s N, N = M g.
TEST(RealFloor, SpinFrictionAloneSlowsASpin) {
  Scenario s;
  s.gravity_mps2 = 10;
  s.ball = {.radius_m = 1, .mass_kg = 2, .inertia_kgm2 = {0.1, 0.1, 0.1}, .center_of_mass_B_m = {0, 0, 0}};
  s.surface.creep_radps = 1e-9;
  s.surface.spin_friction_m = 0.01;
  const double q[] = {1, 0, 0, 0}, omega[] = {0, 0, 3};
  MotionOf<double> m;
  rolling_prescribed(Body(s), 0, q, omega, {}, m);
  const auto paper =
      firmware::rolling_forces(test::ball_params(s), firmware::Quaternion(1, 0, 0, 0), Vector3d(0, 0, 3), {});
  EXPECT_NEAR(m.angular_acceleration_B_radps2[2], -2, 1e-14);
  EXPECT_NEAR(paper.angular_acceleration_B_radps2[2], -2, 1e-14);
}

// A ball that rolls towards its centre of mass, by hand: N = N_0 / (1 - n A^-1 t) has no solution where the
// resistance is so strong that each newton of N slows the ball, and so throws its centre of mass up, by more than one.
TEST(RealFloor, ResistanceThatOutweighsItsCauseIsInconsistent) {
  Scenario s;
  s.gravity_mps2 = 10;
  s.ball = {.radius_m = 1, .mass_kg = 1, .inertia_kgm2 = {0.1, 0.1, 0.1}, .center_of_mass_B_m = {0.5, 0, 0}};
  s.surface.creep_radps = 1e-9;
  // About e2: A = 0.1 + 1 + 0.25. Each rad/s^2 of -Omegadot_2 raises N by M x = 0.5, and T_2 = c_rr r N against it.
  const double bound = 1.35 / 0.5;
  const double q[] = {1, 0, 0, 0}, omega[] = {0, 1, 0};
  for (const double part : {0.999, 1.001}) {
    s.surface.rolling_resistance = part * bound;
    MotionOf<double> m;
    rolling_prescribed(Body(s), 0, q, omega, {}, m);
    const auto paper =
        firmware::rolling_forces(test::ball_params(s), firmware::Quaternion(1, 0, 0, 0), Vector3d(0, 1, 0), {});
    EXPECT_EQ(std::isnan(m.normal_force_n), part > 1);
    EXPECT_EQ(std::isnan(paper.normal_force_n), part > 1);
  }
}

// Section 5 turned round and back: the forces that a prescribed motion needs, given to driven masses, make that motion.
TEST_P(NewtonEuler, DrivenMassesUnderTheNeededForcesMoveAsPrescribed) {
  const std::uint64_t seed = ballast::test::random_seed(5);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < 1000; ++trial) {
    const RandomState s = draw(random, GetParam());
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
