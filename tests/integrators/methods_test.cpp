// The methods on problems with known solutions.
#include "tools/integrators/methods.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

namespace ballast::integrators {
namespace {

// y'' = -y as a system; y = (cos t, -sin t).
class Oscillator : public Problem {
 public:
  [[nodiscard]] std::size_t size() const override { return 2; }
  void rhs(double, const double* y, double* f) const override {
    f[0] = y[1];
    f[1] = -y[0];
  }
  void jacobian(double, const double*, double* out) const override { out[0] = out[3] = 0, out[1] = -1, out[2] = 1; }
  static State at(double t) { return {std::cos(t), -std::sin(t)}; }
};

// x' = -x y on the half of the unit circle where y > 0, the circle as the constraint 0 = x^2 + y^2 - 1 in the place of
// y' = x^2: index 1, for d/dy of it is 2 y. x = 1 / cosh t, y = tanh t. Not linear, as a versor is not.
class HalfCircle : public Problem {
 public:
  [[nodiscard]] std::size_t size() const override { return 2; }
  void rhs(double, const double* y, double* f) const override {
    f[0] = -y[0] * y[1];
    f[1] = y[0] * y[0] + y[1] * y[1] - 1;
  }
  void jacobian(double, const double* y, double* out) const override {
    out[0] = -y[1], out[2] = -y[0];
    out[1] = 2 * y[0], out[3] = 2 * y[1];
  }
  [[nodiscard]] int constraint() const override { return 1; }
  void slope(double, const double* y, double* dydt) const override {
    dydt[0] = -y[0] * y[1];
    dydt[1] = y[0] * y[0];
  }
  static State at(double t) { return {1 / std::cosh(t), std::tanh(t)}; }
};

// Van der Pol's equation, y1' = y2, y2' = ((1 - y1^2) y2 - y1) / 1e-6, from (2, 0): Hairer and Wanner, section IV.10,
// (10.1).
class VanDerPol : public Problem {
 public:
  [[nodiscard]] std::size_t size() const override { return 2; }
  void rhs(double, const double* y, double* f) const override {
    f[0] = y[1];
    f[1] = ((1 - y[0] * y[0]) * y[1] - y[0]) / 1e-6;
  }
  void jacobian(double, const double* y, double* out) const override {
    out[0] = 0, out[2] = 1;
    out[1] = (-2 * y[0] * y[1] - 1) / 1e-6, out[3] = (1 - y[0] * y[0]) / 1e-6;
  }
};

// y' = y^2 from 1: at t = 1 there is no solution any more.
class BlowUp : public Problem {
 public:
  [[nodiscard]] std::size_t size() const override { return 1; }
  void rhs(double, const double* y, double* f) const override { f[0] = y[0] * y[0]; }
  void jacobian(double, const double* y, double* out) const override { out[0] = 2 * y[0]; }
};

// Hairer, Norsett, Wanner, section II.0, (0.1) and (0.2): the restricted three-body problem. The Arenstorf orbit from
// kStart closes after kPeriod; the numbers are theirs.
class Arenstorf : public Problem {
 public:
  static constexpr State kStart{0.994, 0, 0, -2.00158510637908252240537862224};
  static constexpr double kPeriod = 17.0652165601579625588917206249;
  [[nodiscard]] std::size_t size() const override { return 4; }
  void rhs(double, const double* y, double* f) const override {
    constexpr double kMoon = 0.012277471, kEarth = 1 - kMoon;
    const double d1 = std::pow((y[0] + kMoon) * (y[0] + kMoon) + y[1] * y[1], 1.5);
    const double d2 = std::pow((y[0] - kEarth) * (y[0] - kEarth) + y[1] * y[1], 1.5);
    f[0] = y[2];
    f[1] = y[3];
    f[2] = y[0] + 2 * y[3] - kEarth * (y[0] + kMoon) / d1 - kMoon * (y[0] - kEarth) / d2;
    f[3] = y[1] - 2 * y[2] - kEarth * y[1] / d1 - kMoon * y[1] / d2;
  }
  void jacobian(double, const double*, double*) const override {}
};

double distance(const State& a, const State& b) { return std::hypot(a[0] - b[0], a[1] - b[1]); }

std::unique_ptr<Method> make(const std::string& name, Problem& problem, const Settings& settings) {
  const MethodInfo* info = find_method(name);
  return info == nullptr ? nullptr : info->make(problem, settings);
}

// From the problem's solution at `from` to `until`.
template <class P>
std::unique_ptr<Method> solve(const std::string& name, P& problem, const Settings& settings, double from, double until,
                              const std::function<void(Method&)>& after_step = {}) {
  auto method = make(name, problem, settings);
  method->start(from, P::at(from));
  while (method->time() < until) {
    if (!method->step(until)) {
      ADD_FAILURE() << name << ": " << method->failure();
      break;
    }
    if (after_step) after_step(*method);
  }
  return method;
}

// Halving a fixed step divides the error by 2^order in the limit. The steps are chosen so that the error's next term,
// one order higher, changes the quotient by less than the bar allows (it goes as h), and that the smaller error is at
// least a hundred times the rounding and what Newton's iteration leaves (1e-4 of 1e-10 per step).
struct Order {
  const char* method;
  double order, step, bar;
};
class FixedSteps_ : public testing::TestWithParam<Order> {};

TEST_P(FixedSteps_, ShowTheOrder) {
  const auto [name, order, step, bar] = GetParam();
  Oscillator problem;
  const auto error = [&, name = name](double h) {
    const auto method = solve(name, problem, {.tolerance = 1e-10, .fixed_step_s = h}, 0, 4);
    EXPECT_EQ(method->counters().steps, std::lround(4 / h));
    return distance(method->state(), Oscillator::at(4));
  };
  EXPECT_NEAR(std::log2(error(step) / error(step / 2)), order, bar);
}

INSTANTIATE_TEST_SUITE_P(Methods, FixedSteps_,
                         testing::Values(Order{"rk4", 4, 0.1, 0.1}, Order{"dopri5", 5, 0.1, 0.1},
                                         Order{"dop853", 8, 0.5, 0.5}, Order{"radau5", 5, 0.2, 0.1}),
                         [](const auto& order) { return std::string(order.param.method); });

TEST(FixedSteps_, ShowTheOrderOfRadauOnADae) {
  HalfCircle problem;
  const auto error = [&](double h) {
    const auto method = solve("radau5_dae", problem, {.tolerance = 1e-11, .fixed_step_s = h}, 0.5, 2.5);
    return distance(method->state(), HalfCircle::at(2.5));
  };
  EXPECT_NEAR(std::log2(error(0.2) / error(0.1)), 5, 0.4);
}

// The local error of the dense output: one order more than its own, over steps of h and h / 2.
class Dense : public testing::TestWithParam<Order> {};

TEST_P(Dense, HasItsOrderAndMeetsBothEnds) {
  const auto [name, order, step, bar] = GetParam();
  Oscillator problem;
  const auto worst = [&, name = name](double h) {
    double largest = 0;
    State y{};
    auto method = make(name, problem, {.tolerance = 1e-10, .fixed_step_s = h});
    method->start(0, Oscillator::at(0));
    EXPECT_TRUE(method->step(h));
    method->dense(0, y);
    EXPECT_LT(distance(y, Oscillator::at(0)), 1e-14);
    method->dense(h, y);
    EXPECT_LT(distance(y, method->state()), 1e-14);
    for (int i = 1; i < 20; ++i) {
      method->dense(i * h / 20, y);
      largest = std::max(largest, distance(y, Oscillator::at(i * h / 20)));
    }
    return largest;
  };
  EXPECT_NEAR(std::log2(worst(step) / worst(step / 2)), order + 1, bar);
}

INSTANTIATE_TEST_SUITE_P(Methods, Dense,
                         testing::Values(Order{"rk4", 3, 0.1, 0.2}, Order{"dopri5", 4, 0.1, 0.2},
                                         Order{"dop853", 7, 0.8, 0.5}, Order{"radau5", 3, 0.1, 0.2}),
                         [](const auto& order) { return std::string(order.param.method); });

std::vector<std::string> ode_methods() {
  std::vector<std::string> names;
  for (const auto& info : all_methods()) {
    if (info.form == Form::kOde) names.emplace_back(info.name);
  }
  return names;
}

class EveryMethod : public testing::TestWithParam<std::string> {
 protected:
  // As `ballast integrate` would set them.
  [[nodiscard]] Settings settings(double tolerance) const {
    const bool fixed = find_method(GetParam())->fixed_steps == FixedSteps::kAlways;
    return {.tolerance = tolerance, .fixed_step_s = fixed ? std::pow(tolerance, 0.25) : 0};
  }
};

// A tighter tolerance gives a better solution, at the steps' ends as inside them. Error per step: over 10 time units a
// method of order p sums up some tolerance^(p/(p+1)), 1e-10 -> 2e-7 with p = 2, which is the worst; bars with a factor
// of five to spare.
TEST_P(EveryMethod, KeepsToItsTolerance) {
  Oscillator problem;
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    double inside = 0;
    const auto method = solve(GetParam(), problem, settings(tolerance), 0, 10, [&](Method& m) {
      State dense{}, exact{};
      const double t = m.step_start() + 0.3 * (m.time() - m.step_start());
      m.dense(t, dense);
      m.exact(t, exact);
      // Radau's collocation polynomial is of order 3 where the method is of order 5; exact() makes up for that.
      if (GetParam() != "radau5") inside = std::max(inside, distance(dense, Oscillator::at(t)));
      inside = std::max(inside, distance(exact, Oscillator::at(t)));
    });
    EXPECT_EQ(method->time(), 10);
    const double bar = 5 * std::pow(tolerance, 2. / 3);
    EXPECT_LT(distance(method->state(), Oscillator::at(10)), bar);
    EXPECT_LT(inside, bar);
  }
}

// start() forgets: what comes after a kink does not depend on what came before.
TEST_P(EveryMethod, StartsAnewAsIfItWereTheFirstTime) {
  Oscillator problem;
  const auto fresh = solve(GetParam(), problem, settings(1e-8), 2, 3);
  auto used = solve(GetParam(), problem, settings(1e-8), 0, 1.5);
  used->start(2, Oscillator::at(2));
  while (used->time() < 3) ASSERT_TRUE(used->step(3));
  EXPECT_EQ(fresh->state(), used->state());
}

TEST_P(EveryMethod, CountsWhatItDoes) {
  Oscillator problem;
  const auto method = solve(GetParam(), problem, settings(1e-8), 0, 1);
  const Counters& c = method->counters();
  EXPECT_GT(c.steps, 0);
  EXPECT_GT(c.right_hand_sides, c.steps);
  const bool implicit =
      GetParam() != "rk4" && GetParam() != "dopri5" && GetParam() != "dop853" && GetParam() != "adams";
  EXPECT_EQ(c.jacobians > 0, implicit);
}

// No method goes on past the end of the solution, and none hangs before it.
TEST_P(EveryMethod, SaysSoWhereThereIsNoSolution) {
  BlowUp problem;
  auto method = make(GetParam(), problem, settings(1e-6));
  State y{1};
  method->start(0, y);
  bool goes_on = true;
  while (goes_on && method->time() < 2) {
    goes_on = method->step(2);
    ASSERT_LT(method->counters().steps + method->counters().rejected, 1'000'000);
  }
  EXPECT_FALSE(goes_on);
  EXPECT_FALSE(method->failure().empty());
  EXPECT_NEAR(method->time(), 1, 0.1) << method->failure();  // rk4's fixed step overshoots by a step or two
}

INSTANTIATE_TEST_SUITE_P(Methods, EveryMethod, testing::ValuesIn(ode_methods()),
                         [](const auto& name) { return name.param; });

// Index 1, not linear: the constraint holds, and the solution is the known one.
class Dae : public testing::TestWithParam<std::string> {};

TEST_P(Dae, FollowsAKnownSolution) {
  HalfCircle problem;
  double off_circle = 0;
  const auto method = solve(GetParam(), problem, {.tolerance = 1e-10}, 0.5, 3, [&](Method& m) {
    off_circle = std::max(off_circle, std::abs(std::hypot(m.state()[0], m.state()[1]) - 1));
  });
  EXPECT_LT(distance(method->state(), HalfCircle::at(3)), 5e-8);  // some hundred steps of 1e-10
  EXPECT_LT(off_circle, 1e-9);                                    // what Newton's iteration leaves, below the tolerance
}

INSTANTIATE_TEST_SUITE_P(Methods, Dae, testing::Values("radau5_dae", "ida"), [](const auto& n) { return n.param; });

// Stiff. The values at t = 1 and 2 are Hairer's, res_exact_pic of his test
// set for stiff equations, to 16 digits. The bars: |y2| is as large as 1e3 on the way through the jump at t = 0.8,
// whose time carries the error of the steps before.
class Stiff : public testing::TestWithParam<std::string> {};

TEST_P(Stiff, VanDerPolEndsWhereHairerSays) {
  VanDerPol problem;
  auto method = make(GetParam(), problem, {.tolerance = 1e-9});
  method->start(0, State{2, 0});
  while (method->time() < 1) ASSERT_TRUE(method->step(1)) << method->failure();
  EXPECT_NEAR(method->state()[0], -0.1863646254808130e1, 2e-7);
  EXPECT_NEAR(method->state()[1], 0.7535430865435460, 2e-7);
  while (method->time() < 2) ASSERT_TRUE(method->step(2)) << method->failure();
  EXPECT_NEAR(method->state()[0], 0.1706167732170456e1, 2e-7);
  EXPECT_NEAR(method->state()[1], -0.8928097010248257, 2e-7);
  // Explicit methods take some 2e6, for 1e6 y1^2 h < 3; those of order 2, with their share of the tolerance, up to 4e5.
  EXPECT_LT(method->counters().steps, 500'000);
}

INSTANTIATE_TEST_SUITE_P(Methods, Stiff, testing::Values("radau5", "bdf", "trbdf2", "trapezoid", "ida"),
                         [](const auto& n) { return std::string(n.param); });

// Past the moon, at a distance of 0.006, the steps must shrink by 1e3. There are up to some 1e3 of them, with an error
// of 1e-12 each; the bar leaves ten times their sum for what the orbit makes of them.
class Orbit : public testing::TestWithParam<std::string> {};

TEST_P(Orbit, OfArenstorfCloses) {
  Arenstorf problem;
  auto method = make(GetParam(), problem, {.tolerance = 1e-12});
  method->start(0, Arenstorf::kStart);
  while (method->time() < Arenstorf::kPeriod) ASSERT_TRUE(method->step(Arenstorf::kPeriod)) << method->failure();
  EXPECT_NEAR(method->state()[0], Arenstorf::kStart[0], 1e-8);
  EXPECT_NEAR(method->state()[1], Arenstorf::kStart[1], 1e-8);
}

INSTANTIATE_TEST_SUITE_P(Methods, Orbit, testing::Values("dopri5", "dop853", "adams"),
                         [](const auto& n) { return n.param; });

TEST(Methods, AreFoundByName) {
  EXPECT_NE(find_method(kDefaultMethod), nullptr);
  EXPECT_EQ(find_method("euler"), nullptr);
}

}  // namespace
}  // namespace ballast::integrators
