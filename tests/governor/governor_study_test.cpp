// Few runs of the searches of tools/docs/governor.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/governor/judged_run.h"
#include "tests/random_seed.h"

namespace ballast::governor_test {
namespace {

// Robots that are started by random seeds, and how many of them leave the cone without the governor.
template <class Run>
void expect_inside(int robots, std::uint64_t first, const Draw& kind, const Run& run) {
  int started = 0, broken_without = 0;
  for (std::uint64_t seed = first; started < robots && seed < first + 20 * static_cast<std::uint64_t>(robots); ++seed) {
    Draw draw = kind;
    draw.seed = seed;
    const Judged governed = run(draw, true);
    if (!governed.started) continue;
    ++started;
    EXPECT_FALSE(governed.broken) << "seed " << seed << ": " << governed.most_use;
    broken_without += run(draw, false).broken ? 1 : 0;
  }
  std::printf("%d started, %d left the cone without the governor\n", started, broken_without);
  EXPECT_EQ(started, robots);
}

TEST(GovernorStudy, IdealMassesStayInsideTheCone) {
  const std::uint64_t first = test::random_seed(1);
  expect_inside(15, first, {}, [](const Draw& draw, bool governed) { return run_ideal(draw, governed); });
}

TEST(GovernorStudy, SteppersStayInsideTheCone) {
  const std::uint64_t first = test::random_seed(1);
  Draw kind;
  kind.steppers = true;
  expect_inside(5, first, kind, [](const Draw& draw, bool governed) { return run_plant(draw, governed); });
}

// Masses off by 5 %, the shell's centre of mass by .5 % of the radius, both declared.
Draw uncertain() {
  Draw draw;
  draw.mass_error = 0.05;
  draw.center_error = 0.005;
  draw.declared = true;
  return draw;
}

TEST(GovernorStudy, DeclaredErrorsStayInsideTheCone) {
  const std::uint64_t first = test::random_seed(1);
  expect_inside(15, first, uncertain(), [](const Draw& draw, bool governed) { return run_ideal(draw, governed); });
}

TEST(GovernorStudy, NoRobotGoesFurtherAstrayThanSaid) {
  const std::uint64_t first = test::random_seed(1);
  Draw draw = uncertain();
  int rolled = 0;
  double part = 0;
  for (std::uint64_t seed = first; seed < first + 300; ++seed) {
    draw.seed = seed;
    const Astrayed found = lead_astray(draw);
    if (!found.rolled) continue;
    ++rolled;
    EXPECT_LE(found.over, 0) << "seed " << seed;
    part = std::max(part, found.part);
  }
  std::printf("%d rolled; closest: %.3f of the bound\n", rolled, part);
  EXPECT_GT(rolled, 200);
  EXPECT_GT(part, 0.5);  // a bound that is never approached would be of no use
}

TEST(GovernorStudy, PlansHoldFromAnyInstant) {
  const std::uint64_t first = test::random_seed(1);
  int forks = 0;
  for (std::uint64_t seed = first; seed < first + 20; ++seed) {
    Draw draw;
    draw.seed = seed;
    const Instants found = fork_at_instants(draw, 2);
    forks += found.forks;
    EXPECT_EQ(found.broken, 0) << "seed " << seed << ": " << found.worst_use;
    EXPECT_LE(found.near.worst, 0.02) << "seed " << seed;  // issue 22
    EXPECT_LE(found.for_ever.worst, 0.02) << "seed " << seed;
  }
  EXPECT_GT(forks, 10);
}

// Robots that left the cone, by what they did otherwise than their certificates. They are refused, or stay inside.
void expect_kept(const std::vector<std::uint64_t>& seeds, bool steppers) {
  for (const std::uint64_t seed : seeds) {
    Draw draw;
    draw.seed = seed;
    draw.steppers = steppers;
    const Judged judged = steppers ? run_plant(draw, true) : run_ideal(draw, true);
    EXPECT_FALSE(judged.started && judged.broken) << "seed " << seed << ": " << judged.most_use;
  }
}

// The tick's feedback was two ticks late, so bends of some time led away from the certified path.
TEST(GovernorStudy, FollowsTheCertifiedPath) {
  expect_kept({916, 2656}, false);
  expect_kept({206}, true);
}

// The certificate's commands changed faster than the tick's may.
TEST(GovernorStudy, CertifiesWhatTheTickCanDo) { expect_kept({323, 1143}, false); }

// The motors' errors are across a small friction.
TEST(GovernorStudy, KeepsFreeWhatTurnsTheFriction) { expect_kept({64, 257, 386}, true); }

// Masses that creep to rest still ring at each microstep: the tick kept that free, the certificate did not.
TEST(GovernorStudy, CertifiesTheEndOfTheBrake) { expect_kept({384}, true); }

// Masses that swing about their commands take the ball along: a certificate from the ball of one moment was off by more
// than it kept in reserve.
TEST(GovernorStudy, ReckonsWithSwingingMasses) { expect_kept({187, 1077, 1393, 1708, 2660, 2685, 2970}, true); }

// Certificates whose masses had to come to the cone's edge were adopted.
TEST(GovernorStudy, KeepsOffTheEdge) { expect_kept({3311, 10749, 10873, 19528, 23369}, false); }

// Masses faster than a bend may make them were to be slowed down at once, which no tick does.
TEST(GovernorStudy, SlowsMassesDownAsTheTickCan) { expect_kept({21425, 22614}, false); }

// Rounding left a stopped mass a speed, for which friction was kept free.
TEST(GovernorStudy, KnowsMassesThatHaveStopped) { expect_kept({1873}, true); }

// A mass that is bent as much as it brakes keeps its speed: the rollout took it for slower, and the robot was faster.
TEST(GovernorStudy, BrakesAsCertified) {
  Draw draw;
  draw.seed = 363;
  const Instants found = fork_at_instants(draw, 5);
  EXPECT_EQ(found.forks, 5);
  EXPECT_EQ(found.broken, 0) << found.worst_use;
}

// A part that is left out changes no other.
TEST(GovernorStudy, LeavesPartsOut) {
  Draw draw;
  draw.seed = 3;
  const sim::Scenario whole = random_robot(draw);
  draw.without = kSpin | kTurn;
  const sim::Scenario part = random_robot(draw);
  EXPECT_EQ(part.initial.angular_velocity_B_radps.norm(), 0);
  EXPECT_EQ(part.surface.static_friction, whole.surface.static_friction);
  EXPECT_EQ(part.masses[2].mass_kg, whole.masses[2].mass_kg);
  EXPECT_EQ(part.masses[2].motor.max_jerk, whole.masses[2].motor.max_jerk);
  EXPECT_EQ(to_string(draw.without), "turn,spin");
}

}  // namespace
}  // namespace ballast::governor_test
