// The covariance's arithmetic against dense matrices.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "firmware/estimation/error_covariance.h"
#include "firmware/estimation/history.h"
#include "tests/random_seed.h"

namespace ballast::firmware::estimation {
namespace {

constexpr int kX = static_cast<int>(kErrors), kC = static_cast<int>(kConsidered), kAll = kX + kC;
using Dense = Eigen::Matrix<double, kAll, kAll>;

Dense dense(const Covariance& covariance) {
  Dense all = Dense::Zero();
  for (int i = 0; i < kX; ++i) {
    const auto k = static_cast<std::size_t>(i);
    for (int j = 0; j < kX; ++j) all(i, j) = covariance.xx[k][static_cast<std::size_t>(j)];
    for (int j = 0; j < kC; ++j) all(i, kX + j) = all(kX + j, i) = covariance.xc[k][static_cast<std::size_t>(j)];
  }
  for (int j = 0; j < kC; ++j) all(kX + j, kX + j) = covariance.cc[static_cast<std::size_t>(j)];
  return all;
}

class ErrorCovariance : public testing::Test {
 protected:
  ErrorCovariance() : random_(test::random_seed(7)) {}

  double draw() { return normal_(random_); }
  Vector3 vector() { return {draw(), draw(), draw()}; }
  Matrix3 matrix() {
    Matrix3 m;
    for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = draw();
    return m;
  }

  // Positive definite, with a diagonal block of the considered errors.
  Covariance covariance() {
    Covariance c;
    for (double& variance : c.cc) variance = 0.5 + std::abs(draw());
    Eigen::Matrix<double, kX, kX> root;
    Eigen::Matrix<double, kX, kC> gain;
    for (double& value : root.reshaped()) value = draw();
    for (double& value : gain.reshaped()) value = draw();
    const Eigen::Matrix<double, kC, 1> considered = Eigen::Map<const Eigen::Matrix<double, kC, 1>>(c.cc.data());
    const Eigen::Matrix<double, kX, kX> xx =
        root * root.transpose() + gain * considered.asDiagonal() * gain.transpose();
    const Eigen::Matrix<double, kX, kC> xc = gain * considered.asDiagonal();
    for (std::size_t i = 0; i < kErrors; ++i) {
      for (std::size_t j = 0; j < kErrors; ++j)
        c.xx[i][j] = xx(static_cast<int>(std::max(i, j)), static_cast<int>(std::min(i, j)));
      for (std::size_t j = 0; j < kConsidered; ++j) c.xc[i][j] = xc(static_cast<int>(i), static_cast<int>(j));
    }
    return c;
  }

  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

// Sums of up to 23 products of numbers of about 10, rounded.
constexpr double kRounding = 1e-11;

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

TEST_F(ErrorCovariance, AdvancesAsTheDenseTransition) {
  for (int round = 0; round < 20; ++round) {
    Covariance c = covariance();
    const Transition t{matrix(), matrix(), matrix(), vector(), 0.7, 0.3};
    Eigen::Matrix<double, 3, kAll> u = Eigen::Matrix<double, 3, kAll>::Zero();
    u.middleCols<3>(3) = -t.by_gyro_bias;
    u.middleCols<3>(kX) = -t.by_gyro_scale;
    u.middleCols<3>(kX + 3) = t.by_gyro_axes;
    Eigen::Matrix<double, 2, 3> roll;  // zdot = r (omega_2, -omega_1)
    roll << 0, t.radius_m, 0, -t.radius_m, 0, 0;
    Dense f = Dense::Identity();
    f.topRows<3>() += u;
    Eigen::Matrix<double, 3, kAll> attitude = Eigen::Matrix<double, 3, kAll>::Zero();
    attitude.leftCols<3>().setIdentity();
    f.middleRows<2>(9) += roll * (u - cross_matrix(t.turn_W_rad) * (attitude + u / 2));
    Eigen::Matrix<double, kAll, 3> noise = Eigen::Matrix<double, kAll, 3>::Zero();
    noise.topRows<3>().setIdentity();
    noise.middleRows<2>(9) = roll;
    const Dense expected = f * dense(c) * f.transpose() + t.turn_variance * noise * noise.transpose();
    advance(t, c);
    EXPECT_LT((dense(c) - expected).norm(), kRounding * expected.norm());
    EXPECT_EQ(dense(c), dense(c).transpose());
  }
}

// Schmidt's filter: the gain of the considered errors is 0, and Joseph's form holds for any gain.
TEST_F(ErrorCovariance, CorrectsAsJosephsForm) {
  for (int round = 0; round < 20; ++round) {
    Covariance c = covariance();
    Measurement m;
    for (double& h : m.hx) h = draw();
    for (double& h : m.hc) h = draw();
    m.hx[4] = 0;
    m.innovation = 0.1;
    m.variance = 0.4;
    Eigen::Matrix<double, kAll, 1> h;
    for (int i = 0; i < kX; ++i) h[i] = m.hx[static_cast<std::size_t>(i)];
    for (int i = 0; i < kC; ++i) h[kX + i] = m.hc[static_cast<std::size_t>(i)];
    const Dense before = dense(c);
    const double s = h.dot(before * h) + m.variance;
    Eigen::Matrix<double, kAll, 1> gain = before * h / s;
    gain.tail<kC>().setZero();
    const Dense left = Dense::Identity() - gain * h.transpose();
    const Dense expected = left * before * left.transpose() + m.variance * gain * gain.transpose();
    Errors found{};
    found[0] = 0.02;
    EXPECT_TRUE(correct(m, 5, c, found));
    EXPECT_LT((dense(c) - expected).norm(), kRounding * before.norm());
    EXPECT_EQ(dense(c), dense(c).transpose());
    for (int i = 0; i < kX; ++i) {
      const double had = i == 0 ? 0.02 : 0;
      EXPECT_NEAR(found[static_cast<std::size_t>(i)], had + gain[i] * (m.innovation - 0.02 * m.hx[0]), kRounding);
    }
  }
}

TEST_F(ErrorCovariance, RefusesWhatIsFarOff) {
  Covariance c = covariance();
  const Dense before = dense(c);
  Measurement m;
  m.hx[2] = 1;
  m.variance = 1;
  Errors found{};
  const double sigma = std::sqrt(c.xx[2][2] + 1);
  m.innovation = 5.001 * sigma;
  EXPECT_FALSE(correct(m, 5, c, found));
  EXPECT_EQ(dense(c), before);
  EXPECT_EQ(found, Errors{});
  m.innovation = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(correct(m, 5, c, found));
  m.innovation = 4.999 * sigma;
  EXPECT_TRUE(correct(m, 5, c, found));
}

TEST_F(ErrorCovariance, TurnsWithTheAttitude) {
  Covariance c = covariance();
  const Vector3 turn = 0.1 * vector();
  Dense f = Dense::Identity();
  f.topLeftCorner<3, 3>() += cross_matrix(turn) / 2;
  const Dense expected = f * dense(c) * f.transpose();
  turn_errors(turn, c);
  EXPECT_LT((dense(c) - expected).norm(), kRounding * expected.norm());
  EXPECT_EQ(dense(c), dense(c).transpose());
}

// exp(x') = exp(x) exp(-turn), with the tangent of x' by x at x = turn taken by differences. The next term of the
// series is turn^2 / 12.
TEST_F(ErrorCovariance, TurnIsThatOfTheExponentials) {
  const Eigen::Vector3d turn(0.02, -0.03, 0.01);
  const auto exponential = [](const Eigen::Vector3d& v) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(v.norm(), v.normalized()));
  };
  for (int j = 0; j < 3; ++j) {
    const double step = 1e-6;
    const Eigen::Vector3d off = turn + step * Eigen::Vector3d::Unit(j);
    const Eigen::AngleAxisd left(exponential(off) * exponential(turn).conjugate());
    const Eigen::Vector3d derivative = left.angle() / step * left.axis();
    const Eigen::Vector3d expected = Eigen::Vector3d::Unit(j) + turn.cross(Eigen::Vector3d::Unit(j)) / 2;
    EXPECT_LT((derivative - expected).norm(), turn.squaredNorm() / 6 + step);
  }
}

TEST(EstimationHistory, RemembersInStraightLines) {
  for (const std::int64_t span : {1, 10, 61, 62, 100, 1000, 10000}) {
    SCOPED_TRACE(span);
    History<2> history;
    history.reset(span);
    EXPECT_EQ(history.at(5)[0], 0);
    const auto line = [](std::int64_t tick) { return std::array<double, 2>{0.5 * static_cast<double>(tick), 3}; };
    for (std::int64_t tick = -50; tick < 3 * span; ++tick) {
      history.add(tick, line(tick));
      for (const std::int64_t back : {std::int64_t{0}, std::int64_t{1}, span / 2, span - 1, span}) {
        if (tick - back < -50) continue;
        const auto found = history.at(tick - back);
        // Linear interpolation of a line, rounded.
        ASSERT_NEAR(found[0], line(tick - back)[0], 1e-11 * static_cast<double>(span + 100)) << tick << " " << back;
        ASSERT_EQ(found[1], 3);
      }
      ASSERT_EQ(history.at(tick + 7), line(tick));
    }
  }
}

TEST(EstimationHistory, BeforeTheOldestIsTheOldest) {
  History<1> history;
  history.reset(10);
  for (std::int64_t tick = 100; tick < 110; ++tick) history.add(tick, {static_cast<double>(tick)});
  EXPECT_EQ(history.at(0)[0], 100);
}

}  // namespace
}  // namespace ballast::firmware::estimation
