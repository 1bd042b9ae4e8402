// Sliding with masses that accelerate, against CVODE on the law of sliding written down another way: about the centre
// of mass of the whole, where the plant has its sums about the geometric centre (regimes_test.cpp: about that too, with
// masses at constant rail velocity, by Runge and Kutta).
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

#include "sim/closed_forms/trajectories.h"
#include "sim/plant/contact.h"
#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"
#include "tests/physics/prescribed_run.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d hat(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

struct SlidingMotion {
  Vector3d angular_acceleration_B, acceleration_W;
  double normal_force;
};

// With X the centre of mass in the body, d_i = chi_i - X and R_B = N p, p = Gamma - mu_k e_B:
//   H Omegadot = -Omega x I Omega - sum m_i d_i x c_i - (r Gamma + X) x R_B - X x F_B,   H = I - sum m_i d_i^ d_i^
//   xddot = (R + F) / M + g_W,   zddot = xddot - Lambda (Omegadot x X + sum m_i c_i / M)
// with c_i = Omega x (Omega x chi_i + 2 chidot_i) + chiddot_i, and a floor that resists adds its moment to the first.
// Omegadot and zddot are affine in N, and zddot_3 = 0.
SlidingMotion sliding_motion(const firmware::BallParams& ball, double kinetic_friction, const Eigen::Quaterniond& q,
                             const Vector3d& w, const Vector3d& velocity_W, const firmware::MassMotion& masses) {
  const auto on_rails = closed_forms::along_rails(ball, masses);
  const double r = ball.radius_m;
  double mass = ball.shell_mass_kg;
  Vector3d center = mass * ball.center_of_mass_B_m;
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    mass += ball.mass_kg[i];
    center += ball.mass_kg[i] * on_rails.position_B_m[i];
  }
  center /= mass;
  const Vector3d up = q.conjugate() * Vector3d::UnitZ(), force = q.conjugate() * ball.external_force_W_n;
  Matrix3d inertia = ball.inertia_kgm2.asDiagonal();
  Vector3d torque = -w.cross(ball.inertia_kgm2.cwiseProduct(w)) - center.cross(force), mean_c = Vector3d::Zero();
  const auto add = [&](double m, const Vector3d& chi, const Vector3d& c) {
    inertia -= m * hat(chi - center) * hat(chi - center);
    torque -= m * (chi - center).cross(c);
    mean_c += m / mass * c;
  };
  add(ball.shell_mass_kg, ball.center_of_mass_B_m, w.cross(w.cross(ball.center_of_mass_B_m)));
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    const Vector3d& chi = on_rails.position_B_m[i];
    add(ball.mass_kg[i], chi, w.cross(w.cross(chi) + 2 * on_rails.velocity_B_mps[i]) + on_rails.acceleration_B_mps2[i]);
  }
  const Vector3d slip_W = velocity_W - (q * w).cross(Vector3d(0, 0, r));
  const Vector3d e_W = Vector3d(slip_W[0], slip_W[1], 0).normalized();
  const Vector3d pushed = up - kinetic_friction * (q.conjugate() * e_W);
  const Eigen::FullPivLU<Matrix3d> solve(inertia);
  const Vector3d spin_free = solve.solve(torque);
  const Vector3d omega_W = q * w, level(omega_W[0], omega_W[1], 0);
  Vector3d moment_W = Vector3d::Zero();  // T_W / N
  if (ball.creep_radps > 0) {
    moment_W = -ball.rolling_resistance * r * level / std::hypot(level.norm(), ball.creep_radps) -
               Vector3d(0, 0, ball.spin_friction_m * omega_W[2] / std::hypot(omega_W[2], ball.creep_radps));
  }
  const Vector3d spin_of_n = solve.solve(q.conjugate() * moment_W - (r * up + center).cross(pushed));
  const Vector3d free = ball.gravity_mps2 * ball.down_W + q * Vector3d(force / mass - spin_free.cross(center) - mean_c);
  const Vector3d of_n = q * Vector3d(pushed / mass - spin_of_n.cross(center));
  const double normal = -free[2] / of_n[2];
  return {spin_free + normal * spin_of_n, free + normal * of_n, normal};
}

// 1e-10 of the ball's own lengths and speeds over a slide of a radius or so: integrators good to 1e-13 and 1e-14 per
// step, and no growth of errors to speak of in that time.
TEST(SlidingLaw, BallsWithAcceleratingMassesAgreeWithCvode) {
  const std::uint64_t seed = ballast::test::random_seed(71);
  int compared = 0;
  double worst = 0;
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(trial % (kMaxMasses + 1));
    const double r = s.ball.radius_m, speed = std::sqrt(s.gravity_mps2 * r);
    const double kinetic = random.uniform(0.05, 0.4);
    s.run.on_violation = OnViolation::kContinue;
    s.surface = {.static_friction = 1.2 * kinetic, .kinetic_friction = kinetic, .restitution = 0};
    if (trial % 2 == 1) random.make_floor_real(s);
    s.initial.angular_velocity_B_radps = speed / r * random.vector(1);
    s.initial.has_velocity = true;
    s.initial.velocity_W_mps = 2 * speed * Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), 0);
    s.duration_s = 0.6 * r / speed;
    Plant plant(s);
    plant.advance(s.duration_s, {});
    if (plant.regimes().size() != 1 || plant.end() != PhysicsEnd::kNone) continue;
    ++compared;

    const firmware::BallParams ball = test::ball_params(s);
    const auto& q0 = s.initial.orientation;
    const auto& w0 = s.initial.angular_velocity_B_radps;
    const auto& v0 = s.initial.velocity_W_mps;
    const auto at = [&](const firmware::MassMotion& masses, const double* y) {
      return sliding_motion(ball, kinetic, test::attitude(y), Vector3d(y[4], y[5], y[6]), Vector3d(y[9], y[10], y[11]),
                            masses);
    };
    test::PrescribedRun reference(s,
                                  {q0.w(), q0.x(), q0.y(), q0.z(), w0[0], w0[1], w0[2], s.initial.position_W_m[0],
                                   s.initial.position_W_m[1], v0[0], v0[1], 0},
                                  [&](double, const firmware::MassMotion& masses, const double* y, double* d) {
                                    const SlidingMotion motion = at(masses, y);
                                    test::attitude_rate(y, Vector3d(y[4], y[5], y[6]), d);
                                    for (int j = 0; j < 3; ++j) {
                                      d[4 + j] = motion.angular_acceleration_B[j];
                                      d[9 + j] = motion.acceleration_W[j];
                                    }
                                    d[7] = y[9], d[8] = y[10];
                                  });
    ASSERT_TRUE(reference.advance(s.duration_s));
    const double* y = reference.y();
    const auto p = plant.sample();
    const Eigen::Quaterniond q = test::attitude(y);
    const Eigen::Vector4d orientation(q.w(), q.x(), q.y(), q.z());
    const double error = std::max({(p.orientation - orientation).norm(),
                                   (p.angular_velocity_B_radps - Vector3d(y[4], y[5], y[6])).norm() * r / speed,
                                   (p.velocity_W_mps - Vector3d(y[9], y[10], y[11])).norm() / speed,
                                   (p.position_W_m - Vector3d(y[7], y[8], 0)).norm() / r});
    EXPECT_LT(error, 1e-10);
    worst = std::max(worst, error);
    const double weight = s.ball.mass_kg * s.gravity_mps2;
    EXPECT_NEAR(p.normal_force_n, at(reference.masses(), y).normal_force, 1e-9 * weight);
  }
  EXPECT_GE(compared, 15);
  RecordProperty("compared", compared);
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

// Contacts whose compliance couples the directions, so that the slip does not begin where friction failed to hold. The
// direction is bisected down to rounding, some 1e-16 rad; the slip is made of a few products of numbers of order 1.
TEST(SlipDirection, IsThatOfTheSlipItCauses) {
  std::mt19937_64 rng(ballast::test::random_seed(73));
  std::normal_distribution<double> normal;
  int found = 0;
  for (int i = 0; i < 200; ++i) {
    ContactRelation contact;
    const Matrix3d root = Matrix3d::NullaryExpr([&] { return normal(rng) / 3; }) + Matrix3d::Identity();
    contact.compliance = root * root.transpose();
    contact.free = Vector3d(normal(rng), normal(rng), -1);
    const auto e = slip_direction(contact, 0.2, contact.free.head<2>().normalized(), 1e-12);
    if (!e) continue;
    ++found;
    const Eigen::Vector2d y = (contact.free + contact.compliance * sliding_force(contact, 0.2, *e)).head<2>();
    EXPECT_GE(e->dot(y), 0) << i;
    EXPECT_NEAR(e->x() * y.y() - e->y() * y.x(), 0, 1e-12 * contact.compliance.norm()) << i;
  }
  EXPECT_GT(found, 100);
}

// Slides that are over within one step of the integrator or one tick, in a direction that turns as they die: a
// Chaplygin ball set down with a slip of v0. Wherever the ticks are, they end at the same instant, and L + r e3 x M v
// stays (conserved_test.cpp). It is the end of the slip that is hard: where it is missed by dt, friction goes wrong by
// mu M g dt, so momenta to 1e-12 of M r sqrt(g r) are times to some 1e-12 sqrt(r / g). Looking for it costs a few more
// steps.
TEST(ShortSlide, EndsWhereTheSlipDoesWhateverTheTicks) {
  const std::uint64_t seed = ballast::test::random_seed(72);
  for (int trial = 0; trial < 6; ++trial) {
    for (const double v0 : {1e-7, 1e-5, 1e-3, 1e-1}) {
      test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
      Scenario s = random.scenario(0);
      s.gravity_mps2 = 10;
      s.run.on_violation = OnViolation::kContinue;
      s.ball = {.radius_m = 0.1, .mass_kg = 1, .inertia_kgm2 = {0.002, 0.003, 0.004}, .center_of_mass_B_m = {0, 0, 0}};
      s.external_force_W_n.setZero();
      s.surface = {.static_friction = 0.2, .kinetic_friction = 0.15, .restitution = 0};
      s.initial.angular_velocity_B_radps = random.vector(6);
      const Vector3d rolling_W =
          (s.initial.orientation * s.initial.angular_velocity_B_radps).cross(Vector3d(0, 0, s.ball.radius_m));
      const double angle = random.uniform(0, 6);
      s.initial.has_velocity = true;
      s.initial.velocity_W_mps = rolling_W + v0 * Vector3d(std::cos(angle), std::sin(angle), 0);
      double ended_s = -1;
      for (const double tick_s : {0.001, 0.05, 0.3}) {
        SCOPED_TRACE(::testing::Message()
                     << "seed " << seed << " trial " << trial << " v0 " << v0 << " tick " << tick_s);
        s.run.control_period_s = tick_s;
        Plant plant(s);
        const auto momentum = [&] {
          const test::Whole w = test::whole(s, plant.sample());
          return Vector3d(w.angular_momentum_W + Vector3d(0, 0, s.ball.radius_m).cross(w.mass_kg * w.velocity_W_mps));
        };
        const Vector3d before = momentum();
        for (int k = 1; plant.time_s() < 0.3; ++k) plant.advance(std::min(k * tick_s, 0.3), {});
        ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
        EXPECT_LT((momentum() - before).norm(), 1e-11 * 0.1);
        ASSERT_EQ(plant.regimes().size(), 2u);
        if (ended_s > 0) {
          EXPECT_NEAR(plant.regimes()[1].time_s, ended_s, 1e-11);
        }
        ended_s = plant.regimes()[1].time_s;
      }
    }
  }
}

}  // namespace
}  // namespace ballast::sim
