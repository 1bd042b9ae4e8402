#include "firmware/model/affine_forces.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "firmware/model/rolling.h"
#include "tests/firmware/random_ball.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

// Some hundred operations on terms as large as `scale`, times the condition of the 3x3 system (below 10 here).
constexpr Real kRelative = 1e-12;

Real largest(const AffineForces& affine, int n, const PerMass<Real>& u) {
  Real scale = affine.force_W_n.norm() + affine.omega_dot_B_radps2.norm();
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    scale += std::fabs(u[i]) * (affine.force_per_unit[i].norm() + affine.omega_dot_per_unit[i].norm());
  }
  return scale;
}

// rolling_forces() is the judge: the closed form without the affine split.
void compare_with_closed_form(bool slopes, bool resists) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  int compared = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    testing::RandomBall c = testing::random_ball(random, slopes, resists);
    AffineForces affine;
    affine_forces(c.ball, c.orientation, c.angular_velocity_B_radps, c.masses, affine);
    const RollingForces forces = rolling_forces(c.ball, c.orientation, c.angular_velocity_B_radps, c.masses);
    const PerMass<Real>& u = c.masses.acceleration;
    const Vector3 force = affine.force(c.ball.mass_count, u);
    if (resists && !(forces.normal_force_n > 0)) continue;  // there the moment is dropped, which is not affine
    ++compared;
    const Real bound = kRelative * largest(affine, c.ball.mass_count, u);
    ASSERT_LE(std::fabs(force[2] - forces.normal_force_n), bound) << "trial " << trial;
    ASSERT_LE(std::fabs(force[0] - forces.friction_force_W_n[0]), bound) << "trial " << trial;
    ASSERT_LE(std::fabs(force[1] - forces.friction_force_W_n[1]), bound) << "trial " << trial;
    ASSERT_LE((affine.omega_dot(c.ball.mass_count, u) - forces.angular_acceleration_B_radps2).norm(), bound)
        << "trial " << trial;
  }
  EXPECT_GT(compared, 500);
}

TEST(AffineForces, EqualTheClosedFormOnALevelFloor) { compare_with_closed_form(false, false); }
TEST(AffineForces, EqualTheClosedFormOnASlope) { compare_with_closed_form(true, false); }
TEST(AffineForces, EqualTheClosedFormOnAFloorThatResists) { compare_with_closed_form(false, true); }
TEST(AffineForces, EqualTheClosedFormOnASlopeThatResists) { compare_with_closed_form(true, true); }

}  // namespace
}  // namespace ballast::firmware
