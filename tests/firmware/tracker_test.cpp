// Reference, error and feedback of the tracker against closed forms and against Eigen's own algebra.
#include "firmware/tracking/tracker.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

constexpr double kRadius = 0.15;

// A ball that rolls with a constant Omega in the body: attitude and place have closed forms.
struct Rolling {
  Eigen::Quaterniond start;
  Eigen::Vector3d omega_B;
  [[nodiscard]] Eigen::Quaterniond attitude(double t) const {
    return start * Eigen::Quaterniond(Eigen::AngleAxisd(omega_B.norm() * t, omega_B.normalized()));
  }
  // Omega is constant in space too: a constant velocity.
  [[nodiscard]] Eigen::Vector2d place(double t) const {
    const Eigen::Vector3d w = start * omega_B;
    return t * kRadius * Eigen::Vector2d(w[1], -w[0]);
  }
};

void set_row(ReferenceTable& table, int masses, int k, const Eigen::Quaterniond& q, const Eigen::Vector3d& w,
             const Eigen::Vector2d& place) {
  float* row = table.values.data() + static_cast<std::ptrdiff_t>(k) * reference_row(masses);
  const double state[] = {q.w(), q.x(), q.y(), q.z(), w[0], w[1], w[2], place[0], place[1]};
  for (int c = 0; c < kReferenceStateFloats; ++c) row[c] = static_cast<float>(state[c]);
}

TEST(Tracker, ReferenceBetweenRowsIsThatOfASteadyTurn) {
  const Rolling ball{Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1, -2, 0.5}};
  const auto table = std::make_unique<ReferenceTable>();
  table->samples = 11;
  table->period_s = 0.1;
  for (int k = 0; k < table->samples; ++k) {
    set_row(*table, 2, k, ball.attitude(0.1 * k), ball.omega_B, ball.place(0.1 * k));
  }
  for (double t = 0; t <= 1; t += 0.0137) {
    const BallState at = reference_at(*table, 2, kRadius, t);
    // Rounded to floats: 6e-8. The cubic of a turn by 0.23 rad is off by 0.115^4 / 384 = 5e-7.
    EXPECT_LT(at.orientation.angularDistance(ball.attitude(t)), 3e-6) << t;
    EXPECT_LT((at.position_W_m - ball.place(t)).norm(), 1e-7) << t;
    EXPECT_LT((at.angular_velocity_B_radps - ball.omega_B).norm(), 1e-6) << t;
  }
  // Before and after the table: its ends.
  EXPECT_LT((reference_at(*table, 2, kRadius, -1).position_W_m - ball.place(0)).norm(), 1e-7);
  EXPECT_LT((reference_at(*table, 2, kRadius, 9).position_W_m - ball.place(1)).norm(), 1e-7);
  EXPECT_TRUE(tracks_at(*table, 1));
  EXPECT_FALSE(tracks_at(*table, 1.001));
  table->holds = true;
  EXPECT_TRUE(tracks_at(*table, 1.001));
}

TEST(Tracker, FeedbackIsTheProductWithTheError) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  std::normal_distribution<double> draw;
  const auto vector = [&](int size) {
    Eigen::VectorXd v(size);
    for (int j = 0; j < size; ++j) v[j] = draw(random);
    return v;
  };
  for (int n = 1; n <= kMaxMasses; ++n) {
    const auto table = std::make_unique<ReferenceTable>();
    table->samples = 3;
    table->period_s = 0.25;
    const int size = error_size(n);
    std::vector<Eigen::MatrixXd> gain;
    const Eigen::Vector2d place = vector(2);
    for (int k = 0; k < 3; ++k) {
      set_row(*table, n, k, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(), place);
      gain.emplace_back(n, size);
      for (int i = 0; i < n; ++i) {
        for (int c = 0; c < size; ++c) {
          const auto value = static_cast<float>(draw(random));
          gain.back()(i, c) = static_cast<double>(value);
          table->values[static_cast<std::size_t>(k * reference_row(n) + kReferenceStateFloats + i * size + c)] = value;
        }
      }
    }
    const double angle = 0.02;
    const Eigen::Vector3d axis = Eigen::Vector3d(vector(3)).normalized();
    BallState ball;
    ball.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis));
    ball.angular_velocity_B_radps = vector(3);
    ball.position_W_m = place + 0.03 * kRadius * Eigen::Vector2d(vector(2).normalized());
    MassError masses;
    Eigen::VectorXd e(size);
    for (int i = 0; i < n; ++i) {
      masses.position[static_cast<std::size_t>(i)] = e[i] = draw(random);
      masses.velocity[static_cast<std::size_t>(i)] = e[n + i] = draw(random);
    }
    const Vector2 integral = vector(2);
    const Eigen::Index of_ball = Eigen::Index{2} * n;
    e.segment<3>(of_ball) = angle * axis;
    e.segment<3>(of_ball + 3) = ball.angular_velocity_B_radps;
    e.segment<2>(of_ball + 6) = ball.position_W_m - place.cast<float>().cast<double>();
    e.tail<2>() = integral;
    const double time_s = 0.3;
    const ErrorVector ours = tracking_error(*table, n, kRadius, time_s, 1, ball, masses, integral);
    for (int c = 0; c < size; ++c) {
      // 2 sin(angle / 2) is short by angle^3 / 24 = 3.3e-7.
      EXPECT_NEAR(ours[static_cast<std::size_t>(c)], e[c], c / 3 == 2 * n / 3 ? 1e-6 : 4e-7) << c;
    }
    EXPECT_EQ(place_error(ours, n)[0], ours[static_cast<std::size_t>(2 * n + 6)]);
    const Eigen::VectorXd expected = (0.8 * gain[1] + 0.2 * gain[2]) * e;
    const PerMass<Real> correction = feedback(*table, n, time_s, ours);
    for (int i = 0; i < n; ++i) EXPECT_NEAR(correction[static_cast<std::size_t>(i)], expected[i], 1e-5);
  }
}

// The other sign of the same attitude is the same attitude.
TEST(Tracker, ErrorIsThatOfTheShorterTurn) {
  const auto table = std::make_unique<ReferenceTable>();
  table->samples = 2;
  table->period_s = 1;
  for (int k = 0; k < 2; ++k) {
    set_row(*table, 1, k, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(), Eigen::Vector2d::Zero());
  }
  BallState ball;
  ball.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()));
  const ErrorVector e = tracking_error(*table, 1, kRadius, 0, 1, ball, {}, Vector2::Zero());
  ball.orientation.coeffs() *= -1;
  EXPECT_EQ(tracking_error(*table, 1, kRadius, 0, 1, ball, {}, Vector2::Zero()), e);
  EXPECT_NEAR(e[2], 0.1, 1e-4);
}

TEST(Tracker, PlaceFarOffCountsAsATenthOfARadius) {
  const auto table = std::make_unique<ReferenceTable>();
  table->samples = 2;
  table->period_s = 1;
  for (int k = 0; k < 2; ++k) {
    set_row(*table, 1, k, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(), Eigen::Vector2d::Zero());
  }
  BallState ball;
  for (const double radii : {0.0, 0.09, 0.11, 50.0}) {
    ball.position_W_m = radii * kRadius * Eigen::Vector2d(0.6, -0.8);
    const Vector2 off = place_error(tracking_error(*table, 1, kRadius, 0, 1, ball, {}, Vector2::Zero()), 1);
    const Eigen::Vector2d expected = std::min(radii, 0.1) * kRadius * Eigen::Vector2d(0.6, -0.8);
    EXPECT_LT((off - expected).norm(), 1e-15) << radii;
  }
}

// A ball that has turned about the vertical at the place where its reference holds is where it should be.
TEST(Tracker, AHeldRowHoldsWhateverTheTurnAboutTheVertical) {
  const auto table = std::make_unique<ReferenceTable>();
  table->samples = 2;
  table->period_s = 1;
  const Eigen::Quaterniond planned = Eigen::Quaterniond(0.9, 0.3, -0.2, 0.1).normalized();
  const Eigen::Vector2d place(0.4, -0.2), off(0.003, -0.005), integral(0.01, 0.02);
  // The table's end has what its plan has left of speed.
  for (int k = 0; k < 2; ++k) set_row(*table, 1, k, planned, Eigen::Vector3d(0.01, 0.02, 0.03), place);
  const Eigen::Vector3d tilt(0.02, -0.01, 0);
  const auto ball_turned = [&](double yaw_rad) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
    BallState ball;
    ball.orientation = turn * Eigen::Quaterniond(Eigen::AngleAxisd(tilt.norm(), tilt.normalized())) * planned;
    ball.angular_velocity_B_radps = ball.orientation.conjugate() * (turn * Eigen::Vector3d(0.1, -0.2, 5 * yaw_rad));
    ball.position_W_m = place + turn.toRotationMatrix().topLeftCorner<2, 2>() * off;
    return ball;
  };
  const auto error = [&](double yaw_rad, Wide time_s) {
    const Vector2 sum = Eigen::Rotation2Dd(yaw_rad) * integral;
    return tracking_error(*table, 1, kRadius, time_s, 1, ball_turned(yaw_rad), {}, sum);
  };
  table->holds = true;
  const ErrorVector straight = error(0, 1);
  EXPECT_GT(std::fabs(straight[2]), 0.001);
  for (const double yaw_rad : {0.5, -2.0, 3.1, 40.0}) {
    const ErrorVector turned = error(yaw_rad, 3);
    for (std::size_t c = 0; c < 12; ++c) EXPECT_NEAR(turned[c], straight[c], 1e-7) << yaw_rad << ", component " << c;
  }
  // Before the end, or where nothing is held, the turn is an error.
  EXPECT_GT(std::fabs(error(0.5, 0.99)[4] - straight[4]), 0.1);
  table->holds = false;
  EXPECT_GT(std::fabs(error(0.5, 1)[4] - straight[4]), 0.1);
}

// A ball that rolls round a circle: the trapezoidal rule is off by the second order of the step.
TEST(Tracker, ReckonsThePlaceOfARollingBall) {
  const double turn = 2, speed = 3;  // rad/s: about the vertical, and of the rolling about a level axis
  const auto miss = [&](double period_s) {
    DeadReckoning reckoning;
    double t = 0;
    const auto state = [&] {
      BallState ball;
      ball.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(turn * t, Eigen::Vector3d::UnitZ()));
      ball.angular_velocity_B_radps = Eigen::Vector3d(0, speed, turn);  // the level axis turns with the body
      return ball;
    };
    begin_reckoning(Vector2(1, 2), state(), kRadius, reckoning);
    while (t < 1 - period_s / 2) {
      t += period_s;
      advance_reckoning(state(), kRadius, period_s, reckoning);
    }
    const double v = kRadius * speed;
    const Eigen::Vector2d exact(1 + v / turn * std::sin(turn), 2 + v / turn * (1 - std::cos(turn)));
    return (reckoning.position_W_m - exact).norm();
  };
  EXPECT_LT(miss(0.001), 2e-7);  // period^2 turn^2 / 12 of the way of 0.45 m
  EXPECT_NEAR(miss(0.01) / miss(0.005), 4, 0.05);
}

}  // namespace
}  // namespace ballast::firmware
