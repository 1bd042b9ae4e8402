#include "firmware/model/rail.h"

#include <gtest/gtest.h>

#include <complex>
#include <numbers>
#include <random>

#include "tests/firmware/paper_ball.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

constexpr Real kPi = std::numbers::pi_v<Real>;
constexpr Real kRounding = 1e-15;  // a few roundings of numbers of size 1

Vector3 spherical(Real azimuth, Real elevation) {
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
}

// Frisvad 2012, listing 2, as printed there.
void frisvad(const Vector3& n, Vector3& b1, Vector3& b2) {
  if (n[2] < -0.9999999) {
    b1 = Vector3(0, -1, 0);
    b2 = Vector3(-1, 0, 0);
    return;
  }
  const Real a = 1 / (1 + n[2]);
  const Real b = -n[0] * n[1] * a;
  b1 = Vector3(1 - n[0] * n[0] * a, b, -n[0]);
  b2 = Vector3(b, 1 - n[1] * n[1] * a, -n[1]);
}

TEST(Rail, CircleAboutIsFrisvadsFrame) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(20240501));
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> azimuth(-kPi, kPi), elevation(-kPi / 2, kPi / 2);
  for (int k = 0; k < 2000; ++k) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << " case " << k);
    const Real az = azimuth(random), el = elevation(random);
    const Vector3 n = spherical(az, el);
    Vector3 b1, b2;
    frisvad(n, b1, b2);
    Matrix3 frame;
    frame << n, b2, -b1;
    // Near the south pole 1/(1 + n_z) amplifies the rounding of n, whose length is off by 1e-16.
    const Real tolerance = 10 * kRounding / std::fmax(1 + n[2], 1e-7);
    EXPECT_NEAR((frame.transpose() * frame - Matrix3::Identity()).norm(), 0, tolerance);
    EXPECT_NEAR(frame.determinant(), 1, tolerance) << "right-handed [n, b2, -b1]";
    const Rail rail = circle_about(0.85, az, el);
    EXPECT_NEAR((evaluate<Real>(rail, 0).position - 0.85 * n).norm(), 0, kRounding) << "theta = 0 lies on n";
    for (const Real theta : {0.3, 2.0, -1.7}) {
      const Vector3 expected = 0.85 * (frame * Vector3(std::cos(theta), 0, std::sin(theta)));
      EXPECT_NEAR((evaluate<Real>(rail, theta).position - expected).norm(), 0, tolerance);
    }
    EXPECT_NEAR(rail.axis_cos_B.norm(), 1, kRounding);
    EXPECT_NEAR(rail.axis_sin_B.norm(), 1, kRounding);
    EXPECT_NEAR(rail.axis_cos_B.dot(rail.axis_sin_B), 0, kRounding);
  }
}

TEST(Rail, CircleAboutAtTheSouthPole) {
  const Rail rail = circle_about(2, 0.4, -kPi / 2);
  EXPECT_NEAR((rail.axis_cos_B - Vector3(0, 0, -1)).norm(), 0, kRounding);
  EXPECT_NEAR((rail.axis_sin_B - Vector3(0, 1, 0)).norm(), 0, kRounding) << "-b1 of the special case";
  // Just outside the special case the general formula still gives a frame.
  const Rail near = circle_about(2, 0.4, -kPi / 2 + 6e-4);
  EXPECT_GT(std::sin(-kPi / 2 + 6e-4), -0.9999999);
  EXPECT_NEAR(near.axis_cos_B.dot(near.axis_sin_B), 0, kRounding);
  EXPECT_NEAR(near.axis_sin_B.norm(), 1, kRounding);
}

TEST(Rail, PaperRailsInClosedForm) {
  // n = e1: b1 = (0, 0, -1), so the circle is (cos, 0, sin). n = e2: b1 = (1, 0, 0), so it is (-sin, cos, 0).
  const Vector3 first = evaluate<Real>(circle_about(0.95, 0, 0), 0.7).position;
  EXPECT_NEAR((first - 0.95 * Vector3(std::cos(0.7), 0, std::sin(0.7))).norm(), 0, kRounding);
  const Vector3 second = evaluate<Real>(circle_about(0.9, kPi / 2, 0), 0.7).position;
  EXPECT_NEAR((second - 0.9 * Vector3(-std::sin(0.7), std::cos(0.7), 0)).norm(), 0, kRounding);
}

TEST(Rail, PaperStartPutsTheCentreOfMassAboveTheGeometricCentre) {
  const Vector3 sum = Vector3(0, 0, -0.05) + evaluate<Real>(circle_about(0.95, 0, 0), 0).position +
                      evaluate<Real>(circle_about(0.9, kPi / 2, 0), 2.0369).position +
                      evaluate<Real>(circle_about(0.85, kPi / 4, kPi / 4), 0.7044).position;
  // The paper prints the angles with four digits; physics.md section 2 gives offset 1e-5 and height +0.1708.
  EXPECT_NEAR(sum[0] / 4, 0, 2e-5);
  EXPECT_NEAR(sum[1] / 4, 0, 2e-5);
  EXPECT_NEAR(sum[2] / 4, 0.1708, 5e-5);
}

TEST(Rail, DerivativesAgreeWithDifferencesAndComplexStep) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(7));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> uniform(-2, 2);
  const Rail rails[] = {circle_about(0.85, 0.3, 0.6),
                        circle(Vector3(0.1, -0.2, 0.3), 0.4, Vector3(0, 1, 0), Vector3(0.6, 0, -0.8)),
                        line(Vector3(0.1, 0.2, -0.2), Vector3(1, 2, -3)), testing::wavy_spline()};
  for (const Rail& rail : rails) {
    for (int k = 0; k < 100; ++k) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << " case " << k);
      const Real theta = uniform(random), h = 1e-4;
      const RailPoint<Real> p = evaluate<Real>(rail, theta), q = evaluate<Real>(rail, theta + h),
                            o = evaluate<Real>(rail, theta - h);
      // Central differences: h^2/6 = 2e-9 of truncation, 1e-16/h = 1e-12 of rounding.
      EXPECT_NEAR(((q.position - o.position) / (2 * h) - p.d1).norm(), 0, 1e-8);
      EXPECT_NEAR(((q.d1 - o.d1) / (2 * h) - p.d2).norm(), 0, 1e-8);
      const RailPoint<std::complex<Real>> z = evaluate(rail, std::complex<Real>(theta, 1e-100));
      for (int j = 0; j < 3; ++j) {
        // A spline's derivatives are differences of positions, divided by a piece's length of 0.08.
        EXPECT_NEAR(z.position[j].imag() / 1e-100, p.d1[j], 30 * kRounding);
        EXPECT_NEAR(z.d1[j].imag() / 1e-100, p.d2[j], 30 * kRounding);
      }
    }
  }
}

// Two pieces of length 2, chosen so that each is a known cubic: with y and y'' of u^3 at its ends a piece is u^3.
Rail cube(bool closed) {
  Rail rail;
  rail.shape = RailShape::kSpline;
  rail.closed = closed;
  rail.piece_count = 2;
  rail.piece_length_m = 2;
  for (int k = 0; k <= 2; ++k) {
    const Real u = 2 * k;
    // Closed: third component a tent of two parabolas' worth of bend, equal at both ends.
    rail.knots[static_cast<std::size_t>(k)] = {Vector3(closed ? 0 : u * u * u, closed ? k % 2 : 1 + u, 3),
                                               Vector3(closed ? 0 : 6 * u, 0, 0)};
  }
  return rail;
}

TEST(Rail, SplineIsTheCubicOfItsKnots) {
  const Rail rail = cube(false);
  EXPECT_EQ(length_m(rail), 4);
  for (const Real u : {0.0, 0.7, 1.9999, 2.0, 3.3, 4.0}) {
    const RailPoint<Real> p = evaluate<Real>(rail, u);
    // Values up to 64: 1e-14 a rounding.
    EXPECT_NEAR((p.position - Vector3(u * u * u, 1 + u, 3)).norm(), 0, 1e-13) << u;
    EXPECT_NEAR((p.d1 - Vector3(3 * u * u, 1, 0)).norm(), 0, 1e-13) << u;
    EXPECT_NEAR((p.d2 - Vector3(6 * u, 0, 0)).norm(), 0, 1e-13) << u;
  }
}

TEST(Rail, OpenSplineGoesStraightOnBeyondItsEnds) {
  const Rail rail = cube(false);
  for (const Real beyond : {1e-9, 0.5, 100.0}) {
    const RailPoint<Real> p = evaluate<Real>(rail, 4 + beyond), q = evaluate<Real>(rail, -beyond);
    EXPECT_NEAR((p.position - Vector3(64 + 48 * beyond, 5 + beyond, 3)).norm(), 0, 1e-13 * (1 + 48 * beyond));
    EXPECT_NEAR((p.d1 - Vector3(48, 1, 0)).norm(), 0, 1e-13);
    EXPECT_EQ(p.d2, Vector3::Zero());
    EXPECT_NEAR((q.position - Vector3(0, 1 - beyond, 3)).norm(), 0, 1e-13 * (1 + beyond));
    EXPECT_EQ(q.d2, Vector3::Zero());
  }
}

TEST(Rail, ClosedSplineWraps) {
  const Rail rail = cube(true);
  for (const Real u : {0.0, 0.5, 2.5, 3.75}) {
    for (const int turns : {-1000, -1, 1, 7}) {
      const RailPoint<Real> p = evaluate<Real>(rail, u), q = evaluate<Real>(rail, u + 4 * turns);
      EXPECT_EQ(p.position, q.position) << u;  // multiples of 1/4: exact
      EXPECT_EQ(p.d1, q.d1) << u;
    }
  }
  EXPECT_EQ(evaluate<Real>(rail, -0.5).position, Vector3(0, 0.25, 3));
  // A position that rounding leaves just below a turn belongs to the curve, not to a tangent.
  EXPECT_NEAR(evaluate<Real>(rail, -1e-300).position[1], 0, kRounding);
}

TEST(Rail, NotANumberGoesThroughASpline) {
  for (const bool closed : {false, true}) {
    for (const Real theta : {std::numeric_limits<Real>::quiet_NaN(), std::numeric_limits<Real>::infinity()}) {
      EXPECT_FALSE(evaluate<Real>(cube(closed), theta).position.allFinite()) << closed << " " << theta;
    }
  }
}

TEST(Rail, BuildersNormalise) {
  const Rail l = line(Vector3(1, 2, 3), Vector3(0, 3, 4));
  EXPECT_EQ(l.shape, RailShape::kLine);
  EXPECT_NEAR((evaluate<Real>(l, 5).position - Vector3(1, 5, 7)).norm(), 0, 1e-14);
  const Rail c = circle(Vector3::Zero(), 2, Vector3(3, 0, 0), Vector3(1e-7, 0, 1));
  EXPECT_EQ(c.axis_cos_B, Vector3(1, 0, 0));
  EXPECT_NEAR(c.axis_cos_B.dot(c.axis_sin_B), 0, kRounding);
  EXPECT_NEAR(c.axis_sin_B.norm(), 1, kRounding);
}

}  // namespace
}  // namespace ballast::firmware
