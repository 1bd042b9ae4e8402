#include "sim/integrators/dormand_prince.h"

#include <gtest/gtest.h>

#include <cmath>

namespace ballast::sim {
namespace {

using Pair = DormandPrince<2>;

// y'' = -y, y(0) = 1, y'(0) = 0.
void oscillator(double, const double* y, double* dydt) {
  dydt[0] = y[1];
  dydt[1] = -y[0];
}

Pair one_step(double h, const Pair::State& y0) {
  Pair::State k1;
  oscillator(0, y0.data(), k1.data());
  Pair pair;
  pair.step(oscillator, 0, h, y0, k1, 2);
  return pair;
}

double error_at_one(int steps) {
  Pair::State y{1, 0}, k;
  oscillator(0, y.data(), k.data());
  Pair pair;
  for (int i = 0; i < steps; ++i) {
    pair.step(oscillator, 0, 1.0 / steps, y, k, 2);
    y = pair.end_state();
    k = pair.end_derivative();
  }
  return std::hypot(y[0] - std::cos(1.0), y[1] + std::sin(1.0));
}

// Halving the step divides the global error by 2^5 in the limit. The next term of the error is one order higher, so at
// h = 1/16 the observed order is within about h * O(1) of 5.
TEST(DormandPrince, HasOrderFive) {
  const double order = std::log2(error_at_one(16) / error_at_one(32));
  EXPECT_NEAR(order, 5.0, 0.1);
}

// The estimate is the difference to the order-4 solution, whose local error is O(h^5).
TEST(DormandPrince, ErrorEstimateHasOrderFiveLocally) {
  const Pair::State y0{1, 0};
  const double order = std::log2(one_step(0.1, y0).error(1) / one_step(0.05, y0).error(1));
  EXPECT_NEAR(order, 5.0, 0.15);
}

TEST(DormandPrince, DenseOutputMeetsBothEndsAndHasOrderFour) {
  const Pair::State y0{1, 0};
  Pair::State at;
  const Pair pair = one_step(0.1, y0);
  pair.interpolate(0, at);
  EXPECT_EQ(at[0], 1.0);
  pair.interpolate(1, at);
  EXPECT_NEAR(at[0], pair.end_state()[0], 4e-16);  // rounding of one sum
  const auto worst = [&](double h) {
    const Pair p = one_step(h, y0);
    double error = 0;
    for (int i = 1; i < 10; ++i) {
      p.interpolate(i / 10.0, at);
      error = std::max(error, std::hypot(at[0] - std::cos(i * h / 10), at[1] + std::sin(i * h / 10)));
    }
    return error;
  };
  EXPECT_GT(std::log2(worst(0.2) / worst(0.1)), 4.8);  // local error of order 5 at least
}

TEST(DormandPrince, NanInTheRightHandSideShowsInTheError) {
  Pair::State y0{1, 0}, k1{0, 0};
  Pair pair;
  pair.step([](double, const double*, double* d) { d[0] = d[1] = std::nan(""); }, 0, 0.1, y0, k1, 2);
  EXPECT_TRUE(std::isnan(pair.error(1e-12)));
}

}  // namespace
}  // namespace ballast::sim
