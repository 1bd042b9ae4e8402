// The planner's model against the firmware's closed forms, and its derivatives against complex step.
#include "tools/tracking/rolling_model.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <chrono>
#include <complex>
#include <cstdio>
#include <random>

#include "firmware/model/rolling.h"

namespace ballast::plan {
namespace {

using Complex = std::complex<double>;
constexpr double kStep = 1e-100;
constexpr double kRounding = 1e-12;  // of quantities of order 1: some hundred operations

template <class T>
using Vector3T = Eigen::Matrix<T, 3, 1>;

template <class T>
Vector3T<T> cross_of(const Vector3T<T>& a, const Vector3T<T>& b) {  // Eigen's cross conjugates complex products
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
template <class T>
T dot_of(const Vector3T<T>& a, const Vector3T<T>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// The same quantities by Newton and Euler as physics.md section 4 writes them, with the slope and the moment of its
// "Real floors": R_B and Omegadot are unknowns of one linear system of six, in any scalar. The moment has R_B's normal
// part as a factor, so it joins the columns of R_B.
template <class T>
struct Outputs {
  Vector3T<T> omega_dot;
  T normal;
  std::array<T, 2> force, velocity;
  PerMass<T> torque;
};

template <class T>
Outputs<T> newton_euler(const Robot& robot, const std::vector<T>& v) {
  // v: q (4), Omega (3), then position, velocity, acceleration of each mass.
  const firmware::BallParams& ball = robot.ball;
  const T w = v[0], x = v[1], y = v[2], z = v[3];
  Eigen::Matrix<T, 3, 3> lambda;
  lambda << T(1) - T(2) * (y * y + z * z), T(2) * (x * y - w * z), T(2) * (x * z + w * y),  //
      T(2) * (x * y + w * z), T(1) - T(2) * (x * x + z * z), T(2) * (y * z - w * x),        //
      T(2) * (x * z - w * y), T(2) * (y * z + w * x), T(1) - T(2) * (x * x + y * y);
  const Vector3T<T> omega(v[4], v[5], v[6]), gamma = lambda.row(2).transpose();
  const Vector3T<T> force_W = ball.external_force_W_n.template cast<T>(), force = lambda.transpose() * force_W;
  Eigen::Matrix<T, 6, 6> a = Eigen::Matrix<T, 6, 6>::Zero();  // of (Omegadot, R_B)
  Eigen::Matrix<T, 6, 1> b = Eigen::Matrix<T, 6, 1>::Zero();
  const T r = ball.radius_m;
  const Vector3T<T> down_W = ball.down_W.template cast<T>();
  const Vector3T<T> against_weight = -T(ball.gravity_mps2) * (lambda.transpose() * down_W);  // -Lambda^T g_W
  struct Term {
    T mass;
    Vector3T<T> zeta, d1, c;
  };
  std::vector<Term> terms;
  Vector3T<T> chi0 = ball.center_of_mass_B_m.template cast<T>();
  terms.push_back({T(ball.shell_mass_kg), chi0, Vector3T<T>::Zero(), cross_of<T>(omega, cross_of<T>(omega, chi0))});
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const T theta = v[7 + 3 * k], rate = v[8 + 3 * k], acceleration = v[9 + 3 * k];
    const auto p = firmware::evaluate<T>(ball.rail[k], theta);
    const Vector3T<T> inner = cross_of<T>(omega, p.position) + T(2) * rate * p.d1;
    terms.push_back({T(ball.mass_kg[k]), p.position, p.d1,
                     Vector3T<T>(cross_of<T>(omega, inner) + rate * rate * p.d2 + acceleration * p.d1)});
  }
  for (int k = 0; k < 3; ++k) {
    Vector3T<T> unit = Vector3T<T>::Zero();
    unit[k] = T(1);
    const Vector3T<T> acceleration = cross_of<T>(unit, Vector3T<T>(r * gamma));
    Vector3T<T> newton = Vector3T<T>::Zero(), euler = ball.inertia_kgm2.template cast<T>().cwiseProduct(unit);
    for (const Term& t : terms) {
      const Vector3T<T> of_mass = t.mass * (acceleration + cross_of<T>(unit, t.zeta));
      newton += of_mass;
      euler += cross_of<T>(t.zeta, of_mass);
    }
    a.template block<3, 1>(0, k) = newton;
    a.template block<3, 1>(3, k) = euler;
    a.template block<3, 1>(0, 3 + k) = -unit;
    a.template block<3, 1>(3, 3 + k) = cross_of<T>(Vector3T<T>(r * gamma), unit);
  }
  if (ball.creep_radps > 0) {
    const Vector3T<T> spin = lambda * omega;
    const T creep2 = ball.creep_radps * ball.creep_radps;
    const T rolling = T(ball.rolling_resistance) * r / std::sqrt(spin[0] * spin[0] + spin[1] * spin[1] + creep2);
    const T spinning = T(ball.spin_friction_m) / std::sqrt(spin[2] * spin[2] + creep2);
    const Vector3T<T> moment =
        lambda.transpose() * Vector3T<T>(-rolling * spin[0], -rolling * spin[1], -spinning * spin[2]);
    a.template block<3, 3>(3, 3) -= moment * gamma.transpose();
  }
  Vector3T<T> newton = force;
  Vector3T<T> euler = -cross_of<T>(omega, Vector3T<T>(ball.inertia_kgm2.template cast<T>().cwiseProduct(omega)));
  for (const Term& t : terms) {
    const Vector3T<T> of_mass = t.mass * (t.c + against_weight);
    newton -= of_mass;
    euler -= cross_of<T>(t.zeta, of_mass);
  }
  b << newton, euler;
  const Eigen::Matrix<T, 6, 1> solution = a.partialPivLu().solve(b);
  Outputs<T> out;
  out.omega_dot = solution.template head<3>();
  const Vector3T<T> contact_W = lambda * solution.template tail<3>();
  out.normal = contact_W[2];
  out.force = {contact_W[0], contact_W[1]};
  const Vector3T<T> omega_W = lambda * omega;
  out.velocity = {r * omega_W[1], -r * omega_W[0]};
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Term& t = terms[k + 1];
    const Vector3T<T> lever = r * gamma + t.zeta;
    const Vector3T<T> pull = cross_of<T>(out.omega_dot, lever) + t.c + against_weight;
    out.torque[k] = t.mass * dot_of<T>(t.d1, pull) + robot.reflected_inertia[k] * v[9 + 3 * k];
  }
  return out;
}

enum class Floor { kLevel, kSlope, kResists, kBoth };
constexpr Floor kFloors[] = {Floor::kLevel, Floor::kSlope, Floor::kResists, Floor::kBoth};

struct Sample {
  Robot robot;
  RollingState state;
};

// Up to 40 degrees steep. Every third resisting floor has a creep rate far above the ball's own, and every third one
// far below it.
void change_floor(std::mt19937_64& random, Floor floor, firmware::BallParams& ball) {
  std::uniform_real_distribution<double> part(0, 1);
  if (floor == Floor::kSlope || floor == Floor::kBoth) {
    const double angle = 0.7 * part(random), downhill = 7 * part(random);
    ball.down_W = {std::sin(angle) * std::cos(downhill), std::sin(angle) * std::sin(downhill), -std::cos(angle)};
  }
  if (floor == Floor::kResists || floor == Floor::kBoth) {
    ball.rolling_resistance = 0.1 * part(random);
    ball.spin_friction_m = 0.1 * part(random);
    ball.creep_radps = std::pow(10, std::floor(3 * part(random)) * 2 - 3);
  }
}

Sample random_sample(std::mt19937_64& random, int masses, Floor floor = Floor::kLevel) {
  std::uniform_real_distribution<double> u(-1, 1);
  const auto vector = [&] { return firmware::Vector3(u(random), u(random), u(random)); };
  Sample s;
  firmware::BallParams& ball = s.robot.ball;
  ball.radius_m = 1;
  ball.gravity_mps2 = 1;
  ball.shell_mass_kg = 1 + 0.5 * u(random);
  ball.inertia_kgm2 = firmware::Vector3(0.9, 1.0, 1.1);
  ball.center_of_mass_B_m = 0.1 * vector();
  ball.external_force_W_n = 0.1 * vector();
  ball.mass_count = masses;
  for (int i = 0; i < masses; ++i) {
    const auto k = static_cast<std::size_t>(i);
    ball.mass_kg[k] = 0.6 + 0.5 * u(random);
    ball.rail[k] = i % 3 == 2 ? firmware::line(0.3 * vector(), vector())
                              : firmware::circle_about(0.8 + 0.1 * u(random), 3 * u(random), u(random));
    s.robot.reflected_inertia[k] = 0.1 + 0.05 * u(random);
    s.state.position[k] = i % 3 == 2 ? 0.3 * u(random) : 3 * u(random);
    s.state.velocity[k] = u(random);
    s.state.acceleration[k] = u(random);
  }
  Eigen::Vector4d q(u(random), u(random), u(random), u(random));
  q.normalize();
  s.state.q = {q[0], q[1], q[2], q[3]};
  s.state.omega_B = {u(random), u(random), u(random)};
  change_floor(random, floor, ball);
  return s;
}

// Where nothing presses the ball to the floor, it gives no moment.
Sample without_moment_in_flight(Sample s, const RollingValue& value) {
  if (value.normal_n <= 0) s.robot.ball.creep_radps = 0;
  return s;
}

template <class T>
std::vector<T> flat(const Sample& s) {
  std::vector<T> v{T(s.state.q[0]), T(s.state.q[1]), T(s.state.q[2]), T(s.state.q[3])};
  for (const double w : {s.state.omega_B.x, s.state.omega_B.y, s.state.omega_B.z}) v.emplace_back(w);
  for (int i = 0; i < s.robot.ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    for (const double w : {s.state.position[k], s.state.velocity[k], s.state.acceleration[k]}) v.emplace_back(w);
  }
  return v;
}

TEST(RollingModel, AgreesWithTheFirmwareAndNewtonEuler) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const Sample s = random_sample(random, static_cast<int>(seed % 9), kFloors[seed % 4]);
    RollingValue value{};
    evaluate_rolling(s.robot, s.state, value);
    const auto& q = s.state.q;
    const firmware::MassMotion masses{s.state.position, s.state.velocity, s.state.acceleration};
    const auto& w = s.state.omega_B;
    const auto forces = firmware::rolling_forces(s.robot.ball, firmware::Quaternion(q[0], q[1], q[2], q[3]),
                                                 firmware::Vector3(w.x, w.y, w.z), masses);
    EXPECT_NEAR(value.normal_n, forces.normal_force_n, kRounding);
    EXPECT_NEAR(value.force_n[0], forces.friction_force_W_n[0], kRounding);
    EXPECT_NEAR(value.force_n[1], forces.friction_force_W_n[1], kRounding);
    EXPECT_NEAR(value.omega_dot_B.x, forces.angular_acceleration_B_radps2[0], kRounding);
    EXPECT_NEAR(value.omega_dot_B.y, forces.angular_acceleration_B_radps2[1], kRounding);
    EXPECT_NEAR(value.omega_dot_B.z, forces.angular_acceleration_B_radps2[2], kRounding);
    const auto other = newton_euler<double>(without_moment_in_flight(s, value).robot, flat<double>(s));
    EXPECT_NEAR(value.normal_n, other.normal, kRounding);
    for (int i = 0; i < s.robot.ball.mass_count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      EXPECT_NEAR(value.torque[k], other.torque[k], kRounding);
    }
  }
}

TEST(RollingModel, DerivativesAreThoseByComplexStep) {
  double worst = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const Sample s = random_sample(random, static_cast<int>(seed % 9), kFloors[seed % 4]);
    RollingValue value{};
    RollingDerivative derivative{};
    differentiate_rolling(s.robot, s.state, true, value, derivative);
    const Robot judge = without_moment_in_flight(s, value).robot;
    const int n = s.robot.ball.mass_count;
    ASSERT_EQ(derivative.columns, 6 + 3 * n);
    for (int column = 0; column < derivative.columns; ++column) {
      auto v = flat<Complex>(s);
      const Complex i_h(0, kStep);
      if (column < 3) {
        // q exp(phi / 2): q (0, e_k) / 2.
        const auto& q = s.state.q;
        const double w = q[0], x = q[1], y = q[2], z = q[3];
        const double rates[3][4] = {{-x, w, z, -y}, {-y, -z, w, x}, {-z, y, -x, w}};
        for (std::size_t j = 0; j < 4; ++j) v[j] += i_h * 0.5 * rates[column][j];
      } else {
        v[static_cast<std::size_t>(column + 1)] += i_h;
      }
      const auto out = newton_euler<Complex>(judge, v);
      const auto c = static_cast<std::size_t>(column);
      const auto near = [&](double got, Complex expected) {
        // Relative to 1, since all quantities are of order 1 to 30.
        const double error = std::abs(got - expected.imag() / kStep) / std::max(1.0, std::abs(got));
        worst = std::max(worst, error);
        EXPECT_LT(error, kRounding) << "column " << column;
      };
      near(derivative.omega_dot_B[c].x, out.omega_dot[0]);
      near(derivative.omega_dot_B[c].y, out.omega_dot[1]);
      near(derivative.omega_dot_B[c].z, out.omega_dot[2]);
      near(derivative.normal_n[c], out.normal);
      for (std::size_t j = 0; j < 2; ++j) {
        near(derivative.force_n[j][c], out.force[j]);
        if (column < 6) near(derivative.velocity_mps[j][c], out.velocity[j]);
      }
      for (int i = 0; i < n; ++i)
        near(derivative.torque[static_cast<std::size_t>(i)][c], out.torque[static_cast<std::size_t>(i)]);
    }
  }
  RecordProperty("worst", std::to_string(worst));
  std::printf("worst relative error %.2g\n", worst);
}

// The bar is 12 plain evaluations. The least of several rounds is compared, since other programs share the processor.
TEST(RollingModel, JacobianCostsAtMostTwelveEvaluations) {
  std::mt19937_64 random(7);
  const Sample s = random_sample(random, 3);
  RollingValue value{};
  RollingDerivative derivative{};
  const firmware::MassMotion masses{s.state.position, s.state.velocity, s.state.acceleration};
  const auto& q = s.state.q;
  const firmware::Quaternion orientation(q[0], q[1], q[2], q[3]);
  firmware::Vector3 omega(s.state.omega_B.x, s.state.omega_B.y, s.state.omega_B.z);
  double sum = 0;
  const auto least_s = [](auto work) {
    double least = 1e9;
    for (int round = 0; round < 15; ++round) {
      const auto start = std::chrono::steady_clock::now();
      for (int k = 0; k < 3000; ++k) work();
      least = std::min(least, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / 3000);
    }
    return least;
  };
  const double plain_s = least_s([&] {
    omega[0] += 1e-9;
    sum += firmware::rolling_forces(s.robot.ball, orientation, omega, masses).normal_force_n;
  });
  RollingState moving = s.state;
  const double jacobian_s = least_s([&] {
    moving.omega_B.x += 1e-9;
    differentiate_rolling(s.robot, moving, false, value, derivative);
    sum += derivative.normal_n[3];
  });
  std::printf("plain %.3g us, Jacobian %.3g us: %.2f (sum %g)\n", 1e6 * plain_s, 1e6 * jacobian_s, jacobian_s / plain_s,
              sum);
  EXPECT_LT(jacobian_s, 12 * plain_s);
}

}  // namespace
}  // namespace ballast::plan
