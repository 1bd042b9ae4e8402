// The bound on the number of the integrator's steps.
#include "sim/plant/stepping.h"

#include <gtest/gtest.h>

namespace ballast::sim {
namespace {

// All kMaxSteps steps are taken, the last one too. The next one is refused, until the next advance().
TEST(Stepping, TakesItsLastStepAndRefusesTheNext) {
  PlantModel model;
  model.gravity_mps2 = 9.81;
  model.ball = {.radius_m = 1, .mass_kg = 1, .inertia_kgm2 = {0.6, 0.6, 0.6}};
  Dynamics dynamics(model);
  dynamics.evaluate();
  Stepping stepping(model);
  const auto length_s = [&] { return stepping.next_span(dynamics, 1e-9, 1e-9).length_s; };
  stepping.begin_advance();
  for (int k = 0; k < Stepping::kMaxSteps; ++k) {
    ASSERT_GT(length_s(), 0) << k;
    ASSERT_EQ(stepping.failure(), Stepping::Failure::kNone) << k;
  }
  EXPECT_EQ(length_s(), 0);
  EXPECT_EQ(stepping.failure(), Stepping::Failure::kTooStiff);
  stepping.begin_advance();
  EXPECT_GT(length_s(), 0);
  EXPECT_EQ(stepping.failure(), Stepping::Failure::kNone);
}

}  // namespace
}  // namespace ballast::sim
