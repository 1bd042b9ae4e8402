// Cubic curves through points, and rails made of them, against closed forms and convergence orders.
#include "sim/masses/cubic_spline.h"

#include <gtest/gtest.h>

#include <complex>
#include <numbers>
#include <random>

#include "sim/masses/spline_rail.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;

std::vector<double> uneven_knots(std::size_t count, std::mt19937& random) {
  std::vector<double> knots = {-0.3};
  while (knots.size() < count) knots.push_back(knots.back() + std::uniform_real_distribution<double>(0.2, 1)(random));
  return knots;
}

TEST(CubicSpline, OpenAndClampedReproduceEveryCubic) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(5));
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  const auto cubic = [](double u) { return Vector3d(1 - u + 0.5 * u * u - 0.25 * u * u * u, u * u * u, 2 + u * u); };
  const auto slope = [](double u) { return Vector3d(-1 + u - 0.75 * u * u, 3 * u * u, 2 * u); };
  const auto bend = [](double u) { return Vector3d(1 - 1.5 * u, 6 * u, 2); };
  for (const std::size_t count : {4, 5, 12}) {
    const std::vector<double> knots = uneven_knots(count, random);
    std::vector<Vector3d> points;
    for (const double u : knots) points.push_back(cubic(u));
    for (const CubicSpline& spline : {CubicSpline::open(knots, points),
                                      CubicSpline::clamped(knots, points, slope(knots.front()), slope(knots.back()))}) {
      for (double u = knots.front(); u < knots.back(); u += 0.05) {
        // Values up to 1e3 at u = 8, and a sparse system of condition 1e2 or so: rounding.
        EXPECT_LT((spline.at(u).position - cubic(u)).norm(), 1e-11);
        EXPECT_LT((spline.at(u).d1 - slope(u)).norm(), 1e-10);
        EXPECT_LT((spline.at(u).d2 - bend(u)).norm(), 1e-10);
      }
    }
  }
}

TEST(CubicSpline, TwoPointsMakeALineAndThreeAParabola) {
  const CubicSpline line = CubicSpline::open({1, 3}, {Vector3d(0, 1, 2), Vector3d(4, 1, 0)});
  EXPECT_LT((line.at(1.5).position - Vector3d(1, 1, 1.5)).norm(), 1e-15);
  EXPECT_EQ(line.at(1.5).d1, Vector3d(2, 0, -1));
  EXPECT_EQ(line.at(1.5).d2, Vector3d::Zero());
  const auto parabola = [](double u) { return Vector3d(u, u * u, 1 - u - 2 * u * u); };
  const CubicSpline three = CubicSpline::open({0, 0.5, 2}, {parabola(0), parabola(0.5), parabola(2)});
  for (const double u : {0.1, 0.4, 1.0, 1.9}) EXPECT_LT((three.at(u).position - parabola(u)).norm(), 1e-14);
}

TEST(CubicSpline, IsSmoothThroughItsKnotsAndItsSeam) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(6));
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const std::size_t count : {3, 4, 5, 20}) {
    const std::vector<double> knots = uneven_knots(count, random);
    std::vector<Vector3d> points(count);
    for (Vector3d& point : points) point = {uniform(random), uniform(random), uniform(random)};
    points.back() = points.front();
    const CubicSpline closed = CubicSpline::closed(knots, points);
    const CubicSpline open = CubicSpline::open(knots, points);
    const auto expect_same = [](const CubicSpline::Point& a, const CubicSpline::Point& b) {
      // Points of size 1 at distances down to 0.2: second derivatives up to 1e3.
      EXPECT_LT((a.position - b.position).norm(), 1e-13);
      EXPECT_LT((a.d1 - b.d1).norm(), 1e-12);
      EXPECT_LT((a.d2 - b.d2).norm(), 1e-11);
    };
    for (std::size_t i = 1; i + 1 < count; ++i) {
      expect_same(closed.at(i - 1, knots[i]), closed.at(i, knots[i]));
      expect_same(open.at(i - 1, knots[i]), open.at(i, knots[i]));
      EXPECT_LT((open.at(knots[i]).position - points[i]).norm(), 1e-14);
    }
    expect_same(closed.at(count - 2, knots.back()), closed.at(0, knots.front()));
    const double length = knots.back() - knots.front();
    expect_same(closed.at(0.1), closed.at(0.1 + length));
    expect_same(closed.at(0.1), closed.at(0.1 - 3 * length));
  }
}

TEST(CubicSpline, ConvergesWithOrderFour) {
  const auto curve = [](double u) { return Vector3d(std::cos(u), std::sin(2 * u), std::exp(std::sin(u))); };
  for (const bool closed : {true, false}) {
    double previous = 0;
    for (const int count : {20, 40, 80}) {
      std::vector<double> knots;
      std::vector<Vector3d> points;
      for (int i = 0; i <= count; ++i) {
        knots.push_back(2 * pi * i / count);
        points.push_back(curve(i == count && closed ? 0 : knots.back()));
      }
      const CubicSpline spline = closed ? CubicSpline::closed(knots, points) : CubicSpline::open(knots, points);
      double worst = 0;
      for (double u = 0; u < 6.28; u += 0.01) worst = std::max(worst, (spline.at(u).position - curve(u)).norm());
      if (previous > 0) {
        EXPECT_GT(previous / worst, 13) << count;
      }  // 16, up to the next order
      previous = worst;
    }
  }
}

TEST(CubicSpline, SaysWhereNumbersEnd) {
  EXPECT_FALSE(
      CubicSpline::open({0, 1e-320, 1, 2}, {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)})
          .finite());
}

std::vector<Vector3d> circle_points(int count, double radius) {
  std::vector<Vector3d> points;
  for (int i = 0; i < count; ++i) {
    points.emplace_back(radius * std::cos(2 * pi * i / count), 0.1, radius * std::sin(2 * pi * i / count));
  }
  return points;
}

// As a rail of ever more pieces: position and length with order 4, |zeta'| with order 3, the bend with order 2.
TEST(SplineRail, ThroughACircleConvergesToIt) {
  double position = 0, speed = 0, bend = 0;
  const double radius = 0.8;
  for (const int pieces : {16, 32, 64}) {
    const SplineRail spline = spline_rail(circle_points(400, radius), true, pieces);
    EXPECT_NEAR(spline.length_m, 2 * pi * radius, 1e-8);  // 400 points: (2 pi / 400)^4 / 100 of it
    double worst = 0, worst_bend = 0;
    for (double theta = -1; theta < 7; theta += 0.013) {
      const double at = theta / radius;
      const auto p = firmware::evaluate(spline.rail, theta);
      worst = std::max(worst, (p.position - Vector3d(radius * std::cos(at), 0.1, radius * std::sin(at))).norm());
      worst_bend = std::max(worst_bend, (p.d2 + Vector3d(std::cos(at), 0, std::sin(at)) / radius).norm());
    }
    if (position > 0) {
      EXPECT_NEAR(std::log2(position / worst), 4, 0.2) << pieces;
      EXPECT_NEAR(std::log2(speed / spline.speed_error), 4, 1.2) << pieces;
      EXPECT_NEAR(std::log2(bend / worst_bend), 2, 0.2) << pieces;
    }
    position = worst, speed = spline.speed_error, bend = worst_bend;
    EXPECT_LT(spline.point_distance_m, 1.001 * worst + 1e-9);
    EXPECT_NEAR(spline.farthest_m, std::hypot(radius, 0.1), worst);
  }
  EXPECT_LT(position, 1e-6 * radius);  // of the circle of 64 pieces: h^4 / 384 = 2.4e-7
  EXPECT_LT(speed, 1e-4);
}

// Symmetric points of a parabola: x is proportional to the chord length, so the first curve is that parabola.
TEST(SplineRail, HasTheLengthOfAParabola) {
  const SplineRail spline =
      spline_rail({Vector3d(-0.5, 0, 0.5), Vector3d(0, 0, 0), Vector3d(0.5, 0, 0.5)}, false);  // z = 2 x^2
  const double k = 2;                                                                          // dz/dx at the ends
  EXPECT_NEAR(spline.length_m, 2 * (k * std::sqrt(1 + k * k) + std::asinh(k)) / (4 * 2), 1e-12);
  double worst = 0;
  for (double theta = 0; theta <= spline.length_m; theta += 0.01) {
    const Vector3d p = firmware::evaluate(spline.rail, theta).position;
    worst = std::max(worst, std::abs(p[2] - 2 * p[0] * p[0]));
    // Theta is the way from the start: the integral in closed form.
    const auto primitive = [](double x) { return (4 * x * std::sqrt(1 + 16 * x * x) + std::asinh(4 * x)) / 8; };
    EXPECT_NEAR(primitive(p[0]) - primitive(-0.5), theta, 1e-6);  // (1.5 / 64)^4 of a curve that bends at 4 / m
  }
  EXPECT_LT(worst, 1e-6);
  EXPECT_LT(spline.speed_error, 1e-4);
}

TEST(SplineRail, OfTwoPointsIsTheLine) {
  const SplineRail spline = spline_rail({Vector3d(0.1, 0, 0), Vector3d(0.1, 0.3, 0.4)}, false);
  EXPECT_NEAR(spline.length_m, 0.5, 1e-15);
  EXPECT_LT(spline.speed_error, 1e-13);
  for (const double theta : {-0.2, 0.0, 0.123, 0.5, 0.9}) {  // straight on beyond the ends
    const auto p = firmware::evaluate(spline.rail, theta);
    EXPECT_LT((p.position - Vector3d(0.1, 0.6 * theta, 0.8 * theta)).norm(), 1e-14);
    EXPECT_LT((p.d1 - Vector3d(0, 0.6, 0.8)).norm(), 1e-13);
    EXPECT_LT(p.d2.norm(), 1e-10);
  }
}

// Points that a rail of 64 pieces cannot follow, which the scenario reader refuses, are visible here.
TEST(SplineRail, MeasuresWhatItCannotFollow) {
  std::vector<Vector3d> zigzag;
  for (int i = 0; i < 60; ++i) zigzag.emplace_back(0.02 * i, i % 2 == 0 ? 0.0 : 0.2, 0);
  const SplineRail spline = spline_rail(zigzag, false);
  EXPECT_GT(spline.speed_error, 0.1);
  EXPECT_GT(spline.point_distance_m, 0.01);
}

}  // namespace
}  // namespace ballast::sim
