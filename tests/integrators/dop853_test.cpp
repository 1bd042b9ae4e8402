#include "sim/integrators/dop853.h"

#include <gtest/gtest.h>

#include <cmath>

namespace ballast::sim {
namespace {

using Step = Dop853<2>;

// y'' = -y, y(0) = 1, y'(0) = 0.
void oscillator(double, const double* y, double* dydt) {
  dydt[0] = y[1];
  dydt[1] = -y[0];
}

Step one_step(double h, const Step::State& y0) {
  Step::State k1;
  oscillator(0, y0.data(), k1.data());
  Step step;
  step.step(oscillator, 0, h, y0, k1, 2);
  step.prepare_dense(oscillator);
  return step;
}

double error_at_four(int steps) {
  Step::State y{1, 0}, k;
  oscillator(0, y.data(), k.data());
  Step step;
  for (int i = 0; i < steps; ++i) {
    step.step(oscillator, 0, 4.0 / steps, y, k, 2);
    y = step.end_state();
    k = step.end_derivative();
  }
  return std::hypot(y[0] - std::cos(4.0), y[1] + std::sin(4.0));
}

// Halving the step divides the global error by 2^8 in the limit; the next term is one order higher, so at h = 1/2 the
// observed order is within about h of 8. Smaller steps meet rounding soon: the error is 1e-8 at h = 1/2 already.
TEST(Dop853, HasOrderEight) {
  const double order = std::log2(error_at_four(8) / error_at_four(16));
  EXPECT_NEAR(order, 8.0, 0.5);
}

// h (h^5)^2 / h^3 (dop853.f: ERR).
TEST(Dop853, ErrorEstimateHasOrderEightLocally) {
  const Step::State y0{1, 0};
  const double order = std::log2(one_step(0.4, y0).error(1) / one_step(0.2, y0).error(1));
  EXPECT_NEAR(order, 8.0, 0.4);
}

TEST(Dop853, DenseOutputMeetsBothEndsAndHasOrderSeven) {
  const Step::State y0{1, 0};
  Step::State at;
  const Step step = one_step(0.5, y0);
  step.interpolate(0, at);
  EXPECT_EQ(at[0], 1.0);
  step.interpolate(1, at);
  EXPECT_NEAR(at[0], step.end_state()[0], 4e-16);  // rounding of one sum
  const auto worst = [&](double h) {
    const Step s = one_step(h, y0);
    double error = 0;
    for (int i = 1; i < 20; ++i) {
      s.interpolate(i / 20.0, at);
      error = std::max(error, std::hypot(at[0] - std::cos(i * h / 20), at[1] + std::sin(i * h / 20)));
    }
    return error;
  };
  EXPECT_GT(std::log2(worst(1.0) / worst(0.5)), 7.5);  // local error of order 8 at least, up to the next term
}

TEST(Dop853, NanInTheRightHandSideShowsInTheError) {
  Step::State y0{1, 0}, k1{0, 0};
  Step step;
  step.step([](double, const double*, double* d) { d[0] = d[1] = std::nan(""); }, 0, 0.1, y0, k1, 2);
  EXPECT_TRUE(std::isnan(step.error(1e-12)));
}

// A state at rest under no force: nothing to estimate, and no 0 / 0.
TEST(Dop853, RestHasNoError) {
  Step::State y0{1, 2}, k1{0, 0};
  Step step;
  step.step([](double, const double*, double* d) { d[0] = d[1] = 0; }, 0, 0.1, y0, k1, 2);
  EXPECT_EQ(step.error(1e-12), 0);
}

}  // namespace
}  // namespace ballast::sim
