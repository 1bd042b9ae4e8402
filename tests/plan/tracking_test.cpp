// Reference and gains about a plan: the Riccati recursion by another formula, the linearised model with feedback, and
// the ball itself, rolled by the firmware's closed forms, back from a disturbance.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "firmware/model/rolling.h"
#include "tools/program/params.h"
#include "tools/tracking/reference.h"

namespace ballast::plan {
namespace {

// A desk-sized ball that rolls along a curve and rests: the shipped one, with prescribed masses.
sim::Scenario desk_ball() {
  const auto read =
      sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/desk_ball.toml", {"run.actuation=\"prescribed\""});
  EXPECT_TRUE(read.ok()) << (read.ok() ? "" : sim::to_string(read.errors.front()));
  return read.scenario;
}

std::optional<Tracking> try_track(const sim::Scenario& scenario, std::string& why,
                                  const TrackingOptions& options = {}) {
  firmware::BallParams ball;
  EXPECT_FALSE(program::to_ball_params(scenario, ball));
  return track(scenario, ball, why, options);
}

Tracking tracking_of(const sim::Scenario& scenario, double step = 0.1) {
  std::string why;
  TrackingOptions options;
  options.step = step;
  const auto tracking = try_track(scenario, why, options);
  EXPECT_TRUE(tracking) << why;
  return tracking.value_or(Tracking{});
}

// Joseph's form of the recursion, which uses the gains as they are, holds to rounding: P has entries over many decades.
TEST(Tracking, GainsSolveTheRiccatiEquation) {
  const Tracking t = tracking_of(desk_ball());
  ASSERT_FALSE(t.gain.empty());
  for (std::size_t k = 0; k < t.gain.size(); ++k) {
    const Eigen::MatrixXd closed = t.step[k].transition - t.step[k].input * t.gain[k];
    const Eigen::MatrixXd again = t.state_weight + t.gain[k].transpose() * t.input_weight * t.gain[k] +
                                  closed.transpose() * t.cost[k + 1] * closed;
    EXPECT_LT((again - t.cost[k]).norm(), 1e-10 * t.cost[k].norm()) << k;
    EXPECT_GT(t.cost[k].selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0) << k;
  }
}

// The continuous equation -P' = Q + A^T P + P A - P B R^-1 B^T P, Q and R per second: its residual falls with the step.
TEST(Tracking, RecursionApproachesTheDifferentialEquation) {
  double before = 0;
  for (const double step : {0.1, 0.05}) {
    const Tracking t = tracking_of(desk_ball(), step);
    const std::size_t k = t.gain.size() / 2;
    const Linear at = linearise(t.robot, t.reference[k].state);
    const Eigen::MatrixXd& p = t.cost[k];
    const Eigen::MatrixXd slope = (t.cost[k + 1] - t.cost[k - 1]) / (2 * t.step_s), pull = at.b.transpose() * p;
    const Eigen::MatrixXd taken = pull.transpose() * (t.input_weight / t.step_s).ldlt().solve(pull);
    const Eigen::MatrixXd left = slope + t.state_weight / t.step_s + at.a.transpose() * p + p * at.a - taken;
    const double residual = left.norm() / taken.norm();
    EXPECT_LT(residual, 0.2);
    if (before > 0) {
      EXPECT_LT(residual, 0.7 * before);  // first order: half
    }
    before = residual;
  }
}

// Two half steps are one whole, to rounding.
TEST(Tracking, StepsAreThoseOfTheModel) {
  const Tracking t = tracking_of(desk_ball());
  const std::size_t k = t.step.size() / 3;
  const Step half = discretise(linearise(t.robot, t.reference[k].state), t.step_s / 2);
  const Step whole = discretise(linearise(t.robot, t.reference[k].state), t.step_s);
  const Eigen::MatrixXd twice = half.transition * half.transition;
  EXPECT_LT((twice - whole.transition).norm(), 1e-12 * whole.transition.norm());
  EXPECT_LT((half.transition * half.input + half.input - whole.input).norm(), 1e-12 * whole.input.norm());
}

TEST(Tracking, LinearisedModelConverges) {
  const Tracking t = tracking_of(desk_ball());
  const int size = 2 * t.masses() + 8;
  std::mt19937 random(1);
  std::normal_distribution<double> draw;
  for (int run = 0; run < 20; ++run) {
    Eigen::VectorXd e(size);
    for (int c = 0; c < size; ++c) e[c] = 0.01 * draw(random);
    Eigen::VectorXd open = e;
    const double place_before = e.tail(2).norm();
    double cost = e.dot(t.cost[0] * e);
    for (std::size_t k = 0; k < t.gain.size(); ++k) {
      e = (t.step[k].transition - t.step[k].input * t.gain[k]) * e;
      open = t.step[k].transition * open;
      const double now = e.dot(t.cost[k + 1] * e);
      EXPECT_LE(now, cost * (1 + 1e-9)) << "run " << run << ", step " << k;
      cost = now;
    }
    EXPECT_LT(e.tail(2).norm(), 0.1 * std::max(place_before, open.tail(2).norm())) << "run " << run;
  }
}

struct Ball {
  Eigen::Vector4d q;
  Eigen::Vector3d omega;
  Eigen::Vector2d place;
};

Ball rate_of(const firmware::BallParams& params, const Ball& at, const firmware::MassMotion& masses) {
  const Eigen::Quaterniond q(at.q[0], at.q[1], at.q[2], at.q[3]), w(0, at.omega[0], at.omega[1], at.omega[2]);
  const Eigen::Quaterniond turn = q * w;
  const Eigen::Vector3d spin = q * at.omega;
  Ball rate;
  rate.q = 0.5 * Eigen::Vector4d(turn.w(), turn.x(), turn.y(), turn.z());
  rate.omega = firmware::rolling_forces(params, q, at.omega, masses).angular_acceleration_B_radps2;
  rate.place = params.radius_m * Eigen::Vector2d(spin[1], -spin[0]);  // omega x r e3
  return rate;
}

Ball moved(const Ball& at, const Ball& rate, double dt) {
  Ball out{at.q + dt * rate.q, at.omega + dt * rate.omega, at.place + dt * rate.place};
  out.q.normalize();
  return out;
}

// Rolls the ball under the plan's accelerations less K e, from a disturbed start. Returns the last error.
Eigen::VectorXd roll(const Tracking& t, const firmware::BallParams& params, const GainTable* table, double size) {
  const int n = t.masses();
  ReferencePoint now = t.reference.front();
  const Eigen::Quaterniond start(now.state.q[0], now.state.q[1], now.state.q[2], now.state.q[3]);
  const Eigen::Quaterniond q = start * Eigen::AngleAxisd(size, Eigen::Vector3d(1, 2, 0).normalized());
  Ball ball{{q.w(), q.x(), q.y(), q.z()}, {0.5 * size, -size, 0}, {0.02 * size, 0.03 * size}};
  for (std::size_t k = 0; k < t.step.size(); ++k) {
    for (std::size_t c = 0; c < 4; ++c) now.state.q[c] = ball.q[static_cast<int>(c)];
    now.state.omega_B = {ball.omega[0], ball.omega[1], ball.omega[2]};
    now.place_m = {ball.place[0], ball.place[1]};
    const Eigen::VectorXd e = tracking_error(t.reference[k], now, n);
    Eigen::VectorXd u = Eigen::VectorXd::Zero(n);
    if (table != nullptr) u = table->gain_at(static_cast<double>(k) * t.step_s) * e;
    constexpr int kParts = 4;
    const double h = t.step_s / kParts;
    for (int part = 0; part < kParts; ++part) {
      const auto masses = [&](double time_s) {
        firmware::MassMotion m;
        for (int i = 0; i < n; ++i) {
          const auto j = static_cast<std::size_t>(i);
          const double along = (part * h + time_s) / t.step_s;
          const double planned =
              (1 - along) * t.reference[k].state.acceleration[j] + along * t.reference[k + 1].state.acceleration[j];
          m.acceleration[j] = planned - u[i];
          m.velocity[j] = now.state.velocity[j] + time_s * m.acceleration[j];
          m.position[j] =
              now.state.position[j] + time_s * now.state.velocity[j] + time_s * time_s / 2 * m.acceleration[j];
        }
        return m;
      };
      const Ball k1 = rate_of(params, ball, masses(0)), k2 = rate_of(params, moved(ball, k1, h / 2), masses(h / 2)),
                 k3 = rate_of(params, moved(ball, k2, h / 2), masses(h / 2)),
                 k4 = rate_of(params, moved(ball, k3, h), masses(h));
      const Ball mean{(k1.q + 2 * k2.q + 2 * k3.q + k4.q) / 6, (k1.omega + 2 * k2.omega + 2 * k3.omega + k4.omega) / 6,
                      (k1.place + 2 * k2.place + 2 * k3.place + k4.place) / 6};
      ball = moved(ball, mean, h);
      const firmware::MassMotion end = masses(h);
      for (std::size_t j = 0; j < static_cast<std::size_t>(n); ++j) {
        now.state.position[j] = end.position[j];
        now.state.velocity[j] = end.velocity[j];
      }
    }
  }
  for (std::size_t c = 0; c < 4; ++c) now.state.q[c] = ball.q[static_cast<int>(c)];
  now.state.omega_B = {ball.omega[0], ball.omega[1], ball.omega[2]};
  now.place_m = {ball.place[0], ball.place[1]};
  return tracking_error(t.reference.back(), now, n);
}

// 3 degrees and masses 5 % off, as CONTROL asks of tracking: with the gains as they travel, floats at few times.
TEST(Tracking, BallReturnsFromADisturbance) {
  const Tracking t = tracking_of(desk_ball());
  const GainTable table = gain_table(t);
  firmware::BallParams off = t.robot.ball;
  for (int i = 0; i < off.mass_count; ++i) off.mass_kg[static_cast<std::size_t>(i)] *= i % 2 == 0 ? 1.05 : 0.95;
  for (const firmware::BallParams& params : {t.robot.ball, off}) {
    const Eigen::VectorXd open = roll(t, params, nullptr, 0.05), held = roll(t, params, &table, 0.05);
    EXPECT_LT(held.tail(2).norm(), 0.004);  // m, of a path of 0.8 m
    EXPECT_LT(held.tail(2).norm(), 0.3 * open.tail(2).norm());
    EXPECT_TRUE(held.allFinite());
  }
}

// The same on a floor that slopes and resists: the moment has its slope over errors that matter, so the gains still
// hold a ball that has come to a standstill, where the exact slope is 100 times as steep.
TEST(Tracking, BallReturnsOnARealFloor) {
  sim::Scenario real = desk_ball();
  real.surface.slope_rad = 0.02;
  real.surface.rolling_resistance = 0.02;
  const Tracking t = tracking_of(real);
  const GainTable table = gain_table(t);
  const Eigen::VectorXd open = roll(t, t.robot.ball, nullptr, 0.05), held = roll(t, t.robot.ball, &table, 0.05);
  EXPECT_LT(held.tail(2).norm(), 0.3 * open.tail(2).norm());
  EXPECT_TRUE(held.allFinite());
}

TEST(Tracking, TableFitsAndIsCloseToTheGains) {
  const Tracking t = tracking_of(desk_ball());
  const GainTable table = gain_table(t);
  EXPECT_LE(table.bytes(), kMostGainBytes);
  EXPECT_EQ(table.bytes(), static_cast<std::size_t>(table.samples) * (9 + 3 * 14) * 4);
  for (std::size_t k = 0; k < t.gain.size(); ++k) {
    const double time_s = static_cast<double>(k) * t.step_s;
    if (time_s > 0.9 * t.step_s * static_cast<double>(t.gain.size())) break;  // gains change fast towards the end
    EXPECT_LT((table.gain_at(time_s) - t.gain[k]).norm(), 0.05 * t.gain[k].norm()) << k;
  }
  const std::string csv = gain_csv(table);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), table.samples + 1);
}

TEST(Tracking, RefusesWhatItCannotFollow) {
  std::string why;
  sim::Scenario still = desk_ball();
  for (sim::Mass& mass : still.masses) mass.motion.clear();
  EXPECT_FALSE(try_track(still, why));
  EXPECT_NE(why.find("ballast plan"), std::string::npos) << why;
  sim::Scenario endless = desk_ball();
  endless.duration_s = 1e6;
  EXPECT_FALSE(try_track(endless, why));
  EXPECT_NE(why.find("duration"), std::string::npos) << why;
}

}  // namespace
}  // namespace ballast::plan
