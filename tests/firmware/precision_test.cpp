// The firmware with its model in single precision beside the one in double.
#include "tests/firmware/precision.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <limits>
#include <numbers>
#include <random>

namespace precision {
namespace {

constexpr double kEpsilon = std::numeric_limits<float>::epsilon();  // 1.2e-7

// Of the terms the forces are sums of. An angle of 10 rad is known to 4 epsilons, inputs and each of some 300
// operations round by half of one, with either sign; 2 epsilons is the worst of the states here, and 4 times that is
// allowed.
constexpr double kTolerance = 8 * kEpsilon;

State random_state(std::mt19937& random) {
  const auto in = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const auto three = [&](double size) {
    return std::array<double, 3>{in(-size, size), in(-size, size), in(-size, size)};
  };
  State s;
  s.radius_m = in(0.1, 1);
  s.gravity_mps2 = 9.81;
  s.shell_mass_kg = in(0.5, 2);
  const double moment = 2. / 3 * s.shell_mass_kg * s.radius_m * s.radius_m;
  s.inertia_kgm2 = {moment * in(0.9, 1.1), moment * in(0.9, 1.1), moment * in(0.9, 1.1)};
  s.center_of_mass_B_m = three(0.1 * s.radius_m);
  s.force_W_n = three(0.5);
  for (std::size_t i = 0; i < 3; ++i) {
    s.mass_kg[i] = in(0.1, 1);
    s.rail_radius_m[i] = s.radius_m * in(0.5, 0.95);
    s.azimuth_rad[i] = in(-3, 3);
    s.elevation_rad[i] = in(-1, 1.5);  // near the pole Frisvad's frame divides by what single precision does not have
    s.position_rad[i] = in(-10, 10);
    s.velocity_radps[i] = in(-3, 3);
    s.acceleration_radps2[i] = in(-10, 10);
  }
  std::normal_distribution<double> normal;
  double length = 0;
  for (double& q : s.orientation) q = normal(random), length += q * q;
  for (double& q : s.orientation) q /= std::sqrt(length);
  s.omega_B_radps = three(3);
  return s;
}

// What the forces are sums of: weight, and every mass's centripetal and tangential force.
double scale_n(const State& s) {
  double sum = s.shell_mass_kg * s.gravity_mps2 + 1;
  double omega = 0;
  for (const double o : s.omega_B_radps) omega += o * o;
  for (std::size_t i = 0; i < 3; ++i) {
    const double rate = std::sqrt(omega) + std::fabs(s.velocity_radps[i]);
    sum += s.mass_kg[i] * (s.gravity_mps2 + s.radius_m * (rate * rate + std::fabs(s.acceleration_radps2[i])));
  }
  return sum;
}

TEST(SinglePrecision, EnvelopeOfRandomStates) {
  const unsigned seed = 20240719;
  std::mt19937 random(seed);
  double worst = 0;
  for (int k = 0; k < 20'000; ++k) {
    const State s = random_state(random);
    const Envelope wide = envelope_of<double>(s), single = envelope_of<float>(s);
    const double scale = scale_n(s), allowed = kTolerance * scale;
    ASSERT_NEAR(single.normal_force_n, wide.normal_force_n, allowed) << "seed " << seed << " case " << k;
    ASSERT_NEAR(single.static_friction_n, wide.static_friction_n, allowed) << "seed " << seed << " case " << k;
    worst = std::fmax(worst, std::fabs(single.normal_force_n - wide.normal_force_n) / scale);
    worst = std::fmax(worst, std::fabs(single.static_friction_n - wide.static_friction_n) / scale);
    if (wide.normal_force_n > 0.1 * scale) {
      // d(f/N) = df / N + f dN / N^2
      const double per = (1 + wide.mu_required) / wide.normal_force_n;
      ASSERT_NEAR(single.mu_required, wide.mu_required, allowed * per) << "seed " << seed << " case " << k;
    }
  }
  std::cout << "worst " << worst / kEpsilon << " epsilons of the forces' terms\n";
  EXPECT_GT(worst, kEpsilon / 10) << "is this single precision?";
}

// Times, positions and steps do not depend on the model's precision: they are double in both, so the steps are the
// same.
TEST(SinglePrecision, StepsOfThePapersRunAreTheSame) {
  const PaperRun wide = paper_run<double>(20'000, -1), single = paper_run<float>(20'000, -1);
  ASSERT_TRUE(wide.accepted);
  ASSERT_TRUE(single.accepted);
  EXPECT_GT(wide.pulses.size(), 3'000u);
  EXPECT_EQ(single.pulses.size(), wide.pulses.size());
  EXPECT_TRUE(single.pulses == wide.pulses);
  ASSERT_EQ(single.envelope.size(), wide.envelope.size());
  double worst_n = 0, worst_mu = 0;
  for (std::size_t k = 0; k < wide.envelope.size(); ++k) {
    const double n = wide.envelope[k].normal_force_n, mu = wide.envelope[k].mu_required;
    // The weight is 4 N, the terms together up to 8 N.
    ASSERT_NEAR(single.envelope[k].normal_force_n, n, 8 * kTolerance) << "tick " << k;
    ASSERT_NEAR(single.envelope[k].mu_required, mu, 8 * kTolerance * (1 + mu) / n) << "tick " << k;
    worst_n = std::fmax(worst_n, std::fabs(single.envelope[k].normal_force_n - n));
    worst_mu = std::fmax(worst_mu, std::fabs(single.envelope[k].mu_required - mu));
  }
  EXPECT_GT(worst_n, 0) << "is this single precision?";
  std::cout << "N off by " << worst_n << ", f_s/N by " << worst_mu << "\n";
}

TEST(SinglePrecision, StopsAndMovesTakeTheSameStepsAndAreForetoldAlike) {
  const PaperRun wide = paper_run<double>(12'000, 3'000), single = paper_run<float>(12'000, 3'000);
  EXPECT_GT(wide.pulses.size(), 1'000u);
  EXPECT_TRUE(single.pulses == wide.pulses);
  ASSERT_EQ(single.plans.size(), wide.plans.size());
  ASSERT_GE(wide.plans.size(), 2u) << "a stop and a move at least";
  for (std::size_t k = 0; k < wide.plans.size(); ++k) {
    EXPECT_EQ(single.plans[k][0], wide.plans[k][0]) << "duration";
    // Up to 44 evaluations along an attitude that is integrated in single precision: its errors, an epsilon a step, add
    // up, and grow with the ball's motion by no more than a factor of ten in these times.
    for (std::size_t j = 1; j < 4; ++j) EXPECT_NEAR(single.plans[k][j], wide.plans[k][j], 8 * 10 * kTolerance);
  }
}

}  // namespace
}  // namespace precision
