// Every closed form of the paper against the plant's Newton-Euler and against physics.md section 4 written out, on
// random states; the forms that firmware/model computes in another arrangement also against the formula as printed.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <vector>

#include "firmware/model/rolling.h"
#include "sim/closed_forms/detached.h"
#include "sim/closed_forms/rolling_disk.h"
#include "sim/plant/newton_euler.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

using namespace closed_forms;

// Double rounding of some hundred operations, times the condition of the 3x3 systems, stays below it;
// each comparison names the size it is relative to.
constexpr double kRelative = 1e-12;
constexpr int kTrials = 3000;

// The judges compute in long double, so that the rounding measured is that of the forms.
using Long = long double;
using LVec = Eigen::Matrix<Long, 3, 1>;
using LMat = Eigen::Matrix<Long, 3, 3>;

LMat hat(const LVec& v) {
  LMat m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

// chi_i and its derivatives, index 0 the shell.
struct Point {
  Long mass;
  LVec chi, chi_dot, chi_ddot;
};

struct Case {
  sim::Scenario scenario;
  BallParams ball;
  Quaternion q;
  Vector3 omega;
  MassMotion motion;

  LVec force_W() const { return ball.external_force_W_n.cast<Long>(); }
  LMat lambda() const { return q.cast<Long>().toRotationMatrix(); }
  LVec up() const { return lambda().row(2).transpose(); }
  LVec force_B() const { return lambda().transpose() * force_W(); }
  LVec chi0() const { return ball.center_of_mass_B_m.cast<Long>(); }
  LMat inertia() const { return ball.inertia_kgm2.cast<Long>().asDiagonal(); }

  // eq_1d_param, from the rails.
  std::vector<Point> points() const {
    std::vector<Point> out{{ball.shell_mass_kg, chi0(), LVec::Zero(), LVec::Zero()}};
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      const auto rail = evaluate<Real>(ball.rail[i], motion.position[i]);
      const Long rate = motion.velocity[i], acceleration = motion.acceleration[i];
      const LVec d1 = rail.d1.cast<Long>(), d2 = rail.d2.cast<Long>();
      out.push_back({ball.mass_kg[i], rail.position.cast<Long>(), rate * d1, rate * rate * d2 + acceleration * d1});
    }
    return out;
  }
};

void take_from_scenario(Case& c) {
  const sim::Body body(c.scenario);
  c.ball = {body.radius_m,
            body.gravity_mps2,
            body.shell_mass_kg,
            body.inertia_kgm2,
            body.center_of_mass_B_m,
            c.scenario.external_force_W_n,
            Vector3(0, 0, -1),
            0,
            0,
            0,
            body.mass_count,
            body.mass_kg,
            body.rail};
}

Case draw(test::RandomRobot& random, int mass_count) {
  Case c{.scenario = random.scenario(mass_count), .ball = {}, .q = random.attitude(), .omega = {}, .motion = {}};
  // As strong as gravity: a form that loses it should differ as visibly as one that loses anything else.
  const double weight = c.scenario.ball.mass_kg * c.scenario.gravity_mps2;
  c.scenario.external_force_W_n = weight * random.vector(1);
  take_from_scenario(c);
  const double r = c.ball.radius_m, rate = std::sqrt(c.ball.gravity_mps2 / r);
  c.omega = rate * random.vector(3);
  for (std::size_t i = 0; i < c.scenario.masses.size(); ++i) {
    const double unit = c.ball.rail[i].shape == RailShape::kCircle ? 1 : r;
    c.motion.position[i] = unit * random.uniform(-3, 3);
    c.motion.velocity[i] = 3 * unit * rate * random.uniform(-1, 1);
    c.motion.acceleration[i] = 10 * unit * rate * rate * random.uniform(-1, 1);
  }
  return c;
}

struct DiskCase {
  Case ball;  // in the same state
  DiskState disk;
};

// A robot of the same make whose rails, centre of mass and force lie in the plane of e1 and e3.
DiskCase draw_disk(test::RandomRobot& random, int mass_count) {
  DiskCase d{draw(random, mass_count), {}};
  Case& c = d.ball;
  c.scenario.ball.center_of_mass_B_m[1] = 0;
  c.scenario.external_force_W_n[1] = 0;
  for (sim::Mass& mass : c.scenario.masses) {
    const double angle = random.uniform(-3, 3), radius = 0.2 * c.ball.radius_m;
    const Vector3 center(radius * random.uniform(-1, 1), 0, radius * random.uniform(-1, 1));
    const Vector3 along(std::cos(angle), 0, std::sin(angle)), across(-std::sin(angle), 0, std::cos(angle));
    mass.rail = mass.rail.shape == RailShape::kLine
                    ? line(center, along)
                    : circle(center, c.ball.radius_m * random.uniform(0.1, 0.75), along, across);
  }
  take_from_scenario(c);
  d.disk = {random.uniform(-7, 7), 3 * std::sqrt(c.ball.gravity_mps2 / c.ball.radius_m) * random.uniform(-1, 1)};
  c.q = Quaternion(std::cos(d.disk.angle_rad / 2), 0, -std::sin(d.disk.angle_rad / 2), 0);
  c.omega = Vector3(0, -d.disk.angular_velocity_radps, 0);
  return d;
}

// physics.md section 4: Newton, Euler and a closure, solved as they stand for (Omegadot, a, R_B).
struct Solution {
  LVec omega_dot, acceleration_W, contact_W;
};

enum class Regime { kRolling, kFlight };

Solution section_four(const Case& c, const std::vector<Point>& points, Regime regime) {
  using Matrix9 = Eigen::Matrix<Long, 9, 9>;
  using Vector9 = Eigen::Matrix<Long, 9, 1>;
  const LVec omega = c.omega.cast<Long>(), up = c.up();
  const Long r = c.ball.radius_m;
  Matrix9 left = Matrix9::Zero();
  Vector9 right = Vector9::Zero();
  const auto newton = Eigen::seqN(0, 3), euler = Eigen::seqN(3, 3), closure = Eigen::seqN(6, 3);
  const auto omega_dot = Eigen::seqN(0, 3), a = Eigen::seqN(3, 3), contact = Eigen::seqN(6, 3);

  Solution out;
  right(newton) = c.force_B();
  left(euler, omega_dot) = c.inertia();
  right(euler) = -omega.cross(LVec(c.inertia() * omega));
  for (const Point& p : points) {
    const LVec known = omega.cross(LVec(omega.cross(p.chi) + 2 * p.chi_dot)) + p.chi_ddot + c.ball.gravity_mps2 * up;
    left(newton, a) += p.mass * LMat::Identity();
    left(newton, omega_dot) -= p.mass * hat(p.chi);
    right(newton) -= p.mass * known;
    left(euler, a) += p.mass * hat(p.chi);
    left(euler, omega_dot) -= p.mass * hat(p.chi) * hat(p.chi);
    right(euler) -= p.mass * p.chi.cross(known);
  }
  left(newton, contact) = -LMat::Identity();
  left(euler, contact) = r * hat(up);
  if (regime == Regime::kRolling) {
    left(closure, a) = LMat::Identity();
    left(closure, omega_dot) = r * hat(up);
  } else {
    left(closure, contact) = LMat::Identity();
  }
  const Vector9 x = left.fullPivLu().solve(right);
  out.omega_dot = x(omega_dot);
  out.acceleration_W = c.lambda() * x(a);
  out.contact_W = c.lambda() * x(contact);
  return out;
}

sim::MotionOf<double> plant(const Case& c, const sim::Body& body, const MassMotion& motion) {
  const double q[4] = {c.q.w(), c.q.x(), c.q.y(), c.q.z()};
  sim::CarriedMasses masses;
  sim::carry_along(body, motion.position.data(), motion.velocity.data(), motion.acceleration.data(), masses);
  sim::MotionOf<double> out;
  sim::rolling_prescribed(body, 0, q, c.omega.data(), masses, out);
  return out;
}

Long off(const Vector3& form, const LVec& judge) { return (form.cast<Long>() - judge).norm() / judge.norm(); }

// N and friction are small differences of large forces now and then: relative to both together.
Long off(const RollingForces& form, const LVec& contact_W) {
  const LVec force(form.friction_force_W_n[0], form.friction_force_W_n[1], form.normal_force_n);
  return std::max((force - contact_W).norm(), std::abs(form.static_friction_n - contact_W.head<2>().norm())) /
         contact_W.norm();
}

void expect_rolls_like_the_plant(const RollingForces& form, const sim::MotionOf<double>& plant) {
  EXPECT_LT(off(form.angular_acceleration_B_radps2, plant.angular_acceleration_B_radps2.cast<Long>()), kRelative);
  EXPECT_LT(off(form, (plant.rotation_B_to_W * plant.contact_force_B_n).cast<Long>()), kRelative);
}

// eq_Om, eq_normal, eq_static_friction. The plant knows masses on rails only, so each is given the osculating circle of
// its trajectory: any chidot and chiddot are those of a motion on it.
TEST(ClosedForms, BallOnTrajectories) {
  const std::uint64_t seed = ballast::test::random_seed(31);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Case c = draw(random, random.integer(1, kMaxMasses));
    const double r = c.ball.radius_m, rate = std::sqrt(c.ball.gravity_mps2 / r);
    sim::Body body(c.scenario);
    MassTrajectories masses;
    MassMotion on_circles;
    std::vector<Point> points{{c.ball.shell_mass_kg, c.chi0(), LVec::Zero(), LVec::Zero()}};
    for (std::size_t i = 0; i < c.scenario.masses.size(); ++i) {
      const Vector3 chi = 0.9 * r * random.direction(), velocity = 2 * r * rate * random.direction();
      const Vector3 tangent = velocity.normalized(), normal = tangent.cross(random.direction()).normalized();
      const double speed = velocity.norm(), radius = r * random.uniform(0.2, 2);
      const double along = 5 * r * rate * rate * random.uniform(-1, 1);
      const Vector3 acceleration = along * tangent + speed * speed / radius * normal;
      masses.position_B_m[i] = chi;
      masses.velocity_B_mps[i] = velocity;
      masses.acceleration_B_mps2[i] = acceleration;
      points.push_back({c.ball.mass_kg[i], chi.cast<Long>(), velocity.cast<Long>(), acceleration.cast<Long>()});
      body.rail[i] = circle(chi + radius * normal, radius, -normal, tangent);
      on_circles.velocity[i] = speed / radius;
      on_circles.acceleration[i] = along / radius;
    }
    const RollingForces form = rolling_forces_3d(c.ball, c.q, c.omega, masses);
    expect_rolls_like_the_plant(form, plant(c, body, on_circles));
    const Solution judge = section_four(c, points, Regime::kRolling);
    EXPECT_LT(off(form.angular_acceleration_B_radps2, judge.omega_dot), kRelative);
    EXPECT_LT(off(form, judge.contact_W), kRelative);

    // eq_detach_dOm and eq_ddot_z_GC, for the same masses.
    const DetachedMotion detached = detached_motion_3d(c.ball, c.q, c.omega, masses);
    const Solution flight = section_four(c, points, Regime::kFlight);
    EXPECT_LT(off(detached.angular_acceleration_B_radps2, flight.omega_dot), kRelative);
    EXPECT_LT(off(detached.acceleration_W_mps2, flight.acceleration_W), kRelative);
  }
}

// eq_Om_1d, eq_normal_1d, eq_static_friction_1d, and eq_1d_param into the 3-d forms.
TEST(ClosedForms, RollingBallOnRails) {
  const std::uint64_t seed = ballast::test::random_seed(32);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Case c = draw(random, random.integer(0, kMaxMasses));
    const sim::MotionOf<double> motion = plant(c, sim::Body(c.scenario), c.motion);
    const Solution judge = section_four(c, c.points(), Regime::kRolling);
    for (const RollingForces& form : {rolling_forces(c.ball, c.q, c.omega, c.motion),
                                      rolling_forces_3d(c.ball, c.q, c.omega, along_rails(c.ball, c.motion))}) {
      expect_rolls_like_the_plant(form, motion);
      EXPECT_LT(off(form.angular_acceleration_B_radps2, judge.omega_dot), kRelative);
      EXPECT_LT(off(form, judge.contact_W), kRelative);
    }
  }
}

// eq_dot_Omega_static, eq_normal_static, eq_static_friction_static, as printed.
TEST(ClosedForms, RollingBallWithoutMasses) {
  const std::uint64_t seed = ballast::test::random_seed(33);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Case c = draw(random, 0);
    const LVec omega = c.omega.cast<Long>(), up = c.up(), chi0 = c.chi0();
    const Long m0 = c.ball.shell_mass_kg, g = c.ball.gravity_mps2, r = c.ball.radius_m;
    const LVec s0 = r * up + chi0, spin = omega.cross(LVec(omega.cross(chi0)));
    const LMat matrix = m0 * hat(s0) * hat(s0) - c.inertia();
    const LVec omega_dot = matrix.inverse() * (omega.cross(LVec(c.inertia() * omega)) + r * c.force_B().cross(up) +
                                               m0 * s0.cross(LVec(g * up + spin)));
    LVec contact_W = m0 * c.lambda() * (omega_dot.cross(s0) + spin) - c.force_W();
    contact_W[2] = m0 * (g + (omega_dot.cross(s0) + spin).dot(up)) - c.force_W()[2];

    const RollingForces form = rolling_forces(c.ball, c.q, c.omega, {});
    EXPECT_LT(off(form.angular_acceleration_B_radps2, omega_dot), kRelative);
    EXPECT_LT(off(form, contact_W), kRelative);
    expect_rolls_like_the_plant(form, plant(c, sim::Body(c.scenario), {}));
  }
}

// eq_detach_ball_1d as printed, double sums and all.
Solution printed_detach_ball_1d(const Case& c) {
  const std::vector<Point> points = c.points();
  const LVec omega = c.omega.cast<Long>();
  const auto bracket = [&](const Point& p) -> LVec {
    return omega.cross(LVec(omega.cross(p.chi) + 2 * p.chi_dot)) + p.chi_ddot;
  };
  Long mass = 0;
  for (const Point& p : points) mass += p.mass;
  LMat matrix = c.inertia();
  LVec right = LVec(c.inertia() * omega).cross(omega);
  for (std::size_t i = 0; i < points.size(); ++i) {
    LMat inner = LMat::Zero();
    LVec inner_bracket = c.force_B() / mass;
    for (std::size_t j = 0; j < points.size(); ++j) {
      const Long weight = points[j].mass / mass - (i == j ? 1 : 0);
      inner += weight * hat(points[j].chi);
      inner_bracket -= weight * bracket(points[j]);
    }
    matrix += points[i].mass * hat(points[i].chi) * inner;
    right -= points[i].mass * points[i].chi.cross(inner_bracket);
  }
  Solution out;
  out.omega_dot = matrix.inverse() * right;
  LVec sum = LVec::Zero();
  for (const Point& p : points) sum += p.mass * (out.omega_dot.cross(p.chi) + bracket(p));
  out.acceleration_W = c.force_W() / mass - c.lambda() * sum / mass;
  out.acceleration_W[2] -= c.ball.gravity_mps2;
  return out;
}

TEST(ClosedForms, DetachedBallOnRails) {
  const std::uint64_t seed = ballast::test::random_seed(34);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Case c = draw(random, random.integer(0, kMaxMasses));
    const DetachedMotion form = detached_motion(c.ball, c.q, c.omega, c.motion);
    for (const Solution& judge : {section_four(c, c.points(), Regime::kFlight), printed_detach_ball_1d(c)}) {
      EXPECT_LT(off(form.angular_acceleration_B_radps2, judge.omega_dot), kRelative);
      EXPECT_LT(off(form.acceleration_W_mps2, judge.acceleration_W), kRelative);
    }
  }
}

// eq_detach_ball_static, as printed.
TEST(ClosedForms, DetachedBallWithoutMasses) {
  const std::uint64_t seed = ballast::test::random_seed(35);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Case c = draw(random, 0);
    const LVec omega = c.omega.cast<Long>(), chi0 = c.chi0();
    const LVec omega_dot = c.inertia().inverse() * (LVec(c.inertia() * omega).cross(omega) + c.force_B().cross(chi0));
    LVec acceleration_W = c.force_W() / Long(c.ball.shell_mass_kg) -
                          c.lambda() * (omega_dot.cross(chi0) + omega.cross(LVec(omega.cross(chi0))));
    acceleration_W[2] -= c.ball.gravity_mps2;
    const DetachedMotion form = detached_motion(c.ball, c.q, c.omega, {});
    EXPECT_LT(off(form.angular_acceleration_B_radps2, omega_dot), kRelative);
    EXPECT_LT(off(form.acceleration_W_mps2, acceleration_W), kRelative);
  }
}

TEST(ClosedForms, DiskIsTheBallTurnedByMinusPhiAboutE2) {
  for (const Real phi : {-4.0, -0.3, 0.0, 0.7, 3.0}) {
    const DiskState disk{phi, 1.3};
    Matrix3 lambda;
    lambda << std::cos(phi), 0, -std::sin(phi), 0, 1, 0, std::sin(phi), 0, std::cos(phi);  // app_disk
    // Rounding of a few products below 1.
    EXPECT_LT((orientation_of(disk).toRotationMatrix() - lambda).norm(), 1e-15);
    EXPECT_LT((orientation_of(disk).conjugate() * Vector3::UnitZ() - Vector3(std::sin(phi), 0, std::cos(phi))).norm(),
              1e-15);

    // Omega = (Lambda^T dLambda/dt)^vee by a central difference: truncation h^2 phidot^3 / 6, rounding 1e-16 / h.
    const Real h = 1e-5;
    const Matrix3 ahead = orientation_of({phi + h * 1.3, 1.3}).toRotationMatrix();
    const Matrix3 behind = orientation_of({phi - h * 1.3, 1.3}).toRotationMatrix();
    const Matrix3 spin = lambda.transpose() * (ahead - behind) / (2 * h);
    EXPECT_LT((Vector3(spin(2, 1), spin(0, 2), spin(1, 0)) - angular_velocity_of(disk)).norm(), 1e-9);
  }
}

// A disk's phiddot is one number and passes through 0 while the terms it is made of do not; so it is held against the
// least of those too, gravity's on a pendulum of the ball's size.
Long disk_rate_size(const Case& c, const Solution& judge) {
  return judge.omega_dot.norm() + c.ball.gravity_mps2 / c.ball.radius_m;
}

// eq_ddphi_disk with eq_K_i, eq_normal_disk, eq_static_friction_disk.
TEST(ClosedForms, RollingDiskIsTheBallInItsPlane) {
  const std::uint64_t seed = ballast::test::random_seed(36);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const DiskCase d = draw_disk(random, random.integer(0, kMaxMasses));
    const Case& c = d.ball;
    const RollingDiskForces form = rolling_disk_forces(c.ball, d.disk, c.motion);
    const RollingForces ball = rolling_forces(c.ball, c.q, c.omega, c.motion);
    const sim::MotionOf<double> motion = plant(c, sim::Body(c.scenario), c.motion);
    const Vector3 plant_force = motion.rotation_B_to_W * motion.contact_force_B_n;
    const Solution judge = section_four(c, c.points(), Regime::kRolling);
    const double rate = kRelative * static_cast<double>(disk_rate_size(c, judge));
    const double force = kRelative * static_cast<double>(judge.contact_W.norm());

    EXPECT_NEAR(form.angular_acceleration_radps2, -ball.angular_acceleration_B_radps2[1], rate);
    EXPECT_NEAR(form.normal_force_n, ball.normal_force_n, force);
    EXPECT_NEAR(form.friction_force_W1_n, ball.friction_force_W_n[0], force);
    EXPECT_NEAR(form.angular_acceleration_radps2, -motion.angular_acceleration_B_radps2[1], rate);
    EXPECT_NEAR(form.normal_force_n, plant_force[2], force);
    EXPECT_NEAR(form.friction_force_W1_n, plant_force[0], force);
    EXPECT_EQ(form.static_friction_n, std::abs(form.friction_force_W1_n));
    // The plane is not left.
    EXPECT_NEAR(ball.friction_force_W_n[1], 0, force);
    EXPECT_NEAR(ball.angular_acceleration_B_radps2[0], 0, rate);
    EXPECT_NEAR(ball.angular_acceleration_B_radps2[2], 0, rate);
  }
}

// eq_ddphi_sdisk, eq_normal_sdisk, eq_static_friction_sdisk, and eq_detach_disk_static, as printed.
TEST(ClosedForms, DiskWithoutMasses) {
  const std::uint64_t seed = ballast::test::random_seed(37);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const DiskCase d = draw_disk(random, 0);
    const Case& c = d.ball;
    const Long m0 = c.ball.shell_mass_kg, g = c.ball.gravity_mps2, r = c.ball.radius_m, d2 = c.ball.inertia_kgm2[1];
    const Long z1 = c.chi0()[0], z3 = c.chi0()[2], f1 = c.force_W()[0], f3 = c.force_W()[2];
    const Long phi = d.disk.angle_rad, w = d.disk.angular_velocity_radps;
    const Long sn = std::sin(phi), cs = std::cos(phi);

    const Long ddphi = (m0 * (g + r * w * w) * (z3 * sn - z1 * cs) - r * f1) /
                       (d2 + m0 * ((r * sn + z1) * (r * sn + z1) + (r * cs + z3) * (r * cs + z3)));
    const Long normal = m0 * (g - (ddphi * z3 + w * w * z1) * sn + (ddphi * z1 - w * w * z3) * cs) - f3;
    const Long friction = -(m0 * (r * ddphi + (ddphi * z3 + w * w * z1) * cs + (ddphi * z1 - w * w * z3) * sn) + f1);
    const RollingDiskForces form = rolling_disk_forces(c.ball, d.disk, {});
    const Solution rolling = section_four(c, c.points(), Regime::kRolling);
    const double rate = kRelative * static_cast<double>(disk_rate_size(c, rolling));
    const double force = kRelative * static_cast<double>(rolling.contact_W.norm());
    EXPECT_NEAR(form.angular_acceleration_radps2, static_cast<double>(ddphi), rate);
    EXPECT_NEAR(form.normal_force_n, static_cast<double>(normal), force);
    EXPECT_NEAR(form.friction_force_W1_n, static_cast<double>(friction), force);

    const Long in_air = (f1 * (z1 * sn + z3 * cs) - f3 * (z1 * cs - z3 * sn)) / d2;
    const LVec acceleration_W(f1 / m0 + cs * (in_air * z3 + w * w * z1) + sn * (in_air * z1 - w * w * z3), 0,
                              f3 / m0 - g + sn * (in_air * z3 + w * w * z1) - cs * (in_air * z1 - w * w * z3));
    const DetachedDiskMotion detached = detached_disk_motion(c.ball, d.disk, {});
    EXPECT_NEAR(detached.angular_acceleration_radps2, static_cast<double>(in_air), rate);
    EXPECT_LT(off(detached.acceleration_W_mps2, acceleration_W), kRelative);
  }
}

// eq_detach_disk_1d as printed: phiddot.
Long printed_detach_disk_1d(const DiskCase& d) {
  const Case& c = d.ball;
  const std::vector<Point> points = c.points();
  const Long w = d.disk.angular_velocity_radps, phi = d.disk.angle_rad, sn = std::sin(phi), cs = std::cos(phi);
  const Long f1 = c.force_W()[0], f3 = c.force_W()[2];
  Long mass = 0;
  for (const Point& p : points) mass += p.mass;
  const auto p_of = [&](const Point& p) { return -w * w * p.chi[2] + 2 * w * p.chi_dot[0] + p.chi_ddot[2]; };
  const auto q_of = [&](const Point& p) { return -w * w * p.chi[0] - 2 * w * p.chi_dot[2] + p.chi_ddot[0]; };
  Long above = 0, below = mass * c.ball.inertia_kgm2[1];
  for (std::size_t i = 0; i < points.size(); ++i) {
    const LVec& zeta = points[i].chi;
    Long sum = f1 * (zeta[0] * sn + zeta[2] * cs) - f3 * (zeta[0] * cs - zeta[2] * sn);
    for (std::size_t j = 0; j < points.size(); ++j) {
      const Long v = zeta[0] * p_of(points[j]) - zeta[2] * q_of(points[j]);
      sum += (points[j].mass - (i == j ? mass : 0)) * v;
    }
    above += points[i].mass * sum;
    below -= points[i].mass * (points[i].mass - mass) * (zeta[0] * zeta[0] + zeta[2] * zeta[2]);
    for (std::size_t j = i + 1; j < points.size(); ++j) {
      const LVec& other = points[j].chi;
      below -= 2 * points[i].mass * points[j].mass * (zeta[0] * other[0] + zeta[2] * other[2]);
    }
  }
  return above / below;
}

TEST(ClosedForms, DetachedDiskIsTheBallInItsPlane) {
  const std::uint64_t seed = ballast::test::random_seed(38);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const DiskCase d = draw_disk(random, random.integer(0, kMaxMasses));
    const Case& c = d.ball;
    const DetachedDiskMotion form = detached_disk_motion(c.ball, d.disk, c.motion);
    const DetachedMotion ball = detached_motion(c.ball, c.q, c.omega, c.motion);
    const Solution judge = section_four(c, c.points(), Regime::kFlight);
    const double rate = kRelative * static_cast<double>(disk_rate_size(c, judge));
    EXPECT_NEAR(form.angular_acceleration_radps2, -ball.angular_acceleration_B_radps2[1], rate);
    EXPECT_NEAR(form.angular_acceleration_radps2, static_cast<double>(-judge.omega_dot[1]), rate);
    EXPECT_NEAR(form.angular_acceleration_radps2, static_cast<double>(printed_detach_disk_1d(d)), rate);
    EXPECT_LT(off(form.acceleration_W_mps2, ball.acceleration_W_mps2.cast<Long>()), kRelative);
    EXPECT_LT(off(form.acceleration_W_mps2, judge.acceleration_W), kRelative);
    EXPECT_EQ(form.acceleration_W_mps2[1], 0);
  }
}

// The columns of a derivative, as differences over five points: `value(column, step)` is the form, as a vector, with
// the state moved along a column. `unit` scales a column's step. The error of such a difference is h^4 f^(5) / 30 and
// 1e-16 f / h by rounding, with h = 2e-3 of the unit in which the form changes by about its own size: some 1e-13 each,
// times the condition of the 3x3 systems and the powers of the states' ranges.
template <class Derivative, class Vector, class Value, class Unit>
void expect_differences(const Derivative& derivative, const Vector& vector, const Value& value, const Unit& unit) {
  constexpr double kStep = 2e-3, kTolerance = 1e-8;
  const auto size = vector(value(0, 0)).norm();
  for (int k = 0; k < derivative.columns; ++k) {
    const double h = kStep * unit(k);
    const auto at = [&](double steps) { return vector(value(k, steps * h)); };
    const auto difference = ((8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * h)).eval();
    const auto column = vector(derivative.by[static_cast<std::size_t>(k)]);
    EXPECT_LT((column - difference).norm() * unit(k), kTolerance * (size + column.norm() * unit(k))) << "column " << k;
  }
}

// Moves coordinate `column` of the masses: positions, then velocities, then accelerations.
MassMotion moved(MassMotion motion, int count, int column, double step) {
  const auto i = static_cast<std::size_t>(column % count);
  PerMass<Real>* coordinates[] = {&motion.position, &motion.velocity, &motion.acceleration};
  (*coordinates[column / count])[i] += step;
  return motion;
}

// The unit of that coordinate.
double unit_of(const Case& c, int column) {
  const double r = c.ball.radius_m, rate = std::sqrt(c.ball.gravity_mps2 / r);
  const int count = c.ball.mass_count;
  const bool circle = c.ball.rail[static_cast<std::size_t>(column % count)].shape == RailShape::kCircle;
  return (circle ? 1 : r) * std::pow(rate, column / count);
}

constexpr int kDerivativeTrials = 200;

TEST(ClosedForms, DerivativeOfTheDetachedBall) {
  const std::uint64_t seed = ballast::test::random_seed(40);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kDerivativeTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Case c = draw(random, random.integer(0, kMaxMasses));
    const int n = c.ball.mass_count;
    const auto derivative = detached_motion_derivative(c.ball, c.q, c.omega, c.motion);
    ASSERT_EQ(derivative.columns, 6 + 3 * n);
    const auto value = [&](int column, double step) {
      if (column >= 6) return detached_motion(c.ball, c.q, c.omega, moved(c.motion, n, column - 6, step));
      if (column >= 3) return detached_motion(c.ball, c.q, c.omega + step * Vector3::Unit(column - 3), c.motion);
      const Quaternion turn(Eigen::AngleAxisd(step, Vector3::Unit(column)));
      return detached_motion(c.ball, c.q * turn, c.omega, c.motion);
    };
    const double rate = std::sqrt(c.ball.gravity_mps2 / c.ball.radius_m);
    const auto unit = [&](int column) { return column < 3 ? 1 : column < 6 ? rate : unit_of(c, column - 6); };
    expect_differences(
        derivative, [](const DetachedMotion& m) { return m.angular_acceleration_B_radps2; }, value, unit);
    expect_differences(
        derivative, [](const DetachedMotion& m) { return m.acceleration_W_mps2; }, value, unit);
  }
}

TEST(ClosedForms, DerivativesOfTheDisk) {
  const std::uint64_t seed = ballast::test::random_seed(41);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < kDerivativeTrials && !HasFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const DiskCase d = draw_disk(random, random.integer(0, kMaxMasses));
    const Case& c = d.ball;
    const int n = c.ball.mass_count;
    const auto evaluate = [&](const auto& form, int column, double step) {
      DiskState disk = d.disk;
      if (column == 0) disk.angle_rad += step;
      if (column == 1) disk.angular_velocity_radps += step;
      return form(c.ball, disk, column < 2 ? c.motion : moved(c.motion, n, column - 2, step));
    };
    const double rate = std::sqrt(c.ball.gravity_mps2 / c.ball.radius_m);
    const auto unit = [&](int column) { return column == 0 ? 1 : column == 1 ? rate : unit_of(c, column - 2); };

    const auto rolling = rolling_disk_forces_derivative(c.ball, d.disk, c.motion);
    ASSERT_EQ(rolling.columns, 2 + 3 * n);
    const auto roll = [&](int column, double step) { return evaluate(rolling_disk_forces, column, step); };
    expect_differences(
        rolling, [](const RollingDiskForces& f) { return Vector2(f.angular_acceleration_radps2, 0); }, roll, unit);
    expect_differences(
        rolling, [](const RollingDiskForces& f) { return Vector2(f.normal_force_n, f.friction_force_W1_n); }, roll,
        unit);
    const double sign = rolling_disk_forces(c.ball, d.disk, c.motion).friction_force_W1_n > 0 ? 1 : -1;
    for (int k = 0; k < rolling.columns; ++k) {
      const RollingDiskForces& by = rolling.by[static_cast<std::size_t>(k)];
      EXPECT_EQ(by.static_friction_n, sign * by.friction_force_W1_n);
    }

    const auto detached = detached_disk_motion_derivative(c.ball, d.disk, c.motion);
    ASSERT_EQ(detached.columns, 2 + 3 * n);
    const auto fly = [&](int column, double step) { return evaluate(detached_disk_motion, column, step); };
    expect_differences(
        detached, [](const DetachedDiskMotion& m) { return Vector2(m.angular_acceleration_radps2, 0); }, fly, unit);
    expect_differences(
        detached, [](const DetachedDiskMotion& m) { return m.acceleration_W_mps2; }, fly, unit);
  }
}

// Two equal masses opposite each other, their common centre at rest in the geometric centre: the paper's remark that
// one mass in their place gives the same dynamics would lose their moment of inertia. The pushed ball shows it in
// closed form.
TEST(ClosedForms, MassesAreNotOneMassAtTheirCentre) {
  BallParams two;
  two.radius_m = 0.5;
  two.gravity_mps2 = 10;
  two.shell_mass_kg = 2;
  two.inertia_kgm2 = Vector3::Constant(0.2);
  two.external_force_W_n = Vector3(7, 0, 0);
  two.mass_count = 2;
  two.mass_kg = {0.5, 0.5};
  two.rail[0] = two.rail[1] = line(Vector3::Zero(), Vector3::UnitX());
  BallParams one = two;
  one.mass_count = 1;
  one.mass_kg = {1};
  MassMotion apart;
  apart.position = {0.4, -0.4};
  const Real of_two =
      rolling_forces(two, Quaternion::Identity(), Vector3::Zero(), apart).angular_acceleration_B_radps2[1];
  const Real of_one = rolling_forces(one, Quaternion::Identity(), Vector3::Zero(), {}).angular_acceleration_B_radps2[1];
  // r F / (d_2 + M r^2 + sum m_i x_i^2); rounding of a few operations.
  EXPECT_NEAR(of_two, 0.5 * 7 / (0.2 + 3 * 0.25 + 2 * 0.5 * 0.16), 1e-14);
  EXPECT_NEAR(of_one, 0.5 * 7 / (0.2 + 3 * 0.25), 1e-14);
}

TEST(ClosedForms, NanInGivesNanOut) {
  test::RandomRobot random(39);
  const DiskCase d = draw_disk(random, 3);
  MassMotion motion = d.ball.motion;
  motion.acceleration[1] = std::nan("");
  const Case& c = d.ball;
  const MassTrajectories masses = along_rails(c.ball, motion);
  EXPECT_TRUE(std::isnan(rolling_forces_3d(c.ball, c.q, c.omega, masses).normal_force_n));
  EXPECT_TRUE(std::isnan(rolling_disk_forces(c.ball, d.disk, motion).normal_force_n));
  EXPECT_TRUE(detached_motion(c.ball, c.q, c.omega, motion).acceleration_W_mps2.array().isNaN().all());
  EXPECT_TRUE(std::isnan(detached_disk_motion(c.ball, d.disk, motion).angular_acceleration_radps2));
}

}  // namespace
}  // namespace ballast::firmware
